"""A finger in MuJoCo whose tendons lose force on their way: MuJoCo's own loop, one call of the core in each step.

MuJoCo moves the bodies, stretches the springs and makes the friction in the joints. The core computes
from the tendon forces and the joints' motion what the tendons lose (losses.json), as torques on the joints.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tendonfmu import Runner
from tendonfmu.excite import pretension_vector

Array = NDArray[np.float64]
HERE = Path(__file__).resolve().parent
MODEL, LOSSES = HERE / "finger.xml", HERE / "losses.json"
JOINTS = ("mcp", "pip")
TENDONS = ("flexor_deep", "flexor_short", "extensor_long", "extensor_short")
STEP = 0.001  # s
FORCE_NOISE = 0.02  # N, of a load cell


@dataclass(frozen=True)
class Sample:
    """What the sensors of the finger read at one time."""

    time: float  # s
    tendon_force: Array  # [m], N
    tendon_position: Array  # [m], m
    joint_position: Array  # [n], rad
    joint_velocity: Array  # [n], rad/s


def step(runner: Runner, sample: Sample) -> Any:
    """Outputs of a description at a sample; its arrays hold until the next step."""
    return runner.step(
        sample.time,
        tendon_force=sample.tendon_force,
        tendon_position=sample.tendon_position,
        joint_position=sample.joint_position,
        joint_velocity=sample.joint_velocity,
    )


class TendonFinger:
    """The finger of finger.xml with the losses of losses.json, stepped at 1 kHz.

    pretension: mean tendon force at rest [N]. seed: of the sensors' noise.
    """

    def __init__(self, pretension: float = 10.0, seed: int = 1) -> None:
        description = json.loads(LOSSES.read_text(encoding="utf-8"))
        self.losses = Runner(description, kinematics=3)
        self.model = mujoco.MjModel.from_xml_path(str(MODEL))
        self.data = mujoco.MjData(self.model)
        self.random = np.random.default_rng(seed)
        self.arms = np.array([tendon["moment_arms"] for tendon in description["tendons"]])
        self.stiffness = np.array([tendon["stiffness"] for tendon in description["tendons"]])
        self.preload = pretension_vector(description) / self.stiffness  # m per N of pretension
        self.pretension = pretension
        self.motors = pretension * self.preload
        mujoco.mj_forward(self.model, self.data)
        self.reference = self.data.ten_length.copy()  # m, at joint angle 0: where tendon positions count from

    @property
    def angles(self) -> Array:
        return np.array(self.data.qpos)

    def motors_for(self, angles: Array) -> Array:
        """Tendon positions that hold the joints at these angles if nothing rubs or weighs [m]."""
        return np.asarray(self.arms @ angles + self.pretension * self.preload)

    def tension(self) -> Array:
        """Force of each spring [N]; it pulls only."""
        stretched = self.data.ten_length - self.reference + self.motors
        return np.asarray(np.clip(self.stiffness * stretched, 0.0, 100.0))

    def sense(self) -> Sample:
        """What the sensors read now."""
        force = self.tension() + self.random.normal(0.0, FORCE_NOISE, len(TENDONS))
        return Sample(self.data.time, force, self.motors.copy(), self.angles, self.data.qvel.copy())

    def step(self, motors: Array) -> Sample:
        """Move the motors [m], let the tendons lose force, step MuJoCo, and read the sensors."""
        self.motors = motors
        d = self.data
        mujoco.mj_kinematics(self.model, d)
        mujoco.mj_comPos(self.model, d)
        mujoco.mj_tendon(self.model, d)
        true = Sample(d.time, self.tension(), motors, self.angles, d.qvel.copy())
        d.qfrc_applied[:] = -step(self.losses, true).friction_torque
        d.ctrl[:] = self.reference - motors  # a position servo of the tendon's length: the spring behind the motor
        mujoco.mj_step(self.model, d)
        mujoco.mj_kinematics(self.model, d)
        mujoco.mj_comPos(self.model, d)
        mujoco.mj_tendon(self.model, d)
        return self.sense()
