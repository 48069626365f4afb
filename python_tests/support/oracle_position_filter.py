"""The oracle's `position_filter`, from docs/reference/semantics/position_filter.md alone (see oracle.py)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_detection import direction_above
from oracle_finger import Key, Step, given

Array = NDArray[Any]

LONGEST_STEP = 1.0  # s


class JointFilter:
    """One joint: estimate [x, v, a], its covariance, and the angle z behind the gate."""

    def __init__(self, noise: float, jerk_density: float, branches: Counter[str]) -> None:
        self.noise, self.jerk_density, self.branches = noise, jerk_density, branches
        self.estimate = np.zeros(3)
        self.P = np.zeros((3, 3))
        self.z = math.nan

    def begin(self, q: float) -> float:
        """The first sample, or one after a gap: how far z moves."""
        travel = q - self.z
        self.estimate = np.array([q, 0.0, 0.0])
        self.P = np.diag([self.noise**2, 1.0, 100.0])
        self.z = q
        return travel

    def shift(self, angle: float) -> None:
        self.estimate[0] += angle
        self.z += angle

    def take(self, q: float, h: float, key: Key, out: Step) -> float:
        """One later sample: how far z moves."""
        if h > LONGEST_STEP:
            self.branches["filter_begins_anew"] += 1
            return self.begin(q)
        F = np.array([[1.0, h, h**2 / 2.0], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
        Q = np.array([
            [h**5 / 20.0, h**4 / 8.0, h**3 / 6.0],
            [h**4 / 8.0, h**3 / 3.0, h**2 / 2.0],
            [h**3 / 6.0, h**2 / 2.0, h],
        ])  # fmt: skip
        ahead = F @ self.estimate
        P = F @ self.P @ F.T + self.jerk_density * Q
        K = P[:, 0] / (P[0, 0] + self.noise**2)
        self.estimate = ahead + K * (q - ahead[0])
        self.P = P - np.outer(K, P[0])
        x, v, _ = self.estimate
        before = self.z
        if direction_above(v, 2.0 * math.sqrt(self.P[1, 1]), key, out):
            self.z = x
            self.branches["gate_open"] += 1
        else:
            width = 2.0 * math.sqrt(self.P[0, 0])
            self.z = min(max(self.z, x - width), x + width)
            self.branches["gate_held" if self.z == before else "gate_pushed"] += 1
        return float(self.z - before)


class PositionFilter:
    def __init__(self, filters: list[JointFilter]) -> None:
        self.filters = filters

    def shift(self, angles: Array) -> None:
        """Moves what is remembered by [n] rad, where other tendons tell the angles from now on."""
        for joint, angle in zip(self.filters, angles, strict=True):
            joint.shift(float(angle))

    def take(self, q: Array, dt: float, first: bool, out: Step) -> tuple[Array, Array]:
        """Velocity and travel of the joints, [n]."""
        if first:
            for joint, angle in zip(self.filters, q, strict=True):
                joint.begin(float(angle))
            return np.zeros(len(q)), np.zeros(len(q))
        travel = [
            joint.take(float(angle), dt, ("gate", j), out)
            for j, (joint, angle) in enumerate(zip(self.filters, q, strict=True))
        ]
        return np.array([joint.estimate[1] for joint in self.filters]), np.array(travel)


def read_position_filter(description: Mapping[str, Any], branches: Counter[str]) -> PositionFilter | None:
    settings = given(description, "position_filter", None)
    if settings is None:
        return None
    jerk_density = float(given(settings, "jerk_density", 1.0))
    return PositionFilter([JointFilter(float(noise), jerk_density, branches) for noise in settings["noise"]])
