"""How the samples of recordings are averaged over short blocks of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Array, Numbers
from tendonfmu.recordings.prepared import FitRecording

SHORTEST_STEP = 0.01  # s; shortest block
MOST_BLOCKS = 12_000


@dataclass(frozen=True)
class Segment:
    """A stretch of a recording without a gap, cut into blocks with equally many samples."""

    recording: int  # its number, from 0
    part: slice  # its samples there
    first: int  # first block in the whole series, and number of blocks
    count: int
    samples: int  # samples of a block

    @property
    def blocks(self) -> slice:
        return slice(self.first, self.first + self.count)

    def mean(self, values: Array) -> Array:
        """Return block means [count, ...] of values [samples of the part, or as many as the blocks have, ...]."""
        whole = values[: self.count * self.samples]
        return np.asarray(whole.reshape(self.count, self.samples, *whole.shape[1:]).mean(axis=1))


@dataclass(frozen=True)
class Grid:
    """All segments, one after another; they are the estimator's recordings. `step` is the length of a block, s."""

    segments: tuple[Segment, ...]
    step: float

    @property
    def blocks(self) -> int:
        return sum(segment.count for segment in self.segments)

    def means(self, values: Sequence[Array]) -> Array:
        """Return block means [B, ...] of values [N, ...] of each recording."""
        return np.concatenate([segment.mean(values[segment.recording][segment.part]) for segment in self.segments])

    def forces(self, recordings: Sequence[FitRecording]) -> Numbers:
        """Return block means of the tendon forces, N [B, m]."""
        return self.means([recording.recording.groups["tendon_force"] for recording in recordings])


def make_grid(recordings: Sequence[FitRecording], shortest: float = SHORTEST_STEP) -> Grid:
    """Cut recordings into blocks of about 10 ms, or of another length (s)."""
    duration = sum(recording.duration for recording in recordings)
    step = max(shortest, duration / MOST_BLOCKS)
    segments, first = [], 0
    for number, recording in enumerate(recordings):
        samples = max(1, round(step / float(np.median(np.diff(recording.time)))))
        samples += samples % 2 if samples > 3 else 0  # runs of the core thin by whole parts of a block
        for part in recording.parts:
            count = (part.stop - part.start) // samples
            if count and recording.train[part].any():
                segments.append(Segment(number, part, first, count, samples))
                first += count
    return Grid(tuple(segments), step)
