"""What the figures of the simulated finger show, computed for `rig_plots.py`.

One joint moves to and fro: its friction, and what the friction model makes of the same motion.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Array
from tendonfmu.model import Instance
from tendonfmu.recordings import flagged_stretches
from tendonfmu.simulate.plant import Plant
from tendonfmu.simulate.rig import Rig
from tendonfmu.simulate.simulation import simulate

Signals = Mapping[str, Array]
Interval = tuple[float, float]
WAYS = tuple[tuple[float, float], ...]

STEP = 1e-3  # s, between the rows of a run
DRAWN_APART = 1e-4  # rad, between points of a model's line
KINEMATICS_MEASURED = 3  # joint positions and velocities
PRETENSIONS = (10.0, 40.0)  # N
TO_AND_FRO: WAYS = ((0.0, 0.35), (1.0, 0.35), (3.0, 0.1), (9.0, 1.0), (15.0, 0.1), (21.0, 1.0))  # s, rad
# after a stroke: small moves to and fro, each larger than the one before, then one that breaks away
SMALL: WAYS = (
    (0.0, 0.35), (0.5, 0.35), (2.5, 0.7), (4.0, 0.69), (5.5, 0.704), (7.0, 0.684), (8.5, 0.708), (10.0, 0.672),
    (11.5, 0.712), (13.5, 1.2),
)  # fmt: skip


@dataclass(frozen=True)
class Loop:
    """Friction of one joint over its angle."""

    label: str  # name in the legend
    angle: Array
    rig: Array  # friction torque of the rig and of the friction model
    model: Array
    model_line: Array


@dataclass(frozen=True)
class Contact:
    """A bristle over the joint angle."""

    label: str  # name in the legend
    angle: Array
    bristle: Array


@dataclass(frozen=True)
class LoopFigure:
    """Friction loops of one joint."""

    joint: str  # its name
    loops: list[Loop]  # one per pretension


@dataclass(frozen=True)
class PreslidingFigure:
    """Friction before sliding."""

    joint: str  # their names
    tendon: str
    reversals: list[Loop]  # torque after a reversal over the angle back from there, one per pretension
    contacts: list[Contact]  # bristles in the same motion at the first pretension
    small: Loop  # small moves to and fro; the angle counts from where they begin
    turns: list[int]  # indices in `small` at the end of each small move


@dataclass(frozen=True)
class TruthFigure:
    """Part of a recording with its truth."""

    joint: str  # its name
    time: Array
    forces: Array
    flexors: list[bool]
    angle: Array
    torques: dict[str, Array]
    contacts: list[Interval]


def led(rig: Rig, joint: int, ways: WAYS, pretension: float) -> dict[str, Array]:
    """Return the true signals of a rig whose motors lead one joint from rest to rest while the others stay."""
    # returns signals without sensors; also `bristle` [N, k] and `time` [N]
    expanded = copy.deepcopy(dict(rig.expanded))
    first = [knots["position"][0] for knots in expanded["motion"]["joints"]]
    joints = [_knots([(0.0, angle)]) for angle in first]
    joints[joint] = _knots(ways)
    expanded["motion"] = {"joints": joints, "pretension": {"time": [0.0], "value": [pretension]}}
    expanded["pushes"] = []
    plant = Plant(json.dumps(expanded))
    plant.configure(sensors=False)
    plant.initialise()
    time = np.arange(round(ways[-1][0] / STEP) + 1) * STEP
    names = ["tendon_force", "tendon_position", "joint_position", "joint_velocity", "friction_torque"]
    rows, bristles = [], []
    first_bristle = 2 * plant.joints + 2 * plant.tendons
    for moment in time:
        rows.append(plant.run(np.array([moment]), names))
        bristles.append(plant.continuous_state()[first_bristle:-5])
    signals = {name: np.concatenate([row[name] for row in rows]) for name in names}
    return signals | {"time": time, "bristle": np.array(bristles)}


def _knots(ways: Sequence[tuple[float, float]]) -> dict[str, list[float]]:
    time, position = ([float(way[k]) for way in ways] for k in (0, 1))
    return {"time": time, "position": position, "velocity": [0.0] * len(ways), "acceleration": [0.0] * len(ways)}


def model_friction(rig: Rig, joint: int, signals: Signals) -> NDArray[np.float64]:
    """Return the friction torque [N] N·m of one joint as the friction model has it, eq. (10)."""
    # It uses the rig's own static numbers, v_min = 0, and the true velocity of that joint alone, without the bias.
    description = dict(rig.finger.data) | {"velocity_threshold": {"tendon": 0.0, "joint": 0.0}}
    alone = np.zeros_like(signals["joint_velocity"])
    alone[:, joint] = signals["joint_velocity"][:, joint]
    found = Instance.from_description(description, KINEMATICS_MEASURED).run({**signals, "joint_velocity": alone})
    return np.asarray((found["friction_torque"] - found["bias_torque"])[:, joint])


def loop_figure(rig: Rig, joint: int) -> LoopFigure:
    """Move one joint slowly to and fro at each of `PRETENSIONS`; the way to the start of the loop is left out."""
    loops = []
    for pretension in PRETENSIONS:
        signals = led(rig, joint, TO_AND_FRO, pretension)
        shown = signals["time"] >= TO_AND_FRO[3][0]
        loop = _loop(rig, joint, signals, shown, f"{pretension:g} N")
        closed = np.concatenate([loop.model_line, loop.model_line[:1]])
        loops.append(replace(loop, model_line=closed))
    return LoopFigure(rig.finger.joint_names[joint], loops)


def presliding_figure(rig: Rig, joint: int, tendon: int) -> PreslidingFigure:
    """Show one joint after a reversal and in small moves, with the bristles of one tendon; both indices from 0."""
    reversals: list[Loop] = []
    contacts: list[Contact] = []
    for pretension in PRETENSIONS:
        signals = led(rig, joint, TO_AND_FRO[:5], pretension)
        angle = signals["joint_position"][:, joint]
        turn = int(np.argmax(angle))
        back = angle[turn] - angle[turn:]
        loop = _loop(rig, joint, signals, slice(turn, None), f"{pretension:g} N")
        line = loop.model_line * [-1.0, 1.0] + [angle[turn], 0.0]
        jump = [[0.0, loop.rig[0]], [0.0, line[0, 1]]]  # sliding before, sliding back
        reversals.append(replace(loop, angle=back, model_line=np.concatenate([jump, line])))
        if not contacts:
            contacts = [
                Contact(label, back, signals["bristle"][turn:, number])
                for label, number in _contacts(rig, joint, tendon).items()
            ]
    signals = led(rig, joint, SMALL, PRETENSIONS[0])
    shown = signals["time"] >= SMALL[2][0] - 0.4
    small = _loop(rig, joint, signals, shown, "")
    begin = float(np.interp(SMALL[2][0], signals["time"], signals["joint_position"][:, joint]))
    return PreslidingFigure(
        joint=rig.finger.joint_names[joint],
        tendon=rig.finger.tendon_names[tendon],
        reversals=reversals,
        contacts=contacts,
        small=replace(small, angle=small.angle - begin),
        turns=[int(np.searchsorted(signals["time"][shown], way[0])) for way in SMALL[3:-1]],
    )


def _loop(rig: Rig, joint: int, signals: Signals, shown: Array | slice, label: str) -> Loop:
    angle = signals["joint_position"][shown, joint]
    model = model_friction(rig, joint, signals)[shown]
    on = moving_on(angle, DRAWN_APART)
    return Loop(label, angle, signals["friction_torque"][shown, joint], model, np.column_stack([angle[on], model[on]]))


def moving_on(angle: Array, apart: float) -> NDArray[np.intp]:
    """Return indices of points at least `apart` (rad) from the one before."""
    kept, last = [], angle[0]
    for k, value in enumerate(angle):
        if abs(value - last) >= apart:
            kept.append(k)
            last = value
    return np.array(kept, dtype=np.intp)


def _contacts(rig: Rig, joint: int, tendon: int) -> dict[str, int]:
    """Map a label to the number of a bristle. The label has the presliding distance, also as an angle of the joint."""
    distances = rig.expanded["physics"]["friction"]["presliding"]
    arm = abs(rig.finger.data["tendons"][tendon]["moment_arms"][joint])
    labels = {}
    for kind, number in bristle_numbers(rig, joint, tendon).items():
        d = distances[kind]
        label = f"{kind}: {1e3 * d:g} mrad" if kind == "joint" else f"{kind}: {1e6 * d:g} µm = {1e3 * d / arm:.1f} mrad"
        labels[label] = number
    return labels


def truth_figure(rig: Rig, joint: int, begin: float, end: float) -> TruthFigure:
    """Show one joint (from 0) of a rig's own recording from begin to end (s)."""
    simulation = simulate(rig, truth=True)
    recording, truth = simulation.recording, simulation.truth or {}
    shown = (recording["time"] >= begin) & (recording["time"] <= end)
    time = recording["time"][shown]
    labels = {"joint_torque": "joint torque", "friction_torque": "friction", "external_torque": "external torque"}
    arms = rig.finger.moment_arms
    return TruthFigure(
        joint=rig.finger.joint_names[joint],
        time=time,
        forces=np.column_stack([recording[f"tendon_force[{i + 1}]"][shown] for i in range(rig.tendons)]),
        flexors=[arms[i][joint] > 0.0 for i in range(rig.tendons)],
        angle=truth[f"joint_position[{joint + 1}]"][shown],
        torques={label: truth[f"{name}[{joint + 1}]"][shown] for name, label in labels.items()},
        contacts=flagged_stretches(time, truth["contact"][shown]),
    )


def bristle_numbers(rig: Rig, joint: int, tendon: int) -> dict[str, int]:
    """Return the indices of three bristles: the edge before a joint, the pulley there, and the joint's own friction."""
    found: dict[str, int] = {}
    wrist = 1 if rig.expanded["physics"].get("wrist") else 0  # comes first along each tendon
    number = 0
    for i, one in enumerate(rig.finger.data["tendons"]):
        number += wrist
        for j in range(rig.joints):
            for kind in ("edge", "pulley"):
                laws = one.get(f"{kind}_friction") or []
                if j >= len(laws) or laws[j] is None or (kind == "pulley" and j + 1 == rig.joints):
                    continue
                if i == tendon and (kind, j) in (("edge", joint), ("pulley", joint - 1)):
                    found[kind] = number
                number += 1
    for j, one in enumerate(rig.finger.data["joints"]):
        for kind in ("friction", "load_friction"):
            if one.get(kind) is None:
                continue
            if j == joint and kind == "friction":
                found["joint"] = number
            number += 1
    return found
