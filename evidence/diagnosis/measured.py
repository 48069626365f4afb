"""Known effects hidden in measured recordings: EMPS and the da Vinci jaw.

The starting point of each machine is its own diagnosed model (measured_*.json): on the unaltered recording there is
nothing left to name, that is the null. What is to be hidden is first taken off recording and model where they
have it already. All formulas are physics written here; nothing is taken from the candidates or the core's terms.

Strength: variance of the torque that the effect adds and that refitting the model's own numbers cannot absorb, over
the variance of what the model leaves of the unaltered recording, both in blocks of 10 ms.
measured_table.py runs them.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.model.native import run_recording

Array = NDArray[np.float64]
Columns = dict[str, Array]
Description = dict[str, Any]
BLOCK = 0.01  # s
STEP = 1e-4  # relative, of numeric derivatives
ROUNDS, CLOSE = 8, 0.03  # of scaling to a strength; how near, relative

FORCE, POSITION, ANGLE = "tendon_force[1]", "tendon_position[1]", "joint_position[1]"
SPEED, LOAD = "joint_velocity[1]", "external_torque[1]"


@dataclass(frozen=True)
class Machine:
    """One joint, one tendon of a constant moment arm. recordings: by name. kinematics: source 1 or 3."""

    name: str
    model: Description
    recordings: dict[str, Columns]
    kinematics: int

    @property
    def arm(self) -> float:
        return float(self.model["tendons"][0]["moment_arms"][0])

    def chosen(self, names: Sequence[str]) -> Machine:
        return replace(self, recordings={name: self.recordings[name] for name in names})


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


# --- effects: what a recording becomes, and what the model loses to make room for it ----------------------------------


def add_torque(machine: Machine, columns: Columns, torque: Array) -> Columns:
    """The drive has to hold this torque too: its force grows by it over the moment arm."""
    return columns | {FORCE: columns[FORCE] + torque / machine.arm}


def coulomb(machine: Machine, columns: Columns, magnitude: float) -> Columns:
    """Coulomb friction in the joint, N·m; where the model's joint has presliding, it turns round over that distance."""
    side = side_of(machine, columns)
    for row in rows_of(machine.model, "presliding"):
        angle = angle_of(machine, columns)
        side = built_up(side, np.diff(angle, prepend=angle[0]), row["displacement"])
    return add_torque(machine, columns, magnitude * side)


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


@dataclass(frozen=True)
class Effect:
    """names: of effects that are the truth (one joint: some are one and the same). usual: a first magnitude, as a
    share of the largest torque where it is one. both: whether either sign can be. most: the largest that makes
    sense. free: takes it off a machine that has it already."""

    names: tuple[str, ...]
    put: Callable[[Machine, Columns, float], Columns]
    usual: float
    both: bool = False
    most: float = np.inf
    free: Callable[[Machine], Machine] | None = None


def without_rows(model: Description, *effects: str) -> Description:
    model = copy.deepcopy(model)
    model["extensions"] = [row for row in model.get("extensions") or [] if row["effect"] not in effects]
    return model


def rows_of(model: Description, effect: str) -> list[Description]:
    return [row for row in model.get("extensions") or [] if row["effect"] == effect]


def law_torque(law: Description, speed: Array, side: Array) -> Array:
    """A law's F(v), the side given (docs/reference/semantics.md#friction-laws)."""

    def one(half: Description) -> Array:
        drop, slow = half["static"] - half["coulomb"], half["stribeck_velocity"]
        return half["coulomb"] + drop * np.exp(-np.abs(speed) / slow) + half.get("viscous", 0.0) * np.abs(speed)

    forward, back = law.get("positive", law), law.get("negative", law)
    return np.where(side > 0, one(forward), -one(back))


def built_up(side: Array, travel: Array, displacement: float) -> Array:
    """Dahl's share of the friction that is there, from 0 at the start: it nears the side over a displacement."""
    share = np.zeros(len(side))
    for k in range(1, len(side)):
        share[k] = side[k] - (side[k] - share[k - 1]) * np.exp(-abs(travel[k]) / displacement)
    return share


def free_of_friction(machine: Machine) -> Machine:
    """Recordings less the joint's own friction by the model, which then has none."""
    law = machine.model["joints"][0]["friction"]
    near = rows_of(machine.model, "stribeck")
    sliding = rows_of(machine.model, "presliding")
    constant = sum(row["coulomb"] for row in rows_of(machine.model, "preload_friction")) * machine.arm

    def taken(columns: Columns) -> Columns:
        speed = speed_of(machine, columns)
        side = np.where(speed < 0, -1.0, 1.0)
        torque = law_torque(law, speed, side)
        for row in near:
            torque = torque * (1.0 + row["amplitude"] * np.exp(-np.abs(speed) / row["stribeck_velocity"]))
        for row in sliding:
            step = np.diff(angle_of(machine, columns), prepend=angle_of(machine, columns)[0])
            torque = np.abs(torque) * built_up(side, step, row["displacement"])
        return add_torque(machine, columns, -torque - constant * side)

    # presliding stays where the joint has friction that grows with the load, which it acts on too
    kept = machine.model["joints"][0].get("load_friction") is not None
    model = without_rows(machine.model, "stribeck", "preload_friction", *([] if kept else ["presliding"]))
    model["joints"][0]["friction"] = None
    return replace(machine, model=model, recordings={k: taken(v) for k, v in machine.recordings.items()})


def free_of_delay(machine: Machine) -> Machine:
    """Forces moved to the time of the positions by the model's own delay, which it then has not."""
    rows = rows_of(machine.model, "time_delay")
    if not rows:
        return machine
    late = rows[0]["delay"]  # negative: the force of t answers to the motion of t − late

    def moved(columns: Columns) -> Columns:
        return columns | {FORCE: np.interp(columns["time"] + late, columns["time"], columns[FORCE])}

    model = without_rows(machine.model, "time_delay")
    return replace(machine, model=model, recordings={k: moved(v) for k, v in machine.recordings.items()})


def free_of_spring(machine: Machine) -> Machine:
    """Recordings less all torques that follow the angle alone, as the model has them: cover and weight."""
    cover = machine.model["joints"][0].get("cover") or {"stiffness": 0.0, "rest_angle": 0.0}
    weights, cubes = rows_of(machine.model, "gravity"), rows_of(machine.model, "cover_hardening")

    def taken(columns: Columns) -> Columns:
        angle = angle_of(machine, columns)
        bent = angle - cover.get("rest_angle", 0.0)
        torque = cover["stiffness"] * bent
        for row in weights:
            torque = torque + row.get("sine", 0.0) * np.sin(angle) + row.get("cosine", 0.0) * np.cos(angle)
        for row in cubes:
            torque = torque + row["stiffness"] * bent**3
        return add_torque(machine, columns, -torque)

    model = without_rows(machine.model, "gravity", "cover_hardening")
    model["joints"][0].pop("cover", None)
    return replace(machine, model=model, recordings={k: taken(v) for k, v in machine.recordings.items()})


def free_of_growth(machine: Machine) -> Machine:
    """Recordings less the friction that grows with the force, as the model's rows have it; a law of the joint that does
    so stays, and takes its share of what is hidden."""
    rows = rows_of(machine.model, "load_friction")
    if not rows:
        return machine
    lost = sum(row["coulomb"] for row in rows)

    def taken(columns: Columns) -> Columns:
        return add_torque(machine, columns, -lost * np.abs(columns[FORCE]) * side_of(machine, columns))

    model = without_rows(machine.model, "load_friction")
    return replace(machine, model=model, recordings={k: taken(v) for k, v in machine.recordings.items()})


GROWING = ("load_friction", "edge_friction", "joint_load_friction")  # at one joint, along one tendon: the same


def free_of_coulomb(machine: Machine) -> Machine:
    """Friction is taken off at the time at which it acts, so the forces are moved there first."""
    return free_of_friction(free_of_delay(machine))


EFFECTS = {
    "coulomb": Effect(
        ("joint_friction", "preload_friction"),
        coulomb,
        0.05,
        free=free_of_coulomb,
    ),
    "gain": Effect(("force_gain", "moment_arm"), gain, 0.02, both=True, most=0.5),
    "delay": Effect(("time_delay",), delay, 0.002, most=0.05, free=free_of_delay),
    "spring": Effect(("cover_stiffness",), spring, 0.05, free=free_of_spring),
    "growing": Effect(GROWING, growing, 0.02, free=free_of_growth),
}


def usual(effect: Effect, machine: Machine) -> float:
    """A first magnitude, in the unit of the effect."""
    if effect.put in (gain, delay):
        return effect.usual
    largest = max(float(np.percentile(np.abs(c[FORCE]), 95)) for c in machine.recordings.values()) * machine.arm
    if effect.put is growing:
        return effect.usual * machine.arm
    if effect.put is spring:
        return effect.usual * largest / max(float(np.ptp(angle_of(machine, c))) for c in machine.recordings.values())
    return effect.usual * largest


# --- strength ---------------------------------------------------------------------------------------------------------


def residual(machine: Machine, columns: Columns) -> Array:
    """[B] N·m: measured torque less known load less the model's, in blocks."""
    arrays = {key.removesuffix("[1]"): value if key == "time" else value[:, None] for key, value in columns.items()}
    found = run_recording(machine.model, arrays, machine.kinematics)
    left = (found["compensated_torque"][:, 0] - columns[LOAD]).astype(float)
    size = max(1, round(BLOCK / float(np.median(np.diff(columns["time"])))))
    return np.asarray(left[: len(left) // size * size].reshape(-1, size).mean(axis=1))


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
    lengths = [len(residual(machine, each)) for each in machine.recordings.values()]
    columns += list(np.repeat(np.eye(len(lengths)), lengths, axis=1))
    matrix = np.column_stack(columns)
    matrix = matrix[:, np.linalg.norm(matrix, axis=0) > 0.0]
    left, size, _ = np.linalg.svd(matrix / np.linalg.norm(matrix, axis=0), full_matrices=False)
    return np.asarray(left[:, size > 1e-9 * size[0]])


def put(machine: Machine, effect: Effect, magnitude: float) -> Machine:
    """The recordings with the effect; the model as it is."""
    altered = {name: effect.put(machine, columns, magnitude) for name, columns in machine.recordings.items()}
    return replace(machine, recordings=altered)


@dataclass(frozen=True)
class Hidden:
    """machine: with the effect in its recordings. strength, share: what survives refitting, over the remainder of the
    model and over the effect's own variance."""

    machine: Machine
    magnitude: float
    strength: float
    share: float


def hide(machine: Machine, effect: Effect, strength: float, sign: float = 1.0) -> Hidden:
    """The effect at a strength. machine: freed of it. Raises ValueError where no magnitude has the strength."""
    before, nuisance = residuals(machine), bent(machine)
    noise = before - nuisance @ (nuisance.T @ before)
    magnitude = usual(effect, machine)
    for _ in range(ROUNDS):
        if not magnitude <= effect.most:
            break
        made = put(machine, effect, sign * magnitude)
        added = residuals(made) - before
        left = added - nuisance @ (nuisance.T @ added)
        found = float(left @ left) / float(noise @ noise)
        if abs(found / strength - 1.0) < CLOSE:
            share = float(left @ left) / max(float((added - added.mean()) @ (added - added.mean())), 1e-300)
            return Hidden(made, sign * magnitude, found, share)
        magnitude *= float(np.sqrt(strength / found))
    raise ValueError(f"strength {strength}: no sound magnitude of this effect has it; tried up to {magnitude:g}")
