"""Fingers in numpy whose motion is imposed: tendon forces are those nearest to the pretension that hold the joints.

What edges and joints rub follows their travel: after Dahl, or as springs that slip (Maxwell).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from evidence.families.finger import (
    CREEP,
    Array,
    Finger,
    Hidden,
    Trace,
    drift,
    edge_factor,
    extra_torque,
    hardening,
    true_arms,
)
from evidence.families.motion import Motion

RATE = 1000.0  # Hz
ELEMENTS = 5  # springs of a place
Built = Callable[[Array, Array, np.random.Generator], Array]  # travel [N, ...], largest distance, machine -> share


def dahl(travel: Array, distance: Array, machine: np.random.Generator) -> Array:
    """Share of the friction that a travel has built up: dz/dx = (1 − z·sgn ẋ)^δ / distance, δ by the machine."""
    exponent = float(machine.uniform(0.7, 1.5))
    step = np.diff(travel, axis=0) / distance
    sign = np.sign(step)
    share = np.zeros_like(travel)
    for k in range(len(step)):
        slope = np.maximum(1.0 - share[k] * sign[k], 0.0) ** exponent
        share[k + 1] = np.clip(share[k] + slope * step[k], -1.0, 1.0)
    return share


def maxwell(travel: Array, distance: Array, machine: np.random.Generator) -> Array:
    """The same of springs side by side that slip at widths up to twice the distance, with shares by the machine."""
    width = np.geomspace(0.1, 2.0, ELEMENTS) * distance[..., None]
    weight = machine.uniform(0.5, 1.5, width.shape)
    weight = weight / weight.sum(axis=-1, keepdims=True)
    step = np.diff(travel, axis=0)[..., None]
    spring, share = np.zeros(width.shape), np.zeros_like(travel)
    for k in range(len(step)):
        spring = np.clip(spring + step[k], -width, width)
        share[k + 1] = (weight * spring / width).sum(axis=-1)
    return share


@dataclasses.dataclass(frozen=True)
class Kind:
    """How a family rubs."""

    joints: int
    built: Built
    capstan: bool = False  # edges lose exp(−μφ) of the force, not a share of it
    stiffening: float = 0.0  # of the tendons' springs


KINDS = {
    "dahl": Kind(2, dahl),
    "maxwell": Kind(3, maxwell, capstan=True, stiffening=0.1),
}


def simulate(kind: Kind, finger: Finger, hidden: Hidden, motion: Motion, seconds: float, machine: int) -> Trace:
    """True signals at RATE. machine: seed of what all recordings of a finger share."""
    own = np.random.default_rng(machine)
    arms = true_arms(finger.arms, hidden)
    time = np.arange(round(seconds * RATE)) / RATE
    angle = motion.angles(time)
    velocity = np.gradient(angle, time, axis=0)
    travel = _from_the_tip(angle[:, None, :] * arms)
    distance, joint_distance = own.uniform(1e-4, 4e-4, arms.shape), own.uniform(0.01, 0.04, arms.shape[1:])
    edge = kind.built(travel, distance, own)
    joint = kind.built(angle, joint_distance, own)
    speed = _from_the_tip(velocity[:, None, :] * arms)
    passing = _passing(kind, finger, hidden, time, angle, speed, edge)
    worn = np.array([float(drift(hidden, t)) for t in time.tolist()])[:, None]
    needed = finger.cover * (angle - finger.rest) + finger.damping * velocity + finger.friction * joint * worn
    needed = needed + extra_torque(hidden, time, angle, velocity, _crept(angle))
    matrix = np.cumprod(passing, axis=2).transpose(0, 2, 1) * arms.T  # [N, n, m]
    if hidden.effect == "joint_load_friction":
        matrix[:, hidden.j, :] -= (hidden.size * joint[:, hidden.j])[:, None]
    if hidden.effect == "preload_friction":
        i = hidden.i
        behind = np.cumprod(passing[:, i, :], axis=1) / passing[:, i, :1]
        needed = needed + hidden.size * edge[:, i, :1] * behind * arms[i]
    wanted = motion.pull(time)[:, None] * np.ones(len(arms))
    missing = needed - np.einsum("kjm,km->kj", matrix, wanted)
    force = wanted + np.einsum("kmj,kj->km", np.linalg.pinv(matrix), missing)
    position = angle @ arms.T + _stretch(finger, hidden, force)
    return Trace(time, angle, force, position)


def _from_the_tip(values: Array) -> Array:
    """[N, m, n]: what a joint and all joints beyond it add up to."""
    return np.asarray(np.cumsum(values[:, :, ::-1], axis=2)[:, :, ::-1])


def _passing(kind: Kind, finger: Finger, hidden: Hidden, time: Array, angle: Array, speed: Array, edge: Array) -> Array:
    """[N, m, n] share of the force that passes each edge."""
    load = np.zeros(finger.edge.shape)
    factors = [edge_factor(hidden, t, q, v, load) for t, q, v in zip(time.tolist(), angle, speed, strict=True)]
    lost = finger.edge * edge * np.array(factors)
    return np.asarray(np.exp(-lost) if kind.capstan else 1.0 - lost)


def _crept(angle: Array) -> Array:
    crept = np.zeros_like(angle)
    for k in range(1, len(angle)):
        crept[k] = crept[k - 1] + (angle[k - 1] - crept[k - 1]) / (CREEP * RATE)
    return crept


def _stretch(finger: Finger, hidden: Hidden, force: Array) -> Array:
    """[N, m] m of the springs, whose force is stiffness·e + hardening·e²."""
    soft, hard = finger.springs
    hard = hard + hardening(hidden, len(hard))
    root = np.sqrt(soft**2 + 4 * hard * force)
    return np.asarray(2 * force / (soft + root))
