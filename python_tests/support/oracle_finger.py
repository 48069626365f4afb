"""What the oracle knows of a finger (laws, friction effects, tendons and joints), and what it gives of a run.

Part of the oracle (see oracle.py): naive, for tests alone, sharing no code with the runtime.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Key = tuple[Any, ...]
NEAR = 1e-9  # a decision closer than this to its threshold may be turned by rounding
MAGNITUDES = ("static", "coulomb", "stribeck_velocity", "viscous")


@dataclass
class Law:
    """Friction law of one place, eq. (1): four magnitudes for each direction of motion."""

    positive: tuple[float, ...]
    negative: tuple[float, ...]

    def value(self, side: int, speed: float) -> float:
        """F at |v| = speed on the given side (+1 or -1). At speed 0 this is side * Fs."""
        static, coulomb, stribeck_velocity, viscous = self.positive if side > 0 else self.negative
        decay = math.exp(-speed / stribeck_velocity)
        return side * (coulomb + (static - coulomb) * decay + viscous * speed)


@dataclass
class Effect:
    """One friction effect: its laws over the angle, and what the bias procedure (fig. 5) remembers."""

    laws: list[Law]
    angles: list[float]
    threshold: float
    side: int | None = None  # direction of the last moving sample
    stuck: bool | None = None  # None before the first sample
    stuck_since: float = math.nan
    last_stuck: float = math.nan
    absorbed_since: float = 0.0  # Λ_since: Λ when the effect came to rest

    def value(self, side: int, speed: float, angle: float) -> float:
        """F(side * speed); the laws' values are interpolated over the angle, constant outside."""
        values = [law.value(side, speed) for law in self.laws]
        if angle <= self.angles[0]:
            return values[0]
        if angle >= self.angles[-1]:
            return values[-1]
        k = max(i for i, a in enumerate(self.angles) if a <= angle)
        weight = (angle - self.angles[k]) / (self.angles[k + 1] - self.angles[k])
        return (1.0 - weight) * values[k] + weight * values[k + 1]

    def at_threshold(self, side: int, angle: float) -> float:
        """F(side * v_min) at the present angle."""
        return self.value(side, self.threshold, angle)


@dataclass
class Tendon:
    """Constants of one tendon; pulley[j] is F_A of joint j, edge[j] is F_B before joint j."""

    stiffness: float
    zero: float
    bidirectional: bool
    pulley: list[Effect | None]
    edge: list[Effect | None]


@dataclass
class Joint:
    """Constants of one joint: cover spring, T_jv0, T_jvf."""

    cover_stiffness: float
    rest_angle: float
    friction: Effect | None
    load_friction: Effect | None


@dataclass
class Places:
    """One number per place of friction, 0 where there is none.

    edge [m, n]: F_B before joint j; pulley [m, n]: F_A of joint j; joint [n]: T_jv0; load [n]: T_jvf.
    """

    edge: Array
    pulley: Array
    joint: Array
    load: Array

    @classmethod
    def zeros(cls, m: int, n: int) -> Places:
        return cls(np.zeros((m, n)), np.zeros((m, n)), np.zeros(n), np.zeros(n))

    def __mul__(self, other: Places) -> Places:
        return Places(
            self.edge * other.edge, self.pulley * other.pulley, self.joint * other.joint, self.load * other.load
        )

    def loss(self) -> Array:
        """[m, n] N: Σ_{j'≤j} (edge + pulley), for products with the forces: L_ij."""
        return np.asarray(np.cumsum(self.edge + self.pulley, axis=1))


def tendon_velocity(R: Array, v: Array) -> Array:
    """eq. (5), [m, n + 1]; the last column is the velocity after the last joint, 0."""
    n, speeds = R.shape[1], v.tolist()  # Python's own numbers: numpy's take five times as long one by one
    return np.array([[*(sum(arms[k] * speeds[k] for k in range(j, n)) for j in range(n)), 0.0] for arms in R.tolist()])


CLOCK_ROUNDING = 0.01  # of Δt: times so near are equal


def as_long(elapsed: float, time: float, dt: float) -> bool:
    """elapsed ≥ time, for times of clocks that round."""
    return elapsed >= time - CLOCK_ROUNDING * dt


def longer(elapsed: float, time: float, dt: float) -> bool:
    """elapsed > time, for times of clocks that round."""
    return elapsed > time + CLOCK_ROUNDING * dt


def given(table: Mapping[str, Any] | None, key: str, default: Any) -> Any:
    """The entry, or the default when the table or the key is absent or null."""
    value = None if table is None else table.get(key)
    return default if value is None else value


def read_side(side: Mapping[str, Any]) -> tuple[float, ...]:
    return tuple(float(given(side, name, 0.0)) for name in MAGNITUDES)


def read_law(law: Mapping[str, Any]) -> Law:
    if "positive" in law:
        return Law(read_side(law["positive"]), read_side(law["negative"]))
    return Law(read_side(law), read_side(law))


def read_effect(entry: Mapping[str, Any] | None, threshold: float) -> Effect | None:
    """A null entry is no effect; a single law is a table of working points with one entry."""
    if entry is None:
        return None
    if "laws" in entry:
        return Effect([read_law(law) for law in entry["laws"]], [float(a) for a in entry["angles"]], threshold)
    return Effect([read_law(entry)], [0.0], threshold)


def read_effects(entries: list[Any] | None, joints: int, threshold: float) -> list[Effect | None]:
    filled = list(entries or [])
    filled += [None] * (joints - len(filled))
    return [read_effect(entry, threshold) for entry in filled]


def read_joints(description: Mapping[str, Any]) -> list[Joint]:
    threshold = float(given(given(description, "velocity_threshold", {}), "joint", 0.01))
    joints = []
    for entry in description["joints"]:
        cover = given(entry, "cover", {})
        joints.append(
            Joint(
                cover_stiffness=float(given(cover, "stiffness", 0.0)),
                rest_angle=float(given(cover, "rest_angle", 0.0)),
                friction=read_effect(entry.get("friction"), threshold),
                load_friction=read_effect(entry.get("load_friction"), threshold),
            )
        )
    return joints


def read_tendons(description: Mapping[str, Any]) -> list[Tendon]:
    threshold = float(given(given(description, "velocity_threshold", {}), "tendon", 0.0005))
    n = len(description["joints"])
    return [
        Tendon(
            stiffness=float(entry["stiffness"]),
            zero=float(given(entry, "zero", 0.0)),
            bidirectional=bool(given(entry, "bidirectional", False)),
            pulley=read_effects(entry.get("pulley_friction"), n, threshold),
            edge=read_effects(entry.get("edge_friction"), n, threshold),
        )
        for entry in description["tendons"]
    ]


# --- what a sample and a run give -------------------------------------------------------------------------------------


@dataclass
class Result:
    """Outputs of a run: name -> [N, n], [N, m], [N] (`contact`) or [N, n, 4, 8] (`contact_terms`)."""

    outputs: dict[str, Array]
    margin: Array  # [N], of each step
    branches: Counter[str]  # how often each branch was taken

    @property
    def near(self) -> Array:
        """[N] bool: samples within NEAR of some threshold."""
        return np.asarray(self.margin < NEAR)


@dataclass
class Step:
    """What one sample yields besides the change of the state."""

    forced: Mapping[Key, Any] = field(default_factory=dict)  # decisions that are taken this way, whatever the values
    values: dict[str, Array] = field(default_factory=dict)
    decisions: dict[Key, Any] = field(default_factory=dict)
    # smallest distance to a threshold (m/s, rad/s, N·m, N or s); exactly at it (at rest, v_min = 0) nothing is left to
    # rounding
    margin: float = math.inf

    def decide(self, key: Key, value: Any, distance: float = 0.0) -> Any:
        """The decision of that name: the value, unless another one is forced. distance: to the threshold."""
        if distance > 0.0:
            self.margin = min(self.margin, distance)
        self.decisions[key] = self.forced.get(key, value)
        return self.decisions[key]

    def above(self, key: Key, value: float, limit: float) -> bool:
        return bool(self.decide(key, bool(value > limit), abs(value - limit)))
