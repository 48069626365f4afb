"""Whether something is missing at all: scores of candidates on the whitened residual, and their null distribution.

A trial's score is the sum over blocks of time of (its columns)ᵀ (residual), columns orthogonal to all nuisance. Under
the null hypothesis the signs of the blocks' scores are exchangeable (wild bootstrap by blocks: Liu, 1988; Mammen,
1993), whatever the noise's distribution and its dependence within a block. The statistic is that of a cluster-robust
Wald test, computed anew for every flip (null imposed: Cameron, Gelbach and Miller, 2008). The smallest p-value over all
trials is compared with its own distribution under joint flips (min-p: Westfall and Young, 1993), so p is family-wise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from tendonfmu.diagnosis_series import Bank, Series, Trial
from tendonfmu.nuisance import basis, without
from tendonfmu.whitening import Whitener, common, whitener

Numbers = NDArray[np.float64]
Array = NDArray[Any]

BLOCK = 2.0  # s, of the sign flips: longer than what a bias that wanders remembers between the splines' knots
DRAWS = 2000
VISITS = 8.0  # effective number of blocks in which a trial must show
TAIL = 0.1  # share of the draws that the tail is taken from
MOST_TAKEN = 1e-3  # share of a direction that the nuisance leaves, at least, for it to be given back
_DRAWS = 500  # at a time
_CHUNK = 64  # columns at a time


@dataclass(frozen=True)
class Problem:
    """What is to be explained. splines: [B, s] of the bias's trend. nominal: [B, n, u] derivatives by all that is
    fitted.
    """

    series: Series
    bank: Bank
    splines: Numbers
    nominal: Array


@dataclass(frozen=True)
class Prepared:
    """Target and columns white and orthogonal to the nuisance, rows sorted by time.

    target: [V, n]; columns: [V, n, c]; starts: [K] first row of each block of time. whitener: of the residual.
    unshrunk: [V, n, c] the columns, what the nuisance has taken of each block given back.
    """

    target: Numbers
    columns: Array
    starts: NDArray[np.int64]
    whitener: Whitener
    unshrunk: Array

    @property
    def blocks(self) -> int:
        return len(self.starts)

    @cached_property
    def scores(self) -> Numbers:
        """[K, c]"""
        return self._scores(self.columns)

    @cached_property
    def unshrunk_scores(self) -> Numbers:
        """[K, c], whose outer products have the covariance of the sum of `scores` as their mean."""
        return self._scores(self.unshrunk)

    def _scores(self, columns: Array) -> Numbers:
        products = np.einsum("vnc,vn->vc", columns, self.target.astype(columns.dtype))
        return np.add.reduceat(products.astype(np.float64), self.starts, axis=0)

    def score(self, trial: Trial) -> Numbers:
        """[K, d]"""
        return self.scores[:, trial.first : trial.first + trial.count]

    def unshrunk_score(self, trial: Trial) -> Numbers:
        """[K, d]"""
        return self.unshrunk_scores[:, trial.first : trial.first + trial.count]

    def gram(self, trial: Trial) -> Numbers:
        """[K, d, d]"""
        return self._gram(self.columns, trial)

    def unshrunk_gram(self, trial: Trial) -> Numbers:
        """[K, d, d]: what the effect itself makes of `unshrunk_score`, per magnitude."""
        return self._gram(self.unshrunk, trial)

    def _gram(self, columns: Array, trial: Trial) -> Numbers:
        chosen = slice(trial.first, trial.first + trial.count)
        left, right = (values[:, :, chosen].astype(np.float64) for values in (columns, self.columns))
        return np.asarray(np.add.reduceat(np.einsum("vni,vnj->vij", left, right), self.starts, axis=0))


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
    return Prepared(cleaner.target, columns, starts, white, unshrunk_columns(columns, cleaner.span, starts))


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


def unshrunk_columns(columns: Array, span: Numbers, starts: NDArray[np.int64]) -> Array:
    """[V, n, c] (I − H_bb)^(−½) of the columns in each block, H the projection on the nuisance's orthonormal span. With
    them a block's score has the variance that the nuisance has taken of the residual there (CR2: Bell and McCaffrey,
    2002).
    """
    joints = columns.shape[1]
    found = columns.reshape(-1, columns.shape[2]).copy()
    for begin, end in zip(starts, [*starts[1:], len(columns)], strict=True):
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
        side = side.astype(columns.dtype)
        found[rows] += (side * factor.astype(columns.dtype)) @ (side.T @ found[rows])
    return np.asarray(found.reshape(columns.shape))


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
    p_values, statistic = np.ones(count), np.zeros(count)
    groups = []
    for size in sorted({trial.count for trial in trials}):
        members = [k for k in range(count) if trials[k].count == size and eligible[k] and visits[k] >= least]
        if members and blocks > size + 1:
            groups.append(_Group(prepared, trials, members, visits[members]))
    if not groups:
        return Tested(p_values, statistic, visits, draws)
    for group in groups:
        p_values[group.members], statistic[group.members] = (found[0] for found in group.actual())
    rng = np.random.default_rng([seed, 20])
    least_p = np.zeros(0)
    while len(least_p) < draws:
        flips = rng.integers(0, 2, (min(_DRAWS, draws - len(least_p)), blocks)) * 2.0 - 1.0
        least_p = np.append(least_p, np.min([group.flipped(flips)[0].min(axis=1) for group in groups], axis=0))
    chosen = np.concatenate([group.members for group in groups])
    p_values[chosen] = family_wise(p_values[chosen], least_p)
    return Tested(p_values, statistic, visits, draws)


def effective_blocks(gram: Numbers) -> float:
    """(Σ E)² / Σ E² of a trial's energy by block; the number of blocks when they share it equally."""
    energy = np.trace(gram, axis1=1, axis2=2)
    power = float(energy @ energy)
    return float(energy.sum() ** 2 / power) if power > 0 else 0.0


class _Group:
    """Trials of d columns each, their columns turned so that the whole energy is the identity.

    With scores S_b and energies E_b of the blocks the estimate is α = Σ S_b, and T² = αᵀ V⁻¹ α with V the sum of the
    outer products of S_b − E_b α, so that the effect itself does not count as noise. V is put together of sums that
    flip with the blocks.
    """

    def __init__(self, prepared: Prepared, trials: Sequence[Trial], members: list[int], visits: Numbers) -> None:
        self.members, self._visits = np.array(members), visits
        self._size = trials[members[0]].count
        turned = [_turned(prepared, trials[k]) for k in members]
        whole, scores, energy, sides = (np.stack([each[part] for each in turned], axis=-2) for part in range(4))
        self._energy = energy.reshape(prepared.blocks, len(members), self._size, self._size)
        self._scores, self._whole, self._sides = scores, whole, sides[0]
        self._signed = np.array([all(trials[k].signs) for k in members])
        self._square = np.einsum("kti,ktj->tij", scores, scores)
        self._fourth = np.einsum("ktij,ktlm->tijlm", self._energy, self._energy)
        self._third = np.einsum("kti,ktjl->ktijl", scores, self._energy).reshape(prepared.blocks, -1)

    def actual(self) -> tuple[Numbers, Numbers]:
        """p [1, T] of single tests, and T² [1, T]."""
        return self._judged(self._whole, self._third.sum(axis=0)[None])

    def flipped(self, flips: Array) -> tuple[Numbers, Numbers]:
        """The same [D, T] for signs [D, K] of the blocks."""
        estimate = np.einsum("dk,kti->dti", flips, self._scores, optimize=True)
        return self._judged(estimate, flips @ self._third)

    def _judged(self, estimate: Numbers, third: Numbers) -> tuple[Numbers, Numbers]:
        size = self._size
        cross = np.einsum("dtijl,dtl->dtij", third.reshape(*estimate.shape[:2], size, size, size), estimate)
        own = np.einsum("tijlm,dtj,dtm->dtil", self._fourth, estimate, estimate, optimize=True)
        spread = self._square - cross - np.swapaxes(cross, 2, 3) + own
        tiny = 1e-9 * np.trace(self._square, axis1=1, axis2=2)
        spread = spread + tiny[None, :, None, None] * np.eye(size)
        statistic = np.einsum("dti,dti->dt", estimate, np.linalg.solve(spread, estimate[..., None])[..., 0])
        p_values = fdtrc(size, np.maximum(self._visits - size, 1.0), np.maximum(statistic, 0.0) / size)
        right = np.einsum("dti,ti->dt", estimate, self._sides) > 0
        return np.where(self._signed, np.where(right, 0.5 * p_values, 1.0), p_values), statistic


def _turned(prepared: Prepared, trial: Trial) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """Of a trial in directions of energy 1: score [1, d], scores by block [K, d], energies by block [K, d·d], and the
    direction [1, d] along which the sum of the estimates, each with its expected sign, grows."""
    gram = prepared.gram(trial)
    total = gram.sum(axis=0)
    length = np.sqrt(np.maximum(np.diag(total), 1e-300))
    power, direction = np.linalg.eigh(total / np.outer(length, length))
    kept = power > 1e-9 * power[-1]
    turn = np.where(kept, direction / np.sqrt(np.where(kept, power, 1.0)), 0.0) / length[:, None]
    energy = np.einsum("ij,kil,lm->kjm", turn, prepared.unshrunk_gram(trial), turn, optimize=True)
    side = turn.T @ (np.array(trial.signs, dtype=float) * length)
    whole = prepared.score(trial).sum(axis=0) @ turn
    return whole[None], prepared.unshrunk_score(trial) @ turn, energy.reshape(len(gram), -1), side[None]


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
