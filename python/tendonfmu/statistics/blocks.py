"""How time series are cut into blocks: their averages, and the folds whose blocks are held out together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Indices, Numbers

STRETCH = 2.0  # s; longer than the correlation of a bias between the splines' knots
MOST_FOLDS = 8
FEWEST_STRETCHES = 4  # two halves of two; with fewer there is no held-out error


@dataclass(frozen=True)
class BlockSeries:
    """Block means of recordings, one after another: B blocks of n series each."""

    time: Numbers  # centre of each block [B] (s)
    recording: NDArray[np.int64]  # recording of each block [B], from 0
    segment: NDArray[np.int64]  # stretch without a gap of each block [B], from 0
    target: Numbers  # what has to be explained [B, n]
    used: NDArray[np.bool_]  # whether all samples of the block may be learned from [B]
    step: float  # length of a block (s)


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
        members = np.flatnonzero(run == number)
        pieces = max(1, round(len(members) / length))
        stretch[members] = count + np.arange(len(members)) * pieces // len(members)
        count += pieces
    folds = max(1, min(MOST_FOLDS, count // 2))
    return Folds(rows, run, stretch, stretch * folds // max(count, 1), count, folds)
