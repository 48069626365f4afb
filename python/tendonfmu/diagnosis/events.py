"""Events (contact, a stall) in recordings: where they are, what is left of the recordings, and what that gains."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.diagnosis.cause_search import bias_of, residual_alone, series_of
from tendonfmu.diagnosis.contact_scan import left_out, scan_events
from tendonfmu.diagnosis.gain import residual_of
from tendonfmu.diagnosis.result import Event
from tendonfmu.diagnosis.series import Grid
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import Interval, blocks_of, paired_gain

_TWO_SIDED = 1.96  # of the standard error, for a 95 % interval


def events_of(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, seed: int
) -> tuple[tuple[Event, ...], Flags]:
    """Find the stretches that no friction explains in the residual of a model."""
    # returns blocks that lie in an event [B]
    series = series_of(data, recordings, grid)
    names = [str(recording.path) for recording in recordings]
    events = scan_events(series, residual_alone(data, series), bias_of(data, series), names, seed=seed)
    return events, left_out(series, events, names)


def without_events(recording: FitRecording, events: Sequence[Event]) -> FitRecording:
    """Return the recording without the samples that lie in its events."""
    inside = np.zeros(len(recording.time), dtype=bool)
    for event in events:
        if event.recording == str(recording.path):
            inside |= (recording.time >= event.start) & (recording.time <= event.end)
    return replace(recording, train=recording.train & ~inside, held_out=recording.held_out & ~inside)


def without_blocks(recording: FitRecording, number: int, grid: Grid, out: Flags) -> FitRecording:
    """Return a recording that does not train on the samples of some blocks."""
    # out: [B]
    train = recording.train.copy()
    for segment in grid.segments:
        if segment.recording == number:
            begin = segment.part.start
            rows = np.flatnonzero(np.repeat(out[segment.blocks], segment.samples))
            train[begin + rows] = False
    return replace(recording, train=train)


# --- what leaving them out gains --------------------------------------------------------------------------------------


def event_gain(data: Mapping[str, Any], recordings: Sequence[FitRecording], events: Sequence[Event]) -> Interval | None:
    """Return the share of the rms that leaving the events out removes, with a 95 % interval; None without events."""
    if not events:
        return None
    within, samples, free, free_samples = 0.0, 0, [], []
    for recording in recordings:
        squares = np.sum(residual_of(data, recording) ** 2, axis=1)
        judged = recording.train & np.isfinite(squares)
        inside = np.zeros(len(judged), dtype=bool)
        for event in events:
            if event.recording == str(recording.path):
                inside |= (recording.time >= event.start) & (recording.time <= event.end)
        within += float(squares[judged & inside].sum())
        samples += int((judged & inside).sum())
        blocks = blocks_of(recording.time, judged & ~inside)
        free.append(blocks.sums(np.where(judged, squares, 0.0)))
        free_samples.append(blocks.sums(np.ones(len(judged))))
    return _gain(within, samples, np.concatenate(free), np.concatenate(free_samples))


def _gain(within: float, samples: int, free: Numbers, free_samples: Numbers) -> Interval | None:
    """Compute the interval from the sums of r²."""
    # `within` is Σ r² in the events, over `samples` samples. `free` is Σ r² of the blocks outside of events [B], over
    # `free_samples` samples [B].
    rest, count = float(free.sum()), float(free_samples.sum())
    if len(free) < paired_gain.FEWEST or not rest > 0.0:
        return None
    mean = rest / count
    # standard error of a ratio of sums, by blocks
    spread = float(np.sqrt(np.sum((free - mean * free_samples) ** 2) * len(free) / (len(free) - 1)))
    ratio = math.log(mean * (count + samples) / (rest + within)) / 2.0  # log of the rms without over with events
    error = within / (rest + within) * spread / rest / 2.0
    ends = (ratio, ratio + _TWO_SIDED * error, ratio - _TWO_SIDED * error)
    return Interval(*(1.0 - math.exp(end) for end in ends))
