"""How well detected contact agrees with labelled pushes: what was found, and what was said without a push."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.figure_data import Interval, intervals

Flags = NDArray[Any]

QUIET = 0.2  # s before a push: an alarm in there was on already and has not found it. Alarms closer than that are one.


@dataclass(frozen=True)
class ContactScore:
    """found: pushes with an alarm in them and none in the `QUIET` time before. outside: alarms where no push is.

    outside_share: part of the samples without a push that are alarms, 0 to 1.
    """

    pushes: int
    found: int
    outside: list[Interval]
    outside_share: float


def score_contacts(time: NDArray[np.float64], label: Flags, alarm: Flags) -> ContactScore:
    """time: [N] s. label, alarm: [N] flags, whether somebody pushes and whether the detector says so."""
    pushed, alarmed = np.asarray(label).ravel().astype(bool), np.asarray(alarm).ravel().astype(bool)
    pushes = intervals(time, pushed)
    found = 0
    for begin, end in pushes:
        before = (time >= begin - QUIET) & (time < begin)
        during = (time >= begin) & (time <= end)
        found += bool(alarmed[during].any() and not alarmed[before].any())
    outside = alarmed & ~pushed
    free = int((~pushed).sum())
    return ContactScore(
        pushes=len(pushes),
        found=found,
        outside=merged(intervals(time, outside), QUIET),
        outside_share=float(outside.sum()) / free if free else 0.0,
    )


def merged(found: list[Interval], gap: float) -> list[Interval]:
    """Intervals in order, with gaps up to `gap` (s) closed."""
    result: list[Interval] = []
    for begin, end in found:
        if result and begin - result[-1][1] <= gap:
            result[-1] = (result[-1][0], end)
        else:
            result.append((begin, end))
    return result
