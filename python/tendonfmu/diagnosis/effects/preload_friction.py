"""Whether a tendon has friction that does not scale with its force."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import passes, row_places, without_rows
from tendonfmu.diagnosis.span import Span

NAME = "preload_friction"


def _places(data: Data, kinematics: int) -> list[Place]:
    """Return each joint that the tendon reaches, unless a row says that the tendon rubs before all of them."""
    everywhere = row_places(data, NAME)
    return [
        place for place in without_rows(data, NAME, list(passes(data))) if Place(tendon=place.tendon) not in everywhere
    ]


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    """Return the forms: the joints beyond feel the friction, too; if there are some, also that they do not."""
    arms = data["tendons"][(place.tendon or 1) - 1]["moment_arms"]
    return [{}, {"beyond": 0.0}] if any(arms[place.joint or 0 :]) else [{}]


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return row_variant(data, NAME, place, shape, {"coulomb": 1}, shape)


CANDIDATE = Candidate(
    name=NAME,
    title="a tendon rubs however little it pulls",
    explanation=(
        "The tendon loses the same force at every tension, as in a seal, a tight sheath or a clamped guide. Look "
        "at whether friction remains without pretension."
    ),
    sign=1,
    excited_by="the same strokes at pretensions as different as the hand allows, the lowest first of all",
    confused_with=("joint_friction", "edge_friction", "pulley_friction", "load_friction"),
    coordinate="force",
    unit="N",
    number="friction force",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
