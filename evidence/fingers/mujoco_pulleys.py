"""In MuJoCo: 3 joints and 6 tendons over pulleys that turn on hinges, with friction in their journals.

A tendon is a chain of springs from the motor, over a pulley before each joint that it crosses, to the link behind its
last one. A journal's friction grows with the forces on both sides of its pulley (frictionloss of its hinge).
"""

from __future__ import annotations

import mujoco
import numpy as np

from evidence.fingers.common_finger import (
    CREEP,
    Finger,
    Hidden,
    Motion,
    edge_friction,
    hidden_torque,
    joint_friction,
    signals,
    wobble,
)  # fmt: skip
from evidence.fingers.foreign import Array
from evidence.fingers.mujoco_run import random_motion

JOINTS, RATE = 3, 500.0  # Hz
LEFT = 0.003  # N·m rms that a diagnosis leaves with nothing hidden
STEP, TICK, SETTLE = 0.0005, 0.001, 1.0  # s; friction is set at every tick
LINK, RADIUS, PULLEY = 0.04, 0.008, 5e-7  # m, m, kg·m²
FREE = -1e3  # m, springs only pull


def mjcf(finger: Finger) -> str:
    """Joints `joint_j`, pulleys `pulley_i_j` on the body before joint j, tendons `run_i_s`, motors."""
    m, n = finger.arms.shape
    body = ""
    for j in reversed(range(n)):
        turning = "".join(
            f'<body gravcomp="1"><joint name="pulley_{i}_{j}" axis="0 -1 0" armature="{PULLEY}" frictionloss="1e-9"/>'
            '<inertial pos="0 0 0" mass="1e-4" diaginertia="1e-9 1e-9 1e-9"/></body>'
            for i in range(m) if finger.arms[i, j]
        )  # fmt: skip
        body = (
            f'<body pos="{j and LINK} 0 0" gravcomp="1"><joint name="joint_{j}" axis="0 -1 0" armature="2e-5" '
            f'stiffness="{finger.cover[j]}" springref="{finger.rest[j]}" damping="{finger.damping[j]}" '
            f'frictionloss="1e-9"/><inertial pos="{LINK / 2} 0 0" mass="0.015" diaginertia="1e-7 2e-6 2e-6"/>{body}'
            f"</body>{turning}"
        )
    motors = "".join(
        f'<body gravcomp="1"><joint name="motor_{i}" type="slide" axis="1 0 0"/>'
        '<inertial pos="0 0 0" mass="0.4" diaginertia="1e-4 1e-4 1e-4"/></body>'
        for i in range(m)
    )
    runs = "".join(run(finger, i, s) for i in range(m) for s in range(reach(finger, i) + 1))
    drives = "".join(f'<position joint="motor_{i}" kp="40000" kv="240"/>' for i in range(m))
    return f"""
<mujoco><compiler angle="radian"/>
  <option timestep="{STEP}" integrator="implicitfast" jacobian="dense" gravity="0 0 0"/>
  <default><joint solreffriction="0.002 1" solimpfriction="0.999 0.999 0.001"/></default>
  <worldbody>{motors}{body}</worldbody><tendon>{runs}</tendon><actuator>{drives}</actuator>
</mujoco>"""


def reach(finger: Finger, i: int) -> int:
    return int(np.count_nonzero(finger.arms[i]))


def run(finger: Finger, i: int, s: int) -> str:
    """The part of tendon i that comes to its pulley s from the one before; the last one ends at the link."""
    last = reach(finger, i)
    stiffness = finger.stiffness[i] / (0.6 if s == 0 else 0.4 / last)
    ends = f'<joint joint="motor_{i}" coef="1"/>'
    if s:
        ends = f'<joint joint="pulley_{i}_{s - 1}" coef="{RADIUS}"/>'
        ends += f'<joint joint="joint_{s - 1}" coef="{-finger.arms[i, s - 1]}"/>'
    ends += f'<joint joint="pulley_{i}_{s}" coef="{-RADIUS}"/>' if s < last else ""
    return f'<fixed name="run_{i}_{s}" stiffness="{stiffness}" springlength="{FREE} 0">{ends}</fixed>'


class Mechanism:
    """A model with where its parts are, and what it hides."""

    def __init__(self, finger: Finger, hidden: Hidden) -> None:
        self.finger, self.hidden = finger, hidden
        self.model = mujoco.MjModel.from_xml_string(mjcf(finger))
        self.data = mujoco.MjData(self.model)
        m, n = finger.arms.shape
        self.passes = [(i, j) for i in range(m) for j in range(reach(finger, i))]
        self.motors = [self.model.joint(f"motor_{i}").dofadr[0] for i in range(m)]
        self.hinges = [self.model.joint(f"joint_{j}").dofadr[0] for j in range(n)]
        self.pulleys = [self.model.joint(f"pulley_{i}_{j}").dofadr[0] for i, j in self.passes]
        self.runs = [[self.model.tendon(f"run_{i}_{s}").id for s in range(reach(finger, i) + 1)] for i in range(m)]
        self.rows, self.columns = (np.array(part) for part in zip(*self.passes, strict=True))
        self.first = np.array([runs[0] for runs in self.runs])
        self.arriving = np.array([self.runs[i][j] for i, j in self.passes])
        self.stiffness = self.model.tendon_stiffness.reshape(self.model.ntendon, -1)[:, 0]  # a polynomial's, if any
        self.rest = np.zeros((1, n))

    def tension(self) -> Array:
        stretch = self.data.ten_length - self.model.tendon_lengthspring[:, 1]
        return np.asarray(self.stiffness * np.maximum(stretch, 0.0))

    def advance(self, t: float, motors: Array) -> tuple[Array, ...]:
        """One tick: angle, velocity, speed, load of the pulleys, force, position, extra torque; then what rubs."""
        d, finger, hidden = self.data, self.finger, self.hidden
        shape = (1, *finger.arms.shape)
        time, angle, velocity = np.array([t]), d.qpos[self.hinges][None], d.qvel[self.hinges][None]
        if hidden.effect == "pulley_eccentricity":
            self.model.tendon_lengthspring[self.runs[hidden.tendon][hidden.joint + 1], 1] = wobble(
                hidden, angle[:, hidden.joint]
            )[1][0]
        tension = self.tension()
        load, speed = np.zeros(shape), np.zeros(shape)
        load[0, self.rows, self.columns] = 0.5 * (tension[self.arriving] + tension[self.arriving + 1])
        speed[0, self.rows, self.columns] = RADIUS * d.qvel[self.pulleys]
        force = tension[self.first][None]
        edges = edge_friction(finger, hidden, time, angle, speed, load)[0, self.rows, self.columns]
        joints = joint_friction(finger, hidden, time, velocity, force)[0]
        self.model.dof_frictionloss[self.pulleys] = RADIUS * edges + 1e-9
        self.model.dof_frictionloss[self.hinges] = joints
        self.rest += TICK * (angle - self.rest) / CREEP
        extra = hidden_torque(hidden, finger, time, angle, self.rest, force)
        if hidden.effect == "pulley_eccentricity":  # the force behind the pulley
            behind = tension[self.runs[hidden.tendon][hidden.joint + 1]]
            extra *= behind / max(force[0, hidden.tendon], 1e-9)
        d.qfrc_applied[self.hinges] = -extra[0]
        d.ctrl[:] = motors
        position = d.qpos[self.motors][None].copy()
        mujoco.mj_step(self.model, d, round(TICK / STEP))
        z_edge = np.zeros(shape)
        z_edge[0, self.rows, self.columns] = -d.qfrc_constraint[self.pulleys] / (RADIUS * edges + 1e-9)
        z_joint = -d.qfrc_constraint[self.hinges][None] / (joints + 1e-9)
        return time, angle, velocity, speed, z_edge, z_joint, force, position, extra


def simulate(
    finger: Finger, hidden: Hidden, seconds: float, rng: np.random.Generator, machine: int
) -> dict[str, Array]:
    """Forces, positions and angles without noise."""
    mechanism = Mechanism(finger, hidden)
    aims = random_motion(len(finger.cover), rng)
    times = np.asarray(TICK * np.arange(-round(SETTLE / TICK), round(seconds / TICK)), dtype=float)
    share, frequency = aims.breathing
    pull = aims.pretension * (1 + share * np.sin(2 * np.pi * frequency * times))
    motors = aims.angles(times) @ finger.arms.T + pull[:, None] / finger.stiffness
    every, rows = round(1.0 / (RATE * TICK)), []
    for k, t in enumerate(times.tolist(), start=-round(SETTLE / TICK)):
        row = mechanism.advance(t, motors[k + round(SETTLE / TICK)])
        if k >= 0 and k % every == 0:
            rows.append(row)
    time, angle, velocity, speed, z_edge, z_joint, force, position, extra = (
        np.concatenate(column) for column in zip(*rows, strict=True)
    )
    motion = Motion(time, angle, velocity, speed, z_edge, z_joint)
    return signals(finger, hidden, motion, force, position, extra)
