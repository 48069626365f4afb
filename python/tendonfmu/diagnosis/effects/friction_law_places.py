"""Where the friction laws of a description are, and where there could be one: places of the structural candidates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Place
from tendonfmu.diagnosis.effects.description_edit import magnitudes_of, sides_at
from tendonfmu.model import Effect, effects, moment_arms, number_of

KINDS = ("friction", "load_friction", "edge_friction", "pulley_friction")


def place_of(effect: Effect) -> Place:
    """Return joint and tendon of a law; friction in a joint has no tendon."""
    return Place(effect.joint, effect.tendon or None)


def kind_shape(effect: Effect) -> dict[str, float]:
    """Return what distinguishes the two laws of one place: {"pulley": 1} or {"load": 1}."""
    return {"pulley_friction": {"pulley": 1.0}, "load_friction": {"load": 1.0}}.get(effect.kind, {})


def law_of(shape: Mapping[str, float]) -> str:
    """Return which of the two laws of a place a shape belongs to: "pulley", "load", or "" for the other one."""
    return next((kind for kind in ("pulley", "load") if shape.get(kind)), "")


def law_path(place: Place, shape: Mapping[str, float]) -> str:
    """Return the path of the effect at a place; `shape` holds what `kind_shape` returned."""
    if place.tendon is None:
        return f"joints[{place.joint}].{'load_friction' if shape.get('load') else 'friction'}"
    kind = "pulley_friction" if shape.get("pulley") else "edge_friction"
    return f"tendons[{place.tendon}].{kind}[{place.joint}]"


def laws_at(data: Data, place: Place) -> list[Effect]:
    """Return the present laws of a place."""
    return [effect for effect in effects(data) if place_of(effect) == place]


def places_with(data: Data, lacks: Any) -> list[Place]:
    """Return the places with a law for which `lacks(data, effect)` is true, each once."""
    return list(dict.fromkeys(place_of(effect) for effect in effects(data) if lacks(data, effect)))


def all_sides(data: Data, effect: Effect) -> list[tuple[float, float, float]]:
    """Return Coulomb, static − coulomb and viscous friction of each side of each law of an effect."""
    return [magnitudes_of(side) for side in sides_at(data, effect.path)]


def is_asymmetric(effect: Effect) -> bool:
    """Return whether any of its laws has two sides."""
    return any(law.get("positive") is not None for law in effect.laws)


# --- tendons ----------------------------------------------------------------------------------------------------------


def passes(data: Data) -> Iterator[Place]:
    """Yield the joints that each tendon reaches: it turns this joint or one beyond, so ẋ_ij is not always 0."""
    for i, row in enumerate(moment_arms(data), start=1):
        reached = np.flatnonzero(row)
        for j in range(1, (int(reached[-1]) + 2) if len(reached) else 1):
            yield Place(j, i)


def all_joints(data: Data) -> list[Place]:
    return [Place(joint=j) for j in range(1, len(data["joints"]) + 1)]


def all_tendons(data: Data) -> list[Place]:
    return [Place(tendon=i) for i in range(1, len(data["tendons"]) + 1)]


def rubbing_joints(data: Data) -> list[Place]:
    """Return the joints with friction of their own."""
    return [Place(joint=j) for j in sorted({effect.joint for effect in effects(data) if not effect.tendon})]


def rubbing_tendons(data: Data) -> list[Place]:
    """Return the tendons with friction along them."""
    return [Place(tendon=i) for i in sorted({effect.tendon for effect in effects(data) if effect.tendon})]


def thresholds(data: Data) -> tuple[float, float]:
    """Return the velocity thresholds of motion."""
    return number_of(data, "velocity_threshold.tendon"), number_of(data, "velocity_threshold.joint")


# --- extensions -------------------------------------------------------------------------------------------------------


def row_places(data: Data, effect: str) -> set[Place]:
    """Return the places of the description's extensions of this effect."""
    rows = data.get("extensions") or []
    return {Place(row.get("joint"), row.get("tendon")) for row in rows if row["effect"] == effect}


def without_rows(data: Data, effect: str, places: list[Place]) -> list[Place]:
    """Return the places without such an extension in the description."""
    taken = row_places(data, effect)
    return [place for place in places if place not in taken]


def row(effect: str, place: Place, **numbers: float) -> dict[str, Any]:
    """Return a row for the description's extensions."""
    where = {key: value for key, value in (("joint", place.joint), ("tendon", place.tendon)) if value is not None}
    return {"effect": effect, **where, **numbers}


def next_row(data: Data, offset: int = 0) -> str:
    """Return the path of the row that would come next in `extensions`."""
    return f"extensions[{len(data.get('extensions') or []) + 1 + offset}]"
