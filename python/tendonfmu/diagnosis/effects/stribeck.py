"""Whether friction near standstill differs from that of the law, where the law has static equal to coulomb.

- Larger friction is the law's own `static`.
- Smaller friction, which rises from rest with speed, is a row of `extensions`, because a law needs static >= coulomb.
  It is proposed in joints whose law has viscous friction, the simpler of the two.
"""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Column, Place, Variant
from tendonfmu.diagnosis.effects.description_edit import law_columns
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import (
    all_sides,
    kind_shape,
    law_path,
    laws_at,
    places_with,
    row_places,
)
from tendonfmu.diagnosis.span import Span
from tendonfmu.model import Effect, velocity_threshold

NAME = "stribeck"
_OF_SPEED = (0.03, 0.1, 0.3)  # Stribeck velocities, of the 95 % speed
_LEAST = 1.0  # of the threshold of motion: a smaller velocity leaves nothing of the effect during motion
_EXPECTED = 0.25  # of the Coulomb friction
_LEAST_AMPLITUDE = -0.95  # of a row: friction does not change its sign


def _lacks(data: Data, effect: Effect) -> bool:
    return all(drop == 0 for _, drop, _ in all_sides(data, effect))


def _can_rise(data: Data, effect: Effect) -> bool:
    """Return whether a row may let the friction of this joint rise from rest."""
    thick = all(viscous > 0 for _, _, viscous in all_sides(data, effect))
    return not effect.tendon and thick and Place(joint=effect.joint) not in row_places(data, NAME)


def _places(data: Data, kinematics: int) -> list[Place]:
    taken = row_places(data, NAME)
    return [place for place in places_with(data, _lacks) if place not in taken]


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    shapes: list[dict[str, float]] = []
    for effect in laws_at(data, place):
        if not _lacks(data, effect):
            continue
        fast = span.tendon_speed[effect.tendon - 1, effect.drive - 1] if effect.tendon else span.speed[effect.drive - 1]
        least = _LEAST * velocity_threshold(data, effect)
        grid = sorted({max(float(fast) * share, least, 1e-9) for share in _OF_SPEED})
        shapes += [{**kind_shape(effect), "stribeck_velocity": velocity} for velocity in grid]
        if _can_rise(data, effect) and effect == laws_at(data, place)[0]:
            shapes += [{"rises": 1.0, "stribeck_velocity": velocity} for velocity in grid]
    return shapes


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    if shape.get("rises"):
        velocity = {"stribeck_velocity": float(shape["stribeck_velocity"])}
        return row_variant(data, NAME, place, shape, {"amplitude": -1}, velocity, _LEAST_AMPLITUDE)
    path = law_path(place, shape)
    effect = next(law for law in laws_at(data, place) if law.path == path)
    coulomb = max(side for side, _, _ in all_sides(data, effect)) or 1e-6
    numbers = {at: 1.0 for at, _ in law_columns(data, path, ["static"])}
    settings = {path: float(shape["stribeck_velocity"])}
    return Variant(data, shape, (Column(numbers, 1, _EXPECTED * coulomb),), settings=settings)


CANDIDATE = Candidate(
    name="stribeck",
    title="friction is different when slow",
    explanation=(
        "Friction falls as motion gets faster, before it stays level: the lubricant film builds up, and slow motion is "
        "jerky. Or it rises from standstill, as in rolling screws. Look at slow motion for stick and slip."
    ),
    sign=0,
    excited_by="slow motion: strokes at speeds from the threshold of motion up to a tenth of the usual speed",
    confused_with=("presliding", "viscous_friction", "time_delay", "backlash"),
    coordinate="velocity",
    unit="1",
    number="friction near standstill beyond that of faster motion",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
