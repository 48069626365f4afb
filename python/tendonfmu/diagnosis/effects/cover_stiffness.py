"""Whether there is a spring at a joint, such as a plastic cover, where the model has none."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Column, Place, Variant, no_shape
from tendonfmu.diagnosis.effects.description_edit import COVER, Edit
from tendonfmu.diagnosis.effects.friction_law_places import all_joints

_ORDINARY = 0.02  # N·m/rad


def _places(data: Data, kinematics: int) -> list[Place]:
    def bends(place: Place) -> bool:
        return bool((data["joints"][(place.joint or 1) - 1].get("cover") or {}).get("stiffness"))

    return [place for place in all_joints(data) if not bends(place)]


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    path = f"joints[{place.joint}]"
    return Variant(data, shape, (Column({f"{path}.cover.stiffness": 1.0}, 1, _ORDINARY),), (Edit(COVER, path),))


CANDIDATE = Candidate(
    name="cover_stiffness",
    title="a spring pulls at the joint",
    explanation=(
        "A torque that grows with the joint's angle, as of a skin, a cover or a bundle of cables that bends with "
        "the joint. Let the joint go without tendon forces and see where it comes to rest."
    ),
    sign=1,
    excited_by="slow strokes of this joint over its whole range",
    confused_with=("gravity", "cover_hardening", "joint_coupling", "moment_arm_variation", "pulley_eccentricity"),
    coordinate="angle",
    unit="N.m/rad",
    number="stiffness",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
