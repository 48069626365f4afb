"""Known changes put on measured recordings, and how strong they are. Physics written here, on that of measured.py.

A change needs no room: friction that is there already grows or falls. The machine's own physics (presliding, friction)
is that of its diagnosed model, whatever model the case has.

Strength: variance of the torque that the change adds over the variance of what the case's model leaves of the unaltered
`now`, both in blocks of 10 ms and without a constant of each recording (the machines' biases are constants). As in
measured.py the part of the torque that refitting the model's own numbers to `now` absorbs does not count. Where that
is more than half of it the change is one of numbers that the model has, `then` pins them, and the whole torque counts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from measured import (
    CLOSE,
    FORCE,
    GROWING,
    Array,
    Columns,
    Machine,
    add_torque,
    angle_of,
    bent,
    built_up,
    coulomb,
    delay,
    gain,
    growing,
    residual,
    residuals,
    rows_of,
    side_of,
    speed_of,
    spring,
)

Put = Callable[[Machine, Columns, float], Columns]
ROUNDS = 20  # of the search for a strength
ABSORBED = 0.5  # share of the variance that refitting to `now` leaves, below which numbers of the model have changed
LOUDEST = 0.5  # of the machine's largest torque: a change that adds more is no longer the same machine
LEANING = 0.8  # rad
SLOW_SHARE = 0.15  # of the usual speed: what is near standstill


def usual_speed(machine: Machine, columns: Columns) -> float:
    return float(np.percentile(np.abs(speed_of(machine, columns)), 95))


def travelled(machine: Machine, columns: Columns) -> Array:
    """Angle as a share of the stroke, −½ to ½."""
    angle = angle_of(machine, columns)
    return np.asarray((angle - angle.min()) / np.ptp(angle) - 0.5)


def friction_side(machine: Machine, columns: Columns, displacement: float | None = None) -> Array:
    """Sign of the friction, as it builds up over the presliding distance of the diagnosed model."""
    side, angle = side_of(machine, columns), angle_of(machine, columns)
    for row in rows_of(machine.model, "presliding"):
        return built_up(side, np.diff(angle, prepend=angle[0]), displacement or row["displacement"])
    return side


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
class Change:
    """names: of effects that are the truth. also: not false either, and not the truth. signs: by name, of a
    positive magnitude. first: where the search for the strength starts, as a share of `scale`."""

    put: Put
    names: tuple[str, ...]
    unit: str
    signs: Mapping[str, int]
    first: float = 0.05
    scale: str = "torque"
    also: tuple[str, ...] = ()
    sign: int = 1
    most: float = np.inf
    machines: tuple[str, ...] = ("emps", "davinci")


FRICTION = ("joint_friction", "preload_friction")
UP = {
    "joint_friction": 1,
    "preload_friction": 1,
    "viscous_friction": 1,
    "stribeck": 1,
    "friction_drift": 1,
} | dict.fromkeys(GROWING, 1)

CHANGES = {
    "coulomb": Change(coulomb, FRICTION, "N.m", UP),
    "less_coulomb": Change(coulomb, FRICTION, "N.m", UP, sign=-1),
    "gain": Change(gain, ("force_gain", "moment_arm"), "1", {"force_gain": 1, "moment_arm": 1}, 0.02, "one", most=0.5),
    "less_gain": Change(
        gain, ("force_gain", "moment_arm"), "1", {"force_gain": 1, "moment_arm": 1}, 0.02, "one", sign=-1, most=0.5
    ),
    "delay": Change(delay, ("time_delay",), "s", {"time_delay": -1}, 0.002, "one", most=0.05),
    "spring": Change(spring, ("cover_stiffness",), "N.m/rad", {"cover_stiffness": 1}, scale="stiffness"),
    "growing": Change(growing, GROWING, "m", UP, 0.02, "arm"),
    "viscous": Change(viscous, ("viscous_friction",), "N.m.s/rad", UP, scale="damping"),
    "viscous_one_way": Change(
        viscous_one_way, ("asymmetric_friction", "viscous_friction"), "N.m.s/rad", UP, scale="damping"
    ),
    "near_standstill": Change(near_standstill, ("stribeck",), "N.m", UP),
    "along_the_stroke": Change(along_the_stroke, GROWING, "m", UP, 0.02, "arm"),
    # there is more friction now, and it grows: either is right
    "with_time": Change(with_time, ("friction_drift", *FRICTION), "N.m", UP),
    "longer_presliding": Change(longer_presliding, ("presliding",), "rad", {"presliding": 1}, 0.01, "stroke"),
    "heavier": Change(heavier, ("inertia",), "kg.m2", {"inertia": 1}, 1.0, "one", machines=("emps",)),
    "weight": Change(weight, ("gravity",), "N.m", {}, also=("cover_stiffness",), machines=("davinci",)),
    "longer_arm": Change(
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


def first_magnitude(change: Change, machine: Machine) -> float:
    """In the unit of the change, above 0."""
    recordings = list(machine.recordings.values())
    torque = max(float(np.percentile(np.abs(c[FORCE]), 95)) for c in recordings) * machine.arm
    stroke = max(float(np.ptp(angle_of(machine, c))) for c in recordings)
    speed = max(usual_speed(machine, c) for c in recordings)
    scales = {"one": 1.0, "torque": torque, "arm": machine.arm, "stroke": stroke}
    scales |= {"stiffness": torque / stroke, "damping": torque / speed}
    return change.first * scales[change.scale]


@dataclass(frozen=True)
class Hidden:
    """now: recordings with the change. by: which of the three variances was set to the strength (change_case.Truth)."""

    now: Mapping[str, Columns]
    magnitude: float
    by: str
    survives_now: float
    survives_both: float
    whole: float


def spans(lengths: Sequence[int]) -> Array:
    """[B, R] orthonormal: a constant of each recording."""
    total = np.repeat(np.eye(len(lengths)), lengths, axis=1).T
    return np.asarray(total / np.sqrt(np.array(lengths, dtype=float)))


def less(values: Array, columns: Array) -> Array:
    return np.asarray(values - columns @ (columns.T @ values))


def hide(then: Machine, now: Machine, physics: Machine, change: Change, strength: float) -> Hidden:
    """The change at a strength. then, now: seen through the case's model. physics: `now` through the diagnosed one.

    Raises ValueError where no sound magnitude has the strength.
    """
    before, absorbed = residuals(now), bent(now)
    constants = spans([len(residual(now, columns)) for columns in now.recordings.values()])
    noise = less(before, constants)
    loudness = float(noise @ noise)

    def altered(magnitude: float) -> dict[str, Columns]:
        return {name: change.put(physics, c, change.sign * magnitude) for name, c in physics.recordings.items()}

    def added(magnitude: float) -> Array:
        return np.asarray(residuals(replace(now, recordings=altered(magnitude))) - before)

    def measured(torque: Array) -> dict[str, float]:
        """Both variances over that of the remainder."""
        kept = {"whole": less(torque, constants), "survives_now": less(torque, absorbed)}
        return {name: float(left @ left) / loudness for name, left in kept.items()}

    magnitude = first_magnitude(change, physics)
    start = measured(added(magnitude))
    # decided once, at the first magnitude, so that the search does not jump
    by = "whole" if start["survives_now"] < ABSORBED * start["whole"] else "survives_now"
    magnitude = magnitude_of(strength, lambda tried: measured(added(tried))[by], magnitude, change.most)
    torque = added(magnitude)
    check_sound(torque, physics)
    return Hidden(
        altered(magnitude),
        change.sign * magnitude,
        by,
        survives_both=survives_both(then, now, torque) / loudness,
        **measured(torque),
    )


def check_sound(torque: Array, machine: Machine) -> None:
    """Raises ValueError where the torque is too large for the machine to be the same still."""
    most = LOUDEST * max(float(np.percentile(np.abs(c[FORCE]), 95)) for c in machine.recordings.values()) * machine.arm
    swing = float(np.percentile(np.abs(torque - torque.mean()), 95))
    if swing > most:
        raise ValueError(f"it takes {swing:.3g} N.m, more than the {most:.3g} N.m that are sound")


def survives_both(then: Machine, now: Machine, torque: Array) -> float:
    """Sum of squares of what one set of numbers for both leaves of a torque that is in `now` alone."""
    earlier = {f"then {name}": columns for name, columns in then.recordings.items()}
    absorbed = bent(replace(now, recordings=earlier | now.recordings))
    left = less(np.concatenate([np.zeros(len(absorbed) - len(torque)), torque]), absorbed)
    return float(left @ left)


def magnitude_of(strength: float, strength_at: Callable[[float], float], first: float, most: float) -> float:
    """The magnitude that has the strength: by proportion until it lies between two, then between them.

    Raises ValueError where none up to `most` has it.
    """
    low, high, magnitude = 0.0, np.inf, min(first, most)
    for _ in range(ROUNDS):
        found = strength_at(magnitude)
        if abs(found / strength - 1.0) < CLOSE:
            return magnitude
        low, high = (magnitude, high) if found < strength else (low, magnitude)
        if low >= most:
            break
        wanted = min(magnitude * float(np.sqrt(strength / found)), most)
        between = low < wanted < high and not (low > 0.0 and high < np.inf)
        magnitude = wanted if between or high == np.inf else float(np.sqrt(max(low, 0.01 * high) * high))
    raise ValueError(f"strength {strength:g}: no sound magnitude of this change has it; tried up to {magnitude:g}")
