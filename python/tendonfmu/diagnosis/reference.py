"""What recordings of a reference and of now share, so that no change is credited with it.

The background is what a model gets wrong in both: a ridge regression on simple functions of angle, velocity, force,
acceleration and travel, separate for each joint, and on the columns of all candidates. Where a motion of the reference
was repeated exactly, aligned samples are subtracted instead, and almost nothing of these columns is left.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.signal import correlate

from tendonfmu.arrays import Array, Flags, Numbers
from tendonfmu.diagnosis.candidate_columns import CandidateColumns
from tendonfmu.diagnosis.remainder_features import Features, features
from tendonfmu.diagnosis.result import ChangedSize, SteadyLoad, with_error
from tendonfmu.diagnosis.samples import Series
from tendonfmu.model import moment_arms
from tendonfmu.statistics import Folds, gain_interval, make_folds

GROUPS = (
    "angle",
    "friction over angle",
    "velocity",
    "force",
    "friction over force",
    "acceleration",
    "travel",
    "memory of direction",
    "interaction",
)
USUAL = 0.3  # of the residual's standard deviation: expected size of one function
MISSING = 3.0  # times the residual's standard deviation: expected size of an effect that is missing in both
Rows = NDArray[np.int64]
SAME_ANGLES = 0.02  # of the angles' spread: a controller follows the same reference this closely
SAME_FORCES = 0.1  # of the forces: friction that grows with them then differs by as little
SHORTEST = 5.0  # s; least length that both motions share


def background_columns(
    data: Mapping[str, Any], series: Series, force: Numbers, columns: CandidateColumns, residual: Numbers, seed: int
) -> tuple[Array, Numbers]:
    """Return the columns [B, n, d], and the expected size of each weight [d]."""
    seen = features(series, force=force, seed=seed)
    arms = moment_arms(data)
    spread = residual[series.used].std(axis=0)
    parts, scales = [], []
    for joint in range(series.target.shape[1]):
        own = _of_joint(seen, joint, arms)
        block = np.zeros((*series.target.shape, len(own)), dtype=np.float32)
        block[:, joint] = seen.values[:, own]
        parts.append(block)
        scales.append(np.full(len(own), USUAL * max(float(spread[joint]), 1e-300)))
    parts.append(columns.values)
    deviation = (
        columns.values[series.used].astype(np.float64).std(axis=0).max(axis=0, initial=0.0)
    )  # where it is largest
    scales.append(MISSING * float(spread.max()) / np.maximum(deviation, 1e-300))
    return np.concatenate(parts, axis=2), np.concatenate(scales)


def _of_joint(seen: Features, joint: int, arms: Numbers) -> NDArray[np.int64]:
    """Return the functions of this joint, or of a tendon that turns it."""
    tendons = [f"tendon {i + 1}" for i in np.flatnonzero(arms[:, joint])]
    names = {f"joint {joint + 1}", *tendons, *(f"{tendon} at joint {joint + 1}" for tendon in tendons)}
    names.add("")  # several states together
    chosen = np.isin(seen.group, GROUPS) & np.isin(seen.subject, sorted(names))
    return np.asarray(np.flatnonzero(chosen), dtype=np.int64)


# --- repeated motions ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Repeat:
    """A motion that was repeated."""

    then: int  # recordings, by number
    now: int
    shift: float  # from a time in `then` to the same place of the motion in `now`, s
    begin: float  # times in `then` of what both share, s
    end: float


def find_repeats(series: Series, force: Numbers, then: Sequence[int], now: Sequence[int]) -> list[Repeat]:
    """Return the new recordings that follow the motion of a reference recording under the same load."""
    repeats = []
    for number in now:
        fits = [repeat for other in then if (repeat := _repeat(series, force, other, number)) is not None]
        if fits:
            repeats.append(max(fits, key=lambda fit: fit.end - fit.begin))
    return repeats


def less_reference(values: Array, series: Series, repeats: Sequence[Repeat]) -> Array:
    """Return values [B, ...] of the new recordings less those of the reference at the same place of the motion."""
    less = values.copy()
    for repeat in repeats:
        rows, first, share = _places(series, repeat)
        share = share.reshape(-1, *(1,) * (values.ndim - 1)).astype(values.dtype)
        less[rows] -= values[first] * (1 - share) + values[first + 1] * share
    return np.asarray(less)


def outside(series: Series, repeats: Sequence[Repeat]) -> Flags:
    """Return the blocks that add nothing to the differences [B]."""
    flags = np.isin(series.recording, [repeat.then for repeat in repeats])
    for repeat in repeats:
        rows, first, _ = _places(series, repeat)
        own = series.recording == repeat.now
        own[rows[series.used[first] & series.used[first + 1]]] = False
        flags |= own
    return flags


def _places(series: Series, repeat: Repeat) -> tuple[Rows, Rows, Numbers]:
    """Return blocks of the new recording, the reference block before each, and how far each is beyond that block."""
    then, now = (np.flatnonzero(series.recording == number) for number in (repeat.then, repeat.now))
    when = series.time[now] - repeat.shift
    inside = (when >= repeat.begin) & (when < repeat.end)
    first = np.searchsorted(series.time[then], when[inside], side="right") - 1
    first = np.clip(first, 0, len(then) - 2)
    begin = series.time[then][first]
    share = np.clip((when[inside] - begin) / (series.time[then][first + 1] - begin), 0.0, 1.0)
    return now[inside], then[first], share


# --- finding ----------------------------------------------------------------------------------------------------------


def _repeat(series: Series, force: Numbers, then: int, now: int) -> Repeat | None:
    rows = [series.recording == number for number in (then, now)]
    time, angle = ([values[row] for row in rows] for values in (series.time, series.angle))
    step = series.step
    if min(map(len, time)) * step < SHORTEST or any(np.diff(times).max() > 1.5 * step for times in time):
        return None
    for lag in _lags(angle[0], angle[1], math.ceil(SHORTEST / step)):
        begin, end = max(0, -lag), min(len(angle[0]), len(angle[1]) - lag)  # blocks that both have
        if (end - begin) * step < SHORTEST:
            continue
        one, other = angle[0][begin:end], angle[1][begin + lag : end + lag]
        spread = np.ptp(one, axis=0)
        apart = np.sqrt(np.mean((one - other) ** 2, axis=0))
        moves = spread > 1e-6
        if (
            moves.any()
            and (apart[moves] <= SAME_ANGLES * spread[moves]).all()
            and _same_load(force[rows[0]][begin:end], force[rows[1]][begin + lag : end + lag])
        ):
            shift = float(time[1][begin + lag] - time[0][begin])
            return Repeat(then, now, shift, float(time[0][begin]), float(time[0][end - 1]))
    return None


def _same_load(one: Numbers, other: Numbers) -> bool:
    apart = np.sqrt(np.mean((one - other) ** 2, axis=0))
    return bool((apart <= SAME_FORCES * np.sqrt(np.mean(one**2, axis=0))).all())


def _lags(one: Numbers, other: Numbers, fewest: int) -> Iterator[int]:
    """Yield possible delays of the second motion, in blocks: none, and that by which both differ least."""
    yield 0
    one, other = (motion / np.maximum(np.ptp(other, axis=0), 1e-300) for motion in (one, other))
    lags = np.arange(1 - len(one), len(other))
    begin, end = np.maximum(0, -lags), np.minimum(len(one), len(other) - lags)
    sums, others = (np.concatenate([[0.0], np.cumsum(np.sum(motion**2, axis=1))]) for motion in (one, other))
    apart = sums[end] - sums[begin] + others[end + lags] - others[begin + lags]
    for a, b in zip(one.T, other.T, strict=True):
        apart -= 2.0 * correlate(b, a, method="fft")
    yield int(lags[np.argmin(np.where(end - begin >= fewest, apart / (end - begin), np.inf))])


# --- a steady load ----------------------------------------------------------------------------------------------------


BEYOND = 2.0  # times what the reference itself leaves about its level, or the distance between its recordings
OTHER_SIDE = 0.01  # largest share of stretches whose mean is on the other side


def steady_load(series: Series, left: Numbers, is_now: Flags, seed: int = 0) -> SteadyLoad | None:
    """Return the load at the joint where it is largest; None if no level moved beyond the reference's scatter."""
    sides = [make_folds(replace(series, used=series.used & side)) for side in (~is_now, is_now)]
    if min(folds.stretches for folds in sides) < 2:
        return None
    then, now = ([_Side.of(series, values, folds) for values in left.T] for folds in sides)
    pairs = enumerate(zip(then, now, strict=True))
    loads = [load for joint, (one, other) in pairs if (load := _at(joint, one, other, seed)) is not None]
    best = max(loads, key=lambda load: abs(load.size.change.value), default=None)
    return best and replace(best, p_value=min(1.0, best.p_value * left.shape[1]))


@dataclass(frozen=True)
class _Side:
    """The mean torque of one side."""

    level: float  # mean, N·m
    spread: float  # rms about the level, N·m
    apart: float  # largest distance of a recording's mean from the level, N·m
    means: Numbers  # by stretch of 2 s
    squares: Numbers
    counts: Numbers

    @staticmethod
    def of(series: Series, values: Numbers, folds: Folds) -> _Side:
        own, recording = values[folds.rows], series.recording[folds.rows]
        level = float(own.mean())
        apart = max(abs(float(own[recording == k].mean()) - level) for k in np.unique(recording))
        counts = np.bincount(folds.stretch, minlength=folds.stretches).astype(np.float64)
        sums, squares = (np.bincount(folds.stretch, own**k, minlength=folds.stretches) for k in (1, 2))
        return _Side(level, float(own.std()), apart, np.asarray(sums / counts), np.asarray(squares), counts)

    @property
    def error(self) -> float:
        """Standard error of the level."""
        return float(np.std(self.means, ddof=1) / np.sqrt(len(self.means)))

    def about(self, level: float) -> Numbers:
        """Return Σ (x − level)² by stretch [K]."""
        return np.asarray(self.squares - 2.0 * level * self.means * self.counts + level**2 * self.counts)


def _at(joint: int, then: _Side, now: _Side, seed: int) -> SteadyLoad | None:
    moved = now.level - then.level
    if abs(moved) <= BEYOND * max(then.spread, then.apart):
        return None
    if float(np.mean(np.sign(now.means - then.level) != np.sign(moved))) > OTHER_SIDE:
        return None
    gain = gain_interval(now.about(then.level), now.about(now.level), seed)
    if not gain.low > 0.0:  # NaN where too little is left to say
        return None
    error = float(np.hypot(then.error, now.error))
    levels = (with_error(then.level, then.error), with_error(now.level, now.error), with_error(moved, error))
    size = ChangedSize("torque", "N.m", *levels)
    p_value = float(stats.ttest_ind(then.means, now.means, equal_var=False).pvalue)
    return SteadyLoad(joint + 1, size, gain, p_value)


# --- parts ------------------------------------------------------------------------------------------------------------


def folds_of_sides(series: Series, is_now: Flags) -> tuple[Folds, Flags]:
    """Return parts of the new recordings, then of the reference, and which of them are of the new ones [f]."""
    now, then = (make_folds(replace(series, used=series.used & side)) for side in (is_now, ~is_now))
    return _joined(now, then), np.arange(now.folds + then.folds) < now.folds


def folds_of_unseen(series: Series, unseen: Flags) -> tuple[Folds, Flags]:
    """Return unseen blocks as one part and all others as the other, and that only the first is judged [2]."""
    both = [make_folds(replace(series, used=series.used & side)) for side in (unseen, ~unseen)]
    one, other = (replace(folds, fold=np.zeros_like(folds.fold), folds=1) for folds in both)
    return _joined(one, other), np.array([True, False])


def _joined(one: Folds, other: Folds) -> Folds:
    return Folds(
        rows=np.concatenate([one.rows, other.rows]),
        run=np.concatenate([one.run, other.run + 1 + one.run.max(initial=-1)]),
        stretch=np.concatenate([one.stretch, other.stretch + one.stretches]),
        fold=np.concatenate([one.fold, other.fold + one.folds]),
        stretches=one.stretches + other.stretches,
        folds=one.folds + other.folds,
    )
