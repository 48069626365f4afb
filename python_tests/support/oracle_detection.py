"""The oracle's detector: docs/reference/semantics/detection.md.

Part of the oracle (see oracle.py): naive, for tests alone, sharing no code with the runtime. Joints and bands are
counted from 0.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_finger import Key, Step, given, longer

Array = NDArray[Any]

SHORT = (0.004, 0.02, 0.06, 0.5)  # A_k, s
LONG = (0.05, 0.3, 1.0, 10.0)  # M_k, s
LEAK, FORGET = 10.0, 1.0  # s
LEAST_TIME, END = 0.02, 0.4  # s, of the peak
MOVED = 0.1  # rad
HIGHEST = 1e150  # level
NUMBERS = ("noise", "friction", "friction_limit", "motor_load", "friction_change", "friction_reserve")


def direction_above(v: float, limit: float, key: Key, out: Step) -> int:
    """sgn(v) where |v| > limit, else 0."""
    sign = int(v > 0.0) - int(v < 0.0)
    return int(out.decide(key, sign if abs(v) > limit else 0, abs(abs(v) - limit)))


def level_of(distance: float, bound: float) -> float:
    return 0.0 if distance == 0.0 else HIGHEST if bound == 0.0 else min(HIGHEST, distance / bound)


@dataclass
class Signals:
    """What step 5 takes of a sample, each [n], N·m: e, r, x, T, B, Q; and q, rad."""

    e: Array
    r: Array
    x: Array
    T: Array
    B: Array
    Q: Array
    q: Array

    def of(self, j: int) -> tuple[float, ...]:
        """e, x, T, B, U of a joint."""
        return (float(self.e[j]), float(self.x[j]), float(self.T[j]), float(self.B[j]),
                max(0.0, float(self.B[j] - self.Q[j])))  # fmt: skip


@dataclass
class Band:
    """Of one joint: means of e (a, m), x and T, N·m, and the loads D and S."""

    a: float
    m: float
    x_short: float
    x_long: float
    T_short: float
    T_long: float
    D: float = 0.0
    S: float = 0.0


@dataclass
class Joint:
    """What the method bands remembers of a joint. base: None without contact."""

    bands: list[Band] = field(default_factory=list)
    start: float = math.nan  # t_0
    h: float = 0.0
    V: float = 0.0
    has_moved: bool = False
    turned: float = 0.0
    q_0: float = 0.0
    base: float | None = None
    sign: float = 0.0
    begun: float = math.nan
    peak: float = 0.0

    def begin(self, e: float, x: float, T: float, time: float) -> None:
        """Begin anew; S stays."""
        before = [band.S for band in self.bands] or [0.0] * len(SHORT)
        self.bands = [Band(e, e, x, x, T, T, S=S) for S in before]
        self.start, self.base = time, None


class Detector:
    """Decides on contact. `take` once a sample; then level [n] and terms [n, 4, 8] are those of the sample."""

    def __init__(self, description: Mapping[str, Any], R: Array, branches: Counter[str]) -> None:
        n = R.shape[1]
        self.n, self.branches = n, branches
        contact = description["contact"]

        def per_joint(table: Mapping[str, Any], key: str) -> Array:
            return np.array(given(table, key, [0.0] * n), dtype=float)

        self.threshold = per_joint(contact, "threshold")
        self.threshold_per_force = per_joint(contact, "threshold_per_force")
        self.deviation = per_joint(contact, "deviation")
        self.deviation_per_force = per_joint(contact, "deviation_per_force")
        self.by_bands = given(contact, "method", "paper") == "bands"
        rows = given(contact, "bands", [])
        self.numbers = [{name: per_joint(row, name).tolist() for name in NUMBERS} for row in rows]
        if len(self.numbers) != (len(SHORT) if self.by_bands else 0):
            raise ValueError("contact.bands: 4 rows, with the method bands alone")
        self.watches_motors = bool(given(contact, "watches_motors", False))
        self.joints = [Joint() for _ in range(n)]
        self.unknown = np.zeros(n)  # max(V, W) before this sample; 0 with the paper's method
        self.in_contact = np.zeros(n, dtype=bool)
        self.level = np.zeros(n)
        self.terms = np.zeros((n, len(SHORT), 8))

    def take(
        self, of: Signals, mean_force: float, time: float, dt: float, anew: Array, out: Step
    ) -> Array:  # fmt: skip
        """Step 5: joint_contact [n]. anew [n]: joints that begin with this sample or are blind."""
        before = bool(self.in_contact.any())
        self.unknown = np.array([max(joint.V, joint.turned) for joint in self.joints])
        self.level, self.terms = np.zeros(self.n), np.zeros((self.n, len(SHORT), 8))
        found = np.zeros(self.n, dtype=bool)
        for j in range(self.n):
            if self.by_bands:
                found[j] = self._by_bands(j, of.of(j), time, dt, before, bool(anew[j]), float(of.q[j]), out)
            else:
                bound = float(self.threshold[j] + self.threshold_per_force[j] * mean_force)
                distance = 0.0 if anew[j] else abs(float(of.r[j]))
                self.level[j] = level_of(distance, bound)
                found[j] = not anew[j] and out.above(("contact", j), distance, bound)
        self.in_contact = found
        return found

    def std(self, P: Array, mean_force: float) -> Array:
        """Step 7, [n] N·m."""
        return np.asarray(np.sqrt(P + (self.deviation + self.deviation_per_force * mean_force) ** 2))

    def _by_bands(
        self, j: int, sample: tuple[float, ...], time: float, dt: float, held: bool, anew: bool, q: float,
        out: Step
    ) -> bool:  # fmt: skip
        """Whether joint j is in contact. held: any was at the sample before."""
        e, x, T, B, U = sample
        joint = self.joints[j]
        if anew:
            joint.bands = []
            joint.begin(e, x, T, time)
            joint.h, joint.V, joint.has_moved, joint.turned, joint.q_0 = e, B, False, 0.0, q
            self.terms[j] = self._nothing(T, B)
            return False
        self._follow(joint, sample, time, dt, held)
        if not joint.has_moved:
            joint.turned = max(joint.turned, B - U)
        waits = not joint.has_moved and joint.base is None
        if waits and out.above(("moves", j), joint.turned, 0.5 * B):
            joint.bands = []
            joint.begin(e, x, T, time)
            joint.h, joint.V, joint.has_moved, joint.turned = e, B, True, 0.0
            self.terms[j] = self._nothing(T, B)
            self.branches["moves_first"] += 1
            return False
        if not joint.has_moved and out.above(("moves_away", j), abs(q - joint.q_0), MOVED):
            joint.has_moved, joint.turned = True, 0.0
            self.branches["moves_away"] += 1
        distances, bounds = zip(*(self._measure(j, k, abs(T), B) for k in range(len(SHORT))), strict=True)
        levels = [level_of(distance, bound) for distance, bound in zip(distances, bounds, strict=True)]
        self.level[j] = max(levels)
        if joint.base is None:
            self._begin_contact(j, levels, bounds, time, out)
        elif self._ends(j, time, dt, out):
            joint.begin(e, x, T, time)
            joint.V, self.terms[j] = joint.peak, self._nothing(T, B)
            self.branches["contact_ends"] += 1
        return joint.base is not None

    @staticmethod
    def _nothing(T: float, B: float) -> list[float]:
        """Terms of a band of a joint that begins anew."""
        return [0.0, 0.0, 1.0, abs(T), B, 0.0, 0.0, 0.0]

    def _follow(self, joint: Joint, sample: tuple[float, ...], time: float, dt: float, held: bool) -> None:
        """Rules 1 to 5."""
        e, x, T, _, U = sample

        def share(constant: float) -> float:
            return 1.0 - math.exp(-dt / min(constant, time - joint.start))

        joint.V *= math.exp(-dt / FORGET)
        for band, short, long in zip(joint.bands, SHORT, LONG, strict=True):
            band.a += share(short) * (e - band.a)
            band.x_short += share(short) * (x - band.x_short)
            band.T_short += share(short) * (T - band.T_short)
            band.m += (1.0 - math.exp(-dt / LEAK) if held else share(long)) * (band.a - band.m)
            band.x_long += share(long) * (band.x_short - band.x_long)
            band.T_long += share(long) * (band.T_short - band.T_long)
            fade = math.exp(-dt / long)
            band.D = max(band.D * fade, abs(band.x_short - band.x_long))
            band.S = max(band.S * fade, U)
        if not held:
            joint.h += (1.0 - math.exp(-dt / LEAK)) * (joint.bands[1].a - joint.h)
        self.branches["held_by_another" if held and joint.base is None else "own_pace"] += 1

    def _measure(self, j: int, k: int, T: float, B: float) -> tuple[float, float]:
        """Rules 6 and 7 of a band: distance and bound. T: its magnitude."""
        joint, numbers = self.joints[j], self.numbers[k]
        band = joint.bands[k]
        change = abs(band.T_short - band.T_long)
        self.branches["change_limited"] += change > band.D
        self.branches["reserve_limited"] += band.S > joint.bands[2].D
        parts = (1.0, T, B, band.D, min(change, band.D), min(band.S, joint.bands[2].D))
        unknown = max(joint.V, joint.turned)
        bound = math.sqrt(unknown**2 + sum((numbers[name][j] * part) ** 2
                                           for name, part in zip(NUMBERS, parts, strict=True)))  # fmt: skip
        moved = band.a - band.m
        sign = math.copysign(1.0, moved) if moved != 0.0 else 0.0
        distance = max(0.0, min(abs(moved), (band.a - joint.h) * sign))
        self.branches["home_blocks"] += distance == 0.0 and abs(moved) > bound
        self.terms[j, k] = moved, sign * distance, *parts
        return distance, bound

    def _begin_contact(
        self, j: int, levels: list[float], bounds: tuple[float, ...], time: float, out: Step
    ) -> None:  # fmt: skip
        """Rule 8 of a joint that is not in contact."""
        k = levels.index(max(levels))
        if not out.decide(("begins", j), levels[k] > 1.0, abs(levels[k] - 1.0) * bounds[k]):
            return
        gap = min((levels[k] - level for level in levels if level != levels[k]), default=1.0)
        joint = self.joints[j]
        band = joint.bands[out.decide(("band", j), k, gap * bounds[k])]
        joint.sign = math.copysign(1.0, band.a - band.m)
        joint.base = joint.sign * max(joint.sign * band.m, joint.sign * joint.h)
        self.branches["from_home"] += joint.base != band.m
        joint.begun, joint.peak = time, 0.0
        self.branches[f"begins_in_band_{k + 1}"] += 1

    def _ends(self, j: int, time: float, dt: float, out: Step) -> bool:
        """Rule 8 of a joint in contact."""
        joint = self.joints[j]
        assert joint.base is not None
        joint.base += (1.0 - math.exp(-dt / LEAK)) * (joint.bands[2].a - joint.base)
        d = (joint.bands[2].a - joint.base) * joint.sign
        joint.peak = max(joint.peak, d)
        if not longer(time - joint.begun, LEAST_TIME, dt):
            self.branches["too_early_to_end"] += 1
            return False
        return bool(out.decide(("ends", j), d < END * joint.peak, abs(d - END * joint.peak)))
