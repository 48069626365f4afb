"""The numbers of a diagnosed finger, fitted to all of its free motion, and what is not known of them.

A diagnosis finds the structure on a part of the recordings; its numbers are then worth more the more motion they are
learned from.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tendonfmu.cause_search import predicted_of, series_of
from tendonfmu.description import FingerDescription
from tendonfmu.diagnosis_result import Event
from tendonfmu.diagnosis_search import events_of, without_blocks
from tendonfmu.diagnosis_series import make_grid
from tendonfmu.estimation_signals import Signals
from tendonfmu.extension_fit import FitSettings, learn_numbers
from tendonfmu.fit_evaluation import evaluate
from tendonfmu.fit_files import with_uncertainty, with_values
from tendonfmu.fit_recordings import FitRecording
from tendonfmu.fit_uncertainty import parameter_uncertainty
from tendonfmu.identifiability import unknowns
from tendonfmu.signal_choice import estimation_recordings

Data = Mapping[str, Any]


@dataclass(frozen=True)
class CalibratedFit:
    """data: the description as it runs online, with `contact.uncertainty`. events: what no friction explains in the
    recordings, left out of the fit. warnings: sentences.
    """

    data: Data
    events: tuple[Event, ...]
    warnings: tuple[str, ...]


def fit_all(
    finger: FingerDescription,
    recordings: Sequence[FitRecording],
    signals: Signals,
    settings: FitSettings,
    *,
    given: Data,
    seed: int,
) -> CalibratedFit:
    """finger: as a diagnosis extended it, with numbers to begin at. recordings: of free motion, as they were measured.
    given: the description that says how large its numbers may be. Raises InputError.
    """
    data = signals.description(finger.data)
    if not unknowns(data):
        return CalibratedFit(finger.data, (), ())
    own = estimation_recordings(replace(finger, data=data), recordings, signals)
    grid = make_grid(own)
    events, out = events_of(data, own, grid, seed)
    own = [without_blocks(each, k, grid, out) for k, each in enumerate(own)]
    clean = predicted_of(data, own, grid, series_of(data, own, grid, out))
    structure, learned = learn_numbers(data, clean, settings, given=signals.description(given))
    fitted = with_values(structure, np.asarray(learned.estimator.values(learned.z)))
    online = replace(fitted, data=signals.restored(fitted.data, finger.data))
    if np.isfinite(learned.covariance).all():
        judged = [evaluate(data, fitted.data, each) for each in own]
        known = parameter_uncertainty(structure, learned, fitted.data, judged)
        level = (finger.data["contact"] or {}).get("uncertainty_level")
        online = with_uncertainty(online, known.directions, level)
    return CalibratedFit(online.data, events, tuple(learned.warnings))
