"""Whether the spring of a cover has a cubic part."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant, no_shape
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import all_joints, without_rows

NAME = "cover_hardening"


def _places(data: Data, kinematics: int) -> list[Place]:
    return without_rows(data, NAME, all_joints(data))


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return row_variant(data, NAME, place, shape, {"stiffness": 1})


CANDIDATE = Candidate(
    name=NAME,
    title="the cover stiffens as it bends",
    explanation=(
        "The spring at this joint is not linear: far from its rest angle it pulls more than in proportion, as "
        "folded plastic or a cable near its end does. Look at the cover at both ends of the joint's range."
    ),
    sign=1,
    excited_by="slow strokes of this joint up to both ends of its range",
    confused_with=("cover_stiffness", "gravity", "pulley_eccentricity", "moment_arm_variation"),
    coordinate="angle",
    unit="N.m/rad3",
    number="cubic stiffness",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
