"""Recordings of free motion to tune contact detection on: the check for contact, and alarms of a finger."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonfmu.arrays import Array, Flags, Indices, Numbers, flagged_rows
from tendonfmu.detect.counting import sample_seconds, stretches
from tendonfmu.errors import InputError
from tendonfmu.files import counted
from tendonfmu.model import Finger, native, number_of
from tendonfmu.options import KinematicsSource
from tendonfmu.recordings import Held, Recording, prepare

# --- contact that a reference sensor shows ----------------------------------------------------------------------------


BEYOND_NOISE = 6.0  # times the noise of the sensor: a larger mean over `SMOOTHED` is contact
SMOOTHED = 0.05  # s
LEAST_SHARE = 0.05  # of a joint's largest torque: less in a recording with contact is the sensor's own error
AROUND = 0.1  # s, on both sides of a contact that is left out: a touch begins below any threshold


def sensed_contact(recording: Recording) -> tuple[Flags, Numbers] | None:
    """Return [N] whether a reference sensor shows contact, and [n] the torque from which on (N·m); None without one."""
    reference = recording.groups.get("external_torque")
    if reference is None:
        return None
    off = _off(reference, recording.time)
    threshold = np.maximum(_noise_limit(reference), LEAST_SHARE * off.max(axis=0))
    return np.asarray((off > threshold).any(axis=1)), threshold


def touched(recording: Recording) -> Flags:
    """Return [N] whether a label or a reference sensor shows contact, with `AROUND` on both sides."""
    sensed = sensed_contact(recording)
    flags = np.zeros(len(recording), dtype=bool) if recording.contact is None else recording.contact.astype(bool)
    time = recording.time[flags | sensed[0] if sensed else flags]
    if not len(time):
        return np.zeros(len(recording), dtype=bool)
    after = np.searchsorted(time, recording.time + AROUND, side="right")
    return np.asarray(after > np.searchsorted(time, recording.time - AROUND, side="left"))


def require_no_contact(recording: Recording) -> None:
    """Check that neither a label nor a reference sensor shows contact."""
    label = recording.contact
    if label is not None and label.any():
        first = int(np.flatnonzero(label)[0])
        raise InputError(
            f"{recording.path}: column contact, row {first + 1}: 1 at {recording.time[first]:.6g} s, and in "
            f"{counted(int(label.sum()), 'sample')}; expected 0 throughout: false alarms are counted in free motion"
        )
    reference = recording.groups.get("external_torque")
    if reference is None:
        return
    most = _noise_limit(reference)
    wrong = np.argwhere(_off(reference, recording.time) > most)
    if len(wrong):
        row, j = wrong[0]
        raise InputError(
            f"{recording.path}: column external_torque[{j + 1}], row {row + 1}: {reference[row, j]:.4g} N.m at "
            f"{recording.time[row]:.6g} s; expected at most {most[j]:.2g} N.m from its median "
            f"({BEYOND_NOISE:g} times its noise), as in free motion"
        )


def _off(reference: Numbers, time: Numbers) -> Numbers:
    """Return [N, n] how far the running mean over about `SMOOTHED` is from the median."""
    values = reference - np.median(reference, axis=0)
    width = 1 if len(time) < 2 else max(1, min(len(time), round(SMOOTHED / float(np.median(np.diff(time))))))
    total = np.cumsum(np.vstack([np.zeros((1, values.shape[1])), values]), axis=0)
    begin = np.clip(np.arange(len(values)) - width // 2, 0, len(values) - width)
    return np.asarray(np.abs(total[begin + width] - total[begin]) / width)


def _noise_limit(reference: Numbers) -> Numbers:
    """Return [n] the largest torque that may be noise."""
    # from differences, so that contact does not count as noise; 90 % of a normal distribution lies within 1.645 σ
    step = np.diff(reference, axis=0) if len(reference) > 1 else np.zeros((1, reference.shape[1]))
    return np.asarray(BEYOND_NOISE * np.quantile(np.abs(step), 0.9, axis=0) / (1.645 * np.sqrt(2.0)) + 1e-9)


SETTLING = 2.0  # s after the first motion, before which the state of the friction is not known; not counted
SLOW = 0.05  # of a joint's usual largest speed, from which on it moves
STILL = 0.01  # least share of the time with motion; less says nothing about friction


@dataclass(frozen=True)
class FreePart:
    """A stretch of a recording without a gap; a finger starts anew at its beginning."""

    source: str  # file of the recording
    arrays: Mapping[str, Numbers]  # inputs of `native.Instance.run`
    mean_force: Numbers  # [N] mean tendon force (N)
    counted: Flags  # [N] samples after settling, without a stuck sensor
    seconds: Numbers  # [N] time that each sample stands for (s)
    kinematics: KinematicsSource = KinematicsSource.TENDON_POSITIONS
    moves: Flags | None = None  # [N] whether a joint moves; None: always

    @property
    def time(self) -> Numbers:
        """[N] times (s)."""
        return self.arrays["time"]

    @property
    def hours(self) -> float:
        """Counted time (h)."""
        return float(self.seconds[self.counted].sum()) / 3600.0

    def cut(self, rows: Indices) -> FreePart:
        """Return a stretch of it, in which a finger starts anew."""
        time = self.time[rows]
        return replace(
            self,
            arrays={name: values[rows] for name, values in self.arrays.items()},
            mean_force=self.mean_force[rows],
            counted=self.counted[rows] & _settled(time, None if self.moves is None else self.moves[rows]),
            seconds=self.seconds[rows],
            moves=None if self.moves is None else self.moves[rows],
        )


def _settled(time: Numbers, moves: Flags | None) -> Flags:
    """Return [N] the samples from `SETTLING` after the first motion on."""
    if moves is not None and not moves.any():
        return np.zeros(len(time), dtype=bool)
    return np.asarray(time - time[0 if moves is None else int(np.argmax(moves))] >= SETTLING)


# --- recordings -------------------------------------------------------------------------------------------------------


def free_parts(finger: Finger, recording: Recording, kinematics: int) -> tuple[list[FreePart], list[str]]:
    """Divide a recording into parts of free motion without gaps; contact that it shows is left out."""
    contact = touched(recording)
    groups = {name: values for name, values in recording.groups.items() if name != "external_torque"}
    prepared = prepare(finger, replace(recording, groups=groups, contact=None), kinematics, Held())
    moves = _moves(finger, recording, np.nan_to_num(np.abs(prepared.model.joint_speed)))
    force = np.abs(groups["tendon_force"]).mean(axis=1)
    parts = []
    for rows in (piece for part in prepared.parts for piece in _without(contact, part)):
        time = recording.time[rows]
        counted = _settled(time, moves[rows]) & ~prepared.faulty[rows]
        seconds, source = sample_seconds(time), KinematicsSource(kinematics)
        parts.append(
            FreePart(str(recording.path), prepared.arrays(rows), force[rows], counted, seconds, source, moves[rows])
        )
    sentences = [sentence.replace("are fitted as", "count as") for sentence in prepared.warnings]
    if contact.any():
        lost = float(sample_seconds(recording.time)[contact].sum())
        sentences.append(f"{lost:.3g} s of contact are left out, and {SETTLING:g} s after each touch")
    return parts, sentences


def _without(contact: Flags, part: slice) -> Iterator[slice]:
    """Yield the stretches of a part without contact."""
    for begin, end in flagged_rows(~contact[part]):
        yield slice(part.start + begin, part.start + end)


def _moves(finger: Finger, recording: Recording, speed: Numbers) -> Flags:
    """Return [N] whether a joint moves. Raises InputError for a recording that stands still."""
    least = number_of(finger.data, "velocity_threshold.joint")
    share = float((speed > least).any(axis=1).mean())
    if share < STILL:
        raise InputError(
            f"{recording.path}: no motion: no joint is faster than velocity_threshold.joint = {least:g} rad/s in "
            f"{100 * (1 - share):.1f} % of the time; expected free motion with stops and reversals of all joints"
        )
    return np.asarray((speed > np.maximum(least, SLOW * np.quantile(speed, 0.95, axis=0))).any(axis=1))


# --- runs -------------------------------------------------------------------------------------------------------------


def runs_of(described: Finger, parts: Sequence[FreePart]) -> Iterator[tuple[FreePart, dict[str, Array]]]:
    """Run a finger over every part, each from its start."""
    finger = described.instance(parts[0].kinematics)
    begin = finger.save_state()
    for part in parts:
        finger.restore_state(begin)
        with native.refusals_of(part.source):
            outputs = finger.run(part.arrays)
        yield part, outputs


@dataclass(frozen=True)
class Alarms:
    """False alarms of one part."""

    source: str
    begins: Indices  # first sample of each
    hours: float  # counted time
    longest: float  # s; 0 without alarms
    seconds: float  # in alarm, of all time (s)
    at_start: int  # before `SETTLING`, which do not count


def count_alarms(finger: Finger, parts: Sequence[FreePart]) -> list[Alarms]:
    """Run the finger over every part from its start. An alarm counts if it begins in counted time."""
    found = []
    for part, outputs in runs_of(finger, parts):
        contact = outputs["contact"].ravel().astype(bool)
        spans = stretches(part.time, contact)
        length = part.time[spans[:, 1]] + part.seconds[spans[:, 1]] - part.time[spans[:, 0]]
        counted = part.counted[spans[:, 0]]
        early = spans[:, 0] < (np.argmax(part.counted) if part.counted.any() else len(part.counted))
        found.append(
            Alarms(
                source=part.source,
                begins=spans[counted, 0],
                hours=part.hours,
                longest=float(length[counted].max(initial=0.0)),
                seconds=float(part.seconds[contact].sum()),
                at_start=int(early.sum()),
            )
        )
    return found
