"""What a diagnosis is given: the description and recordings of one finger, read and checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonfmu.diagnosis.changes.check import check_sides
from tendonfmu.diagnosis.changes.diagnosis import ChangeCase
from tendonfmu.diagnosis.gain import require_unseen
from tendonfmu.errors import InputError
from tendonfmu.estimate import check_unseen
from tendonfmu.model import Finger, FingerSource, read_finger
from tendonfmu.recordings import (
    UNFIT_FOR_SEARCH,
    FitRecording,
    Held,
    RecordingSource,
    admit,
    listed_sources,
    prepare,
    read_recordings,
    require_noise,
)
from tendonfmu.statistics import FEWEST_STRETCHES, STRETCH

HELD = Held(0.2, 10.0)  # of the recordings, for the gain, if no tests are given
HALF = Held(0.5, 10.0)  # for a change: its few numbers need less data, and single samples of r are mostly noise


@dataclass(frozen=True)
class GivenCase:
    """Checked input. `training` has held-out stretches if there are no `tests`; `warnings` are about recordings."""

    finger: Finger
    training: list[FitRecording]
    tests: list[FitRecording]
    warnings: tuple[str, ...]

    @property
    def whole(self) -> list[FitRecording]:
        """The training recordings without held-out stretches."""
        nothing = [np.zeros_like(recording.held_out) for recording in self.training]
        return [
            replace(recording, train=recording.train | recording.held_out, held_out=none)
            for recording, none in zip(self.training, nothing, strict=True)
        ]


def given_case(
    finger: FingerSource,
    recordings: RecordingSource | Sequence[RecordingSource],
    tests: RecordingSource | Sequence[RecordingSource],
    kinematics: int,
    least_gain: float,
    checked: bool,
    apart: Held = HELD,
    role: str = "recordings",
) -> GivenCase:
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
    warnings = [] if checked else admit(given, [*read, *others], unfit=UNFIT_FOR_SEARCH)
    training = [prepare(given, recording, kinematics, held) for recording in read]
    unseen = [prepare(given, other, kinematics, Held()) for other in others]
    require_noise(given, training)
    require_unseen(training, unseen)
    check_unseen([recording.recording for recording in training], [recording.recording for recording in unseen])
    if not checked:
        warnings += [
            f"{recording.path.name}: {text}" for recording in (*training, *unseen) for text in recording.warnings
        ]
    return GivenCase(given, training, unseen, tuple(warnings))


def require_motion(recordings: Sequence[FitRecording]) -> None:
    """Raise InputError if no part can be held out: no cause could be named, so "adequate" would mean nothing."""
    least = FEWEST_STRETCHES * STRETCH
    seconds = sum(float(np.median(np.diff(recording.time))) * int(recording.train.sum()) for recording in recordings)
    if seconds < least - 0.01:  # the last sample has no duration
        name = str(recordings[0].path) if len(recordings) == 1 else f"{len(recordings)} recordings"
        raise InputError(
            f"{name}: {seconds:.2g} s of free motion; expected at least {least:g} s, better a minute: causes are "
            "judged on parts that are held out in turn"
        )


def change_case(
    finger: FingerSource,
    now: RecordingSource | Sequence[RecordingSource],
    reference: RecordingSource | Sequence[RecordingSource],
    tests: RecordingSource | Sequence[RecordingSource],
    kinematics: int,
    least_gain: float,
    checked: bool,
) -> ChangeCase:
    """Read and check the recordings of now and of the reference, each by itself and against each other."""
    own = given_case(finger, now, tests, kinematics, least_gain, checked, HALF)
    before = given_case(own.finger, reference, [], kinematics, least_gain, checked, role="reference")
    then = before.whole
    warnings = [*own.warnings, *(warning for warning in before.warnings if warning not in own.warnings)]
    warnings += check_sides(own.finger, then, [*own.training, *own.tests])
    return ChangeCase(own.finger, then, own.training, own.tests, tuple(warnings))
