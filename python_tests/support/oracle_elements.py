"""The oracle's friction with a memory, from the text of docs/reference/semantics/presliding.md alone.

Part of the oracle (see oracle.py): naive, for tests alone, sharing no code with the runtime. A place is ("edge", i, j),
("pulley", i, j) or ("joint", j), counted from 0; the pulley of joint j turns with the velocity of level j + 1.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_finger import Step, given

Array = NDArray[Any]
Place = tuple[Any, ...]

LARGEST_LIMIT = 1e15  # of a joint; of |F| at a tendon
LARGEST_SLOPE = 1e150  # 1/D


@dataclass(frozen=True)
class Element:
    """Numbers of one element at one place: its share of the limit, and what its row says."""

    share: float
    stiffness: float  # κ; 0: by distance
    distance: float  # D
    time: float  # T; 0: none
    follows: float  # p

    def decay(self, dt: float) -> tuple[float, float]:
        """a and g."""
        if self.time == 0.0 or dt == 0.0:
            return 1.0, 1.0
        return math.exp(-dt / self.time), -math.expm1(-dt / self.time) * self.time / dt

    def rate(self, dt: float, limit: float) -> float:
        """β, of this element's limit."""
        gain = self.decay(dt)[1]
        return gain * self.stiffness if self.stiffness else gain * limit * self.per_distance

    @property
    def per_distance(self) -> float:
        if self.stiffness:
            return 0.0
        return LARGEST_SLOPE if self.distance == 0.0 else min(1.0 / self.distance, LARGEST_SLOPE)


def rank_of(row: Mapping[str, Any], place: Place) -> int:
    """How specific a row is at a place; 0: it is not there."""
    joint, tendon, level = (given(row, key, None) for key in ("joint", "tendon", "level"))
    everywhere = joint is None and tendon is None and level is None
    if place[0] == "joint":
        return 1 if everywhere else 2 if tendon is None and joint == place[1] + 1 else 0
    at_tendon, at_level = place[1] + 1, place[2] + (2 if place[0] == "pulley" else 1)
    if tendon is not None:
        return 0 if tendon != at_tendon else 3 if joint is None else 4 if joint == at_level else 0
    return 1 if everywhere else 2 if level == at_level else 0


class Elements:
    """All places of one finger. Once a sample: `turn`, then `loss` in the order of the path, and `own`."""

    def __init__(
        self, description: Mapping[str, Any], R: Array, thresholds: tuple[float, float], branches: Counter[str]
    ) -> None:
        extensions = given(description, "extensions", [])
        self.rows = [row for row in extensions if row["effect"] == "presliding"]
        stretch = [float(row["stiffness"]) for row in extensions if row["effect"] == "cord_stretch"]
        self.filtered = max((float(given(row, "filtered_travel", 0.0)) for row in self.rows), default=0.0)
        self.compliance = 1.0 / stretch[0] if stretch and self.rows else 0.0
        self.R, self.thresholds, self.branches = R, thresholds, branches
        self.forces: dict[Place, list[float]] = {}  # F of each element
        self.limits: dict[Place, float] = {}  # lim
        self.tension: dict[Place, float] = {}  # f behind a place
        self.first, self.dt = True, 0.0

    def at(self, place: Place) -> list[Element]:
        """The elements of a place, none where its friction has no memory."""
        ranks = [rank_of(row, place) for row in self.rows]
        rows = [row for row, rank in zip(self.rows, ranks, strict=True) if rank and rank == max(ranks)]
        total = sum(float(given(row, "share", 1.0)) for row in rows)
        return [self._element(row, place, total) for row in rows]

    def _element(self, row: Mapping[str, Any], place: Place, total: float) -> Element:
        own = place[0] == "joint"
        everywhere = all(given(row, key, None) is None for key in ("joint", "tendon", "level"))
        stiffness, distance = float(given(row, "stiffness", 0.0)), float(given(row, "displacement", 0.0))
        if everywhere:
            stiffness *= float(np.mean(self.R[:, place[1]] ** 2)) if own else 1.0
            distance *= self.thresholds[1 if own else 0]
        return Element(
            float(given(row, "share", 1.0)) / total,
            stiffness,
            distance,
            float(given(row, "relaxation_time", 0.0)),
            float(given(row, "follows_limit", 0.0)),
        )

    # --- a sample

    def turn(self, travelled: tuple[Array, Array], dt: float, first: bool) -> None:
        """travelled: Δ of the joints [n] and of the tendons [m, n + 1]."""
        self.joints, self.tendons = (np.zeros_like(each) if first else each for each in travelled)
        self.dt, self.first = dt, first

    def loss(self, kind: str, i: int, j: int, limit: float, before: float, out: Step) -> float:
        """F of an edge or pulley, N. limit: |F(v)|·f; before: the force before it."""
        limit = min(max(limit, 0.0), LARGEST_LIMIT * abs(before))
        place, level = (kind, i, j), j + (1 if kind == "pulley" else 0)
        turned = float(self.tendons[i, level])
        compliance = 0.0
        if self.compliance and not self.first:
            compliance = self.compliance * self.sections(i, level)
            turned += (before - self.tension[place]) * compliance
        return self._take(place, limit, turned, compliance, out)

    def sections(self, i: int, level: int) -> int:
        """S, of the cord of tendon i from a level to the last joint that it moves."""
        moved = np.flatnonzero(self.R[i])
        return max(0, int(moved[-1]) + 1 - level) if len(moved) else 0

    def own(self, j: int, limit: float, out: Step) -> float:
        """F of a joint, N·m."""
        limit = min(max(limit, 0.0), LARGEST_LIMIT)
        return self._take(("joint", j), limit, float(self.joints[j]), 0.0, out)

    def behind(self, kind: str, i: int, j: int, force: float) -> None:
        """The force behind a place; also where it has no memory."""
        self.tension[kind, i, j] = force

    def _take(self, place: Place, limit: float, turned: float, compliance: float, out: Step) -> float:
        elements = self.at(place)
        before = self.forces.get(place, [0.0] * len(elements))
        limits = [element.share * limit for element in elements]
        rates = [element.rate(self.dt, most) for element, most in zip(elements, limits, strict=True)]
        was = self.limits.get(place, 0.0)
        ratios = [1.0 + element.follows * (limit / was - 1.0) if was else 1.0 for element in elements]
        carried = [
            element.decay(self.dt)[0] * ratio * F for element, ratio, F in zip(elements, ratios, before, strict=True)
        ]
        trials = _solve(carried, rates, turned, compliance)
        slips = [self._slips(place, e, 1, trials[e], limits[e], out) for e in range(len(elements))]
        if compliance and len(elements) == 2 and slips[0] != slips[1]:
            free = slips.index(False)
            held = math.copysign(limits[1 - free], trials[1 - free])
            trials[free] = _solve([carried[free]], [rates[free]], turned - held * compliance, compliance)[0]
            slips[free] = self._slips(place, free, 2, trials[free], limits[free], out)
            self.branches["one_element_slips"] += 1
        forces = []
        for e, trial in enumerate(trials):
            sign = out.decide(("slips_to", place, e), math.copysign(1.0, trial))
            forces.append(sign * limits[e] if slips[e] else trial)
            self.branches["element_slips" if slips[e] else "element_holds"] += 1
        self.forces[place], self.limits[place] = forces, limit
        return sum(forces)

    def _slips(self, place: Place, e: int, turn: int, trial: float, limit: float, out: Step) -> bool:
        return bool(out.decide(("slips", place, e, turn), abs(trial) >= limit, abs(abs(trial) - limit)))


def _solve(carried: Sequence[float], rates: Sequence[float], turned: float, compliance: float) -> list[float]:
    """F of elements that all hold: F_e = carried_e + β_e·(turned − ΣF/k_c)."""
    total = (sum(carried) + sum(rates) * turned) / (1.0 + sum(rates) * compliance)
    return [own + rate * (turned - total * compliance) for own, rate in zip(carried, rates, strict=True)]
