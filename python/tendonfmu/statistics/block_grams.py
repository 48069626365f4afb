"""What the held-out error of any subset of columns is, computed from Gram matrices without touching samples again.

Target and columns are block means with the slow bias projected out of both. The products of all columns are kept for
each fold; leaving a fold out is a subtraction. The numbers of the nominal model are refitted without the fold each time
(Frisch and Waugh, 1933): candidates and target are replaced by what that refit leaves of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from tendonfmu.arrays import Array, Indices, Numbers
from tendonfmu.statistics.blocks import Folds, Span, Splines

MEMORY = 20.0  # blocks over which noise is correlated, about; so many rows count as one against prior knowledge
_PIECE = 4096  # rows at a time
_SMALLEST = 1e-100  # of a scale; its square does not underflow


class Products:
    """Columns without a slow bias, and their products by fold: the part that does not depend on a target."""

    def __init__(self, folds: Folds, nominal: Array, values: Array, splines: Splines) -> None:
        """Project the bias out, and multiply."""
        self.folds, self.nominal_count, self.count = folds, nominal.shape[2], values.shape[2]
        rows, joints = folds.rows, nominal.shape[1]
        self.span = Span(splines[rows])
        self.table = np.empty((len(rows), joints, self.nominal_count + self.count), dtype=np.float32)
        for j in range(joints):
            self.table[:, j, : self.nominal_count] = self.span.without(nominal[rows, j])
            self.table[:, j, self.nominal_count :] = self.span.without(values[rows, j])
        self.by_fold = [self._of(np.flatnonzero(folds.fold == number)) for number in range(folds.folds)]

    def _of(self, rows: Indices) -> Numbers:
        """Return the products [u + c]² of some rows."""
        size, joints = self.table.shape[2], self.table.shape[1]
        total = np.zeros((size, size))
        for begin in range(0, len(rows), _PIECE):
            part = rows[begin : begin + _PIECE]
            columns = self.table[part].reshape(len(part) * joints, size).astype(np.float64)
            total += columns.T @ columns
        return total

    def chosen(self, shared: Numbers | None, candidates: Indices | None) -> Products:
        """Return the products with other columns. shared: [c, k]."""
        u = self.nominal_count
        mixed = np.zeros((self.count, 0)) if shared is None else shared
        kept = np.arange(self.count) if candidates is None else candidates
        if not mixed.shape[1] and len(kept) == self.count:
            return self
        products = copy(self)
        products.nominal_count, products.count = u + mixed.shape[1], len(kept)
        added = self.table[:, :, u:] @ mixed.astype(np.float32)
        products.table = np.concatenate([self.table[:, :, :u], added, self.table[:, :, u + kept]], axis=2)
        products.by_fold = [self._turned(of_fold, mixed, u + kept) for of_fold in self.by_fold]
        return products

    def _turned(self, products: Numbers, mixed: Numbers, kept: Indices) -> Numbers:
        """Return products [u + k + kept]² from [u + c]². kept: indices among all columns."""
        u = self.nominal_count
        cross = products[:, u:] @ mixed
        rows = np.concatenate([np.arange(u), kept])
        count = mixed.shape[1]
        turned = np.empty((len(rows) + count, len(rows) + count))
        place = np.concatenate([np.arange(u), u + count + np.arange(len(kept))])
        turned[np.ix_(place, place)] = products[np.ix_(rows, rows)]
        turned[place, u : u + count] = cross[rows]
        turned[u : u + count, place] = cross[rows].T
        turned[u : u + count, u : u + count] = mixed.T @ cross[u:]
        return turned

    def with_own(self, values: Array) -> Products:
        """Return the products with other candidates. values: [r, n, k]."""
        u = self.nominal_count
        changed = copy(self)
        changed.count = values.shape[2]
        changed.table = np.concatenate([self.table[:, :, :u], values.astype(np.float32)], axis=2)
        changed.by_fold = []
        for number, products in enumerate(self.by_fold):
            rows = self.folds.fold == number
            part = changed.table[rows]
            columns = part.reshape(part.shape[0] * part.shape[1], u + changed.count).astype(np.float64)
            cross = columns.T @ columns[:, u:]
            both = np.empty((u + changed.count, u + changed.count))
            both[:u, :u] = products[:u, :u]
            both[:, u:] = cross
            both[u:, :u] = cross[:u].T
            changed.by_fold.append(both)
        return changed


@dataclass(frozen=True)
class _Fold:
    """One fold left out."""

    refit: Numbers  # numbers of the nominal model for each candidate, and for the target [u, c + 1]
    energy: Numbers  # [c, c] and [c] of the other folds, nominal numbers refitted
    score: Numbers
    own_energy: Numbers  # the same on the fold itself: [c, c], [c] and a number
    own_score: Numbers
    own_square: float


class Grams:
    """Products of a target, of the nominal model's columns and of candidates, by fold."""

    def __init__(
        self, products: Products, target: Numbers, scale: Numbers, judged: NDArray[np.bool_] | None = None
    ) -> None:
        folds = self.folds = products.folds
        self.nominal_count, self.count, self._table = products.nominal_count, products.count, products.table
        self._judged = np.ones(folds.folds, dtype=bool) if judged is None else judged
        self._counted = np.unique(folds.stretch[self._judged[folds.fold]])  # stretches
        self._span = products.span
        rows, joints = folds.rows, target.shape[1]
        self._target = np.stack([self._span.without(target[rows, j][:, None])[:, 0] for j in range(joints)], axis=1)
        self.square = float(np.sum(self._target**2))
        by_fold = self._with_target(products.by_fold)
        whole = np.sum(by_fold, axis=0)
        ridge = self.ridge(scale)
        self._raw = whole[self.nominal_count : -1, self.nominal_count : -1]  # products of the candidates
        diagonal = np.diagonal(whole)[: self.nominal_count]
        self._ridge = np.maximum(ridge, 1e-9 * diagonal) + 1e-300
        self._by_fold = [self._left_out(whole - held, held) for held in by_fold]
        self._whole = self._left_out(whole, whole)

    # --- making -------------------------------------------------------------------------------------------------------

    def _with_target(self, by_fold: Sequence[Numbers]) -> list[Numbers]:
        """Return the products [u + c + 1]² of all columns and the target, for each fold."""
        size = self._table.shape[2]
        extended = []
        for number, columns in enumerate(by_fold):
            rows = self.folds.fold == number
            target = self._target[rows].reshape(-1)
            values = self._table[rows].reshape(len(target), size)
            both = np.empty((size + 1, size + 1))
            both[:size, :size] = columns
            both[:size, size] = both[size, :size] = values.T.astype(np.float64) @ target
            both[size, size] = target @ target
            extended.append(both)
        return extended

    def _left_out(self, learned: Numbers, held: Numbers) -> _Fold:
        u = self.nominal_count
        inner = learned[:u, :u] + np.diag(self._ridge)
        refit = _solved(inner, learned[:u, u:])
        after = learned[u:, u:] - learned[u:, :u] @ refit
        mixed = held[u:, :u] @ refit
        there = held[u:, u:] - mixed - mixed.T + refit.T @ held[:u, :u] @ refit
        return _Fold(
            refit=refit,
            energy=after[:-1, :-1],
            score=after[:-1, -1],
            own_energy=there[:-1, :-1],
            own_score=there[:-1, -1],
            own_square=float(there[-1, -1]),
        )

    # --- errors -------------------------------------------------------------------------------------------------------

    @property
    def without(self) -> float:
        """Σ e² on held-out folds ((N·m)²) of the nominal model refitted, without any candidate."""
        return float(sum(fold.own_square for fold, counts in zip(self._by_fold, self._judged, strict=True) if counts))

    def surviving(self, mix: Numbers) -> float:
        """Return how much of a combination of candidates the refit leaves. mix: [c, d]."""
        used = np.flatnonzero(mix.any(axis=1))
        part, inner = mix[used], np.ix_(used, used)
        before = part.T @ self._raw[inner] @ part
        after = part.T @ self._whole.energy[inner] @ part
        length = np.sqrt(np.diagonal(before))
        if not (length > 0.0).all():
            return 0.0
        power, turned = np.linalg.eigh(before / (length[:, None] * length))
        kept = power > 1e-6 * power[-1]
        root = turned[:, kept] / np.sqrt(power[kept])
        left = root.T @ (after / (length[:, None] * length)) @ root
        return float(np.clip(np.linalg.eigvalsh(left)[-1], 0.0, 1.0))

    def ordinary_gain(self, mix: Numbers, expected: Numbers) -> float:
        """Return how far an effect of ordinary size would raise the error, or correcting it lower it again."""
        # mix: [c, d]; expected: [d]
        used = np.flatnonzero(mix.any(axis=1))
        part = mix[used] * expected
        energy = np.diagonal(part.T @ self._whole.energy[np.ix_(used, used)] @ part)
        there = max(float(np.mean(energy)), 0.0)
        return 1.0 - float(np.sqrt(self.without / max(self.without + there, 1e-300)))

    def ridge(self, scale: Numbers, square: float | None = None) -> Numbers:
        """Return the weights of the squares of numbers that are about as large as `scale`; 0 where that is unknown."""
        # scale: [d]; square: Σ e² of what is left ((N·m)²), that of the target if None; returns [d]
        spread = (self.square if square is None else square) / max(self._target.size, 1) * MEMORY
        ridge = np.zeros(len(scale))
        known = np.isfinite(scale) & (scale > 0)
        # a column of zeros has a huge scale; squaring the quotient cannot overflow, squaring the scale could
        ridge[known] = (np.sqrt(spread) / np.maximum(scale[known], _SMALLEST)) ** 2
        return ridge

    def magnitudes(self, mix: Numbers, low: Numbers, high: Numbers, ridge: Numbers | None = None) -> Numbers:
        """Return the magnitudes of a combination of candidates, learned from all folds."""
        # mix: [c, d]; low, high, ridge: [d]; returns [d]
        used = np.flatnonzero(mix.any(axis=1))
        part = mix[used]
        energy = part.T @ self._whole.energy[np.ix_(used, used)] @ part
        score = part.T @ self._whole.score[used]
        return np.asarray(bounded((energy + _diagonal(ridge))[None], score[None], low, high)[0])

    def error(self, mix: Numbers, low: Numbers, high: Numbers, ridge: Numbers | None = None) -> tuple[float, Numbers]:
        """Return the held-out error with a combination of candidates."""
        # mix: [c, d]; low, high, ridge: [d]; returns Σ e² on held-out folds ((N·m)²), learned without each fold [f, d]
        used = np.flatnonzero(mix.any(axis=1))
        part, inner, folds = mix[used], np.ix_(used, used), self._by_fold
        energy, held_energy = (
            part.T @ np.stack(matrices) @ part
            for matrices in ([fold.energy[inner] for fold in folds], [fold.own_energy[inner] for fold in folds])
        )
        score, held_score = (
            np.stack(scores) @ part
            for scores in ([fold.score[used] for fold in folds], [fold.own_score[used] for fold in folds])
        )
        theta = bounded(energy + _diagonal(ridge), score, low, high)
        gain = 2.0 * np.sum(theta * held_score, axis=1) - np.einsum("fd,fde,fe->f", theta, held_energy, theta)
        left = np.array([fold.own_square for fold in folds]) - gain
        return float(left[self._judged].sum()), theta

    def by_stretch(self, mix: Numbers | None, magnitudes: Numbers | None) -> Numbers:
        """Return the error of each stretch on unseen samples."""
        # mix: [c, d]; magnitudes: [f, d]; returns Σ e² [stretches that count] ((N·m)²)
        errors = np.zeros(self.folds.stretches)
        for number, counts in enumerate(self._judged):
            if counts:
                rows, left = self._unseen(number, mix, magnitudes)
                errors += np.bincount(self.folds.stretch[rows], np.sum(left**2, axis=1), minlength=self.folds.stretches)
        return np.asarray(errors[self._counted])

    def unseen_residual(self, mix: Numbers | None = None, magnitudes: Numbers | None = None) -> Numbers:
        """Return the residual on the unseen rows that count."""
        # returns [r, n] (N·m), in the order of `counted_stretch`
        return np.concatenate([self._unseen(int(k), mix, magnitudes)[1] for k in np.flatnonzero(self._judged)])

    @property
    def counted_stretch(self) -> NDArray[np.int64]:
        """Stretch of each unseen row that counts [r]."""
        stretches = [self.folds.stretch[self.folds.fold == k] for k in np.flatnonzero(self._judged)]
        return np.asarray(np.concatenate(stretches), dtype=np.int64)

    def _unseen(
        self, number: int, mix: Numbers | None, magnitudes: Numbers | None
    ) -> tuple[NDArray[np.bool_], Numbers]:
        """Return the rows of a fold, and the residual [r, n] (N·m) there of the model learned without it."""
        u, fold = self.nominal_count, self._by_fold[number]
        rows = self.folds.fold == number
        change = np.zeros(u + self.count)
        change[:u] = fold.refit[:, -1]
        if mix is not None and magnitudes is not None:
            added = mix @ magnitudes[number]
            change[u:] = added
            change[:u] -= fold.refit[:, :-1] @ added
        used = np.flatnonzero(change)
        return rows, np.asarray(self._target[rows] - self._table[rows][:, :, used] @ change[used])

    def scores(self, mix: Numbers, magnitudes: Numbers) -> tuple[Numbers, Numbers]:
        """Return the parts of a sandwich (cluster-robust) covariance of a combination of candidates."""
        # mix: [c, d]; magnitudes: [f, d]; returns [d, d], after the refit, [stretches, d]
        u, used = self.nominal_count, np.flatnonzero(mix.any(axis=1))
        part = mix[used]
        nominal = self._whole.refit[:, used] @ part
        scores = np.zeros((self.folds.stretches, mix.shape[1]))
        for number in range(self.folds.folds):
            rows, left = self._unseen(number, mix, magnitudes)
            table = self._table[rows]
            slopes = table[:, :, u + used] @ part - table[:, :, :u] @ nominal
            np.add.at(scores, self.folds.stretch[rows], np.einsum("rnd,rn->rd", slopes, left))
        return part.T @ self._whole.energy[np.ix_(used, used)] @ part, scores

    def left(self) -> tuple[Numbers, Numbers]:
        """Return the errors on unseen samples without any candidate, whether the stretches count or not."""
        # returns Σ e² of each stretch and joint [stretches, n] ((N·m)²), rows of each stretch [stretches]
        squares = np.zeros((self.folds.stretches, self._target.shape[1]))
        for number in range(self.folds.folds):
            rows, left = self._unseen(number, None, None)
            np.add.at(squares, self.folds.stretch[rows], left**2)
        return squares, np.bincount(self.folds.stretch, minlength=self.folds.stretches).astype(np.float64)

    @property
    def refitted(self) -> Numbers:
        """Change of the nominal numbers when they are refitted to all folds without any candidate [u]."""
        return np.asarray(self._whole.refit[:, -1])

    def errors_of(self, targets: Numbers) -> Numbers:
        """Return the held-out errors of other targets, the nominal numbers refitted to each."""
        # targets: [B, n, K] (N·m); returns Σ e² on held-out folds [K] ((N·m)²)
        u, rows = self.nominal_count, self.folds.rows
        flat = self._table[:, :, :u].astype(np.float64)
        left = np.stack([self._span.without(targets[rows, j]) for j in range(targets.shape[1])], axis=1)
        score = [np.einsum("rnu,rnk->uk", flat[held], left[held]) for held in self._rows_of_folds()]
        energy = [np.einsum("rnu,rnv->uv", flat[held], flat[held], optimize=True) for held in self._rows_of_folds()]
        errors = np.zeros(targets.shape[2])
        for k, held in enumerate(self._rows_of_folds()):
            inner = np.sum(energy, axis=0) - energy[k] + np.diag(self._ridge)
            refit = _solved(inner, np.sum(score, axis=0) - score[k])
            errors += np.einsum("rnk,rnk->k", left[held], left[held])
            errors += np.einsum("uk,uk->k", refit, energy[k] @ refit - 2.0 * score[k])
        return errors

    def _rows_of_folds(self) -> list[NDArray[np.bool_]]:
        return [self.folds.fold == number for number in range(self.folds.folds)]

    def residual(self) -> Numbers:
        """Return what the nominal model, refitted to all folds, leaves of the target. Returns [R, n] (N·m)."""
        change = self._whole.refit[:, -1]
        return np.asarray(self._target - self._table[:, :, : self.nominal_count] @ change)


def _diagonal(ridge: Numbers | None) -> Numbers | float:
    return 0.0 if ridge is None else np.diag(ridge)


def bounded(energy: Numbers, score: Numbers, low: Numbers, high: Numbers) -> Numbers:
    """Return the least-squares solutions between bounds of several problems [f, d]."""
    # energy: [f, d, d]; score: [f, d]
    count = score.shape[1]
    if count == 1:
        return np.asarray(np.clip(score / np.maximum(energy[:, 0] * (1.0 + 1e-9), 1e-300), low, high))
    length = np.sqrt(np.maximum(np.diagonal(energy, axis1=1, axis2=2), 1e-300))
    scaled = energy / (length[:, :, None] * length[:, None, :])
    right, least, most = score / length, low * length, high * length
    solutions, fixed = np.zeros_like(score), np.full(score.shape, np.nan)
    for _ in range(count + 1 if count else 0):
        free = np.isnan(fixed)
        at = np.where(free, 0.0, fixed)
        # the rows and columns of fixed numbers become those of the identity
        inner = np.where(free[:, :, None] & free[:, None, :], scaled, 0.0)
        inner += np.where(free, 1e-9, 1.0)[:, :, None] * np.eye(count)
        given = np.where(free, right - (scaled @ at[:, :, None])[:, :, 0], at)
        solutions = np.linalg.solve(inner, given[:, :, None])[:, :, 0]
        beyond = np.where(free, np.maximum(least - solutions, solutions - most), -np.inf)
        worst = np.argmax(beyond, axis=1)
        rows = np.flatnonzero(beyond[np.arange(len(worst)), worst] > 0.0)
        if not len(rows):
            break
        own = worst[rows]
        fixed[rows, own] = np.where(solutions[rows, own] < least[rows, own], least[rows, own], most[rows, own])
    return np.asarray(solutions / length)


def _solved(matrix: Numbers, right: Numbers) -> Numbers:
    """Solve a symmetric positive matrix for [u, k]. Its columns are scaled to length 1 first."""
    length = np.sqrt(np.diagonal(matrix))
    if not len(length):
        return np.zeros((0, right.shape[1]))
    scaled = matrix / (length[:, None] * length) + 1e-12 * np.eye(len(length))
    factor = cho_factor(scaled, lower=True, check_finite=False)
    return np.asarray(cho_solve(factor, right / length[:, None], check_finite=False) / length[:, None])


def standard_error(gains: Sequence[float] | Numbers) -> float:
    """Return the standard error of a sum of gains. gains: [K]."""
    values = np.asarray(gains)
    return float(np.sqrt(len(values)) * np.std(values, ddof=1)) if len(values) > 1 else np.inf
