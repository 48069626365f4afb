"""Whether a pulley turns about a point beside its centre."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant
from tendonfmu.diagnosis.effects.extension_row import row_variant
from tendonfmu.diagnosis.effects.friction_law_places import passes, without_rows
from tendonfmu.diagnosis.span import Span

NAME = "pulley_eccentricity"
MOST_TURNS = 12.0  # of a pulley that the tendon turns, per turn of the joint: arm over radius
_APART = 2.0  # rad, over the joint's range, between neighbours in the grid: halfway both fit well
_MOST_SHAPES = 60  # a joint that turns many times, or angles that the arms do not determine, would ask for millions
_FEWEST = 1.5 * 2.0 * np.pi  # rad, over the joint's range, of a fast pulley: less looks like any function


def _places(data: Data, kinematics: int) -> list[Place]:
    return without_rows(data, NAME, list(passes(data)))


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    """Return the forms: the pulley turns with the joint, or so much faster that it makes more than one turn."""
    low, high = span.angle[(place.joint or 1) - 1]
    reach = max(float(high - low), _APART / MOST_TURNS)
    first = _FEWEST / reach
    fast = np.arange(first, MOST_TURNS, max(_APART / reach, (MOST_TURNS - first) / _MOST_SHAPES))
    return [{"turns": float(turns)} for turns in (1.0, *fast)]


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    turns = {} if shape["turns"] == 1.0 else dict(shape)
    return row_variant(data, NAME, place, shape, {"sine": 0, "cosine": 0}, turns)


CANDIDATE = Candidate(
    name=NAME,
    title="a pulley is out of round",
    explanation=(
        "The tendon's lever varies as a sine of the pulley's angle: its centre is beside its axis. Measure the run-out "
        "of the pulley."
    ),
    sign=0,
    excited_by="slow strokes of this joint over its whole range, the wider the better, at two pretensions",
    confused_with=("moment_arm_variation", "moment_arm", "gravity", "cover_hardening"),
    coordinate="angle",
    unit="m",
    number="distance of the centre from the axis",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
