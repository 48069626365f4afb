"""Recordings of the simulated index finger: slow pushes, pushes in stiction, a finger to be disturbed.

Pushes come in slots, each of which a fresh finger is run over: what one push leaves in the bias is not counted against
the next. At rest a slot begins with a move of 1 s to another posture. What is there is not made again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from evidence.detection.hand import Arrays, Take, grouped, motion_columns, rig_of, simulated
from evidence.runner import write
from tendonfmu.files import read_table, write_table

RATE = 500.0  # Hz, the rig's
FORCES, RISES, HOLD, FALL = (0.25, 0.5, 1.0, 2.0), (0.1, 1.0, 10.0), 3.0, 0.1  # N, s
PAD = [0.0, 0.0, 1.0]  # direction on the fingertip, frame of the last link
CENTRE, SPREAD = np.array([0.0, 0.35, 0.45, 0.35]), np.array([0.15, 0.3, 0.3, 0.3])  # rad, postures at rest
MOVE, LEAD, TAIL = 1.0, 2.5, 0.5  # s: the move at a slot's begin; from there to the push; after it
STUCK_FORCE, STUCK_RISES, STUCK_HOLD, STUCK_COUNT = (0.02, 1.0), (0.05, 0.5), 0.5, 24
WARM = 2.0  # s, cut off the start of recordings that are disturbed
PUSH_TIME, AFTER = 5.0, 60.0  # s: a push at the start; the minute after a disturbance
DISTURBED, LONGEST = 10.0, 10.0  # s: begin of the other disturbances, the longest of them
RECOVERY_FORCE = 1.0  # N
TRUE = ("external_torque", "joint_torque", "friction_torque", "joint_position", "joint_velocity")
_KINDS = ("rest", "motion", "stuck", "still")
WRIST = {
    "amplitude": 0.5,
    "period": 10.0,
    "arms": [0.01] * 8,  # m
    "friction": {"static": 0.03, "coulomb": 0.025, "stribeck_velocity": 0.005},
}


# Kinds of takes: "rest", "motion" (ramps), "stuck", "still" (to be disturbed), "pushed" (the same with a push at the
# start), "wrist" (the same over a wrist that turns); "rest_twin", "motion_twin": without the pushes.


def pushes_of(take: Take) -> str:
    """The kind whose pushes and motion it has."""
    return take.kind.removesuffix("_twin")


def twin_of(take: Take) -> Take:
    return replace(take, kind=f"{take.kind}_twin")


def seed_of(take: Take) -> int:
    """Of motion and noise, which twins and the recordings of recovery share."""
    kind = _KINDS.index("still" if take.kind in ("pushed", "wrist") else pushes_of(take))
    return 7_000_000 + 10_000 * kind + 100 * round(take.pretension) + take.part


@dataclass(frozen=True)
class Slot:
    """One push."""

    begin: float  # s, of the slot, of the push's rise, of the slot's end
    push: float
    end: float
    force: float  # N
    rise: float  # s
    hold: float

    @property
    def top(self) -> float:
        """s, end of the hold."""
        return self.push + self.rise + self.hold


def slots(take: Take) -> list[Slot]:
    random = np.random.default_rng([seed_of(take), 1])
    if take.kind == "stuck":
        forces = np.exp(random.uniform(np.log(STUCK_FORCE[0]), np.log(STUCK_FORCE[1]), STUCK_COUNT))
        wanted = [(float(force), STUCK_RISES[k % 2], STUCK_HOLD) for k, force in enumerate(forces)]
    else:
        wanted = [(force, rise, HOLD) for force in FORCES for rise in RISES]
        random.shuffle(wanted)
    planned, begin = [], MOVE
    for force, rise, hold in wanted:
        push = begin + LEAD + round(float(random.uniform(0.0, 0.5)), 3)
        end = push + rise + hold + FALL + TAIL
        planned.append(Slot(begin, push, end, force, rise, hold))
        begin = end
    return planned


def write_rig(folder: Path, take: Take) -> Path:
    moves = {"pretension": take.pretension, "seed": seed_of(take), "duration": None}
    rig = rig_of(take.name, seed_of(take), moves, WARM + DISTURBED + LONGEST + AFTER + 1.0) | {"pushes": []}
    if pushes_of(take) in ("still", "pushed", "wrist"):
        if take.kind == "pushed":
            rig["pushes"] = [_push(WARM - 1.0, 0.1, 0.9 + PUSH_TIME, RECOVERY_FORCE)]
        if take.kind == "wrist":
            rig["physics"]["wrist"] = WRIST
    else:
        planned = slots(take)
        duration = rig["recording"]["duration"] = planned[-1].end + 1.0
        if take.kind == pushes_of(take):
            rig["pushes"] = [_push(slot.push, slot.rise, slot.hold, slot.force) for slot in planned]
        if pushes_of(take) == "motion":
            rig["motion"]["rest_share"] = 0.0
        else:
            file = folder / f"motion_{take.name}.parquet"
            write_table(file, _postures(take, planned, duration))
            rig["motion"] = {"kind": "file", "file": file.name, "pretension": take.pretension}
    file = folder / f"{take.name}.json"
    write(file, rig)
    return file


def _push(start: float, rise: float, hold: float, force: float) -> dict[str, Any]:
    return {"start": start, "rise": rise, "hold": hold, "fall": FALL, "force": force, "direction": PAD}


def _postures(take: Take, planned: list[Slot], duration: float) -> Arrays:
    """A motion file: a move to another posture at the begin of each slot."""
    random = np.random.default_rng([seed_of(take), 2])
    time, posture = [0.0], [CENTRE]
    for slot in planned:
        time += [slot.begin, slot.begin + MOVE]
        posture += [posture[-1], CENTRE + SPREAD * random.uniform(-1.0, 1.0, len(CENTRE))]
    time, posture = [*time, duration], [*posture, posture[-1]]
    still = np.zeros((len(time), 2))
    knots = [np.column_stack([time, angles, still]) for angles in np.array(posture).T]
    return motion_columns(np.array(time), knots)


def made(folder: Path, take: Take) -> Arrays:
    """The recording, contact_force [N], and the groups of `TRUE` as true_NAME [N, n]."""
    file = folder / f"{take.name}.parquet"
    if not file.exists():
        recorded, true = simulated(write_rig(folder, take), TRUE)
        kept = {name: values for name, values in recorded.items() if name.startswith(("time", "tendon_"))}
        force = true.pop("contact_force")
        write_table(file, {**kept, **{f"true_{name}": values for name, values in true.items()}, "contact_force": force})
    return grouped(read_table(file, lambda _path, _names: None))


def cut(arrays: Arrays, begin: float, end: float) -> Arrays:
    """The samples from begin to end, s."""
    first, last = np.searchsorted(arrays["time"], (begin - 1e-9, end + 1e-9))
    return {name: values[first:last] for name, values in arrays.items()}
