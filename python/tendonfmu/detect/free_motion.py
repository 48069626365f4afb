"""Recordings of free motion to tune contact detection on: the check for contact, residuals, and alarms of a finger."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Array, Data, Flags, Numbers
from tendonfmu.detect.counting import sample_seconds, stretches
from tendonfmu.detect.reference_sensor import touched
from tendonfmu.errors import InputError
from tendonfmu.model import NEVER, Finger, native, number_of
from tendonfmu.options import KinematicsSource
from tendonfmu.recordings import Held, Recording, flagged_rows, prepare

Signal = NDArray[np.float32]  # saves memory for millions of samples; seven digits suffice to choose thresholds

SETTLING = 2.0  # s after the start, while the bias forgets its initial variance; not counted
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

    @property
    def time(self) -> Numbers:
        """[N] times (s)."""
        return self.arrays["time"]

    @property
    def hours(self) -> float:
        """Counted time (h)."""
        return float(self.seconds[self.counted].sum()) / 3600.0


@dataclass(frozen=True)
class FreeRun:
    """Residuals of a part for a finger with contact detection switched off, all [N, n] and in N·m."""

    part: FreePart  # the stretch of free motion
    residual: Signal  # r, y and d
    innovation: Signal
    drift: Signal
    stuck: Signal  # H and J
    jump: Signal
    known: Signal  # standard deviation that is known before any tuning: of the bias and of the model's uncertainty
    uncertain: Signal  # u, the standard deviation of the model's uncertainty alone


@dataclass(frozen=True)
class Clock:
    """Time constants of the run: innovation T, jump T_J and stuck T_H (s)."""

    innovation: float
    jump: float
    stuck: float


# --- recordings -------------------------------------------------------------------------------------------------------


def free_parts(finger: Finger, recording: Recording, kinematics: int) -> tuple[list[FreePart], list[str]]:
    """Divide a recording into parts of free motion without gaps; contact that it shows is left out."""
    contact = touched(recording)
    groups = {name: values for name, values in recording.groups.items() if name != "external_torque"}
    prepared = prepare(finger, replace(recording, groups=groups, contact=None), kinematics, Held())
    _refuse_stillness(finger, recording, prepared.model.joint_speed)
    force = np.abs(groups["tendon_force"]).mean(axis=1)
    parts = []
    for rows in (piece for part in prepared.parts for piece in _without(contact, part)):
        time = recording.time[rows]
        settled = time - time[0] >= SETTLING
        arrays = prepared.arrays(rows)
        counted = settled & ~prepared.faulty[rows]
        seconds, source = sample_seconds(time), KinematicsSource(kinematics)
        parts.append(FreePart(str(recording.path), arrays, force[rows], counted, seconds, source))
    sentences = [sentence.replace("are fitted as", "count as") for sentence in prepared.warnings]
    if contact.any():
        lost = float(sample_seconds(recording.time)[contact].sum())
        sentences.append(f"{lost:.3g} s of contact are left out, and {SETTLING:g} s after each touch")
    return parts, sentences


def _without(contact: Flags, part: slice) -> Iterator[slice]:
    """Yield the stretches of a part without contact."""
    for begin, end in flagged_rows(~contact[part]):
        yield slice(part.start + begin, part.start + end)


def _refuse_stillness(finger: Finger, recording: Recording, speed: Numbers) -> None:
    least = number_of(finger.data, "velocity_threshold.joint")
    share = float(np.nanmean((np.abs(speed) > least).any(axis=1)))
    if share < STILL:
        raise InputError(
            f"{recording.path}: no motion: no joint is faster than velocity_threshold.joint = {least:g} rad/s in "
            f"{100 * (1 - share):.1f} % of the time; expected free motion with stops and reversals of all joints"
        )


# --- runs -------------------------------------------------------------------------------------------------------------


def run_free(data: Data, parts: Sequence[FreePart], clock: Clock) -> list[FreeRun]:
    """Run the finger over every part with contact detection switched off."""
    probe = _open_loop(data, clock)
    plain = runs_of(_without_uncertainty(probe), parts) if _is_uncertain(data) else repeat((None, None))
    runs = []
    for (part, outputs), (_, of_bias) in zip(runs_of(probe, parts), plain, strict=False):
        known = outputs["compensated_torque_std"]
        uncertain = np.zeros_like(known)
        if of_bias is not None:
            uncertain = np.sqrt(np.maximum(known**2 - of_bias["compensated_torque_std"] ** 2, 0.0))
        names = ("residual", "innovation", "drift", "stuck_friction", "friction_jump")
        arrays = [*(outputs[name] for name in names), known, uncertain]
        runs.append(FreeRun(part, *(values.astype(np.float32) for values in arrays)))
    return runs


def _is_uncertain(data: Data) -> bool:
    return (data.get("contact") or {}).get("uncertainty") is not None


def _open_loop(data: Data, clock: Clock) -> dict[str, Any]:
    """Return the description with all signals of contact detection, and thresholds that are never exceeded."""
    never = [NEVER] * len(data["joints"])
    given = data["contact"].get("friction_bound") or {}
    contact: dict[str, Any] = {
        "method": "innovation",
        "threshold": never,
        "innovation": {"time": clock.innovation, "threshold": never},
        "drift": {"threshold": never},
        "friction_bound": {
            **given,
            "stuck_share": 0.0,
            "jump_share": 0.0,
            "jump_time": clock.jump,
            "stuck_time": clock.stuck,
        },
    }
    if _is_uncertain(data):
        contact["uncertainty"] = data["contact"]["uncertainty"]
    return {**data, "contact": contact, "sensor_fault": None}


def _without_uncertainty(data: Data) -> dict[str, Any]:
    return {**data, "contact": {key: value for key, value in data["contact"].items() if key != "uncertainty"}}


def runs_of(data: Data, parts: Sequence[FreePart]) -> Iterator[tuple[FreePart, dict[str, Array]]]:
    """Run a finger over every part, each from its start."""
    finger = native.Instance.from_description(data, parts[0].kinematics)
    begin = finger.save_state()
    for part in parts:
        finger.restore_state(begin)
        try:
            yield part, finger.run(part.arrays)
        except native.NativeError as refused:
            raise InputError(f"{part.source}: {refused}") from None


def closed_loop(data: Data, parts: Sequence[FreePart]) -> Iterator[Flags]:
    """Yield [N] `contact` of the finger as it is, for every part."""
    for _, outputs in runs_of(data, parts):
        yield np.asarray(outputs["contact"]).ravel().astype(bool)


@dataclass(frozen=True)
class LoopAlarms:
    """Alarms of one part."""

    part: int
    source: str
    begins: list[float]
    ends: list[float]
    at_start: int
    hours: float
    seconds: float
    alarm_seconds: float

    @property
    def alarms(self) -> int:
        return len(self.begins)

    @property
    def longest(self) -> float:
        """Longest alarm (s); 0 without alarms."""
        return max((end - begin for begin, end in zip(self.begins, self.ends, strict=True)), default=0.0)


def count_loop(data: Data, parts: Sequence[FreePart]) -> list[LoopAlarms]:
    """Run the finger over every part from its start. An alarm counts if it begins in counted time."""
    alarms = []
    for k, (part, contact) in enumerate(zip(parts, closed_loop(data, parts), strict=True)):
        time = part.time - part.time[0]
        spans = stretches(part.time, contact)
        settled = time[spans[:, 0]] >= SETTLING if len(spans) else np.zeros(0, dtype=bool)
        counted = spans[part.counted[spans[:, 0]]] if len(spans) else spans
        alarms.append(
            LoopAlarms(
                part=k,
                source=part.source,
                begins=[float(time[begin]) for begin, _ in counted],
                ends=[float(time[end] + part.seconds[end]) for _, end in counted],
                at_start=int((~settled).sum()),
                hours=part.hours,
                seconds=float(part.seconds.sum()),
                alarm_seconds=float(part.seconds[contact].sum()),
            )
        )
    return alarms
