"""The finger of bench/latch_up.py: one joint between two tendons whose friction is a share of their force.

Everything is known: its true friction (which may be more than the model's), load, sensor noise.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.model import native

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]

RATE = 1000.0  # 1/s
STEP = 1.0 / RATE
ARM = 0.009  # m, of both tendons, against each other
SHARE = 0.03  # friction force over tendon force
V_MIN = 0.0005 / ARM  # rad/s, the default threshold of the tendon, at the joint
NOISE = 1e-3  # N·m in the joint torque, white: 0.08 N in each tendon
THRESHOLD = 8e-3  # N·m, 8 times the noise
JOINED = 0.1  # s; alarms closer than that are one

ASLEEP = {"bias.drift_variance": 0.0, "bias.initial_variance": 0.0}  # the filter takes nothing up, as in contact


def finger(keys: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Its description. keys: `bias.forget_rate` and the like, beyond the defaults."""
    law = {"static": SHARE, "coulomb": SHARE, "stribeck_velocity": 0.005}
    description: dict[str, Any] = {
        "format": "tendonfmu-finger-1",
        "name": "one_joint",
        "joints": [{"name": "joint"}],
        "tendons": [{"stiffness": 4000.0, "moment_arms": [arm], "edge_friction": [law]} for arm in (ARM, -ARM)],
        "velocity_threshold": {},
        "bias": {
            "forget_rate": 0.0
        },  # true friction here turns round as the finger moves off, and so nothing is forgotten at rest
        "contact": {"threshold": [THRESHOLD]},
    }
    for key, value in (keys or {}).items():
        group, name = key.split(".")
        description[group][name] = value
    return copy.deepcopy(description)


def friction(pull: Numbers | float) -> Numbers:
    """N·m, that the model has for motion in the positive direction. pull: N, the sum of both tendon forces."""
    return np.asarray(ARM * SHARE * pull)


@dataclass(frozen=True)
class Take:
    """time s, angle rad, velocity rad/s, pull N (both forces together), torque N·m (of the tendons): [N] each."""

    time: Numbers
    angle: Numbers
    velocity: Numbers
    pull: Numbers
    torque: Numbers

    def run(self, keys: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """The core's outputs [N], with measured angle and velocity (kinematics source 3)."""
        difference = self.torque / ARM
        force = 0.5 * np.column_stack([self.pull + difference, self.pull - difference])
        recording = {
            "time": self.time,
            "tendon_force": force,
            "joint_position": self.angle[:, None],
            "joint_velocity": self.velocity[:, None],
        }
        made = native.run_recording(finger(keys), recording, 3)
        return {name: value[:, 0] if value.ndim == 2 else value for name, value in made.items() if name != "slack"}


def times(duration: float) -> Numbers:
    return np.arange(round(duration * RATE)) * STEP


def noise(random: np.random.Generator, count: int, time: float = 0.0) -> Numbers:
    """Of unit standard deviation; time: s, of its correlation (first order), 0 is white."""
    white = random.standard_normal(count)
    if not time:
        return white
    keep = np.exp(-STEP / time)
    made = np.empty(count)
    made[0] = white[0]
    for k, value in enumerate((np.sqrt(1.0 - keep**2) * white[1:]).tolist(), 1):
        made[k] = keep * made[k - 1] + value
    return made


def strokes(random: np.random.Generator, duration: float) -> tuple[Numbers, Numbers]:
    """Angle and velocity [N] of minimum-jerk strokes of 0.5 to 1.5 s between random angles, rests of 0.2 to 2 s."""
    time = times(duration)
    angle, velocity = np.zeros(len(time)), np.zeros(len(time))
    now, here = 0.0, 0.0
    while now < duration:
        there, stroke = random.uniform(-0.5, 0.5), random.uniform(0.5, 1.5)
        s = np.clip((time - now) / stroke, 0.0, 1.0)
        later = time >= now
        angle[later] = (here + (there - here) * (10 * s**3 - 15 * s**4 + 6 * s**5))[later]
        velocity[later] = ((there - here) / stroke * 30 * (s**2 - 2 * s**3 + s**4))[later]
        now, here = now + stroke + random.uniform(0.2, 2.0), there
    return angle, velocity


def direction(velocity: Numbers) -> Numbers:
    """Side of true friction [N], -1 or 1: that of the last motion above V_MIN, of the first one before it."""
    index = np.where(np.abs(velocity) > V_MIN, np.arange(len(velocity)), -1)
    last = np.maximum.accumulate(index)
    moving = index[index >= 0]
    first = moving[0] if len(moving) else 0
    return np.where(velocity[np.where(last < 0, first, last)] < 0, -1.0, 1.0)


def alarms(contact: Flags) -> list[tuple[int, int]]:
    """First and last sample of each alarm; those closer than JOINED are one."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], contact, [False]]).astype(int)))
    found: list[tuple[int, int]] = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if found and first - found[-1][1] - 1 < JOINED * RATE:
            found[-1] = (found[-1][0], end - 1)
        else:
            found.append((first, end - 1))
    return found


def longest(contact: Flags) -> float:
    """s, of the longest alarm."""
    return max((last - first + 1 for first, last in alarms(contact)), default=0) * STEP
