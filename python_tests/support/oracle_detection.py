"""The oracle's detector: detection.md, bias.md and outputs.md of docs/reference/semantics.

Part of the oracle (see oracle.py): naive, for tests alone, sharing no code with the runtime. Joints are counted from 0.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_finger import Key, Step, as_long, given, longer
from oracle_rest import RestWatch

Array = NDArray[Any]

OF_LATE = 0.1  # of T_q
FASTEST = 10.0  # the evidence of `cusum` grows at most this many seconds a second


def direction_above(v: float, limit: float, key: Key, out: Step) -> int:
    """sgn(v) where |v| > limit, else 0."""
    sign = int(v > 0.0) - int(v < 0.0)
    return int(out.decide(key, sign if abs(v) > limit else 0, abs(abs(v) - limit)))


@dataclass
class Bounds:
    """Step 4a at one sample, N·m: H, J, E, u and V [n]; parts [n, m + 3]."""

    H: Array
    J: Array
    E: Array
    u: Array
    parts: Array
    V: Array


class DriftWatch:
    """o, p, s and c [n]. `begin` at the first sample, then `take` once a sample and `follow` with each update."""

    def __init__(self, drift: Mapping[str, Any], n: int, branches: Counter[str]) -> None:
        self.branches = branches
        self.quick_time, self.slow_time = (
            float(given(drift, "quick_time", 0.3)),
            float(given(drift, "slow_time", 10.0)),
        )
        self.threshold = np.array(drift["threshold"], dtype=float)
        self.per_force = np.array(given(drift, "threshold_per_force", [0.0] * n), dtype=float)
        self.late, self.quick, self.slow, self.learned, self.drift = (np.zeros(n) for _ in range(5))
        self.start = math.nan

    def _share(self, constant: float, time: float, dt: float) -> float:
        return 1.0 - math.exp(-dt / min(constant, time - self.start))

    def take(self, r: Array, time: float, dt: float) -> None:
        """Before contact is decided."""
        left = r + self.learned
        self.quick = self.quick + self._share(self.quick_time, time, dt) * (left - self.quick)
        self.late = self.late + self._share(self.quick_time * OF_LATE, time, dt) * (left - self.late)
        mean, now = self.quick - self.slow, self.late - self.slow
        self.drift = np.where(mean * now > 0.0, np.sign(mean) * np.minimum(np.abs(mean), np.abs(now)), 0.0)

    def follow(self, r: Array, K: Array, own: Array, contact: bool, time: float, dt: float) -> None:
        """K: the gain; own: that without V. What V has the bias learn is no drift."""
        of_start = (K - own) * r
        self.late = self.late - self._share(self.quick_time * OF_LATE, time, dt) * of_start
        self.quick = self.quick - self._share(self.quick_time, time, dt) * of_start
        if contact:
            self.slow = self.quick.copy()
            self.branches["drift_begins_anew"] += 1
        else:
            self.slow = self.slow + self._share(self.slow_time, time, dt) * (r - of_start + self.learned - self.slow)
        self.learned = self.learned + own * r

    def forget(self, unwatched: Array) -> None:
        """Joints whose sensors fail."""
        self.late, self.quick, self.slow, self.learned = (
            np.where(unwatched, 0.0, row) for row in (self.late, self.quick, self.slow, self.learned)
        )

    def bound(self, j: int, mean_force: float) -> float:
        return float(self.threshold[j] + self.per_force[j] * mean_force)


class Detector:
    """Decides on contact. `bounds`, `watch`, `contact`, `update`, `std` and `at_rest` are called once a sample,
    in this order."""

    def __init__(self, description: Mapping[str, Any], R: Array, branches: Counter[str]) -> None:
        m, n = R.shape
        self.n, self.m, self.branches = n, m, branches
        contact = description["contact"]

        def per_joint(table: Mapping[str, Any] | None, key: str) -> Array:
            return np.array(given(table, key, [0.0] * n), dtype=float)

        self.threshold = per_joint(contact, "threshold")
        self.threshold_per_force = per_joint(contact, "threshold_per_force")
        self.method = given(contact, "method", "threshold")
        innovation = given(contact, "innovation", None)
        if (self.method == "threshold") != (innovation is None):
            raise ValueError(f"contact.innovation: required by the methods innovation and cusum alone ({self.method})")
        self.T = float(given(innovation, "time", math.nan))
        self.innovation_threshold = per_joint(innovation, "threshold")
        self.innovation_per_force = per_joint(innovation, "threshold_per_force")
        self.evidence_time = float(given(innovation, "evidence_time", math.nan))
        self.friction_bound = given(contact, "friction_bound", None)
        self.stuck_share = float(given(self.friction_bound, "stuck_share", 0.0))
        self.jump_share = float(given(self.friction_bound, "jump_share", 0.0))
        self.bounds_presliding = bool(given(self.friction_bound, "stuck_presliding", False))
        self.jump_time = float(given(self.friction_bound, "jump_time", 0.06))
        self.stuck_time = float(given(self.friction_bound, "stuck_time", 0.0))
        self.uncertainty = given(contact, "uncertainty", None)
        self.level = float(given(contact, "uncertainty_level", 3.0))
        self.deviation = per_joint(contact, "deviation")
        self.deviation_per_force = per_joint(contact, "deviation_per_force")
        self.release_ratio = float(given(contact, "release_ratio", 1.0))
        self.hold_time = float(given(contact, "hold_time", 0.0))
        self.release_time = given(contact, "release_time", None)
        rests = given(contact, "rest", None) is not None
        self.rest = RestWatch(description, R, branches) if rests else None
        drift = given(contact, "drift", None)
        self.slow = None if drift is None else DriftWatch(drift, n, branches)
        # state
        self.H = np.zeros(n)
        self.J = np.zeros(n)
        self.filtered = np.zeros(n)  # m_j
        self.evidence = np.zeros(n)  # g_j
        self.in_contact = np.zeros(n, dtype=bool)  # joint_contact of the sample before
        self.last_exceeded = np.full(n, math.nan)
        self.contact_since: float | None = None  # time of the first sample of the present contact

    def bounds(self, H: Array, parts: Array, change: Array, V: Array, dt: float) -> Bounds:
        """Step 4a. H [n]: S_j, what hides in stiction; parts [n, m + 3]: T by its sources; change [n]: T_eff − T'_eff.

        change and dt are 0 at the first sample, which leaves J there at 0.
        """
        if self.friction_bound is None:
            H = np.zeros(self.n)
        else:
            self.J = self.J * math.exp(-dt / self.jump_time) + np.abs(change)
            self.H = np.maximum(H, self.H * math.exp(-dt / self.stuck_time)) if self.stuck_time else H
            H = self.H.copy()
        if self.uncertainty is None:
            parts = np.zeros((self.n, self.m + 3))
        u = np.zeros(self.n)
        for j in range(self.n):
            for direction in self._directions(j):
                e = sum(weight * part for weight, part in zip(direction, parts[j], strict=True))
                u[j] += e * e
        u = np.sqrt(u)
        return Bounds(H, self.J.copy(), self.stuck_share * H + self.jump_share * self.J + V, u, parts, V)

    def _directions(self, j: int) -> list[list[float]]:
        if self.uncertainty is None:
            return []
        self.branches["uncertain_joint" if self.uncertainty[j] else "certain_joint"] += 1
        return self.uncertainty[j] or []

    def watch(
        self, f0: Array, x0: Array | None, mean_force: float, time: float, dt: float, first: bool, out: Step,
    ) -> None:  # fmt: skip
        """Step 5a, of contact.rest. x0: the tendon positions as they are given."""
        if self.rest is not None:
            self.rest.take(f0, np.array(x0, dtype=float), mean_force, time, dt, first, out)

    def begin(self, time: float) -> None:
        """The first sample."""
        if self.slow is not None:
            self.slow.start = time

    def drift(self) -> Array:
        """d [n], N·m; 0 without contact.drift."""
        return np.zeros(self.n) if self.slow is None else self.slow.drift

    def forget(self, unwatched: Array) -> None:
        """Joints [n] whose sensors fail: nothing is known of them, before `contact`."""
        self.filtered = np.where(unwatched, 0.0, self.filtered)
        self.evidence = np.where(unwatched, 0.0, self.evidence)
        self.in_contact = self.in_contact & ~unwatched
        if self.rest is not None:
            self.rest.carried = np.where(unwatched, 0.0, self.rest.carried)
        if self.slow is not None:
            self.slow.forget(unwatched)

    def at_rest(self) -> dict[str, Array]:
        """The outputs of contact.rest; none without it."""
        if self.rest is None:
            return {}
        return {"contact_change": self.rest.change, "contact_at_rest": np.asarray(self.rest.at_rest.any())}

    def contact(
        self, r: Array, bounds: Bounds, mean_force: float, time: float, dt: float, out: Step,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Step 5: joint_contact [n] and y [n] (0 with the method `threshold`), after `watch`."""
        y = np.zeros(self.n) if self.method == "threshold" else r - self.filtered
        if self.slow is not None:
            self.slow.take(r, time, dt)
        found = np.zeros(self.n, dtype=bool)
        loaded = np.zeros(self.n, dtype=bool) if self.rest is None else self.rest.loaded(r, out)
        for j in range(self.n):
            if self._exceeds(j, r[j], y[j], bounds, mean_force, dt, out) or loaded[j]:
                found[j] = True
                self.last_exceeded[j] = time
            elif self.in_contact[j] and not longer(time - self.last_exceeded[j], self.hold_time, dt):
                found[j] = True
                self.branches["held"] += 1
        self.in_contact = found
        if not found.any():
            self.contact_since = None
        elif self.contact_since is None or (self.rest is not None and self.rest.at_rest.any()):
            self.contact_since = time
        return found, y

    def _exceeds(
        self, j: int, r: float, y: float, bounds: Bounds, mean_force: float, dt: float, out: Step,
    ) -> bool:  # fmt: skip
        """Whether any of the method's criteria is exceeded at joint j."""
        ratio = self.release_ratio if self.in_contact[j] else 1.0
        without_ratio = False

        def above(name: str, value: float, limit: float) -> bool:
            nonlocal without_ratio
            without_ratio = without_ratio or value > limit
            return out.above((name, j), value, ratio * limit)

        allowed = self.threshold[j] + self.threshold_per_force[j] * mean_force + bounds.E[j]
        by_residual = above("contact", abs(r), allowed + self.level * bounds.u[j])
        if self.method == "threshold":
            exceeds = by_residual
        else:
            B = self.innovation_threshold[j] + self.innovation_per_force[j] * mean_force + bounds.E[j]
            if self.method == "innovation":
                by_innovation = above("innovation", abs(y), B)
            else:
                self._gather_evidence(j, abs(y), B, dt, out)
                by_innovation = above("cusum", self.evidence[j], self.evidence_time)
            if by_residual != by_innovation:
                self.branches["residual_alone" if by_residual else f"{self.method}_alone"] += 1
            exceeds = by_residual or by_innovation
        if self.slow is not None:
            by_drift = above("drift", abs(self.slow.drift[j]), self.slow.bound(j, mean_force) + bounds.V[j])
            self.branches["drift_alone"] += by_drift and not exceeds
            exceeds = exceeds or by_drift
        if exceeds and not without_ratio:
            self.branches["release_ratio_holds"] += 1
        return exceeds

    def _gather_evidence(self, j: int, y: float, B: float, dt: float, out: Step) -> None:
        """g_j of `cusum`, in seconds."""
        if B == 0.0:
            growth = FASTEST if out.above(("no_bound", j), y, 0.0) else -1.0
            self.branches["evidence_without_bound"] += 1
        else:
            growth = min(FASTEST, y / B - 1.0)
        grown = self.evidence[j] + dt * growth
        if grown < 0.0 < self.evidence[j]:
            self.branches["evidence_emptied"] += 1
        elif grown > 2.0 * self.evidence_time:
            self.branches["evidence_full"] += 1
        elif growth == FASTEST:
            self.branches["evidence_fastest"] += 1
        self.evidence[j] = min(2.0 * self.evidence_time, max(0.0, grown))

    def updates(self, time: float, dt: float) -> bool:
        """Step 6: whether the bias is updated at this sample, after `contact`."""
        if self.contact_since is None:
            return True
        if self.release_time is None or not as_long(time - self.contact_since, self.release_time, dt):
            return False
        self.branches["update_in_contact"] += 1
        return True

    def update(self, r: Array, K: Array, own: Array, time: float, dt: float) -> None:
        """m_j, s_j and c_j follow r where the bias is updated. K: the gain; own: that without V."""
        if self.slow is not None:
            self.slow.follow(r, K, own, bool(self.in_contact.any()), time, dt)
        if self.method != "threshold":
            self.filtered = self.filtered + (1.0 - math.exp(-dt / self.T)) * (r - self.filtered)

    def std(self, P: Array, bounds: Bounds, mean_force: float) -> Array:
        """Step 7, [n] N·m."""
        free = self.deviation + self.deviation_per_force * mean_force
        evenly = ((self.stuck_share * bounds.H) ** 2 + (self.jump_share * bounds.J) ** 2) / 3.0
        return np.asarray(np.sqrt(P + free**2 + bounds.u**2 + evenly))
