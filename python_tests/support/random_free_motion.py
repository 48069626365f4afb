"""Seeded free motion of random fingers, as good and as bad as people record it, to tune contact detection on.

Motions are sines with rests, forces a pretension with crude friction. What can be wrong with sensors is drawn for each
recording: noise, quantisation, frozen channels, slack tendons, forces of almost nothing.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from random_fingers import Array, Description, random_detection, random_finger
from tendonfmu.recordings.recording import Recording


def random_free_case(seed: int, longest: float = 300.0) -> tuple[Description, list[Recording]]:
    """A finger of 1 to 4 joints, and 1 to 3 recordings of 10 s to `longest` s in all, at 50 to 1000 Hz."""
    rng = np.random.default_rng([seed, 11])
    finger = random_finger(seed)
    if rng.random() < 0.5:
        finger = random_detection(seed, finger)
    count = int(rng.integers(1, 4))
    seconds = float(np.exp(rng.uniform(np.log(10.0), np.log(longest))))
    rate = float(np.exp(rng.uniform(np.log(50.0), np.log(1000.0))))
    pretensions = np.sort(np.exp(rng.uniform(np.log(0.5), np.log(60.0), count)))
    return finger, [
        random_free_recording(finger, rng, max(seconds / count, 4.0), rate, float(each), k)
        for k, each in enumerate(pretensions)
    ]


def random_free_recording(
    finger: Description, rng: np.random.Generator, seconds: float, rate: float, pretension: float, number: int
) -> Recording:
    """One recording; `pretension` in N."""
    arms = np.array([tendon["moment_arms"] for tendon in finger["tendons"]])
    stiffness = np.array([tendon["stiffness"] for tendon in finger["tendons"]])
    time = np.arange(round(seconds * rate)) / rate
    angle, speed = _motion(rng, time, arms.shape[1])
    force = _forces(rng, arms, time, speed, pretension)
    position = angle @ arms.T + force / stiffness
    force, position = _sensed(rng, force, position)
    groups = {"tendon_force": np.ascontiguousarray(force), "tendon_position": np.ascontiguousarray(position)}
    return Recording(Path(f"free_{number + 1}.parquet"), time, groups)


def _motion(rng: np.random.Generator, time: Array, joints: int) -> tuple[Array, Array]:
    """Angles [N, n] rad and their speeds: three sines a joint that stand still at times."""
    moving = np.ones_like(time)
    if rng.random() < 0.7:
        period, share = rng.uniform(3.0, 12.0), rng.uniform(0.05, 0.6)
        moving = (np.mod(time, period) > share * period).astype(float)
    own = np.cumsum(moving) * (time[1] - time[0])
    frequency = rng.uniform(0.05, 2.0, (joints, 3))
    amplitude = rng.uniform(0.05, 0.5, (joints, 3))
    amplitude[rng.random(joints) < 0.2] *= 1e-3  # a joint that hardly moves
    phase = 2 * np.pi * frequency * own[:, None, None] + rng.uniform(0, 6.3, (joints, 3))
    speed = (amplitude * 2 * np.pi * frequency * np.cos(phase)).sum(axis=2) * moving[:, None]
    return (amplitude * np.sin(phase)).sum(axis=2), speed


def _forces(rng: np.random.Generator, arms: Array, time: Array, speed: Array, pretension: float) -> Array:
    """[N, m] N: a pretension that breathes, friction of some size, creep, slack at times."""
    tendons = len(arms)
    breath = 1.0 + rng.uniform(0.0, 0.9) * np.sin(2 * np.pi * rng.uniform(0.01, 0.3) * time + rng.uniform(0, 6.3))
    force = pretension * rng.uniform(0.3, 1.5, tendons) * breath[:, None]
    rubbed = rng.uniform(0.0, 0.3) * np.abs(arms).sum(axis=0) * pretension * np.tanh(speed / 0.03)
    force = force + rubbed @ np.linalg.pinv(arms)
    if rng.random() < 0.3:
        force = force + rng.uniform(0.0, 0.3) * pretension * np.exp(-time / rng.uniform(1.0, 60.0))[:, None]
    if rng.random() < 0.4:  # slack tendons read 0 or their offset
        force = np.maximum(force, rng.choice([0.0, -0.3, 0.2]))
    return np.asarray(force)


def _sensed(rng: np.random.Generator, force: Array, position: Array) -> tuple[Array, Array]:
    """What the sensors make of them."""
    force = force + 10.0 ** rng.uniform(-4.0, 0.3) * rng.standard_normal(force.shape)
    position = position + 10.0 ** rng.uniform(-8.0, -4.5) * rng.standard_normal(position.shape)
    if rng.random() < 0.3:
        step = 10.0 ** rng.uniform(-2.0, 0.5)
        force = np.round(force / step) * step
    if rng.random() < 0.3:
        step = 10.0 ** rng.uniform(-6.0, -4.0)
        position = np.round(position / step) * step
    tendons = force.shape[1]
    if rng.random() < 0.05:
        force[:, int(rng.integers(tendons))] = rng.choice([0.0, 5.0])
    if rng.random() < 0.04:
        position[:, int(rng.integers(tendons))] = 0.0
    if rng.random() < 0.02:
        force[:] = force[0]
    if rng.random() < 0.04:  # a channel that freezes in the middle
        k = len(force) // 2
        force[k:, int(rng.integers(tendons))] = force[k, 0]
    return force, position
