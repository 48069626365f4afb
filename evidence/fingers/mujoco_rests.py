"""Fingers in MuJoCo that move from posture to posture and stand in between, with and without pushes on the fingertip.

The motors stand during a rest, and a push acts on the tip while they do. Rows are those of mujoco_run.py; the push is a
force on the end of the last link at right angles to it, which MuJoCo turns into joint torques.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pandas as pd

from evidence.fingers.foreign import Array, Nominal, Truth, frame, noisy, quantised
from evidence.fingers.mujoco_cases import PLANS, describe, finger
from evidence.fingers.mujoco_model import LINK, Physics
from evidence.fingers.mujoco_run import SETTLE, STEP, Runner

MOVE = 0.8  # s
REST, LEAD = (2.0, 60.0), (1.2, 30.0)  # s: without a push; from the stop to the push; evenly in their logarithm
HOLD, AFTER = 1.5, 1.5  # s: held; until the next move
RISES = (0.05, 0.5)  # s
FALL = 0.1  # s
FORCES = (0.05, 1.0)  # N, evenly in their logarithm
SPREAD = 0.35  # rad, of postures


@dataclasses.dataclass(frozen=True)
class Push:
    """start: s, the rise begins. rise, hold: s. force: N on the fingertip, at right angles to the last link."""

    start: float
    rise: float
    hold: float
    force: float

    @property
    def end(self) -> float:
        return self.start + self.rise + self.hold + FALL

    def at(self, t: float) -> float:
        up = min(max((t - self.start) / self.rise, 0.0), 1.0)
        return self.force * up * min(max((self.end - t) / FALL, 0.0), 1.0)


@dataclasses.dataclass(frozen=True)
class Rests:
    """A finger and what it does. time [T], angles [T, n]: postures at the ends of its moves. pretension: N."""

    physics: Physics
    nominal: Nominal
    rate: float
    pretension: float
    time: Array
    angles: Array
    pushes: tuple[Push, ...]

    @property
    def seconds(self) -> float:
        return float(self.time[-1])

    def motors(self, time: Array) -> Array:
        """x0 [N, m] m: postures joined by minimum-jerk moves."""
        at = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2)
        share = np.clip((time - self.time[at]) / (self.time[at + 1] - self.time[at]), 0.0, 1.0)[:, None]
        smooth = share**3 * (10 - 15 * share + 6 * share**2)
        angles = self.angles[at] + smooth * (self.angles[at + 1] - self.angles[at])
        return np.asarray(angles @ self.physics.arms.T + self.pretension / self.physics.stiffness)


def rests(number: int, seconds: float, pushed: bool, seed: int = 1, pretension: float = 20.0) -> Rests:
    """The finger of a case of mujoco_cases.py that hides nothing, at rest most of the time."""
    plan = PLANS[number - 1]
    if plan.hidden != "none":
        raise ValueError(f"case {number} hides {plan.hidden}; expected one that hides nothing")
    of_finger, of_motion = np.random.default_rng(7100 + number), np.random.default_rng((seed, number, int(pushed)))
    physics = finger(plan, of_finger)
    nominal = describe(physics, plan, of_finger)
    time, angles, pushes = [0.0, 0.5], [np.zeros(plan.joints)] * 2, []
    while time[-1] < seconds:
        stop = time[-1] + MOVE
        rise, force = RISES[len(pushes) % 2], between(FORCES, of_motion) * float(of_motion.choice((-1.0, 1.0)))
        push = Push(stop + between(LEAD, of_motion), rise, HOLD, force)
        leave = push.end + AFTER if pushed else stop + between(REST, of_motion)
        posture = SPREAD * of_motion.uniform(-1.0, 1.0, plan.joints)
        time, angles = [*time, stop, leave], [*angles, posture, posture]
        pushes += [push] if pushed else []
    return Rests(physics, nominal, plan.rate, pretension, np.array(time), np.array(angles), tuple(pushes))


def between(ends: tuple[float, float], random: np.random.Generator) -> float:
    """A number between two ends, evenly distributed in its logarithm."""
    return float(np.exp(random.uniform(*np.log(ends))))


class PushedRunner(Runner):
    """A finger with a force on its tip."""

    def __init__(self, case: Rests) -> None:
        super().__init__(case.physics, Truth("none", case.physics.joints))
        self.pushes = case.pushes
        self.tip = int(self.model.body_rootid.size - 1)

    def disturbance(self, t: float) -> Array:
        force = sum(push.at(t) for push in self.pushes if push.start <= t < push.end)
        if force == 0.0:
            return np.zeros(self.physics.joints)
        body = self.data.body(self.tip)
        along, _, across = body.xmat.reshape(3, 3).T
        moving = np.zeros((3, self.model.nv))  # m/s of the tip by each velocity
        mujoco.mj_jac(self.model, self.data, moving, None, body.xpos + LINK * along, self.tip)
        return np.asarray((moving.T @ (force * across))[self.hinges])


@dataclasses.dataclass(frozen=True)
class Record:
    """recording: columns of a recording. angle [N, n] rad: the true one."""

    recording: pd.DataFrame
    angle: Array


def record(case: Rests, seed: int = 1) -> Record:
    """The recording by the sensors of mujoco_cases.py: 20 mN of noise, positions to 1 µm, angles to 0.1 mrad."""
    runner = PushedRunner(case)
    data = runner.data
    times = STEP * np.arange(-round(SETTLE / STEP), round(case.seconds / STEP))
    motors = case.motors(times)
    data.qpos[runner.hinges], data.qpos[runner.motors] = case.angles[0], motors[0]
    mujoco.mj_forward(runner.model, data)
    every = round(1 / (case.rate * STEP))
    rows = []
    for k, t in enumerate(times.tolist(), start=-round(SETTLE / STEP)):
        if k >= 0 and k % every == 0:
            rows.append((t, data.qpos[runner.hinges].copy(), runner.tension(), data.qpos[runner.motors].copy()))
        runner.advance(t, motors[k + round(SETTLE / STEP)])
    time, angle, force, position = (np.array(column) for column in zip(*rows, strict=True))
    random = np.random.default_rng((seed, 2))
    measured = noisy(force, 0.02, random), quantised(position, 1e-6), quantised(angle, 1e-4)
    return Record(frame(time, *measured), angle)
