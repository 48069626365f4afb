"""Whether the gain of a force sensor is off."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant, no_shape
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import all_tendons, without_rows

NAME = "force_gain"
_LEAST = -0.9  # of the gain; at −1 there would be no force


def _places(data: Data, kinematics: int) -> list[Place]:
    return without_rows(data, NAME, all_tendons(data))


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return row_variant(data, NAME, place, shape, {"correction": 0}, least=_LEAST)


CANDIDATE = Candidate(
    name=NAME,
    title="a force sensor's gain is off",
    explanation=(
        "The true force of this tendon is larger or smaller than the measured one by a constant factor. Hang a "
        "known weight on the tendon and compare."
    ),
    sign=0,
    excited_by="slow changes of the pretension with the joints at rest, and motion at several tensions",
    confused_with=("moment_arm", "edge_friction", "moment_arm_variation", "load_friction"),
    coordinate="force",
    unit="1",
    number="correction of the gain",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
