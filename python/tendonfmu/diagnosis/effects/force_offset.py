"""Whether the zero of a force sensor is off."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant, no_shape
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import all_tendons, without_rows

NAME = "force_offset"


def _places(data: Data, kinematics: int) -> list[Place]:
    return without_rows(data, NAME, all_tendons(data))


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return row_variant(data, NAME, place, shape, {"correction": 0})


CANDIDATE = Candidate(
    name=NAME,
    title="a force sensor's zero is off",
    explanation=(
        "The true force of this tendon is the measured one plus a constant. A constant torque looks like the bias, "
        "which takes it up: take all load off the tendon and read the sensor."
    ),
    sign=0,
    excited_by="nothing that moves: unload the tendon and read its sensor",
    confused_with=("gravity", "asymmetric_friction", "force_gain"),
    coordinate="force",
    unit="N",
    number="offset of the force",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
