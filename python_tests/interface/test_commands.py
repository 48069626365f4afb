"""Each command is its function plus reading and writing: same options, same defaults, same results."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tendonfmu as tf
from command import Call
from repository_paths import ROOT

DEMO = ROOT / "examples/demo_recording"
FINGER, INDEX = DEMO / "two_joints.json", DEMO / "index_finger_calibrated.json"


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    """Twenty seconds."""
    return pd.read_parquet(DEMO / "two_joints_training.parquet").iloc[:10000]


@pytest.fixture(scope="module")
def recording_file(frame: pd.DataFrame, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("recording") / "monday.parquet"
    frame.to_parquet(file)
    return file


@pytest.mark.filterwarnings("ignore::tendonfmu.estimate.fitting.FitWarning")
def test_fit(frame: pd.DataFrame, recording_file: Path, tmp_path: Path, call: Call) -> None:
    options = ("--fix", "*.cover.*", "--holdout", 0.2)
    answer = call("fit", FINGER, recording_file, "-o", tmp_path / "f.json", "--report", tmp_path / "r.json", *options)
    assert answer.status == 0, answer
    report = json.loads((tmp_path / "r.json").read_text())
    values = [each["value"] for each in report["parameters"]]
    for recordings in (frame, [tf.read_recording(recording_file)], str(recording_file)):
        found = tf.fit(tf.read_finger(FINGER).to_dict(), recordings, fix="*.cover.*", holdout=0.2)
        # rounding differs with where the arrays are in memory
        assert found.parameters["value"].tolist() == pytest.approx(values, rel=1e-6)
    table = found.parameters
    assert list(table.index) == [each["path"] for each in report["parameters"]] and "cover" not in "".join(table.index)
    assert table["standard_error"].tolist() == pytest.approx(
        [each["standard_error"] for each in report["parameters"]], rel=1e-3
    )
    assert table["identified"].tolist() == [each["identified"] for each in report["parameters"]]
    assert table["identified"].dtype == bool and table["value"].dtype == float
    assert found.held_out_rms is not None
    for own, reported in ((found.residual_rms, "train"), (found.held_out_rms, "held_out")):
        assert own.tolist() == pytest.approx(report["residual"][reported]["rms"], rel=1e-6)
    found.write(tmp_path / "own.json")
    assert tf.read_finger(tmp_path / "own.json") == found.finger
    assert "numbers identified" in found._repr_html_()


@pytest.mark.filterwarnings("ignore::tendonfmu.detect.tuning.TuneWarning")
def test_tune(frame: pd.DataFrame, recording_file: Path, tmp_path: Path, call: Call) -> None:
    answer = call("tune", FINGER, recording_file, "-o", tmp_path / "t.json", "--report", tmp_path / "r.json")
    assert answer.status == 0, answer
    found = tf.tune(FINGER, frame)
    assert set(found.finger.to_dict()["contact"]) == set(tf.read_finger(tmp_path / "t.json").to_dict()["contact"])
    assert found.attained_rate == json.loads((tmp_path / "r.json").read_text())["tuned_for_per_hour"] > 6.0
    with pytest.raises(tf.InputError, match="min"):
        tf.tune(FINGER, frame, strict=True)
    assert "false alarms per hour" in found._repr_html_()


def test_score(tmp_path: Path, call: Call) -> None:
    pushes = pd.read_parquet(DEMO / "index_finger_pushes.parquet").iloc[:8000]
    pushes.rename(columns={"contact": "touch"}).to_parquet(tmp_path / "touch.parquet")
    pushes.drop(columns="contact").iloc[:1000].to_parquet(tmp_path / "free.parquet")
    free = call("score", INDEX, tmp_path / "free.parquet", "-o", tmp_path / "free.json")
    assert (
        free.err.count("no column contact") == 1
        and "tendonfmu: warning: " in free.err
        and "ScoreWarning" not in free.err
    )
    answer = call("score", INDEX, tmp_path / "touch.parquet", "--labels", "touch", "-o", tmp_path / "s.json")
    assert answer.status == 0, answer
    touched = tf.read_recording(tmp_path / "touch.parquet", label="touch")
    found = tf.score(INDEX, [touched], labels="touch")
    report = json.loads((tmp_path / "s.json").read_text())
    numbers = (found.events, found.found, found.false_alarms, found.median_delay)
    assert numbers == tuple(report[name] for name in ("events", "found", "false_alarms", "median_delay_s"))
    assert found.events > 1
    again = tf.score(tf.read_finger(INDEX), pushes)
    assert (again.events, again.found, again.median_delay) == (found.events, found.found, found.median_delay)
    again.write(tmp_path / "own.json")
    assert json.loads((tmp_path / "own.json").read_text())["events"] == found.events
    assert f"{found.found} of {found.events} events found" in found._repr_html_()
    with pytest.raises(tf.InputError, match=r"DataFrame: no column pressed; expected a label"):
        tf.score(INDEX, pushes, labels="pressed")


def test_diagnose(frame: pd.DataFrame, tmp_path: Path) -> None:
    """Ten seconds, which need not tell anything: what a diagnosis finds is tested elsewhere."""
    found = tf.diagnose(FINGER, frame.iloc[:5000])
    assert found.verdict in ("adequate", "explained", "partly explained", "unexplained")
    assert found.report["verdict"] == found.verdict and found.report["gain"]["value"] == found.gain.value
    assert [each.effect for each in found.causes] == [each["effect"] for each in found.report["causes"]]
    written = found.write(tmp_path / "diagnosis")
    assert {file.name for file in written} >= {"diagnosis.html", "diagnosis.json", "extended.json", "extended.fmu"}
    assert tf.read_finger(tmp_path / "diagnosis/extended.json") == found.extended
    torques = tf.run(found.extended, frame.iloc[:100]).outputs["friction_torque"]
    tf.build(found.extended, tmp_path / "f.fmu")
    assert np.array_equal(tf.run(tmp_path / "f.fmu", frame.iloc[:100]).outputs["friction_torque"], torques)
    assert found.verdict in found._repr_html_()


@pytest.mark.parametrize("tested", [False, True])
def test_diagnose_refuses_what_is_too_short_to_hold_out(frame: pd.DataFrame, tested: bool) -> None:
    """It said "adequate": but nothing can be named without parts that are held out."""
    tests = [frame.iloc[5000:]] if tested else []
    with pytest.raises(tf.InputError, match=r"DataFrame.*: 5 s of free motion; expected at least 8 s, better a minute"):
        tf.diagnose(FINGER, frame.iloc[:2500], test=tests)
    with pytest.raises(tf.InputError, match=r"^2 recordings: 6 s of free motion; expected at least 8 s"):
        tf.diagnose(FINGER, [frame.iloc[:1500], frame.iloc[1500:3000]], test=tests)


def test_sources_that_no_function_takes() -> None:
    for function in (tf.fit, tf.tune, tf.score, tf.diagnose):
        with pytest.raises(tf.InputError, match="no recording; expected at least one"):
            function(FINGER, [])
        with pytest.raises(tf.InputError, match="int; expected paths, DataFrames or Recordings"):
            function(FINGER, 3)
        with pytest.raises(tf.InputError, match="int; expected a path, a dictionary or a Finger"):
            function(3, [DEMO / "two_joints_training.parquet"])


def test_a_command_says_once_which_columns_it_ignores(frame: pd.DataFrame, tmp_path: Path, call: Call) -> None:
    file = tmp_path / "rec.parquet"
    frame.iloc[:100].assign(current=1.0, phase="start").to_parquet(file)
    for _ in range(2):  # also in the same process again
        answer = call("run", FINGER, file, "-o", tmp_path / "out.csv")
        assert answer.status == 0
        first, *rest = answer.err.splitlines()
        assert first.startswith(f"tendonfmu: warning: {file}: ignored columns: 'current', 'phase'; a recording has ")
        assert not [line for line in rest if "warning" in line]
    assert call("run", FINGER, file, "-o", tmp_path / "out.csv", "--quiet").err == ""


@pytest.mark.filterwarnings("ignore::tendonfmu.interface.calibrating.CalibrationWarning")
def test_calibrate(frame: pd.DataFrame, tmp_path: Path) -> None:
    """In memory and from files: the same finger; what it writes is what the command writes."""
    previous = tmp_path / "previous.json"
    previous.write_text(FINGER.read_text(), encoding="utf-8")
    file = tmp_path / "monday.parquet"
    frame.to_parquet(file)
    found, again = (tf.calibrate(FINGER, given, previous=previous) for given in (frame, file))
    left = [each.report["error"]["calibrated"] for each in (found, again)]
    assert left[0] == pytest.approx(left[1], rel=1e-6)
    written = found.write(tmp_path / "out")
    assert {path.name for path in written} == {"calibration.html", "calibration.json", "finger.json", "finger.fmu"}
    assert tf.read_finger(tmp_path / "out" / "finger.json") == found.finger
    assert "mN·m left" in repr(found) and "srcdoc" in found._repr_html_()


def test_messages_name_what_was_given(frame: pd.DataFrame) -> None:
    """They named files in a temporary folder that was gone."""
    tendons = {"tendon_force": np.zeros((9, 3)), "tendon_position": np.zeros((9, 3))}
    few = tf.Recording.from_arrays(np.arange(9.0), **tendons, name="mine")
    for refused, words in {
        lambda: tf.calibrate(FINGER, frame.iloc[:300]): "DataFrame: no sample to measure the gain on",
        lambda: tf.calibrate(FINGER, [frame, frame]): "DataFrame 2: given twice, as DataFrame 1; expected each",
        lambda: tf.calibrate(FINGER, frame, test=frame): "DataFrame: a test, but trained on as well, as DataFrame; ",
        lambda: tf.calibrate(FINGER, few): "mine: 3 columns tendon_force[...], expected 4",
        lambda: tf.convert(DEMO / "two_joints_training.parquet", {"format": "x"}): 'map: format = "x"',
    }.items():
        with pytest.raises(tf.InputError) as error:
            refused()
        assert str(error.value).startswith(words), str(error.value)
    file = DEMO / "two_joints_training.parquet"
    with pytest.raises(tf.InputError, match=rf"^{re.escape(str(file))}: "):
        tf.calibrate(FINGER, tf.read_recording(file)[:0.5])
