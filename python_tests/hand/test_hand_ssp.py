"""The SSP package of a hand: fmpy runs it, and gives what `run` gives."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import tendonfmu as tf
from small_hand import FINGERS, RATE, write_wrist_hand
from tendonfmu.commands.hand.results import START_VALUES, build_hand_ssp

STEPS = 150
STEP = 1.0 / RATE  # s
OUTPUTS = [f"{name}.{output}[2]" for name in FINGERS for output in ("compensated_torque", "joint_angle")]

Signals = dict[str, NDArray[np.float64]]


def inputs_of(hand: tf.Hand, recording: Path) -> Signals:
    """Inputs of the system by name, as the split recordings have them."""
    signals: Signals = {}
    for name, samples in tf.split_recording(hand, recording).items():
        groups = ["tendon_force", "tendon_position", *(["joint_position"] if hand.wrist and name != "wrist" else [])]
        for group in groups:
            for i, values in enumerate(samples[group].T, start=1):
                wrist = group == "joint_position" and i == 1
                signals[f"wrist_{group}[1]" if wrist else f"{name}_{group}[{i}]"] = values
    return signals


def run_fmpy(package: Path, signals: Signals) -> Signals:
    """Its inputs reach the FMUs a step later, and its rows carry the time at the beginning of the step."""
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import read_ssv

    def later(values: NDArray[np.float64]) -> Callable[[float], float]:
        return lambda time: float(values[round(time / STEP) + 1])

    table = simulate_ssp(
        str(package),
        stop_time=(STEPS - 0.5) * STEP,
        step_size=STEP,
        parameter_set=read_ssv(str(package), START_VALUES),
        input={name: later(values) for name, values in signals.items()},
    )
    found = {name: np.asarray(table[name]) for name in OUTPUTS}
    assert all(np.array_equal(table[name.replace(".", "_", 1)], values) for name, values in found.items())
    return {name: values[1:] for name, values in found.items()}  # its first step has no inputs yet


@pytest.mark.parametrize("wrist", ["", "measured"])
def test_fmpy_gives_what_run_gives(tmp_path: Path, wrist: str) -> None:
    file, recording, _ = write_wrist_hand(tmp_path, wrist)
    hand = tf.read_hand(file)
    package, again = (build_hand_ssp(hand, tmp_path / name, recording) for name in ("hand.ssp", "again.ssp"))
    assert package.read_bytes() == again.read_bytes()
    found = run_fmpy(package, inputs_of(hand, recording))
    expected = tf.run_hand(hand, recording).columns()
    for name in OUTPUTS:
        assert np.ptp(expected[name][:STEPS]) > 1e-3
        np.testing.assert_allclose(found[name], expected[name][1:STEPS], rtol=0, atol=1e-14, err_msg=name)


def test_a_wrist_with_tendons_gives_its_angle_to_all_fingers(tmp_path: Path) -> None:
    """By connections, so a step later: the fingers' wrist angle in a row is that of the wrist in the row before."""
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import read_ssv

    file, recording, _ = write_wrist_hand(tmp_path, "tendons")
    hand = tf.read_hand(file)
    package = build_hand_ssp(hand, tmp_path / "hand.ssp", recording)
    signals = {name: values for name, values in inputs_of(hand, recording).items() if name != "wrist_joint_position[1]"}
    inputs = {
        name: lambda time, values=values: float(values[round(time / STEP) + 1]) for name, values in signals.items()
    }
    table = simulate_ssp(
        str(package), stop_time=1.0, step_size=STEP, parameter_set=read_ssv(str(package), START_VALUES), input=inputs
    )
    expected = tf.run_hand(hand, recording).columns()["wrist.joint_angle[1]"]
    np.testing.assert_allclose(table["wrist.joint_angle[1]"][1:100], expected[1:100], rtol=0, atol=1e-14)
    for name in FINGERS:
        np.testing.assert_array_equal(table[f"{name}.joint_angle[1]"][2:], table["wrist.joint_angle[1]"][1:-1])
