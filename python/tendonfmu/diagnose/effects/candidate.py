"""What a candidate for a cause is: where it can sit, which numbers it has, and how a description gets it.

A candidate holds no formula. It says how to add its term to a finger description at a strength of zero; the columns
that the diagnosis compares with the residual are the C core's own derivatives by the term's numbers there, or, where
the term has no useful derivative at zero, the difference of the core's torque with and without it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from tendonfmu.diagnose.effects.description_edit import Edit, add_to_number, apply_edits, raise_to
from tendonfmu.diagnose.span import Span
from tendonfmu.errors import InputError

Data = Mapping[str, Any]

LEAST_SHARE = 0.01  # of the expected size: with less a fit could not tell the number from an absent one


@dataclass(frozen=True)
class Place:
    """Where an effect sits. joint, tendon: from 1; None where it has none."""

    joint: int | None = None
    tendon: int | None = None


@dataclass(frozen=True)
class Column:
    """One direction in the space of a description's numbers.

    numbers: path -> how much of it a magnitude of 1 adds. `coulomb` moves with `static` − `coulomb` held, `static` is
    that difference, as in `estimation.Unknown`. sign: the expected one of the magnitude, 0 either.
    expected: magnitude of an ordinary effect, > 0: where a fit starts that knows nothing better. least: that the
    description takes of the magnitude.
    """

    numbers: Mapping[str, float]
    sign: int
    expected: float
    least: float = -math.inf

    @property
    def path(self) -> str:
        """The first number that it moves."""
        return next(iter(self.numbers))


@dataclass(frozen=True)
class Variant:
    """A candidate at one place and one point of the grid of its non-linear numbers.

    base: the description without it. edits, rows: what is added, at a strength of zero: changes of laws and covers, and
    rows of `extensions`. settings: numbers of laws that mean nothing at strength zero: path of the law -> Stribeck
    velocity. shape: the non-linear numbers here. columns: derivatives to take. secant_rows: where there is no
    derivative, the rows at full strength; the one column is then the difference that they make, magnitude 1.
    scaled: keys of secant_rows that grow with the magnitude, up to `most` at either sign. only_joint: whose torque
    alone the rows change, from 1. late: s by which forces come later than positions: the column is what that does to
    measured forces, not what the row makes of them.
    """

    base: Data
    shape: Mapping[str, float]
    columns: tuple[Column, ...] = ()
    edits: tuple[Edit, ...] = ()
    rows: tuple[Mapping[str, Any], ...] = ()
    settings: Mapping[str, float] | None = None
    secant_rows: tuple[Mapping[str, Any], ...] = ()
    scaled: tuple[str, ...] = ()
    most: float = math.inf
    only_joint: int | None = None
    late: float = 0.0

    @cached_property
    def data(self) -> dict[str, Any]:
        """The description with the term added at a strength of zero."""
        return apply_edits(self.base, self.edits, self.rows, self.settings or {})

    @property
    def secant(self) -> dict[str, Any] | None:
        """The description with the term, where its column is a difference of torques."""
        return self.with_secants([self]) if self.secant_rows else None

    def with_secants(self, variants: Sequence[Variant]) -> dict[str, Any]:
        """The description with the terms of several variants of it at full strength."""
        return apply_edits(self.base, (), [row for variant in variants for row in variant.secant_rows], {})

    @property
    def paths(self) -> tuple[str, ...]:
        """First number of each column."""
        return tuple(column.path for column in self.columns)

    @property
    def signs(self) -> tuple[int, ...]:
        """Expected sign of each column's magnitude."""
        return (1,) if self.secant_rows else tuple(column.sign for column in self.columns)

    @property
    def count(self) -> int:
        """How many columns it has."""
        return 1 if self.secant_rows else len(self.columns)

    def extended(self, magnitudes: Sequence[float]) -> dict[str, Any]:
        """The description with the term at these magnitudes, one per column, none of its numbers at zero.

        A magnitude of the wrong sign, or next to nothing, becomes a small one of the right sign: what a fit starts
        from has to be present.
        """
        if len(magnitudes) != self.count:
            raise InputError(f"magnitudes: {len(magnitudes)} numbers; expected {self.count}, one per column")
        if self.secant_rows:
            factor = min(max(float(magnitudes[0]), 0.2), 5.0)
            rows = [dict(row) for row in self.secant_rows]
            for row in rows:
                row |= {key: min(max(row[key] * factor, -self.most), self.most) for key in self.scaled}
            return apply_edits(self.base, (), rows, {})
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


@dataclass(frozen=True)
class Candidate:
    """One effect of docs/reference/commands/diagnose.md.

    name: of the effect. title: a few plain words. explanation: what it is physically, and what to look at on the
    hand. sign: expected one of its magnitudes, +1, −1 or 0 for either. excited_by: the motion or load that shows it.
    confused_with: effects that look alike in many recordings. coordinate: what its evidence is drawn over: "velocity",
    "angle", "force", "time", "travel", "acceleration" or "load". unit: of its main number. number: what that is called.
    find_places(data, kinematics): where it is absent and can be. find_shapes(data, place, span): the grid of its
    non-linear numbers. make(data, place, shape): the variant there.
    """

    name: str
    title: str
    explanation: str
    sign: int
    excited_by: str
    confused_with: tuple[str, ...]
    coordinate: str
    unit: str
    number: str
    find_places: Callable[[Data, int], list[Place]]
    find_shapes: Callable[[Data, Place, Span], list[dict[str, float]]]
    make: Callable[[Data, Place, Mapping[str, float]], Variant]

    def places(self, data: Data, kinematics: int = 1) -> list[Place]:
        """Where it can be proposed: absent there now. kinematics: source, 1 to 3."""
        return self.find_places(data, kinematics)

    def variants(self, data: Data, place: Place, span: Span) -> list[Variant]:
        """Its grid at a place, for recordings of this span."""
        return [self.make(data, place, shape) for shape in self.find_shapes(data, place, span)]

    def variant(self, data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
        """One point of the grid. shape: of a variant of before."""
        return self.make(data, place, shape)

    def extended(
        self, data: Data, place: Place, shape: Mapping[str, float], magnitudes: Sequence[float]
    ) -> dict[str, Any]:
        """A description with the term at these magnitudes, ready for `check`, `build` and `fit`.

        shape: of the variant. magnitudes: one per column of it. Raises InputError for another number of them.
        """
        return self.make(data, place, shape).extended(magnitudes)


def no_shape(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    """Of an effect without non-linear numbers."""
    return [{}]
