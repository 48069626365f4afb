"""Whether there is a spring between a joint and the next one."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import all_joints, without_rows
from tendonfmu.diagnosis.span import Span

NAME = "joint_coupling"


def _places(data: Data, kinematics: int) -> list[Place]:
    return without_rows(data, NAME, all_joints(data)[:-1])


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    """Return two forms: the next joint feels the spring, too, or it does not."""
    return [{}, {"reaction": 0.0}]


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return row_variant(data, NAME, place, shape, {"stiffness": 0}, shape)


CANDIDATE = Candidate(
    name=NAME,
    title="this joint and the next pull at each other",
    explanation=(
        "A spring between this joint and the next one, which pulls when their angles differ: a shared cover, a "
        "cable or a linkage. Below 0 it pulls at the sum of the angles, as a strap across both joints does. Move one "
        "joint by hand and see whether the other one follows."
    ),
    sign=0,
    excited_by="strokes of this joint and the next one by turns, so that their angles differ",
    confused_with=("cover_stiffness", "gravity", "moment_arm"),
    coordinate="angle",
    unit="N.m/rad",
    number="stiffness",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
