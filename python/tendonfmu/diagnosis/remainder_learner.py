"""Two flexible learners without physics, judged on stretches that they have not seen.

- ridge regressions on groups of simple functions, mixed by non-negative weights;
- gradient-boosted trees on the states themselves, which find products of several of them.

Weights of a mixture are learned from predictions that saw neither the fold that is judged nor the one they predict:
learned from ordinary held-out predictions they find something in pure noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from itertools import combinations

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.optimize import nnls
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from tendonfmu.arrays import Indices, Numbers
from tendonfmu.diagnosis.remainder_features import Features
from tendonfmu.statistics import Folds, Span, Splines

PENALTIES = (1e-3, 1e-2, 1e-1)  # of the number of rows: a standardised column with a smaller weight is noise
FEWEST_FOLDS = 3  # weights are learned without two of them
FLAT = 0.02  # of the mean power of the predictions: keeps weights of predictions that are alike from running apart
MOST_ROWS = 1000  # that a tree sees: blocks of 10 ms are much alike
TREES = {"learning_rate": 0.2, "max_iter": 30, "max_leaf_nodes": 8, "min_samples_leaf": 10, "l2_regularization": 1.0}


class Learner:
    """Residuals of all joints and the columns that may predict them, both without the slow bias."""

    def __init__(self, seen: Features, residual: Numbers, splines: Splines, folds: Folds) -> None:
        """Prepare the residual [B, n], N·m, with the splines [B, s] of the bias."""
        self._span = Span(splines[folds.rows])
        table = self._span.without(seen.values[folds.rows]).astype(np.float32)
        spread = table.std(axis=0)
        self._table = table / np.where(spread > 1e-4, spread, np.inf)
        self.folds = folds
        self.columns = np.arange(table.shape[1])
        rows = [folds.fold == number for number in range(folds.folds)]
        self._rows = rows
        self._count = np.array([int(inside.sum()) for inside in rows])
        self._gram = np.array([(self._table[inside].T @ self._table[inside]).astype(np.float64) for inside in rows])
        self._whole_gram = self._gram.sum(axis=0)
        self._learn(residual)

    def _learn(self, residual: Numbers) -> None:
        self.target = self._span.without(residual[self.folds.rows])
        self._score = np.array(
            [self._table[inside].T.astype(np.float64) @ self.target[inside] for inside in self._rows]
        )
        self._whole_score = self._score.sum(axis=0)

    def of(self, residual: Numbers) -> Learner:
        """Return the learner of other residuals [B, n]."""
        other = copy(self)
        other._learn(residual)
        return other

    def predicted(self, columns: Indices) -> Numbers:
        """Return predictions of unseen folds [R, n], N·m, with the best penalty for each joint."""
        parts = [self._predict(fold, self._fitted([columns], (fold,))) for fold in range(self.folds.folds)]
        ways = np.zeros((len(PENALTIES), *self.target.shape))
        for inside, part in zip(self._rows, parts, strict=True):
            ways[:, inside] = np.moveaxis(part, 1, 0)
        best = np.argmin(np.sum((ways - self.target) ** 2, axis=1), axis=0)
        return np.stack([ways[best[joint], :, joint] for joint in range(len(best))], axis=1)

    def mixed(self, sets: Sequence[Indices], choices: Sequence[Sequence[int]]) -> list[Numbers]:
        """Return for each choice of sets of columns the mixed predictions of unseen folds [R, n], N·m."""
        folds = range(self.folds.folds)
        if len(folds) < FEWEST_FOLDS:
            return [self.predicted(np.concatenate([sets[k] for k in choice])) for choice in choices]
        without = {pair: self._fitted(sets, pair) for pair in combinations(folds, 2)}
        mixtures = [np.zeros_like(self.target) for _ in choices]
        for fold in folds:
            others = [other for other in folds if other != fold]
            inner = [self._predict(other, without[min(fold, other), max(fold, other)]) for other in others]
            table, outer = np.concatenate(inner), self._predict(fold, self._fitted(sets, (fold,)))
            known = np.concatenate([self.target[self._rows[other]] for other in others])
            for mixture, choice in zip(mixtures, choices, strict=True):
                chosen = np.concatenate([np.arange(len(PENALTIES)) + k * len(PENALTIES) for k in choice])
                for joint in range(known.shape[1]):
                    weights = mixing_weights(table[:, chosen, joint], known[:, joint])
                    mixture[self._rows[fold], joint] = outer[:, chosen, joint] @ weights
        return mixtures

    def _fitted(self, sets: Sequence[Indices], out: tuple[int, ...]) -> list[tuple[Indices, Numbers]]:
        """Return the weights of each set of columns, learned without some folds [columns, penalties, n]."""
        rows = float(self._count.sum() - self._count[list(out)].sum())
        fitted: list[tuple[Indices, Numbers]] = []
        for columns in sets:
            chosen = np.ix_(columns, columns)
            gram, score = self._whole_gram[chosen], self._whole_score[columns]
            for fold in out:
                gram, score = gram - self._gram[fold][chosen], score - self._score[fold][columns]
            weights = [
                cho_solve(cho_factor(gram + penalty * rows * np.eye(len(columns)), check_finite=False), score)
                for penalty in PENALTIES
            ]
            fitted.append((columns, np.stack(weights, axis=1)))
        return fitted

    def _predict(self, fold: int, fitted: Sequence[tuple[Indices, Numbers]]) -> Numbers:
        """Return the predictions of each set and penalty [rows, sets × penalties, n]."""
        table = self._table[self._rows[fold]]
        parts = [np.tensordot(table[:, columns], weights.astype(np.float32), axes=1) for columns, weights in fitted]
        return np.concatenate(parts, axis=1).astype(np.float64)

    def by_trees(self, states: Numbers, joint: int, seed: int) -> Numbers:
        """Return predictions of unseen folds [R], N·m, by gradient-boosted trees on states [B, f]."""
        from sklearn.ensemble import HistGradientBoostingRegressor  # takes a second to load

        table, prediction = states[self.folds.rows].astype(np.float32), np.zeros(len(self.target))
        for inside in self._rows:
            train = np.flatnonzero(~inside)
            train = train[:: max(1, len(train) // MOST_ROWS)]
            trees = HistGradientBoostingRegressor(**TREES, early_stopping=False, random_state=seed)
            # its threads come with its library, so no limit that was set before it was loaded holds for them
            with threadpool_limits(limits=1, user_api="openmp"):
                trees.fit(table[train], self.target[train, joint])
                prediction[inside] = trees.predict(table[inside])
        return self._span.without(prediction[:, None])[:, 0]

    def gains(self, prediction: Numbers) -> Numbers:
        """Return by how much a prediction [R, n] lowers the squares, (N·m)² [stretches, n]."""
        change = self.target**2 - (self.target - prediction) ** 2
        return np.stack(
            [np.bincount(self.folds.stretch, values, minlength=self.folds.stretches) for values in change.T], axis=1
        )


def mixing_weights(table: Numbers, target: Numbers) -> Numbers:
    """Return weights of predictions [R, c] of a target [R]: none below 0, their sum at most 1."""
    gram = table.T @ table
    gram += max(FLAT * float(np.trace(gram)) / len(gram), 1e-300) * np.eye(len(gram))
    root = cholesky(gram)  # upper
    weights = nnls(root, solve_triangular(root, table.T @ target, trans="T"))[0]
    return np.asarray(weights / max(1.0, float(weights.sum())))
