"""Tendon forces of a finger in quasi-static balance: the pretension that holds itself, and the forces that carry the
friction of a motion (eq. 12: Rᵀ f0 = T).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.model import native

Numbers = NDArray[np.float64]

LEAST_SHARE = 0.05  # of the mean: every pulling tendon stays taut
_SWEEPS = 20000
_ITERATIONS = 8  # each gains the share of the force that friction takes, some percent
_NEVER = 1e9  # N·m; no contact threshold is ever passed


def moment_arms(data: Mapping[str, Any]) -> Numbers:
    """[m, n] routing matrix R of a valid description, m."""
    return np.array([tendon["moment_arms"] for tendon in data["tendons"]], dtype=float)


def pretension_vector(data: Mapping[str, Any]) -> Numbers:
    """[m] tendon forces per newton of pretension: Rᵀ ν = 0, mean 1, as even as that allows (nearest to ones).

    Every tendon that only pulls gets at least `LEAST_SHARE` of the mean. All zeros for a finger of cable loops alone
    that cannot be pretensioned. Raises InputError where pulling tendons cannot hold each other.
    Method: Dykstra's alternating projections onto the null space and the allowed shares.
    """
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
            "tendons: no pretension holds itself in balance; expected moment arms with a solution of "
            "Rᵀ f = 0 in which every tendon pulls"
        )
    mean = float(np.mean(shares))
    return shares / mean if mean > 1e-9 else np.zeros(len(arms))


def friction_probe(data: Mapping[str, Any]) -> native.Finger:
    """A finger whose `friction_torque` and `bias_torque` hold the model alone: no tracking, no contact, q and q̇ as
    given. The bias then moves by the jumps of fig. 5 only.
    """
    bias = {"drift_variance": 0.0, "initial_variance": 0.0, "initial_torque": [0.0] * len(data["joints"])}
    for key in ("noise_std", "noise_std_per_force", "forget_rate", "noise_time"):
        if (data.get("bias") or {}).get(key) is not None:
            bias[key] = data["bias"][key]
    contact = {"threshold": [_NEVER] * len(data["joints"])}
    probe = {**data, "bias": bias, "contact": contact, "sensor_fault": None}
    return native.Finger(native.image_from_json(json.dumps(probe)), kinematics_source=3)


def balanced_forces(data: Mapping[str, Any], motion: Mapping[str, Numbers], pretension: Numbers) -> Numbers:
    """[N, m] tendon forces that carry the friction of a motion: f0 = pretension·ν + (Rᵀ)⁺ T(f0), N.

    motion: `time` [N], `joint_position` and `joint_velocity` [N, n]. pretension: [N] mean tendon force, N; or [N, m]
    tensions that hold themselves, in place of pretension·ν.
    T is eq. (10) of what slides, cover included; what sticks adds nothing, since its share is not known.
    """
    finger = friction_probe(data)
    start = finger.save_state()
    spread = np.linalg.pinv(moment_arms(data))
    own = np.outer(pretension, pretension_vector(data)) if pretension.ndim == 1 else pretension
    forces = own
    for _ in range(_ITERATIONS):
        finger.restore_state(start)
        found = finger.run({**motion, "tendon_force": forces})
        forces = own + (found["friction_torque"] - found["bias_torque"]) @ spread
    return np.asarray(forces)
