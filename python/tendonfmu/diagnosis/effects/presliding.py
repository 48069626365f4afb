"""Whether friction builds up over a distance after each reversal."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant
from tendonfmu.diagnosis.effects.extension_row import secant_variant
from tendonfmu.diagnosis.effects.friction_law_places import row_places, rubbing_joints, rubbing_tendons, thresholds
from tendonfmu.diagnosis.span import Span

NAME = "presliding"
EVERYWHERE = Place()
OF_TRAVEL = (0.002, 0.008, 0.03, 0.12)  # distances that are tried, of the median travel between reversals
LONGEST = 0.1  # of the median travel between reversals: friction that builds up over more is a spring
_TIMES = (0.3, 3.0)  # distances at one place, times the distance everywhere
_SLOWEST = 1e-9  # m/s or rad/s: a threshold of 0 has no scale


def _single_places(data: Data) -> list[Place]:
    return [*rubbing_joints(data), *rubbing_tendons(data)]


def _places(data: Data, kinematics: int) -> list[Place]:
    """Return everywhere if no place has presliding, else the single places without it."""
    taken = row_places(data, NAME)
    if not taken:
        return [EVERYWHERE] if _single_places(data) and min(thresholds(data)) > _SLOWEST else _single_places(data)
    return [place for place in _single_places(data) if place not in taken]


def _travel(place: Place, span: Span) -> float:
    if place.joint is not None:
        return float(span.travel[place.joint - 1])
    return float(span.tendon_travel[(place.tendon or 1) - 1])


def _threshold(data: Data, place: Place) -> float:
    tendon, joint = thresholds(data)
    return joint if place.joint is not None else tendon


def usual_time(data: Data, span: Span) -> float:
    """Return the travel between reversals over the threshold of motion, s: the median over the places with friction."""
    times = [_travel(place, span) / max(_threshold(data, place), _SLOWEST) for place in _single_places(data)]
    return float(np.median([time for time in times if time > 0] or [0.0]))


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    """Return the grid: everywhere in s, which is multiplied by the threshold of motion; at a place in m or rad."""
    if place == EVERYWHERE:
        usual = usual_time(data, span)
        return [{"displacement": share * usual} for share in OF_TRAVEL] if usual > 0 else []
    everywhere = next((row for row in data.get("extensions") or [] if is_everywhere(row)), None)
    if everywhere is not None:
        present = float(everywhere["displacement"]) * _threshold(data, place)
        return [{"displacement": factor * present} for factor in _TIMES]
    travel = _travel(place, span)
    return [{"displacement": share * travel} for share in OF_TRAVEL[1:]] if travel > 0 else []


def is_spring(data: Data, span: Span) -> bool:
    """Return whether some presliding of a fitted description is so long that it stands for a spring."""
    for row in data.get("extensions") or []:
        if row["effect"] == NAME:
            place = Place(row.get("joint"), row.get("tendon"))
            travel = usual_time(data, span) if is_everywhere(row) else _travel(place, span)
            if float(row["displacement"]) > LONGEST * travel > 0.0:
                return True
    return False


def is_everywhere(row: Mapping[str, object]) -> bool:
    """Return whether a row of `extensions` is presliding at all places."""
    return row["effect"] == NAME and row.get("joint") is None and row.get("tendon") is None


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return secant_variant(data, NAME, place, shape, "displacement", scaled=False, only_joint=place.joint)


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
