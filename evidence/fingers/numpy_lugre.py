"""Imposed filtered noise; LuGre friction with micro-damping, dz/dt = v/d − |v|·z/d and F = z + σ₁·dz/dt."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from evidence.fingers.common_finger import Finger, Hidden, Motion, balanced
from evidence.fingers.foreign import Array

JOINTS, RATE = 2, 500.0  # Hz
LEFT = 0.0015  # N·m rms that a diagnosis leaves with nothing hidden
DAMPING = 0.004  # s, σ₁ over the most friction


def bristles(velocity: Array, distance: Array) -> Array:
    """Friction over the most it may be, of a velocity (samples, ...); implicit steps."""
    z, friction = np.zeros(velocity.shape[1:]), np.zeros_like(velocity)
    for k in range(1, len(velocity)):
        before, rate = z, velocity[k] / distance
        z = (before + rate / RATE) / (1.0 + np.abs(rate) / RATE)
        friction[k] = z + DAMPING * (z - before) * RATE
    return friction


def simulate(
    finger: Finger, hidden: Hidden, seconds: float, rng: np.random.Generator, machine: int
) -> dict[str, Array]:
    """Forces, positions and angles without noise. machine: seed of what one finger keeps in all its recordings."""
    own = np.random.default_rng(machine)
    distance, joint_distance = own.uniform(5e-5, 3e-4, finger.arms.shape), own.uniform(0.005, 0.03, finger.cover.shape)
    time = np.arange(round(seconds * RATE)) / RATE
    low = butter(3, [0.05, 0.8], "band", fs=RATE, output="sos")
    angle = sosfiltfilt(low, rng.standard_normal((len(time) + 20_000, len(finger.cover))), axis=0)[10_000:-10_000]
    angle *= 0.35 / angle.std(axis=0)
    velocity = np.gradient(angle, time, axis=0)
    speed = np.cumsum((velocity[:, None, :] * finger.arms)[:, :, ::-1], axis=2)[:, :, ::-1]
    motion = Motion(time, angle, velocity, speed, bristles(speed, distance), bristles(velocity, joint_distance))
    levels = rng.uniform(14.0, 28.0, round(seconds / 6.0) + 2)
    pull = np.interp(time, 6.0 * np.arange(len(levels)), levels)
    return balanced(finger, hidden, motion, pull)
