"""Where a finger has friction, and which tendon forces carry it.

Each effect has its place, the motion that drives it, and its numbers. In quasi-static balance Rᵀ f0 = T (eq. 12): the
forces are a pretension that balances itself, and what carries the friction of a motion.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.model import native
from tendonfmu.model.description import Law
from tendonfmu.model.description_numbers import number_of, without_detection

LEAST_SHARE = 0.05  # of the mean; keeps every pulling tendon taut
_SWEEPS = 20000
_ITERATIONS = 8  # each reduces the error to the share of the force that friction takes, some percent


@dataclass(frozen=True)
class Effect:
    """One friction effect: an F_A, F_B, T_jv0 or T_jvf."""

    path: str  # path as in the description, such as "tendons[1].edge_friction[2]"
    kind: str  # its key there
    joint: int  # place, from 1
    tendon: int
    drive: int  # the joint whose ẋ_ij or q̇_j slides it
    angles: tuple[float, ...]  # working points [k] (rad) over the angle of joint `joint` − 1
    laws: tuple[Law, ...]  # one law for each working point, or a single one

    @property
    def law_paths(self) -> list[str]:
        """Paths of the laws of the working points [k], or the effect's own path."""
        return [f"{self.path}.laws[{k}]" for k in range(1, len(self.laws) + 1)] if self.angles else [self.path]


def effects(data: Mapping[str, Any]) -> list[Effect]:
    """Return all friction effects of a description that can slide."""
    return [*_in_joints(data), *_at_tendons(data)]


def _in_joints(data: Mapping[str, Any]) -> Iterator[Effect]:
    for j, joint in enumerate(data["joints"], start=1):
        for kind in ("friction", "load_friction"):
            if joint.get(kind) is not None:
                yield Effect(f"joints[{j}].{kind}", kind, j, 0, j, (), (joint[kind],))


def _at_tendons(data: Mapping[str, Any]) -> Iterator[Effect]:
    last = len(data["joints"])
    for i, tendon in enumerate(data["tendons"], start=1):
        for j, law in enumerate(tendon.get("pulley_friction") or [], start=1):
            if law is not None and j < last:
                yield Effect(f"tendons[{i}].pulley_friction[{j}]", "pulley_friction", j, i, j + 1, (), (law,))
        for j, edge in enumerate(tendon.get("edge_friction") or [], start=1):
            if edge is not None:
                angles, laws = tuple(edge.get("angles") or ()), tuple(edge.get("laws") or (edge,))
                yield Effect(f"tendons[{i}].edge_friction[{j}]", "edge_friction", j, i, j, angles, laws)


def velocity_threshold(data: Mapping[str, Any], effect: Effect) -> float:
    """Return v_min of an effect."""
    return number_of(data, f"velocity_threshold.{'tendon' if effect.tendon else 'joint'}")


def sliding_velocity(data: Mapping[str, Any], effect: Effect, joint_velocity: Numbers) -> Numbers:
    """Return the velocity that slides an effect. joint_velocity: [N, n] (rad/s); returns [N] (rad/s)."""
    if not effect.tendon:
        return joint_velocity[:, effect.drive - 1]
    arms = moment_arms(data)[effect.tendon - 1]
    return np.asarray(joint_velocity[:, effect.drive - 1 :] @ arms[effect.drive - 1 :])


def working_point_weights(effect: Effect, joint_position: Numbers) -> Numbers:
    """Return the weight of each law of an effect in its value, by linear interpolation."""
    # joint_position: [N, n] (rad); returns [N, k]. Ones for a single law
    if not effect.angles:
        return np.ones((len(joint_position), 1))
    angle = joint_position[:, effect.joint - 2] if effect.joint > 1 else np.zeros(len(joint_position))
    unit = np.eye(len(effect.angles))
    return np.column_stack([np.interp(angle, effect.angles, row) for row in unit])


# --- forces in balance ------------------------------------------------------------------------------------------------


def moment_arms(data: Mapping[str, Any]) -> Numbers:
    """Return the routing matrix R [m, n] (m) of a description."""
    return np.array([tendon["moment_arms"] for tendon in data["tendons"]], dtype=float)


def tendon_positions(data: Mapping[str, Any], angle: Numbers, force: Numbers) -> Numbers:
    """Return the readings x0 = zero + R q + f0/k at joint angles and tendon forces."""
    # angle: [N, n] (rad); force: [N, m] (N); returns [N, m] (m)
    stiffness, zero = np.array([(row["stiffness"], row.get("zero") or 0.0) for row in data["tendons"]], dtype=float).T
    return np.asarray(angle @ moment_arms(data).T + force / stiffness + zero)


def pretension_vector(data: Mapping[str, Any]) -> Numbers:
    """Return the tendon forces [m] per newton of pretension."""
    arms = moment_arms(data)
    pulls = np.array([not tendon.get("bidirectional") for tendon in data["tendons"]])
    project = np.eye(len(arms)) - arms @ np.linalg.pinv(arms)
    shares = project @ np.ones(len(arms))
    least = np.where(pulls, LEAST_SHARE, -np.inf)
    correction = np.zeros(len(arms))
    for _ in range(_SWEEPS):
        if np.all(shares >= least * (1 - 1e-9)):
            break
        allowed = np.maximum(shares + correction, least)
        correction += shares - allowed
        shares = project @ allowed
    else:
        raise InputError(
            "tendons: no balanced pretension; expected moment arms with a solution of "
            "Rᵀ f = 0 in which every tendon pulls"
        )
    mean = float(np.mean(shares))
    return shares / mean if mean > 1e-9 else np.zeros(len(arms))


def without_learning(data: Mapping[str, Any], *kept: str) -> dict[str, Any]:
    """Return a description without contact detection, whose bias keeps some settings and is moved only by jumps."""
    bias: dict[str, Any] = {"drift_variance": 0.0, "initial_variance": 0.0}
    bias["initial_torque"] = [0.0] * len(data["joints"])
    given = data.get("bias") or {}
    bias |= {key: given[key] for key in kept if given.get(key) is not None}
    return {**without_detection(data), "bias": bias}


def without_friction(data: Mapping[str, Any], *kept: str) -> dict[str, Any]:
    """Return a description without friction and covers, but for some keys of its joints and tendons."""
    gone = {"friction", "load_friction", "cover", "pulley_friction", "edge_friction"} - set(kept)
    bare = {
        part: [{key: value for key, value in each.items() if key not in gone} for each in data[part]]
        for part in ("joints", "tendons")
    }
    return {**data, **bare, "extensions": []}


def friction_probe(data: Mapping[str, Any]) -> native.Instance:
    """Make a finger that computes the friction model only."""
    probe = without_learning(data, "noise_std", "noise_std_per_force", "forget_rate", "noise_time")
    return native.Instance.from_description(probe, 3)


def balanced_forces(data: Mapping[str, Any], motion: Mapping[str, Numbers], pretension: Numbers) -> Numbers:
    """Return the tendon forces that carry the friction of a motion: f0 = pretension·ν + (Rᵀ)⁺ T(f0)."""
    # T is eq. (10) of everything that slides, cover included. Sticking places add nothing, since their share is
    # unknown.
    # motion: [N] (s); pretension: [N] (N); returns tendon forces [N, m] (N)
    finger = friction_probe(data)
    start = finger.save_state()
    spread = np.linalg.pinv(moment_arms(data))
    internal = np.outer(pretension, pretension_vector(data)) if pretension.ndim == 1 else pretension
    forces = internal
    for _ in range(_ITERATIONS):
        finger.restore_state(start)
        outputs = finger.run({**motion, "tendon_force": forces})
        forces = internal + (outputs["friction_torque"] - outputs["bias_torque"]) @ spread
    return np.asarray(forces)
