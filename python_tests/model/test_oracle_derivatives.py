"""Directional derivatives of the core, and of the oracle they are compared with, by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import oracle_derivatives
from analytic_cases import ARM, LAW, finger, one_edge, recording
from tendonfmu.model import native

# A central difference of torques near 0.1 N·m over 1e-3 N rounds at 1e-13; Richardson leaves about as much.
CLOSE = 1e-9

F = 0.03 + 0.02 * math.exp(-2.5) + 0.02  # of LAW at 0.01 m/s
SLOPE = -0.02 / 0.004 * math.exp(-2.5) + 2.0
F_MIN = 0.03 + 0.02 * math.exp(-0.0005 / 0.004) + 2.0 * 0.0005
TAKEN = 1.0 - math.exp(-2.0 * math.pi * 20.0 * 0.01)  # the share of Δq/dt that the velocity filter takes
COVERED = finger([{"moment_arms": [ARM]}], [{"name": "j", "cover": {"stiffness": 0.3}}])
FILTERED = one_edge(LAW, bias={"drift_variance": 0.0, "noise_std": 0.1, "initial_variance": 0.03})


@pytest.mark.parametrize(
    ("description", "samples", "source", "expected"),
    [
        # a moving edge: T_eff = b + r·f0·F(r·q̇); by f0 it is r·F, by q̇ it is r²·f0·F'
        (
            one_edge(),
            recording([0.0, 0.1], 10.0, 1.0),
            3,
            {
                ("friction_torque", "tendon_force"): ARM * F,
                ("compensated_torque", "tendon_force"): ARM - ARM * F,
                ("friction_torque", "joint_velocity"): ARM**2 * 10.0 * SLOPE,
                ("bias_torque", "tendon_force"): 0.0,
            },
        ),
        # on entering b = f0·F(v_min) joins b_eff; F = 0, so velocity has no effect
        (
            one_edge(),
            recording([0.0, 0.1], 10.0, [1.0, 0.0]),
            3,
            {("bias_torque", "tendon_force"): ARM * F_MIN, ("friction_torque", "joint_velocity"): 0.0},
        ),
        # q = (x0 − f0/k)/r, and v by the filter
        (
            COVERED,
            recording([0.0, 0.01], 10.0, 0.0),
            1,
            {
                ("joint_angle", "tendon_position"): 100.0,
                ("joint_angle", "tendon_force"): -0.1,
                ("joint_speed", "tendon_position"): 100.0 * TAKEN / 0.01,
                ("friction_torque", "tendon_position"): 30.0,
            },
        ),
        # K = 3/4 of a torque without friction: compensated changes by r/4, the bias by 3r/4
        (
            FILTERED,
            recording([0.0, 0.1], [10.0, 12.0], 0.0),
            3,
            {("compensated_torque", "tendon_force"): ARM / 4.0, ("bias_torque", "tendon_force"): 3.0 * ARM / 4.0},
        ),
    ],
    ids=["moves", "enters", "tendon positions", "bias filter"],
)
def test_derivatives_by_hand(
    description: Any, samples: Any, source: int, expected: dict[tuple[str, str], float]
) -> None:
    of_oracle, _ = oracle_derivatives.derivatives(description, samples, source, 1)
    core = native.Instance.from_description(description, source)
    core.run(samples)
    for (output, given), value in expected.items():
        within = CLOSE * max(1.0, abs(value))
        np.testing.assert_allclose(of_oracle[output, given], [[value]], atol=within)
        np.testing.assert_allclose(core.directional_derivative({given: np.ones(1)})[output], [value], atol=within)
