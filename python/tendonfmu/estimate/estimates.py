"""`estimated` in a description: the numbers that data have determined, each with its value and its standard error.

An entry counts as long as the number has that value. So it lapses when somebody writes another number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tendonfmu.arrays import Data
from tendonfmu.estimate.structure import MAGNITUDES, estimable_numbers
from tendonfmu.model import Finger, finger_from_data

if TYPE_CHECKING:
    from tendonfmu.estimate.verdicts import Fitted

DIGITS = 4  # of a standard error


def with_estimates(finger: Finger, numbers: Sequence[Fitted]) -> Finger:
    """Return the finger with an entry for each number that is known, by these data or from before."""
    known = {each.number.path: (each.value, each.standard_error) for each in numbers if each.known}
    return finger_from_data(with_entries(finger.data, known), finger.path)


def with_entries(data: Data, known: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
    """Return the description with these values and standard errors beside its other entries."""
    entries = {path: [value, float(f"{error:.{DIGITS}g}")] for path, (value, error) in known.items()}
    entries = {**(data.get("estimated") or {}), **entries}
    return {**data, "estimated": entries} if entries else dict(data)


def known_errors(data: Data) -> dict[str, float]:
    """Return the standard errors, by path, of the numbers that were estimated and that nobody has changed since."""
    entries = data.get("estimated") or {}
    present = {number.path: number.value for number in estimable_numbers(data)} if entries else {}
    return {
        path: float(error)
        for path, (value, error) in entries.items()
        if path in present and np.isclose(value, present[path], rtol=1e-9, atol=0.0)
    }


def unknown_errors(data: Data, errors: Mapping[str, float]) -> dict[str, float]:
    """Return the standard errors by the names of a fit's unknowns: static − coulomb is `.drop`, 1/vs is `.rate`."""
    values = {number.path: number.value for number in estimable_numbers(data)}
    names = dict(zip(MAGNITUDES, ("drop", "coulomb", "rate", "viscous"), strict=True))
    result = {}
    for path, error in errors.items():
        place, _, key = path.rpartition(".")
        is_rate = key == "stribeck_velocity"
        result[f"{place}.{names.get(key, key)}"] = error / values[path] ** 2 if is_rate else error
    return result
