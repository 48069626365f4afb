"""How certain counts and measurements of a score are: 95 % confidence intervals.

They are exact if the distribution is known, otherwise from a bootstrap. NaN stands for unknown.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import betaincinv, gammaincinv  # not scipy.stats, which takes a second to import

from tendonfmu.arrays import Numbers

Statistic = Callable[[Numbers], Numbers]

CONFIDENCE = 0.95
_TAIL = (1 - CONFIDENCE) / 2
RESAMPLES = 2000
FEWEST = 5  # events or blocks; resampling fewer does not show their spread
_MOST = 500  # blocks; more are joined with their neighbours, so that memory stays small


@dataclass(frozen=True)
class Interval:
    """A value and the 95 % interval of the true value."""

    value: float
    low: float = math.nan  # ends of the interval; NaN if unknown
    high: float = math.nan


def share(count: int, of: int) -> Interval:
    """Return a share with the exact binomial interval (Clopper and Pearson 1934)."""
    if not of:
        return Interval(math.nan)
    low = float(betaincinv(count, of - count + 1, _TAIL)) if count else 0.0
    high = float(betaincinv(count + 1, of - count, 1 - _TAIL)) if count < of else 1.0
    return Interval(count / of, low, high)


def rate(count: int, exposure: float) -> Interval:
    """Return a rate with the exact Poisson interval (Garwood 1936)."""
    if not exposure > 0:
        return Interval(math.nan)
    low = float(gammaincinv(count, _TAIL)) if count else 0.0
    high = float(gammaincinv(count + 1, 1 - _TAIL))
    return Interval(count / exposure, low / exposure, high / exposure)


def quantile(values: Numbers, probability: float, seed: int) -> Interval:
    """Return a quantile, with an interval from resampled events (percentiles)."""
    # values: [k]
    if not len(values):
        return Interval(math.nan)
    value = float(np.quantile(values, probability))
    if len(values) < FEWEST:
        return Interval(value)
    drawn = np.random.default_rng(seed).integers(0, len(values), (RESAMPLES, len(values)))
    return Interval(value, *_percentiles(np.quantile(values[drawn], probability, axis=1)))


def of_sums(sums: Numbers, statistic: Statistic, seed: int) -> list[Interval]:
    """Return a statistic of sums over events or blocks, with intervals from resampling these (percentiles)."""
    # sums: [b, k]; statistic: [r, k]; returns [n]. Without intervals for fewer than `FEWEST` events or blocks
    values = statistic(sums.sum(axis=0, keepdims=True))[0]
    if len(sums) < FEWEST:
        return [Interval(float(value)) for value in values]
    units = _joined(sums)
    draws = np.random.default_rng(seed).multinomial(len(units), np.full(len(units), 1 / len(units)), RESAMPLES)
    drawn = statistic(draws @ units)
    return [Interval(float(value), *_percentiles(drawn[:, j])) for j, value in enumerate(values)]


def _joined(sums: Numbers) -> Numbers:
    """Join neighbouring blocks until there are at most `_MOST`."""
    if len(sums) <= _MOST:
        return sums
    begins = np.unique(np.linspace(0, len(sums), _MOST, endpoint=False).astype(int))
    return np.asarray(np.add.reduceat(sums, begins, axis=0))


def _percentiles(drawn: Numbers) -> tuple[float, float]:
    known = drawn[np.isfinite(drawn)]
    if len(known) < RESAMPLES / 2:
        return math.nan, math.nan
    low, high = np.quantile(known, [_TAIL, 1 - _TAIL])
    return float(low), float(high)
