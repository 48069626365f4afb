"""In MuJoCo: 3 joints and 6 elastic cords over pulleys that turn in journals of their own.

A cord is a chain of springs from the motor, over a pulley before each joint that it crosses, to the link behind its
last one. What a journal rubs (frictionloss of its hinge, held by MuJoCo's constraint solver) grows with the forces on
both sides of its pulley. Motors are inputs: they move the end of the first spring.
"""

from __future__ import annotations

import mujoco
import numpy as np

from evidence.families.finger import (
    CREEP,
    Array,
    Finger,
    Hidden,
    Trace,
    drift,
    edge_factor,
    extra_torque,
    hardening,
    true_arms,
)
from evidence.families.motion import Motion

JOINTS, RATE = 3, 500.0  # Hz
STEP, TICK, SETTLE = 0.0005, 0.001, 1.5  # s; friction is set at every tick
LINK, MASS, RADIUS, PULLEY = 0.03, 0.008, 0.008, 5e-7  # m, kg, m, kg·m²
SECTION = 2e4  # N/m, of a cord from one joint to the next
DAMPING = 2e-4  # s, of a cord between pulleys, over its stiffness
HARD, SOFT = 0.995, 0.87  # impedance of friction in journals and joints: they creep below 0.5 mm/s and 10 mrad/s
FREE, TINY = -1e3, 1e-9  # m: springs only pull; N·m: MuJoCo leaves out a frictionloss of 0


def mjcf(arms: Array, finger: Finger) -> str:
    """Joints `joint_j`, pulleys `pulley_i_j` on the body before joint j, parts of cords `run_i_s`."""
    m, n = arms.shape
    body = ""
    for j in reversed(range(n)):
        turning = "".join(
            f'<body gravcomp="1"><joint name="pulley_{i}_{j}" axis="0 -1 0" armature="{PULLEY}" frictionloss="1e-9" '
            f'solimpfriction="{HARD} {HARD} 0.001"/>'
            '<inertial pos="0 0 0" mass="1e-4" diaginertia="1e-9 1e-9 1e-9"/></body>'
            for i in range(m)
            if arms[i, j]
        )
        body = (
            f'<body pos="{j and LINK} 0 0" gravcomp="1"><joint name="joint_{j}" axis="0 -1 0" armature="5e-6" '
            f'stiffness="{finger.cover[j]}" springref="{finger.rest[j]}" damping="{finger.damping[j]}" '
            f'frictionloss="1e-9" solimpfriction="{SOFT} {SOFT} 0.001"/>'
            f'<inertial pos="{LINK / 2} 0 0" mass="{MASS}" diaginertia="1e-7 1e-6 1e-6"/>{body}'
            f"</body>{turning}"
        )
    runs = "".join(run(arms, finger, i, s) for i in range(m) for s in range(reach(arms, i) + 1))
    return f"""
<mujoco><compiler angle="radian"/>
  <option timestep="{STEP}" integrator="implicitfast" jacobian="dense" gravity="0 0 0"/>
  <default><joint solreffriction="0.002 1"/></default>
  <worldbody>{body}</worldbody><tendon>{runs}</tendon>
</mujoco>"""


def reach(arms: Array, i: int) -> int:
    """Number of joints that cord i (from 0) crosses."""
    return int(np.count_nonzero(arms[i]))


def first_part(finger: Finger, i: int, last: int) -> float:
    """Stiffness of cord i up to its first pulley [N/m]: that of all of it is the described one."""
    return float(1.0 / (1.0 / finger.stiffness[i] - last / SECTION))


def run(arms: Array, finger: Finger, i: int, s: int) -> str:
    """The part of cord i that comes to its pulley s from the one before; the last one ends at the link."""
    last = reach(arms, i)
    stiffness = SECTION if s else first_part(finger, i, last)
    ends = ""
    if s:
        ends = f'<joint joint="pulley_{i}_{s - 1}" coef="{RADIUS}"/>'
        ends += f'<joint joint="joint_{s - 1}" coef="{-arms[i, s - 1]}"/>'
    ends += f'<joint joint="pulley_{i}_{s}" coef="{-RADIUS}"/>' if s < last else ""
    return (
        f'<fixed name="run_{i}_{s}" stiffness="{stiffness}" damping="{DAMPING * stiffness if s else 0.0}" '
        f'springlength="{FREE} 0">{ends}</fixed>'
    )


class Mechanism:
    """A model with where its parts are, and what it hides."""

    def __init__(self, finger: Finger, hidden: Hidden) -> None:
        self.finger, self.hidden = finger, hidden
        self.arms = true_arms(finger.arms, hidden)
        self.model = mujoco.MjModel.from_xml_string(mjcf(self.arms, finger))
        self.data = mujoco.MjData(self.model)
        m, n = self.arms.shape
        passes = [(i, j) for i in range(m) for j in range(reach(self.arms, i))]
        self.rows, self.columns = (np.array(part) for part in zip(*passes, strict=True))
        self.hinges = np.array([self.model.joint(f"joint_{j}").dofadr[0] for j in range(n)])
        self.pulleys = np.array([self.model.joint(f"pulley_{i}_{j}").dofadr[0] for i, j in passes])
        self.lengths = np.zeros((self.model.ntendon, self.model.nv))  # of the runs, by coordinate
        for k, (begin, count) in enumerate(zip(self.model.tendon_adr, self.model.tendon_num, strict=True)):
            joints = self.model.wrap_objid[begin : begin + count]
            self.lengths[k, self.model.jnt_dofadr[joints]] = self.model.wrap_prm[begin : begin + count]
        self.first = np.array([self.model.tendon(f"run_{i}_0").id for i in range(m)])
        self.arriving = np.array([self.model.tendon(f"run_{i}_{j}").id for i, j in passes])
        self.stiffness = self.model.tendon_stiffness.reshape(self.model.ntendon, -1)[:, 0].copy()
        # of the whole cord; its first part takes all of it
        self.hardening = hardening(hidden, m) * (self.stiffness[self.first] / finger.stiffness) ** 3
        self.crept = np.zeros((1, n))

    def tension(self) -> Array:
        """[runs] N of every part of the cords where they are now: MuJoCo's own lengths are a step old."""
        stretch = self.lengths @ self.data.qpos - self.model.tendon_lengthspring[:, 1]
        return np.asarray(self.stiffness * np.maximum(stretch, 0.0))

    def pull(self, motors: Array) -> None:
        """Move the cords' ends; a spring that stiffens is one whose end moves further."""
        stretch = np.maximum(self.lengths[self.first] @ self.data.qpos + motors, 0.0)
        further = self.hardening * stretch**2 / self.stiffness[self.first]
        self.model.tendon_lengthspring[self.first, 1] = -(motors + further)

    def rub(self, t: float, tension: Array) -> None:
        """Set the friction of journals and joints by the forces there."""
        hidden, finger = self.hidden, self.finger
        load, speed = np.zeros_like(self.arms), np.zeros_like(self.arms)
        load[self.rows, self.columns] = 0.5 * (tension[self.arriving] + tension[self.arriving + 1])
        speed[self.rows, self.columns] = RADIUS * self.data.qvel[self.pulleys]
        lost = finger.edge * load * edge_factor(hidden, t, self.data.qpos[self.hinges], speed, load)
        if hidden.effect == "preload_friction":
            lost[hidden.i, 0] += hidden.size
        self.model.dof_frictionloss[self.pulleys] = RADIUS * lost[self.rows, self.columns] + TINY
        friction = finger.friction.copy()
        if hidden.effect == "joint_load_friction":
            friction[hidden.j] += hidden.size * tension[self.first].sum()
        self.model.dof_frictionloss[self.hinges] = friction * drift(hidden, t)

    def outside(self, t: float, angle: Array) -> Array:
        """[n] N·m on the joints that MuJoCo has no element for, as they act."""
        velocity = self.data.qvel[self.hinges][None]
        return np.asarray(-extra_torque(self.hidden, np.array([t]), angle[None], velocity, self.crept)[0])

    def advance(self, t: float, motors: Array) -> tuple[Array, Array]:
        """One tick: angle and force at its beginning."""
        data = self.data
        self.pull(motors)
        tension, angle = self.tension(), data.qpos[self.hinges].copy()
        self.rub(t, tension)
        self.crept += TICK * (angle - self.crept) / CREEP
        data.qfrc_applied[self.hinges] = self.outside(t, angle)
        mujoco.mj_step(self.model, data, round(TICK / STEP))
        return angle, tension[self.first]


def simulate(finger: Finger, hidden: Hidden, motion: Motion, seconds: float) -> Trace:
    """True signals at RATE; the first SETTLE seconds are left out."""
    return moved(Mechanism(finger, hidden), motion, seconds)


def moved(mechanism: Mechanism, motion: Motion, seconds: float) -> Trace:
    """The same of a mechanism."""
    finger = mechanism.finger
    before = round(SETTLE / TICK)
    time = np.asarray(TICK * np.arange(-before, round(seconds / TICK)), dtype=float)
    motors = motion.angles(time) @ finger.arms.T + motion.pull(time)[:, None] / finger.stiffness
    mechanism.data.qpos[mechanism.hinges] = motion.angles(time[:2])[0]
    mechanism.data.qpos[mechanism.pulleys] = motors[0][mechanism.rows] / RADIUS
    mujoco.mj_forward(mechanism.model, mechanism.data)
    every = round(1.0 / (RATE * TICK))
    rows = [mechanism.advance(t, motors[k]) for k, t in enumerate(time.tolist())]
    angle, force = (np.array(column)[before::every] for column in zip(*rows, strict=True))
    return Trace(time[before::every], angle, force, motors[before::every])
