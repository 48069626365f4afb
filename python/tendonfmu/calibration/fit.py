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

from tendonfmu.arrays import Data
from tendonfmu.detect import sample_seconds
from tendonfmu.diagnosis import (
    Event,
    FitSettings,
    estimation_recordings,
    events_of,
    learn_numbers,
    predicted_of,
    series_of,
    settled,
    squared_residual,
    with_known,
    without_blocks,
    without_stuck,
)
from tendonfmu.estimate import (
    FIT_REPORT,
    FitWarning,
    FrictionFit,
    evaluate,
    parameter_uncertainty,
    read_previous_fit,
    unknowns,
    with_previous_values,
    with_uncertainty,
    with_values,
)
from tendonfmu.files import read_json
from tendonfmu.model import Finger, read_finger
from tendonfmu.recordings import FitRecording, Recording, Signals, at_rows, make_grid

DIAGNOSED = 90.0  # s of free motion, in all, to find the structure in
JUDGED = 45.0  # s, in all, to judge it on
SHORTEST = 15.0  # s, least length of a stretch
CLEARLY_LESS = 0.9  # of the error of a fit to all samples, which one to sliding samples must stay below


@dataclass(frozen=True)
class CalibratedFit:
    """A fit of all recordings."""

    data: Data
    events: tuple[Event, ...]
    warnings: tuple[str, ...]


def fit_all(
    finger: Finger,
    recordings: Sequence[FitRecording],
    signals: Signals,
    settings: FitSettings,
    *,
    given: Data,
    seed: int,
    only_sliding: bool = False,
) -> CalibratedFit:
    """Fit a diagnosed finger to all recordings of free motion, or only where everything slides if that is better.

    Contact is detected in stuck samples, too, so these count unless they mislead clearly. Raises InputError.
    """
    data = signals.description(finger.data)
    if not unknowns(data):
        return CalibratedFit(finger.data, (), ())
    start = replace(finger, data=data)
    estimated = estimation_recordings(start, recordings, signals)
    grid = make_grid(estimated)
    events, out = events_of(data, estimated, grid, seed)

    def fitted(chosen: Sequence[FitRecording]) -> CalibratedFit:
        kept = [without_blocks(recording, k, grid, out) for k, recording in enumerate(chosen)]
        clean = predicted_of(data, kept, grid, series_of(data, kept, grid, out))
        structure, learned = learn_numbers(data, clean, settings, given=signals.description(given))
        result = with_values(structure, np.asarray(learned.estimator.values(learned.z)))
        result = replace(result, data=with_known(result.data, clean, settings))
        online = replace(result, data=signals.restored(result.data, finger.data))
        if np.isfinite(learned.covariance).all():
            judged = [evaluate(data, result.data, recording) for recording in kept]
            directions, _ = parameter_uncertainty(structure, learned, result.data, judged)
            level = (finger.data["contact"] or {}).get("uncertainty_level")
            online = with_uncertainty(online, directions, level)
        return CalibratedFit(online.data, events, tuple(learned.warnings))

    whole = fitted(estimated)
    if not only_sliding:
        return whole

    def square(of: Data) -> float:
        return squared_residual(of, recordings)

    alone = fitted(estimation_recordings(start, without_stuck(finger, recordings, signals), signals))
    alone = replace(alone, data=settled(alone.data, square))
    return alone if square(alone.data) < CLEARLY_LESS**2 * square(whole.data) else whole


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
    return CalibratedFit(fitting.description_.data, (), tuple(fitting.warnings_))


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
