"""Recordings of MuJoCo fingers for contact detection: free motion and labelled pushes, each with its truth.

The fingers are those of evidence/fingers. A push is a force on a link, at right angles to it, of 0.1 to 2 N, uniform in
the logarithm, that begins anywhere in a slot of 6 s.  What is there is kept.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from evidence.cases import write
from evidence.fingers.foreign import frame, noisy, quantised
from evidence.fingers.mujoco_cases import PLANS, Plan, describe, finger
from evidence.fingers.mujoco_model import LINK, Physics
from evidence.fingers.mujoco_run import SETTLE, STEP, Motion, Runner, random_motion
from tendonfmu.arrays import Numbers
from tendonfmu.files import whole_file

PRETENSIONS = (15.0, 30.0)  # N, each breathing by 30 %
RATE = 250.0  # Hz
SECONDS = {"free": 390.0, "more": 390.0, "push": 300.0}  # s, of one recording; "more" is free, too
FREE, PUSHED = ("free", "more"), ("push",)
SLOT = 6.0  # s, of one push
EARLIEST, LATEST = 0.5, 4.4  # s into its slot that a push begins
FORCE = (0.1, 2.0)  # N
RISE, HOLD = (0.01, 0.05), (0.3, 1.0)  # s; it falls as it rises
SEEDS = {"more": 1, "free": 2, "push": 3}  # of a kind of recording
STRETCH, STILL, RAMP = (6.0, 13.0), (0.7, 2.0), 0.3  # s of motion, of rest, and from one to the other


@dataclasses.dataclass(frozen=True)
class Push:
    begin: float  # s
    end: float
    force: float  # N, along the positive angle or against it
    link: int  # from 0
    rise: float  # s

    def at(self, t: float) -> float:
        """N: a cosine up, a hold, a cosine down."""
        part = min(t - self.begin, self.end - t) / self.rise
        return 0.0 if part <= 0.0 else self.force * 0.5 * (1.0 - float(np.cos(np.pi * min(part, 1.0))))


class Pushed(Runner):
    """A finger that is pushed."""

    def __init__(self, physics: Physics, pushes: list[Push]) -> None:
        super().__init__(physics)
        self.pushes = pushes
        self.bodies = [int(self.model.jnt_bodyid[self.hinges.start + j]) for j in range(physics.joints)]
        self.torque = np.zeros(physics.joints)

    def disturbance(self, t: float) -> Numbers:
        """Torques of the hidden effects and of the push [N·m]; keeps the push's own in `torque`."""
        self.torque = np.zeros(self.physics.joints)
        push = next((push for push in self.pushes if push.begin <= t <= push.end), None)
        if push is not None:
            body = self.bodies[push.link]
            turned = self.data.xmat[body].reshape(3, 3)
            point = self.data.xpos[body] + turned @ np.array([LINK / 2, 0.0, 0.0])
            torque = np.zeros(self.model.nv)
            force = turned @ np.array([0.0, 0.0, push.at(t)])
            mujoco.mj_applyFT(self.model, self.data, force, np.zeros(3), point, body, torque)
            self.torque = torque[self.hinges]
        return np.asarray(super().disturbance(t) + self.torque)


def own_time(seconds: float, rng: np.random.Generator) -> Numbers:
    """[N] s of the motion at every step: it goes on during stretches and stands still between them."""
    steps = round((seconds + SETTLE) / STEP)
    speed = np.ones(steps)
    at = 0.0
    while at < seconds:
        at += rng.uniform(*STRETCH)
        until = at + rng.uniform(*STILL)
        time = np.arange(steps) * STEP
        speed = np.minimum(speed, np.clip(np.maximum(at - time, time - until) / RAMP, 0.0, 1.0))
    smooth = speed * speed * (3.0 - 2.0 * speed)
    return np.asarray(np.cumsum(smooth) * STEP - SETTLE)


def planned(joints: int, rng: np.random.Generator) -> list[Push]:
    """One push in each slot."""
    pushes = []
    for k in range(int(SECONDS["push"] // SLOT)):
        begin = k * SLOT + rng.uniform(EARLIEST, LATEST)
        rise = rng.uniform(*RISE)
        force = float(np.exp(rng.uniform(*np.log(FORCE)))) * (1.0 if rng.random() < 0.5 else -1.0)
        end = begin + rng.uniform(*HOLD) + 2.0 * rise
        pushes.append(Push(begin, end, force, int(rng.integers(joints)), rise))
    return pushes


def simulated(physics: Physics, plan: Plan, motion: Motion, seconds: float, pushes: list[Push], seed: list[int]) -> Any:
    """The recording, labelled where pushes act, as a frame."""
    rng = np.random.default_rng(seed)
    runner = Pushed(physics, pushes)
    motors = motion.motors(own_time(seconds, rng), physics)
    data = runner.data
    data.qpos[runner.hinges] = motion.angles(np.array([-SETTLE]))[0]
    data.qpos[runner.motors] = motors[0]
    mujoco.mj_forward(runner.model, data)
    every, first = round(1 / (RATE * STEP)), round(SETTLE / STEP)
    rows: list[tuple[Numbers, ...]] = []
    for k, row in enumerate(motors, start=-first):
        t = k * STEP
        if k >= 0 and k % every == 0:
            kept = (data.qpos[runner.hinges].copy(), runner.tension(), data.qpos[runner.motors].copy(), runner.torque)
            rows.append((np.array([t]), *kept))
        runner.advance(t, row)
    time, angle, force, position, torque = (np.array(column) for column in zip(*rows, strict=True))
    force = noisy(force, 0.02, rng)
    table = frame(time[:, 0], force, quantised(position, 1e-6), quantised(angle, 1e-4))
    if pushes:
        label = np.zeros(len(table))
        for push in pushes:
            label[(table["time"] >= push.begin) & (table["time"] <= push.end)] = 1.0
        table["contact"] = label
        for j, column in enumerate(torque.T):
            table[f"external_torque[{j + 1}]"] = -column  # as the tendons bear it
    return table


def place(folder: Path, number: int, kind: str, pretension: float) -> Path:
    """File of a recording."""
    return folder / f"mujoco_{number:02d}_{kind}_{pretension:g}.parquet"


def description_file(folder: Path, number: int) -> Path:
    """The rough description of a finger, without what is hidden."""
    return folder / f"mujoco_{number:02d}.json"


def make(folder: Path, number: int, kinds: tuple[str, ...] = FREE + PUSHED) -> None:
    """All recordings of a finger of PLANS (from 1) that are missing."""
    plan = PLANS[number]
    rng = np.random.default_rng(7100 + number)  # as evidence/fingers makes it
    plain = finger(plan, rng)
    physics = dataclasses.replace(plain, **plan.add(plain))
    if not description_file(folder, number).exists():
        write(description_file(folder, number), describe(plain, plan, rng))
    for kind in kinds:
        for pretension in PRETENSIONS:
            file = place(folder, number, kind, pretension)
            if file.exists():
                continue
            seed = [number, SEEDS[kind], round(pretension)]
            draws = np.random.default_rng([*seed, 1])
            motion = dataclasses.replace(random_motion(plan.joints, draws, plan.speed), pretension=pretension)
            pushes = planned(plan.joints, draws) if kind in PUSHED else []
            table = simulated(physics, plan, motion, SECONDS[kind], pushes, [*seed, 2])
            with whole_file(file) as temporary:
                table.to_parquet(temporary)
