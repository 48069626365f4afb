"""Whether friction in a joint grows with the force of one tendon."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant, no_shape
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import passes, without_rows

NAME = "load_friction"


def _places(data: Data, kinematics: int) -> list[Place]:
    return without_rows(data, NAME, list(passes(data)))


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return row_variant(data, NAME, place, shape, {"coulomb": 1})


CANDIDATE = Candidate(
    name=NAME,
    title="friction grows with the force of a tendon",
    explanation=(
        "Friction in the joint that the model has constant, or shares out among all tendons alike, grows with the "
        "force of this tendon. Look at the bearing on the side of this tendon and at the pretension."
    ),
    sign=1,
    excited_by="strokes of this joint at two or more loads of this tendon",
    confused_with=("joint_load_friction", "edge_friction", "pulley_friction", "joint_friction", "force_gain"),
    coordinate="force",
    unit="m",
    number="friction torque per force",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
