"""How much a change gains on unseen parts of the new recordings, with the motion taken as given.

The difference that a change makes varies along a motion, but it is known. What is uncertain is the noise on top of it.
So the error of a gain is that of the product of difference and noise, by stretches. With only a few cycles of a motion,
the spread of gains from stretch to stretch would measure how uneven the motion is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from tendonfmu.arrays import Numbers
from tendonfmu.statistics import Interval


def gain_of(before: Numbers, after: Numbers, stretch: NDArray[np.int64]) -> tuple[float, float]:
    """Return 1 − rms after / rms before, and its standard error."""
    whole, left = float(np.sum(before**2)), float(np.sum(after**2))
    if whole <= 0.0 or left <= 0.0:
        return 0.0, np.inf
    cross = np.bincount(stretch - stretch.min(), np.sum(after * (before - after), axis=1))
    cross = cross[np.unique(stretch - stretch.min())]
    pairs = cross[: len(cross) // 2 * 2].reshape(-1, 2).sum(axis=1)
    variance = 4.0 * max(float(cross @ cross), float(pairs @ pairs))
    ratio = np.sqrt(left / whole)
    # delta method for left / whole: whole = left + 2 cross + difference², of which only cross is uncertain
    return float(1.0 - ratio), float(np.sqrt(variance) * ratio / (2.0 * whole))


def interval_of(before: Numbers, after: Numbers, stretch: NDArray[np.int64]) -> Interval:
    """Return the gain with its 95 % interval: Student's t with as many degrees of freedom as stretches less one."""
    gain, error = gain_of(before, after, stretch)
    count = len(np.unique(stretch))
    half = float(stats.t.ppf(0.975, max(count - 1, 1))) * error
    return Interval(gain, gain - half, gain + half)
