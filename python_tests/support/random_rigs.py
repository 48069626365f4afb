"""Seeded random rigs of the simulated finger: other routing, masses, laws and physics than the index finger's.

What is found on the index finger must hold on these too. Unexpanded, with the finger inline: write one to a file and
read it with `tendonfmu.simulate.rig.read_rig`. The draws are those of
`tendonfmu.statistics.random_numbers`, the same on every machine.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.statistics.random_numbers import Draws

Rig = dict[str, Any]
Array = NDArray[np.float64]

WORST_CONDITION = 30.0  # of the routing matrix: joints that tendons can tell apart


def random_rig(seed: int, joints: int | None = None, duration: float = 20.0) -> Rig:
    """A valid rig of 2 to 4 joints (or `joints`), two tendons for each; strokes at 8 to 15 N."""
    draws = Draws(seed, 3)
    n = joints or 2 + int(3 * draws.share())
    arms = random_arms(draws, n)
    return {
        "format": "tendonfmu-rig-1",
        "name": f"random_rig_{seed}",
        "version": 1,
        "seed": seed,
        "finger": _finger(draws, seed, arms),
        "physics": _physics(draws, n),
        "sensors": {
            "rate": 500,
            "tendon_force": {"noise": 0.003, "resolution": 0.002},
            "tendon_position": {"resolution": 2e-6},
            "joint_position": {"noise": 2e-4, "resolution": 2e-4},
        },
        "motion": {"kind": "strokes", "seed": seed, "duration": duration, "pretension": draws.between(8.0, 15.0)},
        "integration": {"method": "cvode", "relative_tolerance": 1e-6},
        "recording": {"duration": duration, "columns": ["joint_position", "external_torque", "contact"]},
    }


def random_arms(draws: Draws, n: int) -> Array:
    """[2n, n] m: tendons 2k-1 and 2k end at joint k, pulling it either way; R^T p = 0 for some p near ones."""
    while True:
        forces = np.array([draws.between(0.9, 1.1) for _ in range(2 * n)])
        arms = np.zeros((2 * n, n))
        for k in range(n):
            for side in (0, 1):
                row = [draws.sign() * draws.between(0.004, 0.01) for _ in range(k)]
                arms[2 * k + side, : k + 1] = [*row, (1.0 - 2.0 * side) * draws.between(0.005, 0.01)]
        for j in range(n):
            passing = forces * (arms[:, j] != 0.0)
            arms[:, j] -= passing * (passing @ arms[:, j]) / (passing @ passing)
        arms = np.round(arms, 6)
        ones = np.ones(2 * n)
        held = ones - arms @ np.linalg.lstsq(arms, ones, rcond=None)[0]
        big_enough = bool((np.abs(arms[arms != 0.0]) > 1e-3).all())
        if np.linalg.cond(arms) < WORST_CONDITION and held.min() > 0.3 and big_enough:
            return arms


def _law(draws: Draws, low: float, high: float, velocity: float, viscous: float) -> Rig:
    coulomb = draws.between(low, high)
    return {
        "static": round(coulomb * draws.between(1.05, 1.4), 8),
        "coulomb": round(coulomb, 8),
        "stribeck_velocity": round(velocity * draws.between(0.7, 1.5), 6),
        "viscous": round(viscous * draws.share(), 8),
    }


def _edge(draws: Draws, j: int) -> Rig:
    """One law in front of joint 1, working points elsewhere."""
    if j == 0:
        return _law(draws, 0.01, 0.025, 0.004, 0.1)
    points = 3 + int(3 * draws.share())
    angles = [round(-0.5 + 2.0 * (k + 0.4 * draws.share()) / points, 3) for k in range(points)]
    return {"angles": angles, "laws": [_law(draws, 0.01, 0.05, 0.004, 0.1) for _ in angles]}


def _finger(draws: Draws, seed: int, arms: Array) -> Rig:
    m, n = arms.shape
    passes = [int(np.flatnonzero(row)[-1]) + 1 for row in arms]
    return {
        "format": "tendonfmu-finger-1",
        "name": f"random_finger_{seed}",
        "joints": [
            {
                "cover": {"stiffness": round(draws.between(0.005, 0.02), 6), "rest_angle": round(draws.share(), 3)},
                "friction": _law(draws, 0.002, 0.005, 0.1, 0.0015),
                "load_friction": _law(draws, 5e-6, 3e-5, 0.1, 2e-6),
            }
            for _ in range(n)
        ],
        "tendons": [
            {
                "stiffness": round(draws.between(4000.0, 9000.0)),
                "moment_arms": arms[i].tolist(),
                "pulley_friction": [_law(draws, 0.006, 0.014, 0.006, 0.15) for _ in range(passes[i] - 1)],
                "edge_friction": [_edge(draws, j) for j in range(passes[i])],
            }
            for i in range(m)
        ],
        "contact": {"threshold": [0.03] * n},
    }


def _link(draws: Draws, j: int, before: float, length: float) -> Rig:
    """A cylinder along x; the first joint turns about z or y, the others about y."""
    radius = draws.between(0.006, 0.01)
    mass = 1160.0 * math.pi * radius * radius * length
    across = mass * (3.0 * radius * radius + length * length) / 12.0
    lower = round(draws.between(-0.6, -0.1), 3)
    return {
        "axis": [0.0, 0.0, 1.0] if j == 0 and draws.share() < 0.5 else [0.0, 1.0, 0.0],
        "offset": [before, 0.0, 0.0],
        "mass": round(mass, 6),
        "centre_of_mass": [round(0.5 * length, 6), 0.0, 0.0],
        "inertia": [round(0.5 * mass * radius * radius, 12), round(across, 12), round(across, 12)],
        "limits": {"lower": lower, "upper": round(lower + draws.between(1.0, 1.7), 3)},
    }


def _physics(draws: Draws, n: int) -> Rig:
    lengths = [round(draws.between(0.02, 0.045), 4) for _ in range(n)]
    return {
        "links": [_link(draws, j, lengths[j - 1] if j else 0.0, lengths[j]) for j in range(n)],
        "tip": [lengths[-1], 0.0, 0.0],
        "servo": {"frequency": round(draws.between(10.0, 25.0), 2), "damping_ratio": 1.0},
        "friction": {
            "presliding": {
                "pulley": round(draws.between(15e-6, 40e-6), 8),
                "edge": round(draws.between(25e-6, 60e-6), 8),
                "joint": round(draws.between(0.002, 0.006), 5),
            },
            "bristle_damping": round(draws.between(0.001, 0.004), 5),
            "stribeck_exponent": 1 if draws.share() < 0.5 else 2,
            "tension_loss": "linear" if draws.share() < 0.5 else "capstan",
            "pulley_torque": "beyond_joint" if draws.share() < 0.5 else "at_joint",
            "joint_load": "all",
        },
    }
