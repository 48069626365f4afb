"""Whether there is friction in a joint itself, where the model has none."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.absent_law import absent_law
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant, no_shape
from tendonfmu.diagnosis.effects.friction_law_places import all_joints, law_path


def _places(data: Data, kinematics: int) -> list[Place]:
    return [place for place in all_joints(data) if data["joints"][(place.joint or 1) - 1].get("friction") is None]


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return absent_law(data, law_path(place, {}), shape)


CANDIDATE = Candidate(
    name="joint_friction",
    title="the joint itself rubs",
    explanation=(
        "Friction in the joint that does not depend on the tendon forces, where the model has none. Look at the "
        "bearing, at seals and at parts that rub against each other when the joint moves without load."
    ),
    sign=1,
    excited_by="strokes of this joint at low pretension",
    confused_with=("preload_friction", "joint_load_friction", "load_friction", "edge_friction"),
    coordinate="velocity",
    unit="N.m",
    number="Coulomb friction",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
