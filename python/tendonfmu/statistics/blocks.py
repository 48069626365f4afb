"""Time series cut into short blocks, with what statistics ask of them: when each was, and what stands in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class BlockSeries:
    """Recordings one after another, block means; B blocks of n series each.

    time: [B] s, centre. recording: [B] from 0; segment: [B] stretch without a gap, from 0. target: [B, n] what is to be
    explained. used: [B] whether all its samples may be learned from. step: s.
    """

    time: Numbers
    recording: NDArray[np.int64]
    segment: NDArray[np.int64]
    target: Numbers
    used: NDArray[np.bool_]
    step: float
