"""Learns the numbers of `contact.bands` from free motion (docs/reference/commands/tune.md).

A bound is the root of a weighted sum of squares (docs/reference/semantics/detection.md). The weights come from a gamma
likelihood, one level for each joint and band from the tail of the largest ratios, and a factor on all of them from runs
of the finger as it will be. Each recording is judged with numbers that were learned from the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import genpareto

from tendonfmu.arrays import Array, Data, Flags, Indices, Numbers, rounded
from tendonfmu.detect.free_motion import FreePart
from tendonfmu.model import finger_of, native

# --- terms of a bound -------------------------------------------------------------------------------------------------


NAMES = ("noise", "friction", "friction_limit", "motor_load", "friction_change", "friction_reserve")
BANDS = 4
CELL = 0.01  # s, of which only the sample with the largest distance counts, by joint and band
_NEVER = 1e6  # N·m, a noise that no residual exceeds
_BLOCK = 50_000  # samples at once: the terms are 32 numbers for each joint
_KEPT = ("residual", "compensated_torque_std")


Signal = NDArray[np.float32]  # saves memory for millions of samples


@dataclass(frozen=True)
class Terms:
    """Distances and squared terms of a stretch of free motion, by cell, joint and band."""

    level: Signal  # [c, n, 4] the distance that decides: the lesser of those from m and from the slow mean (N·m)
    squares: Signal  # [c, n, 4, 6] of 1, |T|, B, D, min(|ΔT|, D), min(S, D_3)
    time: Numbers  # [c] (s)


def terms_of(time: Numbers, values: Numbers, counted: Flags) -> Terms:
    """Reduce the output `contact_terms` [N, n, 4, 8] to cells; samples that do not count are left out."""
    rows = np.flatnonzero(counted)
    if not len(rows):
        empty = np.zeros((0, *values.shape[1:3]), dtype=np.float32)
        return Terms(empty, np.zeros((*empty.shape, len(NAMES)), dtype=np.float32), np.zeros(0))
    first = begins(np.floor(time[rows] / CELL + 1e-6))
    farthest = rows[largest(np.abs(values[rows, :, :, 1]), first)]
    picked = np.take_along_axis(values, farthest[..., None], axis=0).astype(np.float32)
    return Terms(picked[..., 1], picked[..., 2:] ** 2, time[rows[first]])


def begins(number: Numbers) -> Indices:
    """Return the first index of each run of equal numbers."""
    return np.flatnonzero(np.diff(number, prepend=np.nan) != 0)


def largest(values: Numbers | Signal, first: Indices) -> Indices:
    """Return the index of the largest value along axis 0 in each block that begins at `first`."""
    most = np.repeat(np.maximum.reduceat(values, first, axis=0), np.diff(np.append(first, len(values))), axis=0)
    index = np.arange(len(values)).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(np.minimum.reduceat(np.where(values == most, index, len(values)), first, axis=0))


def run_free(data: Data, parts: Sequence[FreePart]) -> tuple[list[Terms], list[dict[str, Array]]]:
    """Run the finger over every part with nothing in contact; return terms, and residual and std [N, n] (N·m)."""
    finger = finger_of(_without_contact(data, parts)).instance(parts[0].kinematics)
    start = finger.save_state()
    terms, kept = [], []
    for part in parts:
        finger.restore_state(start)
        pieces, outputs = [], []
        for begin in range(0, len(part.time), _BLOCK):
            rows = slice(begin, begin + _BLOCK)
            with native.refusals_of(part.source):
                run = finger.run({name: values[rows] for name, values in part.arrays.items()}, terms=True)
            pieces.append(terms_of(part.time[rows], run["contact_terms"], part.counted[rows]))
            outputs.append({name: run[name] for name in _KEPT})
        terms.append(Terms(*(np.concatenate([getattr(piece, name) for piece in pieces]) for name in vars(pieces[0]))))
        kept.append({name: np.concatenate([each[name] for each in outputs]) for name in _KEPT})
    return terms, kept


def _without_contact(data: Data, parts: Sequence[FreePart]) -> dict[str, Any]:
    """Return the description with bounds that nothing exceeds."""
    joints = len(data["joints"])
    contact: dict[str, Any] = {"threshold": [_NEVER] * joints, **motors_of(parts)}
    return {**data, "contact": {**contact, "method": "bands", "bands": [{"noise": [_NEVER] * joints}] * BANDS}}


def motors_of(parts: Sequence[FreePart]) -> dict[str, bool]:
    """Return the key that makes bounds use the tendon positions, if all parts have them."""
    known = all(np.isfinite(part.arrays.get("tendon_position", np.nan)).all() for part in parts)
    return {"watches_motors": True} if known else {}


def bands_of(numbers: Numbers, digits: int = 4) -> list[dict[str, list[float]]]:
    """Return `contact.bands` of numbers [n, 4, 6]; what is 0 at all joints is left out."""
    return [
        {name: rounded(numbers[:, k, p], digits) for p, name in enumerate(NAMES) if numbers[:, k, p].any()}
        for k in range(numbers.shape[1])
    ]


BLOCK = 0.5  # s, of which only the largest ratio shapes a bound: most samples are far below any
ROUNDS = 3  # of choosing the largest ratios by the weights, and the weights by them
_MOST = 20_000  # cells for the first weights
_LEAST = 1e-6  # of the mean square: a smaller part of a bound is left out
_LEAST_NOISE = 0.02  # of the rms distance: the noise is above 0
TAIL, ENOUGH = 0.05, 30  # share of the seconds whose maxima are the tail, and least number for its shape
FACTORS = 0.85  # from one factor to the next
HIGHEST, LOWEST = 20.0, 0.1
SEEN = 20  # alarms at the lowest factor that is tried, or three times those asked for
SLOPE = (-25.0, -1.0)  # of the log of the alarms over the log of the factor


# --- weights and levels -----------------------------------------------------------------------------------------------


def weights_of(parts: Sequence[Terms]) -> Numbers:
    """Learn the weights [n, 4, 6] of the squared terms, each joint and band alone."""
    block = np.concatenate([np.floor(part.time / BLOCK) + 1e9 * k for k, part in enumerate(parts)])
    first = begins(block)
    level, squares = (np.concatenate([getattr(part, name) for part in parts]) for name in ("level", "squares"))
    weights = np.zeros(squares.shape[1:])
    for j, k in np.ndindex(*weights.shape[:2]):
        y, z = level[:, j, k].astype(float) ** 2, squares[:, j, k].astype(float)
        few = slice(None, None, max(1, len(y) // _MOST))
        weights[j, k] = gamma_weights(y[few], z[few])
        for _ in range(ROUNDS):
            top = largest(y / (z @ weights[j, k]), first)
            weights[j, k] = gamma_weights(y[top], z[top])
    return weights


def gamma_weights(square: Numbers, terms: Numbers) -> Numbers:
    """Return w ≥ 0 [6] with the least mean of log v + y²/v, v = Z·w, for squares y² [c] and squared terms Z [c, 6]."""
    scale, size = terms.mean(axis=0), max(float(square.mean()), 1e-30)
    used = np.flatnonzero(scale > 0)
    z, y = terms[:, used] / scale[used], square / size

    def loss(log_weight: Numbers) -> tuple[float, Numbers]:
        weight = np.exp(log_weight)
        v = z @ weight + _LEAST
        return float(np.mean(np.log(v) + y / v)), (z * (1 / v - y / v**2)[:, None]).mean(axis=0) * weight

    even = np.full(len(used), -np.log(len(used)))
    starts = (even, even + np.where(used == 0, 2.0, -2.0))
    ends = [minimize(loss, start, jac=True, method="L-BFGS-B", bounds=[(-30.0, 10.0)] * len(used)) for start in starts]
    share = np.exp(min(ends, key=lambda end: float(end.fun)).x)
    weights = np.zeros(terms.shape[1])
    weights[used] = np.where(share > _LEAST, share, 0.0) * size / scale[used]
    weights[0] = max(weights[0], _LEAST_NOISE**2 * size)
    return weights


def seconds_of(parts: Sequence[Terms], weights: Numbers) -> Numbers:
    """Return the largest ratio of level to bound in each second [s, n, 4]."""
    maxima = []
    for part in parts:
        ratio = np.abs(part.level) / np.sqrt(np.einsum("cjkp,jkp->cjk", part.squares, weights))
        if len(ratio):
            maxima.append(np.maximum.reduceat(ratio, begins(np.floor(part.time)), axis=0))
    return np.concatenate(maxima)


def levels_of(maxima: Numbers, rate: float) -> Numbers:
    """Return by joint and band [n, 4] the ratio that is exceeded at an equal share of the rate (1/h)."""
    # maxima: [s, n, 4] of each second
    levels = np.zeros(maxima.shape[1:])
    expected = rate * len(maxima) / 3600.0 / levels.size
    for j, k in np.ndindex(*levels.shape):
        ordered = np.sort(maxima[:, j, k])
        tail = max(int(TAIL * len(ordered)), min(ENOUGH, len(ordered) // 2), 1)
        over = ordered[-tail:] - ordered[-tail - 1 if len(ordered) > tail else 0]
        shape, scale = 0.0, max(float(over.mean()), 1e-12)
        if tail >= ENOUGH:
            shape, _, scale = genpareto.fit(over[over > 0], floc=0)
        share = min(expected / tail, 1.0)
        levels[j, k] = ordered[-tail] - over[0] + genpareto.ppf(1.0 - share, min(max(shape, 0.0), 0.5), 0.0, scale)
    return levels


# --- the finger as it runs --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ClosedLoop:
    """What was found with bounds times a factor, each group [g] with numbers that were learned from the others."""

    factor: float  # at which the rate is found
    tried: Numbers  # [f] factors
    alarms: Indices  # [f, g] alarms at them
    kept_out: Numbers  # [g] factor that the other groups alone ask for


def close_the_loop(count: Callable[[int, float], int], hours: Numbers, rate: float) -> ClosedLoop:
    """Find the factor for a rate (1/h); `count` runs a group with a factor, and returns its alarms."""
    groups, asked = range(len(hours)), rate * float(hours.sum())
    rows: dict[float, list[int]] = {}

    def alarms(factor: float) -> int:
        rows[factor] = [count(group, factor) for group in groups]
        return sum(rows[factor])

    factor = 1.0 / FACTORS**2
    while alarms(factor) > asked and factor < HIGHEST:
        factor /= FACTORS**2
    factor = min(rows) * FACTORS
    while factor > LOWEST and alarms(factor) < max(SEEN, 3.0 * asked):
        factor *= FACTORS
    tried = np.array(sorted(rows, reverse=True))
    counts = np.array([rows[factor] for factor in tried])
    others = [_factor_for(tried, counts.sum(axis=1) - counts[:, g], rate * (hours.sum() - hours[g])) for g in groups]
    return ClosedLoop(_factor_for(tried, counts.sum(axis=1), asked), tried, counts, np.array(others))


def _factor_for(factors: Numbers, alarms: Numbers, asked: float) -> float:
    """Return the factor with so many alarms by Poisson regression of alarms [f] on the log of the factor."""
    if not alarms.any():
        return float(factors.min())
    x = np.log(factors)

    def loss(line: Numbers) -> tuple[float, Numbers]:
        mean = np.exp(np.clip(line[0] + line[1] * x, -50.0, 50.0))
        left = mean - alarms
        return float(np.sum(mean - alarms * np.log(mean))), np.array([left.sum(), left @ x])

    start = np.array([np.log(alarms.max()) + 8.0 * x[np.argmax(alarms)], -8.0])
    line = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=[(None, None), SLOPE]).x
    return float(np.clip(np.exp((np.log(asked) - line[0]) / line[1]), factors.min(), HIGHEST))


def numbers_of(weights: Numbers, levels: Numbers) -> Numbers:
    """Return the numbers [n, 4, 6] of the bands."""
    return np.asarray(levels[..., None] * np.sqrt(weights))
