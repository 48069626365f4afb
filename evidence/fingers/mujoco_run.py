"""Runs a finger of mujoco_model.py along a motion, and keeps what sensors see."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from evidence.fingers.foreign import Array
from evidence.fingers.mujoco_model import Physics, compiled

STEP = 0.001  # s
SETTLE = 1.5  # s before the recording begins
TINY = 1e-9  # N; MuJoCo would leave out the row of a frictionloss of 0


@dataclasses.dataclass
class Trace:
    """True signals of a run, a row a sample."""

    time: Array  # s, from 0
    angle: Array  # rad
    force: Array  # N
    position: Array  # m, x0


@dataclasses.dataclass
class Motion:
    """Random multi-sines of the joints and a pretension that breathes, and the motors' positions for both."""

    amplitude: Array  # rad, (joints, sines)
    frequency: Array  # Hz
    phase: Array  # rad
    pretension: float  # N
    breathing: tuple[float, float]  # share of the pretension, Hz

    def angles(self, time: Array) -> Array:
        """Angles that are aimed at [rad], (times, joints)."""
        turn = 2 * np.pi * self.frequency * time[:, None, None] + self.phase
        return np.asarray((self.amplitude * np.sin(turn)).sum(axis=2))

    def motors(self, time: Array, physics: Physics) -> Array:
        """x0 of every tendon [m] that would hold the angles if nothing rubbed, (times, tendons)."""
        share, frequency = self.breathing
        force = self.pretension * (1 + share * np.sin(2 * np.pi * frequency * time))
        return np.asarray(self.angles(time) @ physics.arms.T + force[:, None] / physics.stiffness)


def random_motion(joints: int, rng: np.random.Generator, speed: float = 1.0) -> Motion:
    """Four sines a joint of 0.08 to 0.6 Hz times `speed`, 0.36 rad rms; 20 N of pretension, give or take 30 %."""
    frequency = speed * rng.uniform(0.08, 0.6, (joints, 4))
    amplitude = rng.uniform(0.6, 1.4, (joints, 4)) / np.sqrt(frequency)
    amplitude *= 0.36 / np.sqrt((amplitude**2 / 2).sum(axis=1, keepdims=True))
    phase = rng.uniform(0, 2 * np.pi, (joints, 4))
    return Motion(amplitude, frequency, phase, 20.0, (0.3, float(rng.uniform(0.04, 0.09))))


class Runner:
    """One finger in MuJoCo, whose friction and extra torques are set before every step."""

    def __init__(self, physics: Physics) -> None:
        self.physics = physics
        self.model = compiled(physics, STEP)
        self.data = mujoco.MjData(self.model)
        m, n = physics.tendons, physics.joints
        self.motors = slice(0, m)
        self.hinges = slice(m, m + n)
        self.drags = physics.drags()
        self.rubbing = physics.rubbing()
        self.shares = [float(physics.edge[i, j] + (physics.pulley[i, j - 1] if j else 0.0)) for i, j in self.drags]
        mujoco.mj_forward(self.model, self.data)

    def tension(self) -> Array:
        """Force of every spring [N] at the state of the last forward pass."""
        m = self.physics.tendons
        stretch = self.data.ten_length[:m] - self.model.tendon_lengthspring[:m, 1]
        return np.asarray(self.physics.stiffness * np.maximum(0.0, stretch))

    def set_friction(self) -> None:
        """Frictionloss of tendons and joints in proportion to the force there, from proximal to distal."""
        p, m = self.physics, self.physics.tendons
        force = self.tension().tolist()  # falls (or grows) along the tendon by what rubbed in the step before
        rubbed = self.data.efc_force[len(self.rubbing) : len(self.rubbing) + len(self.drags)].tolist()
        losses = []
        for k, (i, _) in enumerate(self.drags):
            losses.append(self.shares[k] * force[i] + TINY)
            force[i] = max(force[i] - rubbed[k], 0.0)  # lengths count against x1
        self.model.tendon_frictionloss[m : m + len(self.drags)] = losses
        self.model.dof_frictionloss[self.hinges] = p.joint_friction

    def disturbance(self, t: float) -> Array:
        """Torques on the joints that MuJoCo has no element for [N·m], as they act."""
        p = self.physics
        q, torque = self.data.qpos[self.hinges], np.zeros(p.joints)
        if p.hardening:
            torque[p.hardening[0] - 1] -= p.hardening[1] * q[p.hardening[0] - 1] ** 3
        return torque

    def advance(self, t: float, motors: Array) -> None:
        """One step from time t."""
        self.set_friction()
        self.data.ctrl[self.motors] = motors
        self.data.qfrc_applied[self.hinges] = self.disturbance(t)
        mujoco.mj_step(self.model, self.data)


def run(physics: Physics, motion: Motion, seconds: float, rate: float) -> Trace:
    """Simulates and samples; the first SETTLE seconds are left out."""
    runner = Runner(physics)
    data = runner.data
    times = np.asarray(STEP * np.arange(-round(SETTLE / STEP), round(seconds / STEP)), dtype=float)
    motors = motion.motors(times, physics)
    data.qpos[runner.hinges] = motion.angles(times[:1])[0]
    data.qpos[runner.motors] = motors[0]
    mujoco.mj_forward(runner.model, data)
    every = round(1 / (rate * STEP))
    rows: list[tuple[Array, ...]] = []
    for k, t in enumerate(times.tolist(), start=-round(SETTLE / STEP)):
        angle, position = data.qpos[runner.hinges].copy(), data.qpos[runner.motors].copy()
        runner.advance(t, motors[k + round(SETTLE / STEP)])
        if k >= 0 and k % every == 0:  # the forces are those of the step's beginning
            rows.append((np.array([t]), angle, runner.tension(), position))
    time, *others = (np.array(column) for column in zip(*rows, strict=True))
    return Trace(time[:, 0], *others)
