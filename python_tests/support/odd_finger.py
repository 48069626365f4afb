"""A description and recordings for a diagnosis, made by a few lines of numpy that share nothing with the package:
antagonistic tendons, friction of its own, noise. `diagnose_quirks.py` spoils them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Columns = dict[str, Array]  # `time` [N], groups [N, k], `contact` [N]
Description = dict[str, Any]


@dataclass
class Pair:
    """description, recordings and tests of one diagnosis. quirks: what is odd about them, the main one first."""

    seed: int
    description: Description
    recordings: list[Columns]
    tests: list[Columns]
    kinematics: int = 1
    quirks: list[str] = field(default_factory=list)

    @property
    def all(self) -> list[Columns]:
        return [*self.recordings, *self.tests]

    @property
    def joints(self) -> int:
        return len(self.description["joints"])

    @property
    def tendons(self) -> int:
        return len(self.description["tendons"])


# --- the finger -------------------------------------------------------------------------------------------------------


def law(rng: np.random.Generator, scale: float, velocity: float) -> Description:
    coulomb = scale * rng.uniform(0.3, 1.0)
    found = {"static": coulomb * rng.uniform(1.0, 1.6), "coulomb": coulomb, "stribeck_velocity": velocity}
    return found | ({"viscous": scale / velocity * rng.uniform(0.01, 0.1)} if rng.random() < 0.5 else {})


def routing(rng: np.random.Generator, joints: int, tendons: int) -> Array:
    """[m, n] m: pairs of tendons that pull either way; those that go further pass the joints before."""
    arms = np.zeros((tendons, joints))
    for i in range(tendons):
        last = i * joints // tendons
        arms[i, last] = (1.0 if i % 2 == 0 else -1.0) * rng.uniform(0.006, 0.012)
        arms[i, :last] = rng.choice([-1.0, 1.0]) * rng.uniform(0.003, 0.008, last)
    return arms


def finger(rng: np.random.Generator, joints: int, tendons: int) -> Description:
    arms = routing(rng, joints, tendons)
    return {
        "format": "tendonfmu-finger-1",
        "name": "odd_finger",
        "joints": [
            {"name": f"joint_{j + 1}", "friction": law(rng, 0.008, 0.1)}
            | ({"cover": {"stiffness": rng.uniform(0.005, 0.03)}} if rng.random() < 0.5 else {})
            for j in range(joints)
        ],
        "tendons": [
            {
                "name": f"tendon_{i + 1}",
                "stiffness": rng.uniform(2e3, 2e4),
                "moment_arms": arms[i].tolist(),
                "edge_friction": [
                    law(rng, 0.04, 0.005) if arm and rng.random() < 0.7 else None for arm in arms[i].tolist()
                ],
            }
            for i in range(tendons)
        ],
        "bias": {"drift_variance": 1e-6, "noise_std": 0.005},
        "contact": {"threshold": [0.05] * joints},
    }


def arms_of(description: Description) -> Array:
    return np.array([tendon["moment_arms"] for tendon in description["tendons"]], dtype=float)


def moved(rng: np.random.Generator, description: Description, seconds: float, rate: float) -> Columns:
    """A recording of free motion: sines of several speeds, pretension in steps, friction that grows with the force."""
    arms = arms_of(description)
    joints = arms.shape[1]
    time = np.arange(round(seconds * rate)) / rate
    angle = np.zeros((len(time), joints))
    for j in range(joints):
        for part in range(3):
            speed = rng.uniform(0.3, 1.5) * (part + 1)
            angle[:, j] += rng.uniform(0.1, 0.4) * np.sin(speed * time + rng.uniform(0.0, 6.0))
    velocity = np.gradient(angle, time, axis=0) if len(time) > 1 else np.zeros_like(angle)
    level = rng.uniform(5.0, 20.0, 4)[np.minimum((4 * time / max(seconds, 1e-9)).astype(int), 3)]
    size = rng.uniform(0.002, 0.02, joints) + rng.uniform(0.0, 5e-4, joints) * level[:, None]
    torque = size * np.tanh(velocity / rng.uniform(0.01, 0.05)) + rng.uniform(0.0, 0.03, joints) * angle
    torque += rng.uniform(0.0, 3e-3, joints) * velocity
    stiffness = np.array([tendon["stiffness"] for tendon in description["tendons"]])
    force = np.maximum(level[:, None] + torque @ np.linalg.pinv(arms), 0.0)
    force = force + 0.02 * rng.normal(size=force.shape)
    position = angle @ arms.T + force / np.where(stiffness > 0, stiffness, 1.0) + 1e-6 * rng.normal(size=force.shape)
    return {"time": time, "tendon_force": force, "tendon_position": position} | (
        {"joint_position": angle + 1e-4 * rng.normal(size=angle.shape), "joint_velocity": velocity}
    )
