"""Which tendon forces keep a finger in quasi-static balance, with and without motion (eq. 12: Rᵀ f0 = T).

These are the pretension that balances itself, and the forces that carry the friction of a motion.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.model import native

LEAST_SHARE = 0.05  # of the mean; keeps every pulling tendon taut
_SWEEPS = 20000
_ITERATIONS = 8  # each reduces the error to the share of the force that friction takes, some percent
_NEVER = 1e9  # N·m; no contact threshold is ever passed


def moment_arms(data: Mapping[str, Any]) -> Numbers:
    """Return the routing matrix R of a description."""
    # returns [m, n] (m)
    return np.array([tendon["moment_arms"] for tendon in data["tendons"]], dtype=float)


def pretension_vector(data: Mapping[str, Any]) -> Numbers:
    """Return the tendon forces per newton of pretension."""
    # returns [m]
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


def friction_probe(data: Mapping[str, Any]) -> native.Instance:
    """Make a finger that computes the friction model only."""
    bias = {"drift_variance": 0.0, "initial_variance": 0.0, "initial_torque": [0.0] * len(data["joints"])}
    for key in ("noise_std", "noise_std_per_force", "forget_rate", "noise_time"):
        if (data.get("bias") or {}).get(key) is not None:
            bias[key] = data["bias"][key]
    contact = {"threshold": [_NEVER] * len(data["joints"])}
    probe = {**data, "bias": bias, "contact": contact, "sensor_fault": None}
    return native.Instance(native.image_from_json(json.dumps(probe)), kinematics_source=3)


def balanced_forces(data: Mapping[str, Any], motion: Mapping[str, Numbers], pretension: Numbers) -> Numbers:
    """Return the tendon forces that carry the friction of a motion: f0 = pretension·ν + (Rᵀ)⁺ T(f0)."""
    # T is eq. (10) of everything that slides, cover included. Sticking places add nothing, since their share is
    # unknown.
    # motion: [N] (s); pretension: [N] (N); returns tendon forces [N, m] (N)
    finger = friction_probe(data)
    start = finger.save_state()
    spread = np.linalg.pinv(moment_arms(data))
    internal = np.outer(pretension, pretension_vector(data)) if pretension.ndim == 1 else pretension
    forces = internal
    for _ in range(_ITERATIONS):
        finger.restore_state(start)
        outputs = finger.run({**motion, "tendon_force": forces})
        forces = internal + (outputs["friction_torque"] - outputs["bias_torque"]) @ spread
    return np.asarray(forces)
