"""How time series are cut into blocks: their averages, and the folds whose blocks are held out together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Indices, Numbers
from tendonfmu.errors import InputError

NO_BLOCK = -1
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
class SampleBlocks:
    """Which samples each block averages."""

    # for each recording the block of each sample [N], from 0 over all recordings; −1: in no block
    of: tuple[Indices, ...]
    count: int  # number of all blocks

    def sizes(self) -> Indices:
        """Count the samples in each block."""
        # returns [B]
        total = np.zeros(self.count, dtype=np.int64)
        for block in self.of:
            total += np.bincount(block[block >= 0], minlength=self.count)
        return total


def regular_blocks(times: Sequence[Numbers], parts: Sequence[Sequence[slice]], length: float) -> SampleBlocks:
    """Make blocks of the same length."""
    # times: [N] (s); length: (s)
    if not length > 0:
        raise InputError(f"length of a block = {length:g} s: expected above 0")
    blocks, count = [], 0
    for time, slices in zip(times, parts, strict=True):
        block = np.full(len(time), NO_BLOCK, dtype=np.int64)
        for part in slices:
            # half a microsecond: a rounded sample time at a boundary belongs to the block that begins there
            number = np.floor((time[part] - time[part.start] + 5e-7) / length).astype(np.int64)
            new = np.cumsum(np.diff(number, prepend=number[0]) > 0)
            block[part] = count + new
            count += int(new[-1]) + 1
        blocks.append(block)
    return SampleBlocks(tuple(blocks), count)


class BlockSums:
    """Sums over blocks, filled stretch by stretch."""

    def __init__(self, sums: NDArray[Any], mix: Any = None) -> None:
        """Start at the beginning of a part."""
        self._sums, self._mix = sums, mix
        self._carried: Numbers | None = None

    def add(self, block: Indices, values: Numbers, jumps: Numbers) -> None:
        """Add a stretch of samples."""
        # block: [K]; values, jumps: [K, n, u]
        starts = np.flatnonzero(np.diff(block, prepend=block[0] - 1))
        runs = np.add.reduceat(values, starts, axis=0)
        self._add_jumps(runs, jumps, starts, np.diff(starts, append=len(block)))
        numbers = block[starts]
        inside = numbers >= 0
        chosen = runs[inside]
        if self._mix is not None:
            rows, joints, given = chosen.shape
            chosen = np.asarray(chosen.reshape(rows * joints, given) @ self._mix).reshape(
                rows, joints, self._mix.shape[1]
            )
        self._sums[numbers[inside]] += chosen

    def _add_jumps(self, runs: Numbers, jumps: Numbers, starts: Indices, lengths: Indices) -> None:
        """Add to each run what its samples have of all jumps before them, and of those at them."""
        flat = jumps.reshape(len(jumps), -1)
        total = runs.reshape(len(runs), -1)
        if self._carried is not None:
            total += lengths[:, None] * self._carried
        rows = np.flatnonzero(flat.any(axis=1))
        if not len(rows):
            return
        ends = starts + lengths
        # a jump at row k counts for all samples of later runs, and for those of its own run from k on
        share = np.clip(ends[:, None] - np.maximum(rows[None, :], starts[:, None]), 0, None).astype(np.float64)
        total += share @ flat[rows]
        last = flat[rows].sum(axis=0)
        self._carried = last if self._carried is None else self._carried + last


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
