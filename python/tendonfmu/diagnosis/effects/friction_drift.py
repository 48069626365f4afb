"""Whether friction changes in the course of time."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import rubbing_joints, rubbing_tendons, without_rows
from tendonfmu.diagnosis.span import Span

NAME = "friction_drift"
_OF_DURATION = (0.1, 0.6)  # time constants
_LEAST = -0.85  # of the friction


def _places(data: Data, kinematics: int) -> list[Place]:
    """Return each joint and tendon with friction, and everywhere if there are several."""
    places = [*rubbing_joints(data), *rubbing_tendons(data)]
    return without_rows(data, NAME, ([Place()] if len(places) > 1 else []) + places)


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    return [{"time_constant": share * span.duration} for share in _OF_DURATION if span.duration > 0]


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return row_variant(data, NAME, place, shape, {"amplitude": 0}, shape, _LEAST)


CANDIDATE = Candidate(
    name=NAME,
    title="friction changes as time goes by",
    explanation=(
        "All friction here grows or fades by a share in the course of the recording: warming up, running in, or "
        "lubricant that is squeezed out. Compare the same motion at the start and at the end."
    ),
    sign=0,
    excited_by="the same strokes at the start and at the end of a long recording, after a rest",
    confused_with=("viscous_friction", "load_friction", "force_gain"),
    coordinate="time",
    unit="1",
    number="change of the friction, as a share",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
