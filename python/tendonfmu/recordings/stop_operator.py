"""Stop operators: what is elastic until it slips, so that it remembers which way something moved last."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tendonfmu.arrays import Indices, Numbers


def stopped(drivers: Numbers, widths: Numbers, times: Numbers, step: float, starts: Indices) -> Numbers:
    """Return stop operators of drivers [B, k] with widths [k] and times [k] (s), as shares of their widths [B, k]."""
    kept = np.exp(-step / times)
    moves = np.diff(drivers, axis=0, prepend=drivers[:1]) / widths
    states = np.zeros_like(drivers)
    for first, end in pairwise(starts):
        state = np.zeros(drivers.shape[1])
        for k in range(first + 1, end):
            state = np.clip(kept * state + moves[k], -1.0, 1.0)
            states[k] = state
    return states
