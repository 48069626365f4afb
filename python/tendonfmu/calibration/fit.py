"""What a calibration diagnoses, and the numbers of a diagnosed finger, fitted to all of its free motion.

A diagnosis finds the structure on a part of the recordings. The numbers become more accurate with all of the motion. If
there is little motion, an earlier calibration is the prior.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tendonfmu.detect import sample_seconds
from tendonfmu.diagnosis import Event, Samples, events_of, without_events
from tendonfmu.estimate import (
    FIT_REPORT,
    Choice,
    FitWarning,
    FrictionFit,
    Watch,
    build_structure,
    held_delay,
    learn_batch,
    read_previous_fit,
    settings_of,
    torque_scales,
    with_learned_numbers,
    with_previous_values,
)
from tendonfmu.files import read_json
from tendonfmu.model import Finger, friction_numbers, read_finger
from tendonfmu.recordings import FitRecording, Recording, at_rows

DIAGNOSED = 90.0  # s of free motion, in all, to find the structure in
JUDGED = 45.0  # s, in all, to judge it on
SHORTEST = 15.0  # s, least length of a stretch


@dataclass(frozen=True)
class CalibratedFit:
    """A fit of all recordings."""

    finger: Finger
    events: tuple[Event, ...]
    warnings: tuple[str, ...]


def fit_all(finger: Finger, recordings: Sequence[FitRecording], *, threads: int, seed: int) -> CalibratedFit:
    """Fit a finger that was fitted before to all recordings of free motion, less what looks like contact.

    Raises InputError.
    """
    if not friction_numbers(finger.data):
        return CalibratedFit(finger, (), ())
    events, _ = events_of(finger.data, Samples.of(finger.data, recordings, threads), seed)
    kept = [without_events(recording, events) for recording in recordings]
    structure = build_structure(finger, Choice(fix=(*torque_scales(finger.data), *held_delay(finger.data))))
    settings = replace(settings_of(finger.data, kept, threads), near=True)
    learned = learn_batch(structure, kept, Watch(None), settings)
    result = with_learned_numbers(structure, learned, learned.fitted(structure))
    return CalibratedFit(result, events, tuple(learned.warnings))


def earlier_finger(given: Finger, previous: Path) -> Finger:
    """Return the description of an earlier calibration; for a fit's report, the given one with its values."""
    if read_json(previous, "an earlier calibration").get("format") == FIT_REPORT:
        return with_previous_values(given, read_previous_fit(previous))
    return read_finger(previous)


def fit_again(
    finger: Finger, previous: Path, recordings: Sequence[Recording], *, kinematics: int, threads: int
) -> CalibratedFit:
    """Fit an earlier calibration to new motion; its values and their uncertainty are the prior. Raises InputError."""
    fitting = FrictionFit(finger, previous=previous, kinematics=kinematics, threads=threads)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)  # the report lists them
        fitting.fit(list(recordings), checked=True)
    return CalibratedFit(fitting.description_, (), tuple(fitting.warnings_))


# --- the stretches that a diagnosis uses ------------------------------------------------------------------------------


def stretches_for_diagnosis(free: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """Choose stretches of the recordings to find the structure in, and others to judge it on, if there is enough."""
    whole = sum(map(_seconds, free))
    if whole < 2.0 * (DIAGNOSED + JUDGED):
        return list(free), []
    return _cut(free, 0.0, DIAGNOSED / whole), _cut(free, 0.5, JUDGED / whole)


def _seconds(recording: Recording) -> float:
    """Return the time that the samples stand for (s); gaps do not count."""
    return float(sample_seconds(recording.time).sum())


def _cut(recordings: Sequence[Recording], begin: float, share: float) -> list[Recording]:
    """Cut a share of the time of each recording, from a share on."""
    stretches = [_stretch(each, begin, share) for each in recordings if share * _seconds(each) >= SHORTEST]
    if stretches:
        return stretches
    longest = max(recordings, key=_seconds)
    return [_stretch(longest, begin, min(1.0 - begin, share * len(recordings)))]


def _stretch(recording: Recording, begin: float, share: float) -> Recording:
    seconds = np.cumsum(sample_seconds(recording.time))
    rows = slice(*(int(row) for row in np.searchsorted(seconds, seconds[-1] * np.array([begin, begin + share]))))
    stretch = at_rows(recording, rows)
    first, last = stretch.time[[0, -1]] - recording.time[0]
    beside = f"{recording.path.stem}, {first:.0f} to {last:.0f} s"
    return replace(stretch, path=recording.path.with_name(beside + recording.path.suffix))
