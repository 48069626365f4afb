"""Whether a tendon rubs at the pulley of a joint, where the model has no friction."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.absent_law import absent_law
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant, no_shape
from tendonfmu.diagnosis.effects.friction_law_places import law_path, passes
from tendonfmu.model import effects

_PULLEY = {"pulley": 1.0}


def _places(data: Data, kinematics: int) -> list[Place]:
    present = {(effect.joint, effect.tendon) for effect in effects(data) if effect.kind == "pulley_friction"}
    reached = list(passes(data))
    return [
        place
        for place, after in pairwise(reached)
        if place.tendon == after.tendon and (place.joint, place.tendon) not in present
    ]


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return absent_law(data, law_path(place, _PULLEY), shape)


CANDIDATE = Candidate(
    name="pulley_friction",
    title="a pulley turns with friction",
    explanation=(
        "The tendon loses force at the pulley of this joint when it moves on to the joints beyond, and the model "
        "has no friction there. Look at the pulley's bearing and at whether the tendon slides on it."
    ),
    sign=1,
    excited_by="strokes of the joints beyond this one, with this joint at rest, at two pretensions",
    confused_with=("edge_friction", "load_friction", "preload_friction"),
    coordinate="velocity",
    unit="1",
    number="share of the tendon force lost",
    find_places=_places,
    find_shapes=no_shape,
    make=_variant,
)
