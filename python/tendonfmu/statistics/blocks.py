"""What a time series cut into short blocks consists of: the time of each block and its values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers


@dataclass(frozen=True)
class BlockSeries:
    """Block means of recordings, one after another: B blocks of n series each."""

    time: Numbers  # centre of each block [B] (s)
    recording: NDArray[np.int64]  # recording of each block [B], from 0
    segment: NDArray[np.int64]  # stretch without a gap of each block [B], from 0
    target: Numbers  # what has to be explained [B, n]
    used: NDArray[np.bool_]  # whether all samples of the block may be learned from [B]
    step: float  # length of a block (s)
