"""Whether a torque is present all the time now that was not in the reference: a load, a touch, or a sensor's zero."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.diagnosis.cause import ChangedSize, with_error
from tendonfmu.diagnosis.result import SteadyLoad
from tendonfmu.diagnosis.series import Series
from tendonfmu.statistics import gain_interval, make_folds

BEYOND = 2.0  # times what the reference itself leaves about its level, or the distance between its recordings
LEVEL = 0.01  # largest share of stretches whose mean is on the other side


def steady_load(series: Series, left: Numbers, is_now: Flags, seed: int = 0) -> SteadyLoad | None:
    """Return the load at the joint where it is largest; None if no level moved beyond the reference's scatter."""
    loads = []
    for joint in range(left.shape[1]):
        then, now = (_Side.of(series, left[:, joint], series.used & side) for side in (~is_now, is_now))
        if min(len(then.means), len(now.means)) < 2:
            continue
        load = _at(joint, then, now, seed)
        if load is not None:
            loads.append(load)
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
    def of(series: Series, values: Numbers, used: Flags) -> _Side:
        rows = np.flatnonzero(used)
        if not len(rows):
            return _Side(0.0, 0.0, 0.0, np.zeros(0), np.zeros(0), np.zeros(0))
        own = values[rows]
        level = float(own.mean())
        by_recording = [float(own[series.recording[rows] == k].mean()) for k in np.unique(series.recording[rows])]
        folds = make_folds(replace(series, used=used))
        counts = np.bincount(folds.stretch, minlength=folds.stretches).astype(np.float64)
        sums = [np.bincount(folds.stretch, values[folds.rows] ** k, minlength=folds.stretches) for k in (1, 2)]
        return _Side(
            level,
            float(own.std()),
            max(abs(other - level) for other in by_recording),
            np.asarray(sums[0] / counts, dtype=np.float64),
            np.asarray(sums[1], dtype=np.float64),
            counts,
        )

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
    if float(np.mean(np.sign(now.means - then.level) != np.sign(moved))) > LEVEL:
        return None
    gain = gain_interval(now.about(then.level), now.about(now.level), seed)
    if not gain.low > 0.0:  # NaN where too little is left to say
        return None
    error = float(np.hypot(then.error, now.error))
    levels = (with_error(then.level, then.error), with_error(now.level, now.error), with_error(moved, error))
    size = ChangedSize("torque", "N.m", *levels)
    p_value = float(stats.ttest_ind(then.means, now.means, equal_var=False).pvalue)
    return SteadyLoad(joint + 1, size, gain, p_value)
