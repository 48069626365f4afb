"""Friction that is larger at rest than in motion, in a law that has static equal to coulomb."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.diagnosis_span import Span
from tendonfmu.effects.candidate import Candidate, Column, Data, Place, Variant
from tendonfmu.effects.description_edit import law_columns
from tendonfmu.effects.friction_law_places import all_sides, kind_shape, law_path, laws_at, places_with
from tendonfmu.friction_places import Effect, velocity_threshold

_OF_SPEED = (0.03, 0.1, 0.3)  # Stribeck velocities, of the 95 % speed
_LEAST = 1.0  # of the threshold of motion: below, nothing is left of it where the effect moves
_EXPECTED = 0.25  # of the Coulomb friction


def _lacks(data: Data, effect: Effect) -> bool:
    return all(drop == 0 for _, drop, _ in all_sides(data, effect))


def _places(data: Data, kinematics: int) -> list[Place]:
    return places_with(data, _lacks)


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    shapes = []
    for effect in laws_at(data, place):
        if not _lacks(data, effect):
            continue
        fast = span.tendon_speed[effect.tendon - 1, effect.drive - 1] if effect.tendon else span.speed[effect.drive - 1]
        least = _LEAST * velocity_threshold(data, effect)
        grid = sorted({max(float(fast) * share, least, 1e-9) for share in _OF_SPEED})
        shapes += [{**kind_shape(effect), "stribeck_velocity": velocity} for velocity in grid]
    return shapes


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    path = law_path(place, shape)
    effect = next(each for each in laws_at(data, place) if each.path == path)
    coulomb = max(each for each, _, _ in all_sides(data, effect)) or 1e-6
    numbers = {at: 1.0 for at, _ in law_columns(data, path, ["static"])}
    settings = {path: float(shape["stribeck_velocity"])}
    return Variant(data, shape, (Column(numbers, 1, _EXPECTED * coulomb),), settings=settings)


CANDIDATE = Candidate(
    name="stribeck",
    title="friction is larger when slow",
    explanation=(
        "Friction falls as motion gets faster, before it stays level: the lubricant film builds up. It makes slow "
        "motion jerky. Look at slow motion for stick and slip, and at the surfaces that slide here."
    ),
    sign=1,
    excited_by="slow motion: strokes at speeds from the threshold of motion up to a tenth of the usual speed",
    confused_with=("presliding", "viscous_friction", "time_delay", "backlash"),
    coordinate="velocity",
    unit="1",
    number="static friction beyond the Coulomb friction",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
