"""Whether recordings of a reference and of now can be compared: they are refused, or a warning names the problem."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.model import Finger
from tendonfmu.recordings import FitRecording

SHARED = 50  # consecutive samples that two recordings of a moving finger never share by chance
APART = 2.0  # times the spread of angles, forces


def check_sides(finger: Finger, then: Sequence[FitRecording], now: Sequence[FitRecording]) -> list[str]:
    """Return warnings about recordings of the reference and of now."""
    for side, role in ((then, "reference"), (now, "recording")):
        for each in side:
            if not (each.train | each.held_out).any():
                raise InputError(
                    f"{each.path}: {role} has no sample of free motion: all are labelled contact or left out; "
                    "expected a recording of free motion"
                )
    for one in then:
        for other in now:
            _refuse_overlap(one, other)
    return list(_different_conditions(then, now))


def _refuse_overlap(then: FitRecording, now: FitRecording) -> None:
    """Raise InputError if a stretch of one recording is in the other, also if it is at other times."""
    known = {row.tobytes(): k for k, row in enumerate(_rows(then))}
    at = np.array([known.get(row.tobytes(), -1) for row in _rows(now)])
    same = (at >= 0) & np.concatenate([[True], np.diff(at) == 1])
    ends = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(np.int8), [0]])))
    for begin, end in zip(ends[::2], ends[1::2], strict=True):
        if end - begin >= SHARED and np.ptp(_rows(now)[begin:end], axis=0).max() > 0.0:
            raise InputError(
                f"{now.path}: {now.time[begin]:g} to {now.time[end - 1]:g} s are the same samples as "
                f"{then.time[at[begin]]:g} to {then.time[at[end - 1]]:g} s of the reference {then.path}; expected "
                "recordings of different times"
            )


def _rows(recording: FitRecording) -> Numbers:
    """Return forces and positions [N, 2m]."""
    groups = recording.recording.groups
    used = [groups[name] for name in ("tendon_force", "tendon_position", "joint_position") if name in groups]
    return np.ascontiguousarray(np.hstack(used))


def _different_conditions(then: Sequence[FitRecording], now: Sequence[FitRecording]) -> Iterator[str]:
    """Yield warnings about new samples outside the range of the reference: no reference data exist for them."""
    for name, unit, of in (("tendon force", "N", _force), ("joint angle", "rad", _angle)):
        known = np.concatenate([of(recording) for recording in then])
        new = np.concatenate([of(recording) for recording in now])
        low, high = np.quantile(known, [0.005, 0.995], axis=0)
        outside = ((new < low) | (new > high)).mean(axis=0)
        worst = int(np.argmax(outside))
        if outside[worst] > 0.5:
            kind = name.split()[0]
            yield (
                f"{name} of {kind} {worst + 1}: {100 * outside[worst]:.0f} % of the new samples lie outside the "
                f"{low[worst]:.3g} to {high[worst]:.3g} {unit} of the reference; there, an error of the model "
                "cannot be distinguished from a change: record at the load and over the range of the reference"
            )


def _force(recording: FitRecording) -> Numbers:
    return np.asarray(recording.recording.groups["tendon_force"][recording.train | recording.held_out])


def _angle(recording: FitRecording) -> Numbers:
    return np.asarray(recording.model.joint_angle[recording.train | recording.held_out])
