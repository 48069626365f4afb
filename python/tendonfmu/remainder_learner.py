"""A flexible learner with a calibrated null: ridge regression on whitened columns.

Residual and columns get the same treatment before anything is split: whitened by one filter, projected off the
nuisance columns. Whether there is anything to learn: S = z'W z with z = X'y, W = (X'X + λ)^-1, a score test with a
ridge prior (le Cessie and van Houwelingen 1995). Its null follows from z ~ N(0, X'X) by simulation, for all sets of
columns together. What the filter left of the noise's memory, or noise that comes in bursts, shows as blocks of a few
seconds that vary more than white noise: S is divided by that ratio. The projection takes more from the noise of some
blocks than of others; each is corrected for its leverage (Bell and McCaffrey 2002, CR2). How much can be learned: the
same regression, on blocks it has not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cholesky, eigh, eigvalsh, solve, solve_triangular
from scipy.special import gammaincc, log_ndtr

from tendonfmu.nuisance import basis, without
from tendonfmu.remainder_features import Features
from tendonfmu.whitening import Whitener

if TYPE_CHECKING:
    from tendonfmu.diagnosis_series import Series

Numbers = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

BLOCK = 2.0  # s: longer than the noise remembers once the bias splines are out
FOLD_BLOCKS = 3  # blocks side by side in a fold; one block on either side of them is learned from by nobody
FOLDS = 10
FEWEST_BLOCKS = 8
PENALTY = 30.0  # noise variance over the variance that a group may explain
PENALTIES = (3.0, 30.0, 300.0)  # of large sets, where it matters
LARGE = 100  # columns
FLATTEST = 0.95  # leverage that is corrected for, at most
DRAWS = 2000
CHANCE = 1.3  # ratio of block variances that a small set may have by chance


@dataclass(frozen=True)
class Layout:
    """Rows that may be learned from, in runs without a gap, cut into blocks and folds.

    rows: [U] indices into the series. run, block, fold: of each row, from 0. blocks: number of them; fold_of: [blocks].
    """

    rows: Indices
    run: Indices
    block: Indices
    fold: Indices
    blocks: int
    fold_of: Indices


def layout(series: Series, rows: Flags) -> Layout:
    """rows: [B] that may be learned from. Blocks of BLOCK seconds that no gap cuts, folds of neighbouring blocks."""
    chosen = np.flatnonzero(rows)
    new = np.ones(len(chosen), dtype=bool)
    new[1:] = (np.diff(chosen) > 1) | (np.diff(series.segment[chosen]) != 0)
    length = max(1, round(BLOCK / series.step))
    block = np.empty(len(chosen), dtype=np.int64)
    count = 0
    for first, end in pairwise([*np.flatnonzero(new).tolist(), len(chosen)]):
        pieces = max(1, round((end - first) / length))
        block[first:end] = count + np.arange(end - first) * pieces // (end - first)
        count += pieces
    fold_of = np.arange(count) // FOLD_BLOCKS % max(1, min(FOLDS, -(-count // FOLD_BLOCKS)))
    return Layout(chosen, np.cumsum(new) - 1, block, fold_of[block], count, fold_of)


def of_joint(filters: Whitener, joint: int) -> Whitener:
    """Of arrays [B, 1, ...] of this joint alone."""
    return Whitener(filters.coefficients[:, joint : joint + 1], filters.scale[joint : joint + 1], filters.valid)


@dataclass(frozen=True)
class Prepared:
    """One joint's residual and columns, whitened and projected; rows [U] of a layout.

    table: [U, D] float32, groups of equal power. goal: [U] float32, of standard deviation 1. scale: [D] of the raw
    columns, weights in N·m; 0 for those that the nuisance columns leave nothing of. basis, inner: [U, r] orthonormal,
    of the nuisance columns before and after whitening. target: [U] N·m, off the former.
    """

    table: NDArray[np.float32]
    goal: NDArray[np.float32]
    scale: Numbers
    basis: Numbers
    inner: Numbers
    target: Numbers


def prepared(residual: Numbers, nuisance: Numbers, seen: Features, own: Whitener, plan: Layout) -> Prepared:
    """Of one joint. residual: [B] N·m; nuisance: [B, p]; seen: [B, D]; own: its filter. plan: of its valid rows."""

    def filtered(values: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(own.apply(values.reshape(len(values), 1, -1))[plan.rows, 0])

    plain = basis(nuisance[plan.rows])
    inner = basis(filtered(nuisance))
    table = filtered(seen.values.astype(np.float32))
    before = np.mean(table**2, axis=0)
    table = without(table, inner)
    after = np.mean(table**2, axis=0)
    scale = np.where(after > 1e-4 * before, 1.0, 0.0)  # nothing is left of the others but rounding
    for name in dict.fromkeys(seen.group.tolist()):
        power = float(np.sum((after * scale)[seen.group == name]))
        scale[seen.group == name] *= 1.0 / np.sqrt(power) if power > 0.0 else 0.0
    target = without(residual[plan.rows], plain)
    goal = without(filtered(residual)[:, 0], inner)
    spread = max(float(goal.std()), 1e-300)
    table *= scale.astype(np.float32)
    return Prepared(table, (goal / spread).astype(np.float32), scale * spread, plain, inner, target)


def _even_leverage(goal: Numbers, inner: Numbers, plan: Layout) -> Numbers:
    """(1 − N_b N_b')^-½ y_b of each block b: as variable as before the projection."""
    result = goal.copy()
    for rows in np.split(np.arange(len(goal)), np.flatnonzero(np.diff(plan.block)) + 1):
        part = inner[rows]
        part = part[:, np.any(np.abs(part) > 1e-12, axis=0)]
        if not part.size:
            continue
        if part.shape[1] < len(rows):
            value, turned = eigh(part.T @ part)
            kept = value > 1e-9
            vectors = part @ (turned[:, kept] / np.sqrt(value[kept]))
            value = value[kept]
        else:
            value, vectors = eigh(part @ part.T)
        grown = 1.0 / np.sqrt(1.0 - np.clip(value, 0.0, FLATTEST)) - 1.0
        result[rows] += vectors @ (grown * (vectors.T @ goal[rows]))
    return np.asarray(result)


@dataclass(frozen=True)
class Choice:
    """A set of columns. group: key of GROUPS, "" for all. subject: "" for the whole group. columns: indices."""

    group: str
    subject: str
    columns: Indices


def _choices(seen: Features, alive: NDArray[np.bool_]) -> list[Choice]:
    pairs = list(dict.fromkeys(zip(seen.group.tolist(), seen.subject.tolist(), strict=True)))
    names = list(dict.fromkeys(group for group, _ in pairs))
    sets = [Choice("", "", np.flatnonzero(alive))]
    sets += [Choice(group, "", np.flatnonzero(alive & (seen.group == group))) for group in names]
    sets += [
        Choice(group, subject, np.flatnonzero(alive & (seen.group == group) & (seen.subject == subject)))
        for group, subject in pairs
        if subject
    ]
    return [each for each in sets if len(each.columns)]


def _inner(gram: Numbers, choice: Choice, rows: int) -> tuple[Numbers, float]:
    """X'X of a choice with columns of total power 1, and the power divided by; all together stay as they are."""
    power = float(gram[choice.columns, choice.columns].sum()) / rows if choice.group else 1.0
    return gram[np.ix_(choice.columns, choice.columns)] / power, power


@dataclass(frozen=True)
class Skill:
    """What one choice of columns tells of a residual. surprise: −log p of this choice alone. excess: ratio of the
    variance of blocks to that of white noise, at least 1."""

    choice: Choice
    surprise: float
    excess: float


def skills(ready: Prepared, seen: Features, plan: Layout, rng: np.random.Generator) -> tuple[list[Skill], Numbers]:
    """Of all groups, of each of their subjects and of all columns together, the most telling first; and [DRAWS] the
    greatest surprise among them where there is nothing but noise."""
    even = _even_leverage(ready.goal.astype(np.float64), ready.inner, plan).astype(np.float32)
    starts = np.flatnonzero(np.diff(plan.block, prepend=-1))
    product = np.add.reduceat(ready.table * even[:, None], starts, axis=0)
    gram = (ready.table.T @ ready.table).astype(np.float64)
    whole = (ready.table.T @ ready.goal).astype(np.float64)
    drawn = _drawn(gram, rng)
    null = np.zeros(DRAWS)
    raw: list[tuple[Choice, float, tuple[float, float, float]]] = []
    ratios = []
    for choice in _choices(seen, ready.scale > 0.0):
        inner, power = _inner(gram, choice, len(ready.goal))
        columns = choice.columns
        right = np.concatenate([whole[columns, None], product[:, columns].T, drawn[columns]], axis=1) / np.sqrt(power)
        factor = cho_factor(inner + PENALTY * np.eye(len(inner)), lower=True, check_finite=False)[0]
        turned = solve_triangular(factor, right, lower=True, check_finite=False)
        shape = _shape(inner)
        if shape[1] > 0.0:
            single, paired = _block_power(turned[:, 1 : 1 + plan.blocks])
            raw.append((choice, float(np.sum(turned[:, 0] ** 2)), shape))
            ratios.append((single / shape[0], paired / shape[0]))
            null = np.maximum(null, _surprises(np.sum(turned[:, 1 + plan.blocks :] ** 2, axis=0), *shape))
    # the ratio of a small set is uncertain: its own counts only as far as it is beyond chance
    usual = max(1.0, *np.median(ratios, axis=0).tolist())
    found = []
    for (choice, score, shape), (single, _) in zip(raw, ratios, strict=True):
        excess = max(usual, single / CHANCE)
        found.append(Skill(choice, float(_surprises(np.array([score / excess]), *shape)[0]), excess))
    return sorted(found, key=lambda skill: -skill.surprise), null


def _drawn(gram: Numbers, rng: np.random.Generator) -> Numbers:
    """[D, DRAWS] X'y of white noise y."""
    # columns that depend on each other: a touch more on the diagonal than rounding takes off
    root = cholesky(gram + 1e-5 * gram.diagonal().max() * np.eye(len(gram)), lower=True, check_finite=False)
    return np.asarray(root @ rng.standard_normal((len(gram), DRAWS)))


def _shape(inner: Numbers) -> tuple[float, float, float]:
    """Mean, standard deviation and skewness of S for white noise."""
    value = eigvalsh(inner, check_finite=False).clip(0.0)
    share = value / (value + PENALTY)
    spread = float(np.sqrt(2.0 * np.sum(share**2)))
    return float(share.sum()), spread, min(8.0 * float(np.sum(share**3)) / max(spread, 1e-300) ** 3, 2.83)


def _block_power(blocks: Numbers) -> tuple[float, float]:
    """Σ |z_b|² of blocks [D, b], of single ones and of neighbours taken together."""
    both = blocks[:, 1:] + blocks[:, :-1]
    # every block but the two outer ones lies in two pairs
    paired = 0.5 * (float(np.sum(both**2)) + float(np.sum(blocks[:, [0, -1]] ** 2)))
    return float(np.sum(blocks**2)), paired


def _surprises(score: Numbers, mean: float, spread: float, skew: float) -> Numbers:
    """−log of the upper tail of Pearson's third distribution with these moments."""
    ratio = (score - mean) / spread
    if skew < 0.02:
        return np.asarray(-log_ndtr(-ratio))
    shape = 4.0 / skew**2
    return np.asarray(-np.log(np.maximum(gammaincc(shape, np.maximum(ratio * np.sqrt(shape) + shape, 0.0)), 1e-300)))


@dataclass(frozen=True)
class Prediction:
    """Of one joint, on unseen blocks. values: [U] N·m, off the nuisance columns.

    gains: of each choice, share of the whitened residual's variance that it takes away at its best penalty.
    """

    values: Numbers
    gains: tuple[float, ...]


def predicted(ready: Prepared, choices: Sequence[Choice], seen: Features, plan: Layout) -> Prediction:
    """By the best of these choices and PENALTIES, by the whitened gain on the unseen blocks."""
    tries = [
        (k, penalty)
        for k, choice in enumerate(choices)
        for penalty in (PENALTIES if len(choice.columns) > LARGE else (PENALTY,))
    ]
    folds = int(plan.fold_of.max()) + 1
    weights = np.zeros((len(tries), folds, ready.table.shape[1]))
    gram = (ready.table.T @ ready.table).astype(np.float64)
    for fold in range(folds):
        test = np.flatnonzero(plan.fold_of == fold)
        held = np.isin(plan.block, np.concatenate([test - 1, test, test + 1]))
        apart = ready.table[held]
        inner = gram - (apart.T @ apart).astype(np.float64)
        right = (ready.table[~held].T @ ready.goal[~held]).astype(np.float64)
        for number, (k, penalty) in enumerate(tries):
            columns = choices[k].columns
            matrix = inner[np.ix_(columns, columns)] + penalty * np.eye(len(columns))
            weights[number, fold, columns] = solve(matrix, right[columns], assume_a="pos", check_finite=False)
    guesses = np.stack([_by_fold(ready.table, each, plan) for each in weights])
    gains = (2.0 * guesses @ ready.goal.astype(np.float64) - np.sum(guesses**2, axis=1)) / len(ready.goal)
    best = int(np.argmax(gains))
    values = _by_fold(seen.values[plan.rows], weights[best] * ready.scale, plan)
    values -= ready.basis @ (ready.basis.T @ values)
    own = [
        max(gain for gain, (k, _) in zip(gains.tolist(), tries, strict=True) if k == each)
        for each in range(len(choices))
    ]
    return Prediction(values, tuple(own))


def _by_fold(table: NDArray[Any], weights: Numbers, plan: Layout) -> Numbers:
    """[U] of columns [U, D], each row with the weights [folds, D] of its fold."""
    used = np.any(weights != 0.0, axis=0)
    each = table[:, used] @ weights[:, used].T.astype(table.dtype)
    return np.asarray(each[np.arange(len(table)), plan.fold], dtype=np.float64)
