"""What a page says of numbers of the kinematics that are off."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tendonfmu.diagnosis.cause import ChangedSize
from tendonfmu.diagnosis.effects.words import NBSP, quantity
from tendonfmu.diagnosis.names import ENCODER, ZERO

EXPLANATIONS = {
    ENCODER: (
        "All tendons of this joint agree on another angle than its encoder reads: the encoder's disc or its coupling "
        "has slipped, or it was set to zero in another pose. A description has no number for this: set the "
        'encoder to zero again, or write its offset into the map of columns ("offset" at joint_position).'
    ),
    ZERO: (
        "This tendon's motor reads another position than the joints and the other tendons show: the tendon has "
        "slipped on its drum, was attached again, or its motor lost its count. The extended model has its zero."
    ),
    "moment_arm": (
        "The tendon moves more or less per angle of this joint than described. Measure the pulley's radius and add "
        "half the tendon's thickness; look whether the tendon runs on its pulley. The extended model has the arm."
    ),
    "tendon_nonlinearity": (
        "The tendon stretches more or less under its force than described: another tendon, one that is worn, or the "
        "gain of its force sensor. The extended model has the stiffness."
    ),
    "joint_coupling": (
        "The tendon moves with a joint that it does not pass in the description: it passes beside the joint's axis. "
        "The extended model has the moment arm."
    ),
}


def size_of_all(effect: str, sizes: Sequence[ChangedSize], is_change: bool) -> str:
    """Return the size of a cause in words, the largest first."""
    where = f", at the largest of {len(sizes)} places" if len(sizes) > 1 else ""
    return f"{_size(effect, sizes[0], is_change)}{where}"


def _size(effect: str, size: ChangedSize, is_change: bool) -> str:
    then, now = ("then", "now") if is_change else ("described", "recorded")
    if effect == ENCODER:
        degrees = math.degrees(size.change.value)
        base = "before" if is_change else "the tendons show"
        return f"it reads {abs(degrees):.3g}° {'more' if degrees > 0 else 'less'} than {base}"
    ends = f"{quantity(size.reference.value, size.unit)} {then}, {quantity(size.now.value, size.unit)} {now}"
    if effect == ZERO:
        return f"{quantity(size.change.value, size.unit, sign=True)}: {ends}"
    if not size.reference.value:
        return ends
    return f"{100.0 * size.change.value / size.reference.value:+.2g}{NBSP}%: {ends}".replace("-", "−")
