"""The oracle's contact at rest: step 5a, docs/reference/semantics/rest.md.

Part of the oracle (see oracle.py): naive, for tests alone, sharing no code with the runtime. Joints are counted from 0.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_finger import Key, Step, as_long, given

Array = NDArray[Any]


class RestWatch:
    """Watches motors and torques. `take` once a sample, then `loaded` from the second sample on."""

    def __init__(self, description: Mapping[str, Any], R: Array, branches: Counter[str]) -> None:
        contact = description["contact"]
        rest = contact["rest"]
        n = R.shape[1]
        self.R, self.branches = R, branches
        self.travel = float(rest["travel"])
        self.settle_time = float(given(rest, "settle_time", 0.3))
        self.averaging_time = float(given(rest, "averaging_time", 0.03))
        self.threshold = np.array(rest["threshold"], dtype=float)
        self.per_force = np.array(given(rest, "threshold_per_force", [0.0] * n), dtype=float)
        self.creep = np.array(given(rest, "creep", [0.0] * n), dtype=float)
        self.fall_share = float(given(rest, "fall_share", 0.05))
        innovation = given(rest, "innovation", None)
        self.time = None if innovation is None else float(innovation["time"])
        self.sudden = None if innovation is None else np.array(innovation["threshold"], dtype=float)
        self.release_ratio = float(given(contact, "release_ratio", 1.0))
        # state
        self.standing = False
        self.f = np.zeros(0)  # smoothed forces
        self.mark: tuple[float, Array, Array] = (0.0, self.f, self.f)  # time, x0, smoothed forces
        self.recent = self.mark  # the same of late
        self.stiffness = np.array([tendon["stiffness"] for tendon in description["tendons"]], dtype=float)
        self.change = np.zeros(n)  # c_j, as given out
        self.followed = np.zeros(n)  # m_j
        self.at_rest = np.zeros(n, dtype=bool)
        self.extreme = np.zeros(n)
        self.carried = np.zeros(n)  # signed bound of a load from the rest before

    def take(
        self, f0: Array, x0: Array, mean_force: float, time: float, dt: float, first: bool, out: Step,
    ) -> None:  # fmt: skip
        """One sample."""
        if first:
            self.f = f0.copy()
            self._mark(x0, time, False)
            return
        share = 1.0 if self.averaging_time == 0.0 else 1.0 - math.exp(-dt / self.averaging_time)
        self.f = self.f + share * (f0 - self.f)
        since, x_mark, f_mark = self.mark
        change = self.R.T @ (self.f - f_mark)
        rested = time - since if self.standing else 0.0
        noise = self.threshold + self.per_force * mean_force
        D = noise + self.creep * math.sqrt(rested)
        B = D if self.sudden is None else self.sudden

        def above(name: Key, value: float, limit: float) -> bool:
            return out.above(("rest", *name), value, limit)

        # x0 and the travel are inputs: every implementation subtracts and compares the same numbers
        far = np.abs(x0 - x_mark) > self.travel
        if not self.standing:
            changed = [above(("changed", j), abs(change[j]), D[j]) for j in range(len(D))]
            if far.any() or any(changed):
                self.branches["rest_not_yet"] += 1
                self._mark(x0, time, False)
            elif as_long(time - since, self.settle_time, dt):
                self.branches["rest_begins"] += 1
                self._mark(x0, time, True)
            return
        if self._drives(x0, out):
            for j in np.flatnonzero(self.at_rest):
                self.carried[j] = math.copysign(B[j], self.extreme[j])
                self.branches["load_carried"] += 1
            self.branches["rest_ends"] += 1
            self._mark(x0, time, False)
        elif self._gone(change - self.followed, noise, above):
            self.branches["load_gone"] += 1
            self._mark(x0, time, False)
        else:
            self.change = change
            self._decide(change, D, B, above)
            if self.time is not None:
                followed = self.followed + (1.0 - math.exp(-dt / self.time)) * (change - self.followed)
                self.followed = np.where(self.at_rest, self.followed, followed)
            if as_long(time - self.recent[0], self.settle_time, dt):
                self.recent = time, x0.copy(), self.f.copy()

    def _mark(self, x0: Array, time: float, standing: bool) -> None:
        self.mark = self.recent = time, x0.copy(), self.f.copy()
        self.standing = standing
        self.change = np.zeros_like(self.threshold)
        self.followed = np.zeros_like(self.threshold)
        self.at_rest = np.zeros(len(self.threshold), dtype=bool)
        self.extreme = np.zeros_like(self.threshold)

    def _drives(self, x0: Array, out: Step) -> bool:
        """Any motor that its force cannot have moved; one that gives way does not drive."""
        _, x_mark, f_mark = self.mark
        _, x_recent, f_recent = self.recent
        found = False
        for i in range(len(x0)):
            pulled, moved = self.f[i] - f_recent[i], x0[i] - x_recent[i]
            if abs(moved) > self.travel:
                if out.decide(("pulls", i), bool(moved * pulled >= 0.0), abs(pulled)):
                    found = True
                else:
                    self.branches["motor_gives_way"] += 1
            soft = self.travel + abs(self.f[i] - f_mark[i]) / self.stiffness[i]
            beyond = abs(x0[i] - x_mark[i]) - soft
            # in N at the tendon: lengths of some micrometres are never 1e-9 m apart
            if out.decide(("beyond", i), bool(beyond > 0.0), abs(beyond) * self.stiffness[i]):
                self.branches["motor_beyond_yield"] += 1
                found = True
        return found

    def _gone(self, late: Array, noise: Array, above: Callable[..., bool]) -> bool:
        gone = False
        for j in np.flatnonzero(self.extreme != 0.0):
            size = abs(self.extreme[j])
            fallen = size - math.copysign(1.0, self.extreme[j]) * late[j]
            gone |= above(("gone", int(j)), fallen, noise[j] + self.fall_share * size)
        return gone

    def _decide(self, change: Array, D: Array, B: Array, above: Callable[..., bool]) -> None:
        late = change - self.followed
        for j in range(len(D)):
            ratio = self.release_ratio if self.at_rest[j] else 1.0
            slowly = above(("at_rest", j), abs(change[j]), ratio * D[j])
            suddenly = above(("sudden", j), abs(late[j]), ratio * B[j])
            if slowly != suddenly:
                self.branches["sudden_alone" if suddenly else "slow_alone"] += 1
            exceeds = slowly or suddenly
            if exceeds and self.extreme[j] * late[j] > 0.0:
                self.extreme[j] = max(abs(self.extreme[j]), abs(late[j])) * math.copysign(1.0, late[j])
            else:
                self.extreme[j] = late[j] if exceeds else 0.0
            self.branches["contact_at_rest"] += exceeds
            self.at_rest[j] = exceeds

    def loaded(self, r: Array, out: Step) -> Array:
        """[n] in contact at rest, or with a load from the rest before that the residual still shows."""
        for j in np.flatnonzero(self.carried != 0.0):
            level = abs(self.carried[j])
            felt = math.copysign(1.0, self.carried[j]) * r[j]
            if not out.above(("carried", int(j)), felt, level):
                self.carried[j] = 0.0
                self.branches["carried_load_ends"] += 1
        return np.asarray(self.at_rest | (self.carried != 0.0))
