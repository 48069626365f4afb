"""The oracle's derivatives against hand calculation."""

from __future__ import annotations

import math

import numpy as np

import oracle_derivatives
from analytic_cases import ARM, LAW, finger, one_edge, recording
from random_fingers import random_case
from tendonfmu.model import native

# A central difference of torques near 0.1 N·m over 1e-3 N rounds at 1e-13; Richardson leaves about as much.
CLOSE = 1e-9


def test_force_and_velocity_of_a_moving_edge() -> None:
    """T_eff = b + r·f0·F(r·q̇): by f0 it is r·F, by q̇ it is r²·f0·F'."""
    found, _ = oracle_derivatives.derivatives(one_edge(), recording([0.0, 0.1], 10.0, 1.0), 3, 1)
    F = 0.03 + 0.02 * math.exp(-2.5) + 0.02
    slope = -0.02 / 0.004 * math.exp(-2.5) + 2.0
    np.testing.assert_allclose(found["friction_torque", "tendon_force"], [[ARM * F]], atol=CLOSE)
    np.testing.assert_allclose(found["compensated_torque", "tendon_force"], [[ARM - ARM * F]], atol=CLOSE)
    np.testing.assert_allclose(found["friction_torque", "joint_velocity"], [[ARM**2 * 10.0 * slope]], atol=CLOSE)
    assert not found["bias_torque", "tendon_force"].any()


def test_entering_changes_the_bias_with_the_force() -> None:
    """On entering b = f0·F(v_min) joins b_eff; F = 0, so velocity has no effect."""
    found, _ = oracle_derivatives.derivatives(one_edge(), recording([0.0, 0.1], 10.0, [1.0, 0.0]), 3, 1)
    F = 0.03 + 0.02 * math.exp(-0.0005 / 0.004) + 2.0 * 0.0005
    np.testing.assert_allclose(found["bias_torque", "tendon_force"], [[ARM * F]], atol=CLOSE)
    np.testing.assert_allclose(found["friction_torque", "joint_velocity"], [[0.0]], atol=CLOSE)


def test_kinematics_of_tendon_positions() -> None:
    """q = (x0 − f0/k)/r; v takes the share 1 − exp(−2π·20·dt) of Δq/dt."""
    joints = [{"name": "j", "cover": {"stiffness": 0.3}}]
    description = finger([{"moment_arms": [ARM]}], joints)
    found, _ = oracle_derivatives.derivatives(description, recording([0.0, 0.01], 10.0, 0.0), 1, 1)
    share = 1.0 - math.exp(-2.0 * math.pi * 20.0 * 0.01)
    np.testing.assert_allclose(found["joint_angle", "tendon_position"], [[100.0]], rtol=1e-8)
    np.testing.assert_allclose(found["joint_angle", "tendon_force"], [[-0.1]], rtol=1e-8)
    np.testing.assert_allclose(found["joint_speed", "tendon_position"], [[100.0 * share / 0.01]], rtol=1e-8)
    np.testing.assert_allclose(found["friction_torque", "tendon_position"], [[30.0]], rtol=1e-8)


def test_the_filter_absorbs_its_share() -> None:
    """K = 3/4 of a torque without friction: compensated changes by r/4, the bias by 3r/4."""
    bias = {"drift_variance": 0.0, "noise_std": 0.1, "initial_variance": 0.03}
    description = one_edge(LAW, bias=bias)
    found, _ = oracle_derivatives.derivatives(description, recording([0.0, 0.1], [10.0, 12.0], 0.0), 3, 1)
    np.testing.assert_allclose(found["compensated_torque", "tendon_force"], [[ARM / 4.0]], atol=CLOSE)
    np.testing.assert_allclose(found["bias_torque", "tendon_force"], [[3.0 * ARM / 4.0]], atol=CLOSE)


def test_random_fingers_have_derivatives_that_predict() -> None:
    """Sums that hold by definition, and errors small against the derivatives."""
    for seed in (0, 20):
        description, inputs = random_case(seed, samples=40)
        for source in (1, 2, 3):
            found, errors = oracle_derivatives.derivatives(description, inputs, source, 35)
            R = np.array([tendon["moment_arms"] for tendon in description["tendons"]])
            np.testing.assert_allclose(found["joint_torque", "tendon_force"], R.T, atol=1e-11)
            for name in oracle_derivatives.STEPS:
                total = found["compensated_torque", name] + found["friction_torque", name]
                scale = np.abs(found["friction_torque", name]).max() + 1e-6
                np.testing.assert_allclose(total, found["joint_torque", name], atol=1e-6 * scale)
                small = errors["friction_torque", name] < 1e-2 * scale  # infinite at the edge of a play
                assert small.mean() > 0.95


def test_the_core_has_the_oracles_derivatives() -> None:
    """Fingers with the the optional keys of the detection, while they rest, stop and leave, in and out of contact."""
    compared = 0
    for seed in range(500, 510):
        description, inputs = random_case(seed, samples=80, detection=True)
        k = 20 + 5 * (seed - 500)
        source = 1 + seed % 3
        found, errors = oracle_derivatives.derivatives(description, inputs, source, k)
        finger = native.Instance.from_description(description, source)
        finger.run({name: series[: k + 1] for name, series in inputs.items()})
        for name in oracle_derivatives.STEPS:
            for column, unit in enumerate(np.eye(inputs[name].shape[1])):
                slopes = finger.directional_derivative({name: unit})
                for output in oracle_derivatives.OUTPUTS:
                    scale = np.abs(found[output, name]).max() + 1e-6
                    error = errors[output, name][:, column]
                    known = error < 1e-5 * scale  # else there is a kink within the step
                    difference = np.abs(slopes[output] - found[output, name][:, column])
                    assert (difference < 10.0 * error + 1e-6 * scale)[known].all(), (seed, output, name, column)
                    compared += int(known.sum())
    assert compared > 1500, compared
