"""Sensor faults (docs/reference/semantics/sensors.md): by hand, and random fingers against the oracle.

By hand: one joint between two tendons of arms ±0.01 m and k = 1000 N/m without friction, 20 N each, in steps of 1/8 s.
A motion turns the joint by q and stretches both springs by c: x0 = ±0.01·q + (20 N + c)/k, f0 = 20 N + c.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from analytic_cases import ARM, NO_UPDATE, Array, Outputs, close, finger
from random_fingers import random_case
from runners import NATIVE, Runner, product

DT = 0.125
STIFFNESS, TENSION = 1000.0, 20.0
FAULT = {
    "hold_time": 1.5 * DT,
    "force_resolution": 0.01,
    "position_resolution": 1e-6,
    "jump_margin": 0.5,
    "spring_margin": 0.5,
    "recovery_time": 2 * DT,
}
LEARNS = {"drift_variance": 1.0, "noise_std": 0.1, "initial_variance": 0.0}


def pair(fault: Any = None, bias: Any = NO_UPDATE, tendons: int = 2, **contact: Any) -> dict[str, Any]:
    arms = [ARM, -ARM, ARM, -ARM][:tendons]
    data = finger(
        [{"moment_arms": [arm], "stiffness": STIFFNESS} for arm in arms],
        bias=bias,
        contact={"threshold": [0.02]} | contact,
    )
    return data | {"sensor_fault": FAULT | (fault or {})}


def moving(samples: int, q: Any = None, tension: Any = None, tendons: int = 2) -> dict[str, Array]:
    """A recording of both: q turns by 0.01 rad a sample and the tension grows by 0.2 N, unless given."""
    k = np.arange(samples)
    q = 0.01 * k if q is None else np.asarray(q, dtype=float)
    tension = TENSION + 0.2 * k if tension is None else np.asarray(tension, dtype=float)
    side = np.array([1.0, -1.0, 1.0, -1.0][:tendons])
    force = np.repeat(np.reshape(tension, (-1, 1)), tendons, axis=1)
    position = np.outer(q, ARM * side) + force / STIFFNESS
    return {"time": k * DT, "tendon_force": force, "tendon_position": position, "joint_position": q.reshape(-1, 1)}


def changed(recording: dict[str, Array], name: str, tendon: int, rows: slice, values: Any) -> dict[str, Array]:
    copied = recording[name].copy()
    copied[rows, tendon] = values
    return recording | {name: copied}


def faults(out: Outputs, tendon: int = 0) -> list[int]:
    return [int(each) for each in out["sensor_fault"][:, tendon]]


def observable(out: Outputs) -> list[int]:
    return [int(each) for each in np.ravel(out["contact_observable"])]


# --- what is a fault


def test_sound_sensors_have_none(runner: Runner) -> None:
    out = runner(pair(), moving(20), 1)
    assert not out["sensor_fault"].any()
    assert observable(out) == [1] * 20


@pytest.mark.parametrize("source", [1, 2])
def test_a_force_that_jumps_to_zero(runner: Runner, source: int) -> None:
    """At sample 8, at once and at no other tendon; no contact although 0.2 N·m are missing."""
    out = runner(pair(), changed(moving(16), "tendon_force", 0, slice(8, None), 0.0), source)
    assert faults(out) == [0] * 8 + [1] * 8
    assert faults(out, 1) == [0] * 16
    assert observable(out) == [1] * 8 + [0] * 8
    assert not out["contact"].any()
    close(out["joint_torque"][8:, 0], -ARM * (TENSION + 0.2 * np.arange(8, 16)))


def test_a_force_may_change_as_fast_as_its_spring(runner: Runner) -> None:
    """4 N within a sample: the joint is turned by a push, by 0.4 rad, so both springs change by 4 N."""
    q = np.where(np.arange(12) < 6, 0.0, 0.4)
    pushed = moving(12, q=q, tension=np.full(12, TENSION))
    pushed["tendon_position"] = np.full((12, 2), TENSION / STIFFNESS)
    pushed["tendon_force"] = TENSION - np.outer(q, [1.0, -1.0]) * ARM * STIFFNESS
    out = runner(pair(), pushed, 1)
    assert not out["sensor_fault"].any()
    assert out["contact"].any()


def test_a_force_that_stands_while_its_spring_is_stretched(runner: Runner) -> None:
    """Frozen from sample 4 on; 0.2 N a sample are missing, and 0.5 + 10·0.02 N are allowed: 0.8 N at sample 8."""
    out = runner(
        pair({"force_resolution": 0.02}), changed(moving(14), "tendon_force", 0, slice(5, None), TENSION + 0.2 * 4), 1
    )
    assert faults(out) == [0] * 8 + [1] * 6
    assert not out["contact"].any()


def test_a_force_may_not_stand_for_longer_than_it_ever_does(runner: Runner) -> None:
    """At rest from sample 4 on, where its spring says the same: later than half a second is the fifth sample after."""
    still = {name: np.concatenate([each[:5], np.repeat(each[4:5], 9, axis=0)]) for name, each in moving(14).items()}
    still["time"] = np.arange(14) * DT
    assert not any(faults(runner(pair(), still, 1)))
    out = runner(pair({"longest_stand": 0.5}), still, 1)
    assert faults(out) == [0] * 9 + [1] * 5 and not out["contact"].any()


def test_a_position_that_stands_while_the_joint_turns(runner: Runner) -> None:
    """From sample 4 on: 0.3 N of stretch and 0.1 N of turning a sample are missing, 0.5 + 0.01 + share allowed."""
    recording = moving(14)
    out = runner(
        pair(), changed(recording, "tendon_position", 0, slice(5, None), recording["tendon_position"][4, 0]), 1
    )
    first = faults(out).index(1)
    assert first == 6 and faults(out)[first:] == [1] * (14 - first)
    assert observable(out) == [1] * 14, "the other tendon tells the angle, and the torque is right"
    close(out["joint_angle"][first:, 0], recording["joint_position"][first:, 0])
    assert out["joint_angle"][first - 1, 0] != pytest.approx(recording["joint_position"][first - 1, 0], abs=1e-4)


def test_a_slack_tendon_is_no_fault(runner: Runner) -> None:
    """Tendon 1 goes slack by and by and is wound up again: its force stands at 0 while its motor moves."""
    k = np.arange(40)
    stretch = 8.0 - 0.45 * np.minimum(k, 40 - k)
    recording = moving(40, q=np.zeros(40), tension=np.full(40, TENSION))
    recording["tendon_force"][:, 0] = np.maximum(stretch, 0.0)
    recording["tendon_position"][:, 0] = stretch / STIFFNESS
    recording["tendon_force"][:, 1] += 0.1 * (k % 2)
    recording["tendon_position"][:, 1] = recording["tendon_force"][:, 1] / STIFFNESS
    out = runner(pair(), recording, 2)
    assert (recording["tendon_force"][:, 0] == 0.0).sum() > 3
    assert not out["sensor_fault"].any()


# --- what a fault does


def test_the_row_leaves_and_the_angle_goes_on_without_a_jump(runner: Runner) -> None:
    recording = moving(16)
    plain = runner(pair(), recording, 1)
    out = runner(pair(), changed(recording, "tendon_force", 0, slice(8, None), 0.0), 1)
    close(out["joint_angle"], plain["joint_angle"])
    close(out["joint_speed"], plain["joint_speed"])


def test_the_bias_waits_and_begins_anew(runner: Runner) -> None:
    """It stays while the force fails, and is τ − T = τ once it is well."""
    recording = changed(moving(20), "tendon_force", 0, slice(8, 12), 0.0)
    recording["tendon_force"][:, 1] += 1.0
    recording["tendon_position"][:, 1] += 1.0 / STIFFNESS
    out = runner(pair(bias=LEARNS), recording, 1)
    well = 8 + faults(out)[8:].index(0)
    assert well == 13, "last contradicted at sample 11, recovery_time before 13"
    close(out["bias_torque"][8:well, 0], out["bias_torque"][7, 0])
    close(out["bias_torque"][well, 0], out["joint_torque"][well, 0])
    assert observable(out)[8:well] == [0] * 5 and observable(out)[well:] == [1] * (20 - well)
    close(out["compensated_torque"][well, 0], 0.0)


def test_bands_begin_anew(runner: Runner) -> None:
    """Blind from sample 8 on, watched again with 13: level 0 there, and the change is counted from there."""
    recording = changed(moving(24), "tendon_force", 0, slice(8, 12), 0.0)
    rows = [{"noise": [1e-3]}] * 4
    out = runner(pair(method="bands", bands=rows), recording, 1)
    assert faults(out)[8:13] == [1] * 5 and not out["contact"][8:14].any()
    close(out["contact_level"][8:14], 0.0)


def test_a_second_fault_leaves_nothing_to_tell_the_angle(runner: Runner) -> None:
    """Positions of both tendons of one joint: the second one's row cannot leave."""
    recording = moving(24, tendons=2)
    recording = changed(recording, "tendon_position", 0, slice(5, None), recording["tendon_position"][4, 0])
    both = changed(recording, "tendon_force", 1, slice(12, None), 0.0)
    out = runner(pair(), both, 1)
    assert observable(out)[6:] == [1] * 18 and not out["sensor_fault"][:, 1].any(), "nothing tells of tendon 2 any more"
    out = runner(pair(), both, 2)
    assert out["sensor_fault"][12:].all() and observable(out)[12:] == [0] * 12


def test_no_key_no_outputs_and_nothing_else_changes() -> None:
    description, recording = random_case(500, 300, detection=True)
    plain = NATIVE(description, recording, 1)
    assert not {"sensor_fault", "contact_observable"} & set(plain)
    watched = NATIVE(description | {"sensor_fault": {"jump_margin": 1e9, "spring_margin": 1e9}}, recording, 1)
    for name, values in plain.items():
        np.testing.assert_array_equal(watched[name], values, err_msg=name)


def test_positions_are_needed_with_every_source() -> None:
    native = product("model.native")
    recording = {name: values for name, values in moving(5).items() if name != "tendon_position"}
    with pytest.raises(native.NativeError, match=r"tendon_position is missing: .* sensor_fault"):
        native.Instance.from_description(pair(), 2).run(recording)


# --- the FMU, the saved state, the derivative


def test_the_derivative_is_that_of_the_rows_in_use() -> None:
    """The failing tendon no longer moves the angle; before, each of the two did by half."""
    native = product("model.native")
    recording = changed(moving(12), "tendon_force", 0, slice(8, None), 0.0)
    expected = {6: [0.5 / ARM, -0.5 / ARM], 10: [0.0, -1.0 / ARM]}
    for samples, slopes in expected.items():
        one = native.Instance.from_description(pair(), 1)
        one.run({name: values[:samples] for name, values in recording.items()})
        again = native.Instance.from_description(pair(), 1)
        again.restore_state(one.save_state())
        for each in (one, again):
            found = [each.directional_derivative({"tendon_position": unit})["joint_angle"][0] for unit in np.eye(2)]
            close(np.array(found), np.array(slopes))
