"""Recordings for detection_limits.py: slow pushes, pushes in stiction, a finger to be disturbed.

The rig is examples/rigs/index_finger.json. Pushes come in slots, each of which a fresh finger is run over: what one
push leaves in the bias is not counted against the next. At rest a slot begins with a move of 1 s to another posture.
Everything is kept in a folder under its name, and what is there is not made again.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.files.tables import read_table, write_table
from tendonfmu.simulate.rig import read_rig
from tendonfmu.simulate.simulation import Table, simulate
from tendonfmu.statistics.quintic import evaluate

ROOT = Path(__file__).resolve().parent.parent
RIG = ROOT / "examples" / "rigs" / "index_finger.json"
RATE = 500.0  # Hz, the rig's

Numbers = NDArray[np.float64]
Arrays = dict[str, Numbers]

FORCES, RISES, HOLD, FALL = (0.25, 0.5, 1.0, 2.0), (0.1, 1.0, 10.0), 3.0, 0.1  # N, s
PAD = [0.0, 0.0, 1.0]  # direction on the fingertip, frame of the last link
CENTRE, SPREAD = np.array([0.0, 0.35, 0.45, 0.35]), np.array([0.15, 0.3, 0.3, 0.3])  # rad, postures at rest
MOVE, LEAD, TAIL = 1.0, 2.5, 0.5  # s: the move at a slot's begin; from there to the push; after it
STUCK_FORCE, STUCK_RISES, STUCK_HOLD, STUCK_COUNT = (0.02, 1.0), (0.05, 0.5), 0.5, 24
LEAST_FORCE = 0.01  # N, from which there is contact
WARM, PUSH_TIME, AFTER = (
    2.0,
    5.0,
    60.0,
)  # s: cut off the start of recovery's recordings; push at the start; minute after
DISTURBED, LONGEST = 10.0, 10.0  # s: begin of the other disturbances, the longest of them
RECOVERY_FORCE = 1.0  # N
_TRUE = ("external_torque", "joint_torque", "friction_torque", "joint_position", "joint_velocity")
_KINDS = ("rest", "motion", "stuck", "still")
WRIST = {
    "amplitude": 0.5,
    "period": 10.0,
    "arms": [0.01] * 8,  # m
    "friction": {"static": 0.03, "coulomb": 0.025, "stribeck_velocity": 0.005},
}


@dataclass(frozen=True)
class Case:
    """kind: "rest", "motion" (ramps), "stuck", "still" (recovery), "pushed" (the same with a push at the start) or
    "wrist" (the same over a wrist that turns); "rest_twin", "motion_twin": without the pushes.

    pretension: N. part: from 1.
    """

    kind: str
    pretension: float
    part: int

    @property
    def name(self) -> str:
        return f"{self.kind}_{self.pretension:g}_{self.part}"

    @property
    def pushes(self) -> str:
        """The kind whose pushes and motion it has."""
        return self.kind.removesuffix("_twin")

    @property
    def twin(self) -> Case:
        return replace(self, kind=f"{self.kind}_twin")

    @property
    def seed(self) -> int:
        """Of motion and noise, which twins and the recordings of recovery share."""
        kind = _KINDS.index("still" if self.kind in ("pushed", "wrist") else self.pushes)
        return 7_000_000 + 10_000 * kind + 100 * round(self.pretension) + self.part


@dataclass(frozen=True)
class Slot:
    """One push. begin, push, end: s, of the slot, of the push's rise, of the slot. force: N. rise, hold: s."""

    begin: float
    push: float
    end: float
    force: float
    rise: float
    hold: float

    @property
    def top(self) -> float:
        """s, end of the hold."""
        return self.push + self.rise + self.hold


def slots(case: Case) -> list[Slot]:
    random = np.random.default_rng([case.seed, 1])
    if case.kind == "stuck":
        forces = np.exp(random.uniform(*np.log(STUCK_FORCE), STUCK_COUNT))
        asked = [(float(force), STUCK_RISES[k % 2], STUCK_HOLD) for k, force in enumerate(forces)]
    else:
        asked = [(force, rise, HOLD) for force in FORCES for rise in RISES]
        random.shuffle(asked)
    found, begin = [], MOVE
    for force, rise, hold in asked:
        push = begin + LEAD + round(float(random.uniform(0.0, 0.5)), 3)
        end = push + rise + hold + FALL + TAIL
        found.append(Slot(begin, push, end, force, rise, hold))
        begin = end
    return found


def write_rig(folder: Path, case: Case) -> Path:
    rig: dict[str, Any] = {
        "format": "tendonfmu-rig-1",
        "base": str(RIG),
        "name": case.name,
        "seed": case.seed,
        "physics": {"contact_force": LEAST_FORCE},
        "motion": {"pretension": case.pretension, "seed": case.seed, "duration": None},
        "pushes": [],
        "recording": {"columns": ["joint_position", "external_torque", "contact"]},
    }
    if case.pushes in ("still", "pushed", "wrist"):
        duration = WARM + DISTURBED + LONGEST + AFTER + 1.0
        if case.kind == "pushed":
            rig["pushes"] = [_push(WARM - 1.0, 0.1, 0.9 + PUSH_TIME, RECOVERY_FORCE)]
        if case.kind == "wrist":
            rig["physics"]["wrist"] = WRIST
    else:
        asked = slots(case)
        duration = asked[-1].end + 1.0
        if case.kind == case.pushes:
            rig["pushes"] = [_push(slot.push, slot.rise, slot.hold, slot.force) for slot in asked]
        if case.pushes == "motion":
            rig["motion"]["rest_share"] = 0.0
        else:
            file = folder / f"motion_{case.name}.parquet"
            write_table(file, _postures(case, asked, duration))
            rig["motion"] = {"kind": "file", "file": file.name, "pretension": case.pretension}
    rig["recording"]["duration"] = duration
    file = folder / f"{case.name}.json"
    file.write_text(json.dumps(rig), encoding="utf-8")
    return file


def _push(start: float, rise: float, hold: float, force: float) -> dict[str, Any]:
    return {"start": start, "rise": rise, "hold": hold, "fall": FALL, "force": force, "direction": PAD}


def _postures(case: Case, asked: list[Slot], duration: float) -> Table:
    """A motion file: a move to another posture at the begin of each slot."""
    random = np.random.default_rng([case.seed, 2])
    time, posture = [0.0], [CENTRE]
    for slot in asked:
        time += [slot.begin, slot.begin + MOVE]
        posture += [posture[-1], CENTRE + SPREAD * random.uniform(-1.0, 1.0, len(CENTRE))]
    time, posture = [*time, duration], [*posture, posture[-1]]
    table: Table = {"time": np.array(time)}
    for j, angles in enumerate(np.array(posture).T, start=1):
        knots = np.column_stack([time, angles, np.zeros((len(time), 2))])
        for name, values in zip(("position", "velocity", "acceleration"), evaluate(knots, np.array(time)), strict=True):
            table[f"joint_{name}[{j}]"] = values
    return table


def made(folder: Path, case: Case) -> Arrays:
    """The recording and the truth: time, contact_force [N], tendon_force, tendon_position [N, m], and of the truth
    external_torque, joint_torque, friction_torque, joint_position, joint_velocity as true_NAME [N, n].
    """
    file = folder / f"{case.name}.parquet"
    if not file.exists():
        run = simulate(read_rig(write_rig(folder, case)), truth=True)
        assert run.truth is not None
        kept = {name: run.recording[name] for name in run.recording if name.startswith(("time", "tendon_"))}
        for name, values in run.truth.items():
            if name.split("[")[0] in _TRUE:
                kept[f"true_{name}"] = values
        kept["contact_force"] = np.sqrt(sum(run.truth[f"contact_force[{axis}]"] ** 2 for axis in (1, 2, 3)))
        write_table(file, kept)
    table = read_table(file, lambda _path, _names: None)
    groups: dict[str, list[Numbers]] = {}
    for name, values in table.items():
        groups.setdefault(name.split("[")[0], []).append(values)
    return {name: np.column_stack(each) if f"{name}[1]" in table else each[0] for name, each in groups.items()}


def cut(arrays: Arrays, begin: float, end: float) -> Arrays:
    """The samples from begin to end, s."""
    first, last = np.searchsorted(arrays["time"], (begin - 1e-9, end + 1e-9))
    return {name: values[first:last] for name, values in arrays.items()}
