"""Which effects a diagnosis knows: one module each, in the order of docs/reference/commands/diagnose.md.

`contact` and `unknown` are no terms of a model. They stand for an event in the recording and for what is left.
"""

from __future__ import annotations

from tendonfmu.diagnosis.effects import (
    asymmetric_friction,
    backlash,
    cover_hardening,
    cover_stiffness,
    edge_friction,
    force_gain,
    force_offset,
    friction_drift,
    gravity,
    inertia,
    joint_coupling,
    joint_friction,
    joint_load_friction,
    load_friction,
    moment_arm,
    moment_arm_variation,
    preload_friction,
    presliding,
    pulley_eccentricity,
    pulley_friction,
    stribeck,
    tendon_nonlinearity,
    time_delay,
    viscous_friction,
)
from tendonfmu.diagnosis.effects.candidate import Candidate, Column, Place, Variant
from tendonfmu.errors import InputError

CANDIDATES: tuple[Candidate, ...] = tuple(
    module.CANDIDATE
    for module in (
        viscous_friction,
        stribeck,
        asymmetric_friction,
        edge_friction,
        pulley_friction,
        joint_friction,
        joint_load_friction,
        preload_friction,
        load_friction,
        cover_stiffness,
        cover_hardening,
        gravity,
        inertia,
        presliding,
        friction_drift,
        force_gain,
        force_offset,
        time_delay,
        moment_arm,
        moment_arm_variation,
        pulley_eccentricity,
        tendon_nonlinearity,
        joint_coupling,
        backlash,
    )
)

__all__ = ["CANDIDATES", "Candidate", "Column", "Place", "Variant", "by_name"]


def by_name(name: str) -> Candidate:
    """Return the candidate of an effect of docs/reference/commands/diagnose.md."""
    for candidate in CANDIDATES:
        if candidate.name == name:
            return candidate
    names = ", ".join(candidate.name for candidate in CANDIDATES)
    raise InputError(f"effect {name!r}: no candidate of this name; expected one of {names}")
