"""Detection where it can be written on paper, on the oracle and on the C core.

One joint, one tendon of arm 0.01 m unless a case says otherwise: τ = 0.01 m · f0. Speeds, angles and tendon positions
come as given (source 3). Nothing here calls the oracle's rules: after a step of size s, with α = exp(−dt/A) and
β = exp(−dt/M), a mean is s·(1 − αⁿ), and a − m is s·β·(1 − α)·(βⁿ − αⁿ)/(β − α).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from analytic_cases import ARM, ASYMMETRIC, NO_UPDATE, V_MIN, Array, Outputs, close, finger, law_value, one_edge
from analytic_cases import recording as at_times
from random_fingers import random_case
from runners import NATIVE, Runner, assert_state_continues

SHORT, LONG = (0.004, 0.02, 0.06, 0.5), (0.05, 0.3, 1.0, 10.0)  # A, M
HELD = 10.0
SETTLED = 60.0  # s; nothing is left of the start
DT = 0.001
NEVER = 1e6
FREE = {"moment_arms": [ARM]}  # a tendon without friction
HALF = {"drift_variance": 0.0, "noise_std": 0.1, "initial_variance": 0.03}  # after n updates Π(1 − K) = 1/(1 + 3 n)


def bands(noise: Any, **numbers: float) -> dict[str, Any]:
    """`contact` of one joint; noise: of the four bands; numbers: of all bands."""
    rows = [{"noise": [float(each)]} | {name: [value] for name, value in numbers.items()} for each in noise]
    return {"threshold": [NEVER], "method": "bands", "bands": rows}


def one_band(k: int, noise: float, **numbers: float) -> dict[str, Any]:
    """The others find nothing."""
    return bands([noise if each == k else NEVER for each in range(4)], **numbers)


def settled(steps: Any) -> Array:
    """Times: two samples a minute apart, then by these steps."""
    return np.concatenate(
        [[0.0], SETTLED + np.cumsum(np.concatenate([[0.0], np.broadcast_to(steps, np.shape(steps))]))]
    )


def of(
    runner: Runner, contact: Any, time: Array, e: Any, joint: Any = 1, bias: Any = NO_UPDATE, **inputs: Any
) -> Outputs:
    """A finger without tendon friction whose torque is e [N]."""
    force = 10.0 + np.asarray(e, dtype=float) / ARM
    speed = inputs.pop("speed", 0.0)
    return runner(finger([FREE], joint, bias=bias, contact=contact), at_times(time, force, speed, **inputs), 3)


def contact_of(out: Outputs) -> list[int]:
    assert (out["joint_contact"].any(axis=1) == np.ravel(out["contact"])).all()
    return [int(each) for each in out["joint_contact"][:, 0]]


def change(n: Any, k: int, long: float = math.nan, dt: float = DT) -> Array:
    """a − m, n samples after a unit step; at n = 1 the step is there for the first time."""
    a, b = math.exp(-dt / SHORT[k]), math.exp(-dt / (LONG[k] if math.isnan(long) else long))
    return np.asarray(b * (1.0 - a) * (b ** np.asarray(n) - a ** np.asarray(n)) / (b - a))


def counted(n: Any, k: int, long: float = math.nan) -> Array:
    """What counts of it: at most the distance from home, which follows the second mean with 10 s."""
    a, quick = (1.0 - np.exp(-np.asarray(n) * DT / SHORT[each]) for each in (k, 1))
    return np.minimum(change(n, k, long), a - (quick - change(n, 1, HELD)))


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
    samples = at_times(np.arange(5) * 0.125, force, [1.0, 1.0, 0.0, 0.0, -1.0])
    out = runner(one_edge(ASYMMETRIC, bias=bias), samples, 3)
    F1, F2 = law_value(ASYMMETRIC, V_MIN), law_value(ASYMMETRIC, -V_MIN)
    entered = ARM * 20.0 * F1
    leave = -0.4 * entered - 0.6 * ARM * 20.0 * F2
    T = ARM * force * np.array([law_value(ASYMMETRIC, ARM * v) if v else 0.0 for v in (1.0, 1.0, 0.0, 0.0, -1.0)])
    jumps = [0.0, ARM * 10.0 * F1, 0.0, leave]
    steps = list(zip(jumps, (ARM * force - T)[1:], strict=True))
    close(out["bias_torque"][1:, 0], absorbed(out["bias_torque"][0, 0], steps))


# --- the paper's method


def test_level_of_the_paper(runner: Runner) -> None:
    """|r| over 0.02 + 0.001·f̄; 0 at the first sample, and where r and bound are 0."""
    force = np.array([10.0, 12.0, 13.0, 14.0, 7.0])
    samples = at_times(np.arange(5) * 0.1, force, 0.0)
    out = runner(finger([FREE], contact={"threshold": [0.02], "threshold_per_force": [0.001]}), samples, 3)
    level = 0.01 * np.abs(force - 10.0) / (0.02 + 0.001 * force)
    close(out["contact_level"][:, 0], level, within=1e-11)
    assert contact_of(out) == [int(each > 1.0) for each in level]
    named = runner(finger([FREE], contact={"threshold": [0.0], "method": "paper"}), at_times([0, 1], [10, 10], 0.0), 3)
    close(named["contact_level"], 0.0)


# --- method bands: the change, and what it is compared with


@pytest.mark.parametrize("k", range(4))
def test_a_step_is_found_in_the_time_that_the_formula_says(runner: Runner, k: int) -> None:
    """40 mN·m, with a noise of 0.7 of its largest change within 39 ms; home limits the slow band."""
    n = np.arange(1, 40)
    noise = 0.7 * 0.04 * float(counted(n, k).max())
    level = 0.04 * counted(n, k) / noise
    first = int(np.argmax(level > 1.0))
    for size in (0.04, -0.04):
        out = of(runner, one_band(k, noise), settled(np.full(39, DT)), [0.0, 0.0] + [size] * 39)
        close(out["contact_level"][2 : 3 + first, 0], level[: first + 1], within=1e-10)
        assert contact_of(out) == [0] * (2 + first) + [1] * (39 - first)


NUMBERS: dict[str, float] = {
    "friction": 0.5, "friction_limit": 0.2, "motor_load": 0.4, "friction_change": 2.0, "friction_reserve": 0.3,
}  # fmt: skip


@pytest.mark.parametrize("k", [0, 2])
@pytest.mark.parametrize("load", [0.01, 1.0])
@pytest.mark.parametrize("given", [*NUMBERS, "all"])
def test_the_bound_sums_the_squares(runner: Runner, given: str, load: float, k: int) -> None:
    """A stuck joint that holds 0.1 N·m at most, a cover that is turned, and motors that drive a small or a large load,
    all with one step. S is 0.1: what the reserve adds is limited by a small load."""
    joint = {
        "name": "j",
        "cover": {"stiffness": 0.2},
        "friction": {"static": 0.1, "coulomb": 0.1, "stribeck_velocity": 1},
    }
    numbers = {name: value for name, value in NUMBERS.items() if given in (name, "all")}
    n, stiffness = np.arange(1, 200), 1000.0
    # the motors have moved, a minute before
    time = np.concatenate([[0.0, 0.1], 0.1 + SETTLED + DT * np.arange(200)])
    T = np.concatenate([[0.01] * 3, np.full(199, 0.05)])  # 0.2·angle
    tau = 0.02 * (T > 0.02)
    contact = one_band(k, 10.0, **numbers) | {"watches_motors": True}
    position = load / (ARM * stiffness) * (T > 0.02) - (time < 0.1)
    out = of(runner, contact, time, tau, [joint], angle=T / 0.2, position=position)
    assert not out["contact"].any()
    e, D, D_3 = abs(0.02 - 0.04) * change(n, k), load * change(n, k), load * change(n, 2)
    terms = {
        "friction": np.full(199, 0.05), "friction_limit": np.full(199, 0.1), "motor_load": D,
        "friction_change": np.minimum(0.04 * change(n, k), D), "friction_reserve": np.minimum(0.1, D_3),
    }  # fmt: skip
    square = 100.0 + sum((value * terms[name]) ** 2 for name, value in numbers.items())
    close(out["contact_level"][3:, 0], e / np.sqrt(square), within=1e-15)
    if "contact_terms" in out:
        expected = [-e, -e, np.ones(199), *terms.values()]
        close(out["contact_terms"][3:, 0, k], np.transpose(expected), within=1e-12)


def test_what_acts_and_what_could_act(runner: Runner) -> None:
    """A moving edge with its joint: |T| = B, and no reserve. An effect that stands counts on its last side."""
    contact = bands([NEVER] * 4, friction=1.0)
    force, speed = np.array([10.0, 20.0, 20.0]), np.array([0.0, -1.0, 0.0])
    out = runner(one_edge(ASYMMETRIC, contact=contact), at_times(np.arange(3) * DT, force, speed), 3)
    if "contact_terms" not in out:
        return
    F = np.array([law_value(ASYMMETRIC, 1e-300), law_value(ASYMMETRIC, -ARM), law_value(ASYMMETRIC, -1e-300)])
    close(out["contact_terms"][:, 0, :, 4], (ARM * force * np.abs(F))[:, None] * np.ones(4))
    close(out["contact_terms"][:, 0, :, 3], (ARM * force * np.abs(F) * [0, 1, 0])[:, None] * np.ones(4))
    # e leaves out what the jumps of fig. 5 have moved
    left = ARM * force - [0.0, ARM * 20.0 * F[1], 0.0]
    left[1:] += ARM * 20.0 * law_value(ASYMMETRIC, -V_MIN)  # b of the first exit, taken back by that of stopping
    left[2] -= ARM * 20.0 * law_value(ASYMMETRIC, -V_MIN)
    share = 1.0 - math.exp(-1.0)  # of a mean that is as old as the step: the joint begins anew as it moves
    a = left[1] + share * (left[2] - left[1])
    close(out["contact_terms"][2, 0, 3, 0], (a - left[1]) * (1.0 - share))


def test_the_start_is_unknown_for_a_second(runner: Runner) -> None:
    """V = B = 0.1 N·m, which stands; a mean that is as old as the step takes 1 − 1/e of what is new."""
    joint = {"name": "j", "friction": {"static": 0.1, "coulomb": 0.1, "stribeck_velocity": 1}}
    for dt in (0.001, 0.003):
        out = of(runner, bands([0.01] * 4), np.array([5.0, 5.0 + dt]), [0.0, 0.03], [joint])
        distance = 0.03 * (1.0 - math.exp(-1.0)) * math.exp(-1.0)
        expected = distance / math.hypot(0.01, 0.1 * math.exp(-dt))
        close(out["contact_level"][:, 0], [0.0, expected], within=1e-12)
    assert not any(contact_of(of(runner, bands([0.01] * 4), np.arange(10) * 0.01, [0.0] * 5 + [0.06] * 5, [joint])))
    late = of(runner, bands([0.01] * 4), np.arange(450) * 0.01, [0.0] * 400 + [0.06] * 50, [joint])
    assert contact_of(late)[400:405].count(1) == 5 and not any(contact_of(late)[:400])


def test_a_level_is_at_most_1e150(runner: Runner) -> None:
    for noise, level in ((1e-100, 0.04 * counted(1, 0) / 1e-100), (1e-200, 1e150)):
        out = of(runner, one_band(0, noise), settled(np.full(1, DT)), [0.0, 0.0, 0.04])
        assert out["contact_level"][2, 0] == pytest.approx(float(level), rel=1e-9)


def test_the_first_motion_begins_anew(runner: Runner) -> None:
    """At rest for 5 s V is gone. Then the joint moves, and 0.08 of the 0.1 N·m that it may hold turn over."""
    joint = {"name": "j", "friction": {"static": 0.1, "coulomb": 0.1, "stribeck_velocity": 1}}
    time = np.arange(1000) * 0.01
    moves = time > 5.0
    out = of(runner, bands([0.01] * 4), time, 0.1 * moves + 0.08 * moves, [joint], speed=1.0 * moves)
    pushed = of(runner, bands([0.01] * 4), time, 0.06 * (time > 4.0), [joint])
    again = of(runner, bands([0.01] * 4), time, 0.1 * moves + 0.06 * (time > 8.0), [joint], speed=1.0 * moves)
    assert not any(contact_of(out))
    assert contact_of(pushed)[401:430].count(1) > 25
    assert contact_of(again)[801:830].count(1) > 25 and not any(contact_of(again)[:800])


@pytest.mark.parametrize(("way", "found"), [(0.08, False), (0.2, True)])
def test_far_from_the_start_friction_is_known(runner: Runner, way: float, found: bool) -> None:
    """0.02 of 0.1 N·m have turned over: W hides a push of 0.015 N·m, unless the joint has moved 0.1 rad."""
    joint = {"name": "j", "friction": {"static": 0.1, "coulomb": 0.1, "stribeck_velocity": 1}}
    memory = {"effect": "presliding", "joint": 1, "displacement": 5.0 * way}
    time = np.arange(1000) * 0.01
    angle = way * np.clip(time - 1.0, 0.0, 1.0)
    force = 10.0 + (0.1 * angle / (5.0 * way) + 0.015 * (time > 8.0)) / ARM
    samples = at_times(time, force, np.gradient(angle, time), angle)
    out = runner(finger([FREE], [joint], contact=bands([0.01] * 4), extensions=[memory]), samples, 3)
    assert contact_of(out)[801:830].count(1) > 20 if found else not any(contact_of(out))
    assert not any(contact_of(out)[:800])


def test_what_returns_to_the_old_level_is_no_contact(runner: Runner) -> None:
    """Up over a second, which is slow for the band of 20 ms, and down at once: no contact. On at once: contact."""
    ramp = np.linspace(0.0, 0.05, 100)
    time = settled(np.full(130, 0.01))
    for after, found in ((0.0, False), (0.1, True)):
        e = np.concatenate([[0.0, 0.0], ramp, np.full(30, after)])
        out = of(runner, one_band(1, 0.03), time, e)
        assert out["contact"].any() == found and not out["contact"][:102].any()


# --- the end


def test_a_contact_ends_with_the_push(runner: Runner) -> None:
    """a_3 falls with 60 ms: 0.4 of the peak is left after 60·ln(1/0.4) ms = 55 ms, or less."""
    push = np.concatenate([[0.0, 0.0], np.full(400, 0.04), np.zeros(1000)])
    out = of(runner, bands([0.01] * 4), settled(np.full(1400, DT)), push)
    contact = contact_of(out)
    begin, end = contact.index(1), 2 + 400 + contact[402:].index(0)
    assert begin <= 4 and contact[begin:end] == [1] * (end - begin)
    assert 0.045 < (end - 402) * DT < 0.056
    assert contact[end:] == [0] * (1402 - end), "and does not begin again as the references go back"


def test_the_slow_end_of_a_push_is_no_contact(runner: Runner) -> None:
    """0.1 N·m within 5 s and back: the contact ends on the way, and the rest of the way leads home."""
    way = np.linspace(0.0, 0.1, 500)
    push = np.concatenate([[0.0, 0.0], way, np.full(100, 0.1), way[::-1], np.zeros(500)])
    contact = contact_of(of(runner, bands([0.01] * 4), settled(np.full(len(push) - 2, 0.01)), push))
    assert np.count_nonzero(np.diff(contact) > 0) == 1 and not any(contact[1100:])


def test_what_goes_beyond_home_ends_when_it_is_home(runner: Runner) -> None:
    """0.05 unseen for 0.5 s, then −0.04: this contact ends on the way to 0, far from 0.05."""
    way = np.linspace(0.0, 0.05, 100)
    e = np.concatenate([[0.0, 0.0], way, np.full(50, 0.05), np.full(50, -0.04), np.zeros(100)])
    contact = contact_of(of(runner, one_band(1, 0.015), settled(np.full(len(e) - 2, 0.01)), e))
    assert 152 <= contact.index(1) < 162 and not any(contact[212:])


def test_a_load_that_is_held_is_forgotten(runner: Runner) -> None:
    """The reference follows with 10 s: 0.4 of the peak is left after 10·ln(1/0.4) s = 9.2 s."""
    steps = np.concatenate([np.full(300, DT), np.full(150, 0.1)])
    out = of(runner, one_band(1, 0.01), settled(steps), [0.0, 0.0] + [0.04] * 450)
    contact, time = contact_of(out), settled(steps)
    begin, end = contact.index(1), len(contact) - contact[::-1].index(1)
    assert 9.1 < time[end] - time[begin] < 9.8 and sum(contact) == end - begin


def test_after_a_touch_friction_is_unknown(runner: Runner) -> None:
    """V is the peak of 0.04 N·m: 0.03 more are no contact at once, and are after three seconds."""
    for wait, found in ((0.2, False), (3.0, True)):
        push = np.concatenate([[0.0] * 2, np.full(30, 0.04), np.zeros(int(wait / 0.01)), np.full(20, 0.03)])
        out = of(runner, bands([0.01] * 4), settled(np.full(len(push) - 2, 0.01)), push)
        assert out["contact"][2:32].any() and out["contact"][-20:].any() == found


@pytest.mark.parametrize("clock", ["multiples", "sums", "since 1970"])
def test_no_rounding_of_a_clock_changes_a_contact(runner: Runner, clock: str) -> None:
    """Back at once to the other side: it ends with the first sample later than 20 ms, which is the third at 10 ms."""
    times: dict[str, Callable[[int], Array]] = {
        "multiples": lambda count: 0.01 * np.arange(count),
        "sums": lambda count: np.cumsum(np.full(count, 0.01)),
        "since 1970": lambda count: 1.7e9 + 0.01 * np.arange(count),
    }
    e = np.zeros(600)
    e[500], e[501:] = 0.1, -0.1
    out = of(runner, one_band(0, 0.03), times[clock](600), e)
    assert contact_of(out)[498:504] == [0, 0, 1, 1, 1, 0]


def test_contact_at_any_joint_holds_all_references(runner: Runner) -> None:
    """Joint 2's step comes while joint 1 is in contact: its reference follows with 10 s, and home stays."""
    arms: list[Any] = [{"moment_arms": [ARM, 0.0]}, {"moment_arms": [0.0, ARM]}]
    contact = bands([NEVER, 0.01, NEVER, NEVER])
    for row in contact["bands"]:
        row["noise"] = [row["noise"][0], 1.0]
    force = np.full((302, 2), 10.0)
    force[2:, 0] += 4.0
    force[102:, 1] += 4.0
    samples = at_times(settled(np.full(300, DT)), force, 0.0, tendons=2, joints=2)
    out = runner(finger(arms, 2, contact=contact | {"threshold": [NEVER] * 2}), samples, 3)
    assert out["joint_contact"][20:, 0].all() and not out["joint_contact"][:, 1].any()
    n = np.arange(1, 201)
    distance = np.max([0.04 * change(n, k, HELD) for k in range(4)], axis=0)
    close(out["contact_level"][102:, 1], distance, within=1e-12)


# --- bias, rates, states


def test_the_sample_rate_leaves_no_trace(runner: Runner) -> None:
    """Pushes that rise within 30 ms, at 1 kHz and at 500 Hz."""
    time = np.arange(0.0, 3.0, 0.001)
    e = 0.05 * np.clip((np.mod(time, 1.0) - 0.4) / 0.03, 0.0, 1.0) * (np.mod(time, 1.0) < 0.8)
    fine = of(runner, bands([0.01] * 4), time, e)
    coarse = of(runner, bands([0.01] * 4), time[::2], e[::2])
    edges = [np.flatnonzero(np.diff(contact_of(out))) * dt for out, dt in ((fine, 0.001), (coarse, 0.002))]
    assert len(edges[0]) == len(edges[1]) == 6
    close(edges[0], edges[1], within=0.0041)


def test_a_state_saved_in_contact_continues() -> None:
    description, recording = random_case(105, 150, detection=True)
    assert description["contact"]["method"] == "bands"
    contact = np.flatnonzero(np.ravel(NATIVE(description, recording, 1)["contact"]))
    assert_state_continues(description, recording, 1, [int(contact[0]) + 1, int(contact[len(contact) // 2])])


def test_standard_deviation_adds_variances(runner: Runner) -> None:
    """P after the update and (0.002 + 0.0001·10 N)²; already at the first sample."""
    contact = {"threshold": [NEVER], "deviation": [0.002], "deviation_per_force": [1e-4]}
    out = of(runner, contact, np.arange(3) * 0.1, [0.0] * 3, bias=HALF)
    close(out["compensated_torque_std"][:, 0], np.sqrt(0.03 / np.array([1.0, 4.0, 7.0]) + 0.003**2))
