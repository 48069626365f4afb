"""Whether the torque that accelerates a joint is missing."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant, no_shape
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import all_joints, without_rows

NAME = "inertia"


def _places(data: Data, kinematics: int) -> list[Place]:
    return without_rows(data, NAME, all_joints(data))


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return row_variant(data, NAME, place, shape, {"inertia": 0})


CANDIDATE = Candidate(
    name=NAME,
    title="the link's inertia",
    explanation=(
        "A torque in proportion to the joint's acceleration: the link's mass, or a motor's that is geared to it. "
        "It is negative if too much inertia was subtracted with a known load."
    ),
    sign=0,
    excited_by="fast starts and stops of this joint, with the same travel at different accelerations",
    confused_with=("time_delay", "viscous_friction", "tendon_nonlinearity"),
    coordinate="acceleration",
    unit="kg.m2",
    number="moment of inertia",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
