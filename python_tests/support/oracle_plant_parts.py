"""Pieces of the simulated finger's numpy twin (see oracle_plant.py): friction contacts, multibody chain, knots, pushes,
tendons, sensors. Naive, for tests alone, sharing no code with runtime/plant."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly

from oracle_finger import given, read_side

Array = NDArray[Any]
Side = tuple[float, ...]  # static, coulomb, stribeck velocity, viscous
COMPLEX_STEP = 1e-30


def read_law(law: Mapping[str, Any]) -> tuple[Side, Side]:
    """Positive and negative side."""
    positive, negative = (law["positive"], law["negative"]) if "positive" in law else (law, law)
    return read_side(positive), read_side(negative)


@dataclass
class Friction:
    """What all contacts share: T_d, δ and the asymmetry a."""

    bristle_damping: float
    exponent: float
    asymmetry: float

    def factor(self, side: int) -> float:
        return 1.0 + self.asymmetry if side > 0 else 1.0 - self.asymmetry


@dataclass
class Contact:
    """One bristle: laws over the angle of the joint before, and a shape s(angle) that scales them (1 without one)."""

    angles: list[float]
    laws: list[tuple[Side, Side]]
    presliding: float
    shared: Friction
    shape: Callable[[float], float]

    def over_angle(self, angle: float, values: Sequence[float]) -> float:
        return float(np.interp(angle, self.angles, values)) * self.shape(angle)

    def reference(self, angle: float) -> float:
        """c(q): mean of the two sides' static."""
        f = self.shared.factor
        return self.over_angle(angle, [(f(1) * law[0][0] + f(-1) * law[1][0]) / 2.0 for law in self.laws])

    def steady(self, v: float, angle: float) -> float:
        """g(v, q) > 0: the part of eq. (1) that is not viscous, of the side of v."""
        side, values = (1 if v >= 0.0 else -1), []
        for law in self.laws:
            static, coulomb, stribeck, _ = law[0] if side > 0 else law[1]
            decay = math.exp(-((abs(v) / stribeck) ** self.shared.exponent))
            values.append(self.shared.factor(side) * (coulomb + (static - coulomb) * decay))
        return self.over_angle(angle, values)

    def viscous(self, v: float, angle: float) -> float:
        side = 1 if v >= 0.0 else -1
        values = [(law[0] if side > 0 else law[1])[3] * self.shared.factor(side) for law in self.laws]
        return self.over_angle(angle, values) * v

    def act(self, w: float, v: float, angle: float, level: float) -> tuple[float, float]:
        """λ and w'."""
        if v == 0.0:
            return level * self.reference(angle) * w, 0.0
        ratio = self.hat(v, angle)
        sign = math.copysign(1.0, v)
        rate = v / self.presliding * (1.0 - sign * w / ratio)
        fast = abs(v) * self.shared.bristle_damping / self.presliding
        a = fast / (1.0 + fast)
        coefficient = level * self.reference(angle) * (w * (1.0 - a / ratio) + a * sign) + self.viscous(v, angle)
        return coefficient, rate

    def hat(self, v: float, angle: float) -> float:
        """ĝ = g / c; the shape is in both, so it cancels also where it is 0."""
        bare = Contact(self.angles, self.laws, self.presliding, self.shared, lambda _: 1.0)
        return bare.steady(v, angle) / bare.reference(angle)


def diversion_shape(edge: Mapping[str, Any], capstan_loss: bool) -> Callable[[float], float]:
    """s(q) of an entry of `friction.edges`."""
    positive = float(edge["coefficient"])
    negative = float(given(edge, "negative_coefficient", positive))

    def shape(angle: float) -> float:
        theta = float(given(edge, "rest", 0.0))
        theta += float(given(edge, "slope", 1.0)) * (angle - float(given(edge, "centre", 0.0)))
        coefficient = positive if theta >= 0.0 else negative
        if edge["shape"] == "sine":
            return coefficient * abs(math.sin(theta))
        return coefficient * abs(theta) if capstan_loss else 1.0 - math.exp(-coefficient * abs(theta))

    return shape


def rotation(axis: Array, angle: Any) -> Array:
    """Rodrigues; the angle may be complex."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross))


class Multibody:
    """A serial chain of links: positions, point Jacobians, mass matrix, velocity terms, gravity."""

    def __init__(self, physics: Mapping[str, Any]) -> None:
        links = physics["links"]
        self.n = len(links)
        axes = [np.array(link["axis"], dtype=float) for link in links]
        self.axes = [axis / np.linalg.norm(axis) for axis in axes]
        self.offsets = [np.array(given(link, "offset", [0.0] * 3), dtype=float) for link in links]
        self.centres = [np.array(given(link, "centre_of_mass", [0.0] * 3), dtype=float) for link in links]
        self.masses = [float(link["mass"]) for link in links]
        self.inertias = [np.diag(np.array(link["inertia"], dtype=float)) for link in links]
        self.gravity = np.array(given(physics, "gravity", [0.0, 0.0, -9.81]), dtype=float)

    def frames(self, q: Array) -> tuple[list[Array], list[Array]]:
        """Rotation of every link and the place of its joint, in the base frame."""
        turn, place = np.eye(3), np.zeros(3)
        turns, places = [], []
        for j in range(self.n):
            place = place + turn @ self.offsets[j]
            turn = turn @ rotation(self.axes[j], q[j])
            turns.append(turn)
            places.append(place)
        return turns, places

    def point(self, q: Array, link: int, local: Array) -> Array:
        turns, places = self.frames(q)
        return np.asarray(places[link] + turns[link] @ local)

    def jacobians(self, q: Array, link: int, local: Array) -> tuple[Array, Array]:
        """[3, n] of a point fixed on a link, and of the link's angular velocity."""
        turns, places = self.frames(q)
        point = places[link] + turns[link] @ local
        linear = np.zeros((3, self.n), dtype=np.result_type(q, float))
        angular = np.zeros_like(linear)
        for k in range(link + 1):
            angular[:, k] = turns[k] @ self.axes[k]
            linear[:, k] = np.cross(angular[:, k], point - places[k])
        return linear, angular

    def mass_matrix(self, q: Array) -> Array:
        total = np.zeros((self.n, self.n), dtype=np.result_type(q, float))
        turns, _ = self.frames(q)
        for j in range(self.n):
            linear, angular = self.jacobians(q, j, self.centres[j])
            local = turns[j].T @ angular  # the link's own axes, where its inertia is diagonal
            total = total + self.masses[j] * linear.T @ linear + local.T @ self.inertias[j] @ local
        return np.asarray(total)

    def height_energy(self, q: Array) -> Any:
        """Potential energy of the masses in the field of gravity, 0 at the base's origin."""
        return sum(-self.masses[j] * (self.gravity @ self.point(q, j, self.centres[j])) for j in range(self.n))

    def velocity_terms(self, q: Array, v: Array) -> Array:
        """C(q, q') by Christoffel symbols: Σ_jk (∂M_ij/∂q_k − ½ ∂M_jk/∂q_i) q'_j q'_k."""
        slope = [self.mass_matrix(self._stepped(q, k)).imag / COMPLEX_STEP for k in range(self.n)]
        rate = sum(slope[k] * v[k] for k in range(self.n))
        return np.array([(rate @ v)[i] - 0.5 * v @ slope[i] @ v for i in range(self.n)])

    def gravity_torque(self, q: Array) -> Array:
        """G(q), on the left-hand side of the equation of motion."""
        return np.array([self.height_energy(self._stepped(q, k)).imag / COMPLEX_STEP for k in range(self.n)])

    def _stepped(self, q: Array, k: int) -> Array:
        stepped = q.astype(complex)
        stepped[k] += 1j * COMPLEX_STEP
        return stepped


def spline(
    time: Sequence[float], value: Sequence[float], slope: Any = None, curvature: Any = None
) -> Callable[[float], float]:
    """Quintic Hermite polynomials between knots (value, slope, curvature), constant outside."""
    if len(time) == 1:
        return lambda t: float(value[0])
    zeros = np.zeros(len(time))
    knots = np.column_stack([value, zeros if slope is None else slope, zeros if curvature is None else curvature])
    polynomials = BPoly.from_derivatives(time, knots)
    return lambda t: float(polynomials(min(max(t, time[0]), time[-1])))


def push_profile(push: Mapping[str, Any], t: float) -> float:
    """0..1: raised-cosine rise, hold, fall."""
    rise, hold, fall = float(push["rise"]), float(push["hold"]), float(push["fall"])
    since = t - float(push["start"])
    if since <= 0.0 or since >= rise + hold + fall:
        return 0.0
    if since < rise:
        return 0.5 * (1.0 - math.cos(math.pi * since / rise))
    return 1.0 if since <= rise + hold else 0.5 * (1.0 + math.cos(math.pi * (since - rise - hold) / fall))


class Tendon:
    """Spring and true moment arms of one tendon."""

    def __init__(self, described: Mapping[str, Any], physics: Mapping[str, Any] | None, n: int) -> None:
        def per_joint(key: str) -> Array:
            return np.array(given(physics, key, [0.0] * n), dtype=float)

        self.stiffness = float(described["stiffness"])
        self.hardening = float(given(physics, "hardening", 0.0))
        self.damping = float(given(physics, "damping", 0.0))
        self.base = np.array(described["moment_arms"], dtype=float) * float(given(physics, "moment_arm_scale", 1.0))
        self.slope, self.eccentricity, self.phase = map(per_joint, ("moment_arm_slope", "eccentricity", "phase"))

    def arms(self, q: Array) -> Array:
        return np.asarray(self.base + self.slope * q + self.eccentricity * np.sin(q + self.phase))

    def turns(self, joint: int) -> bool:
        """Has a moment arm at the joint or beyond."""
        return bool(np.any(self.base[joint:]) or np.any(self.slope[joint:]) or np.any(self.eccentricity[joint:]))

    def path(self, q: Array) -> float:
        """∫ r dq from 0."""
        wheel = self.eccentricity * (np.cos(self.phase) - np.cos(q + self.phase))
        return float(np.sum(self.base * q + 0.5 * self.slope * q * q + wheel))

    def elastic(self, e: float) -> float:
        return self.stiffness * e + self.hardening * e * e if e > 0.0 else 0.0

    def force(self, e: float, rate: float) -> float:
        return max(0.0, self.elastic(e) + self.damping * rate) if e > 0.0 else 0.0

    def energy(self, e: float) -> float:
        return self.stiffness * e * e / 2.0 + self.hardening * e**3 / 3.0 if e > 0.0 else 0.0

    def elongation(self, force: float) -> float:
        """e at which the spring pulls with the force."""
        if force <= 0.0:
            return 0.0
        return 2.0 * force / (self.stiffness + math.sqrt(self.stiffness**2 + 4.0 * self.hardening * force))


def sense(
    time: Array, truth: Array, at: Array, sensor: Mapping[str, Any], column: int = 0, initial_play: float | None = None
) -> Array:
    """What a noise-free sensor says at the times `at`: play, delay, gain, offset, resolution.

    time, truth [N]: the true signal, linear in between, constant before its first value. Play of width `backlash` is
    the play operator: the output stays while the input moves inside the width.
    """
    seen = np.array(truth, dtype=float)
    half = float(given(sensor, "backlash", 0.0)) / 2.0
    if half > 0.0:
        held = seen[0] if initial_play is None else initial_play
        for k, value in enumerate(seen):
            held = min(max(held, value - half), value + half)
            seen[k] = held

    def of_column(key: str, default: float) -> float:
        value = given(sensor, key, default)
        return float(value[column]) if isinstance(value, list) else float(value)

    delayed = np.interp(np.asarray(at) - float(given(sensor, "delay", 0.0)), time, seen)
    out = of_column("gain", 1.0) * delayed + of_column("offset", 0.0)
    resolution = float(given(sensor, "resolution", 0.0))
    return np.asarray(np.round(out / resolution) * resolution if resolution > 0.0 else out)
