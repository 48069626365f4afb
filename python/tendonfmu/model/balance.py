"""Which tendon forces carry the friction of a motion.

In quasi-static balance Rᵀ f0 = T (eq. 12): the forces are a pretension that balances itself, and what carries friction.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.model import native
from tendonfmu.model.description import Finger
from tendonfmu.model.description_numbers import number_of
from tendonfmu.model.friction_places import moment_arms

LEAST_SHARE = 0.05  # of the mean; keeps every pulling tendon taut
_SWEEPS = 20000
_ITERATIONS = 8  # each reduces the error to the share of the force that friction takes, some percent


def pretension_vector(data: Mapping[str, Any]) -> Numbers:
    """Return the tendon forces [m] per newton of pretension."""
    arms = moment_arms(data)
    pulls = np.array([not tendon.get("bidirectional") for tendon in data["tendons"]])
    project = np.eye(len(arms)) - arms @ np.linalg.pinv(arms)
    shares = project @ np.ones(len(arms))
    least = np.where(pulls, LEAST_SHARE, -np.inf)
    correction = np.zeros(len(arms))
    for _ in range(_SWEEPS):
        if np.all(shares >= least * (1 - 1e-9)):
            break
        allowed = np.maximum(shares + correction, least)
        correction += shares - allowed
        shares = project @ allowed
    else:
        raise InputError(
            "tendons: no balanced pretension; expected moment arms with a solution of "
            "Rᵀ f = 0 in which every tendon pulls"
        )
    mean = float(np.mean(shares))
    return shares / mean if mean > 1e-9 else np.zeros(len(arms))


def friction_probe(finger: Finger) -> native.Instance:
    """Make a finger that computes the friction model only."""
    probe = finger.steady.instance(3)
    probe.set({"bias.forget_rate": number_of(finger.data, "bias.forget_rate")})
    return probe


def balanced_forces(described: Finger, motion: Mapping[str, Numbers], pretension: Numbers) -> Numbers:
    """Return the tendon forces that carry the friction of a motion: f0 = pretension·ν + (Rᵀ)⁺ T(f0)."""
    # T is eq. (10) of everything that slides, cover included. Sticking places add nothing, since their share is
    # unknown.
    # motion: [N] (s); pretension: [N] (N); returns tendon forces [N, m] (N)
    data, finger = described.data, friction_probe(described)
    start = finger.save_state()
    spread = np.linalg.pinv(moment_arms(data))
    internal = np.outer(pretension, pretension_vector(data)) if pretension.ndim == 1 else pretension
    forces = internal
    for _ in range(_ITERATIONS):
        finger.restore_state(start)
        outputs = finger.run({**motion, "tendon_force": forces})
        forces = internal + (outputs["friction_torque"] - outputs["bias_torque"]) @ spread
    return np.asarray(forces)
