"""Products of columns by fold, of which `block_grams` makes held-out errors."""

from __future__ import annotations

from copy import copy

import numpy as np

from tendonfmu.arrays import Array, Indices, Numbers
from tendonfmu.statistics.folds import Folds
from tendonfmu.statistics.splines import Span, Splines

PIECE = 4096  # rows at a time


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
        for begin in range(0, len(rows), PIECE):
            part = rows[begin : begin + PIECE]
            columns = self.table[part].reshape(len(part) * joints, size).astype(np.float64)
            total += columns.T @ columns
        return total

    def chosen(self, shared: Numbers | None, candidates: Indices | None) -> Products:
        """Return the products with other columns."""
        # shared: [c, k]
        u = self.nominal_count
        mixed = np.zeros((self.count, 0)) if shared is None else shared
        kept = np.arange(self.count) if candidates is None else candidates
        if not mixed.shape[1] and len(kept) == self.count:
            return self
        found = copy(self)
        found.nominal_count, found.count = u + mixed.shape[1], len(kept)
        added = self.table[:, :, u:] @ mixed.astype(np.float32)
        found.table = np.concatenate([self.table[:, :, :u], added, self.table[:, :, u + kept]], axis=2)
        found.by_fold = [self._turned(each, mixed, u + kept) for each in self.by_fold]
        return found

    def _turned(self, products: Numbers, mixed: Numbers, kept: Indices) -> Numbers:
        """Return products [u + k + kept]² from [u + c]². kept: indices among all columns."""
        u = self.nominal_count
        cross = products[:, u:] @ mixed
        own = np.concatenate([np.arange(u), kept])
        count = mixed.shape[1]
        found = np.empty((len(own) + count, len(own) + count))
        place = np.concatenate([np.arange(u), u + count + np.arange(len(kept))])
        found[np.ix_(place, place)] = products[np.ix_(own, own)]
        found[place, u : u + count] = cross[own]
        found[u : u + count, place] = cross[own].T
        found[u : u + count, u : u + count] = mixed.T @ cross[u:]
        return found

    def with_own(self, values: Array) -> Products:
        """Return the products with other candidates."""
        # values: [r, n, k]
        u = self.nominal_count
        found = copy(self)
        found.count = values.shape[2]
        found.table = np.concatenate([self.table[:, :, :u], values.astype(np.float32)], axis=2)
        found.by_fold = []
        for number, products in enumerate(self.by_fold):
            rows = self.folds.fold == number
            part = found.table[rows]
            own = part.reshape(part.shape[0] * part.shape[1], u + found.count).astype(np.float64)
            cross = own.T @ own[:, u:]
            both = np.empty((u + found.count, u + found.count))
            both[:u, :u] = products[:u, :u]
            both[:, u:] = cross
            both[u:, :u] = cross[:u].T
            found.by_fold.append(both)
        return found
