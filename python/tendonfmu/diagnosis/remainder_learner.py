"""How well a flexible learner without physics predicts a residual: ridge regression, judged on unseen stretches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve

from tendonfmu.arrays import Indices, Numbers
from tendonfmu.diagnosis.remainder_features import Features
from tendonfmu.statistics import Folds, Span, Splines

PENALTIES = (1e-3, 1e-2, 1e-1)  # of the number of rows: a standardised column with a smaller weight is noise


@dataclass(frozen=True)
class Choice:
    """A set of columns."""

    group: str  # key of GROUPS; "" for all groups
    subject: str  # subject within the group; "" for the whole group
    columns: Indices  # indices of the columns


def choices(seen: Features) -> list[Choice]:
    """Return all columns, those of each group, and those of each subject of each group."""
    pairs = list(dict.fromkeys(zip(seen.group.tolist(), seen.subject.tolist(), strict=True)))
    names = list(dict.fromkeys(group for group, _ in pairs))
    listed = [Choice("", "", np.arange(len(seen.group)))]
    listed += [Choice(name, "", np.flatnonzero(seen.group == name)) for name in names]
    listed += [
        Choice(group, subject, np.flatnonzero((seen.group == group) & (seen.subject == subject)))
        for group, subject in pairs
        if subject
    ]
    return listed


class Learner:
    """Residuals of all joints and the columns that may predict them, both without the slow bias."""

    def __init__(self, seen: Features, residual: Numbers, splines: Splines, folds: Folds) -> None:
        """Prepare the residual [B, n], N·m, with the splines [B, s] of the bias."""
        span = Span(splines[folds.rows])
        table = span.without(seen.values[folds.rows]).astype(np.float32)
        spread = table.std(axis=0)
        self._table = table / np.where(spread > 1e-4, spread, np.inf)
        self.target = span.without(residual[folds.rows])
        self.folds = folds
        self.columns = np.arange(table.shape[1])
        own = [folds.fold == number for number in range(folds.folds)]
        self._rows = own
        self._gram = [(self._table[rows].T @ self._table[rows]).astype(np.float64) for rows in own]
        self._score = [self._table[rows].T.astype(np.float64) @ self.target[rows] for rows in own]

    def predicted(self, columns: Indices) -> Numbers:
        """Return predictions of unseen folds [R, n], N·m, with the best penalty for each joint."""
        gram, score = np.sum(self._gram, axis=0)[np.ix_(columns, columns)], np.sum(self._score, axis=0)[columns]
        predictions = np.zeros((len(PENALTIES), *self.target.shape))
        for rows, own, part in zip(self._rows, self._gram, self._score, strict=True):
            inner, right = gram - own[np.ix_(columns, columns)], score - part[columns]
            seen = self._table[rows][:, columns]
            for k, penalty in enumerate(PENALTIES):
                ridge = penalty * float((~rows).sum()) * np.eye(len(columns))
                weights = solve(inner + ridge, right, assume_a="pos", check_finite=False)
                predictions[k, rows] = seen @ weights.astype(np.float32)
        best = np.argmin(np.sum((predictions - self.target) ** 2, axis=1), axis=0)
        return np.stack([predictions[best[j], :, j] for j in range(self.target.shape[1])], axis=1)

    def gains(self, prediction: Numbers) -> Numbers:
        """Return by how much a prediction [R, n] lowers the squares, (N·m)² [stretches, n]."""
        change = self.target**2 - (self.target - prediction) ** 2
        return np.stack(
            [np.bincount(self.folds.stretch, values, minlength=self.folds.stretches) for values in change.T], axis=1
        )
