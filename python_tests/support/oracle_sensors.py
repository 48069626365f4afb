"""The oracle's watch over the sensors: step 0, docs/reference/semantics/sensors.md.

Part of the oracle (see oracle.py): naive, for tests alone, sharing no code with the runtime. Tendons and joints are
counted from 0.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_finger import Key, Step, as_long, given, longer

Array = NDArray[Any]

NEAR = 1e-9
SPRING_ERROR = 0.1
RESOLUTIONS = 10.0
LEAST_FREEDOM = 0.1
Above = Callable[[tuple[Any, ...], float, float], bool]


@dataclass
class Tendon:
    """What is remembered of one tendon. fault: "", "force" or "position"."""

    stiffness: float
    bidirectional: bool
    fault: str = ""
    fault_since: float = math.nan
    unsound_at: float = math.nan
    last: tuple[float, float, float] | None = None  # f, x, w of the last sample; None where w was not known
    held_force: tuple[float, float] | None = None  # f, since
    taut: tuple[float, float] | None = None  # f and y of a sample with a taut tendon
    held_position: tuple[float, float] | None = None  # x, since
    then: tuple[float, float] = (math.nan, math.nan)  # f and w when x was there first

    def spring(self, x: float, w: float) -> float:
        return self.stiffness * (x - w)

    def expected(self, y: float) -> float:
        """f that the spring should have."""
        assert self.taut is not None
        f = self.taut[0] + y - self.taut[1]
        return f if self.bidirectional else max(f, 0.0)


@dataclass
class Watch:
    """What a sample finds: R⁺ of the rows in use and that of the sample before, and the joints' states."""

    inverse: Array
    before: Array
    blind: list[bool] = field(default_factory=list)
    anew: list[bool] = field(default_factory=list)


class SensorWatch:
    """`take` once a sample, with forces, positions and, for sources 2 and 3, angles."""

    def __init__(self, description: Mapping[str, Any], R: Array, source: int, branches: Counter[str]) -> None:
        settings = description["sensor_fault"]
        self.hold_time = float(given(settings, "hold_time", 0.05))
        self.force_resolution = float(given(settings, "force_resolution", 0.01))
        self.position_resolution = float(given(settings, "position_resolution", 2e-6))
        self.jump_margin = float(given(settings, "jump_margin", 1.0))
        self.margin = float(given(settings, "spring_margin", 1.0))
        self.longest_stand = float(given(settings, "longest_stand", 1e9))
        self.recovery_time = float(given(settings, "recovery_time", 0.5))
        self.R, self.source, self.branches = R, source, branches
        self.tendons = [
            Tendon(float(tendon["stiffness"]), bool(given(tendon, "bidirectional", False)))
            for tendon in description["tendons"]
        ]
        self.joints = description["joints"]
        self.extensions = given(description, "extensions", [])
        self._use_rows()
        self.blind = [False] * R.shape[1]

    @property
    def faults(self) -> Array:
        return np.array([tendon.fault != "" for tendon in self.tendons])

    def _use_rows(self) -> None:
        """Rows in use: those of failing sensors leave one by one, where the others still tell the angles."""
        m = len(self.tendons)
        self.in_use = np.ones(m, dtype=bool)
        self.lost = False  # a failing row could not leave
        for i in range(m if self.source == 1 else 0):
            if self.tendons[i].fault:
                if self._freedom(i) >= LEAST_FREEDOM:
                    self.in_use[i] = False
                    self.branches["row_leaves"] += 1
                else:
                    self.lost = True
                    self.branches["row_cannot_leave"] += 1
        self.inverse = self._inverse(self.in_use)

    def _inverse(self, rows: Array) -> Array:
        """[n, m] R⁺ of some rows, zero elsewhere."""
        inverse = np.zeros(self.R.T.shape)
        inverse[:, rows] = np.linalg.pinv(self.R[rows], rcond=1e-15)
        return inverse

    def _freedom(self, i: int) -> float:
        return float(1.0 - self.R[i] @ self._inverse(self.in_use)[:, i]) if self.in_use[i] else 1.0

    def _joint_side(self, i: int, f: Array, x: Array, q: Array | None) -> float | None:
        """w of tendon i, None where the others do not tell it."""
        if self.source != 1:
            assert q is not None
            return float(self.R[i] @ q)
        for j, tendon in enumerate(self.tendons):
            unsound = tendon.fault or not self._is_taut(j, f[j])
            if j != i and self.in_use[j] and unsound:
                return None
        if self._freedom(i) < LEAST_FREEDOM:
            return None
        others = self.in_use.copy()
        others[i] = False
        z = x - f / np.array([tendon.stiffness for tendon in self.tendons])
        return float(self.R[i] @ (self._inverse(others) @ z))

    def _is_taut(self, i: int, f: float) -> bool:
        return self.tendons[i].bidirectional or bool(f > self.margin)

    def take(self, f: Array, x: Array, q: Array | None, time: float, dt: float, out: Step) -> Watch:
        """One sample."""
        before, self.dt = self.inverse, dt

        def above(name: Key, value: float, limit: float) -> bool:
            return out.above(("sensor", *name), value, limit)

        w = [self._joint_side(i, f, x, q) for i in range(len(f))]
        faulty_before = [bool(tendon.fault) for tendon in self.tendons]
        again = [side is not None and tendon.last is not None for side, tendon in zip(w, self.tendons, strict=True)]
        jumps = [again[i] and not faulty_before[i] and self._jumps(i, f[i], x[i], w[i], above) for i in range(len(f))]
        stuck = [self._force_stands(i, f[i], x[i], w[i], again[i], time, above) for i in range(len(f))]
        still = [self._position_stands(i, f[i], x[i], w[i], again[i], time, above) for i in range(len(f))]
        rivals = any(
            not faulty_before[i] and self._is_taut(i, f[i]) and self._long(tendon.held_force, time)
            for i, tendon in enumerate(self.tendons)
        )
        changed = False
        for i in np.flatnonzero(faulty_before):
            changed |= self._recovers(int(i), f[i], x[i], w[i], time, above)
        for i in range(len(f)):
            if jumps[i] or stuck[i]:
                self._begin(i, "force", "jump" if jumps[i] else "force stands", time)
                changed = True
        if not any(jumps) and not any(stuck) and not rivals:
            for i in np.flatnonzero(still):
                self._begin(int(i), "position", "position stands", time)
                changed = True
        for i, tendon in enumerate(self.tendons):
            side = w[i]
            tendon.last = None if side is None else (float(f[i]), float(x[i]), side)
        if changed and self.source == 1:
            self._use_rows()
            for tendon in self.tendons:
                tendon.last = None
        return self._joints(before)

    def _joints(self, before: Array) -> Watch:
        was_blind = self.blind
        self.blind = [self._is_blind(j) for j in range(self.R.shape[1])]
        anew = [was and not now for was, now in zip(was_blind, self.blind, strict=True)]
        self.branches["joint_begins_anew"] += sum(anew)
        return Watch(self.inverse, before, self.blind, anew)

    def _is_blind(self, j: int) -> bool:
        if self.lost:
            return True
        for i, tendon in enumerate(self.tendons):
            named = any(row.get("joint") == j + 1 and row.get("tendon") == i + 1 for row in self.extensions)
            loaded = given(self.joints[j], "load_friction", None) is not None
            if tendon.fault == "force" and (self.R[i, j] != 0.0 or loaded or named):
                return True
        return False

    def _jumps(self, i: int, f: float, x: float, w: float | None, above: Above) -> bool:
        tendon = self.tendons[i]
        assert tendon.last is not None and w is not None
        f_last, x_last, w_last = tendon.last
        stretched = abs(x - x_last) + abs(w - w_last)
        bound = (1.0 + SPRING_ERROR) * tendon.stiffness * stretched + self.jump_margin
        return above(("jump", i), abs(f - f_last), bound)

    def _long(self, held: tuple[float, float] | None, time: float) -> bool:
        return held is not None and longer(time - held[1], self.hold_time, self.dt)

    def _force_stands(
        self, i: int, f: float, x: float, w: float | None, again: bool, time: float, above: Above
    ) -> bool:
        tendon = self.tendons[i]
        well = not tendon.fault
        lost = well and not again
        # inputs: every implementation compares the same numbers
        left = tendon.held_force is None or abs(f - tendon.held_force[0]) > self.force_resolution
        if lost:
            tendon.taut = None
        had = tendon.taut is not None
        if left or lost:
            tendon.held_force = f, time
        if well and w is not None and self._is_taut(i, f) and (left or lost or not had):
            tendon.taut = f, tendon.spring(x, w)
        assert tendon.held_force is not None
        if not (well and again and had):
            return False
        if self._is_taut(i, f) and longer(time - tendon.held_force[1], self.longest_stand, self.dt):
            return True
        if not self._long(tendon.held_force, time):
            return False
        assert w is not None
        missed = abs(tendon.expected(tendon.spring(x, w)) - f)
        return above(("force_stands", i), missed, self.margin + RESOLUTIONS * self.force_resolution)

    def _position_stands(
        self, i: int, f: float, x: float, w: float | None, again: bool, time: float, above: Above
    ) -> bool:
        tendon = self.tendons[i]
        well = not tendon.fault
        left = tendon.held_position is None or abs(x - tendon.held_position[0]) > self.position_resolution
        if left or (well and not (again and self._is_taut(i, f))):
            tendon.held_position = x, time
            tendon.then = f, math.nan if w is None else w
        if not (well and again and self._long(tendon.held_position, time)):
            return False
        assert w is not None
        pulled = tendon.stiffness * (w - tendon.then[1])
        allowed = RESOLUTIONS * self.position_resolution * tendon.stiffness + self.margin + SPRING_ERROR * abs(pulled)
        return above(("position_stands", i), abs(f - tendon.then[0] + pulled), allowed)

    def _begin(self, i: int, fault: str, branch: str, time: float) -> None:
        tendon = self.tendons[i]
        tendon.fault, tendon.fault_since, tendon.unsound_at = fault, time, time
        self.branches[branch] += 1
        if branch == "jump":
            assert tendon.last is not None
            f, x, w = tendon.last
            tendon.taut = f, tendon.spring(x, w)
        elif fault == "position":
            assert tendon.held_position is not None
            tendon.taut = tendon.then[0], tendon.spring(tendon.held_position[0], tendon.then[1])

    def _recovers(self, i: int, f: float, x: float, w: float | None, time: float, above: Above) -> bool:
        tendon = self.tendons[i]
        held = tendon.held_force if tendon.fault == "force" else tendon.held_position
        assert held is not None and tendon.taut is not None
        agrees = False
        if w is not None and self._is_taut(i, f) and held[1] > tendon.fault_since:
            y = tendon.spring(x, w)
            resolved = self.force_resolution + self.position_resolution * tendon.stiffness
            allowed = self.margin + RESOLUTIONS * resolved + SPRING_ERROR * abs(y - tendon.taut[1])
            agrees = not above(("agrees", i), abs(tendon.expected(y) - f), allowed)
        if not agrees:
            tendon.unsound_at = time
            return False
        if not as_long(time - tendon.unsound_at, self.recovery_time, self.dt):
            self.branches["agrees_for_a_while"] += 1
            return False
        tendon.fault, tendon.fault_since, tendon.unsound_at = "", math.nan, math.nan
        self.branches["recovers"] += 1
        return True

    def mean_force(self, f0: Array) -> float:
        """mean |f0| of the tendons whose force does not fail; of all where every one does."""
        sound = np.array([tendon.fault != "force" for tendon in self.tendons])
        return float(np.mean(np.abs(f0[sound] if sound.any() else f0)))
