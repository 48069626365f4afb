"""Cases whose fingers run in MuJoCo: 2 to 4 joints, routed tendons, stick-slip by the constraint solver, contact.

Each case has every ingredient of its description in the simulation, and one more that the description lacks.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from evidence.fingers.foreign import (
    TEST_SECONDS,
    TRAIN_SECONDS,
    Array,
    Case,
    Nominal,
    Truth,
    description,
    frame,
    law,
    noisy,
    quantised,
    rough,
)
from evidence.fingers.mujoco_model import Physics
from evidence.fingers.mujoco_run import Trace, random_motion, run

DELAY = 0.02  # s
OFFSET = 1.5  # N
ALSO = ("inertia",)  # links and motors have mass, 0.3 to 6 mN·m rms at a joint; no description has a number for it
Add = Callable[[Physics], dict[str, Any]]


@dataclasses.dataclass(frozen=True)
class Plan:
    """One case: its finger, what is hidden and where, and the physics of the hidden effect as changed numbers."""

    hidden: str
    joints: int
    joint: int | None = None
    tendon: int | None = None
    spatial: bool = False
    loaded: bool = False  # the joints' friction grows with the tendon forces
    rate: float = 500.0  # Hz
    speed: float = 1.0  # of the motion, against that of the other cases
    add: Add = lambda physics: {}


def at(values: Array, index: int | tuple[int, int], value: float) -> Array:
    changed = values.copy()
    changed[index] = value
    return np.asarray(changed)


def without_damping(p: Physics) -> dict[str, Any]:
    """A joint whose whole friction is hidden has no damping either: the description could not say it."""
    return {"joint_friction": at(p.joint_friction, 1, 0.022), "damping": at(p.damping, 1, 0.0)}


PUSHES = ((8.0, 11.0, 0.7), (22.0, 24.5, 1.0), (41.0, 44.0, 0.8))  # s, s, N

PLANS = (
    Plan("none", 2),
    Plan("none", 2, spatial=True, loaded=True, rate=250.0),
    Plan("gravity", 2, joint=1, add=lambda p: {"heavy": (1,), "load": 0.25}),
    Plan("gravity", 3, joint=2, spatial=True, add=lambda p: {"heavy": (2,), "load": 0.1}),
    Plan("cover_stiffness", 2, joint=1, add=lambda p: {"cover": at(p.cover, 0, 0.06)}),
    Plan("cover_hardening", 3, joint=2, add=lambda p: {"hardening": (2, 0.35)}),
    Plan("joint_friction", 2, joint=2, rate=1000.0, add=without_damping),
    Plan("time_delay", 2, speed=2.5),
    Plan("force_offset", 2, tendon=2),
    Plan("joint_coupling", 3, joint=1, add=lambda p: {"coupling": (1, 0.04)}),
    Plan("pulley_eccentricity", 2, joint=1, tendon=1, spatial=True, add=lambda p: {"eccentric": (1, 1, 0.0025)}),
    Plan("moment_arm_variation", 2, joint=2, tendon=4, spatial=True, add=lambda p: {"bowstring": (4, 2, 0.005)}),
    Plan("viscous_friction", 2, rate=250.0, add=lambda p: {"damping": 0 * p.damping + 0.02}),
    Plan("friction_drift", 3, add=lambda p: {"drift": (1.0, 20.0)}),
    Plan("contact", 2, add=lambda p: {"pushes": PUSHES}),
    Plan("edge_friction", 2, joint=2, tendon=3, add=lambda p: {"edge": at(p.edge, (2, 1), 0.12)}),
    Plan("unknown_hum", 2, joint=2, add=lambda p: {"hum": (2, 0.02, 1.7)}),
    Plan("unknown_creep", 3, joint=2, spatial=True, add=lambda p: {"creep": (2, 0.06, 2.0)}),
    Plan("none", 3, spatial=True, rate=1000.0),
    Plan("none", 4, loaded=True),
    Plan("stribeck", 2, add=lambda p: {"stribeck": (1.6, 0.008)}),
    Plan("unknown_catch", 2, joint=1, add=lambda p: {"catch": (1, 0.06, 0.1)}),
    Plan("gravity", 4, rate=250.0, add=lambda p: {"heavy": (1, 2, 3, 4), "load": 0.03}),
    Plan("preload_friction", 2, tendon=3, add=lambda p: {"preload": (3, 2.0)}),
)
NUMBERS = range(1, len(PLANS) + 1)
SEED = 7100


def make(number: int) -> Case:
    """The case of a number (from 1)."""
    plan, seed = PLANS[number - 1], SEED + number
    rng = np.random.default_rng(seed)
    plain = finger(plan, rng)
    physics = dataclasses.replace(plain, **plan.add(plain))
    nominal = describe(plain, plan, rng)
    motions = [random_motion(plan.joints, rng, plan.speed) for _ in range(2)]
    still = dataclasses.replace(physics, pushes=())  # nobody pushes in the test recording
    train = run(physics, motions[0], TRAIN_SECONDS + DELAY, plan.rate)
    test = run(still, motions[1], TEST_SECONDS + DELAY, plan.rate)
    frames = [record(trace, plan, np.random.default_rng((seed, k))) for k, trace in enumerate((train, test))]
    truth = Truth(plan.hidden, plan.joint, plan.tendon, also=ALSO)
    return Case(nominal, frames[0], frames[1], truth)


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
        load_friction=np.full(n, 1e-4 if plan.loaded else 0.0),
        damping=rng.uniform(0.001, 0.003, n),
        cover=rng.uniform(0.015, 0.03, n),
        rest_angle=rng.uniform(-0.05, 0.1, n),
        spatial=plan.spatial,
    )


def describe(physics: Physics, plan: Plan, rng: np.random.Generator) -> Nominal:
    """The description with rough numbers; without what is hidden, if that is a part of the description."""
    joints: list[dict[str, Any]] = []
    for j in range(physics.joints):
        friction = law(physics.joint_friction[j], 0.1, rng, viscous=physics.damping[j])
        cover = {"stiffness": rough(physics.cover[j], rng), "rest_angle": rough(physics.rest_angle[j], rng)}
        joints.append({"friction": friction, "cover": cover})
        if plan.loaded:
            # the law counts all tendons, the joint feels those that cross it
            crossing = float((physics.arms[:, j] != 0.0).mean())
            joints[j]["load_friction"] = law(crossing * physics.load_friction[j], 0.1, rng)
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
    return take_out(description(f"mujoco_{plan.joints}", joints, tendons), plan)


def take_out(nominal: Nominal, plan: Plan) -> Nominal:
    nominal = copy.deepcopy(nominal)
    if plan.hidden == "cover_stiffness" and plan.joint:
        del nominal["joints"][plan.joint - 1]["cover"]
    elif plan.hidden == "joint_friction" and plan.joint:
        del nominal["joints"][plan.joint - 1]["friction"]
    elif plan.hidden == "viscous_friction":
        for joint in nominal["joints"]:
            joint["friction"]["viscous"] = 0.0
    elif plan.hidden == "edge_friction" and plan.joint and plan.tendon:
        nominal["tendons"][plan.tendon - 1]["edge_friction"][plan.joint - 1] = None
    return nominal


def measured_force(trace: Trace, plan: Plan) -> Array:
    """Forces as the sensors give them, but for noise [N]: late, or off by a constant, where that is hidden."""
    force: Array = trace.force.copy()
    if plan.hidden == "time_delay":
        late = round(DELAY * plan.rate)
        force[late:] = trace.force[:-late]
    if plan.hidden == "force_offset" and plan.tendon:
        force[:, plan.tendon - 1] += OFFSET
    return force


def record(trace: Trace, plan: Plan, rng: np.random.Generator) -> pd.DataFrame:
    """The recording: 20 mN of noise, positions to 1 µm, angles to 0.1 mrad; from the first late force on."""
    rows = slice(round(DELAY * plan.rate), None)
    force = noisy(measured_force(trace, plan), 0.02, rng)[rows]
    position, angle = quantised(trace.position[rows], 1e-6), quantised(trace.angle[rows], 1e-4)
    return frame(trace.time[rows] - trace.time[rows][0], force, position, angle)
