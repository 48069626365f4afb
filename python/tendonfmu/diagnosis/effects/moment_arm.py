"""Whether a moment arm differs from the description."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant, no_shape
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import passes, without_rows

NAME = "moment_arm"


def _places(data: Data, kinematics: int) -> list[Place]:
    return without_rows(data, NAME, list(passes(data)))


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return row_variant(data, NAME, place, shape, {"correction": 0})


CANDIDATE = Candidate(
    name=NAME,
    title="a moment arm is off",
    explanation=(
        "The tendon pulls at this joint with a longer or shorter lever than described. Measure the pulley's radius "
        "and add half the tendon's thickness."
    ),
    sign=0,
    excited_by="slow changes of this tendon's force with the joint at rest, at several pretensions",
    confused_with=("force_gain", "edge_friction", "moment_arm_variation", "pulley_eccentricity"),
    coordinate="force",
    unit="m",
    number="correction of the moment arm",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
