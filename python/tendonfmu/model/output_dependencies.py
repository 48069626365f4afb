"""Which inputs can affect which outputs: the dependencies in the FMU's ModelStructure.

They follow from the finger's structure: which friction exists, which tendon passes which joint (a moment arm of 0 means
that it does not), and which angles R⁺ computes from which tendon. They hold for all three kinematics sources and all
values of the tunable parameters. Branch decisions count as fixed: a contact elsewhere can stop the bias of a joint, but
this is not a dependency.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tendonfmu.model import native
from tendonfmu.model.description import Finger
from tendonfmu.model.description_numbers import extension_rows
from tendonfmu.model.output_names import PLACE, SENSORS, VECTORS

# Extensions whose torque at their joint follows from its angle, or from its velocity.
BY_OWN_ANGLE = frozenset({"cover_hardening", "moment_arm_variation", "pulley_eccentricity"})
BY_OWN_VELOCITY = frozenset({"inertia", "load_friction"})

# Inputs that a kinematics source uses
INPUTS_OF_SOURCE = {
    1: ("tendon_force", "tendon_position"),
    2: ("tendon_force", "joint_position"),
    3: ("tendon_force", "joint_position", "joint_velocity"),
}

Dependencies = dict[str, list[dict[str, list[int]]]]


def inputs_used(source: int, watches_motors: bool) -> tuple[str, ...]:
    """Return the inputs that a finger needs."""
    used = INPUTS_OF_SOURCE[source]
    return used if "tendon_position" in used or not watches_motors else (*used, "tendon_position")


def watches_motors(data: Mapping[str, Any]) -> bool:
    """Return whether a finger needs tendon positions with every kinematics source."""
    return bool((data.get("contact") or {}).get("watches_motors")) or data.get("sensor_fault") is not None


@dataclass
class Motion:
    """Joints, 0-based, whose angle or velocity can have an effect."""

    angles: set[int] = field(default_factory=set)
    velocities: set[int] = field(default_factory=set)

    def add(self, other: Motion) -> None:
        self.angles |= other.angles
        self.velocities |= other.velocities


@dataclass(frozen=True)
class Structure:
    """The part of a description that decides on dependencies."""

    data: Mapping[str, Any]  # the description
    passes: np.ndarray[Any, np.dtype[np.bool_]]  # [m, n], true where a tendon has a moment arm
    inverse: np.ndarray[Any, np.dtype[np.bool_]]  # [n, m], true where R⁺ has an entry

    @property
    def tendons(self) -> int:
        return int(self.passes.shape[0])

    @property
    def joints(self) -> int:
        return int(self.passes.shape[1])


def structure_of(description: Finger) -> Structure:
    """Return the structure of a finger."""
    passes = np.array(description.moment_arms) != 0.0
    inverse = _inverse_routing(description.image, *passes.shape) != 0.0
    if description.data.get("sensor_fault") is not None:  # when a sensor is left out, R⁺ changes everywhere
        inverse = np.ones_like(inverse)
    return Structure(description.data, passes, inverse)


def _inverse_routing(image: bytes, tendons: int, joints: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return R⁺ [n, m] of the runtime: the slopes of the joint angles by the tendon positions."""
    finger = native.Instance(image, kinematics_source=1)
    finger.run({"time": np.zeros(1), "tendon_force": np.zeros((1, tendons)), "tendon_position": np.zeros((1, tendons))})
    columns = [finger.directional_derivative({"tendon_position": unit})["joint_angle"] for unit in np.eye(tendons)]
    return np.asarray(np.array(columns).T.reshape(joints, tendons), dtype=np.float64)


def dependencies(structure: Structure) -> Dependencies:
    """Return the inputs that can affect each output."""
    n, m = structure.joints, structure.tendons
    torques = [_torque(structure, j) for j in range(n)]
    by_joint = [_inputs(structure, motion, set(range(m))) for motion in torques]
    everything = Motion()
    for motion in torques:
        everything.add(motion)
    result: Dependencies = {
        "joint_torque": [{"tendon_force": [i for i in range(m) if structure.passes[i, j]]} for j in range(n)],
        "joint_angle": [_inputs(structure, Motion(angles={j}), set()) for j in range(n)],
        "joint_speed": [_inputs(structure, Motion(velocities={j}), set()) for j in range(n)],
        "contact": [_inputs(structure, everything, set(range(m)))],
        "slack": [_slack(structure, i) for i in range(m)],
    }
    if structure.data.get("links") is not None:
        everything.add(Motion(angles=set(range(n))))  # all angles turn the force at the tip
        place = _inputs(structure, everything, set(range(m)))
        result |= {name: [place] * (3 if name in VECTORS else 1) for name in PLACE}
    for name in ("compensated_torque", "compensated_torque_std", "friction_torque", "bias_torque", "residual"):
        result[name] = by_joint
    result |= _of_contact(structure, result)
    return result | _with_sensors(structure, result)


def _of_contact(structure: Structure, others: Dependencies) -> Dependencies:
    """Add, with contact.bands, all motors to the contact of each joint: their load says what friction may do."""
    motors = {"tendon_position": list(range(structure.tendons))} if watches_motors(structure.data) else {}
    names = {"joint_contact": "residual", "contact_level": "residual", "contact": "contact"}
    return {name: [element | motors for element in others[other]] for name, other in names.items()}


def _with_sensors(structure: Structure, others: Dependencies) -> Dependencies:
    """Add, with sensor_fault, all sensors to sensor faults and contact."""
    if structure.data.get("sensor_fault") is None:
        return {}
    tendons, joints = list(range(structure.tendons)), list(range(structure.joints))
    watched = {"tendon_force": tendons, "tendon_position": tendons, "joint_position": joints}
    extended: Dependencies = {
        name: [element | watched for element in elements]
        for name, elements in others.items()
        if name in ("joint_contact", "contact", "contact_level", *PLACE)
    }
    return extended | {SENSORS[0]: [watched] * structure.tendons, SENSORS[1]: [watched]}


def _inputs(structure: Structure, motion: Motion, forces: set[int]) -> dict[str, list[int]]:
    """Return the inputs that determine joint angles and velocities, and forces that have a direct effect."""
    moving = motion.angles | motion.velocities
    tendons = {i for j in moving for i in range(structure.tendons) if structure.inverse[j, i]}
    return {
        "tendon_force": sorted(forces | tendons),
        "tendon_position": sorted(tendons),
        "joint_position": sorted(moving),
        "joint_velocity": sorted(motion.velocities),
    }


def _torque(structure: Structure, j: int) -> Motion:
    """Return the motion that friction and bias of joint j depend on, besides the forces."""
    joint = structure.data["joints"][j]
    motion = Motion()
    if joint.get("cover") is not None:
        motion.angles.add(j)
    for kind in ("friction", "load_friction"):
        if joint.get(kind) is not None:
            motion.velocities.add(j)
    for extension in extension_rows(structure.data):
        motion.add(_extension(structure, extension, j))
    for i in range(structure.tendons):
        if structure.passes[i, j]:  # losses up to this joint's pulley, over the moment arm (eq. 10)
            motion.add(_along_tendon(structure, i, j, j))
        if joint.get("load_friction") is not None:  # f_B before this joint's pulley, in Σ f_B
            motion.add(_along_tendon(structure, i, j, j - 1))
    return motion


def _extension(structure: Structure, extension: Mapping[str, Any], j: int) -> Motion:
    """Return the motion that the torque of an extension at joint j depends on, besides the forces and numbers."""
    effect, place, tendon = extension["effect"], (extension.get("joint") or 0) - 1, (extension.get("tendon") or 0) - 1
    if effect == "gravity":
        return _weight(structure, place, j)
    if effect == "joint_coupling":
        return Motion(angles={place, place + 1}) if j in (place, place + 1) else Motion()
    if effect == "inertia_variation":  # the next joint feels no acceleration of its own
        both = {place, place + 1}
        return Motion({place + 1}, both if j == place else {place}) if j in both else Motion()
    if effect == "preload_friction":  # the directions of the tendon before joint `place`, or before each joint
        first = max(place, 0)
        felt = structure.passes[tendon, j] and j >= first
        return Motion(velocities={k for k in range(first, structure.joints) if felt and structure.passes[tendon, k]})
    if place == j:
        return Motion({j} if effect in BY_OWN_ANGLE else set(), {j} if effect in BY_OWN_VELOCITY else set())
    return Motion()


def _weight(structure: Structure, link: int, j: int) -> Motion:
    """Return the angles that turn a link, if joint j feels its weight."""
    turning = {k for k in range(link + 1) if _axis_cosine(structure, k, link) != 0.0}
    return Motion(angles=turning if j in turning else set())


def _axis_cosine(structure: Structure, joint: int, other: int) -> float:
    """Return the cosine of the angle between two axes, 1 without links."""
    links = structure.data.get("links")
    if links is None:
        return 1.0
    a, b = (_unit(links[k]["axis"]) for k in (joint, other))
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _unit(axis: Sequence[float]) -> list[float]:
    largest = max(abs(float(x)) for x in axis)
    x, y, z = (float(number) / largest for number in axis)
    length = math.sqrt(x * x + y * y + z * z)
    return [x / length, y / length, z / length]


def _along_tendon(structure: Structure, i: int, last_edge: int, last_pulley: int) -> Motion:
    """Return the motion that the losses of tendon i at the edges and pulleys up to these joints depend on."""
    motion = Motion()
    for is_edge, j, varies_with_angle in _effects(structure, i):
        if j > (last_edge if is_edge else last_pulley):
            continue
        # an edge moves with ẋ_j, a pulley with ẋ_{j+1}
        moving = {k for k in range(j if is_edge else j + 1, structure.joints) if structure.passes[i, k]}
        if not moving:  # ẋ is always 0: this effect never acts
            continue
        motion.velocities |= moving
        if varies_with_angle:
            motion.angles.add(j - 1)
    return motion


def _effects(structure: Structure, i: int) -> Iterator[tuple[bool, int, bool]]:
    """Yield (is an edge, its joint, varies with the angle of the joint before) of each effect of a tendon."""
    tendon = structure.data["tendons"][i]
    for j, law in enumerate(tendon.get("pulley_friction") or []):
        if law is not None:
            yield False, j, False
    for j, edge in enumerate(tendon.get("edge_friction") or []):
        if edge is not None:
            yield True, j, j > 0 and len(edge.get("angles") or []) > 1


def _slack(structure: Structure, i: int) -> dict[str, list[int]]:
    """Return the inputs of a tendon's slackness: its own force and all its losses. A cable loop is never slack."""
    if structure.data["tendons"][i].get("bidirectional"):
        return {}
    return _inputs(structure, _along_tendon(structure, i, structure.joints, structure.joints), {i})
