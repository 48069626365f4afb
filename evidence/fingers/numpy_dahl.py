"""Imposed random strokes with pauses; friction after Dahl, dz/dx = (1 − z·sgn ẋ)^δ / distance."""

from __future__ import annotations

import numpy as np

from evidence.fingers.common_finger import Finger, Hidden, Motion, balanced
from evidence.fingers.foreign import Array

JOINTS, RATE = 2, 400.0  # Hz
LEFT = 0.0015  # N·m rms that a diagnosis leaves with nothing hidden


def strokes(time: Array, rng: np.random.Generator) -> Array:
    """Angles of a joint [rad]: from one random angle to the next without a jerk, every other time with a rest."""
    angle, begin, here = np.zeros_like(time), 0.0, float(rng.uniform(-0.5, 0.6))
    while begin < time[-1]:
        there, length = float(rng.uniform(-0.6, 0.7)), float(rng.uniform(0.4, 1.8))
        s = np.clip((time - begin) / length, 0.0, 1.0)
        rows = time >= begin
        angle[rows] = (here + (there - here) * s**3 * (10 - 15 * s + 6 * s**2))[rows]
        here, begin = there, begin + length + max(0.0, float(rng.uniform(-1.0, 1.2)))
    return angle


def built_up(travel: Array, distance: Array, exponent: float) -> Array:
    """z of a travel (samples, ...) [m or rad]."""
    z = np.zeros_like(travel)
    for k in range(1, len(travel)):
        step = travel[k] - travel[k - 1]
        slope = np.maximum(1.0 - z[k - 1] * np.sign(step), 0.0) ** exponent
        z[k] = np.clip(z[k - 1] + slope * step / distance, -1.0, 1.0)
    return z


def simulate(
    finger: Finger, hidden: Hidden, seconds: float, rng: np.random.Generator, machine: int
) -> dict[str, Array]:
    """Forces, positions and angles without noise. machine: seed of what one finger keeps in all its recordings."""
    own = np.random.default_rng(machine)
    distance, joint_distance = own.uniform(1e-4, 4e-4, finger.arms.shape), own.uniform(0.01, 0.04, finger.cover.shape)
    exponent = float(own.uniform(0.6, 1.6))
    time = np.arange(round(seconds * RATE)) / RATE
    angle = np.column_stack([strokes(time, rng) for _ in finger.cover])
    velocity = np.gradient(angle, time, axis=0)
    travel = np.cumsum((angle[:, None, :] * finger.arms)[:, :, ::-1], axis=2)[:, :, ::-1]
    motion = Motion(
        time, angle, velocity, np.gradient(travel, time, axis=0),
        built_up(travel, distance, exponent), built_up(angle, joint_distance, exponent),
    )  # fmt: skip
    pull = 20.0 * (1.0 + 0.3 * np.sin(2 * np.pi * float(rng.uniform(0.04, 0.09)) * time))
    return balanced(finger, hidden, motion, pull)
