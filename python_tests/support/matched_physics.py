"""Friction of a tendon finger in numpy, over all samples at once: what the matched rig is made of.

Written from the texts alone (the paper's equations, docs/reference/semantics); it shares no code with the runtime,
the package or the oracle. What moves and what sticks follows from the velocities alone, so that every bias jump can be
placed at once. Indices start at 0 here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Description = dict[str, Any]
NUMBERS = ("coulomb", "drop", "stribeck_velocity", "viscous")  # drop: static - coulomb


@dataclass(frozen=True)
class Motion:
    """Kinematics in use. time [N] s, angle and velocity [N, n] rad, rad/s; tendon [N, m, n + 1] m/s, last column 0."""

    time: Array
    angle: Array
    velocity: Array
    tendon: Array


def motion_of(time: Array, angle: Array, velocity: Array, arms: Array) -> Motion:
    """With the relative tendon velocities of eq. (5): the arms of this joint and all after it."""
    products = velocity[:, None, :] * arms[None, :, :]
    tendon = np.zeros((*products.shape[:2], products.shape[2] + 1))
    tendon[:, :, :-1] = np.cumsum(products[:, :, ::-1], axis=2)[:, :, ::-1]
    return Motion(time, angle, velocity, tendon)


def side_value(side: Array, speed: Array | float) -> Array:
    """Magnitude of eq. (1) of one side, numbers as in NUMBERS."""
    coulomb, drop, stribeck_velocity, viscous = side
    return np.asarray(coulomb + drop * np.exp(-np.abs(speed) / stribeck_velocity) + viscous * np.abs(speed))


def last_true(flags: Array) -> Array:
    """[N] index of the last sample up to this one at which the flag holds, -1 before there was one."""
    return np.maximum.accumulate(np.where(flags, np.arange(len(flags)), -1))


def held_sign(velocity: Array, threshold: float) -> Array:
    """[N] sign of the last velocity above the threshold, 0 before there was one."""
    last = last_true(np.abs(velocity) > threshold)
    return np.where(last >= 0, np.sign(velocity[last]), 0.0)


@dataclass
class Effect:
    """One friction effect and what the series of its velocity made of it.

    kind: "edge", "pulley", "joint" or "load". at: (tendon, joint) or (joint,). sides: [2, 4] positive, negative;
    memory: m or rad over which the friction builds up (presliding), None for stick and slip.
    factor: [N] multiplies it (drift, ageing), or None.
    """

    kind: str
    at: tuple[int, ...]
    sides: Array
    memory: float | None = None
    factor: Array | None = None


@dataclass(frozen=True)
class Contacts:
    """Where a velocity moves, sticks, begins and ends to. side [N]: sign of the last moving sample, 0 before one."""

    moving: Array
    side: Array
    enters: Array  # [E] samples
    leaves: Array  # [L] samples
    entered: Array  # [L] the entry that belongs to each leaving, -1: it never moved before
    stuck_since: Array  # [L] sample at which that rest began


def contacts_of(velocity: Array, threshold: float) -> Contacts:
    moving, side = np.abs(velocity) > threshold, held_sign(velocity, threshold)
    enters = np.flatnonzero(moving[:-1] & ~moving[1:]) + 1
    leaves = np.flatnonzero(~moving[:-1] & moving[1:]) + 1
    position = np.searchsorted(enters, leaves) - 1
    since = np.where(position >= 0, enters[np.maximum(position, 0)] if len(enters) else 0, 0)
    return Contacts(moving, side, enters, leaves, position, since)


def build_up(velocity: Array, time: Array, distance: float) -> Array:
    """ζ of docs/reference/semantics/presliding.md, closed over every stretch of one direction.

    1 - s·ζ decays by exp(-travel/distance) within such a stretch, so only the turns need a loop.
    """
    step = np.zeros(len(time))
    step[1:] = velocity[1:] * np.diff(time)
    sign = np.sign(step)
    last = last_true(sign != 0)
    sign = np.where(last >= 0, sign[last], 0.0)  # no travel: ζ stays, as it does in a stretch without travel
    travel = np.concatenate([[0.0], np.cumsum(np.abs(step[1:]))])
    starts = np.flatnonzero(np.diff(sign) != 0) + 1
    bounds = [0, *starts.tolist(), len(time)]
    zeta, value = np.zeros(len(time)), 0.0
    for begin, end in pairwise(bounds):
        s = sign[begin]
        before = travel[begin - 1] if begin > 0 else 0.0
        if s != 0.0:
            zeta[begin:end] = s - (s - value) * np.exp(-(travel[begin:end] - before) / distance)
        value = zeta[end - 1]
    return zeta


@dataclass
class Finger:
    """Numbers of a finger for this file: `read_finger` makes it from a description.

    arms [m, n] m, stiffness [m] N/m; cover, rest [n]. thresholds: of tendons m/s, of joints rad/s.
    extras: further torques, each f(motion, forces [N, m]) -> [N, n] added to T.
    """

    arms: Array
    stiffness: Array
    cover: Array
    rest: Array
    effects: list[Effect]
    tendon_threshold: float
    joint_threshold: float
    cutoff: float
    forget_rate: float
    extras: list[Callable[[Motion, Array], Array]] = field(default_factory=list)

    @property
    def joints(self) -> int:
        return int(self.arms.shape[1])


def read_law(law: Mapping[str, Any]) -> Array:
    """[2, 4] positive and negative side of a law, which are the same."""
    return np.array([[law["coulomb"], law["static"] - law["coulomb"], law["stribeck_velocity"], law["viscous"]]] * 2)


def read_finger(data: Mapping[str, Any]) -> Finger:
    """The numbers of a description. Laws with working points and most extensions have no reader here."""
    joints, tendons = data["joints"], data["tendons"]
    effects = []
    for i, tendon in enumerate(tendons):
        for kind, key in (("edge", "edge_friction"), ("pulley", "pulley_friction")):
            for j, law in enumerate(tendon.get(key) or []):
                if law is not None:
                    effects.append(Effect(kind, (i, j), read_law(law)))
    for j, joint in enumerate(joints):
        for kind, key in (("joint", "friction"), ("load", "load_friction")):
            if joint.get(key) is not None:
                effects.append(Effect(kind, (j,), read_law(joint[key])))
    for row in data.get("extensions") or []:
        assert row["effect"] == "presliding", f"no reader for {row['effect']}"
        kinds, place = (("edge", "pulley"), row["tendon"]) if "tendon" in row else (("joint", "load"), row["joint"])
        for effect in effects:
            if effect.kind in kinds and effect.at[0] == place - 1:
                effect.memory = row["displacement"]
    covers = [joint.get("cover") or {"stiffness": 0.0} for joint in joints]
    return Finger(
        arms=np.array([tendon["moment_arms"] for tendon in tendons]),
        stiffness=np.array([tendon["stiffness"] for tendon in tendons]),
        cover=np.array([cover["stiffness"] for cover in covers]),
        rest=np.array([cover.get("rest_angle", 0.0) for cover in covers]),
        effects=effects,
        tendon_threshold=data["velocity_threshold"]["tendon"],
        joint_threshold=data["velocity_threshold"]["joint"],
        cutoff=data["velocity_filter_cutoff"],
        forget_rate=data["bias"]["forget_rate"],
    )


def velocity_seen(effect: Effect, motion: Motion) -> Array:
    if effect.kind == "edge":
        return motion.tendon[:, effect.at[0], effect.at[1]]
    if effect.kind == "pulley":
        return motion.tendon[:, effect.at[0], effect.at[1] + 1]
    return motion.velocity[:, effect.at[0]]


@dataclass
class Values:
    """F of one effect [N], and its bias jumps by force: entry [E], what is kept of it and what leaves anew [L]."""

    F: Array
    contacts: Contacts | None = None
    entry: Array | None = None
    kept: Array | None = None
    leaving: Array | None = None


def values_of(effect: Effect, motion: Motion, finger: Finger) -> Values:
    """Friction over the whole series by docs/reference/semantics/friction_law.md, or presliding."""
    v = velocity_seen(effect, motion)
    threshold = finger.tendon_threshold if effect.kind in ("edge", "pulley") else finger.joint_threshold
    contacts = contacts_of(v, threshold)
    factor = np.ones(len(v)) if effect.factor is None else effect.factor

    def at(side: Array, speed: Array | float) -> Array:
        return np.where(side >= 0, side_value(effect.sides[0], speed), side_value(effect.sides[1], speed))

    if effect.memory is not None:
        side = np.where(contacts.side == 0.0, 1.0, contacts.side)
        return Values(build_up(v, motion.time, effect.memory) * at(side, np.abs(v)) * factor)
    F = np.where(contacts.moving, np.sign(v) * at(np.sign(v), np.abs(v)), 0.0) * factor
    side_in = contacts.side[contacts.enters - 1] if len(contacts.enters) else np.zeros(0)
    side_out = contacts.side[contacts.leaves]
    entry = side_in * at(side_in, threshold) * factor[contacts.enters]
    leaving = -side_out * at(side_out, threshold) * factor[contacts.leaves]
    rested = motion.time[contacts.leaves - 1] - motion.time[contacts.stuck_since]
    kept = np.where(contacts.entered >= 0, np.exp(-finger.forget_rate * rested), 0.0)
    return Values(F, contacts, entry, kept, leaving)


def jumps(values: Values, load: Array) -> Array:
    """[N] cumulated Δb of one effect, its loads [N] multiplied in (semantics/friction_law.md)."""
    contacts, total = values.contacts, np.zeros(len(load))
    if contacts is None:
        return total
    assert values.entry is not None and values.kept is not None and values.leaving is not None
    np.add.at(total, contacts.enters, values.entry * load[contacts.enters])
    entered = values.entry[np.maximum(contacts.entered, 0)] if len(values.entry) else 0.0
    back = values.kept * np.where(contacts.entered >= 0, entered, 0.0)
    np.add.at(total, contacts.leaves, ((1.0 - values.kept) * values.leaving - back) * load[contacts.leaves])
    return np.asarray(np.cumsum(total))


def friction_torque(finger: Finger, motion: Motion, values: Sequence[Values], force: Array) -> Array:
    """[N, n] T of eq. (10) and the jumps of the bias so far, for tendon forces [N, m]."""
    samples, joints = motion.angle.shape
    lost = np.zeros((samples, *finger.arms.shape))  # by tendon i at joint j: what eqs. (6), (7) sum up
    torque: Array = finger.cover * (motion.angle - finger.rest)
    by_place = {(effect.kind, effect.at): value for effect, value in zip(finger.effects, values, strict=True)}
    f, between = np.maximum(force, 0.0), np.zeros_like(lost)
    for j in range(joints):
        for i in range(finger.arms.shape[0]):
            for kind in ("edge", "pulley"):
                value = by_place.get((kind, (i, j)))
                if value is not None:
                    lost[:, i, j] += value.F * f[:, i] + jumps(value, f[:, i])
                    f[:, i] = np.maximum(f[:, i] * (1.0 - value.F), 0.0)
                if kind == "edge":
                    between[:, i, j] = f[:, i]
    torque = torque + np.einsum("tij,ij->tj", np.cumsum(lost, axis=2), finger.arms)
    for j in range(joints):
        load = between[:, :, j].sum(axis=1)
        for kind, weight in (("joint", np.ones(samples)), ("load", load)):
            value = by_place.get((kind, (j,)))
            if value is not None:
                torque[:, j] += value.F * weight + jumps(value, weight)
    for extra in finger.extras:
        torque = torque + extra(motion, force)
    return torque


def torque_of(finger: Finger, motion: Motion, force: Array) -> Array:
    """[N, n] G = T + cumulated jumps: what the measured torque is but for a slow bias and noise."""
    return friction_torque(finger, motion, [values_of(effect, motion, finger) for effect in finger.effects], force)


def filtered_velocity(angle: Array, step: float, cutoff: float) -> Array:
    """[N, n] by docs/reference/semantics/kinematics.md#velocity-filter; 0 at the first sample."""
    from scipy.signal import lfilter

    raw = np.zeros_like(angle)
    raw[1:] = np.diff(angle, axis=0) / step
    if cutoff == 0.0:
        return raw
    share = 1.0 - np.exp(-2.0 * np.pi * cutoff * step)
    return np.asarray(lfilter([share], [1.0, share - 1.0], raw, axis=0))
