"""How a row of the description's `extensions` becomes a variant.

The numbers of each effect are in docs/reference/semantics.md#extensions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Column, Place, Variant
from tendonfmu.diagnosis.effects.friction_law_places import next_row, row
from tendonfmu.model import MAGNITUDES


def row_variant(
    data: Data,
    effect: str,
    place: Place,
    shape: Mapping[str, float],
    numbers: Mapping[str, int],
    fixed: Mapping[str, float] | None = None,
    least: float = -math.inf,
) -> Variant:
    """Return the variant of a term that is linear in its magnitudes."""
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
    """Return the variant of a term without a useful derivative at zero: its column is a finite difference."""
    rows = (row(effect, place, **{number: float(shape[number])}),)
    keys = (number,) if scaled else ()
    return Variant(data, shape, secant_rows=rows, scaled=keys, only_joint=only_joint, most=most)
