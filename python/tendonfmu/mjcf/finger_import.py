"""A finger description made from joints and tendons of a MuJoCo model, and what of the model it does not have."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.files import counted
from tendonfmu.mjcf.compiled_model import CompiledModel, Joint, Tendon
from tendonfmu.mjcf.finger_parts import (
    WEIGHTLESS,
    LinkGeometry,
    MomentArm,
    choose_tendons,
    drives_of,
    gravity_rows,
    holding_torques,
    is_driven,
    link_geometry,
    moment_arms,
    motors_of,
    moved_velocities,
    sampled_angles,
    stiffness_of,
)
from tendonfmu.model import native
from tendonfmu.options import ImportOptions

FORMAT = "tendonfmu-finger-1"
UNLIMITED = 1.0  # rad (m); range on both sides of the reference of a joint without limits
STRIBECK = 0.1  # rad/s; without effect as long as static equals coulomb
LONGEST_ARM = 0.3  # m; larger coefficients of fixed tendons are no lengths, such as 1 where joints are coupled
MISSED = 0.02  # share of the largest holding torque that `gravity` rows may miss without a warning
OF_EVERY_MODEL = (
    "limits, terms of higher order, shapes and contacts, the actuators' dynamics, sensors, keyframes: no part of a "
    "description"
)


@dataclass(frozen=True)
class ImportedFinger:
    """A description made from a model."""

    data: dict[str, Any]  # the description
    notes: list[str]  # where numbers come from that the model has in another form
    warnings: list[str]  # what the description has less exactly than the model, with figures
    left_out: list[str]  # what of these joints and tendons the description does not have

    def report(self, model: Path, output: Path) -> dict[str, Any]:
        """Return what was done, for `--json`. output: the file of the description."""
        return {
            "format": "tendonfmu-import-1",
            "model": str(model),
            "finger": str(output),
            "joints": [joint["name"] for joint in self.data["joints"]],
            "tendons": [tendon["name"] for tendon in self.data["tendons"]],
            "notes": self.notes,
            "warnings": self.warnings,
            "left_out": self.left_out,
        }


def import_finger(path: Path, settings: ImportOptions) -> ImportedFinger:
    """Make a finger description from a MuJoCo model."""
    model = CompiledModel(path)
    joints = _chain(model, _names(settings.joints))
    ranges, notes = joint_ranges(model, joints, dict(map(_range, settings.range_)))
    angles = sampled_angles(ranges)
    tendons = choose_tendons(model, joints, angles, _names(settings.tendons) or None)
    for name in _names(settings.bidirectional):
        if model.tendon_named(name) not in tendons:
            raise InputError(f"{path}: --bidirectional {name}: no such tendon; expected one of the finger's")
    arms = moment_arms(model, joints, tendons, angles, settings.arm_tolerance)
    _check_moved(model, joints, arms)
    links = None if settings.tip is None else _links(model, joints, settings.tip)
    weight, warnings = _weight(model, joints, angles, links) if settings.gravity else ([], [])
    rows = [*_tendon_rows(model, tendons, arms), *_inertia_rows(model, joints), *weight]
    data: dict[str, Any] = {
        "format": FORMAT,
        "name": settings.name or model.name,
        "joints": [_joint(joint) for joint in joints],
        "tendons": [_tendon(model, tendon, row, settings) for tendon, row in zip(tendons, arms, strict=True)],
        "contact": {"threshold": [settings.threshold] * len(joints)},
    }
    if rows:
        data["extensions"] = rows
    if links is not None:
        data |= {"links": links.links, "tip": links.tip}
    _check_accepted(model, data)
    return ImportedFinger(
        data=data,
        notes=[*notes, *_sources(model, joints, tendons, settings)],
        warnings=[*_arm_warnings(joints, tendons, arms, ranges, settings.arm_tolerance), *warnings],
        left_out=left_out(model, joints, tendons, angles, settings.gravity, links is not None),
    )


def _names(texts: Sequence[str]) -> list[str]:
    """Return the names of an option that may be repeated and may hold several names."""
    return [name.strip() for text in texts for name in text.split(",") if name.strip()]


def _range(text: str) -> tuple[str, tuple[float, float]]:
    joint, _, limits = text.rpartition("=")
    low, _, high = limits.partition(":")
    try:
        span = float(low), float(high)
    except ValueError:
        raise InputError(f"--range {text}: expected JOINT=LOW:HIGH in rad, such as mcp=-0.3:1.4") from None
    if not joint or not -1e6 < span[0] < span[1] < 1e6:
        raise InputError(f"--range {text}: expected JOINT=LOW:HIGH with LOW below HIGH, in rad")
    return joint, span


# --- joints -----------------------------------------------------------------------------------------------------------


def _chain(model: CompiledModel, names: Sequence[str]) -> list[Joint]:
    """Return the joints of these names. They must be hinges or slides on one chain, base first."""
    joints = [model.joint_named(name) for name in names or _only_chain(model)]
    for joint in joints:
        if joint.kind not in ("hinge", "slide"):
            raise InputError(f"{model.path}: joint {joint.name}: a {joint.kind} joint; expected a hinge or a slide")
        if names.count(joint.name) > 1:
            raise InputError(f"{model.path}: joint {joint.name}: given twice; expected once")
    for before, after in pairwise(joints):
        if _carries(model, before, after):
            continue
        if _carries(model, after, before):
            what = f"joint {after.name}: carries joint {before.name}, which is given before it"
            raise InputError(f"{model.path}: {what}; expected the joints base first")
        what = f"joint {after.name}: not carried by joint {before.name}"
        raise InputError(f"{model.path}: {what}; expected one chain of joints")
    return joints


def _only_chain(model: CompiledModel) -> list[str]:
    """Return the names of the joints that driven tendons move, base first, if they are one chain."""
    joints = [joint for joint in model.joints if joint.kind in ("hinge", "slide") and joint.name]
    driven = [tendon for tendon in model.tendons if is_driven(model, tendon)]
    if not driven:
        none = f"{counted(len(model.tendons), 'tendon')}, none with an actuator or a motor on a slide"
        raise InputError(f"{model.path}: {none}; expected tendons that pull, or --tendons and --joints")
    motors = {joint.index for tendon in driven for joint in motors_of(model, tendon)}
    joints = [joint for joint in joints if joint.index not in motors]
    angles = np.random.default_rng(0).uniform(-0.3, 0.3, (8, len(joints)))
    moved = moved_velocities(model, joints, angles)[[tendon.index for tendon in driven]]
    joints = [joint for joint in joints if moved[:, joint.velocity].any()]
    ends = [joint for joint in joints if not any(_carries(model, joint, other) for other in joints)]
    chains = [[joint.name for joint in joints if joint == end or _carries(model, joint, end)] for end in ends]
    if len(chains) != 1:
        listed = "; ".join(",".join(chain) for chain in chains) or "none that a driven tendon moves"
        there = f"{counted(len(chains), 'chain')} of joints: {listed}"
        raise InputError(f"{model.path}: {there}; expected --joints with one")
    return chains[0]


def _carries(model: CompiledModel, base: Joint, other: Joint) -> bool:
    if base.body == other.body:
        return base.index < other.index
    return base.body in model.ancestors(other.body)


def joint_ranges(
    model: CompiledModel, joints: Sequence[Joint], given: Mapping[str, tuple[float, float]]
) -> tuple[Numbers, list[str]]:
    """Return the ranges of joints [n, 2] (rad)."""
    names = [joint.name for joint in joints]
    for name in given:
        if name not in names:
            raise InputError(f"--range {name}: no such joint; expected one of {', '.join(names)}")
    ranges, notes = [], []
    for joint in joints:
        if joint.name not in given and joint.limits is None:
            notes.append(f"joint {joint.name}: no limits in the model, ±{UNLIMITED:g} taken; --range sets others")
        ranges.append(given.get(joint.name) or joint.limits or (-UNLIMITED, UNLIMITED))
    return np.array(ranges), notes


def _joint(joint: Joint) -> dict[str, Any]:
    row: dict[str, Any] = {"name": joint.name}
    if joint.stiffness:
        row["cover"] = {"stiffness": joint.stiffness, "rest_angle": joint.rest}
    if joint.frictionloss or joint.damping:
        loss = joint.frictionloss
        row["friction"] = {"static": loss, "coulomb": loss, "stribeck_velocity": STRIBECK, "viscous": joint.damping}
    return row


def _inertia_rows(model: CompiledModel, joints: Sequence[Joint]) -> Iterator[dict[str, Any]]:
    """Yield the inertia, armature and links, of joints with armature."""
    own = links_inertia(model, joints)
    for j, joint in enumerate(joints):
        if joint.armature:
            yield {"effect": "inertia", "joint": j + 1, "inertia": float(joint.armature + own[j])}


def links_inertia(model: CompiledModel, joints: Sequence[Joint]) -> Numbers:
    """Return the links' inertia about each joint, in the middle of the model's joint ranges."""
    # returns [n] (kg·m²), without armature
    ranges, _ = joint_ranges(model, joints, {})
    model.place(joints, ranges.mean(axis=1))
    return np.array(np.diag(model.inertia(joints)), dtype=np.float64)


# --- tendons ----------------------------------------------------------------------------------------------------------


def _check_moved(model: CompiledModel, joints: Sequence[Joint], arms: Sequence[Sequence[MomentArm]]) -> None:
    for j, joint in enumerate(joints):
        if all(row[j].arm == 0.0 for row in arms):
            expected = "more tendons (--tendons, springs too), or to leave the joint out"
            raise InputError(f"{model.path}: joint {joint.name}: moved by none of the tendons; expected {expected}")


def _tendon(model: CompiledModel, tendon: Tendon, arms: Sequence[MomentArm], settings: ImportOptions) -> dict[str, Any]:
    stiffness, _ = stiffness_of(model, tendon, settings.stiffness)
    row = {"name": tendon.name, "stiffness": stiffness, "moment_arms": [arm.arm for arm in arms]}
    return row | ({"bidirectional": True} if tendon.name in _names(settings.bidirectional) else {})


def _tendon_rows(
    model: CompiledModel, tendons: Sequence[Tendon], arms: Sequence[Sequence[MomentArm]]
) -> Iterator[dict[str, Any]]:
    """Yield extensions: arms that vary with the angle, and friction that does not depend on the force."""
    for i, row in enumerate(arms):
        for j, arm in enumerate(row):
            if arm.slope:
                yield {"effect": "moment_arm_variation", "joint": j + 1, "tendon": i + 1, "slope": arm.slope}
    for i, tendon in enumerate(tendons):
        first = next((j for j, arm in enumerate(arms[i], start=1) if arm.arm != 0.0), None)
        if tendon.frictionloss and first is not None and not motors_of(model, tendon):
            yield {"effect": "preload_friction", "joint": first, "tendon": i + 1, "coulomb": tendon.frictionloss}


def _arm_warnings(
    joints: Sequence[Joint],
    tendons: Sequence[Tendon],
    arms: Sequence[Sequence[MomentArm]],
    ranges: Numbers,
    tolerance: float,
) -> Iterator[str]:
    varying = False
    for tendon, row in zip(tendons, arms, strict=True):
        largest = max(abs(arm.arm) for arm in row)
        if not tendon.is_spatial and largest > LONGEST_ARM:
            what = f"a fixed tendon with coefficients up to {largest:g}, which count as moment arms in m"
            yield f"tendon {tendon.name}: {what}; expected lengths, or forces that are torques"
        for joint, arm, (low, high) in zip(joints, row, ranges, strict=True):
            if arm.varies <= tolerance:
                continue
            varying = True
            what = (
                f"moment_arm_variation leaves {100 * arm.left:.1f} %"
                if arm.slope
                else "no line in this joint's angle describes it: the mean is taken"
            )
            yield (
                f"tendon {tendon.name}, joint {joint.name}: moment arm {1e3 * arm.low:.4g} to {1e3 * arm.high:.4g} mm "
                f"over {low:.3g} to {high:.3g} rad, {100 * arm.varies:.1f} % from a constant; {what}"
            )
    if varying:
        yield "angles made of tendon positions take constant moment arms: record joint angles, use --kinematics 2"


def _sources(
    model: CompiledModel, joints: Sequence[Joint], tendons: Sequence[Tendon], settings: ImportOptions
) -> Iterator[str]:
    sources: dict[str, list[str]] = {}
    for tendon in tendons:
        sources.setdefault(stiffness_of(model, tendon, settings.stiffness)[1], []).append(tendon.name)
    for source, names in sources.items():
        yield f"tendon {', '.join(names)}: stiffness {source}"
    for tendon in tendons:
        yield from (f"tendon {tendon.name}: {drive}" for drive in drives_of(model, tendon))
    damped = [joint.name for joint in joints if joint.damping and not joint.frictionloss]
    if damped:
        yield f"joint {', '.join(damped)}: damping without frictionloss, so coulomb is 0; `fit` needs a value above 0"
    bare = [joint.name for joint in joints if not joint.frictionloss and not joint.damping]
    if bare:
        yield f"joint {', '.join(bare)}: neither frictionloss nor damping, so no friction in the description"


# --- the whole --------------------------------------------------------------------------------------------------------


def _links(model: CompiledModel, joints: Sequence[Joint], tip: str) -> LinkGeometry:
    for joint in joints:
        if joint.kind != "hinge":
            raise InputError(f"{model.path}: --tip: joint {joint.name} is a {joint.kind}; expected a hinge")
    return link_geometry(model, joints, tip)


def _weight(
    model: CompiledModel, joints: Sequence[Joint], angles: Numbers, links: LinkGeometry | None
) -> tuple[list[dict[str, Any]], list[str]]:
    """Return rows `gravity`, and a warning where they miss much of the weight."""
    torques = holding_torques(model, joints, angles)
    rows, missed = gravity_rows(angles, torques, None if links is None else links.axes)
    largest = float(np.abs(torques).max())
    if missed <= MISSED * largest:
        return rows, []
    reason = "with --tip the axes' directions are taken into account" if links is None else "the axes are not parallel"
    return rows, [
        f"gravity: the rows miss up to {1e3 * missed:.3g} of {1e3 * largest:.3g} mN·m of the links' weight; {reason}"
    ]


def _check_accepted(model: CompiledModel, data: Mapping[str, Any]) -> None:
    with native.refusals_of(f"{model.path}: these joints and tendons do not make a valid finger"):
        native.image_from_json(json.dumps(data))


# --- what a description does not have ---------------------------------------------------------------------------------


def left_out(
    model: CompiledModel,
    joints: Sequence[Joint],
    tendons: Sequence[Tendon],
    angles: Numbers,
    has_gravity: bool,
    has_links: bool,
) -> list[str]:
    """List what an import leaves out. angles: [K, n] (rad)."""
    rows = [
        *_of_joints(model, joints, angles),
        *_of_tendons(model, joints, tendons, angles),
        *_beside_tendons(model, joints, tendons),
    ]
    if not has_gravity:
        rows += _weight_left_out(model, joints, angles)
    if not has_links:
        rows.append("links: the joints' places need a fingertip; --tip names a site, geom or body")
    return [*rows, OF_EVERY_MODEL]


def _of_joints(model: CompiledModel, joints: Sequence[Joint], angles: Numbers) -> Iterator[str]:
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
    velocities = [joint.velocity for joint in joints]
    for tendon in tendons:
        motors = motors_of(model, tendon)
        if tendon.frictionloss and motors:
            yield f"tendon {tendon.name}: frictionloss {tendon.frictionloss:g} N of the spring between motor and finger"
        driven = any(actuator.tendon == tendon.index for actuator in model.actuators)
        forces = {"spring": (tendon.stiffness * driven, "N/m"), "damping": (tendon.damping, "N·s/m")}
        forces["armature"] = (tendon.armature, "kg")
        beside = ", ".join(f"{what} {size:g} {unit}" for what, (size, unit) in forces.items() if size)
        if beside:
            yield f"tendon {tendon.name}: {beside}; moves the joints beside the drive, and no tendon_force shows it"
        for joint in model.joints:
            if joint.velocity not in velocities and moves[tendon.index, joint.velocity] and joint not in motors:
                yield f"tendon {tendon.name}: also moves joint {joint.name}, which is not in --joints"
    for tendon in model.tendons:
        if tendon not in tendons and moves[tendon.index, velocities].any():
            why = "not in --tendons" if is_driven(model, tendon) else "without a drive; --tendons takes it"
            yield f"tendon {tendon.name or tendon.index + 1}: {why}"


def _beside_tendons(model: CompiledModel, joints: Sequence[Joint], tendons: Sequence[Tendon]) -> Iterator[str]:
    """Yield drives of joints, and constraints of joints or tendons."""
    of_finger = {"joint": {joint.index for joint in joints}, "tendon": {tendon.index for tendon in tendons}}
    names = {"joint": [joint.name for joint in model.joints], "tendon": [tendon.name for tendon in model.tendons]}
    for actuator in model.actuators:
        if actuator.joint in of_finger["joint"]:
            yield f"actuator {actuator.name}: drives joint {names['joint'][actuator.joint]} without a tendon"
    for name, kind, ends in model.equalities():
        if of_finger[kind] & set(ends):
            yield f"constraint {name}: couples {kind} {' and '.join(names[kind][end] for end in ends)}"


def _weight_left_out(model: CompiledModel, joints: Sequence[Joint], angles: Numbers) -> Iterator[str]:
    largest = np.abs(holding_torques(model, joints, angles)).max(axis=0)
    if largest.max() > WEIGHTLESS:
        sizes = ", ".join(f"{joint.name} {1e3 * size:.3g}" for joint, size in zip(joints, largest, strict=True))
        yield f"weight of the links, at most (mN·m): {sizes}; --gravity takes it"
