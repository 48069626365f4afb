"""Whether a moment arm changes with the joint's angle."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant, no_shape
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import passes, without_rows

NAME = "moment_arm_variation"


def _places(data: Data, kinematics: int) -> list[Place]:
    return without_rows(data, NAME, list(passes(data)))


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return row_variant(data, NAME, place, shape, {"slope": 0})


CANDIDATE = Candidate(
    name=NAME,
    title="a moment arm changes with the angle",
    explanation=(
        "The tendon's lever at this joint grows or shrinks as the joint bends, as where it lifts off its pulley. "
        "Watch the tendon's line at both ends of the joint's range."
    ),
    sign=0,
    excited_by="slow strokes of this joint over its whole range, at two pretensions",
    confused_with=("pulley_eccentricity", "cover_stiffness", "gravity", "moment_arm"),
    coordinate="angle",
    unit="m/rad",
    number="change of the moment arm per angle",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
