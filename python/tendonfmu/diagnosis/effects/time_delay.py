"""Whether forces and positions are of different times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant
from tendonfmu.diagnosis.effects.extension_row import secant_variant
from tendonfmu.diagnosis.effects.friction_law_places import without_rows
from tendonfmu.diagnosis.span import Span
from tendonfmu.model import EFFECT_NUMBERS

NAME = "time_delay"
_DELAYS = (0.002, 0.01)  # s; larger delays are scanned for (starting_point.py)
_LONGEST = EFFECT_NUMBERS[NAME]["delay"].most  # s
_LEAST_STEPS, _MOST_STEPS = 0.5, 60.0  # samples: the smallest visible delay, and what the model remembers


def _places(data: Data, kinematics: int) -> list[Place]:
    return without_rows(data, NAME, [Place()])


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    longest = min(_LONGEST, _MOST_STEPS * span.step)
    grid = sorted({min(max(delay, _LEAST_STEPS * span.step), longest) for delay in _DELAYS})
    return [{"delay": sign * delay} for delay in grid for sign in (1, -1)]


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    """Return the variant; its column is the effect of a delay on forces that the model explains."""
    # At a reversal the two differ in the sign of the time since.
    variant = secant_variant(data, NAME, place, shape, "delay", scaled=True, most=_LONGEST)
    return replace(variant, late=float(shape["delay"]))


CANDIDATE = Candidate(
    name=NAME,
    title="forces and positions are not of the same time",
    explanation=(
        "The measured forces come later than the positions, or earlier where the delay is negative: filters, bus "
        "cycles, or clocks that differ. Look at how the two signals are sampled and filtered."
    ),
    sign=0,
    excited_by="many quick reversals at different speeds",
    confused_with=("inertia", "presliding", "backlash", "stribeck", "viscous_friction"),
    coordinate="acceleration",
    unit="s",
    number="delay",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
