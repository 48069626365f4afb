"""Which stretches of free motion a diagnosis looks at: its structure is plain in some minutes, and long ones cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonfmu.recordings import Recording

DIAGNOSED = 90.0  # s of free motion, in all, that the structure is found in
JUDGED = 45.0  # s, in all, that it is judged on
SHORTEST = 15.0  # s, of a stretch


def stretches_for_diagnosis(
    free: Sequence[Recording], tests: Sequence[Recording]
) -> tuple[list[Recording], list[Recording]]:
    """Of each recording a stretch to find the structure in; of the tests, or of what is left of the recordings, one to
    judge it on. Short recordings are taken whole, with nothing to judge on: a diagnosis then holds out parts of them.
    """
    whole = sum(_seconds(each) for each in free)
    if tests:
        total = sum(_seconds(each) for each in tests)
        return _cut(free, 0.0, DIAGNOSED / whole), _cut(tests, 0.0, JUDGED / total)
    if whole < 2.0 * (DIAGNOSED + JUDGED):
        return list(free), []
    return _cut(free, 0.0, DIAGNOSED / whole), _cut(free, 0.5, JUDGED / whole)


def _seconds(recording: Recording) -> float:
    return float(recording.time[-1] - recording.time[0])


def _cut(recordings: Sequence[Recording], begin: float, share: float) -> list[Recording]:
    """Of each recording a share of its time, from a share on; all of it where that is all. Short ones are left out
    where others are there."""
    if share >= 1.0:
        return list(recordings)
    found = [_stretch(each, begin, share) for each in recordings if share * _seconds(each) >= SHORTEST]
    if found:
        return found
    longest = max(recordings, key=_seconds)
    return [_stretch(longest, begin, min(1.0 - begin, share * len(recordings)))]


def _stretch(recording: Recording, begin: float, share: float) -> Recording:
    first = recording.time[0] + begin * _seconds(recording)
    last = first + share * _seconds(recording)
    rows = slice(*(int(row) for row in np.searchsorted(recording.time, (first, last))))
    beside = f"{recording.path.stem}, {first - recording.time[0]:.0f} to {last - recording.time[0]:.0f} s"
    return replace(
        recording,
        path=Path(recording.path.with_name(beside + recording.path.suffix)),
        time=recording.time[rows],
        groups={name: values[rows] for name, values in recording.groups.items()},
        contact=None if recording.contact is None else recording.contact[rows],
        others={name: values[rows] for name, values in recording.others.items()},
    )
