"""Where detection ends and how it recovers: slow pushes, pushes in stiction, disturbances (docs/evidence/fit.md).

On the virtual index finger (detection_limit_cases.py), any number of descriptions beside one another:

    python bench/detection_limits.py -o FOLDER --finger paper=fitted.json --finger recommended=tuned.json

Recordings are kept in the folder. Writes detection_limits.md, and detection_limits.json with a row for every push and
every disturbance.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from detection_cases import tendon_velocity
from detection_limit_cases import (
    AFTER,
    DISTURBED,
    FALL,
    LEAST_FORCE,
    LONGEST,
    MOVE,
    PUSH_TIME,
    RATE,
    WARM,
    Arrays,
    Case,
    Numbers,
    Slot,
    cut,
    made,
    slots,
)
from detection_limit_table import ramp_tables, recovery_table, stuck_tables
from tendonfmu.detect.counting import Event, score_detection, stretches
from tendonfmu.files.writing import whole_file
from tendonfmu.model.balance import moment_arms
from tendonfmu.model.native import Instance, image_from_json

Row = dict[str, Any]

PRESLIDING = 0.004  # rad, of the rig's joints
SETTLED = 0.5  # s of a sound state without a break, from which it counts as sound again
FORCE_STEP, POSITION_STEP, DROPPED, SHIFT = 0.5, 1e-4, 0.5, 1e-3  # N, m, s, m


@dataclass(frozen=True)
class Subject:
    """A description under a name. free: the same without detection, whose bias always follows."""

    name: str
    data: Mapping[str, Any]
    image: bytes
    free: bytes

    @classmethod
    def of(cls, name: str, data: Mapping[str, Any]) -> Subject:
        never = dict(data) | {"contact": {"threshold": [1e6] * len(data["joints"])}}
        return cls(name, data, image_from_json(json.dumps(data)), image_from_json(json.dumps(never)))

    def run(self, arrays: Arrays, detecting: bool = True) -> Arrays:
        return Instance(self.image if detecting else self.free).run(arrays)


# --- pushes: computing ------------------------------------------------------------------------------------------------


def run_slots(folder: Path, cases: Iterable[Case], subjects: Sequence[Subject]) -> list[Row]:
    """Every push of these recordings under every description, a fresh finger for each."""
    rows: list[Row] = []
    for case in cases:
        whole = made(folder, case)
        twin = None if case.kind == "stuck" else made(folder, case.twin)
        for slot in slots(case):
            arrays = cut(whole, slot.begin, slot.end)
            alone = None if twin is None else cut(twin, slot.begin, slot.end)
            truth = _stuck(arrays, slot, subjects[0].data) if alone is None else {}
            common = {"kind": case.kind, "pretension": case.pretension, "part": case.part}
            common |= {"force": slot.force, "rise": slot.rise} | truth
            rows += [common | {"finger": each.name} | _pushed(each, arrays, alone, slot) for each in subjects]
    return rows


def _pushed(subject: Subject, arrays: Arrays, twin: Arrays | None, slot: Slot) -> Row:
    """twin: the same slot without the push. by_chance: found there. lead_alarms: that begin before the push.
    released: an alarm begins as it goes.
    """
    out, time = subject.run(arrays), arrays["time"]
    # a load that goes is a change too: an alarm of the release has not found the push
    label = (arrays["contact_force"] >= LEAST_FORCE) & (time <= slot.top + 1e-9)
    score = score_detection(arrays["time"], label, out["contact"].ravel())
    event = score.events[0]
    lead = [begin for begin, _end in score.false_alarms if slot.begin + MOVE <= begin < slot.push]
    begins = [float(time[begin]) for begin, _ in stretches(time, out["contact"].ravel())]
    row: Row = {"released": any(slot.top + 1e-9 < begin <= slot.top + FALL + 0.1 for begin in begins)}
    row |= {"found": event.found, "silent": event.silent, "delay": event.delay, "lead_alarms": len(lead)}
    if twin is None:
        return row
    alone = subject.run(twin)
    chance = score_detection(twin["time"], label, alone["contact"].ravel()).events[0].found
    return row | {"by_chance": chance} | _at_alarm(event, (arrays, twin), (out, alone), slot)


def _at_alarm(event: Event, inputs: tuple[Arrays, Arrays], outputs: tuple[Arrays, Arrays], slot: Slot) -> Row:
    """Load at the alarm, or at the end of the hold where there is none, and of that load the shares that reach the
    springs, that the filter has put into the bias since the push began, and that are left in the output; each by the
    difference from the twin.
    """
    arrays = inputs[0]
    time = arrays["time"]
    before = int(np.searchsorted(time, slot.push)) - 1
    at = int(np.searchsorted(time, (event.alarm if event.found else slot.top) - 1e-9))
    load = arrays["true_external_torque"][at]
    tension = inputs[0]["true_joint_torque"][at] - inputs[1]["true_joint_torque"][at]
    learned = [(out["residual"] - out["compensated_torque"])[before + 1 : at + 1].sum(axis=0) for out in outputs]
    left = outputs[0]["compensated_torque"][at] - outputs[1]["compensated_torque"][at]
    parts = {"reach": tension, "absorbed": learned[0] - learned[1], "left": left}
    return {
        "force_at": float(arrays["contact_force"][at]),
        "torque_at": float(np.abs(load).max()),
        "held": event.held_share if event.found else math.nan,
        **{name: float(torque @ load / (load @ load)) for name, torque in parts.items()},
    }


def _stuck(arrays: Arrays, slot: Slot, data: Mapping[str, Any]) -> Row:
    """What is true of a push at rest. stays: "below" no joint moves farther than its presliding distance and all
    velocities stay below the description's thresholds, "yields" the former alone, "slides" neither. reach, lost: share
    of the external torque that the springs and that friction take in the end. springs, bristles: N·m/rad along the
    motion. motor, tension: m, N, largest change of a tendon's position at the motor and of its force.
    visible: until the hold begins, the torque of the measured forces leaves what it was in the half second before by
    more than twice its own range there.
    """
    inside, settled, before = (
        cut(arrays, *window)
        for window in (
            (slot.push, slot.top),
            (slot.top - 0.1, slot.top),
            (slot.push - 0.1, slot.push),
        )
    )
    speed, limits = inside["true_joint_velocity"], data["velocity_threshold"]
    slow = np.abs(speed).max() <= limits["joint"]
    slow &= np.abs(tendon_velocity(moment_arms(data), speed)).max() <= limits["tendon"]
    moved = np.abs(inside["true_joint_position"] - before["true_joint_position"].mean(axis=0)).max()
    change = {
        name: settled[name].mean(axis=0) - before[name].mean(axis=0) for name in arrays if np.ndim(arrays[name]) > 1
    }
    load, springs, friction = (change[f"true_{name}_torque"] for name in ("external", "joint", "friction"))
    turn = change["true_joint_position"]
    torque, start = arrays["tendon_force"] @ moment_arms(data), slot.push - arrays["time"][0]
    first, last = (round(start * RATE) + offset for offset in (-round(0.5 * RATE), round((slot.rise + 0.05) * RATE)))
    quiet, pushed = torque[first : first + round(0.5 * RATE)], torque[first + round(0.5 * RATE) : last]
    range_ = np.ptp(quiet, axis=0)
    return {
        "visible": bool(np.any(np.abs(pushed - quiet.mean(axis=0)).max(axis=0) > 2.0 * range_)),
        "stays": "slides" if moved > PRESLIDING else "below" if slow else "yields",
        "moved": float(moved),
        "load": float(np.abs(load).max()),
        "reach": float(springs @ load / (load @ load)),
        "lost": float(-friction @ load / (load @ load)),
        "springs": float(-springs @ turn / (turn @ turn)),
        "bristles": float(friction @ turn / (turn @ turn)),
        "motor": float(np.abs(change["tendon_position"]).max()),
        "tension": float(np.abs(change["tendon_force"]).max()),
    }


# --- disturbances: computing ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Disturbance:
    """change: makes the arrays of a recording without it into those with it, given the tendon.

    begin, end: s. kind: of the recording. step: N in the force of that tendon for good, which the bias must take.
    """

    name: str
    begin: float
    end: float
    change: Callable[[Arrays, int], Arrays]
    step: float = 0.0
    kind: str = "still"


def _with(name: str, change: Callable[[Numbers, Numbers, int], None]) -> Callable[[Arrays, int], Arrays]:
    """change: writes into a copy of the signals, given time, signals and tendon."""

    def changed(arrays: Arrays, tendon: int) -> Arrays:
        signals = arrays[name].copy()
        change(arrays["time"], signals, tendon)
        return arrays | {name: signals}

    return changed


def _step(size: float) -> Callable[[Numbers, Numbers, int], None]:
    def change(time: Numbers, signals: Numbers, tendon: int) -> None:
        signals[time >= DISTURBED, tendon] += size

    return change


def _gone(held: bool) -> Callable[[Numbers, Numbers, int], None]:
    def change(time: Numbers, signals: Numbers, tendon: int) -> None:
        gone = (time >= DISTURBED) & (time < DISTURBED + DROPPED)
        signals[gone, tendon] = signals[np.argmax(gone), tendon] if held else 0.0

    return change


def _shift(time: Numbers, signals: Numbers, _tendon: int) -> None:
    phase = np.clip((time - DISTURBED) / LONGEST, 0.0, 1.0)
    signals += (SHIFT * np.sin(np.pi * phase) ** 2)[:, None]


DISTURBANCES = (
    Disturbance("none", DISTURBED, DISTURBED, lambda arrays, _tendon: arrays),
    Disturbance("in contact at t = 0", 0.0, PUSH_TIME + 0.1, lambda arrays, _tendon: arrays, kind="pushed"),
    Disturbance("force + 0.5 N", DISTURBED, DISTURBED, _with("tendon_force", _step(FORCE_STEP)), FORCE_STEP),
    Disturbance("position + 0.1 mm", DISTURBED, DISTURBED, _with("tendon_position", _step(POSITION_STEP))),
    Disturbance("force reads 0 for 0.5 s", DISTURBED, DISTURBED + DROPPED, _with("tendon_force", _gone(held=False))),
    Disturbance(
        "position stands for 0.5 s", DISTURBED, DISTURBED + DROPPED, _with("tendon_position", _gone(held=True))
    ),
    Disturbance(
        "all positions 1 mm and back in 10 s", DISTURBED, DISTURBED + LONGEST, _with("tendon_position", _shift)
    ),
    Disturbance("wrist turns throughout", 0.0, 0.0, lambda arrays, _tendon: arrays, kind="wrist"),
)


def run_recovery(folder: Path, pretension: float, parts: int, subjects: Sequence[Subject]) -> list[Row]:
    """Every disturbance under every description, one recording for each part."""
    twins = [_started(made(folder, Case("still", pretension, part))) for part in range(1, parts + 1)]
    free = [[subject.run(twin, detecting=False) for twin in twins] for subject in subjects]
    squares = np.mean([np.mean(out["residual"][1:] ** 2, axis=0) for out in free[0]], axis=0)
    limit = 2.0 * np.sqrt(squares)
    rows: list[Row] = []
    for number, twin in enumerate(twins):
        pushed, wrist = (_started(made(folder, Case(kind, pretension, number + 1))) for kind in ("pushed", "wrist"))
        tendon = 3 * number % twin["tendon_force"].shape[1]
        for disturbance in DISTURBANCES:
            arrays = disturbance.change({"pushed": pushed, "wrist": wrist, "still": twin}[disturbance.kind], tendon)
            for subject, alone in zip(subjects, free, strict=True):
                shift = disturbance.step * moment_arms(subject.data)[tendon]
                late = twin["time"] >= disturbance.begin
                # what a turning wrist does to the torque is the bias's to take
                base = subject.run(wrist, detecting=False) if disturbance.kind == "wrist" else alone[number]
                reference = base["bias_torque"] + np.where(late[:, None], shift, 0.0)
                out = subject.run(arrays)
                found = recovered(arrays["time"], out, reference, limit, (disturbance.begin, disturbance.end))
                common = {"kind": disturbance.name, "pretension": pretension, "part": number + 1}
                rows.append(common | {"finger": subject.name} | found)
    return rows


def _started(arrays: Arrays) -> Arrays:
    """From `WARM` on, which is then 0 s: what happened before the first sample is not known to the finger."""
    kept = cut(arrays, WARM, math.inf)
    return kept | {"time": kept["time"] - kept["time"][0]}


def recovered(time: Numbers, out: Arrays, reference: Numbers, limit: Numbers, span: tuple[float, float]) -> Row:
    """reference: [N, n] bias of a run that nothing disturbs; limit: [n] N·m. span: begin and end of what disturbs, s.

    until: s from the end until the state stays sound for `SETTLED`: bias within the limits, no contact; infinite if it
    never does. at_once, after: alarms that begin in it (0.1 s after its end included), in the minute after. longest: s,
    of an alarm from its begin on. lasting: there is still one at the end. sound: share of the minute.
    """
    begin, end = span
    alarm = out["contact"].ravel()
    sound = np.all(np.abs(out["bias_torque"] - reference) < limit, axis=1) & ~alarm
    minute = (time >= end) & (time <= end + AFTER)
    good, step = sound[minute], float(time[1] - time[0])
    enough = round(SETTLED / step)
    runs = np.convolve(good, np.ones(enough), "full")[enough - 1 :] > enough - 0.5  # sound from here for `SETTLED`
    alarms = [(float(time[a]), float(time[b])) for a, b in stretches(time, alarm)]
    seen = [(a, min(b, end + AFTER)) for a, b in alarms if b >= begin and a <= end + AFTER]
    return {
        "until": float(np.argmax(runs)) * step if runs.any() else math.inf,
        "at_once": sum(begin <= a <= end + 0.1 for a, _ in seen),
        "after": sum(a > end + 0.1 for a, _ in seen),
        "longest": max((b - max(a, begin) + step for a, b in seen), default=0.0),
        "lasting": bool(alarm[minute][-1]),
        "sound": float(good.mean()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--finger", action="append", required=True, metavar="NAME=FILE")
    parser.add_argument("--parts", type=int, default=8, help="recordings of each kind and pretension")
    given = parser.parse_args()
    subjects = []
    for each in given.finger:
        name, _, file = each.partition("=")
        if not Path(file).is_file():
            parser.error(f"--finger {each}: expected NAME=FILE with a finger description that exists")
        subjects.append(Subject.of(name, json.loads(Path(file).read_text(encoding="utf-8"))))
    folder, numbers = given.output, range(1, given.parts + 1)
    folder.mkdir(parents=True, exist_ok=True)
    pretensions = (10.0, 40.0)
    ramps = [Case(kind, p, part) for kind in ("rest", "motion") for p in pretensions for part in numbers]
    stuck = [Case("stuck", p, part) for p in (10.0, 20.0, 40.0) for part in numbers]
    parts = {
        "Recovery": (
            [row for p in pretensions for row in run_recovery(folder, p, given.parts, subjects)],
            recovery_table,
        ),
        "Pushes in stiction": (run_slots(folder, stuck, subjects), stuck_tables),
        "Slow pushes": (run_slots(folder, ramps, subjects), ramp_tables),
    }
    text = "\n".join(line for name, (rows, show) in parts.items() for line in (f"## {name}", "", *show(rows), ""))
    for file, content in (("json", json.dumps({name: rows for name, (rows, _) in parts.items()})), ("md", text)):
        with whole_file(folder / f"detection_limits.{file}") as temporary:
            temporary.write_text(content, encoding="utf-8")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
