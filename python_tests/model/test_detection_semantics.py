"""Each optional key of the detection where its effect can be written on paper, on the oracle and on the C core.

One joint, one tendon of arm 0.01 m unless a case says otherwise: τ = 0.01 m · f0. Speeds come as given (source 3).
Times are multiples of 1/8 s, so that their differences are exact. Nothing here calls a law of the oracle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from analytic_cases import ARM, ASYMMETRIC, LAW, NO_UPDATE, V_MIN, Array, Outputs, close, finger, law_value, one_edge
from analytic_cases import recording as at_times
from repetitions import repeated
from runners import Runner

DT = 0.125
FREE = {"moment_arms": [ARM]}  # a tendon without friction
NEVER = {"threshold": [1e6]}
HALF = {"drift_variance": 0.0, "noise_std": 0.1, "initial_variance": 0.03}  # after n updates Π(1 − K) = 1/(1 + 3 n)


def run(runner: Runner, description: Any, force: Any, speed: Any = 0.0, **others: Any) -> Outputs:
    """One row every DT for each force or speed given."""
    count = max(np.atleast_1d(each).shape[0] for each in (force, speed, others.get("angle", 0.0)))
    if others.get("tendons", 1) == count:
        raise ValueError("as many samples as tendons: rows and columns cannot be told apart")
    return runner(description, at_times(np.arange(count) * DT, force, speed, **others), 3)


def free_joint(**contact: Any) -> Any:
    """No friction, no filter: r = 0.01·(f0 − f0 of the first sample)."""
    return finger([FREE], contact={"threshold": [1e6]} | contact)


def contact_of(out: Outputs) -> list[int]:
    assert (out["joint_contact"].any(axis=1) == np.ravel(out["contact"])).all()
    return [int(each) for each in out["joint_contact"][:, 0]]


# --- step 2: forgetting


def absorbed(bias: float, steps: list[tuple[float, float]]) -> Array:
    """b_eff after each (jump, τ − T): the jump is added, then K_n = 3/(1 + 3 n) of what is left absorbed."""
    found = []
    for n, (jump, target) in enumerate(steps, start=1):
        bias += jump
        bias += (3.0 / (1.0 + 3.0 * n)) * (target - bias)
        found.append(bias)
    return np.array(found)


def test_absorption_leaves_what_the_filter_has_left(runner: Runner) -> None:
    """Entered at the second update with 10 N, left at the fourth with 20 N: two updates have left (4/7)·(7/10)."""
    bias = HALF | {"forgetting": "absorption", "forget_rate": 1e3}
    force = np.array([10.0, 10.0, 10.0, 20.0, 20.0])
    out = run(runner, one_edge(ASYMMETRIC, bias=bias), force, [1.0, 1.0, 0.0, 0.0, -1.0])
    F1, F2 = law_value(ASYMMETRIC, V_MIN), law_value(ASYMMETRIC, -V_MIN)
    entered = ARM * 20.0 * F1
    leave = -0.4 * entered - 0.6 * ARM * 20.0 * F2
    T = ARM * force * np.array([law_value(ASYMMETRIC, ARM * v) if v else 0.0 for v in (1.0, 1.0, 0.0, 0.0, -1.0)])
    jumps = [0.0, ARM * 10.0 * F1, 0.0, leave]
    steps = list(zip(jumps, (ARM * force - T)[1:], strict=True))
    close(out["bias_torque"][1:, 0], absorbed(out["bias_torque"][0, 0], steps))


# --- step 5: the innovation, the evidence, the end of a contact


def test_innovation_of_a_step_decays(runner: Runner) -> None:
    """r = A from the second sample on and m follows: y = A·exp(−(t_{k−1} − t_0)/T), whatever the steps."""
    time = np.array([0.0, 0.1, 0.15, 0.35, 0.36, 0.8])
    contact = NEVER | {"method": "innovation", "innovation": {"time": 0.2, "threshold": [1e6]}}
    out = runner(finger([FREE], contact=contact), at_times(time, [10.0] + [15.0] * 5, 0.0), 3)
    close(out["residual"][:, 0], [0.0] + [0.05] * 5)
    close(out["innovation"][:, 0], np.append(0.0, 0.05 * np.exp(-time[:-1] / 0.2)))


def test_innovation_decides_and_contact_holds_its_filter(runner: Runner) -> None:
    """B = 0.02 + 0.001·mean|f0|: 0.029 at 12.9 N is below, 0.032 at 13.2 N above; from there m stays and so does y."""
    innovation = {"time": 1e9, "threshold": [0.02], "threshold_per_force": [0.001]}
    out = run(runner, free_joint(method="innovation", innovation=innovation), [10.0, 12.9, 13.4, 13.4, 12.0, 12.0])
    assert contact_of(out) == [0, 0, 1, 1, 0, 0]
    quick = {"time": 0.2, "threshold": [0.02]}
    out = run(runner, free_joint(method="innovation", innovation=quick), [10.0] + [15.0] * 6)
    assert contact_of(out) == [0] + [1] * 6
    close(out["innovation"][1:, 0], 0.05)


def test_methods_keep_the_threshold_of_the_residual(runner: Runner) -> None:
    """A slow push passes the innovation and is found by |r|; without a method there is no innovation at all."""
    force = 10.0 + np.arange(30) * 0.2
    contact = {"threshold": [0.041], "method": "innovation", "innovation": {"time": 0.01, "threshold": [0.02]}}
    out = run(runner, free_joint(**contact), force)
    assert contact_of(out) == [int(0.002 * k > 0.041) for k in range(30)]
    assert np.abs(out["innovation"][:20]).max() < 0.003
    plain = run(runner, free_joint(threshold=[0.041]), force)
    assert contact_of(plain) == contact_of(out)
    close(plain["innovation"], 0.0)
    close(plain["residual"][:, 0], np.arange(30) * 0.002)


def cusum(threshold: float, evidence_time: float, **contact: Any) -> Any:
    innovation = {"time": 1e9, "threshold": [threshold], "evidence_time": evidence_time}
    return free_joint(method="cusum", innovation=innovation, **contact)


def test_cusum_alarms_after_its_time_over_the_excess(runner: Runner) -> None:
    """|y| = 3 B: g grows by 2·DT a sample, above τ_e = 1.1 s with the fifth; twice the excess in less than the time."""
    out = run(runner, cusum(0.02, 1.1), [10.0] + [16.0] * 8)
    assert contact_of(out) == [0] * 5 + [1] * 4
    out = run(runner, cusum(0.02, 1.1), [10.0] + [4.0] * 8)
    assert contact_of(out) == [0] * 5 + [1] * 4
    out = run(runner, cusum(0.02, 1.1), [10.0] + [20.0] * 8)
    assert contact_of(out) == [0] * 3 + [1] * 6
    out = run(runner, cusum(0.02, 1.1), [10.0] + [11.9] * 60)
    assert not any(contact_of(out))


def test_evidence_is_bounded_and_goes_by_one_a_second(runner: Runner) -> None:
    """|y| = 100 B: 10·DT a sample, above 3.05 s with the third, full at 6.1 s; 25 samples down to 3.05 s or less."""
    description = cusum(0.001, 3.05)
    out = run(runner, description, [10.0] + [20.0] * 10 + [10.0] * 40)
    assert contact_of(out) == [0] * 3 + [1] * 8 + [1] * 24 + [0] * 16
    early = run(runner, cusum(0.001, 3.05, release_ratio=0.5), [10.0] + [20.0] * 10 + [10.0] * 40)
    assert contact_of(early) == [0] * 3 + [1] * 8 + [1] * 36 + [0] * 4  # (6.1 − 1.525)/0.125 = 36.6


def test_release_ratio_is_the_joints_own(runner: Runner) -> None:
    """Joint 1 in contact leaves at 0.02, joint 2 next to it still enters at 0.04."""
    tendons: list[Any] = [{"moment_arms": [0.01, 0.0]}, {"moment_arms": [0.0, 0.01]}]
    description = finger(tendons, 2, contact={"threshold": [0.04, 0.04], "release_ratio": 0.5})
    first = [10.0, 13.0, 15.0, 13.0, 12.1, 11.9, 13.0]
    second = [10.0, 10.0, 10.0, 13.9, 13.9, 13.9, 10.0]
    out = run(runner, description, np.stack([first, second], axis=1), tendons=2, joints=2)
    np.testing.assert_array_equal(out["joint_contact"], np.array([[0, 0, 1, 1, 1, 0, 0], [0] * 7]).T)


def test_hold_time_counts_from_the_last_sample_that_exceeded(runner: Runner) -> None:
    """0.25 s are two samples more, both included; exceeding again starts anew; held samples move no bias."""
    description = finger([FREE], bias=HALF, contact={"threshold": [0.04], "hold_time": 0.25})
    out = run(runner, description, [10.0, 15.0, 10.1, 15.0, 10.1, 10.1, 10.1, 10.1])
    assert contact_of(out) == [0, 1, 1, 1, 1, 1, 0, 0]
    close(out["bias_torque"][:6, 0], 0.1)
    close(out["bias_torque"][6, 0], 0.1 + 0.75 * 0.001)
    shorter = run(runner, finger([FREE], contact={"threshold": [0.04], "hold_time": 0.2}), [10.0, 15.0] + [10.1] * 4)
    assert contact_of(shorter) == [0, 1, 1, 0, 0, 0]


CLOCKS: dict[str, Callable[[int, float], Array]] = {
    "multiples": lambda count, h: h * np.arange(count),
    "sums": lambda count, h: np.cumsum(np.full(count, h)) - h,
    "jittered": lambda count, h: h * np.arange(count) + np.random.default_rng(5).uniform(-1e-14, 1e-14, count),
    "microseconds": lambda count, h: np.round(h * np.arange(count) + 3.3e-7, 6),
    "since 1970": lambda count, h: 1.7e9 + h * np.arange(count),
}


@pytest.mark.parametrize("key", ["hold_time", "release_time"])
@pytest.mark.parametrize("h", repeated([0.001, 0.003, 0.01], 1))
def test_no_rounding_of_a_clock_changes_a_contact(runner: Runner, h: float, key: str) -> None:
    """Pushes of two samples every hundred; held for 25 samples exactly, or with a bias that moves after as many."""
    contact: dict[str, Any] = {"threshold": [0.04], key: 25 * h}
    bias = {"drift_variance": 0.0, "noise_std": 0.1, "initial_variance": 1e-4}
    force = np.where(np.arange(2000) % 100 < (2 if key == "hold_time" else 60), 15.0, 10.0)
    force[:50] = 10.0
    found = [
        contact_of(runner(finger([FREE], bias=bias, contact=contact), at_times(clock(2000, h), force, 0.0), 3))
        for clock in CLOCKS.values()
    ]
    expected = 19 * (2 + 25) if key == "hold_time" else None
    assert all(each == found[0] for each in found)
    assert expected is None or sum(found[0]) == expected


# --- step 6: release


def test_the_bias_moves_again_from_the_sample_of_the_release_on(runner: Runner) -> None:
    """Contact since t = 0.125: at 0.375 s, the first update, by 3/4 of r = 0.05, then 3/7 of the rest, ..."""
    description = finger([FREE], bias=HALF, contact={"threshold": [0.01], "release_time": 0.25})
    out = run(runner, description, [10.0] + [15.0] * 5)
    assert contact_of(out) == [0, 1, 1, 1, 1, 0]
    close(out["bias_torque"][:, 0], [0.1, 0.1, 0.1, 0.15 - 0.05 / 4.0, 0.15 - 0.05 / 7.0, 0.15 - 0.05 / 10.0])
    close(out["compensated_torque_std"][:, 0] ** 2, [0.03, 0.03, 0.03, 0.03 / 4.0, 0.03 / 7.0, 0.03 / 10.0])


# --- step 4a and 7: what friction may differ by, and the standard deviation


def magnitude(side: int, speed: float, law: Any = ASYMMETRIC) -> float:
    """|F| at a speed that may be 0."""
    return abs(law_value(law, math.copysign(speed if speed > 0.0 else 1e-300, side)))


def test_stuck_friction_is_what_the_law_would_be(runner: Runner) -> None:
    """|F| at the present |v| on the side of the last motion, of the stuck effects alone; the positive one at first."""
    joint = {"name": "j", "friction": ASYMMETRIC, "load_friction": LAW}
    tendons: list[Any] = [{"moment_arms": [-ARM], "edge_friction": [ASYMMETRIC]}]
    speed = [0.0, 0.005, -1.0, -0.03, -0.005, 0.0]
    force = [10.0, 20.0, 10.0, 10.0, 20.0, 10.0]
    out = run(runner, finger(tendons, [joint], contact=NEVER | {"friction_bound": {}}), force, speed)

    def all_stuck(f: float, v: float, edge: int, own: int) -> float:
        return ARM * f * magnitude(edge, ARM * v) + magnitude(own, v) + magnitude(own, v, LAW) * f

    # the arm is negative: the tendon moves to its positive side where the joint moves to its negative one
    expected = [all_stuck(10.0, 0.0, 1, 1), all_stuck(20.0, 0.005, 1, 1), 0.0]
    # 0.03 rad/s: the joint moves, its tendon at 0.3 mm/s is stuck
    expected += [ARM * 10.0 * magnitude(1, 3e-4), all_stuck(20.0, 0.005, 1, -1), all_stuck(10.0, 0.0, 1, -1)]
    close(out["stuck_friction"][:, 0], expected)


def test_friction_jump_counts_the_models_own_changes(runner: Runner) -> None:
    """A cover of 0.02 N·m/rad turned in steps: 2 and 4 mN·m, fading with T_J. What the filter moves does not count."""
    joint = {"name": "j", "cover": {"stiffness": 0.02}}
    contact = NEVER | {"friction_bound": {"jump_time": 0.25}}
    angle = np.array([0.5, 0.6, 0.6, 0.4, 0.4])
    force = [10.0, 12.0, 15.0, 9.0, 9.0]
    fade = math.exp(-DT / 0.25)
    expected = [0.0, 0.002, 0.002 * fade, 0.002 * fade**2 + 0.004, 0.002 * fade**3 + 0.004 * fade]
    for bias in (NO_UPDATE, HALF):
        out = run(runner, finger([FREE], [joint], bias=bias, contact=contact), force, 0.0, angle=angle)
        close(out["friction_jump"][:, 0], expected)
        close(out["stuck_friction"], 0.0)
    default = run(runner, finger([FREE], [joint], contact=NEVER | {"friction_bound": {}}), force, 0.0, angle=angle)
    close(default["friction_jump"][2, 0], 0.002 * math.exp(-DT / 0.06))
    without = run(runner, finger([FREE], [joint], contact=NEVER), force, 0.0, angle=angle)
    close(without["friction_jump"], 0.0)


def test_bounds_widen_both_thresholds(runner: Runner) -> None:
    """H = 0.01·f·0.1 at rest: with c_H = 1/2 a threshold of 0.02 N·m allows 0.02 + 0.0005·f, the innovation's too."""
    dry = {"static": 0.1, "coulomb": 0.1, "stribeck_velocity": 0.01}
    bound = {"friction_bound": {"stuck_share": 0.5}}
    force = [10.0, 12.6, 12.7, 13.0, 7.5, 7.7]  # 0.02 + 0.0005·f = 0.01·|f − 10|: f = 12.63, f = 7.62
    contact = {"threshold": [0.02]} | bound
    assert contact_of(run(runner, one_edge(dry, contact=contact), force)) == [0, 0, 1, 1, 1, 0]
    slow = {"method": "innovation", "innovation": {"time": 1e9, "threshold": [0.02]}}
    assert contact_of(run(runner, one_edge(dry, contact=NEVER | slow | bound), force)) == [0, 0, 1, 1, 1, 0]
    # c_J: the jump of 2 mN·m is allowed for, and fades
    joint = {"name": "j", "cover": {"stiffness": 0.02}}
    angle = np.array([0.5, 0.6, 0.6, 0.6])
    for share, expected in ((0.0, [0, 1, 1, 1]), (1.0, [0, 0, 1, 1])):
        contact = {"threshold": [0.001], "friction_bound": {"jump_share": share}}
        out = run(runner, finger([FREE], [joint], contact=contact), 10.0, 0.0, angle=angle)
        assert contact_of(out) == expected


DIRECTIONS = [[0.1, -0.2, 0.3, 0.0, 0.5], [0.0, 0.2, 0.0, 1.0, -0.1]]


OWN = {"static": 0.02, "coulomb": 0.01, "stribeck_velocity": 0.5}
BY_LOAD = {"static": 2e-4, "coulomb": 1e-4, "stribeck_velocity": 0.5, "viscous": 1e-5}


def uncertain(**contact: Any) -> Any:
    """Two tendons, all kinds of friction: five parts."""
    joint = {"name": "j", "friction": OWN, "load_friction": BY_LOAD, "cover": {"stiffness": 0.02, "rest_angle": 0.1}}
    tendons = [{"moment_arms": [ARM], "edge_friction": [LAW]}, {"moment_arms": [-0.02], "edge_friction": [ASYMMETRIC]}]
    return finger(tendons, [joint], contact=contact)


def hand_parts(f: Array, v: float, angle: float) -> Array:
    """r·L of both tendons, T_jv0, T_jvf·Σ f_B, T_jq of a moving sample; f [2] N."""
    F = np.array([law_value(LAW, ARM * v), law_value(ASYMMETRIC, -0.02 * v)])
    between = f * (1.0 - F)
    own, by_load = law_value(OWN, v), law_value(BY_LOAD, v) * between.sum()
    return np.array([*(np.array([ARM, -0.02]) * f * F), own, by_load, 0.02 * (angle - 0.1)])


def test_uncertainty_weighs_the_parts_of_the_model(runner: Runner) -> None:
    """u² = Σ_d (w_d · parts)², and |r| is allowed L·u more; what is stuck has no part but the cover."""
    force = np.array([[10.0, 8.0], [20.0, 8.0], [20.0, 8.0]])
    angle = [0.3, 0.3, 0.3]
    parts = [hand_parts(force[0], 1.0, 0.3), hand_parts(force[1], 1.0, 0.3), np.array([0.0, 0.0, 0.0, 0.0, 0.004])]
    u = np.sqrt(np.sum((np.array(parts) @ np.array(DIRECTIONS).T) ** 2, axis=1))
    options: dict[str, Any] = {"tendons": 2, "angle": np.array(angle)}
    out = run(runner, uncertain(**NEVER, uncertainty=[DIRECTIONS]), force, [1.0, 1.0, 0.0], **options)
    close(out["friction_parts"][:, 0, :], parts)
    close(out["compensated_torque_std"][:, 0], u)  # P = 0
    r = abs(out["residual"][1, 0])
    assert r > 3.0 * u[1] > 0.01
    for level, more in ((None, 3.0 * u[1]), (0.5, 0.5 * u[1]), (0.0, 0.0)):
        for threshold, expected in ((r - more - 1e-6, 1), (r - more + 1e-6, 0)):
            contact: dict[str, Any] = {"threshold": [threshold], "uncertainty": [DIRECTIONS]}
            contact |= {} if level is None else {"uncertainty_level": level}
            found = run(runner, uncertain(**contact), force, [1.0, 1.0, 0.0], **options)
            assert contact_of(found)[1] == expected
    without = run(runner, uncertain(**NEVER), force, [1.0, 1.0, 0.0], **options)
    close(without["friction_parts"], 0.0)
    close(without["compensated_torque_std"], 0.0)


def test_a_joint_may_have_no_uncertainty(runner: Runner) -> None:
    """null and an empty list both: u = 0; the parts of every joint are shown all the same."""
    joints = [{"name": f"j{j}", "cover": {"stiffness": 0.02}} for j in range(3)]
    tendons: list[Any] = [{"moment_arms": np.eye(3)[i].tolist()} for i in range(3)]
    contact = {"threshold": [1e6] * 3, "uncertainty": [None, [], [[0.0, 0.0, 0.0, 0.0, 0.0, 0.5]]]}
    out = run(
        runner, finger(tendons, joints, contact=contact), 10.0, 0.0, angle=np.full((2, 3), 0.3), tendons=3, joints=3
    )
    close(out["compensated_torque_std"], [[0.0, 0.0, 0.003]] * 2)
    close(out["friction_parts"][..., 5], 0.006)


def test_standard_deviation_adds_variances(runner: Runner) -> None:
    """P after the update, (0.002 + 0.0001·10 N)², and a third of (0.5·H)² + (0.25·J)²; already at the first sample."""
    dry = {"static": 0.1, "coulomb": 0.1, "stribeck_velocity": 0.01}
    contact: dict[str, Any] = NEVER | {"deviation": [0.002], "deviation_per_force": [1e-4]}
    contact |= {"friction_bound": {"stuck_share": 0.5, "jump_share": 0.25, "jump_time": 0.25}}
    out = run(runner, one_edge(dry, bias=HALF, contact=contact), 10.0, [0.0, 0.0, 1.0])
    # H = 0.01 while stuck; leaving for the first time adds −0.01 to the bias and 0.01 to T: no jump
    P = 0.03 / np.array([1.0, 4.0, 7.0])
    variance = P + 0.003**2 + np.array([0.005, 0.005, 0.0]) ** 2 / 3.0
    close(out["friction_jump"], 0.0)
    close(out["compensated_torque_std"][:, 0], np.sqrt(variance))
    # stopping from a motion with viscous friction: T_eff jumps by 0.1·(F(v_min) − F(v))
    out = run(runner, one_edge(LAW, contact=contact), 10.0, [1.0, 0.0])
    jump, hidden = 0.1 * abs(law_value(LAW, V_MIN) - law_value(LAW, 0.01)), 0.1 * 0.05
    stopped = 0.003**2 + ((0.5 * hidden) ** 2 + (0.25 * jump) ** 2) / 3.0
    close(out["compensated_torque_std"][:, 0], [0.003, math.sqrt(stopped)])


# --- step 4a: how friction stood at the start


DRY_JOINT = {"name": "j", "friction": {"static": 0.1, "coulomb": 0.1, "stribeck_velocity": 0.01}}  # 0.1 N·m
SMOOTH = [{"effect": "presliding", "joint": 1, "displacement": 0.01}]


def at_start(share: float | None, smooth: bool, **contact: Any) -> Any:
    """A joint with 0.1 N·m of friction whose bias does not move by itself, and hears 1e-4 N·m of noise."""
    bias = NO_UPDATE | {"noise_std": 1e-4} | ({} if share is None else {"start_share": share})
    return finger([FREE], [DRY_JOINT], bias=bias, contact={"threshold": [0.02]} | contact,
                  extensions=SMOOTH if smooth else [])  # fmt: skip


@pytest.mark.parametrize("smooth", [True, False], ids=["presliding", "sticks"])
def test_the_first_stroke_shows_how_friction_stood(runner: Runner, smooth: bool) -> None:
    """Friction stood against the first motion: τ changes by 2F. The model, which took it as 0, or as standing with the
    motion where it sticks, is wrong by F or 2F; that is not contact, and the bias has it at once."""
    wrong = 0.1 if smooth else 0.2
    force = [10.0, 10.0, 10.0 - 20.0, 10.0 - 20.0, 10.0 - 20.0]
    speed = [0.0, 0.0, -4.0, -4.0, -4.0]  # 0.5 rad a sample: nothing is left of where it was
    paper = run(runner, at_start(None, smooth), force, speed)
    assert contact_of(paper) == [0, 0, 1, 1, 1]
    close(paper["residual"][2:, 0], -wrong)
    told = run(runner, at_start(1.0, smooth), force, speed)
    assert contact_of(told) == [0, 0, 0, 0, 0]
    close(told["residual"][2, 0], -wrong)
    gain = wrong**2 / 3.0 / (wrong**2 / 3.0 + 1e-8)
    close(told["bias_torque"][2, 0] - told["bias_torque"][1, 0], -gain * wrong + (0.0 if smooth else 0.1))
    left = (1.0 - gain) * wrong  # of V after the update
    close(told["compensated_torque_std"][2, 0], left / math.sqrt(3.0))


def test_the_start_is_turned_over_once(runner: Runner) -> None:
    """A push in the second stroke is contact, and one in the first is not."""
    speed = [0.0, 4.0, -4.0, 4.0]
    model = np.array([0.0, 0.1, -0.1, 0.1]) / ARM  # N that friction takes, from 0 at the start
    for at, contact in ((1, [0, 0, 0, 0]), (3, [0, 0, 0, 1])):
        force = 50.0 + model + 5.0 * (np.arange(4) >= at)
        assert contact_of(run(runner, at_start(1.0, True), force, speed)) == contact


# --- steps 5 and 6: slow loads


STEP = 1.0 - math.exp(-1.0)  # of a mean over the time of one sample; u, over a tenth of that, has all of it


def drifting(bias: Any = NO_UPDATE, **contact: Any) -> Any:
    """No friction: e = 0.01·(f0 − f0 of the first sample) whatever the bias learns."""
    drift = {"quick_time": DT, "slow_time": 8 * DT, "threshold": [0.05]}
    return finger([FREE], bias=bias, contact={"threshold": [1e6], "drift": drift} | contact)


def test_a_slow_load_is_found_though_the_bias_has_it(runner: Runner) -> None:
    """0.01 N·m a sample, of which the bias takes nearly all: |r| stays below 0.02, the drift passes 0.05."""
    quick_bias = {"drift_variance": 1.0, "noise_std": 0.1, "initial_variance": 0.1}
    out = run(runner, drifting(quick_bias), 10.0 + np.arange(20.0))
    load = 0.01 * np.arange(20.0)
    quick, slow, expected = 0.0, 0.0, [0.0]
    for k in range(1, 20):
        quick += STEP * (load[k] - quick)
        expected.append(quick - slow)
        if abs(expected[-1]) > 0.05:
            break
        slow += (1.0 - math.exp(-DT / min(8 * DT, k * DT))) * (load[k] - slow)
    found = len(expected) - 1
    assert 4 < found < 19
    close(out["drift"][: found + 1, 0], expected)
    assert contact_of(out)[: found + 1] == [0] * found + [1]
    assert np.abs(out["residual"][: found + 1]).max() < 0.02


def test_a_contact_that_lasts_too_long_begins_anew(runner: Runner) -> None:
    out = run(runner, drifting(release_time=3 * DT), [10.0] * 12 + [20.0] * 8)
    assert contact_of(out) == [0] * 12 + [1] * 4 + [0] * 4
    close(out["drift"][16, 0], 0.1 * (math.exp(-4.0) - math.exp(-5.0)))  # p − s, s = p of the sample before
