"""How certain counts and measurements of a score are: 95 % confidence intervals.

They are exact if the distribution is known, otherwise from a bootstrap. NaN stands for unknown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, gammaincinv, stdtr, stdtrit  # not scipy.stats, which takes a second to import

from tendonfmu.arrays import Flags, Indices, Numbers, flagged_rows

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
    """Return a quantile, with an interval from resampled events (percentiles). values: [k]."""
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


# --- gains between two models -----------------------------------------------------------------------------------------
# Residuals are coloured, and their size depends on the motion. So blocks of about two seconds are drawn, each with the
# residuals of both models, and the logarithm of the ratio of their rms is studentised. This is the block bootstrap of
# Künsch, "The jackknife and the bootstrap for general stationary observations", Ann. Statist. 17 (1989), with the
# bootstrap-t of Efron and Tibshirani, "An introduction to the bootstrap" (1993), section 12.5.


BLOCK = 2.0  # s; longer than residuals of a fitted finger are correlated
FEWEST_BLOCKS = 3  # blocks; fewer give no interval
_FEW, _SHORTEST = 6, 0.5  # blocks, wanted at least; s, shortest block for this
_RESAMPLES = 4000
_MOST_DRAWN = 400  # blocks; more are joined
_NORMAL = 1.96  # standard deviations
_LEAST_ERROR = 1 / 3  # of that of all blocks; coverage is the same without it (mild, skewed, one block in 20 large)
_LEAST_PLAIN = 12  # blocks; with fewer, the resamples' own errors are too rough, and Student's t is used


@dataclass(frozen=True)
class BlockIndex:
    """The block of each sample."""

    index: NDArray[np.intp]  # [N], from 0; −1 outside the chosen samples
    count: int  # number of blocks

    def sums(self, values: Numbers) -> Numbers:
        """Return the sums of values over the blocks. values: [N]; returns [count]."""
        chosen = self.index >= 0
        return np.asarray(np.bincount(self.index[chosen], weights=values[chosen], minlength=self.count), dtype=float)


def blocks_of(time: Numbers, chosen: Flags, length: float = BLOCK) -> BlockIndex:
    """Cut the chosen samples into blocks. time: [N] (s); chosen: [N]; length: (s)."""
    index = np.full(len(time), -1, dtype=np.intp)
    stretches = flagged_rows(chosen)
    chosen_seconds = sum(float(time[end - 1] - time[begin]) for begin, end in stretches)
    length = min(length, max(chosen_seconds / _FEW, _SHORTEST))
    count = 0
    for begin, end in stretches:
        span = float(time[end - 1] - time[begin])
        parts = max(1, round(span / length))
        if span < length / 2 and count:
            index[begin:end] = count - 1
            continue
        share = (time[begin:end] - time[begin]) / span if span > 0 else np.zeros(end - begin)
        index[begin:end] = count + np.minimum((share * parts).astype(np.intp), parts - 1)
        count += parts
    return BlockIndex(index, count)


def gain_interval(before: Numbers, after: Numbers, seed: int = 0, between: float = 0.0) -> Interval:
    """Return the gain 1 − rms_after/rms_before with its 95 % interval."""
    # before, after: [B]; between: variance of log(rms after/rms before) from one recording to the next
    total_before, total_after = float(before.sum()), float(after.sum())
    if total_before <= 0:
        return Interval(0.0)
    value = 1 - math.sqrt(total_after / total_before)
    if total_after <= 0 or len(before) < FEWEST_BLOCKS:
        return Interval(value)
    pairs = _independent(np.column_stack([before, after]))
    estimate = math.log(1 - value)
    low, high = (
        estimate + math.copysign(math.hypot(end - estimate, _NORMAL * math.sqrt(between)), end - estimate)
        for end in _log_ratio_ends(pairs, seed)
    )
    return Interval(value, 1 - math.exp(high), 1 - math.exp(low))


def variance_between(recordings: Sequence[Numbers]) -> float:
    """Return the variance of log(rms after/rms before) between recordings, beyond what their blocks explain."""
    # recordings: [B, 2] block sums of squares of each, before and after. No recording shows by itself how much another
    # motion changes the gain (DerSimonian and Laird, "Meta-analysis in clinical trials", Control. Clin. Trials 1986)
    known = [
        _independent(pairs) for pairs in recordings if len(pairs) >= FEWEST_BLOCKS and (pairs.sum(axis=0) > 0).all()
    ]
    if len(known) < 2:
        return 0.0
    found = np.array([[float(part[0]) for part in _log_ratio(np.ones((1, len(pairs))), pairs)] for pairs in known])
    return max(0.0, float(np.var(found[:, 0], ddof=1) - np.mean(found[:, 1] ** 2)))


def _log_ratio_ends(pairs: Numbers, seed: int) -> tuple[float, float]:
    """Return the ends of the interval of log(rms after/rms before). pairs: [B, 2] sums of squares."""
    estimate, error = (float(part[0]) for part in _log_ratio(np.ones((1, len(pairs))), pairs))
    if error <= 0:
        return estimate, estimate
    low, high = _quantiles(pairs, estimate, error, seed)
    return estimate - high * error, estimate - low * error


def _quantiles(pairs: Numbers, estimate: float, error: float, seed: int) -> tuple[float, float]:
    """Return the quantiles of the studentised log ratio."""
    from scipy.stats import t

    plain = float(t.ppf(1 - _TAIL, len(pairs) - 1))
    if len(pairs) < _LEAST_PLAIN:
        return -plain, plain
    shares = np.full(len(pairs), 1 / len(pairs))
    draws = np.random.default_rng(seed).multinomial(len(pairs), shares, _RESAMPLES).astype(float)
    drawn, errors = _log_ratio(draws, pairs)
    # a draw whose own error is far below that of all blocks has missed the one that makes it
    studentised = (drawn - estimate) / np.maximum(errors, _LEAST_ERROR * error)
    low, high = np.nanquantile(studentised, [_TAIL, 1 - _TAIL])
    return float(low), float(high)


def _log_ratio(weights: Numbers, pairs: Numbers) -> tuple[Numbers, Numbers]:
    """Return log(rms after/rms before) [R] and its standard error [R], with blocks counted `weights` [R, B] times."""
    # The error is that of a ratio of sums (delta method, or infinitesimal jackknife). With the shares a_b, c_b of a
    # block in both sums its influence is u_b = (a_b − c_b)/2, and the variance is B/(B − 1) Σ u_b².
    sums = weights @ pairs
    estimate = 0.5 * np.log(sums[:, 1] / sums[:, 0])
    share = weights[:, :, None] * pairs[None] / sums[:, None, :]
    with np.errstate(invalid="ignore", divide="ignore"):
        single = np.where(weights > 0, (share[:, :, 1] - share[:, :, 0]) / (2 * weights), 0.0)
    count = weights.sum(axis=1)
    variance = np.sum(weights * single**2, axis=1) * count / (count - 1)
    return estimate, np.sqrt(variance)


def _independent(pairs: Numbers) -> Numbers:
    """Join neighbouring blocks in pairs while there are too many, or their influences are correlated beyond chance."""
    while len(pairs) >= 2 * _LEAST_PLAIN:
        sums = pairs.sum(axis=0)
        influence = pairs[:, 1] / sums[1] - pairs[:, 0] / sums[0]
        power = float(influence @ influence)
        chance = power / math.sqrt(len(pairs))
        if len(pairs) <= _MOST_DRAWN and (power <= 0 or influence[1:] @ influence[:-1] <= chance):
            break
        even = len(pairs) // 2 * 2
        joined = pairs[:even].reshape(-1, 2, 2).sum(axis=1)
        joined[-1] += pairs[even:].sum(axis=0)
        pairs = joined
    return pairs


# --- regression on noisy columns --------------------------------------------------------------------------------------


LEVEL = 0.975  # of Student's t: intervals of 95 %
OF_NOISE = 0.05  # of the variance in any direction of the columns: with more, they do not tell
NOISE_KNOWN = 0.2  # of its variance, to which the noise is known


@dataclass(frozen=True)
class Estimate:
    """Slopes of the columns, then the zero of each side."""

    value: Numbers  # [p + s]
    covariance: Numbers  # [p + s, p + s]
    known: Flags  # [p + s] a column that stands still tells nothing
    free: int  # degrees of freedom
    share: float  # of the variance that is noise, in the worst direction

    def change(self, at: int, then: int) -> float:
        """Return by how much a number differs from another."""
        return float(self.value[at] - self.value[then])

    def difference(self, at: int, then: int | None = None) -> tuple[float, float, float]:
        """Return a number, half of the interval of it or of its difference from another, and the p-value of that."""
        rows = [at] if then is None else [at, then]
        signs = np.array([1.0, -1.0][: len(rows)])
        if not self.known[rows].all():
            return 0.0, np.inf, 1.0
        error = float(np.sqrt(max(signs @ self.covariance[np.ix_(rows, rows)] @ signs, 0.0)))
        slack = NOISE_KNOWN * self.share * abs(self.value[at]) * (at >= 0)
        off = abs(float(signs @ self.value[rows]))
        p_value = 2.0 * float(stdtr(self.free, -max(off - slack, 0.0) / max(error, 1e-300)))
        return float(self.value[at]), float(stdtrit(self.free, LEVEL) * error + slack), p_value


def noisy_regression(
    columns: Numbers, noise: Numbers, target: Numbers, block: Indices, side: Indices, own: int
) -> Estimate | None:
    """Regress on noisy columns and a constant of each side; the first `own` columns of each side are its own."""
    # columns: [N, p]; noise: [p] variances of the columns; target: [N]; block, side: [N]
    rows = (side[:, None] == np.arange(side.max() + 1)).astype(float)  # [N, s]
    owner = np.full(columns.shape[1], -1)
    owner[: own * rows.shape[1]] = np.repeat(np.arange(rows.shape[1]), own)
    counted = np.column_stack([rows, np.ones(len(rows))])[:, owner]  # where a column counts [N, p]
    many = counted.sum(axis=0)
    middle = (columns * counted).sum(axis=0) / many
    centred = (columns - middle) * counted
    variance = (centred**2).sum(axis=0) / many
    used = variance > np.maximum(4.0 * noise, 1e-24)  # others stand still; what they do is not known
    scale = np.sqrt(variance[used])
    design = np.column_stack([centred[:, used] / scale, rows])
    of_noise = np.append(noise[used] / scale**2, np.zeros(rows.shape[1]))
    in_all = np.append(many[used], rows.sum(axis=0))
    moments = design.T @ design - np.diag(in_all * of_noise)
    _, number = np.unique(block, return_inverse=True)
    blocks, free = int(number.max()) + 1, int(number.max()) + 1 - design.shape[1]
    if free < 1 or np.linalg.eigvalsh(moments)[0] < 1e-9 * len(design):
        return None
    share = float(np.linalg.eigvals(np.linalg.solve(design.T @ design, np.diag(in_all * of_noise))).real.max())
    if share > OF_NOISE:
        return None
    inverse = np.linalg.inv(moments)
    beta = inverse @ (design.T @ target)
    scores = np.zeros((blocks, len(beta)))
    np.add.at(scores, number, design * (target - design @ beta)[:, None])
    in_block = np.zeros((blocks, len(beta)))
    np.add.at(in_block, number, np.column_stack([counted[:, used], rows]))
    scores += in_block * (of_noise * beta)
    covariance = inverse @ (scores.T @ scores) @ inverse * blocks / free
    turn = np.zeros((len(used) + rows.shape[1], len(beta)))
    at = np.flatnonzero(used)
    turn[at, np.arange(len(at))] = 1.0 / scale
    for k in range(rows.shape[1]):  # the zero: where all columns of the side are 0
        turn[len(used) + k, len(at) + k] = 1.0
        turn[len(used) + k, : len(at)] = np.where(np.isin(owner[at], (k, -1)), -middle[at] / scale, 0.0)
    known = np.append(used, np.ones(rows.shape[1], dtype=bool))
    return Estimate(turn @ beta, turn @ covariance @ turn.T, known, free, share)
