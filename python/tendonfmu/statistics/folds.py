"""Contiguous parts of the recordings: folds that are held out in turn, and stretches that say how certain it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonfmu.statistics.blocks import BlockSeries

Indices = NDArray[np.int64]

STRETCH = 2.0  # s: longer than what a bias between the splines' knots remembers
MOST_FOLDS = 8
FEWEST_STRETCHES = 4  # two halves of two: below, nothing is said of unseen data


@dataclass(frozen=True)
class Folds:
    """rows: [R] blocks of the series that are used, in runs without a gap. run, stretch, fold: of each row, from 0.
    stretches, folds: their numbers.
    """

    rows: Indices
    run: Indices
    stretch: Indices
    fold: Indices
    stretches: int
    folds: int

    @property
    def enough(self) -> bool:
        """Whether a held-out error means anything."""
        return self.stretches >= FEWEST_STRETCHES


def make_folds(series: BlockSeries) -> Folds:
    """Stretches of about 2 s that no gap cuts, side by side in up to 8 folds of equally many."""
    rows = np.flatnonzero(series.used)
    length = max(1, round(STRETCH / series.step))
    new = (np.diff(rows, prepend=-2) > 1) | (np.diff(series.segment[rows], prepend=-1) != 0)
    run = np.cumsum(new) - 1
    stretch = np.zeros(len(rows), dtype=np.int64)
    count = 0
    for number in range(int(run[-1]) + 1 if len(run) else 0):
        own = np.flatnonzero(run == number)
        pieces = max(1, round(len(own) / length))
        stretch[own] = count + np.arange(len(own)) * pieces // len(own)
        count += pieces
    folds = max(1, min(MOST_FOLDS, count // 2))
    return Folds(rows, run, stretch, stretch * folds // max(count, 1), count, folds)
