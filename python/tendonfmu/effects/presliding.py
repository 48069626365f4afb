"""Friction that builds up over a distance after each reversal."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.diagnosis_span import Span
from tendonfmu.effects.candidate import Candidate, Data, Place, Variant
from tendonfmu.effects.extension_row import secant_variant
from tendonfmu.effects.friction_law_places import row_places, rubbing_joints, rubbing_tendons

NAME = "presliding"
EVERYWHERE = Place()
_OF_TRAVEL = (0.006, 0.03, 0.12)  # displacements, of the median distance between reversals


def _single_places(data: Data) -> list[Place]:
    return [*rubbing_joints(data), *rubbing_tendons(data)]


def _places(data: Data, kinematics: int) -> list[Place]:
    """Each joint and tendon with friction; and all of them at once, where there are several and none has it."""
    taken = row_places(data, NAME)
    places = _single_places(data)
    everywhere = [EVERYWHERE] if len(places) > 1 and not taken else []
    return everywhere + [place for place in places if place not in taken]


def _travel(place: Place, span: Span) -> float:
    if place.joint is not None:
        return float(span.travel[place.joint - 1])
    return float(span.tendon_travel[(place.tendon or 1) - 1])


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    """Everywhere: the same share of the travel of each joint and tendon."""
    if place == EVERYWHERE:
        travels = {_key(each): _travel(each, span) for each in _single_places(data)}
        return [{key: share * travel for key, travel in travels.items() if travel > 0} for share in _OF_TRAVEL]
    travel = _travel(place, span)
    return [{"displacement": share * travel} for share in _OF_TRAVEL] if travel > 0 else []


def _key(place: Place) -> str:
    return f"joints[{place.joint}]" if place.joint is not None else f"tendons[{place.tendon}]"


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    if place != EVERYWHERE:
        return secant_variant(data, NAME, place, shape, "displacement", scaled=False, only_joint=place.joint)
    singles = [(each, shape[_key(each)]) for each in _single_places(data) if _key(each) in shape]
    rows = [
        secant_variant(data, NAME, each, {"displacement": value}, "displacement", scaled=False).secant_rows[0]
        for each, value in singles
    ]
    return Variant(data, shape, secant_rows=tuple(rows))


CANDIDATE = Candidate(
    name=NAME,
    title="friction builds up over a short way after each reversal",
    explanation=(
        "After a reversal friction does not jump but grows over a short travel, because the surfaces and the "
        "tendon deform before they slide. Look at the torque against the travel since the reversal."
    ),
    sign=1,
    excited_by="many small reversals at low speed, with travels around the distance over which friction builds up",
    confused_with=("backlash", "stribeck", "time_delay", "tendon_nonlinearity"),
    coordinate="travel",
    unit="m or rad",
    number="displacement",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
