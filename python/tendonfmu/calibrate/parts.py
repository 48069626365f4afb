"""Which stretches of free motion a diagnosis uses: some minutes show the structure, and long ones cost time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonfmu.recordings import Recording

DIAGNOSED = 90.0  # s of free motion, in all, to find the structure in
JUDGED = 45.0  # s, in all, to judge it on
SHORTEST = 15.0  # s, least length of a stretch


def stretches_for_diagnosis(
    free: Sequence[Recording], tests: Sequence[Recording]
) -> tuple[list[Recording], list[Recording]]:
    """Choose stretches of the recordings to find the structure in, and stretches to judge it on."""
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
    """Cut a share of the time of each recording, from a share on; the whole recording if the share is 1 or more."""
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
