"""Whether something is missing at all: scores of candidates on the whitened residual, and their null distribution.

A trial's score is the sum over blocks of time of (its columns)ᵀ (residual), columns orthogonal to all nuisance. Under
the null hypothesis the signs of the blocks' scores are exchangeable (wild bootstrap by blocks: Liu, 1988; Mammen,
1993), whatever the noise's distribution and its dependence within a block. The statistic is Hotelling's T² of the
blocks' scores about 0: its covariance, the sum of their outer products, does not change under sign flips. The
smallest p-value over all trials is compared with its own distribution under joint flips (min-p: Westfall and Young,
1993), so p is family-wise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta

from tendonfmu.diagnosis_series import Bank, Series, Trial
from tendonfmu.nuisance import basis, without
from tendonfmu.whitening import Whitener, common, whitener

Numbers = NDArray[np.float64]
Array = NDArray[Any]

BLOCK = 1.5  # s, of the sign flips
DRAWS = 2000
VISITS = 8.0  # effective number of blocks in which a trial must show
TAIL = 0.1  # share of the draws that the tail is taken from
MOST_TAKEN = 1e-3  # share of a direction that the nuisance leaves, at least, for it to be given back
_CHUNK = 64  # columns at a time


@dataclass(frozen=True)
class Problem:
    """What is to be explained. splines: [B, s] of the bias; nominal: [B, n, u] derivatives by all that is fitted."""

    series: Series
    bank: Bank
    splines: Numbers
    nominal: Array


@dataclass(frozen=True)
class Prepared:
    """Target and columns white and orthogonal to the nuisance, rows sorted by time.

    target: [V, n]; columns: [V, n, c]; starts: [K] first row of each block of time. whitener: of the residual.
    unshrunk: [V, n] the target less what the nuisance has taken of each block's variance.
    """

    target: Numbers
    columns: Array
    starts: NDArray[np.int64]
    whitener: Whitener
    unshrunk: Numbers

    @property
    def blocks(self) -> int:
        return len(self.starts)

    @cached_property
    def scores(self) -> Numbers:
        """[K, c]"""
        return self._scores(self.target)

    @cached_property
    def unshrunk_scores(self) -> Numbers:
        """[K, c], whose outer products have the covariance of the sum of `scores` as their mean."""
        return self._scores(self.unshrunk)

    def _scores(self, target: Numbers) -> Numbers:
        products = np.einsum("vnc,vn->vc", self.columns, target.astype(self.columns.dtype))
        return np.add.reduceat(products.astype(np.float64), self.starts, axis=0)

    def score(self, trial: Trial) -> Numbers:
        """[K, d]"""
        return self.scores[:, trial.first : trial.first + trial.count]

    def unshrunk_score(self, trial: Trial) -> Numbers:
        """[K, d]"""
        return self.unshrunk_scores[:, trial.first : trial.first + trial.count]

    def gram(self, trial: Trial) -> Numbers:
        """[K, d, d]"""
        own = self.columns[:, :, trial.first : trial.first + trial.count].astype(np.float64)
        return np.asarray(np.add.reduceat(np.einsum("vni,vnj->vij", own, own), self.starts, axis=0))


def prepare(problem: Problem, accepted: Array | None = None) -> Prepared:
    """accepted: [B, n, a] columns of causes already found, which join the nuisance."""
    series = problem.series
    nominal = np.asarray(problem.nominal, dtype=np.float64)
    if accepted is not None:
        nominal = np.concatenate([nominal, np.asarray(accepted, dtype=np.float64)], axis=2)
    white = whitener(series, residual_of(series, problem.splines, nominal))
    cleaner = _Cleaner(white, problem.splines, series.target, nominal)
    values = problem.bank.columns.values
    columns = np.empty((int(white.valid.sum()), *values.shape[1:]), dtype=values.dtype)
    for first in range(0, values.shape[2], _CHUNK):
        chunk = slice(first, first + _CHUNK)
        columns[:, :, chunk] = cleaner.clean(values[:, :, chunk])
    starts = block_starts(series, white)
    return Prepared(cleaner.target, columns, starts, white, unshrunk_target(cleaner.target, cleaner.span, starts))


class _Cleaner:
    """Takes everything off columns that the nuisance explains: whitens, makes joints uncorrelated, and takes off what
    the bias and the nominal model's numbers can do (generalised least squares)."""

    def __init__(self, white: Whitener, splines: Numbers, target: Numbers, nominal: Numbers) -> None:
        joints = target.shape[1]
        self._white = white
        self._mixing = np.eye(joints)
        bias = self._mixed(splines_of_joints(splines, joints))
        own = np.concatenate([bias, self._mixed(nominal)], axis=2)
        left = self._mixed(target[:, :, None])
        plain = without(left.reshape(-1), basis(own.reshape(-1, own.shape[2]))).reshape(len(left), joints)
        self._mixing = common(plain, np.ones(len(plain), dtype=bool))
        own = np.einsum("vnc,nm->vmc", own, self._mixing, optimize=True)
        self.span = basis(own.reshape(-1, own.shape[2]))
        mixed = (left[:, :, 0] @ self._mixing).reshape(-1)
        self.target: Numbers = without(mixed, self.span).reshape(len(left), joints)

    def _mixed(self, values: Array) -> Array:
        whitened = self._white.apply(values)[self._white.valid]
        return np.asarray(np.einsum("vnc,nm->vmc", whitened, self._mixing.astype(values.dtype), optimize=True))

    def clean(self, values: Array) -> Array:
        """[V, n, c] of columns [B, n, c]."""
        mixed = self._mixed(values)
        return without(mixed.reshape(-1, mixed.shape[2]), self.span).reshape(mixed.shape)


def splines_of_joints(splines: Numbers, joints: int) -> Numbers:
    """[B, n, n·s]: those of each joint are columns of their own."""
    found = np.zeros((len(splines), joints, joints * splines.shape[1]))
    for j in range(joints):
        found[:, j, j * splines.shape[1] : (j + 1) * splines.shape[1]] = splines
    return found


def unshrunk_target(target: Numbers, span: Numbers, starts: NDArray[np.int64]) -> Numbers:
    """[V, n] (I − H_bb)^(−½) of the residual in each block, H the projection on the nuisance's orthonormal span: what
    the nuisance has taken of a block is given back in the mean (CR2: Bell and McCaffrey, 2002).
    """
    joints = target.shape[1]
    flat, found = target.reshape(-1), target.reshape(-1).copy()
    for begin, end in zip(starts, [*starts[1:], len(target)], strict=True):
        rows = slice(int(begin) * joints, int(end) * joints)
        own = span[rows]
        if own.shape[0] < own.shape[1]:
            taken, side = np.linalg.eigh(own @ own.T)
        else:
            taken, right = np.linalg.eigh(own.T @ own)
            kept = taken > 1e-9
            taken = taken[kept]
            side = own @ (right[:, kept] / np.sqrt(taken))
        factor = 1.0 / np.sqrt(np.maximum(1.0 - taken, MOST_TAKEN)) - 1.0
        found[rows] += side @ (factor * (side.T @ flat[rows]))
    return np.asarray(found.reshape(target.shape))


def residual_of(series: Series, splines: Numbers, nominal: Array) -> Numbers:
    """[B, n] N·m: target less bias and all that `nominal` [B, n, u] explains by least squares; unused rows as found."""
    used = series.used
    span = basis(splines[used])
    target = without(series.target[used], span)
    if nominal.shape[2]:
        wide = np.asarray(nominal[used], dtype=np.float64)
        own = np.stack([without(wide[:, j], span) for j in range(wide.shape[1])], axis=1)
        flat = basis(own.reshape(-1, own.shape[2]))
        target = without(target.reshape(-1), flat).reshape(target.shape)
    found = series.target - np.mean(series.target[used], axis=0)
    found[used] = target
    return np.asarray(found)


def block_starts(series: Series, white: Whitener, length: float = BLOCK) -> NDArray[np.int64]:
    """[K] among the valid rows: blocks of time of about `length` s, none across a gap."""
    rows = np.flatnonzero(white.valid)
    if not len(rows):
        return np.zeros(0, dtype=np.int64)
    number = np.floor((series.time[rows] - series.time[0]) / length)
    new = (np.diff(number, prepend=number[0] - 1) != 0) | (np.diff(series.segment[rows], prepend=-1) != 0)
    return np.flatnonzero(new)


# --- the test ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tested:
    """p_values: [T] family-wise, of each trial; 1 where a trial shows in too few blocks. visits: [T] that number.

    statistic: [T] T² of each. draws: number of joint flips.
    """

    p_values: Numbers
    statistic: Numbers
    visits: Numbers
    draws: int


def tested_trials(
    prepared: Prepared, trials: Sequence[Trial], eligible: Sequence[bool], seed: int, draws: int
) -> Tested:
    """eligible: whether a trial is visible at all; the others are not tested, p = 1."""
    count, blocks = len(trials), prepared.blocks
    visits = np.array([effective_blocks(prepared.gram(trial)) for trial in trials])
    least = min(VISITS, blocks / 3)
    chosen = [k for k in range(count) if eligible[k] and visits[k] >= least]
    p_values, statistic = np.ones(count), np.zeros(count)
    if not chosen or blocks < 3:
        return Tested(p_values, statistic, visits, draws)
    totals, scaled, sides, offsets = _scaled_scores(prepared, [trials[k] for k in chosen])
    degrees = np.diff([*offsets, scaled.shape[1]])
    signed = np.array([all(trials[k].signs) for k in chosen])

    def p_of(scores: Numbers, side: Numbers) -> tuple[Numbers, Numbers]:
        squares = np.add.reduceat(scores**2, offsets, axis=1)
        return _single_p(np.where(~signed | (side > 0), squares, 0.0), degrees, signed, blocks), squares

    own, squares = p_of(*totals)
    rng = np.random.default_rng([seed, 20])
    least_p = np.zeros(0)
    while len(least_p) < draws:
        flips = rng.integers(0, 2, (min(500, draws - len(least_p)), blocks)) * 2.0 - 1.0
        least_p = np.append(least_p, p_of(flips @ scaled, flips @ sides)[0].min(axis=1))
    p_values[chosen], statistic[chosen] = family_wise(own[0], least_p), squares[0]
    return Tested(p_values, statistic, visits, draws)


def effective_blocks(gram: Numbers) -> float:
    """(Σ E)² / Σ E² of a trial's energy by block; the number of blocks when they share it equally."""
    energy = np.trace(gram, axis1=1, axis2=2)
    power = float(energy @ energy)
    return float(energy.sum() ** 2 / power) if power > 0 else 0.0


def _scaled_scores(
    prepared: Prepared, trials: Sequence[Trial]
) -> tuple[tuple[Numbers, Numbers], Numbers, Numbers, list[int]]:
    """Of all trials, one after the other: scores [K, C] whose outer products add up to the identity within a trial, and
    scores [K, T] whose sum has the sign of the estimates; before them the actual sums of both, [1, C] and [1, T], and
    at last where each trial begins among the C."""
    sums, scaled, side_sums, sides, offsets, first = [], [], [], [], [], 0
    for trial in trials:
        total = prepared.gram(trial).sum(axis=0)
        length = np.sqrt(np.maximum(np.diag(total), 1e-300))
        whole, score = prepared.score(trial).sum(axis=0) / length, prepared.unshrunk_score(trial) / length
        power, direction = np.linalg.eigh(score.T @ score)
        kept = power > 1e-9 * power[-1]
        turn = direction[:, kept] / np.sqrt(power[kept]) if power[-1] > 0 else np.zeros((len(length), 1))
        # the sum of the estimates, each in its expected direction
        estimate = np.linalg.lstsq(total / np.outer(length, length), np.array(trial.signs, dtype=float), rcond=1e-9)[0]
        sums.append(whole @ turn)
        scaled.append(score @ turn)
        side_sums.append(whole @ estimate)
        sides.append(score @ estimate)
        offsets.append(first)
        first += turn.shape[1]
    actual = np.concatenate(sums)[None], np.array(side_sums)[None]
    return actual, np.concatenate(scaled, axis=1), np.column_stack(sides), offsets


def _single_p(statistic: Numbers, degrees: Array, signed: Array, blocks: int) -> Numbers:
    """Tail of T² for K independent normal scores: T²/K has a Beta(d/2, (K − d)/2) distribution; halved for one side."""
    found = np.ones_like(statistic)
    for count in np.unique(degrees):
        own = degrees == count
        share = np.clip(statistic[:, own] / blocks, 0.0, 1.0 - 1e-15)
        found[:, own] = beta.sf(share, count / 2, max(blocks - count, 1) / 2)
    return np.asarray(np.where(signed, 0.5 * found, found))


def family_wise(p_values: Numbers, least: Numbers) -> Numbers:
    """Share of draws whose least p [D] is as small as each p [T]; beyond the smallest TAIL of them by a power law
    P(least ≤ p) = a pᵇ, b ≤ 1, fitted to them: under independence a is the number of tests and b = 1."""
    ordered = np.sort(least)
    share = (np.searchsorted(ordered, p_values, side="right") + 1) / (len(ordered) + 1)
    tail = ordered[: max(int(TAIL * len(ordered)), 10)]
    # Hill's estimate of the exponent from the smallest p-values
    edge = tail[-1]
    exponent = min(1.0, 1.0 / max(float(np.mean(np.log(edge / np.maximum(tail, 1e-300)))), 1e-12))
    beyond = len(tail) / len(ordered) * (np.maximum(p_values, 1e-300) / edge) ** exponent
    return np.asarray(np.where(p_values < tail[len(tail) // 5], np.minimum(beyond, 1.0), share))
