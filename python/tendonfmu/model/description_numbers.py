"""Which numbers a finger description and its `extensions` have, and what is taken where it leaves them out."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

# Generated from the tables in runtime/description by `python tools/tables/generate.py`; SI units.
_TABLE = json.loads((files("tendonfmu") / "schema" / "description_numbers.json").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class EffectNumber:
    """A number of an extension, in SI units."""

    least: float  # its range
    most: float
    missing: float | None  # its value where it is left out; None if it is required
    scale: float  # its expected magnitude


DEFAULTS: Mapping[str, float] = _TABLE["defaults"]  # by path
RANGES: Mapping[str, tuple[float, float]] = {path: (least, most) for path, (least, most) in _TABLE["ranges"].items()}
LIMITS: Mapping[str, int] = _TABLE["limits"]  # largest number of each in one description
# By effect, in the order of the FMU's parameters.
EFFECT_NUMBERS: Mapping[str, Mapping[str, EffectNumber]] = {
    effect: {key: EffectNumber(**number) for key, number in numbers.items()}
    for effect, numbers in _TABLE["effects"].items()
}

# By effect, in the order of the FMU's parameters: magnitudes that matter on a hand of human size, SI units.
MAGNITUDES: Mapping[str, Mapping[str, float]] = {
    effect: {name: number.scale for name, number in numbers.items()} for effect, numbers in EFFECT_NUMBERS.items()
}

# What is taken where the description leaves a number out, if not 0. As long as it is that, a fit leaves it alone.
LEFT_OUT: Mapping[str, float] = {
    name: number.missing for numbers in EFFECT_NUMBERS.values() for name, number in numbers.items() if number.missing
}


@dataclass(frozen=True)
class ExtensionNumber:
    """A number of an extension."""

    effect: str  # effect of the extension
    path: str  # path as in the description
    value: float  # in SI units
    magnitude: float  # expected size of such a number
    left_out: bool = False  # whether the description leaves it out, or has the value that stands for leaving it out


def extension_rows(data: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the extensions of a description."""
    return list(data.get("extensions") or [])


def extension_numbers(data: Mapping[str, Any]) -> Iterator[ExtensionNumber]:
    """Yield all numbers of the extensions of a description."""
    for k, row in enumerate(extension_rows(data), start=1):
        for name, magnitude in MAGNITUDES[row["effect"]].items():
            missing = LEFT_OUT.get(name, 0.0)
            value = missing if row.get(name) is None else float(row[name])
            left_out = missing != 0.0 and value == missing
            yield ExtensionNumber(row["effect"], f"extensions[{k}].{name}", value, magnitude, left_out)


def place_of(row: Mapping[str, Any]) -> str:
    """Describe an extension as an appendix to a text."""
    where = ", ".join(f"{key} {row[key]}" for key in ("joint", "tendon") if row.get(key) is not None)
    return f", of {row['effect']}" + (f" at {where}" if where else "")


def extended_row(data: Mapping[str, Any], effect: str, place: Any) -> Mapping[str, Any] | None:
    """Return the last extension of an effect at a place."""
    rows = [row for row in extension_rows(data) if row["effect"] == effect]
    at = [row for row in rows if (row.get("joint"), row.get("tendon")) == (place.joint, place.tendon)]
    return at[-1] if at else None


def number_of(data: Mapping[str, Any], path: str) -> float:
    """Return a number of a finger description, or its default where it is left out."""
    node: Any = data
    for key in path.split("."):
        node = (node or {}).get(key)
    return DEFAULTS[path] if node is None else float(node)
