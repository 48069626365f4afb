"""Named cases of kinematics, bias procedure and contact with results known by hand, for any implementation.

A case is a finger, one or more recordings and a check of their outputs. The friction values are written
out as numbers or in the few lines of `law_value`; nothing here calls the oracle. Unless a case says otherwise
the Kalman filter is off (all variances 0, so K = 0) and the contact threshold is out of reach.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Description = dict[str, Any]
Recording = dict[str, Array]
Outputs = dict[str, Array]

# The hand calculations round a few times at torques of about 0.1 N·m, so 1e-13 is some hundred roundings.
CLOSE = 1e-13

LAW = {"static": 0.05, "coulomb": 0.03, "stribeck_velocity": 0.004, "viscous": 2.0}
ASYMMETRIC = {
    "positive": {"static": 0.05, "coulomb": 0.03, "stribeck_velocity": 0.004, "viscous": 2.0},
    "negative": {"static": 0.09, "coulomb": 0.08, "stribeck_velocity": 0.002, "viscous": 1.0},
}
DRY = {"static": 0.1, "coulomb": 0.1, "stribeck_velocity": 0.01}
NO_UPDATE = {"drift_variance": 0.0, "noise_std": 0.0, "initial_variance": 0.0, "forget_rate": 5.0}
V_MIN = 0.0005
ARM = 0.01


@dataclass(frozen=True)
class Case:
    """check gets the outputs of each recording in order and raises AssertionError."""

    name: str
    description: Description
    recordings: list[Recording]
    check: Callable[[list[Outputs]], None]
    source: int = 3
    repeated_time: bool = False
    extensions: bool = False


def law_value(law: Description, v: float) -> float:
    """eq. (1) by hand, for v != 0."""
    side = law.get("positive", law) if v > 0 else law.get("negative", law)
    decay = math.exp(-abs(v) / side["stribeck_velocity"])
    magnitude = side["coulomb"] + (side["static"] - side["coulomb"]) * decay + side.get("viscous", 0.0) * abs(v)
    return math.copysign(magnitude, v)


def finger(tendons: list[Description], joints: list[Description] | int = 1, **settings: Any) -> Description:
    joint_list = [{"name": f"j{j + 1}"} for j in range(joints)] if isinstance(joints, int) else joints
    return {
        "format": "tendonfmu-finger-1",
        "name": "case",
        "joints": joint_list,
        "tendons": [{"name": f"t{i + 1}", "stiffness": 1000.0} | tendon for i, tendon in enumerate(tendons)],
        "velocity_threshold": {"tendon": V_MIN, "joint": 0.01},
        "bias": NO_UPDATE,
        "contact": {"threshold": [1e6] * len(joint_list)},
    } | settings


def one_edge(law: Description = LAW, **settings: Any) -> Description:
    """One joint, one tendon, one edge: T = 0.01 m * f0 * F(0.01 m * q̇)."""
    return finger([{"moment_arms": [ARM], "edge_friction": [law]}], **settings)


def recording(
    time: Any, force: Any, speed: Any, angle: Any = 0.0, tendons: int = 1, joints: int = 1, position: Any = 0.0
) -> Recording:
    """Broadcasts every input to one row per sample."""
    t = np.asarray(time, dtype=float)

    def column(values: Any, count: int) -> Array:
        array = np.asarray(values, dtype=float)
        if array.ndim == 1 and len(array) == len(t):
            array = array[:, None]
        return np.array(np.broadcast_to(array, (len(t), count)))

    return {
        "time": t,
        "tendon_force": column(force, tendons),
        "tendon_position": column(position, tendons),
        "joint_position": column(angle, joints),
        "joint_velocity": column(speed, joints),
    }


def close(got: Any, expected: Any, within: float = CLOSE) -> None:
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=within)


def constant_velocity() -> Case:
    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        F = 0.03 + 0.02 * math.exp(-0.01 / 0.004) + 2.0 * 0.01  # ẋ = 0.01 m * 1 rad/s
        bias = 0.01 * 10.0 - 0.01 * 10.0 * F  # the first sample: τ − T
        close(out["bias_torque"][:, 0], bias)
        close(out["joint_torque"][:, 0], [0.1, 0.1, 0.12, 0.08])
        close(out["friction_torque"][:, 0], bias + 0.01 * F * np.array([10.0, 10.0, 12.0, 8.0]))
        close(out["compensated_torque"], out["joint_torque"] - out["friction_torque"])

    return Case("constant_velocity", one_edge(), [recording([0, 0.1, 0.2, 0.35], [10, 10, 12, 8], 1.0)], check)


def fast_zero_crossing() -> Case:
    """A sample within v_min between a forward and a backward one leaves no trace afterwards."""
    without = recording([0.0, 0.1, 0.2, 0.3], 10.0, [1.0, 0.5, -0.5, -1.0])
    with_stuck = recording([0.0, 0.1, 0.15, 0.2, 0.3], 10.0, [1.0, 0.5, 0.02, -0.5, -1.0])

    def check(runs: list[Outputs]) -> None:
        plain, stuck = runs
        bias = 0.1 - 0.1 * law_value(ASYMMETRIC, 0.01)
        close(plain["bias_torque"][:, 0], bias)
        close(stuck["bias_torque"][[0, 1, 3, 4], 0], bias)
        close(stuck["bias_torque"][2, 0], bias + 0.1 * law_value(ASYMMETRIC, V_MIN))
        close(stuck["friction_torque"][2, 0], stuck["bias_torque"][2, 0])  # F = 0 while stuck
        for name in ("friction_torque", "compensated_torque", "bias_torque"):
            close(stuck[name][3:], plain[name][2:])

    return Case("fast_zero_crossing", one_edge(ASYMMETRIC), [without, with_stuck], check)


def slow_zero_crossing() -> Case:
    """The change made on entering is undone but for what 0.2 s of rest have made of it."""
    slow = recording([0.0, 0.1, 0.2, 0.3, 0.4, 0.5], 10.0, [1.0, 0.02, 0.0, -0.01, -0.5, -1.0])

    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        forward, backward = 0.1 * law_value(ASYMMETRIC, V_MIN), 0.1 * law_value(ASYMMETRIC, -V_MIN)
        start = 0.1 - 0.1 * law_value(ASYMMETRIC, 0.01)
        leave = -backward - (forward - backward) * math.exp(-5.0 * (0.3 - 0.1))
        close(out["bias_torque"][:, 0], [start] + [start + forward] * 3 + [start + forward + leave] * 2)

    return Case("slow_zero_crossing", one_edge(ASYMMETRIC), [slow], check)


def same_side_after_rest() -> Case:
    """Leaving on the side of entering undoes the change whatever the length of the rest."""
    rest = recording([0.0, 0.1, 0.6, 0.7], 10.0, [1.0, 0.0, 0.0, 1.0])

    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        start = 0.1 - 0.1 * law_value(LAW, 0.01)
        close(out["bias_torque"][[0, 3], 0], start)
        close(out["bias_torque"][[1, 2], 0], start + 0.1 * law_value(LAW, V_MIN))

    return Case("same_side_after_rest", one_edge(), [rest], check)


def long_rest_forgets() -> Case:
    """After 100 s of rest T_eff is continuous at v_min on the new side: nothing jumps."""
    long = recording([0.0, 0.1, 50.0, 100.1, 100.2], 10.0, [1.0, 0.0, 0.0, 0.0, -0.05 * (1 + 1e-9)])

    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        change = 0.1 * (law_value(LAW, V_MIN) - law_value(LAW, -V_MIN))
        close(out["bias_torque"][4, 0], out["bias_torque"][0, 0] + change)
        # left a billionth above v_min, so T_eff moves by no more than the law's slope allows
        close(out["friction_torque"][4, 0], out["friction_torque"][3, 0], within=1e-10)

    return Case("long_rest_forgets", one_edge(), [long], check)


def contact_at_rest() -> Case:
    """Contact sets stuck_since to the present (t1 = t): the rest counts from the last contact sample."""
    time = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    speed = [1.0, 0.0, 0.0, 0.0, -1.0, -1.0]
    pushed_to_the_end = recording(time, [10, 10, 40, 40, 40, 10], speed)
    pushed_in_between = recording(time, [10, 10, 40, 10, 10, 10], speed)
    description = one_edge(ASYMMETRIC, contact={"threshold": [0.05]})

    def check(runs: list[Outputs]) -> None:
        to_the_end, in_between = runs
        start = 0.1 - 0.1 * law_value(ASYMMETRIC, 0.01)
        F1, F2 = law_value(ASYMMETRIC, V_MIN), law_value(ASYMMETRIC, -V_MIN)
        np.testing.assert_array_equal(to_the_end["joint_contact"][:, 0], [0, 0, 1, 1, 1, 0])
        np.testing.assert_array_equal(to_the_end["contact"].ravel(), [0, 0, 1, 1, 1, 0])
        # last_stuck = stuck_since = 0.3: b = −F(s1 v_min), weighed with the force of 40 N on leaving
        close(to_the_end["bias_torque"][3, 0], start + 0.1 * F1)
        close(to_the_end["bias_torque"][4, 0], start + 0.1 * F1 - 0.4 * F1)
        np.testing.assert_array_equal(in_between["contact"].ravel(), [0, 0, 1, 0, 0, 0])
        leave = -F2 - (F1 - F2) * math.exp(-5.0 * (0.3 - 0.2))
        close(in_between["bias_torque"][4, 0], start + 0.1 * F1 + 0.1 * leave)

    return Case("contact_at_rest", description, [pushed_to_the_end, pushed_in_between], check)


def contact_holds_the_bias() -> Case:
    """In contact b_eff and P stay; entering and leaving still add their b."""
    bias = {"drift_variance": 0.0, "noise_std": 0.1, "initial_variance": 0.01, "forget_rate": 5.0}
    description = one_edge(bias=bias, contact={"threshold": [0.05]})
    push = recording([0.0, 0.1, 0.2, 0.3], [10, 20, 20, 12], 0.0)

    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        np.testing.assert_array_equal(out["contact"].ravel(), [0, 1, 1, 0])
        close(out["bias_torque"][:3, 0], 0.1)
        close(out["compensated_torque"][1:3, 0], 0.1)
        # P is still 0.01, the noise 0.01: K = 1/2 of r = 0.02
        close(out["bias_torque"][3, 0], 0.11)
        close(out["compensated_torque"][3, 0], 0.01)

    return Case("contact_holds_the_bias", description, [push], check)


def first_exit() -> Case:
    """Never moved before: b = −F(s2 v_min), whatever the length of the rest, in contact too."""
    free = recording([0.0, 0.1, 0.2], 10.0, [0.0, 0.0, 1.0])
    pushed = recording([0.0, 0.1, 0.2], [10, 40, 40], [0.0, 0.0, -1.0])
    description = one_edge(ASYMMETRIC, contact={"threshold": [0.05]})

    def check(runs: list[Outputs]) -> None:
        moved, in_contact = runs
        close(moved["bias_torque"][:, 0], [0.1, 0.1, 0.1 - 0.1 * law_value(ASYMMETRIC, V_MIN)])
        change = 0.1 * (law_value(ASYMMETRIC, 0.01) - law_value(ASYMMETRIC, V_MIN))
        close(moved["friction_torque"][2, 0], 0.1 + change)
        np.testing.assert_array_equal(in_contact["contact"].ravel(), [0, 1, 1])
        close(in_contact["bias_torque"][2, 0], 0.1 - 0.4 * law_value(ASYMMETRIC, -V_MIN))

    return Case("first_exit", description, [free, pushed], check)


def zero_threshold() -> Case:
    """v_min = 0: only v = 0 is stuck, and F(s v_min) is s·Fs."""
    rec = recording([0.0, 0.1, 0.2, 0.3], 10.0, [1e-6, 0.0, 0.0, -1e-6])
    description = one_edge(ASYMMETRIC, velocity_threshold={"tendon": 0.0, "joint": 0.0})

    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        start = 0.1 - 0.1 * law_value(ASYMMETRIC, 1e-8)
        leave = 0.09 - (0.05 + 0.09) * math.exp(-5.0 * 0.1)
        close(out["bias_torque"][:, 0], [start, start + 0.005, start + 0.005, start + 0.005 + 0.1 * leave])

    return Case("zero_threshold", description, [rec], check)


def first_sample() -> Case:
    """b_eff = τ − T: nothing to detect, nothing to filter; an effect may begin moving."""
    rec = recording([5.0, 5.1], 10.0, [-1.0, 0.0])
    description = one_edge(ASYMMETRIC, contact={"threshold": [1e-6]})

    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        T = 0.1 * law_value(ASYMMETRIC, -0.01)
        close(out["friction_torque"][0, 0], 0.1)
        close(out["bias_torque"][0, 0], 0.1 - T)
        close(out["compensated_torque"][0, 0], 0.0)
        assert not out["contact"].ravel()[0]
        # it remembers the side it began on
        close(out["bias_torque"][1, 0] - out["bias_torque"][0, 0], 0.1 * law_value(ASYMMETRIC, -V_MIN))

    return Case("first_sample", description, [rec], check)


def initial_torque() -> Case:
    """b_eff starts at the given value: T_eff = b + T, no contact and no update on the first sample."""
    bias = {"drift_variance": 0.0, "noise_std": 0.1, "initial_variance": 0.03, "initial_torque": [0.02]}
    description = one_edge(bias=bias, contact={"threshold": [0.05]})
    rec = recording([0.0, 0.1, 0.2], [10.0, 10.0, 4.0], 0.0)

    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        close(out["bias_torque"][:, 0], [0.02, 0.02, 0.02 + 0.75 * 0.02])  # P = 0.03, noise 0.01: K = 3/4
        close(out["compensated_torque"][:, 0], [0.08, 0.08, 0.005])
        np.testing.assert_array_equal(out["contact"].ravel(), [0, 1, 0])

    return Case("initial_torque", description, [rec], check)


def kalman_filter() -> Case:
    """Two updates by hand, with the noise growing with the mean force and the default initial variance."""
    bias = {"drift_variance": 0.1, "noise_std": 0.1, "noise_std_per_force": 0.01}
    rec = recording([0.0, 0.1, 0.3], [10.0, 20.0, 15.0], 0.0)

    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        P, b = (0.1 + 0.01 * 10.0) ** 2, 0.1
        for force, dt, k in ((20.0, 0.1, 1), (15.0, 0.2, 2)):
            P += 0.1 * dt
            K = P / (P + (0.1 + 0.01 * force) ** 2)
            b += K * (0.01 * force - b)
            P *= 1.0 - K
            close(out["bias_torque"][k, 0], b)
            close(out["compensated_torque"][k, 0], 0.01 * force - b)

    return Case("kalman_filter", one_edge(bias=bias), [rec], check)


def noise_time_scales_the_noise() -> Case:
    """noise variance 0.01·T0/dt with T0 = 0.05 s and dt = 0.1 s."""
    bias = {"drift_variance": 0.0, "noise_std": 0.1, "initial_variance": 0.015, "noise_time": 0.05}
    rec = recording([0.0, 0.1], [10.0, 20.0], 0.0)

    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        close(out["bias_torque"][:, 0], [0.1, 0.1 + 0.75 * 0.1])

    return Case("noise_time_scales_the_noise", one_edge(bias=bias), [rec], check)


def no_variance_no_gain() -> Case:
    """P + noise = 0 gives K = 0, not 0/0."""
    rec = recording([0.0, 0.1, 0.2], [10.0, 20.0, 30.0], 0.0)

    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        close(out["bias_torque"][:, 0], 0.1)
        close(out["compensated_torque"][:, 0], [0.0, 0.1, 0.2])

    return Case("no_variance_no_gain", one_edge(), [rec], check)


def contact_threshold() -> Case:
    """|r| > threshold + threshold_per_force·mean|f0|, on each joint, both signs; one joint suffices."""
    tendons: list[Description] = [{"moment_arms": [0.01, 0.0]}, {"moment_arms": [0.0, 0.01], "bidirectional": True}]
    contact = {"threshold": [0.05, 0.02], "threshold_per_force": [0.0, 0.001]}
    forces = [[10.0, 10.0], [14.9, 10.0], [15.1, 10.0], [10.0, 13.2], [10.0, 13.1], [10.0, 6.9], [10.0, 7.2]]
    rec = recording(np.arange(7) * 0.1, forces, 0.0, tendons=2, joints=2)

    pushed = recording([0.0, 0.1, 0.2], [[10.0, -10.0], [10.0, -13.1], [10.0, -13.2]], 0.0, tendons=2, joints=2)

    def check(runs: list[Outputs]) -> None:
        out, out_pushed = runs
        # joint 2 at 13.2 N: 0.032 against 0.02 + 0.001·11.6 = 0.0316; at 13.1 N: 0.031 against 0.03155;
        # at 6.9 N: 0.031 against 0.02845; at 7.2 N: 0.028 against 0.0286
        expected = [[0, 0], [0, 0], [1, 0], [0, 1], [0, 0], [0, 1], [0, 0]]
        np.testing.assert_array_equal(out["joint_contact"], expected)
        np.testing.assert_array_equal(out["contact"].ravel(), [0, 0, 1, 1, 0, 1, 0])
        np.testing.assert_array_equal(out_pushed["joint_contact"], [[0, 0], [0, 0], [0, 1]])  # mean of |f0|

    return Case("contact_threshold", finger(tendons, 2, contact=contact), [rec, pushed], check)


def kinematics_of_tendon_positions() -> Case:
    """Source 1: q = R⁺(x0 − f0/k), v by the filter of 20 Hz, v_0 = 0."""
    tendons: list[Description] = [{"moment_arms": [0.01]}, {"moment_arms": [-0.02], "stiffness": 500.0}]
    rec = recording([0.0, 0.01, 0.03], [10.0, 5.0], 0.0, tendons=2)
    angle = np.array([0.1, 0.2, 0.2])
    rec["tendon_position"] = np.stack([0.01 * angle + 0.01, -0.02 * angle + 0.01], axis=1)
    rec["tendon_position"][2] += [0.002, 0.001]  # in the null space of R⁺: 0.01·0.002 − 0.02·0.001 = 0

    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        close(out["joint_angle"][:, 0], angle)
        v_1 = (1.0 - math.exp(-2.0 * math.pi * 20.0 * 0.01)) * 10.0
        v_2 = v_1 * math.exp(-2.0 * math.pi * 20.0 * 0.02)
        close(out["joint_speed"][:, 0], [0.0, v_1, v_2], within=1e-11)  # rounding of q over 10 ms

    return Case("kinematics_of_tendon_positions", finger(tendons), [rec], check, source=1)


def kinematics_of_joint_positions() -> Case:
    """Source 2 with cutoff 0: the backward difference itself; positions of the tendons are not looked at."""
    rec = recording([0.0, 0.1, 0.3], 10.0, 99.0, [0.0, 0.5, 0.1], position=7.0)

    def check(runs: list[Outputs]) -> None:
        (out,) = runs
        close(out["joint_angle"][:, 0], [0.0, 0.5, 0.1])
        close(out["joint_speed"][:, 0], [0.0, 5.0, -2.0])

    return Case("kinematics_of_joint_positions", one_edge(velocity_filter_cutoff=0.0), [rec], check, source=2)


def same_time_step() -> Case:
    """A second step at the time of the sample taken changes nothing, even with other inputs."""
    plain = recording([0.0, 0.1, 0.2], [10.0, 12.0, 11.0], [1.0, 0.0, -1.0])
    twice = recording([0.0, 0.0, 0.1, 0.1, 0.2], [10.0, 50.0, 12.0, -9.0, 11.0], [1.0, -3.0, 0.0, 2.0, -1.0])

    def check(runs: list[Outputs]) -> None:
        once, repeated = runs
        for name, series in once.items():
            np.testing.assert_array_equal(repeated[name], series[[0, 0, 1, 1, 2]], err_msg=name)

    return Case("same_time_step", one_edge(), [plain, twice], check, repeated_time=True)


CASES = [
    constant_velocity(),
    fast_zero_crossing(),
    slow_zero_crossing(),
    same_side_after_rest(),
    long_rest_forgets(),
    contact_at_rest(),
    contact_holds_the_bias(),
    first_exit(),
    zero_threshold(),
    first_sample(),
    initial_torque(),
    kalman_filter(),
    noise_time_scales_the_noise(),
    no_variance_no_gain(),
    contact_threshold(),
    kinematics_of_tendon_positions(),
    kinematics_of_joint_positions(),
    same_time_step(),
]
