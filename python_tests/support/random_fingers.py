"""Seeded random fingers and recordings that take every branch of docs/reference/semantics/README.md.

The recordings are not a simulation: motions and forces are chosen so that the rules are exercised
(jumps, slow reversals, rests held to the last bit, pushes, slack), and they share no code with any law.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from random_extensions import random_axes, random_extensions

Array = NDArray[Any]
Description = dict[str, Any]
Recording = dict[str, Array]

SAMPLES = 500


def random_side(rng: np.random.Generator, scale: float, velocity: float) -> Description:
    coulomb = scale * rng.uniform(0.2, 1.0)
    side = {
        "static": coulomb if rng.random() < 0.2 else coulomb * rng.uniform(1.0, 1.8),
        "coulomb": coulomb,
        "stribeck_velocity": velocity * float(np.exp(rng.uniform(-1.0, 1.0))),
    }
    if rng.random() < 0.7:
        side["viscous"] = scale / velocity * rng.uniform(0.0, 0.3)
    return side


def random_law(rng: np.random.Generator, scale: float, velocity: float) -> Description:
    if rng.random() < 0.4:
        return {
            "positive": random_side(rng, scale, velocity),
            "negative": random_side(rng, scale, velocity),
        }
    return random_side(rng, scale, velocity)


def random_edge(rng: np.random.Generator, scale: float) -> Description:
    """One law, or 1 to 5 working points on an uneven grid."""
    if rng.random() < 0.35:
        return random_law(rng, scale, 0.005)
    points = int(rng.integers(1, 6))
    angles = np.cumsum(np.exp(rng.uniform(-3.0, -0.5, points)))
    angles = angles - angles.mean() + rng.uniform(-0.2, 0.2)
    return {"angles": angles.tolist(), "laws": [random_law(rng, scale, 0.005) for _ in range(points)]}


def with_gaps(rng: np.random.Generator, make: Callable[[], Description], count: int) -> list[Any] | None:
    """A list with null entries, cut short at times; None stands for a key left out."""
    entries = [None if rng.random() < 0.25 else make() for _ in range(count)]
    draw = rng.random()
    if draw < 0.1:
        return None
    if draw < 0.3:
        return entries[: int(rng.integers(0, count + 1))]
    return entries


def random_moment_arms(rng: np.random.Generator, m: int, n: int) -> Array:
    """[m, n], a finger's routing: a tendon ends at some joint; well conditioned."""
    while True:
        R: Array = rng.uniform(0.004, 0.012, (m, n)) * rng.choice([-1.0, 1.0], (m, n))
        for i in range(m):
            R[i, int(rng.integers(1, n + 1)) :] = 0.0
        R[rng.random((m, n)) < 0.1] = 0.0
        singular_values = np.linalg.svd(R, compute_uv=False)
        if singular_values[-1] > 0.12 * singular_values[0] > 0.0:
            return R


def random_joint(rng: np.random.Generator, number: int) -> Description:
    joint: Description = {"name": f"joint_{number}"}
    if rng.random() < 0.6:
        joint["cover"] = {"stiffness": rng.uniform(0.0, 0.05)}
        if rng.random() < 0.7:
            joint["cover"]["rest_angle"] = rng.uniform(-0.5, 0.5)
    if rng.random() < 0.7:
        joint["friction"] = random_law(rng, 0.01, 0.1)
    if rng.random() < 0.6:
        joint["load_friction"] = random_law(rng, 2e-4, 0.1)
    return joint


def random_tendon(rng: np.random.Generator, number: int, arms: Array, jammed: bool) -> Description:
    n = len(arms)
    tendon: Description = {
        "name": f"tendon_{number}",
        "stiffness": rng.uniform(1e3, 2e4),
        "moment_arms": arms.tolist(),
    }
    scale = 0.8 if jammed else 0.03
    pulleys = with_gaps(rng, lambda: random_law(rng, scale, 0.005), max(n - 1, 0))
    edges = with_gaps(rng, lambda: random_edge(rng, scale), n)
    if pulleys is not None:
        tendon["pulley_friction"] = [*pulleys, None] if len(pulleys) == n - 1 and rng.random() < 0.5 else pulleys
    if edges is not None:
        tendon["edge_friction"] = edges
    if rng.random() < 0.25:
        tendon["bidirectional"] = True
    return tendon


def random_bias(rng: np.random.Generator) -> Description:
    def often_zero(low: float, high: float) -> float:
        return 0.0 if rng.random() < 0.15 else float(10.0 ** rng.uniform(low, high))

    bias: Description = {"drift_variance": often_zero(-7, -3), "noise_std": often_zero(-3, -1)}
    if rng.random() < 0.5:
        bias["noise_std_per_force"] = often_zero(-5, -3)
    if rng.random() < 0.5:
        bias["initial_variance"] = often_zero(-6, -3)
    if rng.random() < 0.8:
        bias["forget_rate"] = 0.0 if rng.random() < 0.15 else rng.uniform(0.5, 20.0)
    if rng.random() < 0.3:
        bias["noise_time"] = rng.uniform(0.001, 0.02)
    if rng.random() < 0.1:
        bias |= {"drift_variance": 0.0, "initial_variance": 0.0, "noise_std": 0.0, "noise_std_per_force": 0.0}
    return bias


def random_finger(seed: int) -> Description:
    """A valid description (docs/reference/finger_description.md) with 1-4 joints and up to 8 tendons."""
    rng = np.random.default_rng([seed, 1])
    n = int(rng.integers(1, 5))
    m = int(rng.integers(n, 9))
    R = random_moment_arms(rng, m, n)
    jammed = rng.random(m) < 0.05
    description: Description = {
        "format": "tendonfmu-finger-1",
        "name": f"random_finger_{seed}",
        "joints": [random_joint(rng, j + 1) for j in range(n)],
        "tendons": [random_tendon(rng, i + 1, R[i], bool(jammed[i])) for i in range(m)],
    }
    if rng.random() < 0.5:
        zero = rng.random() < 0.3
        description["velocity_threshold"] = {"tendon": 0.0, "joint": 0.0} if zero else {"tendon": 0.001}
    if rng.random() < 0.6:
        description["velocity_filter_cutoff"] = 0.0 if rng.random() < 0.5 else rng.uniform(5.0, 50.0)
    if rng.random() < 0.85:
        description["bias"] = random_bias(rng)
    description["contact"] = {"threshold": (friction_scale(R) * rng.uniform(0.4, 1.2, n) * (1.0 + 0.3 * n)).tolist()}
    if rng.random() < 0.5:
        description["contact"]["threshold_per_force"] = rng.uniform(0.0, 1e-3, n).tolist()
    if rng.random() < 0.5:
        description["extensions"] = []
    add_zeros(np.random.default_rng([seed, 11]), description["tendons"])
    return description


def add_zeros(rng: np.random.Generator, tendons: list[Description]) -> None:
    """Give some tendons of every fourth finger a zero of their positions."""
    if rng.random() < 0.25:
        for tendon in tendons:
            tendon |= {"zero": rng.uniform(-2e-3, 2e-3)} if rng.random() < 0.7 else {}


def friction_scale(R: Array) -> Array:
    """[n] N·m: the size of friction to expect for 10 N a tendon, each losing a tenth."""
    return np.asarray(np.abs(R).sum(axis=0) * 10.0 * 0.1 + 0.01)


def random_times(rng: np.random.Generator, samples: int) -> Array:
    """[N] s: jittered steps around 1 to 10 ms with a few long ones; not always from 0."""
    dt = float(10.0 ** rng.uniform(-3.0, -2.0))
    steps = dt * rng.uniform(0.5, 1.5, samples)
    steps[rng.random(samples) < 0.005] *= 20.0
    start = 0.0 if rng.random() < 0.7 else rng.uniform(-5.0, 5.0)
    return np.asarray(start + np.cumsum(steps) - steps[0])


def random_speeds(rng: np.random.Generator, time: Array, rest: Array, v_small: float) -> Array:
    """[N] rad/s: ramps, jumps and plateaus between -2 and 2, many of them slow; 0 where rest."""
    samples = len(time)
    speed = np.zeros(samples)
    k, value, angle = 0, 0.0, 0.0
    while k < samples:
        sign = -np.sign(angle) if abs(angle) > 0.6 else rng.choice([-1.0, 1.0])
        draw = rng.random()
        if draw < 0.2:
            target = 0.0
        elif draw < 0.45:
            target = sign * v_small * rng.uniform(0.1, 3.0)
        else:
            target = sign * float(10.0 ** rng.uniform(-1.0, 0.3))
        ramp = int(rng.choice([1, 1, 5, 25]))
        for c in range(ramp + int(rng.integers(1, 30))):
            if k >= samples:
                break
            speed[k] = 0.0 if rest[k] else value + (target - value) * min(1.0, (c + 1) / ramp)
            angle += speed[k] * (time[k] - time[k - 1] if k else 0.0)
            k += 1
        value = target
    return speed


def intervals(rng: np.random.Generator, samples: int, share: float, longest: int) -> Array:
    """[N] bool: true in a few stretches that cover about the given share."""
    inside = np.zeros(samples, dtype=bool)
    while inside.mean() < share:
        start = int(rng.integers(0, samples))
        inside[start : start + int(rng.integers(3, longest))] = True
    return inside


def random_forces(rng: np.random.Generator, description: Description, R: Array, time: Array, speed: Array) -> Array:
    """[N, m] N: pretension, a crude opposing torque, pushes from outside, sensor noise, slack at times."""
    m, n = R.shape
    samples = len(time)
    pretension: Array = rng.uniform(5.0, 15.0, (m,))
    if rng.random() < 0.5:  # a nearly loose tendon goes slack now and then
        pretension[int(rng.integers(0, m))] = rng.uniform(0.0, 0.5)
    for i, tendon in enumerate(description["tendons"]):
        if tendon.get("bidirectional"):
            pretension[i] = rng.uniform(-2.0, 2.0)
    scale = friction_scale(R)
    threshold = np.array(description["contact"]["threshold"])
    torque: Array = 0.4 * scale * np.tanh(speed / 0.05)
    for j in range(n):
        push = intervals(rng, samples, 0.15, samples // 10)
        torque[:, j] += push * rng.choice([-1.0, 1.0]) * threshold[j] * rng.uniform(1.1, 2.0)
    wave = np.sin(2.0 * np.pi * rng.uniform(0.1, 1.0, m) * time[:, None] + rng.uniform(0.0, 6.0, m))
    null_space = np.eye(m) - R @ np.linalg.pinv(R)
    force = pretension + (0.2 * np.abs(pretension) * wave) @ null_space + torque @ np.linalg.pinv(R)
    return np.asarray(force + rng.normal(0.0, 0.005, force.shape))


def random_recording(
    description: Description, seed: int, samples: int = SAMPLES, time: Array | None = None
) -> Recording:
    """All inputs of a finger: `time` [N] (random unless given), forces and positions [N, m], joints [N, n]."""
    rng = np.random.default_rng([seed, 2])
    R = np.array([tendon["moment_arms"] for tendon in description["tendons"]])
    k = np.array([tendon["stiffness"] for tendon in description["tendons"]])
    m, n = R.shape
    if time is None:
        time = random_times(rng, samples)
    samples = len(time)
    rest = intervals(rng, samples, 0.15, samples // 8)
    thresholds = description.get("velocity_threshold", {})
    v_small = thresholds.get("joint", 0.01) or 0.01
    speed = np.stack([random_speeds(rng, time, rest, v_small) for _ in range(n)], axis=1)
    steps = np.diff(time, prepend=time[0])[:, None]
    angle: Array = rng.uniform(-0.4, 0.4, n) + np.cumsum(speed * steps, axis=0)
    force = random_forces(rng, description, R, time, speed)
    position = angle @ R.T + force / k + rng.normal(0.0, 2e-8, (samples, m))
    measured_angle = angle + rng.normal(0.0, 2e-6, (samples, n))
    for held in np.flatnonzero(rest):  # a rest is held to the last bit, also by the sensors
        if held > 0 and rest[held - 1]:
            position[held], measured_angle[held] = position[held - 1], measured_angle[held - 1]
            # where everything above 0 moves, a compensated step would leave the direction of motion to rounding
            if rng.random() < 0.9 or thresholds.get("tendon") == 0.0:
                force[held] = force[held - 1]
            else:  # a force step at rest, without a change of the angle
                position[held] = position[held - 1] + (force[held] - force[held - 1]) / k
    return {
        "time": time,
        "tendon_force": force,
        "tendon_position": position,
        "joint_position": measured_angle,
        "joint_velocity": speed,
    }


def random_bands(rng: np.random.Generator, scale: Array) -> list[Description]:
    """`contact.bands`: any of them may find most; a number is left out for some."""
    n = len(scale)
    most = {"friction": 1.0, "friction_limit": 0.3, "motor_load": 0.3, "friction_change": 1.0, "friction_reserve": 0.5}
    bands: list[Description] = []
    for size in (2.0, 1.0, 0.5, 0.3):  # so that the slow ones find something, too
        band: Description = {"noise": (size * scale * 10.0 ** rng.uniform(-0.8, 0.7, n)).tolist()}
        optional = {name: rng.uniform(0.0, largest, n).tolist() for name, largest in most.items()}
        bands.append(band | {name: values for name, values in optional.items() if rng.random() < 0.4})
    return bands


def random_detection(seed: int, finger: Description) -> Description:
    """The finger with any subset of the optional keys of the detection."""
    rng = np.random.default_rng([seed, 4])
    R = np.array([tendon["moment_arms"] for tendon in finger["tendons"]])
    n = R.shape[1]
    scale: Array = friction_scale(R) * (1.0 + 0.3 * n)
    contact: Description = dict(finger["contact"])
    if rng.random() < 0.6:
        contact |= {"method": "bands", "bands": random_bands(rng, scale)}
        contact |= {"watches_motors": bool(rng.random() < 0.8)} if rng.random() < 0.7 else {}
    elif rng.random() < 0.5:
        contact["method"] = "paper"
    if rng.random() < 0.5:
        contact["deviation"] = np.asarray(scale * rng.uniform(0.0, 0.2, n)).tolist()
    if rng.random() < 0.5:
        contact["deviation_per_force"] = np.asarray(rng.uniform(0.0, 1e-3, n)).tolist()
    finger = finger | {"contact": contact}
    if rng.random() < 0.6:
        forgetting = "absorption" if rng.random() < 0.8 else "time"
        finger["bias"] = finger.get("bias", {}) | {"forgetting": forgetting}
    if rng.random() < 0.3:
        hardening = {
            "effect": "cover_hardening",
            "joint": int(rng.integers(1, n + 1)),
            "stiffness": rng.uniform(0.0, 0.1),
        }
        finger["extensions"] = [hardening]
    return finger


def random_extended(seed: int, finger: Description) -> Description:
    """The finger with any of docs/reference/semantics/effects.md, a few of them with axes of the joints."""
    rng = np.random.default_rng([seed, 7])
    joints, tendons = len(finger["joints"]), len(finger["tendons"])
    thresholds = all(finger.get("velocity_threshold", {}).get(key) != 0.0 for key in ("tendon", "joint"))
    finger = finger | {"extensions": random_extensions(rng, joints, tendons, thresholds=thresholds)}
    return finger | (random_axes(rng, joints) if rng.random() < 0.3 else {})


def random_case(
    seed: int, samples: int = SAMPLES, detection: bool = False, extensions: bool = False
) -> tuple[Description, Recording]:
    """A finger and its recording; about a third begin under load, with `bias.initial_torque` near it.

    detection: with any subset of the optional keys. extensions: with rows of `extensions`.
    """
    rng = np.random.default_rng([seed, 3])
    description = random_finger(seed)
    if detection:
        description = random_detection(seed, description)
    if extensions:
        description = random_extended(seed, description)
    recording = random_recording(description, seed, samples)
    if rng.random() < 0.3:
        R = np.array([tendon["moment_arms"] for tendon in description["tendons"]])
        torque = R.T @ recording["tendon_force"][0]
        bias = description.setdefault("bias", {})
        bias["initial_torque"] = (torque + rng.normal(0.0, 0.01, len(torque))).tolist()
    return description, recording


def failing_case(seed: int) -> tuple[Description, Recording]:
    """A random finger whose springs agree with its sensors but for noise, and sensors that fail for a while."""
    description, recording = random_case(seed, 400, detection=True)
    rng = np.random.default_rng([seed, 13])
    R = np.array([tendon["moment_arms"] for tendon in description["tendons"]], dtype=float)
    k = np.array([tendon["stiffness"] for tendon in description["tendons"]], dtype=float)
    samples, (m, n) = len(recording["time"]), R.shape
    phase = np.linspace(0.0, 12.0, samples)[:, None] + rng.uniform(0.0, 6.0, n)
    q = 0.3 * np.sin(phase)
    tension = 20.0 + 8.0 * np.sin(2.3 * np.linspace(0.0, 12.0, samples)[:, None] + rng.uniform(0.0, 6.0, m))
    force = np.maximum(tension - 15.0 * (rng.random(m) < 0.2), 0.0)
    position = q @ R.T + tension / k + rng.normal(0.0, 1e-8, (samples, m))
    force = force + rng.normal(0.0, 0.005, (samples, m)) * (rng.random(m) < 0.8)
    for begin in range(40, samples - 80, 80):
        i, rows = int(rng.integers(m)), slice(begin, begin + int(rng.integers(20, 50)))
        what = rng.integers(6)
        if what == 0:
            force[rows, i] = 0.0
        elif what == 1:
            force[rows, i] = force[begin, i]
        elif what == 2:
            force[rows, i] += rng.choice([-1.0, 1.0]) * rng.uniform(3.0, 10.0)
        elif what == 5:
            position[rows] = position[begin]  # of all: what reads them hangs
        else:
            position[rows, i] = position[begin, i]
            if what == 4:
                force[begin + 5 : rows.stop, (i + 1) % m] = 0.0
    recording |= {"tendon_force": force, "tendon_position": position, "joint_position": q}
    step = float(np.median(np.diff(recording["time"])))
    fault = {
        "hold_time": step * rng.uniform(1.0, 4.0),
        "force_resolution": rng.uniform(0.002, 0.02),
        "position_resolution": rng.uniform(1e-7, 1e-6),
        "jump_margin": rng.uniform(0.2, 1.0),
        "spring_margin": rng.uniform(0.2, 1.0),
        "longest_stand": step * rng.uniform(2.0, 20.0),
        "recovery_time": step * rng.uniform(2.0, 15.0),
    }
    kept = {key: value for key, value in fault.items() if key == "recovery_time" or rng.random() < 0.9}
    return description | {"sensor_fault": kept}, recording
