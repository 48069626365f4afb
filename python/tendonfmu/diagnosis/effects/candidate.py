"""What a candidate for a cause is: where it can be, which numbers it has, and how it is added to a description.

A candidate holds no formula. It says how to add its term to a finger description at a strength of zero. The columns
that the diagnosis compares with the residual are the C core's own derivatives by the term's numbers there. If the term
has no useful derivative at zero, the column is the difference of the core's torque with and without it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.description_edit import Edit, add_to_number, apply_edits, raise_to
from tendonfmu.diagnosis.span import Span
from tendonfmu.errors import InputError
from tendonfmu.files import counted

LEAST_SHARE = 0.01  # of the expected size: a fit could not distinguish a smaller number from an absent one

Shape = Mapping[str, float]  # non-linear numbers of a term, by name
Sizes = Mapping[str, list[tuple[float, str]]]  # last part of a path -> (value, unit) of each number


@dataclass(frozen=True)
class Place:
    """Where an effect is."""

    joint: int | None = None  # number from 1; None if the place has none
    tendon: int | None = None


@dataclass(frozen=True)
class Column:
    """One direction in the space of a description's numbers."""

    numbers: Mapping[str, float]  # path -> how much a magnitude of 1 adds
    sign: int  # expected sign of the magnitude, 0 for either
    expected: float  # magnitude of an ordinary effect, > 0; a fit without better knowledge starts there
    least: float = -math.inf  # smallest magnitude that the description accepts

    @property
    def path(self) -> str:
        """The first number that it moves."""
        return next(iter(self.numbers))


@dataclass(frozen=True)
class Variant:
    """A candidate at one place and one point of the grid of its non-linear numbers."""

    base: Data  # the description without the term
    shape: Shape  # the non-linear numbers here
    columns: tuple[Column, ...] = ()  # derivatives to compute
    # what is added at a strength of zero: changes of laws and covers, and rows of `extensions`
    edits: tuple[Edit, ...] = ()
    rows: tuple[Mapping[str, Any], ...] = ()
    # numbers of laws without a meaning at strength zero: path of the law -> Stribeck velocity
    settings: Mapping[str, float] | None = None
    full: Callable[[float], dict[str, Any]] | None = None  # magnitude -> the description with a term of no derivative
    late: float = 0.0  # by how much forces come later than positions, s

    @cached_property
    def data(self) -> dict[str, Any]:
        """The description with the term added at a strength of zero."""
        return apply_edits(self.base, self.edits, self.rows, self.settings or {})

    @property
    def secant(self) -> dict[str, Any] | None:
        """The description with the term, if its column is a difference of torques."""
        return self.full(1.0) if self.full is not None else None

    def at(self, magnitudes: Sequence[float]) -> dict[str, Any]:
        """Return the description with the term at exactly these magnitudes, one per column."""
        result = apply_edits(self.base, self.edits, self.rows, self.settings or {})
        for column, magnitude in zip(self.columns, magnitudes, strict=True):
            for path, share in column.numbers.items() if magnitude else ():
                add_to_number(result, path, magnitude * share)
        return result

    @property
    def paths(self) -> tuple[str, ...]:
        """First number of each column; "" for a column at full strength."""
        return ("",) if self.full is not None else tuple(column.path for column in self.columns)

    @property
    def signs(self) -> tuple[int, ...]:
        """Expected sign of each column's magnitude."""
        return (1,) if self.full is not None else tuple(column.sign for column in self.columns)

    @property
    def expected(self) -> tuple[float, ...]:
        """Magnitudes of an ordinary effect."""
        return (1.0,) if self.full is not None else tuple(column.expected for column in self.columns)

    @property
    def count(self) -> int:
        """Number of columns."""
        return 1 if self.full is not None else len(self.columns)

    def extended(self, magnitudes: Sequence[float]) -> dict[str, Any]:
        """Return the description with the term at these magnitudes, one per column, none of its numbers at zero."""
        # A magnitude of the wrong sign, or close to 0, becomes a small one of the right sign, because a fit can only
        # start from a number that is present.
        if len(magnitudes) != self.count:
            raise InputError(f"magnitudes: {counted(len(magnitudes), 'number')}; expected {self.count}, one per column")
        if self.full is not None:
            return self.full(min(max(float(magnitudes[0]), 0.2), 5.0))
        result = apply_edits(self.base, self.edits, self.rows, self.settings or {})
        for column, magnitude in zip(self.columns, magnitudes, strict=True):
            value = max(_present(column, float(magnitude)), column.least)
            for path, share in column.numbers.items():
                add_to_number(result, path, value * share)
        raise_to(result, self.edits, self.settings or {}, LEAST_SHARE)
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
class Candidate:
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
    """A candidate at a place, as it is added to a description."""

    candidate: Candidate
    place: Place
    shape: Shape = field(default_factory=dict)  # its non-linear numbers
    magnitudes: Sequence[float] = ()  # one per column, as estimated so far; () for an ordinary size
    fixed: bool = False  # whether a fit leaves its numbers as they are

    def added_to(self, data: Data) -> dict[str, Any]:
        """Return the description with this term."""
        return self.candidate.extended(data, self.place, self.shape, self.magnitudes)

    def times(self, factors: Sequence[float]) -> Term:
        """Return the term with each magnitude multiplied by its factor."""
        return replace(self, magnitudes=tuple(float(a * b) for a, b in zip(self.magnitudes, factors, strict=True)))

    @property
    def ordinary(self) -> Term:
        """The term at an ordinary size."""
        return replace(self, shape=dict(self.shape), magnitudes=())
