"""What a diagnosis is given: the description and recordings of one finger, read and checked.

Recordings of a reference and of now that cannot be compared are refused, or a warning names the problem.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from tendonfmu.arrays import Numbers, flagged_rows
from tendonfmu.diagnosis.gain import require_unseen
from tendonfmu.errors import InputError
from tendonfmu.estimate import check_unseen
from tendonfmu.model import Finger, FingerSource, bias_is_constant, read_finger
from tendonfmu.recordings import (
    UNFIT_FOR_SEARCH,
    FitRecording,
    Held,
    Recording,
    RecordingSource,
    admit,
    listed_sources,
    prepare,
    read_recordings,
    require_noise,
    without_rests,
)
from tendonfmu.statistics import FEWEST_STRETCHES, STRETCH

HELD = Held(0.2, 10.0)  # of the recordings, for the gain, if no tests are given
HALF = Held(0.5, 10.0)  # for a change: its few numbers need less data, and single samples of r are mostly noise


SHORTEST = 0.1  # s on end of free motion: a shorter stretch has no block of its own
SHARED = 50  # consecutive samples that two recordings of a moving finger never share by chance


@dataclass(frozen=True)
class Input:
    """Checked input. `training` has held-out stretches if there are no `tests`."""

    finger: Finger
    training: list[FitRecording]
    tests: list[FitRecording]
    warnings: tuple[str, ...]  # about recordings
    reference: Sequence[FitRecording] = ()  # the finger as it was; none if the question is what the description lacks

    @property
    def whole(self) -> list[FitRecording]:
        """The training recordings without held-out stretches."""
        nothing = [np.zeros_like(recording.held_out) for recording in self.training]
        return [
            replace(recording, train=recording.train | recording.held_out, held_out=none)
            for recording, none in zip(self.training, nothing, strict=True)
        ]

    def of_finger(self, finger: Finger, seen: Callable[[Recording], Recording] = lambda recording: recording) -> Input:
        """Return the input of another description, with recordings as `seen` changes them."""

        def again(old: FitRecording) -> FitRecording:
            new = prepare(finger, seen(old.recording), old.kinematics, Held())
            return replace(new, train=old.train, held_out=old.held_out, contact_out=old.contact_out)

        return replace(
            self,
            finger=finger,
            training=[again(each) for each in self.training],
            tests=[again(each) for each in self.tests],
        )


Sources: TypeAlias = "RecordingSource | Sequence[RecordingSource]"


def read_input(
    finger: FingerSource,
    recordings: Sources,
    tests: Sources,
    reference: Sources | None,
    kinematics: int,
    least_gain: float,
    checked: bool,
) -> Input:
    """Read and check the recordings, each by itself; those of a reference and of now also against each other."""
    if reference is None:
        given = _read(finger, recordings, tests, kinematics, least_gain, checked)
        _require_motion(given.whole)
        return given
    now = _read(finger, recordings, tests, kinematics, least_gain, checked, HALF)
    before = _read(now.finger, reference, [], kinematics, least_gain, checked, role="reference")
    then = before.whole
    warnings = [*now.warnings, *(warning for warning in before.warnings if warning not in now.warnings)]
    warnings += _compared(now.finger, then, [*now.training, *now.tests])
    return replace(now, warnings=tuple(warnings), reference=then)


def _read(
    finger: FingerSource,
    recordings: Sources,
    tests: Sources,
    kinematics: int,
    least_gain: float,
    checked: bool,
    apart: Held = HELD,
    role: str = "recordings",
) -> Input:
    given_sources, test_sources = listed_sources(recordings), listed_sources(tests)
    if not given_sources:
        raise InputError("no recording; expected at least one")
    if kinematics not in (1, 2, 3):
        raise InputError(f"kinematics = {kinematics!r}: expected 1, 2 or 3")
    if not 0.0 <= least_gain <= 0.5:
        raise InputError(f"least_gain = {least_gain!r}: expected 0 to 0.5")
    given = read_finger(finger)
    held = Held() if test_sources else apart
    read, others = read_recordings(given_sources, role), read_recordings(test_sources, "test")
    warnings = [] if checked else admit(given, [*read, *others], unfit=UNFIT_FOR_SEARCH, besides=("routing",))
    training = [_moving(given, prepare(given, recording, kinematics, held)) for recording in read]
    unseen = [_moving(given, prepare(given, other, kinematics, Held())) for other in others]
    require_noise(given, training)
    require_unseen(training, unseen)
    check_unseen([recording.recording for recording in training], [recording.recording for recording in unseen])
    if not checked:
        warnings += [
            f"{recording.path.name}: {text}" for recording in (*training, *unseen) for text in recording.warnings
        ]
    return Input(given, training, unseen, tuple(warnings))


def _moving(finger: Finger, recording: FitRecording) -> FitRecording:
    """Return a machine's recording without rests, at which its motor holds any torque; fingers keep theirs."""
    return without_rests(recording, finger, is_batch=True) if bias_is_constant(finger.data) else recording


def _require_motion(recordings: Sequence[FitRecording]) -> None:
    """Raise InputError if no part can be held out: no cause could be named, so "adequate" would mean nothing."""
    least = FEWEST_STRETCHES * STRETCH
    seconds = sum(float(np.median(np.diff(recording.time))) * int(recording.train.sum()) for recording in recordings)
    if seconds < least - 0.01:  # the last sample has no duration
        name = str(recordings[0].path) if len(recordings) == 1 else f"{len(recordings)} recordings"
        raise InputError(
            f"{name}: {seconds:.2g} s of free motion; expected at least {least:g} s, better a minute: causes are "
            "judged on parts that they were not fitted to"
        )


# --- a reference and now ----------------------------------------------------------------------------------------------


def _compared(finger: Finger, then: Sequence[FitRecording], now: Sequence[FitRecording]) -> list[str]:
    """Return warnings about recordings of the reference and of now."""
    for side, role in ((then, "reference"), (now, "recording")):
        for recording in side:
            longest = max((end - begin for begin, end in flagged_rows(recording.train | recording.held_out)), default=0)
            if longest * np.median(np.diff(recording.time)) < SHORTEST:
                raise InputError(
                    f"{recording.path}: {role} has no free motion of {SHORTEST:g} s on end: others are labelled "
                    "contact or left out; expected a recording of free motion"
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
    for begin, end in flagged_rows(same):
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
    sides = [[(each, each.train | each.held_out) for each in side] for side in (then, now)]
    forces = [np.concatenate([each.recording.groups["tendon_force"][used] for each, used in side]) for side in sides]
    angles = [np.concatenate([each.model.joint_angle[used] for each, used in side]) for side in sides]
    for name, unit, (known, new) in (("tendon force", "N", forces), ("joint angle", "rad", angles)):
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
