"""Named cases of kinematics, bias procedure and contact with results known by hand, for any implementation.

A case is a function that runs a finger and checks its outputs. The friction values are written
out as numbers or in the few lines of `law_value`; nothing here calls the oracle. Unless a case says otherwise
the Kalman filter is off (all variances 0, so K = 0) and the contact threshold is out of reach.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Description = dict[str, Any]
Recording = dict[str, Array]
Outputs = dict[str, Array]


class Run(Protocol):
    def __call__(self, description: Description, recording: Recording, source: int = 3) -> Outputs: ...


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


# A case gets a function that runs a description over a recording (with measured velocities unless it says otherwise),
# and raises AssertionError.
CASES: dict[str, Callable[[Run], None]] = {}


def case(check: Callable[[Run], None]) -> Callable[[Run], None]:
    """Add a case under its name."""
    CASES[check.__name__] = check
    return check


def case_of_sources(*sources: int) -> Callable[[Callable[[Run, int], None]], Callable[[Run, int], None]]:
    """Add a case for each of some kinematics sources."""

    def add(check: Callable[[Run, int], None]) -> Callable[[Run, int], None]:
        for source in sources:
            CASES[f"{check.__name__}_source_{source}"] = functools.partial(check, source=source)
        return check

    return add


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


@case
def constant_velocity(run: Run) -> None:
    out = run(one_edge(), recording([0, 0.1, 0.2, 0.35], [10, 10, 12, 8], 1.0))
    F = 0.03 + 0.02 * math.exp(-0.01 / 0.004) + 2.0 * 0.01  # ẋ = 0.01 m * 1 rad/s
    bias = 0.01 * 10.0 - 0.01 * 10.0 * F  # the first sample: τ − T
    close(out["bias_torque"][:, 0], bias)
    close(out["joint_torque"][:, 0], [0.1, 0.1, 0.12, 0.08])
    close(out["friction_torque"][:, 0], bias + 0.01 * F * np.array([10.0, 10.0, 12.0, 8.0]))
    close(out["compensated_torque"], out["joint_torque"] - out["friction_torque"])


@case
def fast_zero_crossing(run: Run) -> None:
    """A sample within v_min between a forward and a backward one leaves no trace afterwards."""
    without = recording([0.0, 0.1, 0.2, 0.3], 10.0, [1.0, 0.5, -0.5, -1.0])
    with_stuck = recording([0.0, 0.1, 0.15, 0.2, 0.3], 10.0, [1.0, 0.5, 0.02, -0.5, -1.0])
    plain, stuck = run(one_edge(ASYMMETRIC), without), run(one_edge(ASYMMETRIC), with_stuck)
    bias = 0.1 - 0.1 * law_value(ASYMMETRIC, 0.01)
    close(plain["bias_torque"][:, 0], bias)
    close(stuck["bias_torque"][[0, 1, 3, 4], 0], bias)
    close(stuck["bias_torque"][2, 0], bias + 0.1 * law_value(ASYMMETRIC, V_MIN))
    close(stuck["friction_torque"][2, 0], stuck["bias_torque"][2, 0])  # F = 0 while stuck
    for name in ("friction_torque", "compensated_torque", "bias_torque"):
        close(stuck[name][3:], plain[name][2:])


@case
def slow_zero_crossing(run: Run) -> None:
    """The change made on entering is undone but for what 0.2 s of rest have made of it."""
    slow = recording([0.0, 0.1, 0.2, 0.3, 0.4, 0.5], 10.0, [1.0, 0.02, 0.0, -0.01, -0.5, -1.0])
    out = run(one_edge(ASYMMETRIC), slow)
    forward, backward = 0.1 * law_value(ASYMMETRIC, V_MIN), 0.1 * law_value(ASYMMETRIC, -V_MIN)
    start = 0.1 - 0.1 * law_value(ASYMMETRIC, 0.01)
    leave = -backward - (forward - backward) * math.exp(-5.0 * (0.3 - 0.1))
    close(out["bias_torque"][:, 0], [start] + [start + forward] * 3 + [start + forward + leave] * 2)


@case
def same_side_after_rest(run: Run) -> None:
    """Leaving on the side of entering undoes the change whatever the length of the rest."""
    rest = recording([0.0, 0.1, 0.6, 0.7], 10.0, [1.0, 0.0, 0.0, 1.0])
    out = run(one_edge(), rest)
    start = 0.1 - 0.1 * law_value(LAW, 0.01)
    close(out["bias_torque"][[0, 3], 0], start)
    close(out["bias_torque"][[1, 2], 0], start + 0.1 * law_value(LAW, V_MIN))


@case
def long_rest_forgets(run: Run) -> None:
    """After 100 s of rest T_eff is continuous at v_min on the new side: nothing jumps."""
    long = recording([0.0, 0.1, 50.0, 100.1, 100.2], 10.0, [1.0, 0.0, 0.0, 0.0, -0.05 * (1 + 1e-9)])
    out = run(one_edge(), long)
    change = 0.1 * (law_value(LAW, V_MIN) - law_value(LAW, -V_MIN))
    close(out["bias_torque"][4, 0], out["bias_torque"][0, 0] + change)
    # left a billionth above v_min, so T_eff moves by no more than the law's slope allows
    close(out["friction_torque"][4, 0], out["friction_torque"][3, 0], within=1e-10)


@case
def contact_at_rest(run: Run) -> None:
    """Contact sets stuck_since to the present (t1 = t): the rest counts from the last contact sample."""
    time = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    speed = [1.0, 0.0, 0.0, 0.0, -1.0, -1.0]
    pushed_to_the_end = recording(time, [10, 10, 40, 40, 40, 10], speed)
    pushed_in_between = recording(time, [10, 10, 40, 10, 10, 10], speed)
    description = one_edge(ASYMMETRIC, contact={"threshold": [0.05]})
    to_the_end, in_between = run(description, pushed_to_the_end), run(description, pushed_in_between)
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


@case
def contact_holds_the_bias(run: Run) -> None:
    """In contact b_eff and P stay; entering and leaving still add their b."""
    bias = {"drift_variance": 0.0, "noise_std": 0.1, "initial_variance": 0.01, "forget_rate": 5.0}
    description = one_edge(bias=bias, contact={"threshold": [0.05]})
    push = recording([0.0, 0.1, 0.2, 0.3], [10, 20, 20, 12], 0.0)
    out = run(description, push)
    np.testing.assert_array_equal(out["contact"].ravel(), [0, 1, 1, 0])
    close(out["bias_torque"][:3, 0], 0.1)
    close(out["compensated_torque"][1:3, 0], 0.1)
    # P is still 0.01, the noise 0.01: K = 1/2 of r = 0.02
    close(out["bias_torque"][3, 0], 0.11)
    close(out["compensated_torque"][3, 0], 0.01)


@case
def first_exit(run: Run) -> None:
    """Never moved before: b = −F(s2 v_min), whatever the length of the rest, in contact too."""
    free = recording([0.0, 0.1, 0.2], 10.0, [0.0, 0.0, 1.0])
    pushed = recording([0.0, 0.1, 0.2], [10, 40, 40], [0.0, 0.0, -1.0])
    description = one_edge(ASYMMETRIC, contact={"threshold": [0.05]})
    moved, in_contact = run(description, free), run(description, pushed)
    close(moved["bias_torque"][:, 0], [0.1, 0.1, 0.1 - 0.1 * law_value(ASYMMETRIC, V_MIN)])
    change = 0.1 * (law_value(ASYMMETRIC, 0.01) - law_value(ASYMMETRIC, V_MIN))
    close(moved["friction_torque"][2, 0], 0.1 + change)
    np.testing.assert_array_equal(in_contact["contact"].ravel(), [0, 1, 1])
    close(in_contact["bias_torque"][2, 0], 0.1 - 0.4 * law_value(ASYMMETRIC, -V_MIN))


@case
def zero_threshold(run: Run) -> None:
    """v_min = 0: only v = 0 is stuck, and F(s v_min) is s·Fs."""
    rec = recording([0.0, 0.1, 0.2, 0.3], 10.0, [1e-6, 0.0, 0.0, -1e-6])
    description = one_edge(ASYMMETRIC, velocity_threshold={"tendon": 0.0, "joint": 0.0})
    out = run(description, rec)
    start = 0.1 - 0.1 * law_value(ASYMMETRIC, 1e-8)
    leave = 0.09 - (0.05 + 0.09) * math.exp(-5.0 * 0.1)
    close(out["bias_torque"][:, 0], [start, start + 0.005, start + 0.005, start + 0.005 + 0.1 * leave])


@case
def first_sample(run: Run) -> None:
    """b_eff = τ − T: nothing to detect, nothing to filter; an effect may begin moving."""
    rec = recording([5.0, 5.1], 10.0, [-1.0, 0.0])
    description = one_edge(ASYMMETRIC, contact={"threshold": [1e-6]})
    out = run(description, rec)
    T = 0.1 * law_value(ASYMMETRIC, -0.01)
    close(out["friction_torque"][0, 0], 0.1)
    close(out["bias_torque"][0, 0], 0.1 - T)
    close(out["compensated_torque"][0, 0], 0.0)
    assert not out["contact"].ravel()[0]
    # it remembers the side it began on
    close(out["bias_torque"][1, 0] - out["bias_torque"][0, 0], 0.1 * law_value(ASYMMETRIC, -V_MIN))


@case
def initial_torque(run: Run) -> None:
    """b_eff starts at the given value: T_eff = b + T, no contact and no update on the first sample."""
    bias = {"drift_variance": 0.0, "noise_std": 0.1, "initial_variance": 0.03, "initial_torque": [0.02]}
    description = one_edge(bias=bias, contact={"threshold": [0.05]})
    rec = recording([0.0, 0.1, 0.2], [10.0, 10.0, 4.0], 0.0)
    out = run(description, rec)
    close(out["bias_torque"][:, 0], [0.02, 0.02, 0.02 + 0.75 * 0.02])  # P = 0.03, noise 0.01: K = 3/4
    close(out["compensated_torque"][:, 0], [0.08, 0.08, 0.005])
    np.testing.assert_array_equal(out["contact"].ravel(), [0, 1, 0])


@case
def kalman_filter(run: Run) -> None:
    """Two updates by hand, with the noise growing with the mean force and the default initial variance."""
    bias = {"drift_variance": 0.1, "noise_std": 0.1, "noise_std_per_force": 0.01}
    rec = recording([0.0, 0.1, 0.3], [10.0, 20.0, 15.0], 0.0)
    out = run(one_edge(bias=bias), rec)
    P, b = (0.1 + 0.01 * 10.0) ** 2, 0.1
    for force, dt, k in ((20.0, 0.1, 1), (15.0, 0.2, 2)):
        P += 0.1 * dt
        K = P / (P + (0.1 + 0.01 * force) ** 2)
        b += K * (0.01 * force - b)
        P *= 1.0 - K
        close(out["bias_torque"][k, 0], b)
        close(out["compensated_torque"][k, 0], 0.01 * force - b)


@case
def noise_time_scales_the_noise(run: Run) -> None:
    """noise variance 0.01·T0/dt with T0 = 0.05 s and dt = 0.1 s."""
    bias = {"drift_variance": 0.0, "noise_std": 0.1, "initial_variance": 0.015, "noise_time": 0.05}
    rec = recording([0.0, 0.1], [10.0, 20.0], 0.0)
    out = run(one_edge(bias=bias), rec)
    close(out["bias_torque"][:, 0], [0.1, 0.1 + 0.75 * 0.1])


@case
def no_variance_no_gain(run: Run) -> None:
    """P + noise = 0 gives K = 0, not 0/0."""
    rec = recording([0.0, 0.1, 0.2], [10.0, 20.0, 30.0], 0.0)
    out = run(one_edge(), rec)
    close(out["bias_torque"][:, 0], 0.1)
    close(out["compensated_torque"][:, 0], [0.0, 0.1, 0.2])


@case
def contact_threshold(run: Run) -> None:
    """|r| > threshold + threshold_per_force·mean|f0|, on each joint, both signs; one joint suffices."""
    tendons: list[Description] = [{"moment_arms": [0.01, 0.0]}, {"moment_arms": [0.0, 0.01], "bidirectional": True}]
    contact = {"threshold": [0.05, 0.02], "threshold_per_force": [0.0, 0.001]}
    forces = [[10.0, 10.0], [14.9, 10.0], [15.1, 10.0], [10.0, 13.2], [10.0, 13.1], [10.0, 6.9], [10.0, 7.2]]
    rec = recording(np.arange(7) * 0.1, forces, 0.0, tendons=2, joints=2)

    pushed = recording([0.0, 0.1, 0.2], [[10.0, -10.0], [10.0, -13.1], [10.0, -13.2]], 0.0, tendons=2, joints=2)
    out, out_pushed = (run(finger(tendons, 2, contact=contact), samples) for samples in (rec, pushed))
    # joint 2 at 13.2 N: 0.032 against 0.02 + 0.001·11.6 = 0.0316; at 13.1 N: 0.031 against 0.03155;
    # at 6.9 N: 0.031 against 0.02845; at 7.2 N: 0.028 against 0.0286
    expected = [[0, 0], [0, 0], [1, 0], [0, 1], [0, 0], [0, 1], [0, 0]]
    np.testing.assert_array_equal(out["joint_contact"], expected)
    np.testing.assert_array_equal(out["contact"].ravel(), [0, 0, 1, 1, 0, 1, 0])
    np.testing.assert_array_equal(out_pushed["joint_contact"], [[0, 0], [0, 0], [0, 1]])  # mean of |f0|


@case
def kinematics_of_tendon_positions(run: Run) -> None:
    """Source 1: q = R⁺(x0 − f0/k), v by the filter of 20 Hz, v_0 = 0."""
    tendons: list[Description] = [{"moment_arms": [0.01]}, {"moment_arms": [-0.02], "stiffness": 500.0}]
    rec = recording([0.0, 0.01, 0.03], [10.0, 5.0], 0.0, tendons=2)
    angle = np.array([0.1, 0.2, 0.2])
    rec["tendon_position"] = np.stack([0.01 * angle + 0.01, -0.02 * angle + 0.01], axis=1)
    rec["tendon_position"][2] += [0.002, 0.001]  # in the null space of R⁺: 0.01·0.002 − 0.02·0.001 = 0
    out = run(finger(tendons), rec, 1)
    close(out["joint_angle"][:, 0], angle)
    v_1 = (1.0 - math.exp(-2.0 * math.pi * 20.0 * 0.01)) * 10.0
    v_2 = v_1 * math.exp(-2.0 * math.pi * 20.0 * 0.02)
    close(out["joint_speed"][:, 0], [0.0, v_1, v_2], within=1e-11)  # rounding of q over 10 ms


@case
def kinematics_of_joint_positions(run: Run) -> None:
    """Source 2 with cutoff 0: the backward difference itself; positions of the tendons are not looked at."""
    rec = recording([0.0, 0.1, 0.3], 10.0, 99.0, [0.0, 0.5, 0.1], position=7.0)
    out = run(one_edge(velocity_filter_cutoff=0.0), rec, 2)
    close(out["joint_angle"][:, 0], [0.0, 0.5, 0.1])
    close(out["joint_speed"][:, 0], [0.0, 5.0, -2.0])


@case
def same_time_step(run: Run) -> None:
    """A second step at the time of the sample taken changes nothing, even with other inputs."""
    plain = recording([0.0, 0.1, 0.2], [10.0, 12.0, 11.0], [1.0, 0.0, -1.0])
    twice = recording([0.0, 0.0, 0.1, 0.1, 0.2], [10.0, 50.0, 12.0, -9.0, 11.0], [1.0, -3.0, 0.0, 2.0, -1.0])
    once, repeated = run(one_edge(), plain), run(one_edge(), twice)
    for name, series in once.items():
        np.testing.assert_array_equal(repeated[name], series[[0, 0, 1, 1, 2]], err_msg=name)
