"""Random strokes of a finger's joints and the pretension of its tendons, for the matched rig."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

Array = NDArray[Any]

REACH = 0.7  # rad, largest joint angle
SPEEDS = (0.25, 2.0)  # rad/s, mean speed of a stroke, evenly in its logarithm
STROKES = (0.1, 1.0)  # rad
SHORTEST = 0.3  # s, of a stroke: else a few of them would have most of all acceleration
REST = (0.05, 0.8)  # s, of every third stroke or so


def strokes(rng: np.random.Generator, time: Array, speed: float = 1.0) -> Array:
    """[N] one joint's angle: strokes of least jerk between random angles, a rest after some; it begins at rest at 0."""
    angle = np.zeros(len(time))
    now, at = time[0] + rng.uniform(0.1, 0.4), 0.0
    while now < time[-1]:
        length = rng.uniform(*STROKES)
        direction = 1.0 if at < -REACH + length else -1.0 if at > REACH - length else rng.choice([-1.0, 1.0])
        target = float(np.clip(at + direction * length, -REACH, REACH))
        mean_speed = speed * np.exp(rng.uniform(*np.log(SPEEDS)))
        duration = max(abs(target - at) / mean_speed, SHORTEST)
        s = np.clip((time - now) / duration, 0.0, 1.0)
        angle = np.where(time >= now, at + (target - at) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2), angle)
        now, at = now + duration, target
        if rng.random() < 0.35:
            now += rng.uniform(*REST)
    return angle


def wandering(rng: np.random.Generator, time: Array, knots: float) -> Array:
    """[N] smooth random signal between -1 and 1: a cubic through random values some `knots` seconds apart."""
    from scipy.interpolate import CubicSpline

    count = max(4, int((time[-1] - time[0]) / knots) + 2)
    places = np.linspace(time[0], time[-1], count)
    return np.clip(CubicSpline(places, rng.uniform(-1.0, 1.0, count))(time), -1.0, 1.0)


def pulling_null_vector(arms: Array) -> Array | None:
    """[m] forces above 0 of largest least element that make no torque, mean 1; None where there are none."""
    tendons, joints = arms.shape
    balance = np.vstack([np.hstack([arms.T, np.zeros((joints, 1))]), np.append(np.ones(tendons), 0.0)])
    above = np.hstack([-np.eye(tendons), np.ones((tendons, 1))])
    solution = linprog(
        np.append(np.zeros(tendons), -1.0),
        A_ub=above,
        b_ub=np.zeros(tendons),
        A_eq=balance,
        b_eq=np.append(np.zeros(joints), float(tendons)),
        bounds=[(0.0, None)] * (tendons + 1),
    )
    return solution.x[:tendons] if solution.success and solution.x[-1] > 0.3 else None


def pretension(rng: np.random.Generator, time: Array, arms: Array, level: float, knots: float) -> Array:
    """[N, m] N: varying forces without torque: `level` times 0.5 to 2, and a quarter of it between the tendons.

    knots: s in which they change. Where that is several seconds, what comes from wrong forces or arms looks like a
    slow bias.
    """
    base = pulling_null_vector(arms)
    assert base is not None
    left, _, _ = np.linalg.svd(arms)
    others = left[:, arms.shape[1] :]
    common = level * 2.0 ** wandering(rng, time, knots)
    force = common[:, None] * base
    for k in range(others.shape[1]):
        force = force + (0.25 * level * wandering(rng, time, knots / 1.5))[:, None] * others[:, k]
    return force
