"""How a term at a strength of zero is added to a finger description, without a change of the torque.

An absent law gets a negligible friction, because the estimator refuses a law without any. A law that is split into two
sides or several working points starts with equal sides and equal laws. Paths are those of the FMU's parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tendonfmu.arrays import Data
from tendonfmu.estimate import MAGNITUDES, get_number, own_copy, set_number
from tendonfmu.model import law_path

ABSENT, POINTS, SIDES, COVER = "absent", "points", "sides", "cover"  # kinds of edits, in their order
_NEXT_TO_NONE = 1e-15  # of the force, or N·m
_ORDER = (ABSENT, POINTS, SIDES, COVER)


@dataclass(frozen=True)
class Edit:
    """A change of a description."""

    kind: str  # "absent": a law where there was none
    path: str  # of the effect or of the joint
    angles: tuple[float, ...] = ()  # of the working points, rad


def apply_edits(
    data: Data, edits: Iterable[Edit], rows: Sequence[Mapping[str, Any]], settings: Mapping[str, float]
) -> dict[str, Any]:
    """Return a copy with the edits made, rows added to `extensions` and Stribeck velocities set."""
    result = own_copy(data)
    for edit in sorted(edits, key=lambda edit: _ORDER.index(edit.kind)):
        _MAKE[edit.kind](result, edit)
    for path, velocity in settings.items():
        for side in sides_at(result, path):
            side["stribeck_velocity"] = velocity
    if rows:
        result["extensions"] = [*(result.get("extensions") or []), *({**row} for row in rows)]
    return result


def _add_law(data: dict[str, Any], edit: Edit) -> None:
    law = {"static": _NEXT_TO_NONE, "coulomb": _NEXT_TO_NONE, "stribeck_velocity": 1.0, "viscous": 0.0}
    place = law_path(edit.path)
    if place is None or place.tendon is None:
        set_number(data, edit.path, law)  # type: ignore[arg-type]
        return
    tendon = data["tendons"][place.tendon - 1]
    entries = list(tendon.get(place.kind) or [])
    entries += [None] * (place.joint - len(entries))
    entries[place.joint - 1] = law
    tendon[place.kind] = entries


def _add_points(data: dict[str, Any], edit: Edit) -> None:
    law = get_number(data, edit.path)
    laws = [own_copy(law) for _ in edit.angles]
    set_number(data, edit.path, {"angles": list(edit.angles), "laws": laws})  # type: ignore[arg-type]


def _add_sides(data: dict[str, Any], edit: Edit) -> None:
    law = get_number(data, edit.path)
    for one in laws_of(law):
        if one.get("positive") is None:
            both = {side: dict(one) for side in ("positive", "negative")}
            one.clear()
            one.update(both)


def _add_cover(data: dict[str, Any], edit: Edit) -> None:
    joint = get_number(data, edit.path)
    cover = joint.get("cover") or {}
    joint["cover"] = {"stiffness": 0.0, "rest_angle": float(cover.get("rest_angle") or 0.0)}


_MAKE = {ABSENT: _add_law, POINTS: _add_points, SIDES: _add_sides, COVER: _add_cover}


# --- laws -------------------------------------------------------------------------------------------------------------


def laws_of(entry: Any) -> list[dict[str, Any]]:
    """Return the laws of an effect: those of its working points, or the only one."""
    return list(entry["laws"]) if entry.get("laws") is not None else [entry]


def sides_at(data: Data, path: str) -> list[dict[str, Any]]:
    """Return all sides of all laws of the effect at a path."""
    sides = []
    for law in laws_of(get_number(data, path)):
        sides += [law] if law.get("positive") is None else [law["positive"], law["negative"]]
    return sides


def law_columns(data: Data, path: str, numbers: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield (path, number) for each of `numbers` in all laws and sides of the effect at a path."""
    entry = get_number(data, path)
    pointed = entry.get("laws") is not None
    for k, law in enumerate(laws_of(entry), start=1):
        at = f"{path}.laws[{k}]" if pointed else path
        for side in ("",) if law.get("positive") is None else (".positive", ".negative"):
            for number in numbers:
                yield f"{at}{side}.{number}", number


# --- numbers ----------------------------------------------------------------------------------------------------------


def add_to_number(data: dict[str, Any], path: str, value: float) -> None:
    """Add a value to a number in place; `coulomb` of a law moves `static` along."""
    place = law_path(path)
    if place is not None and place.number == "coulomb":
        static = f"{path.rsplit('.', 1)[0]}.static"
        set_number(data, static, float(get_number(data, static)) + value)
    before = data_number(data, path)
    set_number(data, path, before + value)


def data_number(data: Data, path: str) -> float:
    """Return a number of a description, 0 if its key is left out."""
    try:
        value = get_number(data, path)
    except KeyError:
        return 0.0
    return float(value or 0.0)


def raise_to(data: dict[str, Any], edits: Iterable[Edit], settings: Mapping[str, float], share: float) -> None:
    """Keep every number of the edited laws valid and present: at least `share` of its law's Coulomb friction."""
    for path in {edit.path for edit in edits if edit.kind != COVER} | set(settings):
        sides = sides_at(data, path)
        largest = max(abs(float(side["static"])) for side in sides) or 1e-6
        for side in sides:
            drop = float(side["static"]) - float(side["coulomb"])
            side["coulomb"] = max(float(side["coulomb"]), share * largest)
            side["static"] = side["coulomb"] + max(drop, 0.0)
            if side.get("viscous") is not None:
                side["viscous"] = max(float(side["viscous"]), 0.0)


def magnitudes_of(side: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return Coulomb friction, static − coulomb and viscous friction of a side."""
    static, coulomb, _, viscous = (float(side.get(key) or 0.0) for key in MAGNITUDES)
    return coulomb, static - coulomb, viscous
