"""Whether the weight of the link that a joint turns is missing."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant, no_shape
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import all_joints, without_rows

NAME = "gravity"


def _places(data: Data, kinematics: int) -> list[Place]:
    return without_rows(data, NAME, all_joints(data))


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return row_variant(data, NAME, place, shape, {"sine": 0, "cosine": 0})


CANDIDATE = Candidate(
    name=NAME,
    title="the link's weight",
    explanation=(
        "A torque that varies with the sine and cosine of the link's angle, at this joint and at those before it: "
        "the weight of what this joint turns. Turn the hand and see whether it changes."
    ),
    sign=0,
    excited_by="slow strokes over the whole range, then the same with the hand turned by 90 degrees",
    confused_with=("cover_stiffness", "cover_hardening", "pulley_eccentricity", "moment_arm_variation"),
    coordinate="angle",
    unit="N.m",
    number="weight times lever",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
