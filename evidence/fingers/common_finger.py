"""A random finger for simulators of any friction law, and what may be hidden in it.

A simulator says how friction builds up (z, from −1 to 1, at each edge and joint); here is how large it may become, and
which torques act beside it. Arrays are (samples, tendons, joints) or (samples, joints); places count from 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from evidence.fingers.foreign import Array, Nominal, description, law, rms, rough

BEND = 0.3  # rad, from which a guide begins to press
SLOW_EDGE, SLOW_JOINT = 0.004, 0.08  # m/s, rad/s: width of the Stribeck effect
CREEP = 2.0  # s

Signals = dict[
    str, Array
]  # time, force, position, angle; hidden: torque [N·m]; seen: rms of what refitting leaves of it


@dataclass(frozen=True)
class Finger:
    """An antagonistic pair of tendons a joint, which cross the joints before theirs."""

    arms: Array  # m, (tendons, joints)
    stiffness: Array  # N/m
    share: Array  # of the tendon force that is lost before a joint, (tendons, joints)
    joint_friction: Array  # N·m
    damping: Array  # N·m·s/rad
    cover: Array  # N·m/rad
    rest: Array  # rad


@dataclass(frozen=True)
class Hidden:
    """What the finger has and its description lacks."""

    effect: str = "none"
    joint: int = 0
    tendon: int = 0
    size: float = 0.0
    numbers: tuple[float, float, float] = (0.0, 0.0, 0.0)  # from −1 to 1: phases, frequencies
    seconds: float = 60.0  # in which friction grows by `size`


@dataclass(frozen=True)
class Motion:
    """Signals of a recording. z: friction at an edge [tendons, joints] and a joint over the most it may be."""

    time: Array  # s
    angle: Array  # rad
    velocity: Array  # rad/s
    speed: Array  # m/s, of a tendon before a joint
    z_edge: Array
    z_joint: Array


def random_finger(joints: int, rng: np.random.Generator) -> Finger:
    m = 2 * joints
    tendon, joint = np.indices((m, joints))
    crossed = (joint <= tendon // 2).astype(float)
    sign = (-1.0) ** (tendon + tendon // 2 - joint)
    return Finger(
        arms=crossed * sign * rng.uniform(0.0068, 0.0095, (m, joints)),
        stiffness=rng.uniform(3000.0, 5000.0, m),
        share=crossed * (np.where(joint == 0, 0.02, 0.015) + rng.uniform(0.0, 0.018, (m, joints))),
        joint_friction=rng.uniform(0.003, 0.008, joints),
        damping=rng.uniform(0.001, 0.003, joints),
        cover=rng.uniform(0.015, 0.03, joints),
        rest=rng.uniform(-0.05, 0.1, joints),
    )  # fmt: skip


def describe(name: str, finger: Finger, rng: np.random.Generator) -> Nominal:
    """All that the finger has when nothing is hidden but how its friction builds up, with rough numbers."""
    joints = [
        {
            "friction": law(finger.joint_friction[j], 0.1, rng, viscous=finger.damping[j]),
            "cover": {"stiffness": rough(finger.cover[j], rng), "rest_angle": rough(finger.rest[j], rng)},
        }
        for j in range(len(finger.cover))
    ]
    tendons = [
        {
            "stiffness": float(finger.stiffness[i]),
            "moment_arms": finger.arms[i].tolist(),
            "edge_friction": [law(share, 0.005, rng) if share else None for share in finger.share[i]],
        }
        for i in range(len(finger.stiffness))
    ]
    return description(name, joints, tendons)


# --- friction and torques ---------------------------------------------------------------------------------------------


def growth(hidden: Hidden, time: Array, speed: Array, slow: float) -> Array:
    """Factor of all friction."""
    if hidden.effect == "friction_drift":
        factor = 1.0 + hidden.size * time / hidden.seconds
        return np.asarray(factor.reshape(-1, *[1] * (speed.ndim - 1)) * np.ones_like(speed))
    if hidden.effect == "stribeck":
        return np.asarray(1.0 + hidden.size * np.exp(-np.abs(speed) / slow))
    return np.ones_like(speed)


def edge_friction(finger: Finger, hidden: Hidden, time: Array, angle: Array, speed: Array, load: Array) -> Array:
    """The most that a tendon of this load [N] may lose before each joint [N]."""
    most = finger.share * load
    j = hidden.joint
    if hidden.effect == "edge_friction":  # bent by the joint before
        bend = np.maximum(angle[:, j - 1] + BEND, 0.0)
        most[:, :, j] += hidden.size * bend[:, None] * load[:, :, j] * (finger.arms[:, j] != 0.0)
    elif hidden.effect == "preload_friction":  # a sheath before the first joint
        most[:, :, 0] += hidden.size
    return most * growth(hidden, time, speed, SLOW_EDGE)


def joint_friction(finger: Finger, hidden: Hidden, time: Array, velocity: Array, force: Array) -> Array:
    """The most friction of each joint [N·m]."""
    most = finger.joint_friction * np.ones_like(velocity)
    if hidden.effect == "joint_load_friction":
        most[:, hidden.joint] += hidden.size * force @ (finger.arms[:, hidden.joint] != 0.0)
    return most * growth(hidden, time, velocity, SLOW_JOINT)


def crept(angle: Array, rate: float) -> Array:
    """Where a cover's rest angle has crept to."""
    share = 1.0 / (CREEP * rate)
    return np.asarray(lfilter([share], [1.0, share - 1.0], angle, axis=0))


def wobble(hidden: Hidden, angle: Array) -> tuple[Array, Array]:
    """Arm [m] that a pulley off its axis adds, and the tendon's travel [m] by it."""
    phase = np.pi * (0.5 + 0.25 * hidden.numbers[0])
    return hidden.size * np.cos(angle + phase), hidden.size * (np.sin(angle + phase) - np.sin(phase))


def hidden_torque(hidden: Hidden, finger: Finger, time: Array, angle: Array, rest: Array, force: Array) -> Array:
    """Torque on the tendons' side of the balance but friction [N·m]; rest: angle that a cover has crept to [rad]."""
    torque, size, j = np.zeros_like(angle), hidden.size, hidden.joint
    here, (a, b, c) = angle[:, j], hidden.numbers
    if hidden.effect == "gravity":
        torque[:, : j + 1] = size * np.sin(angle[:, : j + 1].sum(axis=1) + np.pi * a)[:, None]
    elif hidden.effect == "cover_hardening":
        torque[:, j] = size * (here - finger.rest[j]) ** 3
    elif hidden.effect == "joint_coupling":
        torque[:, j] = size * (here - angle[:, j + 1])
        torque[:, j + 1] = -torque[:, j]
    elif hidden.effect == "pulley_eccentricity":
        torque[:, j] = -wobble(hidden, here)[0] * force[:, hidden.tendon]
    elif hidden.effect == "unknown_product":
        other = angle[:, (j + 1) % angle.shape[1]]
        torque[:, j] = size * np.sin((3 + b) * here + a) * np.cos((3 + c) * other)
    elif hidden.effect == "unknown_hum":
        torque[:, j] = size * np.sin(2 * np.pi * (1.7 + b) * time + np.pi * a)
    elif hidden.effect == "unknown_cross":
        torque[:, (j + 1) % angle.shape[1]] = size * force @ finger.arms[:, j]
    elif hidden.effect == "unknown_creep":
        torque[:, j] = size * (here - rest[:, j])
    return torque


# --- balance of an imposed motion -------------------------------------------------------------------------------------


def lost(finger: Finger, hidden: Hidden, motion: Motion, force: Array) -> tuple[Array, Array]:
    """Friction of the edges on each joint by tendon [N·m], (samples, tendons, joints), and of the joints."""
    rest, along = force, np.zeros_like(motion.speed)
    for j in range(motion.angle.shape[1]):  # from proximal to distal: less arrives
        load = np.repeat(rest[:, :, None], motion.angle.shape[1], axis=2)
        most = edge_friction(finger, hidden, motion.time, motion.angle, motion.speed, load)
        along[:, :, j] = (most * motion.z_edge)[:, :, j]
        rest = rest - along[:, :, j]
    joint = joint_friction(finger, hidden, motion.time, motion.velocity, force) * motion.z_joint
    return finger.arms * np.cumsum(along, axis=2), joint


def balanced(finger: Finger, hidden: Hidden, motion: Motion, pull: Array) -> Signals:
    """Tendon forces nearest to a pretension `pull` [N] that carry all torques, and the tendons' positions."""
    rate = 1.0 / float(motion.time[1] - motion.time[0])
    spring = finger.cover * (motion.angle - finger.rest) + finger.damping * motion.velocity
    rest, inverse = crept(motion.angle, rate), np.linalg.pinv(finger.arms)
    start = pull[:, None] * np.ones(len(finger.stiffness))
    force = start
    for _ in range(25):
        edges, joints = lost(finger, hidden, motion, force)
        extra = hidden_torque(hidden, finger, motion.time, motion.angle, rest, force)
        force = start + (spring + edges.sum(axis=1) + joints + extra - start @ finger.arms) @ inverse
    position = motion.angle @ finger.arms.T + force / finger.stiffness
    if hidden.effect == "pulley_eccentricity":
        position[:, hidden.tendon] += wobble(hidden, motion.angle[:, hidden.joint])[1]
    return signals(finger, hidden, motion, force, position, extra)


def signals(finger: Finger, hidden: Hidden, motion: Motion, force: Array, position: Array, extra: Array) -> Signals:
    """Of a recording; `seen` is the rms at the joint where most of the hidden torque remains when all that is described
    may have another size. extra: the hidden torque but friction [N·m]."""
    edges, joints = lost(finger, hidden, motion, force)
    sound_edges, sound_joints = lost(finger, replace(hidden, effect="none"), motion, force)
    torque = extra + (edges - sound_edges).sum(axis=1) + joints - sound_joints
    remains = np.empty_like(torque)
    for j in range(torque.shape[1]):
        columns = [np.ones(len(torque)), motion.angle[:, j], motion.velocity[:, j], sound_joints[:, j]]
        basis = np.column_stack([*columns, sound_edges[:, :, j]])
        remains[:, j] = torque[:, j] - basis @ np.linalg.lstsq(basis, torque[:, j], rcond=None)[0]
    known = {"time": motion.time, "force": force, "position": position, "angle": motion.angle}
    return {**known, "hidden": torque, "seen": np.array(rms(remains))}
