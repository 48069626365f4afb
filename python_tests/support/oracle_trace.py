"""T_k(θ) and Δb_k(θ) of a recording as plain numpy formulas of the parameters, used by tests of the estimation alone.

Velocities, who moves, who sticks and when do not depend on θ. So the oracle runs once, with contact detection out of
reach, and what each friction effect did is written down (`Course`); after that T and Δb are formulas over all samples
that take complex numbers too: the imaginary part of one evaluation at θ + i h is the exact derivative along h, without
the cancellation of a difference. Tests hold the formulas and the derivatives against the oracle itself.

Of `extensions`, only those that are springs are part of the formulas; the others are held against differences of the
oracle (`run_recorder`).
"""

from __future__ import annotations

import copy
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import oracle
from oracle_finger import NEAR, Effect, given

Array = NDArray[Any]
Values = Mapping[str, Any]  # path of a parameter -> its number, or [U, 1] numbers
Place = tuple[Any, ...]

NEVER = 1e9  # N·m, a contact threshold out of reach
SPRINGS = ("cover_hardening", "joint_coupling")


def without_contact(description: Mapping[str, Any]) -> dict[str, Any]:
    """The description with contact detection out of reach."""
    free = copy.deepcopy(dict(description))
    free["contact"] = {"threshold": [NEVER] * len(free["joints"])}
    return free


def with_values(description: Mapping[str, Any], values: Mapping[str, float]) -> dict[str, Any]:
    """The description with the numbers at some paths replaced (`tendons[1].edge_friction[2].laws[1].coulomb`)."""
    changed = json.loads(json.dumps(description))  # copy.deepcopy keeps what places share: one would move all
    for path, value in values.items():
        place: Any = changed
        *before, last = re.findall(r"[a-z_]+|\d+", path)
        for step in before:
            place = place[int(step) - 1] if step.isdigit() else place[step]
        place[int(last) - 1 if last.isdigit() else last] = float(value)
    return changed


@dataclass
class Course:
    """What one friction effect did over a recording, all [N].

    direction: 0 stuck, else sgn(v). speed: |v|. angle: that its working points see. at_plus, at_minus: b of the sample
    is at_plus·F(+v_min) + at_minus·F(−v_min), F with its sign.
    """

    direction: Array
    speed: Array
    angle: Array
    at_plus: Array
    at_minus: Array


class Recorder(oracle.FingerOracle):
    """The oracle, writing down T, Δb and what each effect does."""

    def __init__(self, description: Mapping[str, Any], kinematics_source: int) -> None:
        super().__init__(without_contact(description), kinematics_source)
        self.rows: dict[int, list[tuple[float, ...]]] = {}
        self.totals: list[Array] = []
        self.moments: list[Any] = []  # what torques of extensions see
        self.residuals: list[Array] = []  # r of step 5, from the second sample on

    def step(self, *arguments: Any) -> oracle.Step:
        out = super().step(*arguments)
        if self.samples > 1:
            self.residuals.append(out.values["residual"])
        return out

    def _total(self, *arguments: Array) -> Array:
        self.totals.append(super()._total(*arguments))
        return self.totals[-1]

    def _take_effect(
        self, effect: Effect, v: float, angle: float, time: float, first: bool, key: Any, out: oracle.Step,
    ) -> tuple[float, float]:  # fmt: skip
        stuck, side, since, last = effect.stuck, effect.side, effect.stuck_since, effect.last_stuck
        absorbed = self.absorbed - effect.absorbed_since
        F, b = super()._take_effect(effect, v, angle, time, first, key, out)
        direction = out.decisions[key]
        of_side = {1: 0.0, -1: 0.0}
        if not first and direction != 0 and stuck:
            forgotten = absorbed if self.by_absorption else self.forget_rate * (last - since)
            memory = 0.0 if side is None else math.exp(-forgotten)
            of_side[direction] -= 1.0 - memory
            if side is not None:
                of_side[side] -= memory
        elif not first and direction == 0 and not stuck:
            assert side is not None
            of_side[side] += 1.0
        self.rows.setdefault(id(effect), []).append((direction, abs(v), angle, of_side[1], of_side[-1]))
        return F, b

    def course(self, effect: Effect) -> Course:
        return Course(*np.array(self.rows[id(effect)], dtype=float).T)


def run_recorder(
    description: Mapping[str, Any], recording: Mapping[str, Array], kinematics_source: int
) -> tuple[Recorder, Array, Array, list[oracle.Step]]:
    """The oracle over a recording without contact: itself, T [N, n], Δb [N, n], its steps."""
    finger = Recorder(description, kinematics_source)
    present = [name for name in oracle.INPUTS if recording.get(name) is not None]
    steps, torque, jump = [], [], []
    for k, time in enumerate(np.asarray(recording["time"], dtype=float)):
        finger.totals.clear()
        steps.append(finger.step(float(time), {name: recording[name][k] for name in present}))
        friction, increments = finger.totals
        torque.append(friction + finger._springs(finger.q))
        finger.moments.append(finger.extensions.moment)
        jump.append(increments)
    return finger, np.array(torque), np.array(jump), steps


class Trace:
    """A recording seen through a finger: T and Δb as functions of all parameters.

    q [N, n], tau [N, n], force [N, m], time [N]; torque, jump and residual (r of step 5) [N, n]
    are the oracle's own at the description.
    """

    def __init__(
        self, description: Mapping[str, Any], recording: Mapping[str, Array], kinematics_source: int = 1
    ) -> None:
        finger, self.torque, self.jump, steps = run_recorder(description, recording, kinematics_source)
        self.description = description
        self.n, self.m, self.R = finger.n, finger.m, finger.R
        self.bidirectional = [tendon.bidirectional for tendon in finger.tendons]
        self.time = np.asarray(recording["time"], dtype=float)
        self.force = np.array([moment.f0 for moment in finger.moments])
        self.q = np.array([step.values["joint_angle"] for step in steps])
        self.tau = np.array([step.values["joint_torque"] for step in steps])
        self.near = np.array([step.margin for step in steps]) < NEAR
        self.residual = np.array([np.full(self.n, np.nan), *finger.residuals])
        self.branches = finger.branches
        self.springs = [(f"extensions[{k + 1}]", row) for k, row in enumerate(finger.extensions.rows)]
        if not {row.effect for _, row in self.springs} <= set(SPRINGS):
            raise ValueError("extensions: only springs are part of the formulas")
        self.laws: dict[Place, tuple[Course, float, Array, list[tuple[str, str]]]] = {}
        for place, path, entry, effect in self._places(finger):
            self.laws[place] = (finger.course(effect), effect.threshold, *self._points(effect, path, entry, finger))

    def _places(self, finger: Recorder) -> list[tuple[Place, str, Any, Effect]]:
        found = []
        for j, joint in enumerate(finger.joints):
            for kind, effect in (("friction", joint.friction), ("load_friction", joint.load_friction)):
                entry = self.description["joints"][j].get(kind)
                found.append(((kind, j), f"joints[{j + 1}].{kind}", entry, effect))
            for i, tendon in enumerate(finger.tendons):
                for kind, effects in (("pulley_friction", tendon.pulley), ("edge_friction", tendon.edge)):
                    entries = list(given(self.description["tendons"][i], kind, []))
                    entry = entries[j] if j < len(entries) else None
                    found.append(((kind, i, j), f"tendons[{i + 1}].{kind}[{j + 1}]", entry, effects[j]))
        return [each for each in found if each[3] is not None]

    def _points(
        self, effect: Effect, path: str, entry: Mapping[str, Any], finger: Recorder
    ) -> tuple[Array, list[tuple[str, str]]]:
        """[N, points] weights of the working points, and the paths of each law's positive and negative side."""
        angle = finger.course(effect).angle
        points = np.array(effect.angles)
        hats = np.eye(len(points))
        weights = np.stack([np.interp(angle, points, hat) for hat in hats], axis=1)
        laws = entry.get("laws", [entry])
        sides = []
        for k, law in enumerate(laws, start=1):
            own = f"{path}.laws[{k}]" if "laws" in entry else path
            sides.append((f"{own}.positive", f"{own}.negative") if "positive" in law else (own, own))
        return weights, sides

    def _friction_and_jump(self, place: Place, theta: Values, samples: slice) -> tuple[Any, Any]:
        """F and b of one effect, [U, N]."""
        if place not in self.laws:
            return 0.0, 0.0
        course, threshold, weights, sides = self.laws[place]

        def magnitude(path: str, speed: Any) -> Any:
            static, coulomb = theta[f"{path}.static"], theta[f"{path}.coulomb"]
            stribeck_velocity, viscous = theta[f"{path}.stribeck_velocity"], theta[f"{path}.viscous"]
            return coulomb + (static - coulomb) * np.exp(-speed / stribeck_velocity) + viscous * speed

        F: Any = 0.0
        b: Any = 0.0
        speed, direction = course.speed[samples], course.direction[samples]
        at_plus, at_minus = course.at_plus[samples], course.at_minus[samples]
        for weight, (positive, negative) in zip(weights[samples].T, sides, strict=True):
            forward, backward = magnitude(positive, speed), -magnitude(negative, speed)
            F = F + weight * np.where(direction > 0, forward, np.where(direction < 0, backward, 0.0))
            b = b + weight * (at_plus * magnitude(positive, threshold) - at_minus * magnitude(negative, threshold))
        return F, b

    def evaluate(self, theta: Values, samples: slice = slice(None)) -> tuple[Array, Array]:
        """T and Δb, [U, samples, n]; U = 1 where all numbers are plain."""
        T, db = self._springs(theta, samples), 0.0 * self._springs(theta, samples)
        load = [0.0] * self.n
        for i in range(self.m):
            f_A: Any = self._not_slack(i, self.force[samples, i] + 0.0j)
            loss: Any = 0.0
            jump: Any = 0.0
            for j in range(self.n):
                edge, edge_jump = self._friction_and_jump(("edge_friction", i, j), theta, samples)
                pulley, pulley_jump = self._friction_and_jump(("pulley_friction", i, j), theta, samples)
                before = self._magnitude(i, f_A)
                f_B = self._not_slack(i, f_A - before * edge)
                between = self._magnitude(i, f_B)
                f_A = self._not_slack(i, f_B - between * pulley)
                loss = loss + before * edge + between * pulley
                jump = jump + before * edge_jump + between * pulley_jump
                T[..., j] += self.R[i, j] * loss
                db[..., j] += self.R[i, j] * jump
                load[j] = load[j] + between
        for j in range(self.n):
            own, own_jump = self._friction_and_jump(("friction", j), theta, samples)
            by_load, by_load_jump = self._friction_and_jump(("load_friction", j), theta, samples)
            T[..., j] += own + by_load * load[j]
            db[..., j] += own_jump + by_load_jump * load[j]
        return T, db

    def slack(self, theta: Values, samples: slice = slice(None)) -> Array:
        """[samples] whether the model finds a force below 0 in a tendon that can only pull."""
        found = np.zeros(self.force[samples].shape[0], dtype=bool)
        for i in (i for i in range(self.m) if not self.bidirectional[i]):
            force: Any = self.force[samples, i]
            for j in range(self.n):
                for kind in ("edge_friction", "pulley_friction"):
                    found |= force < 0.0
                    force = np.maximum(force, 0.0)
                    loss = self._friction_and_jump((kind, i, j), theta, samples)[0]
                    force = force - force * np.reshape(loss, -1).real
            found |= force < 0.0
        return found

    def _not_slack(self, i: int, force: Array) -> Array:
        return force if self.bidirectional[i] else np.where(force.real < 0.0, 0.0, force)

    def _magnitude(self, i: int, force: Array) -> Array:
        return np.where(force.real < 0.0, -force, force) if self.bidirectional[i] else force

    def _springs(self, theta: Values, samples: slice) -> Array:
        """Covers and springs of extensions, complex [U, samples, n]."""
        size = max((np.size(value) for value in theta.values()), default=1)
        q = self.q[samples]
        torque = np.zeros((size, *q.shape), dtype=complex)

        def bend(j: int) -> Any:
            return q[:, j] - theta.get(f"joints[{j + 1}].cover.rest_angle", 0.0)

        for j in range(self.n):
            torque[..., j] += theta.get(f"joints[{j + 1}].cover.stiffness", 0.0) * bend(j)
        for path, row in self.springs:
            assert row.joint is not None
            stiffness = theta[f"{path}.stiffness"]
            if row.effect == "cover_hardening":
                cube, square = (bend(row.joint) ** power for power in (3, 2))
                torque[..., row.joint] += stiffness * cube + theta[f"{path}.quadratic"] * square
            else:
                pull = stiffness * (bend(row.joint) - bend(row.joint + 1))
                torque[..., row.joint] += pull
                torque[..., row.joint + 1] -= theta[f"{path}.reaction"] * pull
        return torque
