"""Measured machines (EMPS, the da Vinci jaw, a joint of PSM), and known effects that can be put on their recordings.

All formulas are physics written here; nothing is taken from the candidates or the core's terms. A change needs no room:
friction that is there already grows or falls. The model of a machine is its diagnosed one (measured_*.json: diagnosed
again until nothing was found), and says how presliding and friction of the real machine are.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.fingers.matched_strength import averaged, orthonormal
from tendonfmu.model.native import run_recording

Array = NDArray[np.float64]
Columns = dict[str, Array]
Description = dict[str, Any]
BLOCK = 0.01  # s
STEP = 1e-4  # relative, of numeric derivatives
CLOSE = 0.03  # how near to a strength, relative
ROUNDS = 20  # of the search for a strength
LEANING = 0.8  # rad
SLOW_SHARE = 0.15  # of the usual speed: what is near standstill

FORCE, POSITION, ANGLE = "tendon_force[1]", "tendon_position[1]", "joint_position[1]"
SPEED, LOAD = "joint_velocity[1]", "external_torque[1]"


@dataclass(frozen=True)
class Machine:
    """One joint, one tendon of a constant moment arm."""

    name: str
    model: Description
    recordings: dict[str, Columns]  # by name
    kinematics: int  # source 1 or 3

    @property
    def arm(self) -> float:
        return float(self.model["tendons"][0]["moment_arms"][0])


def diagnosed_model(name: str) -> Description:
    """The model of emps, davinci or psm."""
    file = Path(__file__).resolve().parent / f"measured_{name}.json"
    model: Description = json.loads(file.read_text(encoding="utf-8"))
    return model


# --- motion, as the machine's sensors show it -------------------------------------------------------------------------


def angle_of(machine: Machine, columns: Columns) -> Array:
    return columns[ANGLE] if machine.kinematics == 3 else columns[POSITION] / machine.arm


def speed_of(machine: Machine, columns: Columns) -> Array:
    """rad/s; of an encoder smoothed over ±25 ms, which steps of 1 kHz need."""
    if machine.kinematics == 3:
        return columns[SPEED]
    raw = np.gradient(angle_of(machine, columns), columns["time"])
    return np.convolve(np.pad(raw, 25, mode="edge"), np.ones(51) / 51, mode="valid")


def side_of(machine: Machine, columns: Columns) -> Array:
    """Sign of the last motion faster than a hundredth of the usual one; that of the first before it."""
    speed = speed_of(machine, columns)
    moving = np.abs(speed) > 0.01 * np.percentile(np.abs(speed), 95)
    last = np.maximum.accumulate(np.where(moving, np.arange(len(speed)), -1))
    last[last < 0] = np.flatnonzero(moving)[0]
    return np.sign(speed[last])


def usual_speed(machine: Machine, columns: Columns) -> float:
    return float(np.percentile(np.abs(speed_of(machine, columns)), 95))


def travelled(machine: Machine, columns: Columns) -> Array:
    """Angle as a share of the stroke, −½ to ½."""
    angle = angle_of(machine, columns)
    return np.asarray((angle - angle.min()) / np.ptp(angle) - 0.5)


def rows_of(model: Description, effect: str) -> list[Description]:
    return [row for row in model.get("extensions") or [] if row["effect"] == effect]


def built_up(side: Array, travel: Array, displacement: float) -> Array:
    """Dahl's share of the friction that is there, from 0 at the start: it nears the side over a displacement."""
    share = np.zeros(len(side))
    for k in range(1, len(side)):
        share[k] = side[k] - (side[k] - share[k - 1]) * np.exp(-abs(travel[k]) / displacement)
    return share


def friction_side(machine: Machine, columns: Columns, displacement: float | None = None) -> Array:
    """Sign of the friction, as it builds up over the presliding distance of the diagnosed model."""
    side, angle = side_of(machine, columns), angle_of(machine, columns)
    for row in rows_of(machine.model, "presliding"):
        return built_up(side, np.diff(angle, prepend=angle[0]), displacement or row["displacement"])
    return side


# --- effects: what a recording becomes, by machine, columns and magnitude ---------------------------------------------


def add_torque(machine: Machine, columns: Columns, torque: Array) -> Columns:
    """The drive has to hold this torque too: its force grows by it over the moment arm."""
    return columns | {FORCE: columns[FORCE] + torque / machine.arm}


def coulomb(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """Coulomb friction in the joint, N·m; where the model's joint has presliding, it turns round over that distance."""
    return add_torque(machine, columns, magnitude * friction_side(machine, columns))


def gain(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """The sensor shows 1/(1 + magnitude) of the force."""
    return columns | {FORCE: columns[FORCE] / (1.0 + magnitude)}


def delay(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """Motion and known load are recorded so many seconds late, told from the forces, which then seem early."""
    when = columns["time"] + magnitude
    return columns | {FORCE: np.interp(when, columns["time"], columns[FORCE])}


def spring(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """A spring across the joint, N·m/rad."""
    angle = angle_of(machine, columns)
    return add_torque(machine, columns, magnitude * (angle - angle.mean()))


def growing(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """Coulomb friction of magnitude (m) times the tendon's force, which it is itself a part of."""
    lost = magnitude * side_of(machine, columns) / machine.arm
    force = columns[FORCE]
    return columns | {FORCE: force / (1.0 - lost * np.sign(force))}


def viscous(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """N·m·s/rad"""
    return add_torque(machine, columns, magnitude * speed_of(machine, columns))


def viscous_one_way(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """N·m·s/rad, while the angle grows"""
    return add_torque(machine, columns, magnitude * np.maximum(speed_of(machine, columns), 0.0))


def near_standstill(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """Friction that falls with speed, N·m at standstill (Stribeck)."""
    slow = SLOW_SHARE * usual_speed(machine, columns)
    fading = np.exp(-np.abs(speed_of(machine, columns)) / slow)
    return add_torque(machine, columns, magnitude * fading * friction_side(machine, columns))


def along_the_stroke(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """Friction under load that grows along the stroke, m at its end: an edge that the cable wraps more and more."""
    share = travelled(machine, columns) + 0.5
    lost = magnitude * share * np.abs(columns[FORCE]) * friction_side(machine, columns)
    return add_torque(machine, columns, lost)


def with_time(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """Coulomb friction that comes in the course of the recording, N·m in the end."""
    time = columns["time"] - columns["time"][0]
    grown = 1.0 - np.exp(-time / (time[-1] / 3.0))
    return add_torque(machine, columns, magnitude * grown * friction_side(machine, columns))


def heavier(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """kg·m² more"""
    return add_torque(machine, columns, magnitude * np.gradient(speed_of(machine, columns), columns["time"]))


def longer_presliding(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """The distance over which the machine's friction builds up becomes longer, rad."""
    before = rows_of(machine.model, "presliding")[0]["displacement"]
    law = machine.model["joints"][0]["friction"]
    law = law.get("positive", law)
    load = sum(row["coulomb"] for row in rows_of(machine.model, "load_friction"))
    load += (machine.model["joints"][0].get("load_friction") or {"coulomb": 0.0})["coulomb"]
    friction = law["coulomb"] + load * np.abs(columns[FORCE])
    turned = friction_side(machine, columns, before + magnitude) - friction_side(machine, columns)
    return add_torque(machine, columns, friction * turned)


def weight(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """A weight that hangs LEANING from its lowest point in the middle of the stroke, N·m, less its torque there."""
    angle = angle_of(machine, columns)
    middle = 0.5 * (angle.min() + angle.max())
    return add_torque(machine, columns, magnitude * (np.sin(angle - middle + LEANING) - np.sin(LEANING)))


def longer_arm(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """The arm grows along the stroke by this share of it from end to end: the same torque takes less force."""
    return dict(columns) | {FORCE: columns[FORCE] / (1.0 + magnitude * travelled(machine, columns))}


@dataclass(frozen=True)
class Effect:
    """A known effect, and which answers to it count."""

    put: Callable[[Machine, Columns, float], Columns]
    names: tuple[str, ...]  # names that are the truth (one joint: some are one and the same)
    unit: str
    signs: Mapping[str, int] = field(default_factory=dict)  # by name, of a positive magnitude
    first: float = 0.05  # where the search for a strength starts, as a share of `scale`
    scale: str = "torque"
    also: tuple[str, ...] = ()  # names that are not false either
    sign: int = 1
    most: float = np.inf  # the largest magnitude that makes sense
    machines: tuple[str, ...] = ("emps", "davinci")


FRICTION = ("joint_friction", "preload_friction")
GROWING = ("load_friction", "edge_friction", "joint_load_friction")  # at one joint, along one tendon: the same
UP = dict.fromkeys((*FRICTION, "viscous_friction", "stribeck", "friction_drift", *GROWING), 1)
GAIN = Effect(gain, ("force_gain", "moment_arm"), "1", {"force_gain": 1, "moment_arm": 1}, 0.02, "one", most=0.5)

EFFECTS = {
    "coulomb": Effect(coulomb, FRICTION, "N.m", UP),
    "less_coulomb": Effect(coulomb, FRICTION, "N.m", UP, sign=-1),
    "gain": GAIN,
    "less_gain": replace(GAIN, sign=-1),
    "delay": Effect(delay, ("time_delay",), "s", {"time_delay": -1}, 0.002, "one", most=0.05),
    "spring": Effect(spring, ("cover_stiffness",), "N.m/rad", {"cover_stiffness": 1}, scale="stiffness"),
    "growing": Effect(growing, GROWING, "m", UP, 0.02, "arm"),
    "viscous": Effect(viscous, ("viscous_friction",), "N.m.s/rad", UP, scale="damping"),
    "viscous_one_way": Effect(
        viscous_one_way, ("asymmetric_friction", "viscous_friction"), "N.m.s/rad", UP, scale="damping"
    ),
    "near_standstill": Effect(near_standstill, ("stribeck",), "N.m", UP),
    "along_the_stroke": Effect(along_the_stroke, GROWING, "m", UP, 0.02, "arm"),
    # there is more friction now, and it grows: either is right
    "with_time": Effect(with_time, ("friction_drift", *FRICTION), "N.m", UP),
    "longer_presliding": Effect(longer_presliding, ("presliding",), "rad", {"presliding": 1}, 0.01, "stroke"),
    "heavier": Effect(heavier, ("inertia",), "kg.m2", {"inertia": 1}, 1.0, "one", machines=("emps",)),
    "weight": Effect(weight, ("gravity",), "N.m", {}, also=("cover_stiffness",), machines=("davinci",)),
    "longer_arm": Effect(
        longer_arm,
        ("moment_arm_variation", "pulley_eccentricity"),
        "1",
        {"moment_arm_variation": 1},
        0.05,
        "one",
        most=1.0,
        machines=("davinci",),
    ),
}


def first_magnitude(effect: Effect, machine: Machine) -> float:
    """In the unit of the effect, above 0."""
    recordings = list(machine.recordings.values())
    torque = largest_force(machine) * machine.arm
    stroke = max(float(np.ptp(angle_of(machine, columns))) for columns in recordings)
    speed = max(usual_speed(machine, columns) for columns in recordings)
    scales = {"one": 1.0, "torque": torque, "arm": machine.arm, "stroke": stroke}
    scales |= {"stiffness": torque / stroke, "damping": torque / speed}
    return effect.first * scales[effect.scale]


def largest_force(machine: Machine) -> float:
    return max(float(np.percentile(np.abs(columns[FORCE]), 95)) for columns in machine.recordings.values())


def put(machine: Machine, effect: Effect, magnitude: float) -> Machine:
    """The recordings with the effect; the model as it is."""
    altered = {name: effect.put(machine, columns, magnitude) for name, columns in machine.recordings.items()}
    return replace(machine, recordings=altered)


# --- strength ---------------------------------------------------------------------------------------------------------


def residual(machine: Machine, columns: Columns) -> Array:
    """[B] N·m: measured torque less known load less the model's, in blocks."""
    arrays = {key.removesuffix("[1]"): value if key == "time" else value[:, None] for key, value in columns.items()}
    outputs = run_recording(machine.model, arrays, machine.kinematics)
    left = (outputs["compensated_torque"][:, 0] - columns.get(LOAD, 0.0)).astype(float)
    return averaged(left, max(1, round(BLOCK / float(np.median(np.diff(columns["time"]))))))


def residuals(machine: Machine) -> Array:
    return np.concatenate([residual(machine, columns) for columns in machine.recordings.values()])


def numbers(model: Description) -> Iterator[tuple[Description, str]]:
    """(object, key) of every number that a fit estimates, in place."""
    joint = model["joints"][0]
    laws = [joint.get("friction")] + [law for row in model["tendons"] for law in row.get("edge_friction") or []]
    for law in filter(None, laws):
        for half in (law["positive"], law["negative"]) if "positive" in law else (law,):
            yield half, "coulomb"
            if half.get("viscous"):
                yield half, "viscous"
    if joint.get("cover"):
        yield joint["cover"], "stiffness"
    for row in model.get("extensions") or []:
        yield from ((row, key) for key in row if key not in ("effect", "joint", "tendon"))


def bent(machine: Machine) -> Array:
    """[B, p] orthonormal: all that refitting the model's numbers can do to the residuals; a constant of each
    recording is the bias."""
    start = residuals(machine)
    columns = []
    for k in range(len(list(numbers(machine.model)))):
        moved = copy.deepcopy(machine.model)
        at, key = list(numbers(moved))[k]
        change = STEP * at[key]
        at[key] += change
        if key == "coulomb" and "static" in at:
            at["static"] += change
        columns.append((residuals(replace(machine, model=moved)) - start) / STEP)
    lengths = [len(residual(machine, recording)) for recording in machine.recordings.values()]
    columns += list(np.repeat(np.eye(len(lengths)), lengths, axis=1))
    return orthonormal(np.column_stack(columns))


def less(values: Array, columns: Array) -> Array:
    return np.asarray(values - columns @ (columns.T @ values))


def magnitude_of(strength: float, strength_at: Callable[[float], float], first: float, most: float) -> float:
    """The magnitude that has the strength: by proportion until it lies between two, then between them.

    Raises ValueError where none up to `most` has it.
    """
    low, high, magnitude = 0.0, np.inf, min(first, most)
    for _ in range(ROUNDS):
        reached = strength_at(magnitude)
        if abs(reached / strength - 1.0) < CLOSE:
            return magnitude
        low, high = (magnitude, high) if reached < strength else (low, magnitude)
        if low >= most:
            break
        wanted = min(magnitude * float(np.sqrt(strength / reached)), most)
        between = low < wanted < high and not (low > 0.0 and high < np.inf)
        magnitude = wanted if between or high == np.inf else float(np.sqrt(max(low, 0.01 * high) * high))
    raise ValueError(f"strength {strength:g}: no sound magnitude of this change has it; tried up to {magnitude:g}")
