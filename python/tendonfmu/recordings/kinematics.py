"""Whether the columns of a recording belong together, and which correction is needed.

Tendon positions, tendon forces and joint angles satisfy x0 − f0/k = R q. The equation holds independent of friction,
contact and weight, so it shows wrong columns before any friction is known. It shows nothing if a finger has as many
joints as tendons and its joint angles are not measured. Offsets of the sensors have no effect, since the test uses
covariances only. Measured velocities belong to the angles if each angle changes by the integral of its velocity.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from tendonfmu.arrays import Indices, Numbers
from tendonfmu.model import Finger
from tendonfmu.recordings.faults import TURNS, tendon_angles
from tendonfmu.recordings.recording import Recording

FEWEST = 200  # samples; a covariance needs at least as many
MISFIT = 5e-4  # share of variance below which an equation fits: arms and springs are known to 2 % at best
GAIN = 4.0  # a correction must lower the misfit by this factor
ALIKE = 1.5  # times the best correction's misfit; corrections below it are named as alternatives
SAME = 2e-4  # share of variance below which two corrections are equally good
NOTHING = 1e-6  # of the largest terms of all equations; an equation with smaller terms is not used
MOST_SUBSETS, MOST_ORDERS, MOST_CIRCLES = 8, 6, 16  # columns of which all subsets, orders, circles of three are tried
NOISY = 10.0  # times the variance of its noise; an equation with less motion is not used
ROUNDS = 8  # corrections of one recording, at most
STRONGEST = 5000.0  # N; a tendon of a finger breaks at less
EQUATED = ("tendon_force", "tendon_position", "joint_position")  # groups of the equation, in the order of its columns
# Units in which logs are often written, with their factors to the units of a recording
UNITS: dict[str, tuple[tuple[float, str], ...]] = {
    "tendon_position": ((1e-3, "mm"), (1e-2, "cm"), (1e-6, "µm"), (0.0254, "inch")),
    "tendon_force": ((9.80665, "kgf or daN"), (9.80665e-3, "gf or cN"), (1e-3, "mN"), (4.448222, "lbf"), (1e3, "kN")),
    "joint_position": ((np.pi / 180, "degrees"), (1e-3, "mrad"), (2 * np.pi, "turns")),
}
WINDOW = 0.1  # s over which changes of angles and velocities are compared
TOGETHER = 0.8  # correlation above which changes belong together
NEAR = 1.15  # a slope within this factor of a unit's factor shows the unit
VELOCITY_UNITS = ((np.pi / 180, "degrees/s"), (2 * np.pi / 60, "rpm"), (1e-3, "mrad/s"), (2 * np.pi, "turns/s"))


@dataclass(frozen=True)
class Correction:
    """A correction that a map of columns would have to contain."""

    kind: str  # "sign", "scale" or "exchange"
    columns: tuple[str, ...]  # names of the columns
    factor: float = 1.0  # of a sign or scale
    unit: str = ""  # the unit that explains the scale
    sources: tuple[str, ...] = ()  # of an exchange, the column from which each of the columns has to be read

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Return, for an exchange, each column and the one from which it has to be read."""
        return tuple(zip(self.columns, self.sources, strict=True))


@dataclass(frozen=True)
class Repair:
    """A correction that makes the equations fit, and others that do as well."""

    correction: Correction  # the most plausible correction
    alternatives: tuple[Correction, ...]  # corrections that fit as well
    misfit: float  # mean share of variance that the changed equations leave, before and after the correction
    left: float


class Balance:
    """Second moments of a recording's columns, and the equations that they have to satisfy."""

    def __init__(
        self, finger: Finger, groups: Mapping[str, Numbers], noise: Mapping[str, Numbers] | None = None
    ) -> None:
        """Compute the moments."""
        used = [name for name in EQUATED if name in groups]
        self.columns = [f"{name}[{k + 1}]" for name in used for k in range(groups[name].shape[1])]
        values = np.concatenate([groups[name] for name in used], axis=1)
        self.covariance = np.cov(values, rowvar=False)
        self.largest = np.abs(values).max(axis=0)
        self._range = np.ptp(values, axis=0)
        self._median = np.median(values, axis=0)
        self._noise = np.concatenate([noise[name] for name in used]) ** 2 if noise else np.zeros(len(self.columns))
        pulls = [not tendon.get("bidirectional") for tendon in finger.data["tendons"]]
        self._pulls = np.flatnonzero(pulls)  # columns of forces, which come first
        self.tendons = taut_tendons(groups["tendon_force"])
        self.rows, self._angle = _equations(finger, self.tendons, "joint_position" in groups)

    def misfits(self, transform: Numbers) -> Numbers:
        """Return the share of variance [e], without noise, that each equation leaves. NaN: the equation is not used."""
        rows = self.rows @ transform
        squares = rows**2
        terms = squares @ np.diag(self.covariance)
        noise = squares @ self._noise
        left = np.maximum(((rows @ self.covariance) * rows).sum(axis=1) - noise, 0.0)
        says = (terms > NOTHING * terms.max(initial=0.0)) & (terms > NOISY * noise)
        return np.where(says, left / np.where(says, terms, 1.0), np.nan)

    def misfit(self, transform: Numbers) -> float:
        """Return the mean share over the equations that are used."""
        return _mean(self.misfits(transform))

    def worst(self, transform: Numbers) -> float:
        """Return the largest share of an equation that is used."""
        return float(np.nan_to_num(self.misfits(transform)).max(initial=0.0))

    def is_plausible(self, transform: Numbers) -> bool:
        """Return whether all joints turn less than `TURNS` and all forces are at most `STRONGEST`."""
        turn = np.abs(self._angle @ transform) @ self._range
        force = [k for k, name in enumerate(self.columns) if name.startswith("tendon_force")]
        return bool(turn.max() < 2 * TURNS and (np.abs(transform) @ self.largest)[force].max() <= STRONGEST)

    def pushing(self, transform: Numbers) -> int:
        """Return how many tendons that can only pull have a negative force."""
        return int(((transform @ self._median)[self._pulls] < 0.0).sum())

    def plausible_scale(self) -> Correction | None:
        """Return a unit of positions or forces, whichever turn the joints most, that makes the angles plausible."""
        groups = ("tendon_position", "tendon_force")
        share = {name: [column in self.group(name) for column in self.columns] for name in groups}
        turn = {name: float((np.abs(self._angle) @ (self._range * share[name])).max()) for name in groups}
        name = max(groups, key=lambda group: turn[group])
        for factor, unit in UNITS[name]:
            correction = Correction("scale", tuple(self.group(name)), factor, unit)
            if self.is_plausible(self.transform(correction)):
                return correction
        return None

    def worst_tendon(self) -> int:
        """Return the index, from 0, of the tendon whose equation leaves most."""
        return int(self.tendons[np.argmax(((self.rows @ self.covariance) * self.rows).sum(axis=1))])

    def transform(self, correction: Correction) -> Numbers:
        """Return the matrix [c, c] of a correction."""
        made = np.eye(len(self.columns))
        if correction.kind == "exchange":
            indices = {name: k for k, name in enumerate(self.columns)}
            made[[indices[name] for name in correction.columns]] = np.eye(len(self.columns))[
                [indices[name] for name in correction.sources]
            ]
        else:
            for name in correction.columns:
                k = self.columns.index(name)
                made[k, k] = correction.factor
        return made

    def corrections(self) -> Iterator[Correction]:
        """Yield all candidates: signs, exchanges and units of columns and of whole groups."""
        groups = {name: self.group(name) for name in UNITS}
        for name, columns in groups.items():
            for subset in _subsets(columns):
                yield Correction("sign", subset, -1.0)
            for order in _orders(len(columns)):
                yield _exchange([columns], order)
            for factor, unit in UNITS[name]:
                yield Correction("scale", tuple(columns), factor, unit)
                if len(columns) > 1:
                    for column in columns:
                        yield Correction("scale", (column,), factor, unit)
        for order in _orders(len(groups["tendon_force"])):
            yield _exchange([groups["tendon_force"], groups["tendon_position"]], order)

    def group(self, name: str) -> list[str]:
        """Return the columns of a group."""
        return [column for column in self.columns if column.startswith(f"{name}[")]


def _equations(finger: Finger, tendons: Indices, measured: bool) -> tuple[Numbers, Numbers]:
    """Return rows [e, c] that are 0, and joint angles [n, c] by the tendons; columns as in `Balance`."""
    arms = np.asarray(finger.moment_arms, dtype=float)
    compliance = np.diag([1.0 / float(tendon["stiffness"]) for tendon in finger.data["tendons"]])
    elastic = np.concatenate([-compliance, np.eye(len(arms))], axis=1)[tendons]
    arms = arms[tendons]
    inverse = np.linalg.pinv(arms)
    angle = inverse @ elastic
    if not measured:
        return (np.eye(len(arms)) - arms @ inverse) @ elastic, angle
    joints = np.zeros((len(angle), arms.shape[1]))
    return np.concatenate([elastic, -arms], axis=1), np.concatenate([angle, joints], axis=1)


def taut_tendons(force: Numbers) -> Indices:
    """Return the indices, from 0, of tendons with any force. force: [N, m]."""
    return np.flatnonzero(force.any(axis=0))


def tells(finger: Finger, groups: Mapping[str, Numbers]) -> bool:
    """Return whether the equations can show anything: there are more of them than unknown joint angles."""
    return "joint_position" in groups or len(taut_tendons(groups["tendon_force"])) > len(finger.joint_names)


def repairs(balance: Balance) -> tuple[list[Repair], float]:
    """Find the corrections that make the equations fit, and the misfit that they leave."""
    done: list[Repair] = []
    transform = np.eye(len(balance.columns))
    misfit = balance.misfit(transform)
    tried = list(balance.corrections()) if balance.worst(transform) > MISFIT else []
    while tried and balance.worst(transform) > MISFIT and len(done) < ROUNDS:
        scores = _scores(balance, tried, transform)
        least = float(scores.min(initial=np.inf))
        if not np.isfinite(least):
            break
        alike = np.flatnonzero(scores <= max(ALIKE * least, SAME))
        rank = [(balance.pushing(balance.transform(tried[k]) @ transform), _size(tried[k]), scores[k]) for k in alike]
        best = int(alike[min(range(len(alike)), key=lambda k: rank[k])])
        others = tuple(tried[k] for k, key in zip(alike, rank, strict=True) if k != best and key[0] == min(rank)[0])
        before = balance.misfits(transform)
        transform = balance.transform(tried[best]) @ transform
        after = balance.misfits(transform)
        changed = np.abs(after - before) > NOTHING
        done.append(Repair(tried[best], others, _mean(before[changed]), _mean(after[changed])))
        misfit = float(scores[best])
    return done, misfit


def _scores(balance: Balance, tried: Sequence[Correction], transform: Numbers) -> Numbers:
    """Return the misfit [tried] with each correction."""
    was, pushing = balance.is_plausible(transform), balance.pushing(transform)
    before, whole = balance.misfits(transform), balance.misfit(transform)
    scores = np.full(len(tried), np.inf)
    for k, correction in enumerate(tried):
        if not was and correction.kind != "scale":
            continue
        with_it = balance.transform(correction) @ transform
        after = balance.misfits(with_it)
        changed = np.abs(after - before) > NOTHING
        if not changed.any() or _mean(after[changed]) * GAIN >= _mean(before[changed]) or _mean(after) >= whole:
            continue
        if balance.is_plausible(with_it) and balance.pushing(with_it) <= pushing:
            scores[k] = _mean(after)
    return scores


def _size(correction: Correction) -> int:
    """Return the rank of a correction among equally good ones: fewer changed columns are likelier, units likeliest."""
    return 0 if correction.kind == "scale" else len(correction.columns)


def _mean(misfits: Numbers) -> float:
    says = misfits[np.isfinite(misfits)]
    return float(says.mean()) if len(says) else 0.0


# --- what is tried ----------------------------------------------------------------------------------------------------


def _subsets(columns: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Yield all subsets of few columns; of many columns, the subsets of one, two and all."""
    sizes = range(1, len(columns) + 1) if len(columns) <= MOST_SUBSETS else (1, 2, len(columns))
    for size in sizes:
        yield from combinations(columns, size)


def _orders(count: int) -> Iterator[tuple[int, ...]]:
    """Yield all orders of few elements except the given one; of many, two exchanged or three in a circle."""
    given = tuple(range(count))
    if count <= MOST_ORDERS:
        yield from (order for order in permutations(given) if order != given)
        return
    for i, j in combinations(given, 2):
        yield tuple(j if k == i else i if k == j else k for k in given)
    yield given[::-1]
    if count <= MOST_CIRCLES:
        for i, j, k in combinations(given, 3):
            for one, two, three in ((i, j, k), (i, k, j)):
                circle = {one: two, two: three, three: one}
                yield tuple(circle.get(place, place) for place in given)


def _exchange(groups: Sequence[Sequence[str]], order: Sequence[int]) -> Correction:
    """Return the exchange that reads element k of each group from element order[k]."""
    moved = [k for k, source in enumerate(order) if source != k]
    columns = tuple(group[k] for group in groups for k in moved)
    return Correction("exchange", columns, sources=tuple(group[order[k]] for group in groups for k in moved))


# --- velocities -------------------------------------------------------------------------------------------------------


def velocity_corrections(recording: Recording, finger: Finger) -> Iterator[tuple[Correction, float]]:
    """Yield corrections of columns of `joint_velocity`, each with the slope of the angle over the integral."""
    velocity = recording.groups.get("joint_velocity")
    if velocity is None or len(recording) < FEWEST:
        return
    turned, travelled = _changes(recording, finger, velocity)
    for j in range(velocity.shape[1]):
        column = f"joint_velocity[{j + 1}]"
        same = _correlation(turned[:, j], travelled[:, j])
        others = [abs(_correlation(turned[:, j], travelled[:, k])) for k in range(velocity.shape[1])]
        best = int(np.argmax(others))
        if best > j and abs(same) < TOGETHER / 2 and others[best] > TOGETHER:
            columns = (column, f"joint_velocity[{best + 1}]")
            yield Correction("exchange", columns, sources=columns[::-1]), same
        if abs(same) < TOGETHER:
            continue
        slope = float(turned[:, j] @ travelled[:, j] / (travelled[:, j] @ travelled[:, j]))
        if slope < 0.0:
            yield Correction("sign", (column,), -1.0), slope
        for factor, unit in VELOCITY_UNITS:
            if 1.0 / NEAR < abs(slope) / factor < NEAR:
                yield Correction("scale", (column,), factor, unit), slope


def _changes(recording: Recording, finger: Finger, velocity: Numbers) -> tuple[Numbers, Numbers]:
    """Return the change of each angle and the integral of each velocity over windows, [K, n] rad."""
    angle = recording.groups.get("joint_position")
    if angle is None:
        angle = tendon_angles(recording, finger)
    step = np.diff(recording.time)
    every = max(5, round(WINDOW / float(np.median(step))))
    mean = (velocity[1:] + velocity[:-1]) / 2
    path = np.concatenate([np.zeros((1, velocity.shape[1])), np.cumsum(mean * step[:, None], axis=0)])
    return np.diff(angle[::every], axis=0), np.diff(path[::every], axis=0)


def _correlation(one: Numbers, other: Numbers) -> float:
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(one @ other) / size if size > 0.0 else 0.0
