"""Naive numpy implementation of docs/reference/semantics/README.md, used by tests alone.

Written from that text and the paper, sharing no code with the runtime. It favours reading over
speed: one plain loop over samples, and one small object per friction effect.
Indices in this file start at 0; joint 0 is the first joint, so the edge before joint 0 sees the angle q_0 = 0.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_detection import Detector, Signals, direction_above
from oracle_elements import Elements
from oracle_extensions import Extensions
from oracle_finger import Effect, Key, Places, Result, Step, given, read_joints, read_tendons, tendon_velocity
from oracle_sensors import SensorWatch, Watch

Array = NDArray[Any]

LARGEST_ABSORPTION = 700.0  # of one sample, -ln(1 - K): K = 1 leaves nothing, and exp(-700) is not yet 0


class FingerOracle:
    """One finger: constants from the description, and the remembered state. `step` takes a sample.

    Raises ValueError when the routing matrix has no full column rank or time goes back.
    """

    def __init__(self, description: Mapping[str, Any], kinematics_source: int = 1) -> None:
        self.source = kinematics_source
        self.branches: Counter[str] = Counter()
        self._read_structure(description)
        self._read_settings(description)
        self.detector = Detector(description, self.R, self.branches)
        self.extensions = Extensions(description, self.n, self.m, self.R, self.joints, kinematics_source, self.branches)
        watches = given(description, "sensor_fault", None) is not None
        self.sensors = SensorWatch(description, self.R, kinematics_source, self.branches) if watches else None
        self.watch = Watch(self.R_plus, self.R_plus, [False] * self.n, [False] * self.n)
        self.spring_end = np.zeros(self.m)  # x0 − f0/k
        self.elements = Elements(description, self.R, self.thresholds, self.branches)
        self.grips = [self.extensions.rows_at(kind, at) for kind, at, _ in self.places]
        # state
        self.samples = 0
        self.time = math.nan
        self.q, self.v, self.b_eff, self.P = (np.zeros(self.n) for _ in range(4))
        self.absorbed = 0.0  # Λ
        self.jumps = np.zeros(self.n)  # Σ Δb
        self.last = Step()
        # of a guided run (oracle_guided.py): N·m known from elsewhere, and whether the bias begins with this sample
        self.known_torque: Array | float = 0.0
        self.begins = False

    def _read_structure(self, description: Mapping[str, Any]) -> None:
        threshold = given(description, "velocity_threshold", {})
        self.thresholds = float(given(threshold, "tendon", 0.0005)), float(given(threshold, "joint", 0.01))
        self.n = len(description["joints"])
        self.m = len(description["tendons"])
        self.joints = read_joints(description)
        self.tendons = read_tendons(description)
        self.R = np.array([entry["moment_arms"] for entry in description["tendons"]], dtype=float)
        singular_values = np.linalg.svd(self.R, compute_uv=False)
        if self.m < self.n or singular_values[-1] < 1e-15 * singular_values[0] or singular_values[0] == 0.0:
            raise ValueError("tendons: moment_arms have no full column rank")
        self.R_plus = np.linalg.pinv(self.R, rcond=1e-15)
        self.places = self._list_places()

    def _list_places(self) -> list[tuple[str, tuple[int, ...], Effect]]:
        """Every effect with its kind (a field of Places) and its indices there, base first."""
        found: list[tuple[str, tuple[int, ...], Effect | None]] = []
        for j in range(self.n):
            for i, tendon in enumerate(self.tendons):
                found += [("edge", (i, j), tendon.edge[j]), ("pulley", (i, j), tendon.pulley[j])]
            found += [("joint", (j,), self.joints[j].friction), ("load", (j,), self.joints[j].load_friction)]
        return [(kind, at, effect) for kind, at, effect in found if effect is not None]

    def _read_settings(self, description: Mapping[str, Any]) -> None:
        bias = given(description, "bias", {})
        self.cutoff = float(given(description, "velocity_filter_cutoff", 20.0))
        self.drift_variance = float(given(bias, "drift_variance", 1e-6))
        self.noise_std = float(given(bias, "noise_std", 0.01))
        self.noise_std_per_force = float(given(bias, "noise_std_per_force", 0.0))
        self.forget_rate = float(given(bias, "forget_rate", 5.0))
        self.initial_variance = given(bias, "initial_variance", None)
        self.initial_torque = given(bias, "initial_torque", None)
        self.noise_time = given(bias, "noise_time", None)
        self.by_absorption = given(bias, "forgetting", "time") == "absorption"

    def step(self, time: float, inputs: Mapping[str, Array], forced: Mapping[Key, Any] | None = None) -> Step:
        """Takes one sample. `forced` fixes single decisions (by key) instead of deciding them."""
        if time == self.time:
            return self.last  # the sample of this time is already taken
        if time < self.time:
            raise ValueError(f"time: {time} lies before the last sample's {self.time}")
        first = self.samples == 0
        dt = 0.0 if first else time - self.time
        out = Step(forced or {})
        x0 = inputs.get("tendon_position")
        if x0 is not None:
            x0 = np.asarray(x0, dtype=float) - np.array([tendon.zero for tendon in self.tendons])
            inputs = {**inputs, "tendon_position": x0}
        inputs = self.extensions.signals(time, inputs, first)
        f0 = np.asarray(inputs["tendon_force"], dtype=float)

        # 0. sensors
        self._watch(inputs, f0, time, dt, out)
        # 1. kinematics
        q, v = self._kinematics(inputs, f0, dt, first, out)
        x_dot = tendon_velocity(self.R, v)
        filtered = 1.0 if self.source == 3 else self.elements.filtered
        travel = filtered * v * dt + (1.0 - filtered) * (q - (q if first else self.q + self.shift))
        self.travelled = travel, tendon_velocity(self.R, travel)
        self.extensions.advance(q, v, x_dot, f0, dt, first, self.thresholds, self.travelled, self.elements, out)
        self.elements.turn(self.travelled, dt, first)
        # 2. each friction effect: F, the increment b, and |F| of its law
        F, b, limits = self._effects(q, v, x_dot, time, dt, first, out)
        # 3. forces at and between the joints, and with them what multiplies an F or a b
        f_between, f_before_edge, slack, lost = self._propagate(f0, F.edge, F.pulley, out)
        f = self._loads(f_before_edge, f_between)
        # 4. totals, eq. (10)
        products = self._remembered(F * f, lost, out)
        friction = self._total(products)
        T = friction + self._springs(q)
        db = self._total(b * f)
        tau = self.R.T @ f0 - self.known_torque
        mean_force = float(np.mean(np.abs(f0))) if self.sensors is None else self.sensors.mean_force(f0)
        noise = (self.noise_std + self.noise_std_per_force * mean_force) ** 2
        if first:
            self.P = np.full(self.n, noise if self.initial_variance is None else float(self.initial_variance))
            self.b_eff = tau - T if self.initial_torque is None else np.array(self.initial_torque, dtype=float)
            self.branches["initial_torque" if self.initial_torque is not None else "initial_bias"] += 1
        else:
            self.b_eff = np.where(np.array(self.watch.anew) | self.begins, tau - T, self.b_eff + db)
            self.jumps = self.jumps + db
        T_eff = self.b_eff + T
        # 5. contact, 6. bias
        unwatched = np.asarray(self.watch.blind) | np.asarray(self.watch.anew) | first
        r = np.where(unwatched, 0.0, tau - T_eff)
        B = self._held_at_most(limits * f)
        signals = Signals(tau - T - self.jumps, r, self._driven(x0), T, B, np.abs(friction), q)
        joint_contact = self.detector.take(signals, mean_force, time, dt, unwatched, out)
        if not first:
            correction = self._gain(dt, noise, time, bool(joint_contact.any())) * r
            self.b_eff = self.b_eff + correction
            T_eff = T_eff + correction
            self._count_in_contact(out, bool(joint_contact.any()))
        # 7. outputs
        out.values = {
            "compensated_torque": tau - T_eff,
            "joint_torque": tau,
            "friction_torque": T_eff,
            "bias_torque": self.b_eff.copy(),
            "joint_angle": q,
            "joint_speed": v,
            "joint_contact": joint_contact,
            "contact": np.asarray(joint_contact.any()),
            "slack": slack,
            "compensated_torque_std": self.detector.std(self.P, mean_force),
            "residual": r,
            "contact_level": self.detector.level,
            "contact_terms": self.detector.terms,
        }
        if self.sensors is not None:
            observable = np.asarray(not any(self.watch.blind))
            out.values |= {"sensor_fault": self.sensors.faults, "contact_observable": observable}
        self.q, self.v, self.time, self.last = q, v, time, out
        self.samples += 1
        return out

    def _watch(self, inputs: Mapping[str, Array], f0: Array, time: float, dt: float, out: Step) -> None:
        """Step 0: the rows in use, x0 − f0/k, and by how much the angles of the sample before change with the rows."""
        k = np.array([tendon.stiffness for tendon in self.tendons])
        before = self.spring_end
        x = inputs.get("tendon_position")
        if self.source == 1:
            self.spring_end = np.asarray(x, dtype=float) - self.extensions.stretch(f0, k)
            x = self.spring_end + f0 / k
        if self.sensors is not None:
            q = None if self.source == 1 else np.asarray(inputs["joint_position"], dtype=float)
            self.watch = self.sensors.take(f0, np.asarray(x, dtype=float), q, time, dt, out)
        self.shift = (self.watch.inverse - self.watch.before) @ before

    def _kinematics(
        self, inputs: Mapping[str, Array], f0: Array, dt: float, first: bool, out: Step
    ) -> tuple[Array, Array]:
        if self.source == 1:
            q = self.watch.inverse @ self.spring_end
        else:
            q = np.array(inputs["joint_position"], dtype=float)
        q = self.extensions.play(q, first)
        if self.source == 3:
            return q, np.array(inputs["joint_velocity"], dtype=float)
        if first:
            return q, np.zeros(self.n)
        raw = (q - (self.q + self.shift)) / dt
        if self.cutoff == 0.0:
            return q, raw
        return q, self.v + (1.0 - math.exp(-2.0 * math.pi * self.cutoff * dt)) * (raw - self.v)

    def _effects(
        self, q: Array, v: Array, x_dot: Array, time: float, dt: float, first: bool, out: Step,
    ) -> tuple[Places, Places, Places]:  # fmt: skip
        """Step 2: F, b and |F| of the law, of a stuck effect on the side of its last motion."""
        F, b, limits = (Places.zeros(self.m, self.n) for _ in range(3))
        seen = q.tolist(), v.tolist(), x_dot.tolist()
        for (kind, at, effect), rows in zip(self.places, self.grips, strict=True):
            velocity, angle, key = self._seen_by(kind, at, *seen)
            factor = self.extensions.factor(rows, abs(velocity), time)
            if self._remembers(kind, at):
                effect.side = self.extensions.side_of(effect, key)
                taken = abs(effect.value(effect.side, abs(velocity), angle)), 0.0
            else:
                taken = self._take_effect(effect, velocity, angle, time, first, key, out)
            getattr(F, kind)[at], getattr(b, kind)[at] = factor * taken[0], factor * taken[1]
            getattr(limits, kind)[at] = abs(factor * effect.value(effect.side or 1, abs(velocity), angle))
        return F, b, limits

    def _remembers(self, kind: str, at: tuple[int, ...]) -> bool:
        """Whether the friction of a place has a memory: F is then |F|, the limit without the force."""
        return bool(self.elements.at(("joint", *at) if kind in ("joint", "load") else (kind, *at)))

    def _remembered(self, products: Places, lost: dict[tuple[str, int, int], float], out: Step) -> Places:
        """F·f with what has a memory in its place."""
        for (kind, i, j), loss in lost.items():
            getattr(products, kind)[i, j] = loss
        for j in range(self.n):
            if self._remembers("joint", (j,)):
                limit = products.joint[j] + products.load[j] + self.extensions.own_limit(j)
                held = self.elements.own(j, limit, out)
                share = held / limit if limit > 0.0 else 0.0
                own = products.joint[j] + products.load[j]
                products.load[j] *= share
                products.joint[j] = held - products.load[j] if own else held
        return products

    def _seen_by(
        self, kind: str, at: tuple[int, ...], q: list[float], v: list[float], x_dot: list[list[float]]
    ) -> tuple[float, float, Key]:
        """Velocity and angle of one place, and the key of its decision: who sees the same velocity decides together."""
        if kind == "edge":
            i, j = at
            return x_dot[i][j], q[j - 1] if j > 0 else 0.0, ("tendon", i, j)
        if kind == "pulley":
            i, j = at
            return x_dot[i][j + 1], 0.0, ("tendon", i, j + 1)
        return v[at[0]], 0.0, ("joint", at[0])

    def _take_effect(
        self, effect: Effect, v: float, angle: float, time: float, first: bool, key: Key, out: Step,
    ) -> tuple[float, float]:  # fmt: skip
        """Step 2 of section 5: (F, b) of one effect, and what it remembers."""
        direction = direction_above(v, effect.threshold, key, out)
        self._count_place(effect, direction, angle)

        if direction != 0:  # the effect moves
            F = effect.value(direction, abs(v), angle)
            b = 0.0
            if effect.stuck and not first:
                leaving = effect.at_threshold(direction, angle)
                if effect.side is None:
                    b = -leaving
                    self.branches["first_exit"] += 1
                    out.decisions[("first_exit",)] = True
                else:
                    kept = self._kept(effect)
                    entered = effect.at_threshold(effect.side, angle)
                    b = -leaving - (entered - leaving) * kept
                    self.branches["exit_same_side" if effect.side == direction else "exit_other_side"] += 1
                    out.decisions[("exit",)] = True
            elif not first:
                self.branches["reversal_between_samples" if effect.side != direction else "keeps_moving"] += 1
            else:
                self.branches["first_sample_moves"] += 1
            effect.side = direction
            effect.stuck = False
            return F, b

        b = 0.0
        if first:
            effect.stuck_since = time
            self.branches["first_sample_stuck"] += 1
        elif not effect.stuck:
            assert effect.side is not None
            b = effect.at_threshold(effect.side, angle)
            effect.stuck_since = time
            effect.absorbed_since = self.absorbed
            self.branches["enter"] += 1
            out.decisions[("enter",)] = True
        else:
            self.branches["stays_stuck"] += 1
        effect.last_stuck = time
        effect.stuck = True
        return 0.0, b

    def _kept(self, effect: Effect) -> float:
        """κ: the share that the rest has left of what entering it added."""
        if self.by_absorption:
            absorbed = self.absorbed - effect.absorbed_since
            self.branches["exit_with_absorption" if absorbed > 0.0 else "exit_unabsorbed"] += 1
            return math.exp(-absorbed)
        rested = effect.last_stuck - effect.stuck_since
        self.branches["exit_after_one_sample" if rested == 0.0 else "exit_with_memory"] += 1
        return math.exp(-self.forget_rate * rested)

    def _propagate(
        self, f0: Array, F_B: Array, F_A: Array, out: Step
    ) -> tuple[Array, Array, Array, dict[tuple[str, int, int], float]]:
        """eqs. (6), (7) as a recursion: f_B[i, j], f_A before the edge of joint j, slack[i], what memories lose."""
        lost: dict[tuple[str, int, int], float] = {}
        f_between = np.zeros((self.m, self.n))
        f_before_edge = np.zeros((self.m, self.n))
        slack = np.zeros(self.m, dtype=bool)

        def checked(force: float, i: int, place: str, j: int, computed: bool) -> float:
            """The force, or 0 and slack where a tendon that can only pull would push."""
            if self.tendons[i].bidirectional:
                self.branches["bidirectional_pushes" if force < 0.0 else "bidirectional_pulls"] += 1
                return force
            if out.decide(("force", i, place, j), force < 0.0, abs(force) if computed else 0.0):
                slack[i] = True
                self.branches["slack_at_spring" if place == "spring" else "slack_by_loss"] += 1
                return 0.0
            return force

        def loss(kind: str, i: int, j: int, friction: float, force: float) -> float:
            product = self._load(i, force) * friction
            if not self._remembers(kind, (i, j)):
                return product
            lost[kind, i, j] = self.elements.loss(kind, i, j, product, force, out)
            return lost[kind, i, j]

        given_forces, before, at_pulley = f0.tolist(), F_B.tolist(), F_A.tolist()
        for i in range(self.m):
            # f0 is an input: every implementation compares the same number, so it is never "near" (but interpolated)
            f_A = checked(given_forces[i], i, "spring", 0, computed=self.extensions.forces_are_computed)
            for j in range(self.n):
                f_before_edge[i, j] = f_A
                # a force of 0 stays 0 whatever the friction: nothing is decided there by rounding
                f_B = checked(f_A - loss("edge", i, j, before[i][j], f_A), i, "between", j, computed=f_A != 0.0)
                self.elements.behind("edge", i, j, f_B)
                f_between[i, j] = f_B
                f_A = checked(f_B - loss("pulley", i, j, at_pulley[i][j], f_B), i, "at", j, computed=f_B != 0.0)
                self.elements.behind("pulley", i, j, f_A)
        return f_between, f_before_edge, slack, lost

    def _load(self, i: int, force: float) -> float:
        """What multiplies an F or a b: the force, or its magnitude for a bidirectional tendon."""
        return abs(force) if self.tendons[i].bidirectional else force

    def _loads(self, f_before_edge: Array, f_between: Array) -> Places:
        """f, what multiplies an F or a b in eq. (10): the force or its magnitude, 1, or the sum over the tendons."""
        f = Places.zeros(self.m, self.n)
        for j in range(self.n):
            for i in range(self.m):
                f.edge[i, j] = self._load(i, f_before_edge[i, j])
                f.pulley[i, j] = self._load(i, f_between[i, j])
            f.joint[j] = 1.0
            f.load[j] = f.pulley[:, j].sum()
        return f

    def _total(self, products: Places) -> Array:
        """Friction part of eq. (10), of the products F·f or b·f."""
        return self._at_joints(products, self.R)

    def _held_at_most(self, products: Places) -> Array:
        """B [n] N·m, of the products |F|·f."""
        own = [self.extensions.own_limit(j) if self._remembers("joint", (j,)) else 0.0 for j in range(self.n)]
        return np.asarray(self._at_joints(products, np.abs(self.R)) + np.array(own))

    def _driven(self, x0: Array | None) -> Array:
        """x [n] N·m: what the motors load. x0: tendon positions less their zeros."""
        if not self.detector.watches_motors:
            return np.zeros(self.n)
        k = np.array([tendon.stiffness for tendon in self.tendons])
        return np.asarray(self.R.T @ (k * x0))

    def _at_joints(self, products: Places, arms: Array) -> Array:
        """[n] N·m: the tendons' losses by their arms [m, n], and what acts at the joints themselves."""
        loss = products.loss()
        torque = products.joint + products.load
        for j in range(self.n):
            torque[j] += arms[:, j] @ loss[:, j]
        return torque

    def _covers(self, q: Array) -> Array:
        """T_jq, [n] N·m."""
        return np.array([joint.cover_stiffness * (q[j] - joint.rest_angle) for j, joint in enumerate(self.joints)])

    def _springs(self, q: Array) -> Array:
        """T_jq and the torques of `extensions`."""
        return self._covers(q) + self.extensions.torques()

    def _gain(self, dt: float, noise: float, time: float, contact: bool) -> Array:
        """What step 6 takes of r, per joint; updates P."""
        if contact:
            self._inhibit(time)
            return np.zeros(self.n)
        if self.noise_time is not None:
            noise = noise * float(self.noise_time) / dt
            self.branches["noise_time"] += 1
        self.P = self.P + self.drift_variance * dt
        self.branches["gain_zero_of_zero"] += int((self.P + noise == 0.0).sum())
        K, of_all = (
            np.array([P / (P + noise) if P + noise != 0.0 else 0.0 for P in self.P + more])
            for more in (0.0, self.detector.unknown**2 / 3.0)
        )
        self.P = (1.0 - K) * self.P
        # all joints have one K: one start, one drift, one noise
        self.absorbed += LARGEST_ABSORPTION if K[0] >= 1.0 else min(LARGEST_ABSORPTION, -math.log(1.0 - K[0]))
        return of_all

    def _inhibit(self, time: float) -> None:
        """Contact: P stays, the rest counts as begun now (fig. 5, t1 = t)."""
        for _, _, effect in self.places:
            if effect.stuck:
                effect.stuck_since = time
                self.branches["stuck_in_contact"] += 1

    def _count_place(self, effect: Effect, direction: int, angle: float) -> None:
        if direction != 0:
            symmetric = all(law.positive == law.negative for law in effect.laws)
            side = "positive" if direction > 0 else "negative"
            self.branches[f"{'symmetric' if symmetric else 'asymmetric'}_{side}"] += 1
            if effect.threshold == 0.0:
                self.branches["moves_above_zero_threshold"] += 1
        if len(effect.angles) > 1:
            inside = effect.angles[0] < angle < effect.angles[-1]
            place = "inside" if inside else ("below" if angle <= effect.angles[0] else "above")
            self.branches[f"working_points_{place}"] += 1

    def _count_in_contact(self, out: Step, contact: bool) -> None:
        self.branches["contact" if contact else "no_contact"] += 1
        for event in ("enter", "exit", "first_exit"):
            if (event,) in out.decisions and contact:
                self.branches[f"{event}_in_contact"] += 1


INPUTS = ("tendon_force", "tendon_position", "joint_position", "joint_velocity")


def run(
    description: Mapping[str, Any],
    recording: Mapping[str, Array],
    kinematics_source: int = 1,
) -> Result:
    """Runs a finger over a recording: `time` [N] (s) and the inputs, [N, m] or [N, n] each."""
    finger = FingerOracle(description, kinematics_source)
    present = [name for name in INPUTS if recording.get(name) is not None]
    steps = []
    for k, time in enumerate(np.asarray(recording["time"], dtype=float)):
        inputs = {name: recording[name][k] for name in present}
        steps.append(finger.step(float(time), inputs))
    return Result(
        outputs={name: np.array([step.values[name] for step in steps]) for name in steps[0].values},
        margin=np.array([step.margin for step in steps]),
        branches=finger.branches,
    )
