"""`run` and `Runner`: the same bits as the FMU, and what they refuse."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import tendonfmu as tf
from command import Call
from repository_paths import ROOT

INDEX = ROOT / "examples/demo_recording/index_finger_calibrated.json"
PUSHES = ROOT / "examples/demo_recording/index_finger_pushes.parquet"
SAMPLES = 1500


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    """Three seconds around a push."""
    whole = pd.read_parquet(PUSHES)
    begin = int(whole["contact"].to_numpy().argmax()) - 500
    return whole.iloc[begin : begin + SAMPLES].reset_index(drop=True)


def test_run_gives_the_bits_of_the_fmu(frame: pd.DataFrame, tmp_path: Path, call: Call) -> None:
    """All columns, in the order of the command."""
    frame.to_parquet(tmp_path / "rec.parquet")
    tf.build(INDEX, tmp_path / "f.fmu")
    for model, out in ((tmp_path / "f.fmu", "fmu.parquet"), (INDEX, "json.parquet")):
        answer = call("run", model, tmp_path / "rec.parquet", "-o", tmp_path / out)
        assert answer.status == 0, answer
    found = tf.run(INDEX, frame)
    of_fmu, of_json = (pd.read_parquet(tmp_path / name) for name in ("fmu.parquet", "json.parquet"))
    pd.testing.assert_frame_equal(of_json, of_fmu, check_exact=True)
    flags = found.frame.select_dtypes(bool).columns
    assert set(flags) >= {"contact", "slack[8]", "sensor_fault[8]"}
    pd.testing.assert_frame_equal(found.frame.astype(dict.fromkeys(flags, np.uint8)), of_fmu, check_exact=True)
    assert found.frame["contact"].any() and not found.frame["contact"].all()
    assert found.summary in answer.err


@pytest.mark.parametrize("kinematics", [1, 2])
def test_runner_gives_the_bits_of_run(frame: pd.DataFrame, kinematics: int) -> None:
    finger = tf.read_finger(INDEX)
    angles = tf.run(finger, frame).outputs["joint_angle"]
    recording = tf.Recording.from_frame(frame)
    groups = {**recording.groups, "joint_position": angles}
    recording = tf.Recording.from_arrays(recording.time, **groups)
    whole = tf.run(finger, recording, kinematics=kinematics).outputs
    runner = tf.Runner(finger, kinematics=kinematics)
    columns = (recording.time, *(groups[name] for name in ("tendon_force", "tendon_position", "joint_position")))
    for k, (time, force, position, angle) in enumerate(zip(*columns, strict=True)):
        sample = runner.step(time, force, position, angle)
        assert sample is runner.sample
        for name, values in sample.outputs.items():
            if name in whole:
                assert np.array_equal(np.ravel(values), np.ravel(whole[name][k])), (k, name)
        assert sample.contact is bool(whole["contact"][k])


FORCE, POSITION = [10.0, 11.0, 12.0, 13.0], [0.0, 0.001, 0.0, 0.001]


def two_joints() -> tf.Runner:
    runner = tf.Runner(ROOT / "examples/demo_recording/two_joints.json")
    runner.step(0.0, FORCE, POSITION)
    runner.step(0.01, tendon_force=np.array(FORCE) + 1, tendon_position=tuple(POSITION))
    return runner


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((0.02, FORCE[:3], POSITION), "tendon_force: 3 numbers; expected 4"),
        ((0.02, [1.0, np.nan, 1.0, 1.0], POSITION), "tendon_force[2] = nan at time 0.02 s: expected a finite number"),
        ((0.02, FORCE, [0.0, np.inf, 0.0, 0.0]), "tendon_position[2] = inf"),
        ((0.02, FORCE, None), "tendon_position"),
        ((0.02, [FORCE], POSITION), "tendon_force: shape (1, 4); expected numbers of one sample, [m]"),
        ((0.005, FORCE, POSITION), "time = 0.005 s: expected a finite number"),
        ((float("nan"), FORCE, POSITION), "time = nan s"),
        ((None, FORCE, POSITION), "time: None; expected seconds as a number"),
        ((np.ma.masked, FORCE, POSITION), "time: masked; expected seconds as a number"),
        ((0.02, np.ma.masked_equal(FORCE, 11.0), POSITION), "tendon_force[2]: masked; expected a number"),
        ((0.02, FORCE, POSITION, [0.0]), "joint_position: 1 numbers; expected 2"),
    ],
)
def test_a_bad_sample_is_named_and_changes_nothing(arguments: tuple[Any, ...], words: str) -> None:
    runner, untouched = two_joints(), two_joints()
    before = {name: values.copy() for name, values in runner.sample.outputs.items()}
    with pytest.raises(tf.InputError) as refused:
        runner.step(*arguments)
    assert words in str(refused.value), refused.value
    assert runner.save() == untouched.save()
    assert all(np.array_equal(runner.sample.outputs[name], values) for name, values in before.items())


def test_runner_saves_restores_and_resets() -> None:
    """Outputs are reused and cannot be written; a step at the same time changes nothing."""
    runner = two_joints()
    state, sample, torque = runner.save(), runner.sample, runner.sample.joint_torque
    runner.step(0.01, FORCE, POSITION)
    assert runner.save() == state
    with pytest.raises(ValueError, match="read-only"):
        torque[0] = 1.0
    expected = runner.step(0.02, FORCE, POSITION).bias_torque.copy()
    assert runner.step(0.03, FORCE, POSITION) is sample and sample.joint_torque is torque
    runner.restore(state)
    assert np.array_equal(runner.step(0.02, FORCE, POSITION).bias_torque, expected)
    runner.reset()
    assert runner.step(0.0, FORCE, POSITION).compensated_torque.tolist() == [0.0, 0.0]
    for wrong in (b"", b"x" * len(state), "text"):
        with pytest.raises(tf.InputError, match="expected one that `save` of the same finger returned"):
            runner.restore(wrong)  # type: ignore[arg-type]


def test_what_does_not_fit_is_refused(frame: pd.DataFrame) -> None:
    with pytest.raises(tf.InputError, match=r"DataFrame: 8 columns tendon_force\[...\], expected 4"):
        tf.run(ROOT / "examples/demo_recording/two_joints.json", frame)
    with pytest.raises(tf.InputError, match=r"DataFrame: no column joint_velocity\[1\]"):
        tf.run(INDEX, frame, kinematics=3)
    with pytest.raises(tf.InputError, match=r"rec\.parquet: a recording; expected FINGER\.json or FINGER\.fmu"):
        tf.run("rec.parquet", frame)
