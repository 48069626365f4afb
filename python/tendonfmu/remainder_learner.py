"""A flexible learner with a calibrated null: ridge regression on whitened columns, blocks of time as its samples.

Residual and columns get the same treatment before anything is split: whitened by one autoregressive filter, projected
off the nuisance columns. Whether there is anything to learn: S = z'W z with z = X'y and W = (X'X + λ)^-1 (a score test
with a ridge prior). Had the noise of each block of a few seconds the other sign, z would be Σ s_b X_b'y_b: random signs
s give the distribution of S whatever the colour of the noise (block wild bootstrap), and S is a quadratic form in s, so
thousands of draws cost one small matrix. The projection takes more from the noise of some blocks than of others: each
block is corrected for its leverage (Bell and McCaffrey 2002, CR2). How much can be learned: the same regression, on
blocks it has not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, eigh, qr, solve, solve_toeplitz, solve_triangular
from scipy.stats import gamma, norm

from tendonfmu.remainder_features import Features

if TYPE_CHECKING:
    from tendonfmu.diagnosis_series import Series

Numbers = NDArray[np.float64]
Indices = NDArray[np.int64]

BLOCK = 2.0  # s: longer than the noise remembers once the bias splines are out
FOLD_BLOCKS = 3  # blocks side by side in a fold; one block on either side of them is learned from by nobody
FOLDS = 10
FEWEST_BLOCKS = 8
TEST_PENALTIES = (30.0, 300.0)  # noise variance over the variance that a group may explain
PENALTIES = (3.0, 30.0, 300.0)
FLATTEST = 0.95  # leverage that is corrected for, at most
MOST_ORDER = 12
DRAWS = 2000


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


def layout(series: Series) -> Layout:
    """Blocks of BLOCK seconds that no gap cuts, and folds of neighbouring blocks."""
    rows = np.flatnonzero(series.used)
    new = np.ones(len(rows), dtype=bool)
    if len(rows):
        new[1:] = (np.diff(rows) > 1) | (np.diff(series.segment[rows]) != 0)
    run = np.cumsum(new) - 1
    length = max(1, round(BLOCK / series.step))
    block = np.empty(len(rows), dtype=np.int64)
    count = 0
    starts = np.concatenate([np.flatnonzero(new), [len(rows)]])
    for first, end in pairwise(starts):
        pieces = max(1, round((end - first) / length))
        block[first:end] = count + np.arange(end - first) * pieces // (end - first)
        count += pieces
    bundle = np.arange(count) // FOLD_BLOCKS
    fold_of = bundle % max(1, min(FOLDS, int(bundle[-1]) + 1 if count else 1))
    return Layout(rows, run, block, fold_of[block] if count else block, count, fold_of)


def autoregression(signal: Numbers, run: Indices) -> Numbers:
    """Coefficients a_1.. of the whitening filter e_t = y_t + Σ a_l y_{t−l}, order by BIC (Yule-Walker)."""
    count = len(signal)
    covariance = np.array([_lagged(signal, run, lag) for lag in range(MOST_ORDER + 1)]) / max(count, 1)
    if covariance[0] <= 0.0:
        return np.empty(0)
    best, chosen = np.log(covariance[0]) * count, np.empty(0)
    for order in range(1, MOST_ORDER + 1):
        found = -solve_toeplitz(covariance[:order], covariance[1 : order + 1])
        variance = covariance[0] + found @ covariance[1 : order + 1]
        score = np.log(max(variance, 1e-12 * covariance[0])) * count + order * np.log(count)
        if score < best:
            best, chosen = score, found
    return np.asarray(chosen)


def _lagged(signal: Numbers, run: Indices, lag: int) -> float:
    if lag == 0:
        return float(signal @ signal)
    return float(np.sum((signal[lag:] * signal[:-lag])[run[lag:] == run[:-lag]]))


def whitened(values: NDArray[Any], coefficients: Numbers, run: Indices) -> NDArray[Any]:
    """values [U] or [U, k], filtered within each run; nothing is known before a run."""
    result = values.copy()
    for lag, coefficient in enumerate(coefficients, start=1):
        same = (run[lag:] == run[:-lag]).astype(values.dtype) * values.dtype.type(coefficient)
        result[lag:] += values[:-lag] * (same if values.ndim == 1 else same[:, None])
    return np.asarray(result)


def orthonormal(columns: Numbers) -> Numbers:
    """Orthonormal basis [U, r] of the span of columns [U, p]."""
    norms = np.linalg.norm(columns, axis=0)
    kept = columns[:, norms > 0.0] / norms[norms > 0.0]
    if not kept.shape[1]:
        return np.empty((len(columns), 0))
    basis, triangle, _ = qr(kept, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(triangle))
    return np.asarray(basis[:, : int(np.sum(diagonal > 1e-9 * diagonal[0]))])


@dataclass(frozen=True)
class Prepared:
    """One joint's residual and columns, whitened and projected; rows [U] of a layout.

    table: [U, D] float32, groups of equal power. goal: [U] float32, standard deviation 1. scale: [D] of the raw
    columns, weights in N·m; 0 for those that the nuisance columns leave nothing of. basis, inner: [U, r] orthonormal,
    of the nuisance columns before and after whitening.
    """

    table: NDArray[np.float32]
    goal: NDArray[np.float32]
    scale: Numbers
    basis: Numbers
    inner: Numbers


def prepared(residual: Numbers, nuisance: Numbers, seen: Features, plan: Layout) -> Prepared:
    """residual: [U] of the rows of the plan; nuisance: [U, p]; seen: columns of the same rows."""
    basis = orthonormal(nuisance)
    target = residual - basis @ (basis.T @ residual)
    coefficients = autoregression(target, plan.run)
    inner = orthonormal(whitened(nuisance, coefficients, plan.run))
    table = np.asarray(whitened(seen.values.astype(np.float32), coefficients, plan.run), dtype=np.float32)
    before = np.mean(table**2, axis=0)
    small = inner.astype(np.float32)
    table -= small @ (small.T @ table)
    after = np.mean(table**2, axis=0)
    scale = np.where(after > 1e-4 * before, 1.0, 0.0)  # nothing is left of the others but rounding
    for name in dict.fromkeys(seen.group.tolist()):
        power = float(np.sum((after * scale)[seen.group == name]))
        scale[seen.group == name] *= 1.0 / np.sqrt(power) if power > 0.0 else 0.0
    table *= scale.astype(np.float32)
    goal = whitened(target, coefficients, plan.run)
    goal -= inner @ (inner.T @ goal)
    spread = max(float(goal.std()), 1e-300)
    return Prepared(table, (goal / spread).astype(np.float32), scale * spread, basis, inner)


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


def ranked(ready: Prepared, seen: Features) -> list[Choice]:
    """All groups, each of their subjects, all columns together: the most telling first, by theory for white noise."""
    gram = (ready.table.T @ ready.table).astype(np.float64)
    whole = (ready.table.T @ ready.goal).astype(np.float64)
    scored = []
    for choice in _choices(seen, ready.scale > 0.0):
        inner, power = _inner(gram, choice, len(ready.goal))
        value, vectors = eigh(inner, check_finite=False)
        share = np.clip(value, 0.0, None) / (np.clip(value, 0.0, None) + TEST_PENALTIES[0])
        turned = vectors.T @ (whole[choice.columns] / np.sqrt(power))
        excess = float(np.sum(turned**2 / (value.clip(0.0) + TEST_PENALTIES[0])) - share.sum())
        spread, third = float(np.sqrt(2.0 * np.sum(share**2))), 8.0 * float(np.sum(share**3))
        skew = min(third / spread**3, 2.8) if spread > 0.0 else 0.0
        scored.append((float(_surprise(np.array([excess / max(spread, 1e-12)]), skew)[0]), choice))
    return [choice for _, choice in sorted(scored, key=lambda pair: -pair[0])]


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
    """What one choice of columns tells of a residual. kernel: [b, b] symmetric, without diagonal, unit null variance.

    score: over the standard deviation under the null. skew: of the null.
    """

    choice: Choice
    kernel: NDArray[np.float32]
    score: float
    skew: float

    @property
    def surprise(self) -> float:
        """−log p of this choice alone."""
        return float(_surprise(np.array([self.score]), self.skew)[0])


def skills(ready: Prepared, choices: Sequence[Choice], explained: Numbers, plan: Layout) -> list[Skill]:
    """explained: [U] what is predicted of the goal on unseen blocks, or 0: signs are drawn for what is left of it, else
    a strong effect would pass for noise of its own strength."""
    even = _even_leverage(ready.goal - explained, ready.inner, plan).astype(np.float32)
    product = np.zeros((plan.blocks, ready.table.shape[1]), dtype=np.float32)
    starts = np.flatnonzero(np.diff(plan.block, prepend=-1))
    np.add.reduceat(ready.table * even[:, None], starts, axis=0, out=product)
    gram = (ready.table.T @ ready.table).astype(np.float64)
    whole = (ready.table.T @ ready.goal).astype(np.float64)
    found = []
    for choice in choices:
        inner, power = _inner(gram, choice, len(ready.goal))
        right = np.column_stack([whole[choice.columns], product[:, choice.columns].T]) / np.sqrt(power)
        for penalty in TEST_PENALTIES:
            factor = cho_factor(inner + penalty * np.eye(len(inner)), lower=True, check_finite=False)[0]
            turned = solve_triangular(factor, right, lower=True, check_finite=False)
            kernel = turned[:, 1:].T @ turned[:, 1:]
            excess = float(turned[:, 0] @ turned[:, 0] - np.trace(kernel))
            np.fill_diagonal(kernel, 0.0)
            spread, skew = _null_shape(kernel)
            if spread > 0.0:
                found.append(Skill(choice, (kernel / spread).astype(np.float32), excess / spread, skew))
    return found


def _null_shape(kernel: Numbers) -> tuple[float, float]:
    """Standard deviation and skewness of s'K s over random signs; exact where the diagonal of K is 0."""
    variance = 2.0 * float(np.sum(kernel**2))
    if variance <= 0.0:
        return 0.0, 0.0
    third = 8.0 * float(np.sum((kernel @ kernel) * kernel))
    return float(np.sqrt(variance)), float(np.clip(third / variance**1.5, 0.0, 2.8))


def _surprise(score: Numbers, skew: float) -> Numbers:
    """−log of the upper tail of Pearson's third distribution with mean 0, variance 1."""
    if skew < 0.02:
        return np.asarray(-norm.logsf(score))
    shape = 4.0 / skew**2
    return np.asarray(-gamma.logsf(np.maximum(score * np.sqrt(shape) + shape, 1e-12), shape))


def null_surprises(found: Sequence[Skill], blocks: int, seed: int) -> Numbers:
    """[DRAWS] the greatest surprise of all sets of all joints over random signs of the blocks."""
    signs = np.random.default_rng(seed).choice(np.array([-1.0, 1.0], dtype=np.float32), (DRAWS, blocks))
    best = np.zeros(DRAWS)
    for each in found:
        score = np.einsum("ij,ij->i", signs @ each.kernel, signs)
        best = np.maximum(best, _surprise(score.astype(np.float64), each.skew))
    return best


@dataclass(frozen=True)
class Prediction:
    """Of one joint, on unseen blocks. goal: [U] of the whitened residual. values: [U] N·m, off the nuisance columns.

    gains: of each choice, share of the whitened residual's variance that it takes away at its best penalty.
    """

    goal: Numbers
    values: Numbers
    gains: tuple[float, ...]


def predicted(ready: Prepared, choices: Sequence[Choice], seen: Features, plan: Layout) -> Prediction:
    """By the best of these choices and PENALTIES, by the whitened gain on the unseen blocks."""
    tries = [(choice.columns, penalty) for choice in choices for penalty in PENALTIES]
    folds = int(plan.fold_of.max()) + 1
    weights = np.zeros((len(tries), folds, ready.table.shape[1]))
    gram = (ready.table.T @ ready.table).astype(np.float64)
    for fold in range(folds):
        test = np.flatnonzero(plan.fold_of == fold)
        held = np.isin(plan.block, np.concatenate([test - 1, test, test + 1]))
        apart = ready.table[held]
        inner = gram - (apart.T @ apart).astype(np.float64)
        right = (ready.table[~held].T @ ready.goal[~held]).astype(np.float64)
        for number, (columns, penalty) in enumerate(tries):
            matrix = inner[np.ix_(columns, columns)] + penalty * np.eye(len(columns))
            weights[number, fold, columns] = solve(matrix, right[columns], assume_a="pos", check_finite=False)
    guesses = np.stack([_by_fold(ready.table, each, plan) for each in weights])
    gains = (2.0 * guesses @ ready.goal.astype(np.float64) - np.sum(guesses**2, axis=1)) / len(ready.goal)
    best = int(np.argmax(gains))
    values = _by_fold(seen.values, weights[best] * ready.scale, plan)
    values -= ready.basis @ (ready.basis.T @ values)
    return Prediction(guesses[best], values, tuple(gains.reshape(len(choices), -1).max(axis=1).tolist()))


def _by_fold(table: NDArray[Any], weights: Numbers, plan: Layout) -> Numbers:
    """[U] of columns [U, D], each row with the weights [folds, D] of its fold."""
    used = np.any(weights != 0.0, axis=0)
    each = table[:, used] @ weights[:, used].T.astype(table.dtype)
    return np.asarray(each[np.arange(len(table)), plan.fold], dtype=np.float64)
