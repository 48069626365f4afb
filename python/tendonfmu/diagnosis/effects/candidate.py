"""What a candidate for a cause is: where it can be, which numbers it has, and how it is added to a description.

A candidate holds no formula. It says how to add its term to a finger description at a strength of zero. The columns
that the diagnosis compares with the residual are the C core's own derivatives by the term's numbers there. If the term
has no useful derivative at zero, the column is the difference of the core's torque with and without it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from tendonfmu.diagnosis.effects.description_edit import Edit, add_to_number, apply_edits, raise_to
from tendonfmu.diagnosis.span import Span
from tendonfmu.errors import InputError
from tendonfmu.files import counted

Data = Mapping[str, Any]

LEAST_SHARE = 0.01  # of the expected size: a fit could not distinguish a smaller number from an absent one


@dataclass(frozen=True)
class Place:
    """Where an effect is.

    Attributes
    ----------
    joint, tendon
        Number from 1; None if the place has none.
    """

    joint: int | None = None
    tendon: int | None = None


@dataclass(frozen=True)
class Column:
    """One direction in the space of a description's numbers.

    Attributes
    ----------
    numbers
        Path -> how much a magnitude of 1 adds. `coulomb` moves with `static` − `coulomb` held constant; `static` is
        that difference, as in `estimation.Unknown`.
    sign
        Expected sign of the magnitude, 0 for either.
    expected
        Magnitude of an ordinary effect, > 0; a fit without better knowledge starts there.
    least
        Smallest magnitude that the description accepts.
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

    Attributes
    ----------
    base
        The description without the term.
    shape
        The non-linear numbers here.
    columns
        Derivatives to compute.
    edits, rows
        What is added at a strength of zero: changes of laws and covers, and rows of `extensions`.
    settings
        Numbers of laws without a meaning at strength zero: path of the law -> Stribeck velocity.
    secant_rows
        The rows at full strength, if there is no derivative. The one column is then the difference that they make; its
        magnitude is 1.
    scaled
        Keys of `secant_rows` that grow with the magnitude.
    most
        Largest value of these keys, of either sign.
    only_joint
        The only joint whose torque the rows change, from 1.
    late
        By how much forces come later than positions, s. The column is then the effect of this delay on measured forces,
        not what the row makes of them.
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
        """The description with the term, if its column is a difference of torques."""
        return self.with_secants([self]) if self.secant_rows else None

    def with_secants(self, variants: Sequence[Variant]) -> dict[str, Any]:
        """Return the description with the terms of several of its variants at full strength."""
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
        """Number of columns."""
        return 1 if self.secant_rows else len(self.columns)

    def extended(self, magnitudes: Sequence[float]) -> dict[str, Any]:
        """Return the description with the term at these magnitudes, one per column, none of its numbers at zero.

        A magnitude of the wrong sign, or close to 0, becomes a small one of the right sign, because a fit can only
        start from a number that is present.
        """
        if len(magnitudes) != self.count:
            raise InputError(f"magnitudes: {counted(len(magnitudes), 'number')}; expected {self.count}, one per column")
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

    Attributes
    ----------
    name
        Name of the effect.
    title
        A few plain words.
    explanation
        What it is physically, and what to look at on the hand.
    sign
        Expected sign of its magnitudes: +1, −1, or 0 for either.
    excited_by
        Motion or load that shows it.
    confused_with
        Effects that look alike in many recordings.
    coordinate
        What its evidence is drawn over: "velocity", "angle", "force", "time", "travel", "acceleration" or "load".
    unit
        Of its main number.
    number
        What the main number is called.
    find_places
        (data, kinematics) -> places where it is absent and possible.
    find_shapes
        (data, place, span) -> the grid of its non-linear numbers.
    make
        (data, place, shape) -> the variant there.
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
        """Return the places where it is possible and absent now; `kinematics` is the source, 1 to 3."""
        return self.find_places(data, kinematics)

    def variants(self, data: Data, place: Place, span: Span) -> list[Variant]:
        """Return its grid at a place, for recordings of this span."""
        return [self.make(data, place, shape) for shape in self.find_shapes(data, place, span)]

    def variant(self, data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
        """Return one point of the grid; `shape` comes from an earlier variant."""
        return self.make(data, place, shape)

    def extended(
        self, data: Data, place: Place, shape: Mapping[str, float], magnitudes: Sequence[float]
    ) -> dict[str, Any]:
        """Return a description with the term at these magnitudes, ready for `check`, `build` and `fit`.

        `shape` is that of the variant; `magnitudes` has one entry per column. Raises InputError if their number is
        wrong.
        """
        return self.make(data, place, shape).extended(magnitudes)


def no_shape(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    """Return the grid of an effect without non-linear numbers."""
    return [{}]
