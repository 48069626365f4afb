"""Pushes of 0.05 to 1 N on a finger at rest: how many contact.rest finds with the bounds that `tune` learns for it.

On the virtual index finger (the pushes in stiction of detection_limit_cases.py) and on fingers in MuJoCo that hide
nothing (python_tests/foreign/mujoco_rests.py). Bounds come from rests without pushes, alarms are counted in others.

    python bench/contact_at_rest.py -o FOLDER [--seconds 600]

Recordings are kept in the folder. Prints a table, a row a finger.
"""

from __future__ import annotations

import argparse
import json
import pickle
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detection_limit_cases import ROOT, Case, cut, made, slots
from tendonfmu.detect.contact_at_rest import count_alarms, find_rests, learn_rest
from tendonfmu.detect.free_motion import free_parts
from tendonfmu.model.description import Finger
from tendonfmu.model.native import Instance, image_from_json
from tendonfmu.recordings.recording import Recording

sys.path.insert(0, str(ROOT / "python_tests" / "foreign"))
import mujoco_rests

Arrays = dict[str, NDArray[np.float64]]

RATE, CONFIDENCE = 6.0, 0.9  # 1/h
BELOW = 0.004  # rad; less than that is no sliding, as in detection_limits.py
HAND_PARTS, PRETENSIONS = range(1, 9), (10.0, 20.0, 40.0)
MUJOCO = (1, 2, 19, 20)  # cases that hide nothing
LEAST_FORCE = 0.05  # N


@dataclass(frozen=True)
class Pushed:
    """One push: what a finger sees of it. begin, end: s, from the rise to the end of the hold. moved: rad."""

    arrays: Arrays
    begin: float
    end: float
    force: float
    moved: float


@dataclass
class Counts:
    found: list[bool] = field(default_factory=list)
    below: list[bool] = field(default_factory=list)
    forced: list[bool] = field(default_factory=list)  # at least LEAST_FORCE
    alarms: int = 0  # before a push
    delays: list[float] = field(default_factory=list)
    tails: list[float] = field(default_factory=list)  # share of the time from 0.2 s after the push on in contact


def described(data: Mapping[str, Any]) -> Finger:
    text = json.dumps(data).encode()
    return Finger(Path("finger"), text, data, image_from_json(text))


def inputs(arrays: Arrays) -> Arrays:
    return {name: arrays[name] for name in ("time", "tendon_force", "tendon_position")}


def recording(arrays: Arrays) -> Recording:
    groups = inputs(arrays)
    return Recording(Path("recording"), groups.pop("time"), groups)


def measure(data: Mapping[str, Any], free: Sequence[Arrays], other: Sequence[Arrays], pushes: Iterator[Pushed]) -> str:
    """Learns from `free`, counts alarms in `other` and pushes found; a row of the table."""
    finger = described(data)
    parts, others = ([part for a in each for part in free_parts(finger, recording(a), 1)[0]] for each in (free, other))
    rule, sentences = learn_rest(data, parts, RATE, CONFIDENCE)
    if rule is None:
        return f"no rule: {sentences}"
    never = {**rule.keys, "threshold": [1e9] * len(data["joints"]), "creep": None, "innovation": None}
    minutes = sum(float(rest.time[-1]) for rest in find_rests(data, others, never)) / 60.0
    alarms = count_alarms(data, others, rule.keys)
    image = described({**data, "contact": {"threshold": [1e9] * len(data["joints"]), "rest": dict(rule.keys)}}).image
    counts = Counts()
    for push in pushes:
        count_push(image, push, counts)
    found, below, forced = (np.array(each) for each in (counts.found, counts.below, counts.forced))
    cells = [f"{60 * rule.hours:.1f}", str(rule.rests), f"{minutes:.1f}", str(alarms), str(counts.alarms)]
    for chosen in (below, below & forced, forced):
        cells.append(f"{int(found[chosen].sum())} of {int(chosen.sum())}")
    cells += [f"{1e3 * float(np.median(counts.delays)):.0f}", f"{100 * float(np.mean(counts.tails)):.0f}"]
    print(json.dumps(dict(rule.keys)), file=sys.stderr)
    return " | ".join(cells)


def count_push(image: bytes, push: Pushed, counts: Counts) -> None:
    time = push.arrays["time"]
    alarm = Instance(image).run(inputs(push.arrays))["contact_at_rest"].ravel()
    during = (time >= push.begin) & (time <= push.end)
    before = (time < push.begin) & (time > push.begin - 1.0)
    counts.alarms += int(np.any(alarm[before]))
    counts.found.append(bool(alarm[during].any()))
    counts.below.append(push.moved <= BELOW)
    counts.forced.append(abs(push.force) >= LEAST_FORCE)
    if counts.found[-1]:
        counts.delays.append(float(time[during][np.argmax(alarm[during])] - push.begin))
        counts.tails.append(float(alarm[time > push.end + 0.3].mean()))


def moved(angle: NDArray[np.float64], time: NDArray[np.float64], begin: float, end: float) -> float:
    """rad, the farthest that any joint goes from where it was in the tenth of a second before."""
    before = angle[(time >= begin - 0.1) & (time < begin)].mean(axis=0)
    return float(np.abs(angle[(time >= begin) & (time <= end)] - before).max())


# --- the virtual hand -------------------------------------------------------------------------------------------------


def hand(folder: Path) -> str:
    data = json.loads((ROOT / "examples" / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
    folder.mkdir(parents=True, exist_ok=True)

    def twins(parts: Sequence[int]) -> list[Arrays]:
        return [made(folder, Case("stuck_twin", force, part)) for part in parts for force in PRETENSIONS]

    return measure(data, twins(HAND_PARTS[::2]), twins(HAND_PARTS[1::2]), hand_pushes(folder))


def hand_pushes(folder: Path) -> Iterator[Pushed]:
    for part in HAND_PARTS:
        for force in PRETENSIONS:
            case = Case("stuck", force, part)
            whole = made(folder, case)
            for slot in slots(case):
                arrays = cut(whole, slot.begin, slot.end)
                far = moved(arrays["true_joint_position"], arrays["time"], slot.push, slot.top)
                yield Pushed(arrays, slot.push, slot.top, slot.force, far)


# --- MuJoCo -----------------------------------------------------------------------------------------------------------


def in_mujoco(folder: Path, number: int, seconds: float) -> str:
    made = [kept(folder, number, seconds, pushed, seed) for pushed, seed in ((False, 1), (False, 2), (True, 1))]
    free, other, (case, arrays) = made[0][1], made[1][1], made[2]
    return measure(case.nominal, [free], [other], mujoco_pushes(case, arrays))


def kept(folder: Path, number: int, seconds: float, pushed: bool, seed: int) -> tuple[mujoco_rests.Rests, Arrays]:
    case = mujoco_rests.rests(number, seconds, pushed, seed)
    file = folder / f"mujoco_{number}_{seconds:g}_{'pushed' if pushed else 'free'}_{seed}.pickle"
    if not file.exists():
        record = mujoco_rests.record(case, seed)
        groups = {"time": record.recording["time"].to_numpy(), "angle": record.angle}
        for name in ("tendon_force", "tendon_position"):
            columns = [f"{name}[{i + 1}]" for i in range(case.physics.tendons)]
            groups[name] = np.ascontiguousarray(record.recording[columns].to_numpy())
        file.write_bytes(pickle.dumps(groups))
    return case, pickle.loads(file.read_bytes())


def mujoco_pushes(case: mujoco_rests.Rests, arrays: Arrays) -> Iterator[Pushed]:
    for push, stop, leave in zip(case.pushes, case.time[2::2], case.time[3::2], strict=True):
        end = push.start + push.rise + push.hold
        part = cut(arrays, stop - mujoco_rests.MOVE, leave)
        yield Pushed(part, push.start, end, push.force, moved(part["angle"], part["time"], push.start, end))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the recordings")
    parser.add_argument("--seconds", type=float, default=600.0, help="of each recording in MuJoCo")
    parser.add_argument("--mujoco", type=int, nargs="*", default=MUJOCO, help="cases of fingers_in_mujoco.py")
    arguments = parser.parse_args()
    print(
        "| finger | learned from, min | rests | other rests, min | alarms | before a push | below break-away "
        "| of them ≥ 0.05 N | all ≥ 0.05 N | delay, ms | after a push, % |"
    )
    print("| --- |" + " ---: |" * 10)
    print(f"| virtual hand | {hand(arguments.output)} |", flush=True)
    for number in arguments.mujoco:
        print(f"| mujoco_{number:02d} | {in_mujoco(arguments.output, number, arguments.seconds)} |", flush=True)


if __name__ == "__main__":
    main()
