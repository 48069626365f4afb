"""Contact at rest (docs/reference/semantics/rest.md): by hand, and random fingers against the oracle.

By hand: one joint, one tendon of arm 0.01 m without friction, τ = 0.01 m · f0. Times are multiples of 1/8 s.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from analytic_cases import ARM, NO_UPDATE, Outputs, close, finger
from analytic_cases import recording as at_times
from random_fingers import random_case
from runners import NATIVE, Runner, product

DT = 0.125
TRAVEL = 1e-5  # m
QUICK = {"travel": TRAVEL, "settle_time": 2 * DT, "averaging_time": 0.0, "threshold": [0.005], "fall_share": 0.1}
LEARNS = {"drift_variance": 1.0, "noise_std": 0.1, "initial_variance": 0.0}  # K = 0.92 and more


def run(
    runner: Runner, force: Any, position: Any = 0.0, rest: Any = None, bias: Any = NO_UPDATE, **contact: Any
) -> Outputs:
    description = finger(
        [{"moment_arms": [ARM]}],
        bias=bias,
        contact={"threshold": [1e6], "rest": QUICK | (rest or {})} | contact,
    )
    count = len(np.atleast_1d(force)) if np.ndim(force) else len(position)
    return runner(description, at_times(np.arange(count) * DT, force, 0.0, position=position), 3)


def with_rest(description: Any, rest: Any) -> Any:
    return description | {"contact": description["contact"] | {"rest": rest}}


def flags(out: Outputs) -> list[int]:
    assert (np.ravel(out["contact"]) == out["joint_contact"].any(axis=1)).all()
    assert not (np.ravel(out["contact_at_rest"]) & ~np.ravel(out["contact"])).any()
    return [int(each) for each in np.ravel(out["contact_at_rest"])]


def contacts(out: Outputs) -> list[int]:
    return [int(each) for each in np.ravel(out["contact"])]


# --- the rest and the change


def test_the_change_counts_from_the_begin_of_the_rest(runner: Runner) -> None:
    """Marked at sample 0, standing from sample 2 on: 0 there, then 0.01 m · (f0 − f0 of sample 2)."""
    out = run(runner, [10.0, 10.1, 10.2, 10.3, 10.6, 11.0, 10.2])
    close(out["contact_change"][:, 0], ARM * np.array([0.0, 0.0, 0.0, 0.1, 0.4, 0.8, 0.0]))
    assert flags(out) == [0, 0, 0, 0, 0, 1, 0]
    assert contacts(out) == flags(out)


def test_torque_and_motor_postpone_the_rest(runner: Runner) -> None:
    """A change of 0.6 N at sample 2, or a motor that moves there: the wait begins again, the rest at sample 4."""
    stepped = run(runner, [10.0, 10.0, 10.6, 10.6, 10.6, 11.2])
    moved = run(runner, [10.0, 10.0, 10.0, 10.0, 10.0, 10.6], [0.0, 0.0, 2e-5, 2e-5, 2e-5, 2e-5])
    for out in (stepped, moved):
        assert flags(out) == [0, 0, 0, 0, 0, 1]
        close(out["contact_change"][:, 0], ARM * np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.6]))


def test_the_bound_grows_with_force_and_the_root_of_the_time(runner: Runner) -> None:
    """Standing from sample 2: D = 0.005 + 0.001·11 + 0.016·√t at 11 N, 0.024 at t = 0.25 s and 0.032 at 1 s."""
    rest = {"threshold_per_force": [0.001], "creep": [0.016]}
    force = np.array([8.0, 8.0, 8.0, 11.0, 11.0, 11.0])  # 0.03 of change, D = 0.0217, 0.024, 0.0258
    assert flags(run(runner, force, rest=rest)) == [0, 0, 0, 1, 1, 1]
    later = np.array([8.0] * 11 + [11.0, 11.0])  # t = 1.125 s
    assert flags(run(runner, later, rest=rest)) == [0] * 13


def test_averaging(runner: Runner) -> None:
    """The mean of the forces follows a step by 1 − exp(−t/T); no rest while it still changes is asked for here."""
    out = run(runner, [10.0] * 3 + [11.0] * 5, rest={"averaging_time": 0.2, "threshold": [1.0]})
    t = np.arange(1, 6) * DT
    close(out["contact_change"][3:, 0], 0.01 * (1.0 - np.exp(-t / 0.2)))


# --- what ends it


def test_a_motor_that_gives_way_still_stands(runner: Runner) -> None:
    """Force up and motor back is a push; force up and motor forth is a move, which ends the rest."""
    force = [10.0, 10.0, 10.0, 11.0, 11.0, 11.0]
    yields = run(runner, force, [0.0, 0.0, 0.0, -1e-4, -1e-4, -1e-4])
    drives = run(runner, force, [0.0, 0.0, 0.0, 1e-4, 1e-4, 1e-4])
    assert flags(yields) == [0, 0, 0, 1, 1, 1]
    assert flags(drives) == [0, 0, 0, 0, 0, 0]


def test_a_load_that_goes_ends_the_contact_and_another_rest_begins(runner: Runner) -> None:
    """From 0.02 N·m down to 0.012: more than 0.005 + 0.1·0.02. The rest of it is the new rest's own."""
    out = run(runner, [10.0, 10.0, 10.0, 12.0, 12.0, 11.2, 11.2, 11.2, 11.2, 12.0])
    assert flags(out) == [0, 0, 0, 1, 1, 0, 0, 0, 0, 1]
    close(out["contact_change"][4:, 0], ARM * np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.8]))
    held = run(runner, [10.0, 10.0, 10.0, 12.0, 12.0, 11.4, 11.4])  # by 0.006, within 0.007
    assert flags(held) == [0, 0, 0, 1, 1, 1, 1]


def test_what_changes_suddenly_is_found_beside_what_creeps(runner: Runner) -> None:
    """m follows c with T = 0.25 s: a ramp of 0.004 N·m a sample stays below y = 0.02, a step of 0.03 does not."""
    rest = {"threshold": [0.5], "innovation": {"time": 0.25, "threshold": [0.02]}}
    ramp = 10.0 + 0.4 * np.maximum(np.arange(14) - 2, 0)
    out = run(runner, ramp, rest=rest)
    assert flags(out) == [0] * 14
    close(out["contact_change"][2:, 0], 0.004 * np.arange(12))
    stepped = ramp + 3.0 * (np.arange(14) >= 10)
    assert flags(run(runner, stepped, rest=rest)) == [0] * 10 + [1] * 4


# --- the bias and the load


def test_the_bias_does_not_learn_the_load_of_a_rest(runner: Runner) -> None:
    """Neither at rest, however long, nor as the motor moves on, until release_time after the rest; without the key it
    does so at once."""
    force, position = [10.0] * 4 + [12.0] * 12, [0.0] * 10 + [2e-5 * k for k in range(1, 7)]
    out = run(runner, force, position, bias=LEARNS, release_time=4 * DT)
    assert flags(out) == [0] * 4 + [1] * 6 + [0] * 6
    assert contacts(out)[4:13] == [1] * 9
    close(out["bias_torque"][4:13, 0], 0.1)
    close(out["compensated_torque"][4:13, 0], 0.02)
    assert out["bias_torque"][-1, 0] > 0.119 and contacts(out)[-1] == 0


def test_no_rest_no_outputs_and_nothing_else_changes() -> None:
    description, recording = random_case(300, 300, detection=True)
    plain = NATIVE(description, recording, 1)
    assert not {"contact_change", "contact_at_rest"} & set(plain)
    never = {"travel": 0.0, "threshold": [1e9] * len(description["joints"]), "settle_time": 1e9}
    watched = NATIVE(with_rest(description, never), recording, 1)
    for name, values in plain.items():
        np.testing.assert_array_equal(watched[name], values, err_msg=name)


def test_positions_are_needed_with_every_source() -> None:
    native = product("model.native")
    description, recording = random_case(301, 60)
    n = len(description["joints"])
    without = {name: values for name, values in recording.items() if name != "tendon_position"}
    native.Instance.from_description(description, 2).run(without)
    watched = native.Instance.from_description(with_rest(description, QUICK | {"threshold": [1.0] * n}), 2)
    with pytest.raises(
        native.NativeError, match=r"tendon_position is missing: this kinematics source, or contact\.rest"
    ):
        watched.run(without)
    bad = recording | {"tendon_position": recording["tendon_position"] * np.nan}
    with pytest.raises(native.NativeError, match=r"tendon_position\[1\] = "):
        watched.run(bad)
