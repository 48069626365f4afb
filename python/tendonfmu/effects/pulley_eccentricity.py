"""A pulley that turns about a point beside its centre."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.effects.candidate import Candidate, Data, Place, Variant, no_shape
from tendonfmu.effects.extension_row import row_variant
from tendonfmu.effects.friction_law_places import passes, without_rows

NAME = "pulley_eccentricity"


def _places(data: Data, kinematics: int) -> list[Place]:
    return without_rows(data, NAME, list(passes(data)))


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return row_variant(data, NAME, place, shape, {"sine": 0, "cosine": 0})


CANDIDATE = Candidate(
    name=NAME,
    title="a pulley is out of round",
    explanation=(
        "The tendon's lever varies as a sine of the joint's angle: the pulley turns with the joint and its centre "
        "is beside the axis. Measure the run-out of the pulley."
    ),
    sign=0,
    excited_by="slow strokes of this joint over its whole range, the wider the better, at two pretensions",
    confused_with=("moment_arm_variation", "moment_arm", "gravity", "cover_hardening"),
    coordinate="angle",
    unit="m",
    number="distance of the centre from the axis",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
