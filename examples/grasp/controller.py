"""What stands between the two FMUs of a grasp, whichever master steps them: the plate and the controller.

`Loop.step` makes the inputs of the next step of the outputs of both FMUs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEP = 0.001  # s
JOINTS, TENDONS, SPACE = range(1, 5), range(1, 9), range(1, 4)

# the hand as its controller knows it; moment arms and thresholds are parameters of the friction FMU
LINKS = np.array([0.045, 0.028, 0.022])  # m
START = np.array([0.0, 0.1, 0.2, 0.15])  # rad, first posture of the rig
CLOSING = np.array([0.0, 1.0, 0.9, 0.6])  # rad per rad of the closing coordinate c
RIG_PRETENSION = 10.0  # N
NEVER = 1e3  # N·m, a threshold that no torque reaches


def numbered(name: str, numbers: Sequence[int]) -> list[str]:
    return [f"{name}[{i}]" for i in numbers]


def tip_position(angles: Array) -> Array:
    """[3] m, fingertip in the base frame at joint angles [4], without abduction."""
    bend = np.cumsum(angles[1:])
    return np.array([LINKS @ np.cos(bend), 0.0, -LINKS @ np.sin(bend)])


def tip_motion(angles: Array) -> Array:
    """[3] m/rad, motion of the fingertip by the closing coordinate."""
    bend, turn = np.cumsum(angles[1:]), LINKS * np.cumsum(CLOSING[1:])
    return np.array([-turn @ np.sin(bend), 0.0, -turn @ np.cos(bend)])


@dataclass(frozen=True)
class Task:
    """What is done. `compensated`: contact by the friction FMU, force from `compensated_torque`.

    Otherwise both from `joint_torque`: contact where it differs by more than raw_threshold [4] N·m from its mean of the
    last raw_time s or so; force from its difference to that mean before the contact, and raw_offset N.
    """

    compensated: bool = True
    pretension: float = RIG_PRETENSION  # N
    speed: float = 0.2  # rad/s, of the closing coordinate
    way: tuple[float, ...] = (0.35, 0.25, 0.8)  # rad, its targets after the warm-up, with a pause of 0.5 s at each
    touch: float | None = 0.4  # rad, where the fingertip meets the plate; None: there is none
    forces: tuple[float, ...] = (0.5, 1.0)  # N, held one after the other
    hold: float = 6.0  # s, each
    stroke: float = 0.003  # m, of the plate, forth and back, while a force is held
    frequency: float = 0.5  # Hz
    threshold_scale: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)  # per joint, on the thresholds of the friction FMU
    raw_threshold: tuple[float, ...] = (0.0085, 0.070, 0.044, 0.024)
    raw_time: float = 2.0
    raw_offset: float = 0.0
    integral: float = 4.0  # rad/s per N
    proportional: float = 0.02  # rad per N


class Plate:
    """A rigid plate across the way of the fingertip, which moves along its normal: the rig's obstacle cannot move."""

    STIFFNESS = 1000.0  # N/m, of the fingertip's pad

    def __init__(self, task: Task) -> None:
        angles = START + (task.touch or 0.0) * CLOSING
        self.task, self.place = task, tip_position(angles)
        self.normal = -tip_motion(angles) / np.linalg.norm(tip_motion(angles))

    def force(self, tip: Array, held: float) -> float:
        """N, on a fingertip at [3] m, `held` s after the first force was asked for."""
        if self.task.touch is None:
            return 0.0
        moved = self.task.stroke * math.sin(2.0 * math.pi * self.task.frequency * held)
        return self.STIFFNESS * max(0.0, float(self.normal @ (self.place - tip)) + moved)


class Loop:
    """Plate and controller: `step` takes outputs of both FMUs, named by PLANT and FRICTION, and gives their inputs.

    The friction FMU gets the phase of a grasp through its thresholds. In the warm-up none is passed, so that the bias
    learns: the finger starts at rest, where friction may have either sign. After the stop all are, so that it stays:
    a held force is no friction, however small.
    """

    PLANT = numbered("tendon_position", TENDONS) + numbered("truth.tip_position", SPACE)
    TORQUES = numbered("compensated_torque", JOINTS) + numbered("joint_torque", JOINTS)
    FRICTION = TORQUES + numbered("joint_angle", JOINTS)
    INPUTS = numbered("tendon_position_command", TENDONS) + numbered("push_force", SPACE)
    ARMS = tuple(f"tendons[{i}].moment_arms[{j}]" for i in TENDONS for j in JOINTS)
    THRESHOLDS = numbered("contact.threshold", JOINTS) + numbered("contact.threshold_per_force", JOINTS)
    WARM_UP, ARMED = 0.2, 0.1  # rad: there and back; from which on a contact counts
    PAUSE, REST = 0.5, 0.4  # s: on the way; between stop and force control

    def __init__(self, task: Task, arms: Sequence[float], thresholds: Sequence[float]) -> None:
        self.task, self.plate = task, Plate(task)
        self.pull = np.reshape(arms, (len(TENDONS), len(JOINTS))) @ CLOSING  # m of tendon per rad of c
        self._armed = np.tile(task.threshold_scale, 2) * np.array(thresholds)
        self._way = [(target, task.speed, self.PAUSE) for target in task.way]
        self._way = [(self.WARM_UP, task.speed, 0.0), (0.0, task.speed, 0.0), (self.ARMED, task.speed, 0.0), *self._way]
        self.phase, self.c, self.stopped_at, self.held_at = "warm up", 0.0, math.nan, math.nan
        self.force = self.estimate = self._sum = self._waited = 0.0
        self._mean: Array | None = None  # N·m, of joint_torque
        self._start: Array | None = None  # m, of the motors

    def step(self, now: float, plant: Array, friction: Array, contact: bool) -> Array:
        """INPUTS of the plant from both FMUs' outputs at `now`; ask for `thresholds` afterwards."""
        motors, tip = plant[: len(TENDONS)], plant[len(TENDONS) :]
        compensated, raw, angles = friction.reshape(3, len(JOINTS))
        detected = self._detected(raw, contact)
        load = compensated if self.task.compensated else raw - self._mean
        lever = float(np.linalg.norm(tip_motion(angles)))  # virtual work: load · dq = force · dx
        self.estimate = CLOSING @ load / lever + (0.0 if self.task.compensated else self.task.raw_offset)
        self._start = motors if self._start is None else self._start
        if self.phase in ("warm up", "close"):
            self._close(now, detected, motors - self._start)
        elif self.phase == "stop" and now - self.stopped_at >= self.REST:
            self.phase, self.held_at, self._sum = "hold", now, self.c
        elif self.phase == "hold":
            error = self.wanted(now) - self.estimate
            self._sum += self.task.integral * error * STEP
            self.c = self._sum + self.task.proportional * error
        self.force = self.plate.force(tip, now - self.held_at if self.phase == "hold" else 0.0)
        return np.concatenate([self.pull * self.c, self.force * self.plate.normal])

    @property
    def thresholds(self) -> Array:
        """THRESHOLDS of the friction FMU."""
        return {"warm up": np.full_like(self._armed, NEVER), "close": self._armed}.get(self.phase, 0.0 * self._armed)

    def wanted(self, now: float) -> float:
        """N; 0 before a force is asked for."""
        if self.phase != "hold" or not self.task.forces:
            return 0.0
        return self.task.forces[min(int((now - self.held_at) / self.task.hold), len(self.task.forces) - 1)]

    def done(self, now: float) -> bool:
        return self.phase == "closed" or now - self.held_at >= self.task.hold * len(self.task.forces)

    def _detected(self, raw: Array, contact: bool) -> bool:
        change = raw - (raw if self._mean is None else self._mean)
        if self.phase in ("warm up", "close"):  # then it stays, as the torque without a contact
            self._mean = raw - change * math.exp(-STEP / self.task.raw_time)
        return contact if self.task.compensated else bool(np.any(np.abs(change) > self.task.raw_threshold))

    def _close(self, now: float, detected: bool, moved: Array) -> None:
        if self.phase == "close" and detected:
            self.c = float(self.pull @ moved / (self.pull @ self.pull))  # where the motors stand
            self.phase, self.stopped_at = "stop", now
            return
        target, speed, pause = self._way[0]
        self.c += min(speed * STEP, max(-speed * STEP, target - self.c))
        self._waited += STEP if self.c == target else 0.0
        if self._waited > pause:
            self._way, self._waited = self._way[1:], 0.0
            if self.phase == "warm up" and target == self.ARMED:
                self.phase = "close"
            elif not self._way:
                self.phase = "closed"  # on nothing
