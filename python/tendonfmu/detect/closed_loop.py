"""False alarms of a tuned finger as it runs, with the bias frozen in contact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.detect.alarm_level import Cells
from tendonfmu.detect.counting import stretches
from tendonfmu.detect.free_motion import SETTLING, FreePart, closed_loop


@dataclass(frozen=True)
class LoopAlarms:
    """Alarms of one part."""

    part: int
    source: str
    begins: list[float]
    ends: list[float]
    at_start: int
    hours: float
    seconds: float
    alarm_seconds: float

    @property
    def alarms(self) -> int:
        return len(self.begins)

    @property
    def longest(self) -> float:
        """Longest alarm (s); 0 without alarms."""
        return max((end - begin for begin, end in zip(self.begins, self.ends, strict=True)), default=0.0)

    def alarms_in(self, cells: Cells, group: int) -> int:
        """Count the alarms at one pretension, by the nearest counted cell."""
        own = np.flatnonzero(cells.part == self.part)
        if not len(own):
            return 0
        near = own[np.clip(np.searchsorted(cells.time[own], self.begins), 0, len(own) - 1)]
        return int((cells.group[near] == group).sum())


def count_loop(data: Mapping[str, Any], parts: Sequence[FreePart], kinematics: int) -> list[LoopAlarms]:
    """Run the finger over every part from its start. An alarm counts if it begins in counted time."""
    found = []
    for k, (part, contact) in enumerate(zip(parts, closed_loop(data, parts, kinematics), strict=True)):
        time = part.time - part.time[0]
        spans = stretches(part.time, contact)
        settled = time[spans[:, 0]] >= SETTLING if len(spans) else np.zeros(0, dtype=bool)
        counted = spans[part.counted[spans[:, 0]]] if len(spans) else spans
        found.append(
            LoopAlarms(
                part=k,
                source=part.source,
                begins=[float(time[begin]) for begin, _ in counted],
                ends=[float(time[end] + part.seconds[end]) for _, end in counted],
                at_start=int((~settled).sum()),
                hours=part.hours,
                seconds=float(part.seconds.sum()),
                alarm_seconds=float(part.seconds[contact].sum()),
            )
        )
    return found
