"""Runs a finger of mujoco_model.py along a motion; keeps what sensors see and what only the simulator knows."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
from foreign_case import Array, Truth
from mujoco_model import Physics, compiled

STEP = 0.001  # s
SETTLE = 1.5  # s before the recording begins


@dataclasses.dataclass
class Trace:
    """True signals of a run, a row a sample. Rᵀ f0 = described + hidden, as torques that the tendons have to bear."""

    time: Array  # s, from 0
    angle: Array  # rad
    force: Array  # N
    position: Array  # m, x0
    described: Array  # N·m, all that the description has a term for, and inertia
    hidden: Array  # N·m, the rest


@dataclasses.dataclass
class Motion:
    """Random multi-sines of the joints and a pretension that breathes, and the motors' positions for both."""

    amplitude: Array  # rad, (joints, sines)
    frequency: Array  # Hz
    phase: Array  # rad
    pretension: float  # N
    breathing: tuple[float, float]  # share of the pretension, Hz

    def angles(self, t: float) -> Array:
        return np.asarray((self.amplitude * np.sin(2 * np.pi * self.frequency * t + self.phase)).sum(axis=1))

    def motors(self, t: float, physics: Physics) -> Array:
        """x0 of every tendon [m] that would hold the angles if nothing rubbed."""
        share, frequency = self.breathing
        force = self.pretension * (1 + share * np.sin(2 * np.pi * frequency * t))
        return np.asarray(physics.arms @ self.angles(t) + force / physics.stiffness)


def random_motion(joints: int, rng: np.random.Generator, speed: float = 1.0) -> Motion:
    """Four sines a joint of 0.08 to 0.6 Hz times `speed`, 0.36 rad rms; 20 N of pretension, give or take 30 %."""
    frequency = speed * rng.uniform(0.08, 0.6, (joints, 4))
    amplitude = rng.uniform(0.6, 1.4, (joints, 4)) / np.sqrt(frequency)
    amplitude *= 0.36 / np.sqrt((amplitude**2 / 2).sum(axis=1, keepdims=True))
    phase = rng.uniform(0, 2 * np.pi, (joints, 4))
    return Motion(amplitude, frequency, phase, 20.0, (0.3, float(rng.uniform(0.04, 0.09))))


class Runner:
    """One finger in MuJoCo: sets friction and extra torques before every step, reads the balance after it."""

    def __init__(self, physics: Physics, truth: Truth) -> None:
        self.physics = physics
        self.truth = truth
        self.model = compiled(physics, STEP)
        self.data = mujoco.MjData(self.model)
        m, n = physics.tendons, physics.joints
        self.motors = slice(0, m)
        self.hinges = slice(m, m + n)
        self.drags = physics.drags()
        self.rubbing = physics.rubbing()
        # per friction row of MuJoCo, joints before tendons: the share of its force that the description lacks
        self.lacking = np.zeros(len(self.rubbing) + len(self.drags))
        self.crept = np.zeros(n)
        mujoco.mj_forward(self.model, self.data)

    def tension(self) -> Array:
        """Force of every spring [N] at the state of the last forward pass."""
        m = self.physics.tendons
        stretch = self.data.ten_length[:m] - self.model.tendon_lengthspring[:m, 1]
        return np.asarray(self.physics.stiffness * np.maximum(0.0, stretch))

    def set_friction(self, t: float) -> None:
        """Frictionloss of tendons and joints in proportion to the force there, from proximal to distal."""
        p, m = self.physics, self.physics.tendons
        drift = 1.0 + (p.drift[0] * (1 - np.exp(-max(t, 0.0) / p.drift[1])) if p.drift else 0.0)
        losses = np.zeros(len(self.drags))
        force = self.tension()  # falls (or grows) along the tendon by what rubbed in the step before
        rubbed = self.data.efc_force[len(self.rubbing) : len(self.lacking)]
        along = np.where(p.arms != 0.0, force[:, None], 0.0)
        for k, (i, j) in enumerate(self.drags):
            share = p.edge[i, j] + (p.pulley[i, j - 1] if j else 0.0)
            constant = p.preload[1] if p.preload and (p.preload[0] - 1, 0) == (i, j) else 0.0
            stribeck = self.stribeck(k)
            losses[k] = drift * stribeck * (share * force[i] + constant) + 1e-9  # a row of 0 would go
            self.lacking[len(self.rubbing) + k] = self.lacks_here(i, j, drift, stribeck, constant / losses[k])
            force[i] = max(force[i] - rubbed[k], 0.0)  # lengths count against x1
            along[i, j:] = np.where(p.arms[i, j:] != 0.0, force[i], 0.0)
        self.model.tendon_frictionloss[m : m + len(self.drags)] = losses
        loss = drift * (p.joint_friction + p.load_friction * along.sum(axis=0))
        self.model.dof_frictionloss[self.hinges] = loss
        for k, j in enumerate(self.rubbing):
            hidden = self.truth.hidden == "joint_friction" and self.truth.joint == j + 1
            self.lacking[k] = 1.0 if hidden else 1 - 1 / drift

    def lacks_here(self, i: int, j: int, drift: float, stribeck: float, constant: float) -> float:
        """Share of a tendon's friction that the description lacks; `constant` is that of its preload friction."""
        if self.truth.hidden == "edge_friction":
            return float((self.truth.tendon, self.truth.joint) == (i + 1, j + 1))
        return constant if self.truth.hidden == "preload_friction" else 1 - 1 / (drift * stribeck)

    def stribeck(self, drag: int) -> float:
        if not self.physics.stribeck:
            return 1.0
        share, speed = self.physics.stribeck
        return float(1 + share * np.exp(-abs(self.data.ten_velocity[self.physics.tendons + drag]) / speed))

    def disturbance(self, t: float) -> Array:
        """Torques on the joints that MuJoCo has no element for [N·m], as they act."""
        p = self.physics
        q, v = self.data.qpos[self.hinges], self.data.qvel[self.hinges]
        torque = np.zeros(p.joints)
        if p.hardening:
            torque[p.hardening[0] - 1] -= p.hardening[1] * q[p.hardening[0] - 1] ** 3
        if p.hum:
            torque[p.hum[0] - 1] += p.hum[1] * np.sin(2 * np.pi * p.hum[2] * t)
        if p.catch and v[p.catch[0] - 1] > 0.0:
            torque[p.catch[0] - 1] -= p.catch[1] * np.exp(-(((q[p.catch[0] - 1] - p.catch[2]) / 0.06) ** 2))
        if p.creep:
            j, stiffness, memory = p.creep[0] - 1, p.creep[1], p.creep[2]
            torque[j] -= stiffness * (q[j] - self.crept[j])
            self.crept[j] += STEP * (q[j] - self.crept[j]) / memory
        return torque

    def push(self, t: float) -> float:
        """Force on the probe [N]; it goes back up when nobody pushes."""
        return next((force for begin, end, force in self.physics.pushes if begin <= t < end), -0.5)

    def advance(self, t: float, motors: Array) -> Array:
        """One step from time t; returns the extra torques that act in it."""
        self.set_friction(t)
        self.data.ctrl[self.motors] = motors
        if self.physics.pushes:
            self.data.ctrl[self.physics.tendons] = self.push(t)
        extra = self.disturbance(t)
        self.data.qfrc_applied[self.hinges] = extra
        mujoco.mj_step(self.model, self.data)
        return extra

    def balance(self, q: Array, v: Array, extra: Array) -> tuple[Array, Array]:
        """What is described and what is hidden [N·m] at the start (q, v) of the step just made."""
        d, h, p, truth = self.data, self.hinges, self.physics, self.truth
        rows = len(self.lacking)
        rubbed = d.efc_J.reshape(-1, self.model.nv)[:rows, h] * d.efc_force[:rows, None]
        inertia = np.zeros(self.model.nv)
        mujoco.mj_mulM(self.model, d, inertia, d.qacc)
        weight = d.qfrc_bias[h] - d.qfrc_gravcomp[h]  # with what spins, which is small
        touching = d.qfrc_constraint[h] - rubbed.sum(axis=0)
        cover, damping = p.cover * (q - p.rest_angle), p.damping * v
        coupled = self.coupled(q)
        bent = self.tension() @ p.arms - (d.qfrc_spring[h] + cover + coupled)  # by arms that are not the described ones
        here = np.array([truth.joint in (None, j + 1) for j in range(p.joints)], float)
        hidden = -self.lacking @ rubbed + coupled - extra - touching + bent
        hidden += weight * bool(p.heavy) + cover * here * (truth.hidden == "cover_stiffness")
        hidden += damping * here * (truth.hidden == "viscous_friction")
        total = -rubbed.sum(axis=0) + coupled - extra - touching + bent + weight + cover + damping + inertia[h]
        return total - hidden, hidden

    def coupled(self, q: Array) -> Array:
        torque = np.zeros(self.physics.joints)
        if self.physics.coupling:
            j, stiffness = self.physics.coupling
            torque[j - 1 : j + 1] = stiffness * (q[j - 1] - q[j]) * np.array([1.0, -1.0])
        return torque


def run(physics: Physics, truth: Truth, motion: Motion, seconds: float, rate: float) -> Trace:
    """Simulates and samples; the first SETTLE seconds are left out."""
    runner = Runner(physics, truth)
    data = runner.data
    data.qpos[runner.hinges] = motion.angles(-SETTLE)
    data.qpos[runner.motors] = motion.motors(-SETTLE, physics)
    mujoco.mj_forward(runner.model, data)
    every = round(1 / (rate * STEP))
    rows: list[tuple[Array, ...]] = []
    for k in range(-round(SETTLE / STEP), round(seconds / STEP)):
        t = k * STEP
        q, v, x0 = data.qpos[runner.hinges].copy(), data.qvel[runner.hinges].copy(), data.qpos[runner.motors].copy()
        extra = runner.advance(t, motion.motors(t, physics))
        if k >= 0 and k % every == 0:
            rows.append((np.array([t]), q, runner.tension(), x0, *runner.balance(q, v, extra)))
    time, *others = (np.array(column) for column in zip(*rows, strict=True))
    return Trace(time[:, 0], *others)
