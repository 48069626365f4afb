"""What the figures of the simulated finger show, computed for `plots.py`: one joint led to and fro, its friction, and
what the friction model makes of the same motion.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tendonfmu.model import Finger
from tendonfmu.report.figure_data import Interval, intervals
from tendonfmu.simulate import Array, Plant, Rig, simulate

Signals = Mapping[str, Array]
WAYS = tuple[tuple[float, float], ...]

STEP = 1e-3  # s, between the rows of a run
DRAWN_APART = 1e-4  # rad, between points of a model's line
KINEMATICS_MEASURED = 3  # joint positions and velocities
PRETENSIONS = (10.0, 40.0)  # N
TO_AND_FRO: WAYS = ((0.0, 0.35), (1.0, 0.35), (3.0, 0.1), (9.0, 1.0), (15.0, 0.1), (21.0, 1.0))  # s, rad
# after a stroke small moves to and fro, each commanded larger than the one before, then one that breaks away
SMALL: WAYS = (
    (0.0, 0.35), (0.5, 0.35), (2.5, 0.7), (4.0, 0.69), (5.5, 0.704), (7.0, 0.684), (8.5, 0.708), (10.0, 0.672),
    (11.5, 0.712), (13.5, 1.2),
)  # fmt: skip


@dataclass(frozen=True)
class Loop:
    """One joint: angle [N] rad, friction torque of the rig and of the friction model [N] N·m. model_line: [K, 2] angle
    and model torque where the joint moves on, without standstill: each jump once.
    """

    label: str
    angle: Array
    rig: Array
    model: Array
    model_line: Array


@dataclass(frozen=True)
class Contact:
    """A bristle: angle [N] rad, w [N] (1: break-away)."""

    label: str
    angle: Array
    bristle: Array


@dataclass(frozen=True)
class LoopFigure:
    """joint: its name. loops: one per pretension."""

    joint: str
    loops: list[Loop]


@dataclass(frozen=True)
class PreslidingFigure:
    """joint, tendon: their names. reversals: torque after a reversal, angle back from there, one per pretension.
    contacts: bristles in the same motion at the first pretension. small: small moves to and fro, angle from where they
    begin. turns: index in `small` at the end of each small move; from the last one on the joint is led away.
    """

    joint: str
    tendon: str
    reversals: list[Loop]
    contacts: list[Contact]
    small: Loop
    turns: list[int]


@dataclass(frozen=True)
class TruthFigure:
    """A part of a recording with its truth. time: [N] s. forces: [N, m] N measured. angle: [N] rad. torques: label ->
    [N] N·m, of one joint. contacts: begin and end in s.
    """

    joint: str
    time: Array
    forces: Array
    flexors: list[bool]
    angle: Array
    torques: dict[str, Array]
    contacts: list[Interval]


def led(rig: Rig, joint: int, ways: WAYS, pretension: float) -> dict[str, Array]:
    """Signals of a rig whose motors lead one joint (0-based) from rest to rest, the others staying; without sensors.

    ways: (time s, angle rad). Also `bristle` [N, k], and `time` [N].
    """
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
    """[N] N·m: eq. (10) of one joint with the rig's own static numbers, v_min = 0, at the true velocity of that joint
    alone, without the bias."""
    description = dict(rig.finger.data) | {"velocity_threshold": {"tendon": 0.0, "joint": 0.0}}
    alone = np.zeros_like(signals["joint_velocity"])
    alone[:, joint] = signals["joint_velocity"][:, joint]
    found = Finger.from_description(description, KINEMATICS_MEASURED).run({**signals, "joint_velocity": alone})
    return np.asarray((found["friction_torque"] - found["bias_torque"])[:, joint])


def loop_figure(rig: Rig, joint: int) -> LoopFigure:
    """One joint slowly to and fro at each of `PRETENSIONS`; the way to the start of the loop is left out."""
    loops = []
    for pretension in PRETENSIONS:
        signals = led(rig, joint, TO_AND_FRO, pretension)
        shown = signals["time"] >= TO_AND_FRO[3][0]
        loop = _loop(rig, joint, signals, shown, f"{pretension:g} N")
        closed = np.concatenate([loop.model_line, loop.model_line[:1]])
        loops.append(replace(loop, model_line=closed))
    return LoopFigure(rig.finger.joint_names[joint], loops)


def presliding_figure(rig: Rig, joint: int, tendon: int) -> PreslidingFigure:
    """After a reversal, and small moves to and fro. tendon: 0-based, whose bristles are shown."""
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
    """Indices of points at least `apart` (rad) from the one before. Where a joint stands its velocity trembles about
    0 and the model's torque jumps from row to row, which a dashed line must not trace."""
    kept, last = [], angle[0]
    for k, value in enumerate(angle):
        if abs(value - last) >= apart:
            kept.append(k)
            last = value
    return np.array(kept, dtype=np.intp)


def _contacts(rig: Rig, joint: int, tendon: int) -> dict[str, int]:
    """Label with the presliding distance, also as an angle of the joint -> number of the bristle."""
    distances = rig.expanded["physics"]["friction"]["presliding"]
    arm = abs(rig.finger.data["tendons"][tendon]["moment_arms"][joint])
    labels = {}
    for kind, number in bristle_numbers(rig, joint, tendon).items():
        d = distances[kind]
        label = f"{kind}: {1e3 * d:g} mrad" if kind == "joint" else f"{kind}: {1e6 * d:g} µm = {1e3 * d / arm:.1f} mrad"
        labels[label] = number
    return labels


def truth_figure(rig: Rig, joint: int, begin: float, end: float) -> TruthFigure:
    """From begin to end (s) of a rig's own recording, one joint (0-based)."""
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
        contacts=intervals(time, truth["contact"][shown]),
    )


def bristle_numbers(rig: Rig, joint: int, tendon: int) -> dict[str, int]:
    """Number among the bristles of the edge before a joint, of the pulley before that, and of the joint's own friction.

    Order as in tendonfmu_plant_derivative: along each tendon edge and pulley of joint 1, of joint 2, ..., then joints.
    """
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
