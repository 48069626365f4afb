"""What it is worth to leave events (contact, a stall) out of the recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tendonfmu.diagnosis_result import Event, Interval
from tendonfmu.fit_recordings import FitRecording
from tendonfmu.gain import residual_of
from tendonfmu.gain_interval import blocks_of, gain_interval


def event_gain(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], events: Sequence[Event], seed: int = 0
) -> Interval | None:
    """Share of the rms that leaving the events out takes away, with a 95 % interval by blocks of 2 s; None without
    events.

    data: fitted description, as it runs online. recordings: as they were measured, with the events in them; `train`
    says what is judged.
    """
    if not events:
        return None
    sums, free_sums, samples, free_samples = [], [], 0, 0
    for recording in recordings:
        squares = np.sum(residual_of(data, recording) ** 2, axis=1)
        judged = recording.train & np.isfinite(squares)
        free = judged.copy()
        for event in events:
            if event.recording == str(recording.path):
                free &= (recording.time < event.start) | (recording.time > event.end)
        blocks = blocks_of(recording.time, judged)
        sums.append(blocks.sums(np.where(judged, squares, 0.0)))
        free_sums.append(blocks.sums(np.where(free, squares, 0.0)))
        samples, free_samples = samples + int(judged.sum()), free_samples + int(free.sum())
    if not free_samples:
        return None
    # as if all of the time were as the rest of it
    return gain_interval(np.concatenate(sums), samples / free_samples * np.concatenate(free_sums), seed)
