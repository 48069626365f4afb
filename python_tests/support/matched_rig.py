"""Recordings of a tendon finger whose physics is the nominal model's but for one hidden effect.

It solves Rᵀ f = T(q, q̇, f) + bias + noise for the forces, by the model's friction law or with presliding. Strokes are
random, the pretension varies by a factor of four, torque noise is 1.5 to 3 mN·m, and the bias wanders.

    hand = random_hand(seed=1, joints=2)                       # the truth, and the tool's nominal description
    hidden = hide(hand, "load_friction", strength=0.1, seed=3) # hidden_effects.py; strength after refitting, over noise
    made = record(hidden, seed=5, seconds=60.0)                # made.columns: a recording; hand.nominal: for the tool

Friction depends on the forces: they are found by fixed-point iteration over the whole series at once.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import linprog
from scipy.signal import lfilter

from matched_physics import (
    Array,
    Description,
    Finger,
    Motion,
    filtered_velocity,
    motion_of,
    read_finger,
    torque_of,
)

ITERATIONS = 60  # of the balance, at most: it contracts by some tenths of the friction coefficients
BALANCED = 1e-9  # N

REACH = 0.7  # rad, largest joint angle
SPEEDS = (0.25, 2.0)  # rad/s, mean speed of a stroke, evenly in its logarithm
STROKES = (0.1, 1.0)  # rad
SHORTEST = 0.3  # s, of a stroke: else a few of them would have most of all acceleration
REST = (0.05, 0.8)  # s, of every third stroke or so


class Unreachable(ValueError):
    """No sound magnitude of an effect has the strength asked for, or this finger has no place for it."""


@dataclass(frozen=True)
class Noise:
    """What no model explains. std N·m and correlation time s of the coloured torque noise; wander N·m/√s of the bias
    (a random walk); force_std N of each force sensor; steps of the encoders: joint rad, tendon m."""

    std: float = 0.002
    time: float = 0.02
    wander: float = 0.001
    force_std: float = 0.0002
    joint_step: float = 2.0 * np.pi / 2**20
    tendon_step: float = 2e-8


QUIET = Noise(0.0, 0.02, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Hidden:
    """What the true finger has and the nominal lacks. Every hook gets this finger's truth and changes it.

    effect, joint, tendon: the answer, from 1 or None. magnitude: the number that was scaled.
    hand: changes both descriptions by the magnitude. path: true joint angles [N, n] from those of the encoders.
    finger: changes the true numbers or adds torques. sensors: changes what is measured.
    """

    effect: str
    joint: int | None = None
    tendon: int | None = None
    magnitude: float = 0.0
    note: str = ""
    hand: Callable[[Hand, float], Hand] | None = None
    path: Callable[[Array, float], Array] | None = None
    finger: Callable[[Finger, Motion, float], None] | None = None
    sensors: Callable[[dict[str, Array], Finger, float], None] | None = None


@dataclass(frozen=True)
class Hand:
    """A finger. truth: description without what is hidden; nominal: what the tool gets, numbers off by up to half."""

    truth: Description
    nominal: Description
    source: int = 2
    rate: float = 1000.0
    level: float = 18.0  # N, mean pretension
    tension_time: float = 1.5  # s in which the pretension changes
    noise: Noise = field(default_factory=Noise)
    hidden: tuple[Hidden, ...] = ()


@dataclass(frozen=True)
class Made:
    """A recording: values [N] by the names of columns."""

    hand: Hand
    columns: dict[str, Array]


def random_arms(rng: np.random.Generator, joints: int) -> Array:
    """[2n, n] m: 4 to 11 mm, signs such that all tendons can pull at once."""
    while True:
        signs = rng.choice([-1.0, 1.0], (joints, joints))
        arms = np.vstack([signs, -signs]) * rng.uniform(0.004, 0.011, (2 * joints, joints))
        if joints == 2:
            arms = np.abs(arms) * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
        if np.linalg.cond(arms) < 6.0 and pulling_null_vector(arms) is not None:
            return arms


def random_law(rng: np.random.Generator, size: float, velocity: float) -> Description:
    """Symmetric; Stribeck effect and viscous friction half of the time each."""
    coulomb = size * rng.uniform(0.6, 1.6)
    drop = coulomb * rng.uniform(0.2, 0.5) * (rng.random() < 0.5)
    viscous = coulomb * rng.uniform(0.05, 0.2) / velocity * (rng.random() < 0.5)
    return {
        "static": coulomb + drop,
        "coulomb": coulomb,
        "stribeck_velocity": velocity * rng.uniform(0.6, 1.6),
        "viscous": viscous,
    }


def random_truth(rng: np.random.Generator, joints: int, presliding: bool) -> Description:
    """A plausible finger: half of the possible pulleys and edges, a joint's own friction and its cover mostly."""
    arms = random_arms(rng, joints)
    tendons: list[Description] = []
    for row in arms:
        edges = [random_law(rng, 0.03, 0.006) if rng.random() < 0.5 else None for _ in range(joints)]
        pulleys = [random_law(rng, 0.02, 0.006) if rng.random() < 0.4 else None for _ in range(joints - 1)]
        tendons.append({
            "stiffness": float(rng.uniform(3000.0, 8000.0)), "moment_arms": row.tolist(),
            "edge_friction": edges, "pulley_friction": [*pulleys, None],
        })  # fmt: skip
    members: list[Description] = []
    for _ in range(joints):
        joint: Description = {"friction": random_law(rng, 0.006, 0.3)}
        if rng.random() < 0.7:
            joint["cover"] = {"stiffness": float(rng.uniform(0.01, 0.04)), "rest_angle": float(rng.uniform(-0.2, 0.2))}
        if rng.random() < 0.3:
            joint["load_friction"] = random_law(rng, 1e-4, 0.3)
        members.append(joint)
    data: Description = {
        "format": "tendonfmu-finger-1",
        "name": "matched",
        "joints": [{"name": f"joint_{j + 1}", **joint} for j, joint in enumerate(members)],
        "tendons": [{"name": f"tendon_{i + 1}", **tendon} for i, tendon in enumerate(tendons)],
        "velocity_threshold": {"tendon": 0.0004, "joint": 0.04},
        "velocity_filter_cutoff": 0.0,
        "bias": {"initial_variance": 1e-4, "forget_rate": 0.0},
        "contact": {"threshold": [1.0] * joints},
        "extensions": [],
    }  # fmt: skip
    if presliding:
        add_presliding(rng, data)
    return data


def add_presliding(rng: np.random.Generator, data: Description) -> None:
    """At every tendon that has friction and every joint. Static friction is no notion then: laws without Stribeck."""
    for i, tendon in enumerate(data["tendons"]):
        laws = [law for law in [*tendon["edge_friction"], *tendon["pulley_friction"]] if law is not None]
        if laws:
            distance = float(rng.uniform(1e-4, 6e-4))
            data["extensions"].append({"effect": "presliding", "tendon": i + 1, "displacement": distance})
    for j in range(len(data["joints"])):
        distance = float(rng.uniform(0.01, 0.06))
        data["extensions"].append({"effect": "presliding", "joint": j + 1, "displacement": distance})


def off_start(rng: np.random.Generator, data: Description, share: float = 0.5) -> Description:
    """The numbers that fit estimates, each off by up to `share`; what is absent stays absent."""
    rough = copy.deepcopy(data)

    def move(law: Description | None) -> None:
        if law is None:
            return
        drop = law["static"] - law["coulomb"]
        scale = rng.uniform(1.0 - share, 1.0 + share, 4)
        law["coulomb"] = float(law["coulomb"] * scale[0])
        law["static"] = law["coulomb"] if drop == 0.0 else float(law["coulomb"] + drop * scale[1])
        law["stribeck_velocity"] = float(law["stribeck_velocity"] * scale[2])
        law["viscous"] = float(law["viscous"] * scale[3])

    for joint in rough["joints"]:
        move(joint.get("friction"))
        move(joint.get("load_friction"))
        if joint.get("cover"):
            joint["cover"]["stiffness"] *= float(rng.uniform(1.0 - share, 1.0 + share))
    for tendon in rough["tendons"]:
        for law in [*tendon["edge_friction"], *tendon["pulley_friction"]]:
            move(law)
    for row in rough["extensions"]:
        row["displacement"] *= float(rng.uniform(1.0 - share, 1.0 + share))
    return rough


def random_hand(
    seed: int,
    joints: int = 2,
    *,
    presliding: bool = False,
    source: int = 2,
    rate: float = 1000.0,
    wander: float = 1.0,
    cutoff: float = 0.0,
) -> Hand:
    """A finger of its own for every seed. source: kinematics 1 to 3; wander: factor of the bias's random walk. cutoff:
    Hz of the filter behind which friction sees velocity, 0: none."""
    rng = np.random.default_rng([seed, 60])
    truth = random_truth(rng, joints, presliding)
    truth["velocity_filter_cutoff"] = cutoff
    noise = Noise(std=float(rng.uniform(0.0015, 0.003)), time=float(rng.uniform(0.01, 0.03)))
    noise = replace(noise, wander=noise.wander * wander)
    truth["bias"] |= {"noise_std": noise.std, "drift_variance": max(noise.wander, 3e-4) ** 2}
    return Hand(truth, off_start(rng, truth), source, rate, float(rng.uniform(14.0, 24.0)), noise=noise)


# --- motion and pretension --------------------------------------------------------------------------------------------


def strokes(rng: np.random.Generator, time: Array) -> Array:
    """[N] one joint's angle: strokes of least jerk between random angles, a rest after some; it begins at rest at 0."""
    angle = np.zeros(len(time))
    now, at = time[0] + rng.uniform(0.1, 0.4), 0.0
    while now < time[-1]:
        length = rng.uniform(*STROKES)
        direction = 1.0 if at < -REACH + length else -1.0 if at > REACH - length else rng.choice([-1.0, 1.0])
        target = float(np.clip(at + direction * length, -REACH, REACH))
        mean_speed = np.exp(rng.uniform(*np.log(SPEEDS)))
        duration = max(abs(target - at) / mean_speed, SHORTEST)
        s = np.clip((time - now) / duration, 0.0, 1.0)
        angle = np.where(time >= now, at + (target - at) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2), angle)
        now, at = now + duration, target
        if rng.random() < 0.35:
            now += rng.uniform(*REST)
    return angle


def wandering(rng: np.random.Generator, time: Array, knots: float) -> Array:
    """[N] smooth random signal between -1 and 1: a cubic through random values some `knots` seconds apart."""
    count = max(4, int((time[-1] - time[0]) / knots) + 2)
    places = np.linspace(time[0], time[-1], count)
    return np.asarray(np.clip(CubicSpline(places, rng.uniform(-1.0, 1.0, count))(time), -1.0, 1.0))


def pulling_null_vector(arms: Array) -> Array | None:
    """[m] forces above 0 of largest least element that make no torque, mean 1; None where there are none."""
    tendons, joints = arms.shape
    balance = np.vstack([np.hstack([arms.T, np.zeros((joints, 1))]), np.append(np.ones(tendons), 0.0)])
    above = np.hstack([-np.eye(tendons), np.ones((tendons, 1))])
    solution = linprog(
        np.append(np.zeros(tendons), -1.0),
        A_ub=above,
        b_ub=np.zeros(tendons),
        A_eq=balance,
        b_eq=np.append(np.zeros(joints), float(tendons)),
        bounds=[(0.0, None)] * (tendons + 1),
    )
    return solution.x[:tendons] if solution.success and solution.x[-1] > 0.3 else None


def pretension(rng: np.random.Generator, time: Array, arms: Array, level: float, knots: float) -> Array:
    """[N, m] N: varying forces without torque: `level` times 0.5 to 2, and a quarter of it between the tendons.

    knots: s in which they change. Where that is several seconds, what comes from wrong forces or arms looks like a
    slow bias.
    """
    base = pulling_null_vector(arms)
    assert base is not None
    left, _, _ = np.linalg.svd(arms)
    others = left[:, arms.shape[1] :]
    common = level * 2.0 ** wandering(rng, time, knots)
    force = common[:, None] * base
    for k in range(others.shape[1]):
        force = force + (0.25 * level * wandering(rng, time, knots / 1.5))[:, None] * others[:, k]
    return force


# --- recordings -------------------------------------------------------------------------------------------------------


def coloured(rng: np.random.Generator, samples: int, width: int, step: float, noise: Noise) -> Array:
    """[N, width] N·m: AR(1) of standard deviation std, stationary from the first sample on."""
    a = np.exp(-step / noise.time)
    drive = rng.standard_normal((samples, width)) * np.sqrt(1.0 - a**2)
    drive[0] /= np.sqrt(1.0 - a**2)
    return np.asarray(noise.std * lfilter([1.0], [1.0, -a], drive, axis=0))


def balanced_forces(finger: Finger, motion: Motion, pretensions: Array, load: Array) -> Array:
    """[N, m] N with Rᵀ f = G(f) + load, by iteration; pretensions [N, m] make no torque. load [N, n]."""
    spread = np.linalg.pinv(finger.arms.T)
    force: Array = pretensions + load @ spread.T
    for _ in range(ITERATIONS):
        last = force
        force = pretensions + (torque_of(finger, motion, force) + load) @ spread.T
        if np.max(np.abs(force - last)) < BALANCED:
            return force
    raise RuntimeError(f"matched rig: no balance, forces still move by {np.max(np.abs(force - last)):.2e} N")


def record(hand: Hand, seed: int, seconds: float = 60.0, *, quiet: bool = False) -> Made:
    """A recording of this hand. quiet: without noise, wander and quantisation."""
    arms = read_finger(hand.truth).arms
    time = np.arange(round(seconds * hand.rate)) / hand.rate
    rng = np.random.default_rng([seed, 61])
    encoders = np.column_stack([strokes(rng, time) for _ in range(arms.shape[1])])
    rng = np.random.default_rng([seed, 62])
    pretensions = pretension(rng, time, arms, hand.level, hand.tension_time)
    return recorded(hand, time, encoders, pretensions, 0.0, rng, QUIET if quiet else hand.noise)


def recorded(
    hand: Hand,
    time: Array,
    encoders: Array,
    pretensions: Array,
    load: Array | float,
    rng: np.random.Generator,
    noise: Noise,
) -> Made:
    """What sensors see of the hand: joint angles are those of its encoders, and a load [N, n] N·m acts on it."""
    finger = read_finger(hand.truth)
    angle = encoders
    for hidden in hand.hidden:
        if hidden.path is not None:
            angle = hidden.path(angle, hidden.magnitude)
    exact = np.gradient(angle, time, axis=0)
    velocity = exact if hand.source == 3 else filtered_velocity(angle, 1.0 / hand.rate, finger.cutoff)
    motion = motion_of(time, angle, velocity, finger.arms)
    for hidden in hand.hidden:
        if hidden.finger is not None:
            hidden.finger(finger, motion, hidden.magnitude)
    samples, step = len(time), 1.0 / hand.rate
    walk = noise.wander * np.sqrt(step) * np.cumsum(rng.standard_normal((samples, finger.joints)), axis=0)
    disturbance = coloured(rng, samples, finger.joints, step, noise)
    force = balanced_forces(finger, motion, pretensions, disturbance + walk + load)
    signals = {
        "time": time,
        "tendon_force": force.copy(),
        "tendon_position": motion.angle @ finger.arms.T + force / finger.stiffness,
        "joint_position": encoders.copy(),
        "joint_velocity": exact,
    }
    for hidden in hand.hidden:
        if hidden.sensors is not None:
            hidden.sensors(signals, finger, hidden.magnitude)
    measure(rng, signals, noise)
    return Made(hand, columns_of(signals, hand.source))


def measure(rng: np.random.Generator, signals: dict[str, Array], noise: Noise) -> None:
    """Sensors: white force noise, encoders that round."""
    signals["tendon_force"] = signals["tendon_force"] + noise.force_std * rng.standard_normal(
        signals["tendon_force"].shape
    )
    for name, size in (("tendon_position", noise.tendon_step), ("joint_position", noise.joint_step)):
        if size > 0.0:
            signals[name] = size * np.round(signals[name] / size)


def columns_of(signals: dict[str, Array], source: int) -> dict[str, Array]:
    """Columns of docs/reference/recordings.md; joint sensors only where these kinematics use them."""
    groups = ["tendon_force", "tendon_position"]
    groups += ["joint_position"] * (source >= 2) + ["joint_velocity"] * (source == 3)
    columns = {"time": signals["time"]}
    for name in groups:
        columns |= {f"{name}[{k + 1}]": signals[name][:, k] for k in range(signals[name].shape[1])}
    return columns
