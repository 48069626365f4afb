"""What a time series cut into short blocks consists of: the time of each block and its values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class BlockSeries:
    """Block means of recordings, one after another: B blocks of n series each.

    Attributes
    ----------
    time
        Centre of each block [B] (s).
    recording
        Recording of each block [B], from 0.
    segment
        Stretch without a gap of each block [B], from 0.
    target
        What has to be explained [B, n].
    used
        Whether all samples of the block may be learned from [B].
    step
        Length of a block (s).
    """

    time: Numbers
    recording: NDArray[np.int64]
    segment: NDArray[np.int64]
    target: Numbers
    used: NDArray[np.bool_]
    step: float
