"""Where a finger has friction: the place of each effect, what drives it, and its numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.model.description_numbers import EFFECT_NUMBERS, Law, extension_rows, number_of


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


# --- numbers ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Number:
    """A number of the description that a fit estimates."""

    path: str  # path in the description
    value: float  # value in SI units
    effect: Effect | None = None  # friction effect that the number belongs to, if any
    point: int = 0  # which of the laws of the effect, from 0
    with_path: str | None = None  # number that moves by the same amount (static where it equals coulomb), if any
    extension: str | None = None  # name of the effect in `extensions` that the number belongs to, if any
    size: float = 1.0  # expected magnitude, where the value may be 0

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of all that moves with it."""
        return (self.path,) if self.with_path is None else (self.path, self.with_path)

    @property
    def kind(self) -> str:
        """What the number belongs to: edge_friction, cover, bias, extensions.gravity."""
        if self.effect is not None:
            return self.effect.kind
        if self.extension is not None:
            return f"extensions.{self.extension}"
        return self.path.rsplit(".", 1)[0].rsplit(".", 1)[-1].split("[")[0]

    @property
    def key(self) -> str:
        """Last part of the path: static, coulomb, stribeck_velocity, viscous, stiffness."""
        return self.path.rsplit(".", 1)[1]

    @property
    def side(self) -> Law:
        """The side of the law that the number belongs to."""
        assert self.effect is not None
        law = self.effect.laws[self.point]
        side: Law = law.get(self.path.split(".")[-2], law)
        return side

    @property
    def reference(self) -> float:
        """Size that steps and errors are relative to: the value, or if that is 0 the static friction of its law."""
        if self.value or self.effect is None:
            return abs(self.value) or self.size
        return float(self.side["static"]) or 1.0


def friction_numbers(data: Mapping[str, Any]) -> list[Number]:
    """List the numbers that a fit estimates, without the biases, which are tracked."""
    numbers = [number for effect in effects(data) for number in _numbers_of(effect)]
    for j, joint in enumerate(data["joints"], start=1):
        stiffness = (joint.get("cover") or {}).get("stiffness")
        if stiffness:
            numbers.append(Number(f"joints[{j}].cover.stiffness", float(stiffness)))
    return [*numbers, *_of_extensions(data)]


def estimable_numbers(data: Mapping[str, Any]) -> list[Number]:
    """List the numbers that a fit of a parsed description may estimate: all present, `bias.initial_torque` last."""
    given = (data.get("bias") or {}).get("initial_torque") or []
    biases = (Number(f"bias.initial_torque[{j}]", float(value)) for j, value in enumerate(given, start=1))
    return [*friction_numbers(data), *biases]


def _numbers_of(effect: Effect) -> Iterator[Number]:
    for point, (path, law) in enumerate(zip(effect.law_paths, effect.laws, strict=True)):
        asymmetric = law.get("positive") is not None
        for side in ("positive", "negative") if asymmetric else ("",):
            values, prefix = (law[side], f"{path}.{side}") if side else (law, path)
            stribeck = values["static"] != values["coulomb"]
            tied = None if stribeck else f"{prefix}.static"
            yield Number(f"{prefix}.coulomb", float(values["coulomb"]), effect, point, tied)
            for key in ("static", "stribeck_velocity") if stribeck else ():
                yield Number(f"{prefix}.{key}", float(values[key]), effect, point)
            if values.get("viscous"):
                yield Number(f"{prefix}.viscous", float(values["viscous"]), effect, point)


def _of_extensions(data: Mapping[str, Any]) -> Iterator[Number]:
    """Yield the numbers of extensions; one with the value that stands for leaving it out is no number of the finger."""
    for k, row in enumerate(extension_rows(data), start=1):
        for name, number in EFFECT_NUMBERS[row["effect"]].items():
            missing = number.missing or 0.0
            value = missing if row.get(name) is None else float(row[name])
            if number.scale and (value != missing or not (missing or row["effect"] == "presliding")):
                yield Number(f"extensions[{k}].{name}", value, extension=row["effect"], size=number.scale)


# --- routing ----------------------------------------------------------------------------------------------------------


def moment_arms(data: Mapping[str, Any]) -> Numbers:
    """Return the routing matrix R [m, n] (m) of a description."""
    return np.array([tendon["moment_arms"] for tendon in data["tendons"]], dtype=float)


def tendon_positions(data: Mapping[str, Any], angle: Numbers, force: Numbers) -> Numbers:
    """Return the readings x0 = zero + R q + f0/k at joint angles and tendon forces."""
    # angle: [N, n] (rad); force: [N, m] (N); returns [N, m] (m)
    stiffness, zero = np.array([(row["stiffness"], row.get("zero") or 0.0) for row in data["tendons"]], dtype=float).T
    return np.asarray(angle @ moment_arms(data).T + force / stiffness + zero)


def without_friction(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return a description without friction and covers."""
    gone = {"friction", "load_friction", "cover", "pulley_friction", "edge_friction"}
    bare = {
        part: [{key: value for key, value in each.items() if key not in gone} for each in data[part]]
        for part in ("joints", "tendons")
    }
    return {**data, **bare, "extensions": []}
