"""What a mechanism is: where it can be, which numbers it has, and how it is added to a description.

A mechanism holds no formula. It says how to add its term to a finger description at a strength of zero. The columns
that the diagnosis compares with the residual are the C core's own derivatives by the term's numbers there. If the term
has no useful derivative at zero, the column is the difference of the core's torque with and without it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.samples import Span
from tendonfmu.errors import InputError
from tendonfmu.files import counted
from tendonfmu.model import LAW_NUMBERS, get_number, law_path, own_copy, set_number

# --- changes of a description -----------------------------------------------------------------------------------------
# An absent law gets a negligible friction, because the estimator refuses a law without any. A law that is split into
# two sides or several working points starts with equal sides and equal laws. Paths are those of the FMU's parameters.


_NEXT_TO_NONE = 1e-15  # of the force, or N·m
_ABSENT = {"static": _NEXT_TO_NONE, "coulomb": _NEXT_TO_NONE, "stribeck_velocity": 1.0, "viscous": 0.0}


@dataclass(frozen=True)
class Edit:
    """A change of a description."""

    path: str  # of the effect or of the joint
    make: Callable[[dict[str, Any], str], None]

    def made(self, data: Data) -> dict[str, Any]:
        """Return a copy of a description with the change."""
        result = own_copy(data)
        self.make(result, self.path)
        return result


def add_law(data: dict[str, Any], path: str) -> None:
    """Add a law where there was none."""
    place = law_path(path)
    if place is None or place.tendon is None:
        set_number(data, path, dict(_ABSENT))
        return
    tendon = data["tendons"][place.tendon - 1]
    entries = list(tendon.get(place.kind) or [])
    entries += [None] * (place.joint - len(entries))
    entries[place.joint - 1] = dict(_ABSENT)
    tendon[place.kind] = entries


def add_points(angles: Sequence[float]) -> Callable[[dict[str, Any], str], None]:
    """Return a function that gives a law working points at these angles, rad."""

    def add(data: dict[str, Any], path: str) -> None:
        law = get_number(data, path)
        laws = [own_copy(law) for _ in angles]
        set_number(data, path, {"angles": list(angles), "laws": laws})

    return add


def add_sides(data: dict[str, Any], path: str) -> None:
    """Split the laws at a path into two sides."""
    for one in laws_of(get_number(data, path)):
        if one.get("positive") is None:
            both = {side: dict(one) for side in ("positive", "negative")}
            one.clear()
            one.update(both)


def add_cover(data: dict[str, Any], path: str) -> None:
    """Add a cover without stiffness to a joint."""
    joint = get_number(data, path)
    joint["cover"] = {"stiffness": 0.0, "rest_angle": float((joint.get("cover") or {}).get("rest_angle") or 0.0)}


def with_rows(data: Data, *rows: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a description with further rows of `extensions`."""
    result = own_copy(data)
    if rows:
        result["extensions"] = [*(result.get("extensions") or []), *({**row} for row in rows)]
    return result


# --- laws -------------------------------------------------------------------------------------------------------------


def laws_of(entry: Any) -> list[dict[str, Any]]:
    """Return the laws of an effect: those of its working points, or the only one."""
    return list(entry["laws"]) if entry.get("laws") is not None else [entry]


def sides_at(data: Data, path: str) -> list[dict[str, Any]]:
    """Return all sides of all laws of the effect at a path."""
    sides = []
    for law in laws_of(get_number(data, path)):
        sides += [law] if law.get("positive") is None else [law["positive"], law["negative"]]
    return sides


def law_columns(data: Data, path: str, numbers: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield (path, number) for each of `numbers` in all laws and sides of the effect at a path."""
    entry = get_number(data, path)
    pointed = entry.get("laws") is not None
    for k, law in enumerate(laws_of(entry), start=1):
        at = f"{path}.laws[{k}]" if pointed else path
        for side in ("",) if law.get("positive") is None else (".positive", ".negative"):
            for number in numbers:
                yield f"{at}{side}.{number}", number


# --- numbers ----------------------------------------------------------------------------------------------------------


def add_to_number(data: dict[str, Any], path: str, value: float) -> None:
    """Add a value to a number in place; `coulomb` of a law moves `static` along."""
    place = law_path(path)
    if place is not None and place.number == "coulomb":
        static = f"{path.rsplit('.', 1)[0]}.static"
        set_number(data, static, float(get_number(data, static)) + value)
    before = data_number(data, path)
    set_number(data, path, before + value)


def data_number(data: Data, path: str) -> float:
    """Return a number of a description, 0 if its key is left out."""
    try:
        value = get_number(data, path)
    except KeyError:
        return 0.0
    return float(value or 0.0)


def raise_to(data: dict[str, Any], path: str, share: float) -> None:
    """Keep every number of the laws at a path valid and present: at least `share` of the law's Coulomb friction."""
    sides = sides_at(data, path)
    largest = max(abs(float(side["static"])) for side in sides) or 1e-6
    for side in sides:
        drop = float(side["static"]) - float(side["coulomb"])
        side["coulomb"] = max(float(side["coulomb"]), share * largest)
        side["static"] = side["coulomb"] + max(drop, 0.0)
        if side.get("viscous") is not None:
            side["viscous"] = max(float(side["viscous"]), 0.0)


def magnitudes_of(side: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return Coulomb friction, static − coulomb and viscous friction of a side."""
    static, coulomb, _, viscous = (float(side.get(key) or 0.0) for key in LAW_NUMBERS)
    return coulomb, static - coulomb, viscous


LEAST_SHARE = 0.01  # of the expected size: a fit could not distinguish a smaller number from an absent one

Shape = Mapping[str, float]  # non-linear numbers of a term, by name
Sizes = Mapping[str, list[tuple[float, str]]]  # last part of a path -> (value, unit) of each number


class Place(NamedTuple):
    """Where an effect is."""

    joint: int | None = None  # number from 1; None if the place has none
    tendon: int | None = None


@dataclass(frozen=True)
class Where:
    """An effect at a place."""

    effect: str  # name of the effect
    joint: int | None = None  # as of `Place`
    tendon: int | None = None

    @property
    def place(self) -> Place:
        return Place(self.joint, self.tendon)


@dataclass(frozen=True)
class Column:
    """One direction in the space of a description's numbers."""

    numbers: Mapping[str, float]  # path -> how much a magnitude of 1 adds
    sign: int  # expected sign of the magnitude, 0 for either
    expected: float  # magnitude of an ordinary effect, > 0; a fit without better knowledge starts there
    least: float = -math.inf  # smallest magnitude that the description accepts


SECANT = (Column({}, 1, 1.0),)  # of a term at full strength


@dataclass(frozen=True)
class Variant:
    """A mechanism at one place and one point of the grid of its non-linear numbers."""

    base: Data  # the description without the term
    shape: Shape  # the non-linear numbers here
    columns: tuple[Column, ...]  # derivatives to compute
    # what is added at a strength of zero: a change of laws or of a cover, or a row of `extensions`
    edit: Edit | None = None
    rows: tuple[Mapping[str, Any], ...] = ()
    # a number of laws without a meaning at strength zero: path of the law and its Stribeck velocity
    setting: tuple[str, float] | None = None
    full: Callable[[float], dict[str, Any]] | None = None  # magnitude -> the description with a term of no derivative
    late: float = 0.0  # by how much forces come later than positions, s

    @cached_property
    def data(self) -> dict[str, Any]:
        """The description with the term added at a strength of zero."""
        return self.at((0.0,) * self.count)

    def at(self, magnitudes: Sequence[float]) -> dict[str, Any]:
        """Return the description with the term at exactly these magnitudes, one per column."""
        result = with_rows(self.base if self.edit is None else self.edit.made(self.base), *self.rows)
        if self.setting is not None:
            for side in sides_at(result, self.setting[0]):
                side["stribeck_velocity"] = self.setting[1]
        for column, magnitude in zip(self.columns, magnitudes, strict=True):
            for path, share in column.numbers.items() if magnitude else ():
                add_to_number(result, path, magnitude * share)
        return result

    @property
    def signs(self) -> tuple[int, ...]:
        """Expected sign of each column's magnitude."""
        return tuple(column.sign for column in self.columns)

    @property
    def expected(self) -> tuple[float, ...]:
        """Magnitudes of an ordinary effect."""
        return tuple(column.expected for column in self.columns)

    @property
    def count(self) -> int:
        """Number of columns."""
        return len(self.columns)

    def extended(self, magnitudes: Sequence[float]) -> dict[str, Any]:
        """Return the description with the term at these magnitudes, one per column, none of its numbers at zero."""
        # A magnitude of the wrong sign, or close to 0, becomes a small one of the right sign, because a fit can only
        # start from a number that is present.
        if len(magnitudes) != self.count:
            raise InputError(f"magnitudes: {counted(len(magnitudes), 'number')}; expected {self.count}, one per column")
        if self.full is not None:
            return self.full(min(max(float(magnitudes[0]), 0.2), 5.0))
        both = zip(self.columns, magnitudes, strict=True)
        result = self.at([max(_present(column, float(magnitude)), column.least) for column, magnitude in both])
        changed = self.setting[0] if self.setting is not None else self.edit.path if self.edit is not None else ""
        if changed and law_path(changed) is not None:  # a cover has none
            raise_to(result, changed, LEAST_SHARE)
        return result


def _present(column: Column, magnitude: float) -> float:
    least = LEAST_SHARE * column.expected
    if column.sign:
        return column.sign * max(column.sign * magnitude, least)
    return magnitude if abs(magnitude) >= least else (least if magnitude >= 0 else -least)


def row_places(data: Data, effect: str) -> set[Place]:
    """Return the places of the description's extensions of this effect."""
    rows = data.get("extensions") or []
    return {Place(row.get("joint"), row.get("tendon")) for row in rows if row["effect"] == effect}


def no_shape(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    """Return the grid of an effect without non-linear numbers."""
    return [{}]


@dataclass(frozen=True)
class Mechanism:
    """One effect of docs/reference/commands/diagnose.md."""

    name: str
    title: str  # a few plain words
    explanation: str  # what it is physically, and what to look at on the hand
    # what its evidence is drawn over: "velocity", "angle", "force", "time", "travel", "acceleration" or "load"
    coordinate: str
    possible_places: Callable[[Data, int], list[Place]]  # (data, kinematics) -> where its law is absent
    make: Callable[[str, Data, Place, Shape], Variant]  # (name, data, place, shape) -> the variant there
    size: Callable[[Sizes], str]  # numbers at a place -> its size in words
    find_shapes: Callable[[Data, Place, Span], list[dict[str, float]]] = no_shape  # grid of its non-linear numbers
    # Effects of surfaces and materials: a finger tends to have them at all of its places alike. The others belong to
    # one sensor, link or pulley.
    shared: bool = False
    common: bool = False  # in every finger, or in every way of recording: its name does not count

    def places(self, data: Data, kinematics: int = 1) -> list[Place]:
        """Return the places where it is possible and absent now; `kinematics` is the source, 1 to 3."""
        taken = row_places(data, self.name)
        return [place for place in self.possible_places(data, kinematics) if place not in taken]

    def variants(self, data: Data, place: Place, span: Span) -> list[Variant]:
        """Return its grid at a place, for recordings of this span."""
        return [self.variant(data, place, shape) for shape in self.find_shapes(data, place, span)]

    def variant(self, data: Data, place: Place, shape: Shape) -> Variant:
        """Return one point of the grid; `shape` comes from an earlier variant."""
        return self.make(self.name, data, place, shape)

    def extended(self, data: Data, place: Place, shape: Shape, magnitudes: Sequence[float]) -> dict[str, Any]:
        """Return a description with the term at these magnitudes, ready for `check`, `build` and `fit`."""
        return self.variant(data, place, shape).extended(magnitudes)


@dataclass(frozen=True)
class Term:
    """A mechanism at a place, as it is added to a description."""

    mechanism: Mechanism
    place: Place
    shape: Shape = field(default_factory=dict)  # its non-linear numbers
    magnitudes: Sequence[float] = ()  # one per column, as estimated so far; () for an ordinary size
    fixed: bool = False  # whether a fit leaves its numbers as they are

    @property
    def where(self) -> Where:
        return Where(self.mechanism.name, *self.place)

    def added_to(self, data: Data) -> dict[str, Any]:
        """Return the description with this term."""
        return self.mechanism.extended(data, self.place, self.shape, self.magnitudes)

    def times(self, factors: Sequence[float]) -> Term:
        """Return the term with each magnitude multiplied by its factor."""
        return replace(self, magnitudes=tuple(float(a * b) for a, b in zip(self.magnitudes, factors, strict=True)))

    @property
    def ordinary(self) -> Term:
        """The term at an ordinary size."""
        return replace(self, shape=dict(self.shape), magnitudes=())
