"""What a model has of a finger's joints and tendons that a description does not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.mjcf.compiled_model import CompiledModel, Joint, Tendon
from tendonfmu.mjcf.geometry import WEIGHTLESS, holding_torques
from tendonfmu.mjcf.tendon_choice import is_driven, motors_of, moved_velocities

OF_EVERY_MODEL = "shapes and contacts, the actuators' dynamics, sensors, keyframes: no part of a description"


def left_out(
    model: CompiledModel,
    joints: Sequence[Joint],
    tendons: Sequence[Tendon],
    angles: Numbers,
    has_gravity: bool,
    has_links: bool,
) -> list[str]:
    """List what an import leaves out."""
    # angles: [K, n] (rad)
    rows = [
        *_of_joints(model, joints, angles),
        *_of_tendons(model, joints, tendons, angles),
        *_other_drives(model, joints, tendons),
        *_constraints(model, joints, tendons),
    ]
    if not has_gravity:
        rows += _weight(model, joints, angles)
    if not has_links:
        rows.append("links: the joints' places need a fingertip; --tip names a site, geom or body")
    return [*rows, OF_EVERY_MODEL]


def _of_joints(model: CompiledModel, joints: Sequence[Joint], angles: Numbers) -> Iterator[str]:
    yield from _named("joint", [joint.name for joint in joints if joint.limits], "limits")
    nonlinear = [joint.name for joint in joints if joint.is_nonlinear]
    yield from _named("joint", nonlinear, "stiffness or damping of higher order")
    model.place(joints, (angles.min(axis=0) + angles.max(axis=0)) / 2)
    matrix = model.inertia(joints)
    bare = [j for j, joint in enumerate(joints) if not joint.armature]
    if bare:
        sizes = ", ".join(f"{joints[j].name} {matrix[j, j]:.3g}" for j in bare)
        yield f"inertia of links (kg·m²) at joints without armature: {sizes}"
    aside = np.abs(matrix - np.diag(np.diag(matrix)))
    if aside.max() > 0.0:
        yield f"inertia that couples the joints, and forces of their speeds: up to {aside.max():.3g} kg·m²"


def _of_tendons(
    model: CompiledModel, joints: Sequence[Joint], tendons: Sequence[Tendon], angles: Numbers
) -> Iterator[str]:
    moves = moved_velocities(model, joints, angles)
    own = [joint.velocity for joint in joints]
    yield from _named("tendon", [tendon.name for tendon in tendons if tendon.is_limited], "limits of the length")
    for tendon in tendons:
        if tendon.damping:
            yield f"tendon {tendon.name}: damping {tendon.damping:g} N·s/m: no viscous friction without a tendon force"
        if tendon.armature:
            yield f"tendon {tendon.name}: armature {tendon.armature:g} kg"
        if tendon.stiffness and any(actuator.tendon == tendon.index for actuator in model.actuators):
            yield f"tendon {tendon.name}: spring of {tendon.stiffness:g} N/m beside its actuator"
        motors = motors_of(model, tendon)
        if tendon.frictionloss and motors:
            yield f"tendon {tendon.name}: frictionloss {tendon.frictionloss:g} N of the spring between motor and finger"
        for joint in model.joints:
            if joint.velocity not in own and moves[tendon.index, joint.velocity] and joint not in motors:
                yield f"tendon {tendon.name}: also moves joint {joint.name}, which is not in --joints"
    for tendon in model.tendons:
        if tendon not in tendons and moves[tendon.index, own].any():
            why = "not in --tendons" if is_driven(model, tendon) else "without a drive; --tendons takes it"
            yield f"tendon {tendon.name or tendon.index + 1}: {why}"


def _other_drives(model: CompiledModel, joints: Sequence[Joint], tendons: Sequence[Tendon]) -> Iterator[str]:
    for actuator in model.actuators:
        for joint in joints:
            if actuator.joint == joint.index:
                yield f"actuator {actuator.name}: drives joint {joint.name} without a tendon"


def _constraints(model: CompiledModel, joints: Sequence[Joint], tendons: Sequence[Tendon]) -> Iterator[str]:
    own = {"joint": {joint.index for joint in joints}, "tendon": {tendon.index for tendon in tendons}}
    names = {"joint": [joint.name for joint in model.joints], "tendon": [tendon.name for tendon in model.tendons]}
    for name, kind, ends in model.equalities():
        if own[kind] & set(ends):
            yield f"constraint {name}: couples {kind} {' and '.join(names[kind][end] for end in ends)}"


def _weight(model: CompiledModel, joints: Sequence[Joint], angles: Numbers) -> Iterator[str]:
    largest = np.abs(holding_torques(model, joints, angles)).max(axis=0)
    if largest.max() > WEIGHTLESS:
        sizes = ", ".join(f"{joint.name} {1e3 * size:.3g}" for joint, size in zip(joints, largest, strict=True))
        yield f"weight of the links, at most (mN·m): {sizes}; --gravity takes it"


def _named(kind: str, names: Sequence[str], what: str) -> Iterator[str]:
    if names:
        yield f"{kind} {', '.join(names)}: {what}"
