"""`estimated` in a description: what data have determined, each with its value and its standard error.

An entry is a number of the description, or the Coulomb friction of a place (mean over its working points and sides), or
that of a tendon (sum over its places), which are often known where their parts are not. It counts as long as the
description has that value. So it lapses when somebody writes another number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.estimate.fisher_information import Unknown
from tendonfmu.estimate.identifiability import LIMIT
from tendonfmu.estimate.structure import MAGNITUDES, estimable_numbers
from tendonfmu.model import Finger, finger_from_data

DIGITS = 4  # of a standard error


def with_estimates(finger: Finger, numbers: Sequence[Unknown], covariance: Numbers, size: Numbers) -> Finger:
    """Return the finger with an entry for all that is known within `LIMIT` of its size [p]."""
    value = np.array([number.value for number in numbers])
    weights = {number.path: np.eye(len(numbers))[k] for k, number in enumerate(numbers)} | _coulomb_sums(numbers)
    entries = dict(finger.data.get("estimated") or {})
    for path, weight in weights.items():
        error = float(np.sqrt(max(weight @ covariance @ weight, 0.0)))
        entries.pop(path, None)
        if error <= LIMIT * float(weight @ size):
            entries[path] = [float(weight @ value), float(f"{error:.{DIGITS}g}")]
    return finger_from_data({**finger.data, "estimated": entries or None}, finger.path)


def known_numbers(data: Data) -> dict[str, tuple[float, float]]:
    """Return value and standard error, by path, of what was estimated and that nobody has changed since."""
    entries = data.get("estimated") or {}
    numbers = estimable_numbers(data) if entries else []
    present = {number.path: number.value for number in numbers} | {
        path: float(weight @ [number.value for number in numbers]) for path, weight in _coulomb_sums(numbers).items()
    }
    return {
        path: (float(value), float(error))
        for path, (value, error) in entries.items()
        if path in present and np.isclose(value, present[path], rtol=1e-9, atol=0.0)
    }


def unknown_errors(data: Data, errors: Mapping[str, float]) -> dict[str, float]:
    """Return the standard errors of numbers by a fit's unknowns: static − coulomb is `.drop`, 1/vs is `.rate`."""
    names = dict(zip(MAGNITUDES, ("drop", "coulomb", "rate", "viscous"), strict=True))
    result = {}
    for number in estimable_numbers(data):
        if number.path in errors:
            place, _, key = number.path.rpartition(".")
            factor = number.value**-2 if key == "stribeck_velocity" else 1.0
            result[f"{place}.{names.get(key, key)}"] = factor * errors[number.path]
    return result


def _coulomb_sums(numbers: Sequence[Unknown]) -> dict[str, Numbers]:
    """Return the weights [p] of the Coulomb friction of each place, and of each tendon."""
    places: dict[str, list[int]] = {}
    for k, number in enumerate(numbers):
        if number.effect is not None and number.key == "coulomb":
            places.setdefault(number.effect.path, []).append(k)
    sums: dict[str, Numbers] = {}
    for path, members in places.items():
        sums[path] = np.zeros(len(numbers))
        sums[path][members] = 1.0 / len(members)
    for path in places:
        tendon = path.partition(".")[0]
        if tendon.startswith("tendons["):
            sums[tendon] = sums.get(tendon, 0.0) + sums[path]
    return sums
