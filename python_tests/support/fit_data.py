"""Recordings that the model of the estimation explains exactly, made through the C batch run, for tests.

The motion is given (kinematics source 3) and the tendons carry internal forces plus the smallest forces that balance
the joints: Rᵀ f0 = T(f0) + b + e, a fixed point in f0, since friction grows with the forces. The bias b wanders as a
random walk and jumps as fig. 5 says; e is white noise. Both have the variances that the description states.

`noise_in_forces` puts e into the forces themselves, as a sensor would: f0 then carries a little of e into T, which the
likelihood ignores (a shift of an estimate by the order of (e/(r·f0))², gone with symmetric laws). Otherwise the forces
stay smooth and e is in the column `external_torque`: y = τ − external_torque is then exactly the model's.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.model import native

Array = NDArray[Any]
Description = dict[str, Any]

SETTLED = 1e-15  # N·m, in units of the largest torque: the fixed point is found
MOST_ROUNDS = 200
NEVER = 1e9  # N·m, a contact threshold out of reach


def model_alone(description: Mapping[str, Any]) -> dict[str, Any]:
    """The description without contact and with a bias that only jumps, from 0."""
    alone = copy.deepcopy(dict(description))
    alone["contact"] = {"threshold": [NEVER] * len(alone["joints"])}
    kept = {key: value for key, value in (alone.get("bias") or {}).items() if key == "forget_rate"}
    still = {"drift_variance": 0.0, "initial_variance": 0.0, "noise_std": 1.0}
    alone["bias"] = kept | still | {"initial_torque": [0.0] * len(alone["joints"])}
    return alone


def model_torques(description: Mapping[str, Any], recording: Mapping[str, Numbers]) -> tuple[Numbers, Numbers]:
    """T [N, n] and the jumps of the bias added up [N, n], of a recording with kinematics source 3."""
    outputs = native.run_recording(model_alone(description), recording, 3)
    return outputs["friction_torque"] - outputs["bias_torque"], outputs["bias_torque"]


def noise_scale(description: Mapping[str, Any], time: Numbers, force: Numbers) -> Numbers:
    """[N, 1] standard deviation of the noise; that of the first sample is the root of bias.initial_variance."""
    bias = description.get("bias") or {}
    mean_force = np.abs(force).mean(axis=1)
    std = bias.get("noise_std", 0.01) + (bias.get("noise_std_per_force") or 0.0) * mean_force
    first = std[0] if bias.get("initial_variance") is None else np.sqrt(bias["initial_variance"])
    if bias.get("noise_time") is not None:
        std = std * np.sqrt(bias["noise_time"] / np.diff(time, prepend=np.nan))
    std[0] = first
    return np.asarray(std)[:, None]


@dataclass(frozen=True)
class MadeRecording:
    """recording: as the runtime takes it, kinematics source 3, with `external_torque` where the noise is not in the
    forces. bias [N, n]: the true b_k (jumps included). noise [N, n]: e_k."""

    recording: dict[str, Array]
    bias: Array
    noise: Array


def make_recording(
    description: Mapping[str, Any],
    motion: Mapping[str, Array],
    internal_force: Array,
    seed: int,
    start_bias: Array | float = 0.0,
    noise_in_forces: bool = False,
    quiet: bool = False,
    settled: float = SETTLED,
) -> MadeRecording:
    """A recording of a motion (`time` [N], `joint_position`, `joint_velocity` [N, n]) with its true bias and noise.

    internal_force: [N, m] or [m] N; what of it acts on the joints is replaced by the balancing forces.
    start_bias: [n] N·m. quiet: no noise and no wandering, jumps only. settled: in place of
    SETTLED, more where a long recording's rounding stays above that.
    Raises ValueError where the fixed point is not found or a tendon goes slack.
    """
    rng = np.random.default_rng(seed)
    time, q = np.asarray(motion["time"], dtype=float), np.asarray(motion["joint_position"], dtype=float)
    R = np.array([tendon["moment_arms"] for tendon in description["tendons"]], dtype=float)
    balance = np.linalg.pinv(R)  # f = balanceᵀ τ: the smallest forces with Rᵀ f = τ
    white, walk = rng.standard_normal(q.shape), rng.standard_normal(q.shape)
    drift = (description.get("bias") or {}).get("drift_variance", 1e-6)
    wander = np.cumsum(walk * np.sqrt(drift * np.diff(time, prepend=time[0]))[:, None], axis=0)
    if quiet:
        white, wander = np.zeros_like(white), np.zeros_like(wander)

    stiffness = np.array([tendon["stiffness"] for tendon in description["tendons"]])
    given = np.broadcast_to(np.asarray(internal_force, dtype=float), (len(time), len(R)))
    inner = given - given @ R @ balance
    recording = {"time": time, "joint_position": q, "joint_velocity": np.asarray(motion["joint_velocity"], dtype=float)}
    force, torque = inner, np.zeros_like(q)
    for _ in range(MOST_ROUNDS):
        T, jumps = model_torques(description, recording | {"tendon_force": np.ascontiguousarray(force)})
        bias = start_bias + wander + jumps
        noise = white * noise_scale(description, time, force)
        wanted = T + bias + (noise if noise_in_forces else 0.0)
        change = np.abs(wanted - torque).max()
        torque = wanted
        force = inner + torque @ balance
        if change <= settled * max(np.abs(torque).max(), 1e-6):
            break
    else:
        raise ValueError(
            f"the forces that balance the motion do not settle: {change:.3g} N·m after {MOST_ROUNDS} rounds"
        )
    for i, tendon in enumerate(description["tendons"]):
        if not tendon.get("bidirectional") and force[:, i].min() <= 0.0:
            raise ValueError(
                f"tendon_force[{i + 1}]: {force[:, i].min():.3g} N, a tendon goes slack; raise internal_force"
            )
    recording |= {"tendon_force": force, "tendon_position": q @ R.T + force / stiffness}
    if not noise_in_forces:
        # y = τ − external_torque = T + b + e, to the last bits that the fixed point leaves
        recording["external_torque"] = force @ R - torque - noise
    return MadeRecording(recording, bias, noise)


def wavy_motion(seed: int, duration: float, rate: float, joints: int, reach: float = 0.5) -> dict[str, Array]:
    """A smooth motion of all joints at once, sums of four sines, at rest for a moment every few seconds.

    rate: Hz. reach: rad, about the largest angle.
    """
    rng = np.random.default_rng([seed, 7])
    time = np.arange(round(duration * rate)) / rate
    # a clock that stands still now and then brings rests longer than one sample, with the angle held
    phase = 2.0 * np.pi * time / 4.1
    clock = time - np.sin(phase) * 4.1 / (2.0 * np.pi)
    pace = 1.0 - np.cos(phase)
    angle, speed = np.zeros((len(time), joints)), np.zeros((len(time), joints))
    for j in range(joints):
        for frequency in rng.uniform(0.05, 0.9, 4):
            at, size = rng.uniform(0.0, 6.0), reach / 4.0 * rng.uniform(0.5, 1.5)
            angle[:, j] += size * np.sin(2.0 * np.pi * frequency * clock + at)
            speed[:, j] += size * 2.0 * np.pi * frequency * np.cos(2.0 * np.pi * frequency * clock + at) * pace
    return {"time": time, "joint_position": angle, "joint_velocity": speed}


def wavy_forces(seed: int, time: Array, tendons: int, mean: float = 12.0) -> Array:
    """[N, m] N internal forces that change slowly, each tendon on its own."""
    rng = np.random.default_rng([seed, 8])
    wave = np.sin(2.0 * np.pi * rng.uniform(0.03, 0.3, tendons) * time[:, None] + rng.uniform(0.0, 6.0, tendons))
    return np.asarray(mean * (1.0 + 0.4 * wave))


def recorded(
    description: Mapping[str, Any], seed: int, duration: float, rate: float = 20.0, **how: Any
) -> dict[str, Array]:
    """A recording of a wavy motion of the whole finger, its tendons tight; how: options of `make_recording`."""
    motion = wavy_motion(seed, duration, rate, len(description["joints"]))
    forces = wavy_forces(seed, motion["time"], len(description["tendons"]), mean=30.0)
    return make_recording(description, motion, forces, seed, 0.02, **how).recording
