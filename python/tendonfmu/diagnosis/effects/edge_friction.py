"""Whether a tendon rubs before a joint: at an edge that the model lacks, or at a known edge depending on the angle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.absent_law import absent_law, law_shares
from tendonfmu.diagnosis.effects.candidate import Candidate, Column, Place, Variant
from tendonfmu.diagnosis.effects.description_edit import POINTS, Edit, apply_edits
from tendonfmu.diagnosis.effects.friction_law_places import law_path, passes
from tendonfmu.diagnosis.span import Span
from tendonfmu.model import effects

_NARROW = 0.02  # rad; with less motion of the joint before, the influence of its angle does not show
_FARTHEST = 1e5  # rad; no joint turns this far
_EXPECTED = 0.3  # of the friction, from the middle of the range to its end
_ANGLES = ("angle_low", "angle_middle", "angle_high")


def _edges(data: Data) -> dict[Place, bool]:
    """Return the present edges and whether they have working points."""
    edges = (effect for effect in effects(data) if effect.kind == "edge_friction")
    return {Place(effect.joint, effect.tendon): bool(effect.angles) for effect in edges}


def _places(data: Data, kinematics: int) -> list[Place]:
    edges = _edges(data)
    return [place for place in passes(data) if place not in edges or (not edges[place] and (place.joint or 1) > 1)]


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    if place not in _edges(data):
        return [{}]
    low, high = (float(end) for end in span.angle[(place.joint or 2) - 2])
    if not high - low > _NARROW or max(abs(low), abs(high)) > _FARTHEST:
        return []
    return [dict(zip(_ANGLES, np.linspace(low, high, 3).tolist(), strict=True))]


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    """Return a new law without angles; with angles, the shares by which friction grows at the ends of the range."""
    path = law_path(place, {})
    if not shape:
        return absent_law(data, path, shape)
    edits = (Edit(POINTS, path, tuple(float(shape[key]) for key in _ANGLES)),)
    pointed = apply_edits(data, edits, (), {})
    ends = (law_shares(pointed, f"{path}.laws[{point}]") for point in (1, 3))
    return Variant(data, shape, tuple(Column(numbers, 0, _EXPECTED) for numbers in ends), edits)


CANDIDATE = Candidate(
    name="edge_friction",
    title="a tendon rubs at an edge before a joint",
    explanation=(
        "The tendon bends over an edge or guide where the model has no friction, or where it has friction that "
        "does not depend on how far the joint before bends the tendon. Look at the guide between the joints."
    ),
    sign=1,
    excited_by="strokes of this joint with the joint before at several angles, at two pretensions",
    confused_with=("pulley_friction", "load_friction", "joint_load_friction", "preload_friction", "moment_arm"),
    coordinate="angle",
    unit="1",
    number="share of the tendon force lost",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
