"""What the simulators share: a finger's true numbers, what it hides, its rough description, and its recording."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

Array = npt.NDArray[np.float64]
Nominal = dict[str, Any]

NONE = "none"
CREEP = 2.0  # s, memory of a cover that creeps
FORCE_NOISE, POSITION_NOISE, ANGLE_NOISE = 0.02, 1e-6, 1e-4  # N, m, rad rms of each sample


@dataclasses.dataclass(frozen=True)
class Hidden:
    """One effect that the description lacks. Places count from 1; None: the whole finger."""

    effect: str = NONE  # of docs/reference/commands/diagnose.md, `none`, or `unknown_*` for what is on no list
    joint: int | None = None
    tendon: int | None = None
    size: float = 0.0  # in the unit of the description's number
    second: float = 0.0  # what else it takes: a time constant, a phase, a velocity, a frequency

    @property
    def i(self) -> int:
        """Its tendon from 0."""
        return (self.tendon or 1) - 1

    @property
    def j(self) -> int:
        """Its joint from 0."""
        return (self.joint or 1) - 1

    def at(self, effect: str) -> float:
        """Its size if it is this effect, else 0."""
        return self.size if self.effect == effect else 0.0


@dataclasses.dataclass(frozen=True)
class Finger:
    """True numbers of a finger with n joints and m tendons."""

    arms: Array  # [m, n] m
    stiffness: Array  # [m] N/m, from the motor to the last joint
    edge: Array  # [m, n] share of the force that is lost before a joint
    friction: Array  # [n] N·m
    damping: Array  # [n] N·m·s/rad
    cover: Array  # [n] N·m/rad
    rest: Array  # [n] rad
    pretension: float  # N
    stiffening: float = 0.0  # of the tendons' springs at the pretension, over their stiffness

    @property
    def springs(self) -> tuple[Array, Array]:
        """[m] stiffness N/m and hardening N/m² of springs whose force is stiffness·e + hardening·e²."""
        usual = self.pretension / self.stiffness
        hard = self.stiffening * self.stiffness / usual
        return self.stiffness - hard * usual, hard


@dataclasses.dataclass(frozen=True)
class Trace:
    """True signals of a run, a row a sample."""

    time: Array  # [N] s, from 0
    angle: Array  # [N, n] rad
    force: Array  # [N, m] N, before the first edge
    position: Array  # [N, m] m, of the motors


def finger(joints: int, rng: np.random.Generator, stiffening: float = 0.0, pretension: float = 18.0) -> Finger:
    """Two tendons a joint, an antagonistic pair each, which cross all joints before theirs."""
    n, m = joints, 2 * joints
    arms = np.zeros((m, n))
    for i in range(m):
        for j in range(i // 2 + 1):
            arms[i, j] = (1.0 if i % 2 == 0 else -1.0) * (-1.0) ** (i // 2 - j) * rng.uniform(0.0068, 0.0095)
    return Finger(
        arms=arms,
        stiffness=rng.uniform(3000.0, 5000.0, m),
        edge=np.where(arms != 0.0, rng.uniform(0.025, 0.05, (m, n)), 0.0),
        friction=rng.uniform(0.001, 0.003, n),
        damping=rng.uniform(0.0005, 0.002, n),
        cover=rng.uniform(0.015, 0.035, n),
        rest=rng.uniform(-0.05, 0.1, n),
        pretension=pretension,
        stiffening=stiffening,
    )


# --- what is hidden ---------------------------------------------------------------------------------------------------


def edge_factor(hidden: Hidden, time: float, angle: Array, speed: Array, load: Array) -> Array:
    """[m, n] by which hidden effects multiply what edges rub; speed [m, n] m/s and load [m, n] N at the edges."""
    factor = np.ones_like(load)
    if hidden.effect == "edge_friction":  # grows as the joint before bends the tendon round the edge
        before = np.concatenate([[0.0], np.maximum(angle[:-1], 0.0)])
        growth = np.broadcast_to(1.0 + hidden.size * before, load.shape)
        factor = np.where(is_at(hidden, load.shape), growth, factor)
    elif hidden.effect == "friction_drift":
        factor = factor * drift(hidden, time)
    elif hidden.effect == "stribeck":
        factor = 1.0 + hidden.size * np.exp(-np.abs(speed) / hidden.second)
    elif hidden.effect == "preload_friction":
        factor[hidden.i, 0] = 1.0
    return factor


def is_at(hidden: Hidden, shape: tuple[int, ...]) -> npt.NDArray[np.bool_]:
    """[m, n] where a hidden effect at edges sits."""
    here = np.ones(shape, dtype=bool)
    if hidden.tendon is not None:
        here[np.arange(shape[0]) != hidden.i] = False
    if hidden.joint is not None:
        here[:, np.arange(shape[1]) != hidden.j] = False
    return here


def drift(hidden: Hidden, time: float) -> float:
    """Factor of all friction at a time since the machine was switched on."""
    amplitude = hidden.at("friction_drift")
    return 1.0 + amplitude * (1.0 - np.exp(-max(time, 0.0) / hidden.second)) if amplitude else 1.0


def extra_torque(hidden: Hidden, time: Array, angle: Array, velocity: Array, crept: Array) -> Array:
    """[N, n] N·m that the tendons hold in addition; crept [N, n] rad: angles as a cover with a memory has them."""
    torque, j = np.zeros_like(angle), hidden.j
    q = angle[:, j]
    if hidden.effect == "gravity":
        torque[:, : j + 1] = (hidden.size * np.sin(angle[:, : j + 1].sum(axis=1) + hidden.second))[:, None]
    elif hidden.effect == "cover_stiffness":
        torque[:, j] = hidden.size * (q - hidden.second)
    elif hidden.effect == "cover_hardening":
        torque[:, j] = hidden.size * q**3
    elif hidden.effect == "joint_coupling":
        pull = hidden.size * (q - angle[:, j + 1])
        torque[:, j], torque[:, j + 1] = pull, -pull
    elif hidden.effect == "viscous_friction":
        torque[:, j] = hidden.size * velocity[:, j]
    elif hidden.effect == "unknown_hum":
        torque[:, j] = hidden.size * np.sin(2 * np.pi * hidden.second * time)
    elif hidden.effect == "unknown_creep":
        torque[:, j] = hidden.size * (q - crept[:, j])
    elif hidden.effect == "unknown_catch":
        torque[:, j] = hidden.size * (velocity[:, j] > 0.0) * np.exp(-(((q - hidden.second) / 0.06) ** 2))
    return torque


def true_arms(arms: Array, hidden: Hidden) -> Array:
    if hidden.effect != "moment_arm":
        return arms
    changed: Array = arms.copy()
    changed[hidden.i, hidden.j] += hidden.size
    return changed


def hardening(hidden: Hidden, tendons: int) -> Array:
    """[m] N/m² of springs whose force is stiffness·e + hardening·e²."""
    made = np.zeros(tendons)
    if hidden.effect == "tendon_nonlinearity":
        made[hidden.i] = hidden.size
    return made


# --- recording and description ----------------------------------------------------------------------------------------


def record(trace: Trace, hidden: Hidden, rng: np.random.Generator | None) -> pd.DataFrame:
    """What the sensors give, with the hidden effects of sensors, and with noise if there is a source of it."""
    force, position, angle = trace.force.copy(), trace.position.copy(), trace.angle.copy()
    if hidden.effect == "time_delay":
        late = trace.time - hidden.size
        force = np.column_stack([np.interp(late, trace.time, column) for column in force.T])
    elif hidden.effect == "force_gain":  # the true force is (1 + size) times the measured one
        force[:, hidden.i] /= 1.0 + hidden.size
    elif hidden.effect == "zero":
        position[:, hidden.i] += hidden.size
    elif hidden.effect == "encoder_offset":
        angle[:, hidden.j] += hidden.size
    columns = {"time": trace.time}
    for name, values, noise in (
        ("tendon_force", force, FORCE_NOISE),
        ("tendon_position", position, POSITION_NOISE),
        ("joint_position", angle, ANGLE_NOISE),
    ):
        noisy = values + noise * rng.standard_normal(values.shape) if rng else values
        columns |= {f"{name}[{k + 1}]": noisy[:, k] for k in range(values.shape[1])}
    made: pd.DataFrame = pd.DataFrame(columns)
    return made


def describe(made: Finger, hidden: Hidden, rng: np.random.Generator) -> Nominal:
    """The right structure but for what is hidden; kinematics as described to the mechanic, friction rough."""
    joints = []
    for j, cover in enumerate(made.cover.tolist()):
        viscous = 0.0 if hidden.effect == "viscous_friction" and hidden.joint == j + 1 else made.damping[j]
        joint: Nominal = {"name": f"joint_{j + 1}", "friction": law(made.friction[j], 0.1, rng, viscous)}
        if not (hidden.effect == "cover_stiffness" and hidden.joint == j + 1):
            joint["cover"] = {"stiffness": rough(cover, rng), "rest_angle": rough(made.rest[j], rng)}
        joints.append(joint)
    soft, hard = made.springs
    stiffens = hard * (hardening(hidden, len(hard)) == 0.0)  # what is hidden is left out altogether
    stiffness = np.where(stiffens > 0.0, soft, made.stiffness)
    tendons = [
        {
            "name": f"tendon_{i + 1}",
            "stiffness": float(stiffness[i]),
            "moment_arms": arms.tolist(),
            "edge_friction": [law(share, 0.005, rng) if share > 0.0 else None for share in made.edge[i]],
        }
        for i, arms in enumerate(made.arms)
    ]
    return {
        "format": "tendonfmu-finger-1",
        "name": "finger",
        "joints": joints,
        "tendons": tendons,
        "velocity_threshold": {"tendon": 0.0005, "joint": 0.01},
        "velocity_filter_cutoff": 20.0,
        "contact": {"threshold": [0.03] * len(joints)},
        "extensions": [
            {"effect": "tendon_nonlinearity", "tendon": i + 1, "hardening": float(stiffens[i])}
            for i in np.flatnonzero(stiffens)
        ],
    }


def rough(value: float, rng: np.random.Generator) -> float:
    """A starting number: the true one times a factor of 0.6 to 1.6, even in its logarithm."""
    return float(f"{value * np.exp(rng.uniform(np.log(0.6), np.log(1.6))):.3g}")


def law(magnitude: float, speed: float, rng: np.random.Generator, viscous: float = 0.0) -> Nominal:
    coulomb = rough(float(magnitude), rng)
    damping = rough(float(viscous), rng) if viscous else 0.0
    return {"static": coulomb, "coulomb": coulomb, "stribeck_velocity": speed, "viscous": damping}
