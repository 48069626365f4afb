"""The best that a detector could do with a given residual: one that knows each push beforehand.

It knows when a push comes, how the finger would have moved, and either the true torque of the push behind the bias
filter or its effect on the residual (the difference from the twin); the only question is whether it is there. The free
residual is taken as a Gaussian process, stationary in each of three states. The likelihood ratio is then linear in the
residual x: wᵀ x with C w = s, s the known signal and C the covariance of the free recordings (Kay, *Fundamentals of
Statistical Signal Processing: Detection Theory*, 1998, sect. 4.4). The threshold is what wᵀ x exceeds once in 10 min of
the free recordings. Where free residuals have outliers, one that is not linear can still do better.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from evidence.detection.hand import PRETENSIONS, TWINS, Take, read_truth, recording, states, takes
from evidence.detection.rivals import Detector, HighPass
from evidence.fingers.matched_strength import averaged
from evidence.runner import say, write
from tendonfmu.arrays import Flags, Indices, Numbers

STEP = 0.01  # s, of the means
BEFORE = 0.1  # s of the window before the onset: what the noise did there says what it does next
WINDOWS = (0.04, 0.3)  # s from the onset until it decides; every push is held for 0.3 s
STATES = ("rest", "motion", "setting off")  # as `states` counts them
KINDS = ("torque", "effect")  # that it knows
APART = 10  # means; excesses closer than this are one false alarm
SHRINKAGE = 0.01  # of the covariance towards its diagonal
PER_SECOND = 1.0 / 600.0  # false alarms
_ROWS = 20_000  # windows in one product

Push = dict[str, Any]


def name_of(kind: str, after: float) -> str:
    return f"matched, {kind} known, {1e3 * after:.0f} ms"


def matched_findings(folder: Path, reference: Detector, pushes: Sequence[Push], parts: int) -> dict[str, list[float]]:
    """Of every push whether it is found, by window and kind of knowledge; kept in the folder."""
    file = folder / f"matched_{reference.name}.json"
    if file.exists():
        return dict(json.loads(file.read_text(encoding="utf-8")))
    results = {name_of(kind, after): np.zeros(len(pushes)) for after in WINDOWS for kind in KINDS}
    for pretension in PRETENSIONS:
        quiet = takes("free", parts=parts, pretensions=(pretension,))
        pushed = takes(*TWINS, parts=parts, pretensions=(pretension,))
        free = [_means(residual, _rate(time)) for time, residual in (_residual(folder, reference, t) for t in quiet)]
        signals = [push_signals for take in pushed for push_signals in _signals(folder, reference, take, pushes)]
        of_pretension = np.flatnonzero([push["pretension"] == pretension for push in pushes])
        for after in WINDOWS:
            still = [_states(folder, reference, take, after) for take in quiet]
            at_onset = np.concatenate([_states_at_onsets(folder, reference, take, pushes, after) for take in pushed])
            for state, words in enumerate(STATES):
                chosen = np.flatnonzero(at_onset == state)
                if not len(chosen):
                    continue
                in_state = [
                    Quiet(residual, own_state == state) for residual, own_state in zip(free, still, strict=True)
                ]
                passed, limit = findings(in_state, [signals[k] for k in chosen], after)
                for kind in KINDS:
                    results[name_of(kind, after)][of_pretension[chosen]] = passed[kind]
                where = f"{pretension:g} N, {1e3 * after:.0f} ms, {words}, {len(chosen)} pushes"
                say(f"matched detector, {where}: limit of {limit:.1f} standard deviations")
    write(file, results)
    return {name: values.tolist() for name, values in results.items()}


# --- signals of a recording -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Signals:
    """What a push does: [N, n] N·m each, means from `BEFORE` before the onset."""

    torque: Numbers  # external, behind the bias filter
    effect: Numbers  # residual less that of the twin
    residual: Numbers  # with the push


@dataclass(frozen=True)
class Quiet:
    """A free recording."""

    residual: Numbers  # [N, n] N·m, means
    chosen: Flags  # [N] whether the finger is in the state in question


def _residual(folder: Path, reference: Detector, take: Take) -> tuple[Numbers, Numbers]:
    """(time, residual)."""
    inputs = reference.inputs(recording(folder, take))
    return inputs["time"], reference.residual(inputs)


def _states(folder: Path, reference: Detector, take: Take, after: float) -> Indices:
    """[N] of every mean: the state at its middle."""
    truth = read_truth(folder, take)
    rate, threshold = _rate(truth["time"]), float(reference.description["velocity_threshold"]["joint"])
    size = round(STEP * rate)
    return states(truth["joint_velocity"], rate, threshold, after)[size // 2 :: size]


def _states_at_onsets(folder: Path, reference: Detector, take: Take, pushes: Sequence[Push], after: float) -> Indices:
    """[k] at the onsets of a recording's pushes, had there been none."""
    of_twin = _states(folder, reference, take.twin, after)
    return of_twin[[int(push["onset"] / STEP) for push in pushes if _is_of(push, take)]]


def _signals(folder: Path, reference: Detector, take: Take, pushes: Sequence[Push]) -> list[Signals]:
    (time, with_push), (_, without) = (_residual(folder, reference, which) for which in (take, take.twin))
    passed = HighPass.of(reference.description, time, recording(folder, take).groups["tendon_force"])
    torque = read_truth(folder, take)["external_torque"]
    signals = []
    for push in (push for push in pushes if _is_of(push, take)):
        begin = np.searchsorted(time, push["onset"] - 0.5)
        of_push = np.where((time >= push["onset"] - 0.1)[:, None], torque, 0.0)  # nothing of the push before
        filtered = np.zeros_like(torque)
        part = slice(int(begin), int(begin) + round(1.5 * _rate(time)))
        filtered[part] = passed(of_push[part])
        signals.append(
            Signals(*(_cut(array, time, push["onset"]) for array in (filtered, with_push - without, with_push)))
        )
    return signals


def _is_of(push: Push, take: Take) -> bool:
    return all(push[key] == getattr(take, key) for key in ("kind", "pretension", "part"))


def _rate(time: Numbers) -> float:
    return 1.0 / float(np.median(np.diff(time)))


def _means(signals: Numbers, rate: float) -> Numbers:
    """[N/k, n] means over `STEP`."""
    return averaged(signals, round(STEP * rate))


def _cut(signals: Numbers, time: Numbers, onset: float) -> Numbers:
    """[l, n] means from `BEFORE` before an onset to the end of the longest window."""
    rate = _rate(time)
    first = int(np.searchsorted(time, onset - 1e-9)) - round(BEFORE * rate)
    count = round((BEFORE + max(WINDOWS)) / STEP) * round(STEP * rate)
    return _means(signals[first : first + count], rate)


# --- the detector -----------------------------------------------------------------------------------------------------


def findings(free: Sequence[Quiet], asked: Sequence[Signals], after: float) -> tuple[dict[str, Flags], float]:
    """Which pushes a window that ends `after` s after the onset finds, by what is known; the limit of torques."""
    # free: all free recordings of a pretension; asked: pushes whose onset is in the same state; limit: in deviations of
    # the statistic, the median of what is exceeded once in 10 min: 4.15 where it is Gaussian
    length = round((BEFORE + after) / STEP)
    windows = [_windows(quiet.residual, length) for quiet in free]
    before = round(BEFORE / STEP)
    chosen = [quiet.chosen[before : before + len(part)] for quiet, part in zip(free, windows, strict=True)]
    factor = cho_factor(_covariance(windows, chosen))
    seen = np.array([push.residual[:length].ravel() for push in asked])
    passed, limits = dict[str, Flags](), dict[str, Numbers]()
    for kind in KINDS:
        templates = np.array([getattr(push, kind)[:length].ravel() for push in asked])
        weights = cho_solve(factor, templates.T).T
        weights /= np.sqrt(np.maximum(np.sum(weights * templates, axis=1), 1e-30))[:, None]  # of unit deviation
        limits[kind] = _limits(windows, chosen, weights)
        passed[kind] = np.sum(weights * seen, axis=1) > limits[kind]
    return passed, float(np.median(limits["torque"]))


def _windows(values: Numbers, length: int) -> Numbers:
    """[N − length + 1, length, n], a view."""
    return np.moveaxis(np.lib.stride_tricks.sliding_window_view(values, length, axis=0), 2, 1)


def _covariance(windows: Sequence[Numbers], chosen: Sequence[Flags]) -> Numbers:
    """[d, d], of all chosen windows, about 0."""
    dimension = windows[0].shape[1] * windows[0].shape[2]
    total, count = np.zeros((dimension, dimension)), 0
    for part, wanted in zip(windows, chosen, strict=True):
        for begin in range(0, len(part), _ROWS):
            rows = part[begin : begin + _ROWS][wanted[begin : begin + _ROWS]].reshape(-1, dimension)
            total += rows.T @ rows
            count += len(rows)
    covariance = total / count
    return np.asarray((1 - SHRINKAGE) * covariance + SHRINKAGE * np.diag(np.diag(covariance)))


def _limits(windows: Sequence[Numbers], chosen: Sequence[Flags], weights: Numbers) -> Numbers:
    """[k] what each statistic exceeds as often as false alarms are allowed, excesses close to each other being one."""
    statistics = []
    for part, wanted in zip(windows, chosen, strict=True):
        blocks = (part[begin : begin + _ROWS] for begin in range(0, len(part), _ROWS))
        values = np.concatenate([block.reshape(len(block), -1) @ weights.T for block in blocks])
        values[~wanted] = -np.inf
        statistics.append(values)
    allowed = int(PER_SECOND * STEP * sum(int(wanted.sum()) for wanted in chosen) + 0.5)
    return np.array([_limit([values[:, k] for values in statistics], allowed) for k in range(len(weights))])


def _limit(statistics: Sequence[Numbers], allowed: int) -> float:
    """The lowest level that is exceeded no more than `allowed` times: that of the next highest separate peak."""
    peaks = []
    for values in statistics:
        blocks = values[: len(values) // APART * APART].reshape(-1, APART).max(axis=1)
        higher = blocks.copy()  # neighbouring blocks of one excess count once
        inner = (blocks[1:-1] >= blocks[:-2]) & (blocks[1:-1] > blocks[2:])
        higher[1:-1][~inner] = -np.inf
        peaks.append(higher)
    ranked = np.sort(np.concatenate(peaks))[::-1]
    return float(ranked[allowed])
