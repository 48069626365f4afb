"""A row of the description's `extensions` as a variant (its numbers: docs/reference/extensions.md)."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tendonfmu.effects.candidate import Column, Data, Place, Variant
from tendonfmu.effects.friction_law_places import next_row, row
from tendonfmu.extensions import MAGNITUDES


def row_variant(
    data: Data,
    effect: str,
    place: Place,
    shape: Mapping[str, float],
    numbers: Mapping[str, int],
    fixed: Mapping[str, float] | None = None,
    least: float = -math.inf,
) -> Variant:
    """A term that is linear in its magnitudes.

    numbers: name of each magnitude -> expected sign. fixed: the row's other numbers. least: that the description takes
    of the magnitudes.
    """
    path = next_row(data)
    sizes = MAGNITUDES[effect]
    columns = tuple(Column({f"{path}.{name}": 1.0}, sign, sizes[name], least) for name, sign in numbers.items())
    zero = dict.fromkeys(numbers, 0.0)
    return Variant(data, shape, columns, rows=(row(effect, place, **zero, **(fixed or {})),))


def secant_variant(
    data: Data,
    effect: str,
    place: Place,
    shape: Mapping[str, float],
    number: str,
    *,
    scaled: bool,
    only_joint: int | None = None,
    most: float = math.inf,
) -> Variant:
    """A term whose torque has no useful derivative at zero: its column is the difference at full strength.

    number: of the row, with the shape's value. scaled: whether twice the number makes about twice the difference.
    only_joint: whose torque alone it changes. most: the largest size of the number that the description takes.
    """
    rows = (row(effect, place, **{number: float(shape[number])}),)
    keys = (number,) if scaled else ()
    return Variant(data, shape, secant_rows=rows, scaled=keys, only_joint=only_joint, most=most)
