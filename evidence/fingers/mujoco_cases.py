"""Fingers in MuJoCo that are pushed: 2 or 3 joints, routed tendons, stick-slip by the constraint solver.

Each has every ingredient of its description in the simulation, or one more that the description lacks.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from evidence.fingers.foreign import Nominal, description, law, rough
from evidence.fingers.mujoco_model import Physics

Add = Callable[[Physics], dict[str, Any]]


@dataclasses.dataclass(frozen=True)
class Plan:
    """One finger, and the physics of what its description lacks as changed numbers."""

    joints: int
    spatial: bool = False
    speed: float = 1.0  # of the motion, against that of the others
    add: Add = lambda physics: {}


PLANS = {  # by number
    1: Plan(2),
    3: Plan(2, add=lambda p: {"heavy": (1,), "load": 0.25}),
    4: Plan(3, spatial=True, add=lambda p: {"heavy": (2,), "load": 0.1}),
    6: Plan(3, add=lambda p: {"hardening": (2, 0.35)}),
    19: Plan(3, spatial=True),
}


def finger(plan: Plan, rng: np.random.Generator) -> Physics:
    """Two tendons a joint, an antagonistic pair each, which cross all joints before theirs."""
    n, m = plan.joints, 2 * plan.joints
    arms = np.zeros((m, n))
    for i in range(m):
        side = 1.0 if i % 2 == 0 else -1.0
        for j in range(i // 2 + 1):
            arms[i, j] = side * (-1.0) ** (i // 2 - j) * rng.uniform(0.0068, 0.0095)
    crossed = (arms != 0.0).astype(float)
    # Friction between joints sits at edges of fixed tendons and at pulleys of those that wrap.
    inner = crossed * (np.arange(n) > 0) * rng.uniform(0.012, 0.025, (m, n))
    entry = crossed * (np.arange(n) == 0) * rng.uniform(0.015, 0.035, (m, n))
    passing = np.hstack([inner[:, 1:], np.zeros((m, 1))])
    return Physics(
        arms=arms,
        stiffness=rng.uniform(3000.0, 5000.0, m),
        edge=entry if plan.spatial else entry + inner,
        pulley=passing if plan.spatial else 0 * passing,
        joint_friction=rng.uniform(0.004, 0.009, n),
        damping=rng.uniform(0.001, 0.003, n),
        cover=rng.uniform(0.015, 0.03, n),
        rest_angle=rng.uniform(-0.05, 0.1, n),
        spatial=plan.spatial,
    )


def describe(physics: Physics, plan: Plan, rng: np.random.Generator) -> Nominal:
    """The description with rough numbers."""
    joints: list[dict[str, Any]] = []
    for j in range(physics.joints):
        friction = law(physics.joint_friction[j], 0.1, rng, viscous=physics.damping[j])
        cover = {"stiffness": rough(physics.cover[j], rng), "rest_angle": rough(physics.rest_angle[j], rng)}
        joints.append({"friction": friction, "cover": cover})
    tendons = []
    for i in range(physics.tendons):
        edge = [law(share, 0.005, rng) if share > 0.0 else None for share in physics.edge[i]]
        pulley = [law(share, 0.005, rng) if share > 0.0 else None for share in physics.pulley[i]]
        tendons.append(
            {
                "stiffness": float(physics.stiffness[i]),
                "moment_arms": physics.arms[i].tolist(),
                "edge_friction": edge,
                "pulley_friction": pulley,
            }
        )
    return description(f"mujoco_{plan.joints}", joints, tendons)
