"""The friction effects of a finger, each with where it acts, what drives it and which numbers it has."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.balance import moment_arms
from tendonfmu.description import Law
from tendonfmu.description_numbers import number_of

Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class Effect:
    """One F_A, F_B, T_jv0 or T_jvf.

    path: as in the description, such as "tendons[1].edge_friction[2]". kind: its key there. joint, tendon: from 1;
        tendon 0 for friction in a joint. drive: the joint whose ẋ_ij or q̇_j slides it.
    angles: [k] rad, working points over the angle of joint `joint` − 1; empty for a single law. laws: as many, or one.
    """

    path: str
    kind: str
    joint: int
    tendon: int
    drive: int
    angles: tuple[float, ...]
    laws: tuple[Law, ...]

    @property
    def law_paths(self) -> list[str]:
        """[k] paths of the laws of the working points, or the effect's own path."""
        return [f"{self.path}.laws[{k}]" for k in range(1, len(self.laws) + 1)] if self.angles else [self.path]


def effects(data: Mapping[str, Any]) -> list[Effect]:
    """All friction effects of a valid description that can slide at all."""
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
    """v_min of an effect, m/s or rad/s."""
    return number_of(data, f"velocity_threshold.{'tendon' if effect.tendon else 'joint'}")


def sliding_velocity(data: Mapping[str, Any], effect: Effect, joint_velocity: Numbers) -> Numbers:
    """[N] ẋ_ij (m/s, eq. 5) of a tendon's effect, q̇_j (rad/s) of a joint's. joint_velocity: [N, n]."""
    if not effect.tendon:
        return joint_velocity[:, effect.drive - 1]
    arms = moment_arms(data)[effect.tendon - 1]
    return np.asarray(joint_velocity[:, effect.drive - 1 :] @ arms[effect.drive - 1 :])


def working_point_weights(effect: Effect, joint_position: Numbers) -> Numbers:
    """[N, k] share of each law in the value at each sample, by linear interpolation; ones for a single law.

    joint_position: [N, n] rad. q_0 = 0.
    """
    if not effect.angles:
        return np.ones((len(joint_position), 1))
    angle = joint_position[:, effect.joint - 2] if effect.joint > 1 else np.zeros(len(joint_position))
    unit = np.eye(len(effect.angles))
    return np.column_stack([np.interp(angle, effect.angles, row) for row in unit])
