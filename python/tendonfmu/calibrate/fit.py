"""The numbers of a diagnosed finger, fitted to all of its free motion, with their uncertainty.

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
from tendonfmu.diagnosis import (
    Event,
    FitSettings,
    estimation_recordings,
    events_of,
    learn_numbers,
    make_grid,
    predicted_of,
    series_of,
    settled,
    squared_residual,
    without_blocks,
    without_stuck,
)
from tendonfmu.estimate import (
    FitWarning,
    FrictionFit,
    evaluate,
    fit_report,
    parameter_uncertainty,
    read_previous_fit,
    unknowns,
    with_previous_values,
    with_uncertainty,
    with_values,
)
from tendonfmu.files import read_json
from tendonfmu.model import Finger, read_finger
from tendonfmu.recordings import FitRecording, Signals


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
    uncertainty: bool = True,
    only_sliding: bool = False,
) -> CalibratedFit:
    """Fit a diagnosed finger to all recordings of free motion. Raises InputError."""
    data = signals.description(finger.data)
    if not unknowns(data):
        return CalibratedFit(finger.data, (), ())
    own = estimation_recordings(replace(finger, data=data), recordings, signals)
    grid = make_grid(own)
    events, out = events_of(data, own, grid, seed)
    if only_sliding:
        sliding = without_stuck(finger, recordings, signals)
        own = estimation_recordings(replace(finger, data=data), sliding, signals)
    own = [without_blocks(each, k, grid, out) for k, each in enumerate(own)]
    clean = predicted_of(data, own, grid, series_of(data, own, grid, out))
    structure, learned = learn_numbers(data, clean, settings, given=signals.description(given))
    fitted = with_values(structure, np.asarray(learned.estimator.values(learned.z)))
    online = replace(fitted, data=signals.restored(fitted.data, finger.data))
    if only_sliding:
        online = replace(online, data=settled(online.data, lambda data: squared_residual(data, recordings)))
    if uncertainty and np.isfinite(learned.covariance).all():
        judged = [evaluate(data, fitted.data, each) for each in own]
        known = parameter_uncertainty(structure, learned, fitted.data, judged)
        level = (finger.data["contact"] or {}).get("uncertainty_level")
        online = with_uncertainty(online, known.directions, level)
    return CalibratedFit(online.data, events, tuple(learned.warnings))


def earlier_finger(given: Finger, previous: Path) -> Finger:
    """Return the description of an earlier calibration; for a fit's report, the given one with its values."""
    if read_json(previous, "an earlier calibration").get("format") == fit_report.FORMAT:
        return with_previous_values(given, read_previous_fit(previous))
    return read_finger(previous)


def fit_again(
    finger: Finger,
    previous: Path,
    recordings: Sequence[FitRecording],
    *,
    share: float,
    kinematics: int,
    threads: int,
) -> CalibratedFit:
    """Fit an earlier calibration to new motion; its values and their uncertainty are the prior. Raises InputError."""
    fitting = FrictionFit(finger, previous=previous, kinematics=kinematics, holdout=share, threads=threads)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)  # the report lists them
        fitting.fit([each.recording for each in recordings], checked=True)
    return CalibratedFit(fitting.description_.data, (), tuple(fitting.warnings_))
