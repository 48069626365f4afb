"""How a row of the description's `extensions` becomes a variant.

The numbers of each effect are in docs/reference/semantics.md#extensions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from tendonfmu.diagnosis.effects.candidate import Column, Data, Place, Variant
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
    """Return the variant of a term that is linear in its magnitudes.

    `numbers` maps the name of each magnitude to its expected sign. `fixed` holds the other numbers of the row. `least`
    is the smallest magnitude that the description accepts.
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
    """Return the variant of a term without a useful derivative at zero: its column is the difference at full strength.

    Parameters
    ----------
    number
        Key of the row that gets the shape's value.
    scaled
        Whether twice the number makes about twice the difference.
    only_joint
        The only joint whose torque it changes.
    most
        Largest size of the number that the description accepts.
    """
    rows = (row(effect, place, **{number: float(shape[number])}),)
    keys = (number,) if scaled else ()
    return Variant(data, shape, secant_rows=rows, scaled=keys, only_joint=only_joint, most=most)
