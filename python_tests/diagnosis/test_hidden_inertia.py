"""An arm with a shoulder of two perpendicular axes, by Lagrange's equations: its inertia is found to vary."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonfmu.commands.diagnose import diagnose
from tendonfmu.recordings.recording import Recording

Array = NDArray[np.float64]
INERTIA = 0.05  # kg·m², of a mass at the end of the arm
RATE, SECONDS = 200.0, 40.0
COULOMB = (0.04, 0.03)  # N·m


def motion(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Angles, velocities and accelerations [N, 2] of an excitation."""
    time = np.arange(0.0, SECONDS, 1.0 / RATE)[:, None, None]
    speed = 2.0 * np.pi * rng.uniform(0.1, 1.0, (2, 5))
    size = rng.uniform(0.3, 1.0, (2, 5)) * 0.5 / (1.0 + speed / 4.0)
    phase = speed * time + rng.uniform(0.0, 2.0 * np.pi, (2, 5))
    angle = (size * np.sin(phase)).sum(axis=2)
    return angle, (size * speed * np.cos(phase)).sum(axis=2), -(size * speed**2 * np.sin(phase)).sum(axis=2)


def recorded(seed: int, *, turns: bool) -> Recording:
    """turns: the mass comes nearer to the first axis as the second joint turns; else it stays where it is."""
    rng = np.random.default_rng(seed)
    angle, velocity, acceleration = motion(rng)
    torque = INERTIA * acceleration + COULOMB * np.tanh(velocity / 0.005)
    if turns:  # energy ½·INERTIA·(cos²q₂·q̇₁² + q̇₂²)
        second, (v, w) = angle[:, 1], velocity.T
        torque[:, 0] -= INERTIA * (np.sin(second) ** 2 * acceleration[:, 0] + np.sin(2.0 * second) * v * w)
        torque[:, 1] += 0.5 * INERTIA * np.sin(2.0 * second) * v**2
    torque += 0.004 * rng.standard_normal(torque.shape)
    return Recording.from_arrays(
        np.arange(len(angle)) / RATE,
        tendon_force=torque,
        tendon_position=angle,
        joint_position=angle,
        joint_velocity=velocity,
    )


def arm() -> dict[str, Any]:
    law = {"static": 0.03, "coulomb": 0.03, "stribeck_velocity": 0.1, "viscous": 0.001}
    return {
        "format": "tendonfmu-finger-1",
        "name": "arm",
        "joints": [{"name": "yaw", "friction": law}, {"name": "pitch", "friction": law}],
        "tendons": [
            {"stiffness": 1e6, "moment_arms": arms, "bidirectional": True} for arms in ([1.0, 0.0], [0.0, 1.0])
        ],
        "bias": {"initial_torque": [0.0, 0.0]},
        "contact": {"threshold": [1.0, 1.0]},
        "extensions": [{"effect": "inertia", "joint": joint, "inertia": 0.03} for joint in (1, 2)],
    }


def named(*, turns: bool) -> dict[str, Any]:
    found = diagnose(arm(), [recorded(1, turns=turns)], test=[recorded(2, turns=turns)], kinematics=3)
    return {cause["effect"]: cause for cause in found.report["causes"]}


@pytest.mark.long
def test_the_inertia_that_varies_is_named_with_its_size() -> None:
    cause = named(turns=True)["inertia_variation"]
    assert cause["joint"] == 1 and cause["gain"]["interval"][0] > 0.5
    numbers = {path.rpartition(".")[2]: value for path, value in cause["parameters"].items()}
    assert numbers["cosine"] == pytest.approx(INERTIA / 2.0, rel=0.05)
    assert abs(numbers["sine"]) < 0.05 * INERTIA


@pytest.mark.long
def test_an_inertia_that_stays_is_not_named() -> None:
    assert "inertia_variation" not in named(turns=False)
