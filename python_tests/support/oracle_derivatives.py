"""Derivatives of the oracle's outputs by the inputs (docs/reference/semantics/outputs.md#directional-derivatives).

All that is remembered is held and every branch decision is frozen, so a central difference of one step from
a copied state is the derivative; one Richardson extrapolation removes its error of second order.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import oracle

Array = NDArray[Any]

OUTPUTS = (
    "compensated_torque",
    "joint_torque",
    "friction_torque",
    "bias_torque",
    "joint_angle",
    "joint_speed",
)
# Small against the Stribeck velocities (through q and v), large against rounding; N, m, rad, rad/s.
STEPS = {"tendon_force": 1e-3, "tendon_position": 1e-7, "joint_position": 1e-5, "joint_velocity": 1e-4}


def derivatives(
    description: Mapping[str, Any], recording: Mapping[str, Array], kinematics_source: int, k: int
) -> tuple[dict[tuple[str, str], Array], dict[tuple[str, str], Array]]:
    """d output / d input after sample k: {(output, input): [outputs, inputs]}, and the estimated errors.

    They are infinite at the edge of a play, which moves on in one direction only.
    """
    finger = oracle.FingerOracle(description, kinematics_source)
    names = [name for name in oracle.INPUTS if recording.get(name) is not None]

    def sample(at: int) -> dict[str, Array]:
        return {name: np.array(recording[name][at], dtype=float) for name in names}

    for at in range(k):
        finger.step(float(recording["time"][at]), sample(at))
    time = float(recording["time"][k])
    plain = copy.deepcopy(finger).step(time, sample(k))
    decisions = plain.decisions

    def difference(name: str, column: int, step: float) -> tuple[dict[str, Array], dict[str, Array]]:
        values = []
        for change in (step, -step):
            inputs = sample(k)
            inputs[name][column] += change
            values.append(copy.deepcopy(finger).step(time, inputs, decisions).values)
        slopes = {output: (values[0][output] - values[1][output]) / (2.0 * step) for output in OUTPUTS}
        bends = {output: values[0][output] + values[1][output] - 2.0 * plain.values[output] for output in OUTPUTS}
        return slopes, {output: bend / (2.0 * step) for output, bend in bends.items()}

    found, errors = {}, {}
    for name in names:
        coarse = [difference(name, column, STEPS[name])[0] for column in range(len(sample(k)[name]))]
        fine, bends = zip(*(difference(name, column, STEPS[name] / 2.0) for column in range(len(coarse))), strict=True)
        for output in OUTPUTS:
            wide = np.stack([each[output] for each in coarse], axis=1)
            narrow = np.stack([each[output] for each in fine], axis=1)
            found[output, name] = (4.0 * narrow - wide) / 3.0
            bend = np.abs(np.stack([each[output] for each in bends], axis=1))
            kinked = bend > 0.1 * np.abs(narrow) + 1e-4 * (np.abs(narrow).max() + 1.0)
            errors[output, name] = np.where(kinked, np.inf, np.abs(narrow - wide))
    return found, errors
