"""The best that a detector could do with a given residual: one that knows each push beforehand.

Of every push it knows when it comes, what it does to the residual of all joints, and how the finger would have moved;
the only question is whether it is there. The free residual is taken as a Gaussian process, coloured, and stationary in
each of three states: at rest, in motion, and while a joint sets off, which is where models of friction fail most. The
covariances C are those of the free recordings of the same pretension, over windows of all joints at 100 Hz (means of
10 ms), from 0.1 s before the onset to some time after it. The likelihood ratio is then linear in the
residual x: wᵀ x with C w = s, s the known signal, and it passes a threshold u with probability Φ(d − u),
d² = sᵀ C⁻¹ s (Kay, *Fundamentals of Statistical Signal Processing: Detection Theory*, 1998, sect. 4.4).

It is given three ways:

- *theory*: u by the Gaussian tail for one false alarm in 10 min, 100 tests a second taken as independent; s is the true
  external torque behind the bias filter. As optimistic as it gets: friction lets all of the torque through, and the
  residual has no outliers.
- *torque known*: the same s, but u is what wᵀ x exceeds once in 10 min of the free recordings themselves, and x is what
  was left of the push in the residual.
- *effect known*: likewise, with s the difference of the residual with and without the push (the twin recording), after
  friction took its part. This is what is left to be found.

A detector that must find out when, where and in which direction somebody pushes asks all these questions at once, at
the same rate of false alarms. Where free residuals have outliers, as here, one that is not linear, or that knows more
of the motion than these states, can still do better than the last two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import norm

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]

STEP = 0.01  # s, of the means
BEFORE = 0.1  # s of the window before the onset: what the noise did there says what it does next
APART = 10  # means; excesses closer than this are one false alarm
SHRINKAGE = 0.01  # of the covariance towards its diagonal
PER_SECOND = 1.0 / 600.0  # false alarms
_ROWS = 20_000  # windows in one product


@dataclass(frozen=True)
class Asked:
    """One push: [N, n] N·m each, means from `BEFORE` before the onset.

    torque: the external torque behind the bias filter. effect: residual less that of the twin. residual: with the push.
    """

    torque: Numbers
    effect: Numbers
    residual: Numbers


@dataclass(frozen=True)
class Quiet:
    """A free recording. residual: [N, n] N·m, means. chosen: [N] whether the finger is in the state in question."""

    residual: Numbers
    chosen: Flags


@dataclass(frozen=True)
class Answer:
    """Of a window that ends `after` s after the onset, by push [k].

    theory: probability of detection. torque_known, effect_known: passed or not. limit: the median of what the
    statistics of known torques exceed once in 10 min, in their standard deviations; Gaussian ones would 4.15.
    """

    after: float
    theory: Numbers
    torque_known: Flags
    effect_known: Flags
    limit: float


def means(signals: Numbers, rate: float) -> Numbers:
    """[N/k, n] means over `STEP`."""
    size = round(STEP * rate)
    whole = len(signals) // size * size
    return np.asarray(signals[:whole].reshape(-1, size, signals.shape[1]).mean(axis=1))


def cut(signals: Numbers, time: Numbers, onset: float, longest: float) -> Numbers:
    """[l, n] means from `BEFORE` before an onset to `longest` after it. time: [N] s, evenly."""
    rate = 1.0 / float(np.median(np.diff(time)))
    first = int(np.searchsorted(time, onset - 1e-9)) - round(BEFORE * rate)
    count = round((BEFORE + longest) / STEP) * round(STEP * rate)
    return means(signals[first : first + count], rate)


def answer(free: Sequence[Quiet], asked: Sequence[Asked], after: float) -> Answer:
    """free: all free recordings of a pretension. asked: pushes whose onset is in the same state."""
    length = round((BEFORE + after) / STEP)
    windows = [_windows(each.residual, length) for each in free]
    before = round(BEFORE / STEP)
    chosen = [each.chosen[before : before + len(part)] for each, part in zip(free, windows, strict=True)]
    factor = cho_factor(_covariance(windows, chosen))
    seen = np.array([each.residual[:length].ravel() for each in asked])
    found: dict[str, tuple[Flags, Numbers, Numbers]] = {}
    for kind in ("torque", "effect"):
        templates = np.array([getattr(each, kind)[:length].ravel() for each in asked])
        weights = cho_solve(factor, templates.T).T
        distances = np.sqrt(np.maximum(np.sum(weights * templates, axis=1), 1e-30))
        weights /= distances[:, None]  # of unit deviation
        limits = _limits(windows, chosen, weights)
        found[kind] = np.sum(weights * seen, axis=1) > limits, distances, limits
    limit = float(norm.isf(PER_SECOND * STEP))
    passed, distances, limits = found["torque"]
    return Answer(after, np.asarray(norm.sf(limit - distances)), passed, found["effect"][0], float(np.median(limits)))


def _windows(values: Numbers, length: int) -> Numbers:
    """[N − length + 1, length, n], a view."""
    return np.moveaxis(np.lib.stride_tricks.sliding_window_view(values, length, axis=0), 2, 1)


def _covariance(windows: Sequence[Numbers], chosen: Sequence[Flags]) -> Numbers:
    """[d, d], of all chosen windows, about 0."""
    dimension = windows[0].shape[1] * windows[0].shape[2]
    total, count = np.zeros((dimension, dimension)), 0
    for each, wanted in zip(windows, chosen, strict=True):
        for begin in range(0, len(each), _ROWS):
            rows = each[begin : begin + _ROWS][wanted[begin : begin + _ROWS]].reshape(-1, dimension)
            total += rows.T @ rows
            count += len(rows)
    found = total / count
    return np.asarray((1 - SHRINKAGE) * found + SHRINKAGE * np.diag(np.diag(found)))


def _limits(windows: Sequence[Numbers], chosen: Sequence[Flags], weights: Numbers) -> Numbers:
    """[k] what each statistic exceeds as often as false alarms are allowed, excesses close to each other being one."""
    statistics = []
    for each, wanted in zip(windows, chosen, strict=True):
        parts = (each[begin : begin + _ROWS] for begin in range(0, len(each), _ROWS))
        found = np.concatenate([part.reshape(len(part), -1) @ weights.T for part in parts])
        found[~wanted] = -np.inf
        statistics.append(found)
    allowed = int(PER_SECOND * STEP * sum(int(wanted.sum()) for wanted in chosen) + 0.5)
    return np.array([_limit([each[:, k] for each in statistics], allowed) for k in range(len(weights))])


def _limit(statistics: Sequence[Numbers], allowed: int) -> float:
    """The lowest level that is exceeded no more than `allowed` times: that of the next highest separate peak."""
    peaks = []
    for each in statistics:
        blocks = each[: len(each) // APART * APART].reshape(-1, APART).max(axis=1)
        higher = blocks.copy()  # neighbouring blocks of one excess count once
        inner = (blocks[1:-1] >= blocks[:-2]) & (blocks[1:-1] > blocks[2:])
        higher[1:-1][~inner] = -np.inf
        peaks.append(higher)
    ranked = np.sort(np.concatenate(peaks))[::-1]
    return float(ranked[allowed])
