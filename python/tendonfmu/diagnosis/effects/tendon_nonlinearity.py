"""Whether the spring of a tendon is progressive."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Candidate, Place, Variant
from tendonfmu.diagnosis.effects.extension_row import secant_variant
from tendonfmu.diagnosis.effects.friction_law_places import all_tendons, without_rows
from tendonfmu.diagnosis.span import Span

NAME = "tendon_nonlinearity"
_SHARES = (0.01, 0.2)  # hardening·e²/(k·e) at the largest force, e = f/k


def _places(data: Data, kinematics: int) -> list[Place]:
    """Return the tendons if the joint angles come from the tendon positions; otherwise stretch does not matter."""
    return without_rows(data, NAME, all_tendons(data)) if kinematics == 1 else []


def _shapes(data: Data, place: Place, span: Span) -> list[dict[str, float]]:
    tendon = (place.tendon or 1) - 1
    largest = float(abs(span.force[tendon]).max())
    stiffness = float(data["tendons"][tendon]["stiffness"])
    return [{"hardening": share * stiffness**2 / largest} for share in _SHARES] if largest > 0 else []


def _variant(data: Data, place: Place, shape: Mapping[str, float]) -> Variant:
    return secant_variant(data, NAME, place, shape, "hardening", scaled=True)


CANDIDATE = Candidate(
    name=NAME,
    title="a tendon's spring is not linear",
    explanation=(
        "The tendon gets stiffer as it is pulled, so the joint angles that are computed from its stretch are off, "
        "and with them the velocity at each change of force. Pull the tendon against a stop and plot force over "
        "position."
    ),
    sign=1,
    excited_by="changes of the pretension over a wide range while the joints move, with joint encoders beside them",
    confused_with=("presliding", "backlash", "time_delay", "inertia"),
    coordinate="force",
    unit="N/m2",
    number="hardening",
    find_places=_places,
    find_shapes=_shapes,
    make=_variant,
)
