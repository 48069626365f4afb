"""The numbers of `extensions` (docs/extensions.md): their names, and how large each is expected to be."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from tendonfmu.description_defaults import EFFECT_NUMBERS

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
    """A number of an extension. path: as in the description. value: SI. magnitude: expected of such a number. left_out:
    the description leaves it out, or might."""

    effect: str
    path: str
    value: float
    magnitude: float
    left_out: bool = False


def extension_rows(data: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The extensions of a valid description; [] without the key."""
    return list(data.get("extensions") or [])


def extension_numbers(data: Mapping[str, Any]) -> Iterator[ExtensionNumber]:
    """All numbers of the extensions of a valid description, in the order of the FMU's parameters."""
    for k, row in enumerate(extension_rows(data), start=1):
        for name, magnitude in MAGNITUDES[row["effect"]].items():
            missing = LEFT_OUT.get(name, 0.0)
            value = missing if row.get(name) is None else float(row[name])
            left_out = missing != 0.0 and value == missing
            yield ExtensionNumber(row["effect"], f"extensions[{k}].{name}", value, magnitude, left_out)


def place_of(row: Mapping[str, Any]) -> str:
    """`, of load_friction at joint 2, tendon 1`: which effect an extension is, as an appendix to a text."""
    where = ", ".join(f"{key} {row[key]}" for key in ("joint", "tendon") if row.get(key) is not None)
    return f", of {row['effect']}" + (f" at {where}" if where else "")


def extended_row(data: Mapping[str, Any], effect: str, place: Any) -> Mapping[str, Any] | None:
    """The last extension of an effect at a place (joint, tendon from 1 or None); None where there is none."""
    own = [row for row in extension_rows(data) if row["effect"] == effect]
    at = [row for row in own if (row.get("joint"), row.get("tendon")) == (place.joint, place.tendon)]
    return at[-1] if at else None
