"""Whether friction grows with speed, where the law has no viscous part."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Column, Place, Variant
from tendonfmu.diagnosis.effects.description_edit import law_columns
from tendonfmu.diagnosis.effects.friction_law_places import all_sides, kind_shape, law_path, laws_at, places_with
from tendonfmu.diagnosis.span import Span
from tendonfmu.model import Effect, velocity_threshold

_EXPECTED = 0.2  # of the Coulomb friction, at a speed of 100 times the threshold of motion


def _lacks(data: Data, effect: Effect) -> bool:
    return all(viscous == 0 for _, _, viscous in all_sides(data, effect))


def _places(data: Data, kinematics: int) -> list[Place]:
    return places_with(data, _lacks)


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    return [kind_shape(effect) for effect in laws_at(data, place) if _lacks(data, effect)]


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    path = law_path(place, shape)
    effect = next(law for law in laws_at(data, place) if law.path == path)
    coulomb = max(side for side, _, _ in all_sides(data, effect)) or 1e-6
    numbers: dict[str, Any] = {at: 1.0 for at, _ in law_columns(data, path, ["viscous"])}
    expected = _EXPECTED * coulomb / (100 * (velocity_threshold(data, effect) or 1e-3))
    return Variant(data, shape, (Column(numbers, 1, expected),))


CANDIDATE = Candidate(
    name="viscous_friction",
    title="friction grows with speed",
    explanation=(
        "The friction law here is the same at every speed, but the measured friction rises with it, as in grease "
        "or a seal. Look at the lubricant, at sealed bearings, and at whether it is worse when cold."
    ),
    sign=1,
    excited_by="strokes at several constant speeds, from slow to as fast as the hand goes",
    confused_with=("stribeck", "time_delay", "inertia", "asymmetric_friction"),
    coordinate="velocity",
    unit="s/m",
    number="viscous friction",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
