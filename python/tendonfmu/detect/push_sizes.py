"""Which share of the pushes is found, by size.

The size of a push is the torque of a reference sensor over the residual of free motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from tendonfmu.detect.score_report import Scored
from tendonfmu.statistics import intervals

SIZES = (1.5, 3.0, 6.0, math.inf)  # times the rms of the joint's residual, at the joint with the largest ratio


def by_size(scored: Scored, left: Sequence[float]) -> list[dict[str, Any]] | None:
    """Count the pushes, and those found, by class of size."""
    # left: [n] (N·m)
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
