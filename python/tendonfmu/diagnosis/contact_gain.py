"""How much the extended model improves contact detection, measured on labelled recordings.

Both models are tuned alike on free motion, for the same rate of false alarms in the same free motion
(`detect.tuning.ContactTuning`). Both are then scored on the labels: `detect.counting`
counts events, false alarms and delays.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonfmu.arrays import Data, Flags
from tendonfmu.detect import (
    SETTLING,
    ContactTuning,
    DetectionScore,
    Subject,
    TuneWarning,
    free_parts,
    pooled,
    require_no_contact,
    run_track,
)
from tendonfmu.diagnosis.result import DetectionGain
from tendonfmu.errors import InputError
from tendonfmu.model import Finger, finger_from_data
from tendonfmu.recordings import FitRecording, Recording

RATE, HIGHEST = 6.0, 3600.0  # 1/h; false alarm rate that both are tuned for, at least one alarm in the free motion
_SHORTEST = 4.0  # s; shortest stretch without contact that counts as free motion
_MARGIN = 1.0  # s, on either side of a contact


def detection_gain(nominal: Data, extended: Data, recordings: Sequence[FitRecording]) -> DetectionGain | None:
    """Return the gain for contact detection; None without labelled contact or if nothing can be tuned."""
    labelled = [recording.recording for recording in recordings if recording.recording.contact is not None]
    labelled = [recording for recording in labelled if recording.contact is not None and recording.contact.any()]
    if not labelled:
        return None
    kinematics = recordings[0].kinematics
    free = _free_motion(finger_from_data(nominal), [recording.recording for recording in recordings], kinematics)
    if not free:
        return None
    hours = sum(float(recording.time[-1] - recording.time[0]) - SETTLING for recording in free) / 3600
    if not hours > 0:
        return None
    try:
        tuned = [_tuned(data, free, kinematics, min(max(RATE, 1.0 / hours), HIGHEST)) for data in (nominal, extended)]
    except InputError:  # nothing can be tuned, for example with a bias without drift
        return None
    before, after = (_score(tuning.description_.data, labelled, kinematics) for tuning in tuned)
    return DetectionGain(
        events=len(before.events),
        found_before=before.found,
        found_after=after.found,
        false_alarms_before=len(before.false_alarms),
        false_alarms_after=len(after.false_alarms),
        median_delay_before=_median(before),
        median_delay_after=_median(after),
        smallest_push_before=tuple(map(float, tuned[0].push_)),
        smallest_push_after=tuple(map(float, tuned[1].push_)),
    )


# --- free motion ------------------------------------------------------------------------------------------------------


def _free_motion(finger: Finger, recordings: Sequence[Recording], kinematics: int) -> list[Recording]:
    whole = [recording for recording in recordings if recording.contact is None or not recording.contact.any()]
    free = [recording for recording in whole if _is_free(finger, recording, kinematics)]
    if free:
        return free
    pieces = [
        piece
        for recording in recordings
        if recording.contact is not None
        for piece in _pieces(recording, recording.contact)
    ]
    return [piece for piece in pieces if _is_free(finger, piece, kinematics)]


def _is_free(finger: Finger, recording: Recording, kinematics: int) -> bool:
    """Return whether a recording is free motion: long enough, moving, and without a load on a reference sensor."""
    try:
        require_no_contact(recording)
        parts, _ = free_parts(finger, recording, kinematics)
    except InputError:
        return False
    return any(part.counted.any() for part in parts)


def _pieces(recording: Recording, contact: Flags) -> list[Recording]:
    """Return the stretches that are not in or close to contact."""
    time = recording.time
    touched = time[contact]
    after = np.searchsorted(touched, time - _MARGIN) < np.searchsorted(touched, time + _MARGIN, side="right")
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (~after).astype(np.int8), [0]])))
    pieces = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if time[end - 1] - time[begin] >= _SHORTEST:
            groups = {name: np.ascontiguousarray(values[begin:end]) for name, values in recording.groups.items()}
            piece = Recording(Path(f"{recording.path}, from {time[begin]:.4g} s"), time[begin:end].copy(), groups)
            pieces.append(replace(piece, contact=np.zeros(end - begin, dtype=bool)))
    return pieces


# --- tuned and scored -------------------------------------------------------------------------------------------------


def _tuned(data: Data, free: Sequence[Recording], kinematics: int, rate: float) -> ContactTuning:
    tuning = ContactTuning(finger_from_data(data), false_alarms_per_hour=rate, kinematics=kinematics)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TuneWarning)
        return tuning.tune(list(free), checked=True)


def _score(data: Data, recordings: Sequence[Recording], kinematics: int) -> DetectionScore:
    subject = Subject(Path("finger"), finger_from_data(data), packed=False)
    return pooled([run_track(subject, recording, kinematics, None).score() for recording in recordings])


def _median(score: DetectionScore) -> float | None:
    return float(np.median(score.delays)) if len(score.delays) else None
