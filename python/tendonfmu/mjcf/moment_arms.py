"""Moment arms of a compiled model over the joints' ranges: constant ones, and how far they are from constant.

A pull shortens its tendon, so the moment arm is minus the change of the tendon's length with the joint angle:
r_ij(q) = −∂L_i/∂q_j.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from tendonfmu.arrays import Numbers
from tendonfmu.mjcf.compiled_model import CompiledModel, Joint, Tendon

SAMPLES = 256  # spread over all joint ranges
STEPS = 33  # along each joint's range, the others in the middle of theirs
NONE = 1e-6  # m; shorter arms are none
NEGLIGIBLE = 0.01  # of the largest arm at the joint; a smaller constant is what the samples happen to average to
WORTH = 0.8  # the line must leave no more than this share of the deviation from a constant


@dataclass(frozen=True)
class MomentArm:
    """Moment arm of a tendon at a joint."""

    arm: float  # arm + slope·q_j (m; m/rad)
    slope: float
    low: float  # least and largest over all joint ranges (m)
    high: float
    varies: float  # largest deviation from the constant, as a share of the largest magnitude
    left: float  # the same with the slope


def sampled_angles(ranges: Numbers) -> Numbers:
    """Return angles that cover the ranges of all joints."""
    # ranges: [n, 2] (rad); returns [K, n] (rad)
    low, high = ranges[:, 0], ranges[:, 1]
    rows = [np.tile((low + high) / 2, (STEPS, 1)) for _ in ranges]
    for j, row in enumerate(rows):
        row[:, j] = np.linspace(low[j], high[j], STEPS)
    spread = qmc.Halton(len(ranges), scramble=False).random(SAMPLES)
    return np.concatenate([*rows, low + (high - low) * spread])


def moment_arms(
    model: CompiledModel, joints: Sequence[Joint], tendons: Sequence[Tendon], angles: Numbers, tolerance: float
) -> list[list[MomentArm]]:
    """Read the moment arms of a model."""
    # angles: [K, n] (rad); returns [m][n]
    rows, columns = [tendon.index for tendon in tendons], [joint.velocity for joint in joints]
    found = np.empty((len(angles), len(tendons), len(joints)))
    for k, each in enumerate(angles):
        model.place(joints, each)
        found[k] = -model.tendon_jacobian()[np.ix_(rows, columns)]
    return [[_fitted(found[:, i, j], angles[:, j], tolerance) for j in range(len(joints))] for i in range(len(tendons))]


def _fitted(values: Numbers, angle: Numbers, tolerance: float) -> MomentArm:
    """Describe an arm [K] over its own joint's angle [K]."""
    low, high = float(values.min()), float(values.max())
    largest = max(abs(low), abs(high))
    if largest < NONE:
        return MomentArm(0.0, 0.0, low, high, 0.0, 0.0)
    constant = float(values.mean())
    varies = float(np.abs(values - constant).max()) / largest
    if varies <= tolerance:
        return MomentArm(_constant(constant, largest), 0.0, low, high, varies, varies)
    slope, arm = np.polyfit(angle, values, 1)
    left = float(np.abs(values - arm - slope * angle).max()) / largest
    if left > WORTH * varies:
        return MomentArm(_constant(constant, largest), 0.0, low, high, varies, varies)
    return MomentArm(_constant(float(arm), largest), _rounded(float(slope)), low, high, varies, left)


def _constant(arm: float, largest: float) -> float:
    return _rounded(arm) if abs(arm) > NEGLIGIBLE * largest else 0.0


def _rounded(value: float) -> float:
    """Return a length without the last digits, which are those of MuJoCo's rotations: 1e-12 m and less."""
    return round(value, 11)
