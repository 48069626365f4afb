"""Whether there is play before a position passes on."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant
from tendonfmu.diagnosis.effects.extension_row import secant_variant
from tendonfmu.diagnosis.effects.friction_law_places import all_joints, all_tendons, without_rows
from tendonfmu.diagnosis.span import Span

NAME = "backlash"
_OF_RANGE = (0.0006, 0.005, 0.03)  # widths, of the range of the position; the smallest serves as a derivative


def _places(data: Data, kinematics: int) -> list[Place]:
    """Return joints, and tendons if their positions are used."""
    tendons = all_tendons(data) if kinematics == 1 else []
    joints = all_joints(data) if kinematics != 3 else []
    return without_rows(data, NAME, joints + tendons)


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    at_joint = place.joint is not None
    low, high = span.angle[(place.joint or 1) - 1] if at_joint else span.position[(place.tendon or 1) - 1]
    return [{"width": share * float(high - low)} for share in _OF_RANGE] if high > low else []


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return secant_variant(data, NAME, place, shape, "width", scaled=True)


CANDIDATE = Candidate(
    name=NAME,
    title="play before motion passes on",
    explanation=(
        "After a reversal the measured position moves on for a short way before the joint follows: a loose gear, "
        "coupling or tendon fixing. Rock the drive to and fro by a little and see whether the joint follows."
    ),
    sign=1,
    excited_by="many small reversals, with travels around the play's width",
    confused_with=("presliding", "time_delay", "tendon_nonlinearity", "stribeck"),
    coordinate="travel",
    unit="m or rad",
    number="width of the play",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
