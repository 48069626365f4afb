"""The oracle's `extensions`: effects beyond the paper, from the text of docs/reference/semantics/effects.md alone.

Part of the oracle (see oracle.py): naive, for tests alone, sharing no code with the runtime. Joints and tendons are
counted from 0. An object of this file remembers what the text says an effect remembers; copying it copies that.
"""

from __future__ import annotations

import copy
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_detection import direction_above
from oracle_elements import Element, Elements
from oracle_finger import Effect, Joint, Key, Step, given

Array = NDArray[Any]

PLACES = ("joint", "tendon", "level")
HISTORY = 64  # samples that a delay looks back on
OPTIONAL_NUMBERS = {
    "cover_hardening": ("quadratic",),
    "gravity": ("sine", "cosine"),
    "inertia_variation": ("sine", "cosine"),
    "moment_arm_variation": ("correction",),
    "pulley_eccentricity": ("sine", "cosine"),
}
MECHANISM = {
    "pulley_eccentricity": {"turns": 1.0},
    "joint_coupling": {"reaction": 1.0},
    "preload_friction": {"beyond": 1.0},
}  # left out: this
DELAYED = {1: ("tendon_position",), 2: ("joint_position",), 3: ("joint_position", "joint_velocity")}


@dataclass
class Row:
    """One extension: where it acts (None: the key is absent) and its numbers."""

    effect: str
    joint: int | None
    tendon: int | None
    level: int | None
    numbers: dict[str, float]
    play: float = math.nan  # z of `backlash`


@dataclass
class Moment:
    """A sample as torques see it: q, v, acceleration, rest [n], f0 [m]; s of ẋ [m, n + 1] and of q̇ [n], z of ẋ and 0 of
    q̇ where friction has a memory."""

    q: Array
    v: Array
    acceleration: Array
    rest: Array
    f0: Array
    tendon_side: Array
    joint_side: Array


@dataclass
class Sides:
    """s: sign of each velocity at the last sample at which it was above v_min (this one included), 0 before."""

    tendon: Array
    joint: Array
    read: set[tuple[Any, ...]] = field(default_factory=set)  # velocities whose s any effect reads
    now: dict[tuple[Any, ...], int] = field(default_factory=dict)  # sgn(v) where |v| > v_min at this sample, else 0

    def take(self, key: Key, v: float, threshold: float, out: Step) -> None:
        if key not in self.read:
            return
        moves = direction_above(v, threshold, ("side", *key), out)
        self.now[key] = moves
        if moves:
            side = self.tendon if key[0] == "tendon" else self.joint
            side[key[1:]] = moves


def read_rows(description: Mapping[str, Any]) -> list[Row]:
    rows = []
    for entry in given(description, "extensions", []):
        effect = str(entry["effect"])
        places = [None if given(entry, key, None) is None else int(entry[key]) - 1 for key in PLACES]
        numbers = dict.fromkeys(OPTIONAL_NUMBERS.get(effect, ()), 0.0) | MECHANISM.get(effect, {})
        numbers |= {k: float(v) for k, v in entry.items() if k not in ("effect", *PLACES) and v is not None}
        rows.append(Row(effect, *places, numbers))
    return rows


def axis_cosines(description: Mapping[str, Any], n: int) -> Array:
    """[n, n] of the angle between the axes of two joints (all joints at 0); 1 without `links`."""
    links = given(description, "links", None)
    if links is None:
        return np.ones((n, n))
    axes = np.array([link["axis"] for link in links], dtype=float)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return np.asarray(axes @ axes.T)


def torque_of(row: Row, numbers: Mapping[str, Any], at: Moment, R: Array, cosines: Array) -> Array:
    """[n] what a row of step 4 adds to T_j; 0 of other rows. Numbers may be complex."""
    n = len(at.q)
    j, i = row.joint, row.tendon
    T = np.zeros(n, dtype=np.result_type(float, *numbers.values()))
    if row.effect == "cover_hardening":
        bend = at.q[j] - at.rest[j]
        T[j] = numbers["stiffness"] * bend**3 + numbers["quadratic"] * bend**2
    elif row.effect == "gravity":
        assert j is not None
        theta = sum(cosines[k, j] * at.q[k] for k in range(j + 1))
        for before in range(j + 1):
            weight = numbers["sine"] * math.sin(theta) + numbers["cosine"] * math.cos(theta)
            T[before] = cosines[before, j] * weight
    elif row.effect == "inertia":
        T[j] = numbers["inertia"] * at.acceleration[j]
    elif row.effect == "inertia_variation":
        assert j is not None
        angle, v, w = 2.0 * at.q[j + 1], at.v[j], at.v[j + 1]
        inertia = numbers["sine"] * np.sin(angle) + numbers["cosine"] * np.cos(angle)
        by_angle = 2.0 * (numbers["sine"] * np.cos(angle) - numbers["cosine"] * np.sin(angle))
        T[j], T[j + 1] = inertia * at.acceleration[j] + by_angle * w * v, -0.5 * by_angle * v * v
    elif row.effect == "joint_coupling":
        assert j is not None
        c = numbers["stiffness"] * ((at.q[j] - at.rest[j]) - (at.q[j + 1] - at.rest[j + 1]))
        T[j], T[j + 1] = c, -numbers["reaction"] * c
    elif row.effect == "preload_friction":
        for before in range(n) if j is None else [j]:
            for each in range(before, n):
                share = 1.0 if each == before else numbers["beyond"]
                T[each] += R[i, each] * numbers["coulomb"] * share * at.tendon_side[i, before]
    elif row.effect == "load_friction":
        T[j] = numbers["coulomb"] * abs(at.f0[i]) * at.joint_side[j]
    elif row.effect == "force_gain":
        T[:] = -numbers["correction"] * R[i] * at.f0[i]
    elif row.effect == "force_offset":
        T[:] = -numbers["correction"] * R[i]
    elif row.effect == "moment_arm":
        T[j] = -numbers["correction"] * at.f0[i]
    elif row.effect == "moment_arm_variation":
        T[j] = -(numbers["slope"] * at.q[j] + numbers["correction"]) * at.f0[i]
    elif row.effect == "pulley_eccentricity":
        turned = numbers["turns"] * at.q[j]
        arm = numbers["sine"] * np.sin(turned) + numbers["cosine"] * np.cos(turned)
        T[j] = -arm * at.f0[i]
    return T


def factor_of(row: Row, numbers: Mapping[str, Any], speed: Any, since_start: Any) -> Any:
    """What a row of step 2 multiplies F and b by; 1 of other rows. Numbers may be complex, the others arrays."""
    if row.effect == "friction_drift":
        return 1.0 + numbers["amplitude"] * (1.0 - np.exp(-since_start / numbers["time_constant"]))
    if row.effect == "stribeck":
        return 1.0 + numbers["amplitude"] * np.exp(-speed / numbers["stribeck_velocity"])
    return 1.0


def _followed(z: float, element: Element, size: float, travel: float, dt: float) -> float:
    """z of a sample before it is clipped, of friction of this size, N."""
    kept, gain = element.decay(dt)
    if travel == 0.0:
        return kept * z
    steepness = element.per_distance if not element.stiffness else math.inf if size == 0.0 else element.stiffness / size
    return kept * z + gain * min(steepness, 1e290) * travel


class Extensions:
    """All rows of one finger. Once a sample: `signals`, `stretch`, `play`, `advance`, then the others in any order."""

    def __init__(
        self, description: Mapping[str, Any], n: int, m: int, R: Array, joints: list[Joint], source: int,
        branches: Counter[str],
    ) -> None:  # fmt: skip
        self.rows = read_rows(description)
        self.n, self.R, self.source, self.branches = n, R, source, branches
        self.cosines = axis_cosines(description, n)
        self.rest = np.array([joint.rest_angle for joint in joints])
        self.delay = sum(row.numbers["delay"] for row in self.rows if row.effect == "time_delay")
        self.delays = any(row.effect == "time_delay" for row in self.rows)
        # state
        self.start = math.nan  # t_0
        self.times: list[float] = []
        self.history: dict[str, list[Array]] = {}
        self.v_before = np.zeros(n)
        self.sides = Sides(np.zeros((m, n + 1)), np.zeros(n), set(self._read_sides(m)))
        self.follows: dict[int, Array] = {}  # by number of a row of `preload_friction`, [n] z; NaN without a memory
        self.moment: Moment | None = None

    def _read_sides(self, m: int) -> list[tuple[Any, ...]]:
        found: list[tuple[Any, ...]] = []
        for row in self.rows:
            if row.effect == "preload_friction":
                found += [("tendon", row.tendon, j) for j in (range(self.n) if row.joint is None else [row.joint])]
            elif row.effect == "presliding":
                found += [("tendon", i, j) for i in range(m) for j in range(self.n + 1)]
                found += [("joint", j) for j in range(self.n)]
            elif row.effect == "load_friction":
                found.append(("joint", row.joint))
        return found

    @property
    def forces_are_computed(self) -> bool:
        return self.delay < 0.0

    # --- before step 1, and in it

    def signals(self, time: float, inputs: Mapping[str, Array], first: bool) -> dict[str, Array]:
        """The inputs as step 1 takes them."""
        if first:
            self.start = time
        given_inputs = {name: np.array(values, dtype=float) for name, values in inputs.items()}
        taken = self._delayed(time, given_inputs) if self.delays else given_inputs
        if self.source == 1:
            for row in (row for row in self.rows if row.effect == "backlash" and row.tendon is not None):
                position = taken["tendon_position"]
                position[row.tendon] = self._played(row, position[row.tendon], first)
        return taken

    def _delayed(self, time: float, inputs: dict[str, Array]) -> dict[str, Array]:
        names = DELAYED[self.source] if self.delay >= 0.0 else ("tendon_force",)
        self.times = [*self.times, time][-HISTORY:]
        taken = dict(inputs)
        for name in names:
            self.history[name] = [*self.history.get(name, []), inputs[name].copy()][-HISTORY:]
            taken[name] = self._value_at(time - abs(self.delay), self.history[name])
        self.branches["delayed_forces" if self.delay < 0.0 else f"delayed_{names[0]}"] += 1
        return taken

    def _value_at(self, wanted: float, series: list[Array]) -> Array:
        if wanted <= self.times[0]:
            self.branches["before_the_oldest"] += 1
            return series[0].copy()
        k = max(at for at, time in enumerate(self.times) if time <= wanted)
        if k == len(self.times) - 1:
            return series[k].copy()
        weight = (wanted - self.times[k]) / (self.times[k + 1] - self.times[k])
        # equal neighbours give that very value: where all that is not 0 moves, rounding must not
        return np.asarray(series[k] + weight * (series[k + 1] - series[k]))

    def _played(self, row: Row, value: float, first: bool) -> float:
        half = row.numbers["width"] / 2.0
        before = value if first else row.play
        row.play = min(max(before, value - half), value + half)
        self.branches["inside_the_play" if row.play == before else "play_carried_along"] += 1
        return row.play

    def stretch(self, f0: Array, stiffness: Array) -> Array:
        """[m] m: how much longer the tendons are under f0."""
        e = f0 / stiffness
        for row in (row for row in self.rows if row.effect == "tendon_nonlinearity"):
            f, k, h = f0[row.tendon], stiffness[row.tendon], row.numbers["hardening"]
            e[row.tendon] = np.sign(f) * 2.0 * abs(f) / (k + math.sqrt(k**2 + 4.0 * h * abs(f)))
            self.branches["progressive_push" if f < 0.0 else "progressive_pull"] += 1
        return np.asarray(e)

    def play(self, q: Array, first: bool) -> Array:
        """[n] rad: the angles in use."""
        used = q.copy()
        for row in (row for row in self.rows if row.effect == "backlash" and row.joint is not None):
            used[row.joint] = self._played(row, used[row.joint], first)
        return used

    def advance(
        self, q: Array, v: Array, x_dot: Array, f0: Array, dt: float, first: bool, thresholds: tuple[float, float],
        travelled: tuple[Array, Array], elements: Elements, out: Step,
    ) -> None:  # fmt: skip
        """What torques and friction see of this sample. thresholds: v_min of tendons and joints; travelled: their Δ."""
        for i, row in enumerate(x_dot):
            for j, velocity in enumerate(row):
                self.sides.take(("tendon", i, j), velocity, thresholds[0], out)
        for j, velocity in enumerate(v):
            self.sides.take(("joint", j), velocity, thresholds[1], out)
        acceleration = np.zeros(self.n) if first else (v - self.v_before) / dt
        self.v_before = v
        travel = np.zeros_like(travelled[1]) if first else travelled[1]
        self.moment = Moment(q, v, acceleration, self.rest, f0, self.sides.tendon.copy(), self.sides.joint.copy())
        self.elements = elements
        self._follow(elements, travel, dt, out)
        self.own = np.zeros(self.n)
        for row in self.rows:
            if row.effect == "load_friction" and elements.at(("joint", row.joint)):
                self.own[row.joint] += row.numbers["coulomb"] * abs(f0[row.tendon])

    def _follow(self, elements: Elements, travel: Array, dt: float, out: Step) -> None:
        """z of `preload_friction`, before each joint, where friction has a memory; NaN elsewhere."""
        for number, row in enumerate(self.rows):
            if row.effect != "preload_friction":
                continue
            z = self.follows.get(number, np.zeros(self.n))
            self.follows[number] = np.full(self.n, np.nan)
            for j in range(self.n) if row.joint is None else [row.joint]:
                found = elements.at(("edge", row.tendon, j))
                if found:
                    moved = _followed(z[j], found[0], abs(row.numbers["coulomb"]), travel[row.tendon, j], dt)
                    slips = out.decide(("followed", number, j), abs(moved) >= 1.0, abs(abs(moved) - 1.0))
                    side = out.decide(("followed_to", number, j), math.copysign(1.0, moved))
                    self.follows[number][j] = side if slips else moved

    def own_limit(self, j: int) -> float:
        """What `load_friction` adds to the limit of a joint with a memory."""
        return float(self.own[j])

    # --- step 2

    def rows_at(self, kind: str, at: tuple[int, ...]) -> list[Row]:
        """The rows that change the friction of one place."""
        joint, tendon = (at[0], None) if kind in ("joint", "load") else (None, at[0])
        rows = [row for row in self.rows if row.effect in ("friction_drift", "stribeck")]
        return [row for row in rows if (row.joint is None or row.joint == joint)
                and (row.tendon is None or row.tendon == tendon)]  # fmt: skip

    def factor(self, rows: list[Row], speed: float, time: float) -> float:
        found = 1.0
        for row in rows:
            found *= float(factor_of(row, row.numbers, speed, time - self.start))
            self.branches[row.effect] += 1
        return found

    def side_of(self, effect: Effect, key: tuple[Any, ...]) -> int:
        """On which side an effect with `presliding` is; effect.side is still that of the samples before this one."""
        return self.sides.now[key] or effect.side or 1

    # --- step 4

    def torques(self) -> Array:
        """[n] N·m."""
        assert self.moment is not None
        T = np.zeros(self.n)
        for number, row in enumerate(self.rows):
            at = copy.copy(self.moment)
            z = self.follows.get(number)
            if z is not None:
                at.tendon_side = at.tendon_side.copy()
                at.tendon_side[row.tendon, : self.n] = np.where(np.isnan(z), at.tendon_side[row.tendon, : self.n], z)
            if row.effect == "load_friction" and self.elements.at(("joint", row.joint)):
                continue
            T += torque_of(row, row.numbers, at, self.R, self.cosines)
        return T
