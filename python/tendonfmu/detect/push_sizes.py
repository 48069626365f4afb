"""Which pushes are found, by their size: the torque that a reference sensor shows, over what free motion leaves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from tendonfmu.detect.score_report import Scored
from tendonfmu.statistics import intervals

SIZES = (1.5, 3.0, 6.0, math.inf)  # times the residual's rms of the joint, at the joint where it is the largest


def by_size(scored: Scored, left: Sequence[float]) -> list[dict[str, Any]] | None:
    """By class of size: how many pushes there are and how many are found; None without a reference sensor.

    left: [n] N·m, rms of the residual in free motion.
    """
    sizes, found = [], []
    scale = np.maximum(np.array(left), 1e-12)
    for track, score in zip(scored.tracks, scored.scores, strict=True):
        if track.external is None:
            return None
        for event in score.events:
            inside = (track.recording.time >= event.onset) & (track.recording.time <= event.end)
            sizes.append(float((np.abs(track.external[inside]) / scale).max()))
            found.append(event.found)
    low, rows = 0.0, []
    for high in SIZES:
        own = [hit for size, hit in zip(sizes, found, strict=True) if low <= size < high]
        if own:
            known = intervals.share(sum(own), len(own))
            rows.append(
                {
                    "from": low,
                    "below": None if math.isinf(high) else high,
                    "events": len(own),
                    "found": sum(own),
                    "share": known.value,
                    "interval": [known.low, known.high],
                }
            )
        low = high
    return rows
