"""Whether friction in a joint grows with the forces of all its tendons, where the model has no such part."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.absent_law import absent_law
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant, no_shape
from tendonfmu.diagnosis.effects.friction_law_places import all_joints, law_path

_LOAD = {"load": 1.0}


def _places(data: Data, kinematics: int) -> list[Place]:
    return [place for place in all_joints(data) if data["joints"][(place.joint or 1) - 1].get("load_friction") is None]


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return absent_law(data, law_path(place, _LOAD), shape)


CANDIDATE = Candidate(
    name="joint_load_friction",
    title="the joint's friction grows with the force of all tendons",
    explanation=(
        "The tendons press the joint's bearing together, and its friction grows with the sum of their forces; the "
        "model has no such part. Look at the bearing and at the pretension."
    ),
    sign=1,
    excited_by="strokes of this joint at two or more pretensions",
    confused_with=("load_friction", "edge_friction", "joint_friction", "force_gain"),
    coordinate="load",
    unit="m",
    number="friction torque per force",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
