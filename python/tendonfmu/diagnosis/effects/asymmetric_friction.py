"""Whether friction differs between the two directions, where the law is the same for both."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Column, Place, Variant
from tendonfmu.diagnosis.effects.description_edit import SIDES, Edit, apply_edits, law_columns, magnitudes_of, sides_at
from tendonfmu.diagnosis.effects.friction_law_places import is_asymmetric, kind_shape, law_path, laws_at, places_with
from tendonfmu.diagnosis.span import Span
from tendonfmu.model import Effect

_EXPECTED = 0.2  # of the friction, from one direction to the other


def _lacks(data: Data, effect: Effect) -> bool:
    return not is_asymmetric(effect)


def _places(data: Data, kinematics: int) -> list[Place]:
    return places_with(data, _lacks)


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    return [kind_shape(effect) for effect in laws_at(data, place) if _lacks(data, effect)]


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    """Return the variant; its magnitude is the difference between the directions in shares of the law."""
    path = law_path(place, shape)
    edits = (Edit(SIDES, path),)
    split = apply_edits(data, edits, (), {})
    dry: dict[str, float] = {}
    viscous: dict[str, float] = {}
    values = [magnitudes_of(side) for side in sides_at(split, path)]
    paths = [at for at, _ in law_columns(split, path, ["coulomb"])]
    for at, (coulomb, drop, thick) in zip(paths, values, strict=True):
        law, half = at.rsplit(".", 1)[0], 0.5 if ".positive." in at else -0.5
        dry |= {f"{law}.coulomb": half * coulomb} | ({f"{law}.static": half * drop} if drop else {})
        viscous |= {f"{law}.viscous": half * thick} if thick else {}
    columns = tuple(Column(numbers, 0, _EXPECTED) for numbers in (dry, viscous) if numbers)
    return Variant(data, shape, columns, edits)


CANDIDATE = Candidate(
    name="asymmetric_friction",
    title="friction differs between the directions",
    explanation=(
        "Moving one way costs more than moving the other way. Look for a worn or fouled flank, a preload in a "
        "screw or gear, a tendon that rubs at one edge in one direction only."
    ),
    sign=0,
    excited_by="the same strokes there and back, with pauses, at several speeds",
    confused_with=("force_offset", "gravity", "moment_arm", "cover_stiffness"),
    coordinate="velocity",
    unit="1",
    number="difference between the directions, in shares of the friction",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
