"""Where a finger has friction: each effect with its place, the motion that drives it, and its numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.model.balance import moment_arms
from tendonfmu.model.description import Law
from tendonfmu.model.description_numbers import number_of


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
    """Return the velocity that slides an effect."""
    # joint_velocity: [N, n] (rad/s); returns [N] (rad/s)
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
