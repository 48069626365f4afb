"""Naive numpy implementation of the sample semantics (contract section 5), used by tests alone.

Written from the contract's text and the paper, sharing no code with the runtime. It favours reading
over speed: one plain loop over samples, and one small object per friction effect. Indices in this
file start at 0; joint 0 is the first joint, so the edge before joint 0 sees the angle q_0 = 0.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_finger import Effect, Joint, Tendon, given, read_effect, read_effects

Array = NDArray[Any]
Key = tuple[Any, ...]

NEAR = 1e-9  # contract section 5: a decision closer than this to its threshold may go either way


@dataclass
class Result:
    """Outputs of a run and what the agreement rule and the branch counts need.

    outputs: name -> [N, n], [N, m] or [N] (`contact`).
    velocity_margin, residual_margin, force_margin: [N], smallest distance of the sample to a
        threshold (m/s or rad/s, N.m, N).
    alternatives: sample -> {decision key: values the decision may also take within NEAR}.
    branches: how often each branch was taken.
    """

    outputs: dict[str, Array]
    velocity_margin: Array
    residual_margin: Array
    force_margin: Array
    alternatives: dict[int, dict[Key, list[Any]]]
    branches: Counter[str]

    @property
    def near(self) -> Array:
        """[N] bool: samples within NEAR of some threshold."""
        smallest = np.minimum(np.minimum(self.velocity_margin, self.residual_margin), self.force_margin)
        return np.asarray(smallest < NEAR)


@dataclass
class Step:
    """What one sample yields besides the change of the state."""

    values: dict[str, Array] = field(default_factory=dict)
    velocity_margin: float = math.inf
    residual_margin: float = math.inf
    force_margin: float = math.inf
    decisions: dict[Key, Any] = field(default_factory=dict)
    alternatives: dict[Key, list[Any]] = field(default_factory=dict)


class FingerOracle:
    """One finger: constants from the description, and the remembered state. `step` takes a sample.

    Raises ValueError when the routing matrix has no full column rank or time goes back.
    """

    def __init__(self, description: Mapping[str, Any], kinematics_source: int = 1) -> None:
        self.source = kinematics_source
        self.branches: Counter[str] = Counter()
        self._read_structure(description)
        self._read_settings(description)
        # state
        self.samples = 0
        self.time = math.nan
        self.q = np.zeros(self.n)
        self.v = np.zeros(self.n)
        self.b_eff = np.zeros(self.n)
        self.P = np.zeros(self.n)
        self.last = Step()

    def _read_structure(self, description: Mapping[str, Any]) -> None:
        thresholds = given(description, "velocity_threshold", {})
        v_tendon = float(given(thresholds, "tendon", 0.0005))
        v_joint = float(given(thresholds, "joint", 0.01))
        self.n = len(description["joints"])
        self.m = len(description["tendons"])
        self.joints = []
        for entry in description["joints"]:
            cover = given(entry, "cover", {})
            self.joints.append(
                Joint(
                    cover_stiffness=float(given(cover, "stiffness", 0.0)),
                    rest_angle=float(given(cover, "rest_angle", 0.0)),
                    friction=read_effect(entry.get("friction"), v_joint),
                    load_friction=read_effect(entry.get("load_friction"), v_joint),
                )
            )
        for extension in given(description, "extensions", []):
            if extension["effect"] != "cover_hardening":
                raise ValueError(f"extensions: effect {extension['effect']!r} is unknown to the oracle")
            self.joints[extension["joint"] - 1].hardening += float(extension["stiffness"])
        self.tendons = [
            Tendon(
                stiffness=float(entry["stiffness"]),
                bidirectional=bool(given(entry, "bidirectional", False)),
                pulley=read_effects(entry.get("pulley_friction"), self.n, v_tendon),
                edge=read_effects(entry.get("edge_friction"), self.n, v_tendon),
            )
            for entry in description["tendons"]
        ]
        self.R = np.array([entry["moment_arms"] for entry in description["tendons"]], dtype=float)
        singular_values = np.linalg.svd(self.R, compute_uv=False)
        if self.m < self.n or singular_values[-1] < 1e-15 * singular_values[0] or singular_values[0] == 0.0:
            raise ValueError("tendons: moment_arms have no full column rank")
        self.R_plus = np.linalg.pinv(self.R, rcond=1e-15)

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
        contact = description["contact"]
        self.contact_threshold = np.array(contact["threshold"], dtype=float)
        self.contact_per_force = np.array(given(contact, "threshold_per_force", [0.0] * self.n), dtype=float)

    def step(self, time: float, inputs: Mapping[str, Array], forced: Mapping[Key, Any] | None = None) -> Step:
        """Takes one sample. `forced` fixes single decisions (by key) instead of deciding them."""
        if time == self.time:
            return self.last  # the sample of this time is already taken
        if time < self.time:
            raise ValueError(f"time: {time} lies before the last sample's {self.time}")
        first = self.samples == 0
        dt = 0.0 if first else time - self.time
        out = Step()
        f0 = np.asarray(inputs["tendon_force"], dtype=float)

        def decide(key: Key, value: Any, others: list[Any]) -> Any:
            chosen = (forced or {}).get(key, value)
            out.decisions[key] = chosen
            if others:
                out.alternatives[key] = others
            return chosen

        # 1. kinematics
        q, v = self._kinematics(inputs, f0, dt, first)
        x_dot = self._tendon_velocity(v)
        # 2. each friction effect: F and the increment b, per place
        F_B, b_B, F_A, b_A, F_joint, b_joint, F_load, b_load = self._effects(q, v, x_dot, time, first, decide, out)
        # 3. forces at and between the joints
        f_between, f_before_edge, slack = self._propagate(f0, F_B, F_A, decide, out)
        # 4. totals, eq. (10)
        T = self._total(f_before_edge, f_between, F_B, F_A, F_joint, F_load) + self._springs(q)
        db = self._total(f_before_edge, f_between, b_B, b_A, b_joint, b_load)
        tau = self.R.T @ f0
        mean_force = float(np.mean(np.abs(f0)))
        noise = (self.noise_std + self.noise_std_per_force * mean_force) ** 2
        if first:
            self.P = np.full(self.n, noise if self.initial_variance is None else float(self.initial_variance))
            self.b_eff = tau - T if self.initial_torque is None else np.array(self.initial_torque, dtype=float)
            self.branches["initial_torque" if self.initial_torque is not None else "initial_bias"] += 1
            joint_contact = np.zeros(self.n, dtype=bool)
        else:
            self.b_eff = self.b_eff + db
        T_eff = self.b_eff + T
        if not first:
            # 5. contact, 6. bias update or its inhibition
            joint_contact = self._contact(tau - T_eff, mean_force, decide, out)
            if joint_contact.any():
                self._inhibit(time)
            else:
                K = self._gain(dt, noise)
                correction = K * (tau - T_eff)
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
        }
        self.q, self.v, self.time, self.last = q, v, time, out
        self.samples += 1
        return out

    def _kinematics(self, inputs: Mapping[str, Array], f0: Array, dt: float, first: bool) -> tuple[Array, Array]:
        if self.source == 1:
            k = np.array([tendon.stiffness for tendon in self.tendons])
            q = self.R_plus @ (np.asarray(inputs["tendon_position"], dtype=float) - f0 / k)
        else:
            q = np.array(inputs["joint_position"], dtype=float)
        if self.source == 3:
            return q, np.array(inputs["joint_velocity"], dtype=float)
        if first:
            return q, np.zeros(self.n)
        raw = (q - self.q) / dt
        if self.cutoff == 0.0:
            return q, raw
        return q, self.v + (1.0 - math.exp(-2.0 * math.pi * self.cutoff * dt)) * (raw - self.v)

    def _tendon_velocity(self, v: Array) -> Array:
        """eq. (5), [m, n + 1]; the last column is the velocity after the last joint, 0."""
        x_dot = np.zeros((self.m, self.n + 1))
        for i in range(self.m):
            for j in range(self.n):
                x_dot[i, j] = sum(self.R[i, after] * v[after] for after in range(j, self.n))
        return x_dot

    def _effects(
        self, q: Array, v: Array, x_dot: Array, time: float, first: bool, decide: Callable[..., Any], out: Step
    ) -> tuple[Array, ...]:
        F_B, b_B, F_A, b_A = (np.zeros((self.m, self.n)) for _ in range(4))
        F_joint, b_joint, F_load, b_load = (np.zeros(self.n) for _ in range(4))

        def take(effect: Effect | None, velocity: float, angle: float, key: Key) -> tuple[float, float]:
            if effect is None:
                return 0.0, 0.0
            return self._take_effect(effect, velocity, angle, time, first, key, decide, out)

        for j in range(self.n):
            angle_before = q[j - 1] if j > 0 else 0.0
            for i, tendon in enumerate(self.tendons):
                F_B[i, j], b_B[i, j] = take(tendon.edge[j], x_dot[i, j], angle_before, ("tendon", i, j))
                F_A[i, j], b_A[i, j] = take(tendon.pulley[j], x_dot[i, j + 1], 0.0, ("tendon", i, j + 1))
            F_joint[j], b_joint[j] = take(self.joints[j].friction, v[j], 0.0, ("joint", j))
            F_load[j], b_load[j] = take(self.joints[j].load_friction, v[j], 0.0, ("joint", j))
        return F_B, b_B, F_A, b_A, F_joint, b_joint, F_load, b_load

    def _take_effect(
        self, effect: Effect, v: float, angle: float, time: float, first: bool, key: Key,
        decide: Callable[..., Any], out: Step,
    ) -> tuple[float, float]:  # fmt: skip
        """Step 2 of section 5: (F, b) of one effect, and what it remembers."""
        sign = int(np.sign(v))
        margin = abs(abs(v) - effect.threshold)
        out.velocity_margin = min(out.velocity_margin, margin)
        direction = sign if abs(v) > effect.threshold else 0
        others = [d for d in (-1, 0, 1) if d != direction] if abs(v) < NEAR else [0 if direction else sign]
        direction = decide(key, direction, others if margin < NEAR else [])
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
                    entered = effect.at_threshold(effect.side, angle)
                    rested = effect.last_stuck - effect.stuck_since
                    b = -leaving - (entered - leaving) * math.exp(-self.forget_rate * rested)
                    self.branches["exit_same_side" if effect.side == direction else "exit_other_side"] += 1
                    self.branches["exit_after_one_sample" if rested == 0.0 else "exit_with_memory"] += 1
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
            self.branches["enter"] += 1
            out.decisions[("enter",)] = True
        else:
            self.branches["stays_stuck"] += 1
        effect.last_stuck = time
        effect.stuck = True
        return 0.0, b

    def _propagate(
        self, f0: Array, F_B: Array, F_A: Array, decide: Callable[..., Any], out: Step
    ) -> tuple[Array, Array, Array]:
        """eqs. (6), (7) as a recursion: f_B[i, j], f_A before the edge of joint j, and slack[i]."""
        f_between = np.zeros((self.m, self.n))
        f_before_edge = np.zeros((self.m, self.n))
        slack = np.zeros(self.m, dtype=bool)

        def checked(force: float, i: int, place: str, j: int, computed: bool) -> float:
            """The force, or 0 and slack where a tendon that can only pull would push."""
            if self.tendons[i].bidirectional:
                self.branches["bidirectional_pushes" if force < 0.0 else "bidirectional_pulls"] += 1
                return force
            near = computed and abs(force) < NEAR
            if computed:
                out.force_margin = min(out.force_margin, abs(force))
            negative = decide(("force", i, place, j), force < 0.0, [not force < 0.0] if near else [])
            if negative:
                slack[i] = True
                self.branches["slack_by_loss" if computed else "slack_at_spring"] += 1
                return 0.0
            return force

        for i in range(self.m):
            # f0 is an input: every implementation compares the same number, so it is never "near"
            f_A = checked(float(f0[i]), i, "spring", 0, computed=False)
            for j in range(self.n):
                f_before_edge[i, j] = f_A
                # a force of 0 stays 0 whatever the friction: nothing is decided there by rounding
                f_B = checked(f_A - self._load(i, f_A) * F_B[i, j], i, "between", j, computed=f_A != 0.0)
                f_between[i, j] = f_B
                f_A = checked(f_B - self._load(i, f_B) * F_A[i, j], i, "at", j, computed=f_B != 0.0)
        return f_between, f_before_edge, slack

    def _load(self, i: int, force: float) -> float:
        """What multiplies an F or a b: the force, or its magnitude for a bidirectional tendon."""
        return abs(force) if self.tendons[i].bidirectional else force

    def _total(self, f_before_edge: Array, f_between: Array, B: Array, A: Array, joint: Array, load: Array) -> Array:
        """Friction part of eq. (10), with the F or with the b in their place."""
        total = np.zeros(self.n)
        for j in range(self.n):
            for i in range(self.m):
                loss = 0.0
                for upto in range(j + 1):
                    loss += self._load(i, f_before_edge[i, upto]) * B[i, upto]
                    loss += self._load(i, f_between[i, upto]) * A[i, upto]
                total[j] += self.R[i, j] * loss
            total[j] += joint[j]
            total[j] += load[j] * sum(self._load(i, f_between[i, j]) for i in range(self.m))
        return total

    def _springs(self, q: Array) -> Array:
        """T_jq: the linear cover, and the cubic extension `cover_hardening`."""
        torque = np.zeros(self.n)
        for j, joint in enumerate(self.joints):
            bend = q[j] - joint.rest_angle
            torque[j] = joint.cover_stiffness * bend + joint.hardening * bend**3
        return torque

    def _contact(self, r: Array, mean_force: float, decide: Callable[..., Any], out: Step) -> Array:
        thresholds = self.contact_threshold + self.contact_per_force * mean_force
        joint_contact = np.zeros(self.n, dtype=bool)
        for j in range(self.n):
            margin = abs(abs(r[j]) - thresholds[j])
            out.residual_margin = min(out.residual_margin, float(margin))
            exceeds = bool(abs(r[j]) > thresholds[j])
            joint_contact[j] = decide(("contact", j), exceeds, [not exceeds] if margin < NEAR else [])
        return joint_contact

    def _gain(self, dt: float, noise: float) -> Array:
        """Kalman gain per joint; updates P."""
        if self.noise_time is not None:
            noise = noise * float(self.noise_time) / dt
            self.branches["noise_time"] += 1
        K = np.zeros(self.n)
        for j in range(self.n):
            self.P[j] += self.drift_variance * dt
            if self.P[j] + noise != 0.0:
                K[j] = self.P[j] / (self.P[j] + noise)
            else:
                self.branches["gain_zero_of_zero"] += 1
            self.P[j] = (1.0 - K[j]) * self.P[j]
        return K

    def _inhibit(self, time: float) -> None:
        """Contact: b_eff and P stay, the rest counts as begun now (fig. 5, t1 = t)."""
        effects = [joint.friction for joint in self.joints] + [joint.load_friction for joint in self.joints]
        for tendon in self.tendons:
            effects += tendon.pulley + tendon.edge
        for effect in effects:
            if effect is not None and effect.stuck:
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
    forced: Mapping[Key, Any] | None = None,
) -> Result:
    """Runs a finger over a recording: `time` [N] (s) and the inputs, [N, m] or [N, n] each.

    forced: decisions to take differently, keyed (sample, *decision key); see agreement.py.
    """
    finger = FingerOracle(description, kinematics_source)
    by_sample: dict[int, dict[Key, Any]] = {}
    for key, value in (forced or {}).items():
        by_sample.setdefault(key[0], {})[key[1:]] = value
    present = [name for name in INPUTS if recording.get(name) is not None]
    steps = []
    for k, time in enumerate(np.asarray(recording["time"], dtype=float)):
        inputs = {name: recording[name][k] for name in present}
        steps.append(finger.step(float(time), inputs, by_sample.get(k)))
    return Result(
        outputs={name: np.array([step.values[name] for step in steps]) for name in steps[0].values},
        velocity_margin=np.array([step.velocity_margin for step in steps]),
        residual_margin=np.array([step.residual_margin for step in steps]),
        force_margin=np.array([step.force_margin for step in steps]),
        alternatives={k: step.alternatives for k, step in enumerate(steps) if step.alternatives},
        branches=finger.branches,
    )
