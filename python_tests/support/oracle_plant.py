"""Naive numpy twin of the simulated finger's right-hand side, used by tests alone.

Written from the equations (docs/reference/simulated_finger.md), sharing no code with runtime/plant: the mass matrix
comes from the Jacobians of the centres of mass, the velocity terms from Christoffel symbols whose derivatives are
complex steps, and every friction contact is one plain object. It favours reading over speed. Indices in this file start
at 0.

State: q[n], q'[n], motor x[m], motor x'[m], bristles, heat, motor work, friction work, damping work, push work.
Bristles: along each tendon wrist, edge 1, pulley 1, edge 2, ...; then per joint friction, load_friction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_finger import given
from oracle_plant_parts import (
    Contact,
    Friction,
    Multibody,
    Tendon,
    diversion_shape,
    push_profile,
    read_law,
    spline,
)

Array = NDArray[Any]


class PlantTwin:
    """The finger of an expanded rig.

    `derivative(t, y)` is the right-hand side; `parts(t, y)` its terms: mass, inertial, tension (f0), between
    (f_B [m, n]), at (f_A [m, n]), loss (force lost and sliding velocity of each contact), drive (torque of the tensions
    where they act), joint_friction, cover, coupling, stop (torques as they act on the joints), external (−Jᵀ F), level,
    and the powers.
    """

    def __init__(self, rig: Mapping[str, Any]) -> None:
        self.finger, self.physics, self.motion = rig["finger"], rig["physics"], rig["motion"]
        self.pushes = given(rig, "pushes", [])
        self.body = Multibody(self.physics)
        self.n, self.m = self.body.n, len(self.finger["tendons"])
        extra = list(given(self.physics, "tendons", []))
        extra += [None] * (self.m - len(extra))
        self.tendons = [Tendon(self.finger["tendons"][i], extra[i], self.n) for i in range(self.m)]
        self.tip = np.array(given(self.physics, "tip", [0.0] * 3), dtype=float)
        servo = given(self.physics, "servo", {})
        self.servo_rate = 2.0 * math.pi * float(given(servo, "frequency", 15.0))
        self.servo_damping = float(given(servo, "damping_ratio", 1.0))
        self.coupling = list(given(self.physics, "joint_coupling", [])) or [0.0] * (self.n - 1)
        covers = [given(joint, "cover", {}) for joint in self.finger["joints"]]
        self.cover_stiffness = np.array([float(given(cover, "stiffness", 0.0)) for cover in covers])
        self.rest = np.array([float(given(cover, "rest_angle", 0.0)) for cover in covers])
        links = self.physics["links"]
        self.cover_hardening = np.array([float(given(link, "cover_hardening", 0.0)) for link in links])
        self.damping = np.array([float(given(link, "damping", 0.0)) for link in links])
        self.stops = [given(link, "limits", None) for link in links]
        self._read_friction()
        self._read_motion()

    def _read_friction(self) -> None:
        friction = given(self.physics, "friction", {})
        shared = Friction(
            float(given(friction, "bristle_damping", 0.0)),
            float(given(friction, "stribeck_exponent", 1)),
            float(given(friction, "asymmetry", 0.0)),
        )
        self.capstan = given(friction, "tension_loss", "linear") == "capstan"
        self.at_joint = given(friction, "pulley_torque", "beyond_joint") == "at_joint"
        self.only_passing = given(friction, "joint_load", "all") == "passing"
        self.preload = float(given(friction, "preload", 0.0))
        self.drift, self.heat = given(friction, "drift", {}), given(friction, "heat", {})
        distances = given(friction, "presliding", {})
        lengths = {"pulley": 25e-6, "edge": 40e-6, "joint": 0.004}
        self.lengths = {kind: float(given(distances, kind, default)) for kind, default in lengths.items()}
        self.edges = {(e["tendon"] - 1, e["joint"] - 1): e for e in given(friction, "edges", [])}
        self.wrist = given(self.physics, "wrist", None)
        self.places: list[tuple[Any, ...]] = []
        self.contacts: dict[tuple[Any, ...], Contact] = {}
        for i, tendon in enumerate(self.finger["tendons"]):
            if self.wrist is not None:
                length = float(given(self.wrist, "presliding", 40e-6))
                self._add(("wrist", i), self.wrist["friction"], length, shared)
            for j in range(self.n):
                self._add(("edge", i, j), _entry(tendon.get("edge_friction"), j), self.lengths["edge"], shared)
                if j < self.n - 1:
                    law = _entry(tendon.get("pulley_friction"), j)
                    self._add(("pulley", i, j), law, self.lengths["pulley"], shared)
        for j, joint in enumerate(self.finger["joints"]):
            self._add(("friction", j), joint.get("friction"), self.lengths["joint"], shared)
            self._add(("load_friction", j), joint.get("load_friction"), self.lengths["joint"], shared)

    def _add(self, place: tuple[Any, ...], entry: Mapping[str, Any] | None, length: float, shared: Friction) -> None:
        if entry is None:
            return
        angles, laws = [0.0], [entry]
        if "laws" in entry:
            angles, laws = [float(a) for a in entry["angles"]], entry["laws"]
        read = [read_law(law) for law in laws]
        shape: Callable[[float], float] = lambda _: 1.0  # noqa: E731
        if place[0] == "edge" and place[1:] in self.edges:
            # the law normalised to its coulomb level (mean of the sides), times s(q)
            shape = diversion_shape(self.edges[place[1:]], self.capstan)
            angles = [0.0]
            coulomb = (read[0][0][1] + read[0][1][1]) / 2.0
            read = [tuple((s[0] / coulomb, s[1] / coulomb, s[2], s[3] / coulomb) for s in read[0])]  # type: ignore[list-item]
        self.places.append(place)
        self.contacts[place] = Contact(angles, read, length, shared, shape)

    def _read_motion(self) -> None:
        self.desired = [
            spline(joint["time"], joint["position"], joint["velocity"], joint["acceleration"])
            for joint in self.motion["joints"]
        ]
        self.pretension = spline(self.motion["pretension"]["time"], self.motion["pretension"]["value"])
        # null vector of Rᵀ nearest to ones, mean 1, with the true arms in the first posture
        posture = np.array([path(0.0) for path in self.desired])
        R = np.array([tendon.arms(posture) for tendon in self.tendons])
        nearest = np.ones(self.m) - R @ np.linalg.lstsq(R, np.ones(self.m), rcond=None)[0]
        self.null_vector = nearest / nearest.mean()

    @property
    def order(self) -> int:
        return 2 * self.n + 2 * self.m + len(self.places) + 5

    def split(self, y: Array) -> dict[str, Array]:
        sizes = {"q": self.n, "v": self.n, "x": self.m, "x_rate": self.m, "w": len(self.places), "sums": 5}
        ends = np.cumsum(list(sizes.values()))
        return {name: np.asarray(y)[end - size : end] for (name, size), end in zip(sizes.items(), ends, strict=True)}

    def command(self, t: float) -> Array:
        """x_cmd: [m] m."""
        posture = np.array([path(t) for path in self.desired])
        p = self.pretension(t)
        return np.array(
            [
                each.path(posture) + each.elongation(p * nu)
                for each, nu in zip(self.tendons, self.null_vector, strict=True)
            ]
        )

    def level(self, t: float, heat: float) -> float:
        amplitude, constant = given(self.drift, "amplitude", 0.0), given(self.drift, "time_constant", 300.0)
        drift = 1.0 + amplitude * (1.0 - math.exp(-t / constant))
        return float(drift * (1.0 + given(self.heat, "coefficient", 0.0) * heat))

    def _pass(self, force: float, coefficient: float) -> float:
        """f_out of a contact."""
        p = self.preload * (1.0 - math.exp(-force / self.preload)) if self.preload > 0.0 else 0.0
        if self.capstan:
            return force * math.exp(-coefficient) - p * coefficient
        return force - (force + p) * coefficient

    def tendons_at(self, t: float, y: Array, q: Array, v: Array, arms: Array) -> dict[str, Any]:
        """Tensions along the tendons, the bristles' rates, the power friction takes out at each contact."""
        state = self.split(y)
        w = dict(zip(self.places, state["w"], strict=True))
        level = self.level(t, state["sums"][0])
        f0, elastic, between, at = np.zeros(self.m), np.zeros(self.m), np.zeros((self.m, self.n)), None
        at = np.zeros((self.m, self.n))
        rate: dict[tuple[Any, ...], float] = {}
        loss: dict[tuple[Any, ...], tuple[float, float]] = {}  # (force lost, sliding velocity)

        def take(place: tuple[Any, ...], force: float, sliding: float, angle: float) -> float:
            if place not in w:
                return force
            coefficient, rate[place] = self.contacts[place].act(w[place], sliding, angle, level)
            left = self._pass(force, coefficient)
            loss[place] = (force - left, sliding)
            return left

        slid = np.array([[np.dot(arms[i, j:], v[j:]) for j in range(self.n + 1)] for i in range(self.m)])
        for i, tendon in enumerate(self.tendons):
            e = state["x"][i] - tendon.path(q)
            f0[i], elastic[i] = tendon.force(e, state["x_rate"][i] - slid[i, 0]), tendon.elastic(e)
            force = f0[i]
            if self.wrist is not None:
                turn = 2.0 * math.pi / self.wrist["period"]
                wrist_speed = self.wrist["amplitude"] * turn * math.cos(turn * t)
                force = take(("wrist", i), force, slid[i, 0] + self.wrist["arms"][i] * wrist_speed, 0.0)
            for j in range(self.n):
                between[i, j] = take(("edge", i, j), force, slid[i, j], q[j - 1] if j else 0.0)
                at[i, j] = force = take(("pulley", i, j), between[i, j], slid[i, j + 1], 0.0)
        return {"tension": f0, "elastic": elastic, "between": between, "at": at, "rate": rate, "loss": loss,
                "w": w, "level": level, "slid": slid}  # fmt: skip

    def joint_friction(self, along: dict[str, Any], q: Array, v: Array) -> Array:
        """[n] N·m, opposes q'; adds the rates of the joints' bristles."""
        torque = np.zeros(self.n)
        for j in range(self.n):
            for kind in ("friction", "load_friction"):
                place = (kind, j)
                if place not in along["w"]:
                    continue
                act = self.contacts[place].act(along["w"][place], v[j], 0.0, along["level"])
                load = 1.0
                if kind == "load_friction":
                    passing = [not self.only_passing or each.turns(j) for each in self.tendons]
                    load = float(np.sum(along["between"][passing, j]))
                torque[j] += act[0] * load
                along["rate"][place] = act[1]
        return torque

    def springs(self, q: Array) -> tuple[Array, Array]:
        """Torques of cover and coupling as they act on the joints."""
        bend = q - self.rest
        cover = -(self.cover_stiffness * bend + self.cover_hardening * bend**3)
        coupling = np.zeros(self.n)
        for j, stiffness in enumerate(self.coupling):
            torque = stiffness * (bend[j] - bend[j + 1])
            coupling[j] -= torque
            coupling[j + 1] += torque
        return cover, coupling

    def stop(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Torque of the limits on the joints, and the elastic part alone."""
        torque, elastic = np.zeros(self.n), np.zeros(self.n)
        for j, limits in enumerate(self.stops):
            if limits is None:
                continue
            k, d = float(given(limits, "stiffness", 5.0)), float(given(limits, "damping", 0.01))
            if q[j] < limits["lower"]:
                elastic[j] = k * (limits["lower"] - q[j])
                torque[j] = max(0.0, elastic[j] - d * v[j])
            elif q[j] > limits["upper"]:
                elastic[j] = -k * (q[j] - limits["upper"])
                torque[j] = min(0.0, elastic[j] - d * v[j])
        return torque, elastic

    def _place(self, entry: Mapping[str, Any]) -> tuple[int, Array]:
        return int(given(entry, "link", self.n)) - 1, np.array(given(entry, "point", self.tip), dtype=float)

    def outside(self, t: float, q: Array, v: Array) -> list[dict[str, Any]]:
        """Forces from outside: each with force [3], point [3], Jacobian [3, n], kind, elastic energy, damping power."""
        found = []
        for push in self.pushes:
            link, local = self._place(push)
            direction = np.array(push["direction"], dtype=float)
            direction = direction / np.linalg.norm(direction)
            if given(push, "frame", "link") == "link":
                direction = self.body.frames(q)[0][link] @ direction
            force = float(push["force"]) * push_profile(push, t) * direction
            found.append({"kind": "push", "force": force, "energy": 0.0, "damping": 0.0, "at": (link, local)})
        obstacle = given(self.physics, "obstacle", None)
        if obstacle is not None:
            link, local = self._place(obstacle)
            away = self.body.point(q, link, local) - np.array(obstacle["centre"], dtype=float)
            depth = float(obstacle["radius"]) - float(np.linalg.norm(away))
            if depth > 0.0:
                normal = away / np.linalg.norm(away)
                closing = -float(normal @ self.body.jacobians(q, link, local)[0] @ v)
                k = float(obstacle["stiffness"])
                size = max(0.0, k * depth * (1.0 + float(given(obstacle, "damping", 0.0)) * closing))
                found.append(
                    {"kind": "obstacle", "force": size * normal, "energy": 0.5 * k * depth**2,
                     "damping": (size - k * depth) * closing, "at": (link, local)}
                )  # fmt: skip
        for each in found:
            each["jacobian"] = self.body.jacobians(q, *each["at"])[0]
            each["point"] = self.body.point(q, *each["at"])
        return found

    def parts(self, t: float, y: Array) -> dict[str, Any]:
        state = self.split(np.asarray(y, dtype=float))
        q, v = state["q"], state["v"]
        arms = np.array([each.arms(q) for each in self.tendons])
        along = self.tendons_at(t, y, q, v, arms)
        friction = self.joint_friction(along, q, v)
        drive = np.sum(arms * (along["at"] if self.at_joint else along["between"]), axis=0)
        cover, coupling = self.springs(q)
        stop, stop_elastic = self.stop(q, v)
        outside = self.outside(t, q, v)
        external = -sum((each["jacobian"].T @ each["force"] for each in outside), np.zeros(self.n))
        torque = drive - friction - self.damping * v + cover + coupling + stop - external
        mass = self.body.mass_matrix(q)
        bias = self.body.velocity_terms(q, v) + self.body.gravity_torque(q)
        acceleration = np.linalg.solve(mass, torque - bias)
        stretch_rate = state["x_rate"] - along["slid"][:, 0]
        wrist = sum(
            lost * (speed - along["slid"][place[1], 0])
            for place, (lost, speed) in along["loss"].items()
            if place[0] == "wrist"
        )
        damping = float(np.sum((along["tension"] - along["elastic"]) * stretch_rate) + np.sum(self.damping * v * v))
        damping -= float((stop - stop_elastic) @ v)
        return along | {
            "arms": arms, "joint_friction": friction, "drive": drive, "cover": cover, "coupling": coupling,
            "stop": stop, "outside": outside, "external": external, "mass": mass, "acceleration": acceleration,
            "inertial": mass @ acceleration + bias, "joint_torque": arms.T @ along["tension"],
            "motor_power": float(along["tension"] @ state["x_rate"]) + wrist,
            "friction_power": float(along["tension"] @ along["slid"][:, 0] - drive @ v + friction @ v) + wrist,
            "damping_power": damping + sum(each["damping"] for each in outside),
            "push_power": sum(
                float(each["force"] @ each["jacobian"] @ v) for each in outside if each["kind"] == "push"),
        }  # fmt: skip

    def derivative(self, t: float, y: Array) -> Array:
        state, found = self.split(np.asarray(y, dtype=float)), self.parts(t, y)
        w = self.servo_rate
        motor = w * w * (self.command(t) - state["x"]) - 2.0 * self.servo_damping * w * state["x_rate"]
        bristles = np.array([found["rate"][place] for place in self.places])
        heat = found["friction_power"] - state["sums"][0] / float(given(self.heat, "time_constant", 100.0))
        works = [found[name] for name in ("motor_power", "friction_power", "damping_power", "push_power")]
        return np.concatenate([state["v"], found["acceleration"], state["x_rate"], motor, bristles, [heat], works])

    def kinetic_energy(self, y: Array) -> float:
        state = self.split(y)
        return float(0.5 * state["v"] @ self.body.mass_matrix(state["q"]) @ state["v"])

    def potential_energy(self, t: float, y: Array) -> float:
        """Gravity, springs, cover, coupling, stops, obstacle."""
        state = self.split(y)
        q, bend = state["q"], state["q"] - self.rest
        energy = float(self.body.height_energy(q))
        energy += sum(each.energy(state["x"][i] - each.path(q)) for i, each in enumerate(self.tendons))
        energy += float(np.sum(self.cover_stiffness * bend**2 / 2.0 + self.cover_hardening * bend**4 / 4.0))
        energy += sum(k * (bend[j] - bend[j + 1]) ** 2 / 2.0 for j, k in enumerate(self.coupling))
        for j, limits in enumerate(self.stops):
            if limits is not None:
                beyond = max(0.0, limits["lower"] - q[j], q[j] - limits["upper"])
                energy += float(given(limits, "stiffness", 5.0)) * beyond**2 / 2.0
        return energy + sum(each["energy"] for each in self.outside(t, q, state["v"]))

    def balance(self, t: float, y: Array) -> float:
        """kinetic + potential + friction work + damping work − motor work − push work: constant along a solution."""
        _, motor, friction, damping, push = self.split(y)["sums"]
        return float(self.kinetic_energy(y) + self.potential_energy(t, y) + friction + damping - motor - push)


def _entry(entries: Sequence[Any] | None, j: int) -> Any:
    return entries[j] if entries is not None and j < len(entries) else None
