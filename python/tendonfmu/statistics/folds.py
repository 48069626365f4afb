"""Which contiguous parts of recordings are held out in turn (folds), and which show the uncertainty (stretches)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Indices
from tendonfmu.statistics.blocks import BlockSeries

STRETCH = 2.0  # s; longer than the correlation of a bias between the splines' knots
MOST_FOLDS = 8
FEWEST_STRETCHES = 4  # two halves of two; with fewer there is no held-out error


@dataclass(frozen=True)
class Folds:
    """Folds and stretches of the blocks of a series."""

    rows: Indices  # blocks of the series that are used [R], in runs without a gap
    run: Indices  # of each row [R], from 0
    stretch: Indices
    fold: Indices
    stretches: int  # their numbers
    folds: int

    @property
    def enough(self) -> bool:
        """Whether there are enough stretches for a meaningful held-out error."""
        return self.stretches >= FEWEST_STRETCHES


def make_folds(series: BlockSeries) -> Folds:
    """Make stretches of about 2 s without gaps, and up to 8 contiguous folds of equally many stretches."""
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
