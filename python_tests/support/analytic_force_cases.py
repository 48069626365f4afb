"""Named cases of force propagation and torques with results known by hand, for any implementation."""

from __future__ import annotations

import math

import numpy as np

from analytic_cases import ARM, DRY, LAW, V_MIN, Description, Run, case, close, finger, recording


@case
def chain_product_over_pulleys(run: Run) -> None:
    """f_A3 = f0·(1−F_B1)(1−F_A1)(1−F_B2)(1−F_A2)(1−F_B3); the torque lost is r·(f0 − f_A)."""
    laws = [dict(DRY, static=F, coulomb=F) for F in (0.1, 0.2, 0.05, 0.15, 0.3)]
    tendons: list[Description] = [
        {
            "moment_arms": [0.01, 0.01, 0.01],
            "edge_friction": [laws[0], laws[2], laws[4]],
            "pulley_friction": [laws[1], laws[3]],
        },
        {"moment_arms": [0.01, -0.01, 0.0]},
        {"moment_arms": [0.01, 0.0, -0.01]},
    ]
    joints: list[Description] = [{"name": f"j{j}", "load_friction": None} for j in (1, 2, 3)]
    joints[2] = {"name": "j3", "load_friction": {"static": 1e-3, "coulomb": 1e-3, "stribeck_velocity": 1.0}}
    forward = recording([0.0, 0.1], [[20.0, 10.0, 10.0]] * 2, 1.0, tendons=3, joints=3)
    folding = recording([0.0, 0.1], [[20.0, 10.0, 10.0]] * 2, [4.0, -3.0, 1.0], tendons=3, joints=3)
    out, folded = (run(finger(tendons, joints), samples) for samples in (forward, folding))
    T = out["friction_torque"] - out["bias_torque"]
    # at joint j the losses up to and including its own pulley count, eq. (10)
    kept = [0.9 * 0.8, 0.9 * 0.8 * 0.95 * 0.85, 0.9 * 0.8 * 0.95 * 0.85 * 0.7]
    expected = [0.01 * 20.0 * (1.0 - each) for each in kept]
    expected[2] += 1e-3 * (20.0 * kept[2] + 10.0 + 10.0)
    close(T[0], expected)
    close(T[1], expected)
    # ẋ = 0.02, −0.02, 0.01 m/s: the pulley of joint 1 sees ẋ_2, so it rubs backward as edge 2 does
    kept = [0.9 * 1.2, 0.9 * 1.2 * 1.05 * 0.85, 0.9 * 1.2 * 1.05 * 0.85 * 0.7]
    expected = [0.01 * 20.0 * (1.0 - each) for each in kept]
    expected[2] += 1e-3 * (20.0 * kept[2] + 10.0 + 10.0)
    close(folded["friction_torque"][1] - folded["bias_torque"][1], expected)


@case
def slack(run: Run) -> None:
    """The loss that made the force negative counts in full; then the force is 0. f0 = 0 is not slack."""
    jam = {"static": 1.5, "coulomb": 1.5, "stribeck_velocity": 0.01}
    tendons: list[Description] = [
        {"moment_arms": [0.01, 0.01], "edge_friction": [jam, DRY], "pulley_friction": [DRY]},
        {"moment_arms": [0.01, -0.01], "edge_friction": [DRY, DRY]},
    ]
    forces = [[10.0, 10.0], [10.0, 0.0], [10.0, -3.0], [-1.0, 10.0]]
    rec = recording([0.0, 0.1, 0.2, 0.3], forces, [1.0, 0.2], tendons=2, joints=2)
    out = run(finger(tendons, 2), rec)
    np.testing.assert_array_equal(out["slack"], [[1, 0], [1, 0], [1, 1], [1, 0]])
    T = out["friction_torque"] - out["bias_torque"]
    # tendon 1 loses 15 N of 10 N at its first edge, after which nothing is left to rub;
    # tendon 2: ẋ_1 = 0.008, ẋ_2 = −0.002: 10·0.1, then 9·(−0.1)
    lost_1 = 15.0 * 0.01
    close(T[0], [lost_1 + 0.01 * 1.0, lost_1 - 0.01 * (1.0 - 0.9)])
    close(T[1], [lost_1, lost_1])
    close(T[2], [lost_1, lost_1])
    close(T[3], [0.01 * 1.0, -0.01 * (1.0 - 0.9)])
    close(out["joint_torque"][2], [0.01 * (10.0 - 3.0), 0.01 * (10.0 + 3.0)])  # τ keeps the measured f0


@case
def bidirectional_sign(run: Run) -> None:
    """A pushed cable loop rubs against the motion just as a pulled one does."""
    tendons: list[Description] = [
        {
            "moment_arms": [0.01, 0.01],
            "edge_friction": [DRY, dict(DRY, static=0.2, coulomb=0.2)],
            "bidirectional": True,
        },
        {"moment_arms": [0.01, -0.01]},
    ]
    joints: list[Description] = [{"name": "j1"}, {"name": "j2", "load_friction": dict(DRY, static=1e-3, coulomb=1e-3)}]
    rec = recording([0.0, 0.1, 0.2], [[10.0, 1.0], [-10.0, 1.0], [-10.0, 1.0]], 1.0, tendons=2, joints=2)
    rec["joint_velocity"][2] = -1.0
    out = run(finger(tendons, joints), rec)
    T = out["friction_torque"] - out["bias_torque"]
    pulled = [0.01 * 1.0, 0.01 * (1.0 + 0.2 * 9.0) + 1e-3 * (7.2 + 1.0)]
    pushed = [0.01 * 1.0, 0.01 * (1.0 + 0.2 * 11.0) + 1e-3 * (13.2 + 1.0)]  # f_B = −10 − 1, then −11 − 2.2
    back = [-0.01 * 1.0, -0.01 * (1.0 + 0.2 * 9.0) - 1e-3 * (7.2 + 1.0)]
    close(T, [pulled, pushed, back])
    assert not out["slack"].any()
    close(out["joint_torque"][1], [0.01 * (-10.0 + 1.0), 0.01 * (-10.0 - 1.0)])


@case
def working_point_interpolation(run: Run) -> None:
    """The values are interpolated over the angle of the joint before; constant outside; q_0 = 0."""
    laws = [dict(LAW, static=s, coulomb=s, viscous=0.0) for s in (0.1, 0.3, 0.2)]
    points = {"angles": [-0.5, 0.0, 1.0], "laws": laws}
    first = {"angles": [-1.0, 1.0], "laws": [dict(DRY, static=0.1, coulomb=0.1), dict(DRY, static=0.2, coulomb=0.2)]}
    tendons: list[Description] = [
        {"moment_arms": [0.01, 0.01], "edge_friction": [first, points]},
        {"moment_arms": [0.01, -0.01]},
    ]
    angles = np.array([-2.0, -0.5, -0.25, 0.0, 0.25, 1.0, 3.0])
    rec = recording(np.arange(7) * 0.1, [10.0, 1.0], 1.0, tendons=2, joints=2)
    rec["joint_position"][:, 0] = angles
    rec["joint_position"][:, 1] = 0.7  # a joint's own angle has no effect
    out = run(finger(tendons, 2), rec)
    T = out["friction_torque"] - out["bias_torque"]
    close(T[:, 0], 0.01 * 10.0 * 0.15)
    F = np.array([0.1, 0.1, 0.2, 0.3, 0.275, 0.2, 0.2])
    close(T[:, 1], 0.01 * (1.5 + 8.5 * F))


@case
def values_not_parameters_are_interpolated(run: Run) -> None:
    """Halfway between two Stribeck velocities F is the mean of the values; b takes the present angle."""
    slow = {"static": 0.2, "coulomb": 0.0, "stribeck_velocity": 0.001}
    fast = {"static": 0.2, "coulomb": 0.0, "stribeck_velocity": 0.01}
    tendons: list[Description] = [
        {"moment_arms": [0.01, 0.01], "edge_friction": [None, {"angles": [0.0, 1.0], "laws": [slow, fast]}]},
        {"moment_arms": [0.01, -0.01]},
    ]
    rec = recording([0.0, 0.1, 0.2], [10.0, 1.0], 0.0, tendons=2, joints=2)
    rec["joint_velocity"][:, 1] = [0.5, 0.0, 0.5]
    rec["joint_position"][:, 0] = [0.5, 0.25, 0.75]
    out = run(finger(tendons, 2), rec)

    def mean(v: float, weight: float) -> float:
        return 0.2 * ((1.0 - weight) * math.exp(-v / 0.001) + weight * math.exp(-v / 0.01))

    T = out["friction_torque"][:, 1] - out["bias_torque"][:, 1]
    close(T, [0.1 * mean(0.005, 0.5), 0.0, 0.1 * mean(0.005, 0.75)])
    steps = np.diff(out["bias_torque"][:, 1])
    close(steps, [0.1 * mean(V_MIN, 0.25), -0.1 * mean(V_MIN, 0.75)])


@case
def joint_friction_and_cover(run: Run) -> None:
    joints: list[Description] = [
        {
            "name": "j1",
            "cover": {"stiffness": 0.5, "rest_angle": 0.2},
            "friction": {"static": 0.02, "coulomb": 0.01, "stribeck_velocity": 0.1, "viscous": 0.03},
            "load_friction": {"static": 0.002, "coulomb": 0.001, "stribeck_velocity": 0.1, "viscous": 0.003},
        }
    ]
    rec = recording([0.0, 0.1, 0.2, 0.3], 10.0, [0.5, -0.5, 0.01, 0.5], [0.2, 0.4, 0.6, 0.2])
    out = run(finger([{"moment_arms": [ARM]}], joints), rec)
    stribeck = math.exp(-5.0)
    F = (0.01 + 0.01 * stribeck + 0.015) + 10.0 * (0.001 + 0.001 * stribeck + 0.0015)
    T = out["friction_torque"][:, 0] - out["bias_torque"][:, 0]
    close(T, [F, 0.1 - F, 0.2, F])  # |v| = v_min is stuck
    at_v_min = math.exp(-0.1)
    F_min = (0.01 + 0.01 * at_v_min + 0.0003) + 10.0 * (0.001 + 0.001 * at_v_min + 0.00003)
    close(out["bias_torque"][2, 0] - out["bias_torque"][1, 0], -F_min)
    close(out["bias_torque"][3, 0], out["bias_torque"][0, 0])  # one sample of rest: undone


@case
def cover_hardening(run: Run) -> None:
    """The extension adds k3·(q − rest_angle)³; 0 is the rest angle of a joint without a cover."""
    tendons = [{"moment_arms": [0.01, 0.0]}, {"moment_arms": [0.0, 0.01]}]
    joints: list[Description] = [{"name": "j1", "cover": {"stiffness": 0.5, "rest_angle": 0.2}}, {"name": "j2"}]
    extensions = [
        {"effect": "cover_hardening", "joint": 1, "stiffness": 2.0},
        {"effect": "cover_hardening", "joint": 2, "stiffness": 3.0},
    ]
    rec = recording([0.0, 0.1], 10.0, 0.0, [[0.7, -0.5], [0.2, 0.0]], tendons=2, joints=2)
    description = finger(tendons, joints, extensions=extensions)
    out = run(description, rec)
    T = out["friction_torque"] - out["bias_torque"]
    close(T, [[0.25 + 2.0 * 0.125, -3.0 * 0.125], [0.0, 0.0]])
