"""Each function gives what its command gives, from memory and from files, and names what it was given."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import diagnosis_examples as examples
import tendonfmu as tf
from command import Call
from repository_paths import ROOT
from tendonfmu.commands.diagnose import Diagnosis

DEMO = ROOT / "examples/demo_recording"
FINGER, INDEX = DEMO / "two_joints.json", DEMO / "index_finger_calibrated.json"
TRAINING, PUSHES = DEMO / "two_joints_training.parquet", DEMO / "index_finger_pushes.parquet"


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    """Twenty seconds."""
    return pd.read_parquet(TRAINING).iloc[:10000]


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
    for recordings in (frame, [tf.read_recording(recording_file)]):
        found = tf.fit(tf.read_finger(FINGER).to_dict(), recordings, fix="*.cover.*", holdout=0.2)
        table = found.parameters
        assert list(table.index) == [entry["path"] for entry in report["parameters"]]
        for column, within in (("value", 1e-6), ("standard_error", 1e-3)):  # rounding differs with places in memory
            expected = [entry[column] for entry in report["parameters"]]
            assert table[column].tolist() == pytest.approx(expected, rel=within)
    assert "cover" not in "".join(table.index)
    assert table["identified"].tolist() == [entry["identified"] for entry in report["parameters"]]
    assert found.held_out_rms is not None
    for own, reported in ((found.residual_rms, "train"), (found.held_out_rms, "held_out")):
        assert own.tolist() == pytest.approx(report["residual"][reported]["rms"], rel=1e-6)
    found.write(tmp_path / "own.json")
    assert tf.read_finger(tmp_path / "own.json") == found.finger
    assert found._repr_html_().count("<li>") == len(found.warnings)


@pytest.mark.filterwarnings("ignore::tendonfmu.detect.tuning.TuneWarning")
def test_tune(frame: pd.DataFrame, recording_file: Path, tmp_path: Path, call: Call) -> None:
    answer = call("tune", FINGER, recording_file, "-o", tmp_path / "t.json", "--report", tmp_path / "r.json")
    assert answer.status == 0, answer
    found = tf.tune(FINGER, frame)
    assert found.finger.to_dict()["contact"] == tf.read_finger(tmp_path / "t.json").to_dict()["contact"]
    assert found.attained_rate == json.loads((tmp_path / "r.json").read_text())["kept_out"]["per_hour"]
    with pytest.raises(tf.InputError, match="expected minutes"):
        tf.tune(FINGER, frame.iloc[:600])


def test_score(tmp_path: Path, call: Call) -> None:
    pushes = pd.read_parquet(PUSHES).iloc[:8000]
    pushes.rename(columns={"contact": "touch"}).to_parquet(tmp_path / "touch.parquet")
    answer = call("score", INDEX, tmp_path / "touch.parquet", "--labels", "touch", "-o", tmp_path / "s.json")
    assert answer.status == 0, answer
    report = json.loads((tmp_path / "s.json").read_text())
    names = ("events", "found", "false_alarms", "median_delay_s")
    touched = tf.read_recording(tmp_path / "touch.parquet", label="touch")
    for found in (tf.score(INDEX, [touched], labels="touch"), tf.score(tf.read_finger(INDEX), pushes)):
        numbers = (found.events, found.found, found.false_alarms, found.median_delay)
        assert numbers == tuple(report[name] for name in names) and found.events > 1
    with pytest.raises(tf.InputError, match=r"DataFrame: no column pressed; expected a label"):
        tf.score(INDEX, pushes, labels="pressed")


def test_a_diagnosis_is_written_with_a_finger_that_runs(frame: pd.DataFrame, tmp_path: Path) -> None:
    """One that is made up: what `diagnose` finds is tested elsewhere."""
    found = Diagnosis(examples.one_cause())
    assert found.report["verdict"] == found.verdict and found.report["gain"]["value"] == found.gain.value
    assert [cause.effect for cause in found.causes] == [cause["effect"] for cause in found.report["causes"]]
    written = found.write(tmp_path / "diagnosis")
    assert {file.name for file in written} >= {"diagnosis.html", "diagnosis.json", "extended.json", "extended.fmu"}
    assert tf.read_finger(tmp_path / "diagnosis/extended.json") == found.extended


@pytest.mark.parametrize("tested", [False, True])
def test_diagnose_refuses_what_is_too_short_to_hold_out(frame: pd.DataFrame, tested: bool) -> None:
    """Nothing can be named without parts that are held out."""
    tests = [frame.iloc[5000:]] if tested else []
    with pytest.raises(tf.InputError, match=r"DataFrame.*: 5 s of free motion; expected at least 8 s, better a minute"):
        tf.diagnose(FINGER, frame.iloc[:2500], test=tests)
    with pytest.raises(tf.InputError, match=r"^2 recordings: 6 s of free motion; expected at least 8 s"):
        tf.diagnose(FINGER, [frame.iloc[:1500], frame.iloc[1500:3000]], test=tests)


def test_recordings_of_which_contact_leaves_nothing_are_refused() -> None:
    free, now = tf.read_recording(DEMO / "two_joints_unseen.parquet"), tf.read_recording(TRAINING)
    touched = replace(now, contact=np.arange(len(now)) % 3 > 0)
    with pytest.raises(tf.InputError, match="are labelled contact"):
        tf.diagnose(FINGER, touched, reference=free)


# --- messages and warnings --------------------------------------------------------------------------------------------


def test_messages_name_what_was_given(frame: pd.DataFrame) -> None:
    tendons = {"tendon_force": np.zeros((9, 3)), "tendon_position": np.zeros((9, 3))}
    few = tf.Recording.from_arrays(np.arange(9.0), **tendons, name="mine")
    for refused, words in {
        lambda: tf.calibrate(FINGER, frame.iloc[:300]): "DataFrame: no sample to measure the gain on",
        lambda: tf.calibrate(FINGER, [frame, frame]): "DataFrame 2: given twice, as DataFrame 1; expected each",
        lambda: tf.calibrate(FINGER, frame, test=frame): "DataFrame: a test, but trained on as well: the same ",
        lambda: tf.calibrate(FINGER, few): "mine: 3 columns tendon_force[...], expected 4",
        lambda: tf.convert(TRAINING, {"format": "x"}): 'map: format = "x"',
        lambda: tf.calibrate(FINGER, tf.read_recording(TRAINING)[:0.5]): f"{TRAINING}: ",
    }.items():
        with pytest.raises(tf.InputError) as error:
            refused()
        assert str(error.value).startswith(words), str(error.value)


@pytest.mark.parametrize("function", [tf.fit, tf.tune, tf.score, tf.diagnose])
def test_sources_that_no_function_takes(function: Callable[..., Any]) -> None:
    bad = pd.DataFrame({"time": [0.0, 0.0], "tendon_force[1]": [1.0, 2.0], "tendon_position[1]": [0.0, 0.1]})
    good = bad.assign(time=[0.0, 0.1])
    for finger, recordings, words in (
        (FINGER, [], "no recording; expected at least one"),
        (FINGER, 3, "int; expected paths, DataFrames or Recordings"),
        (FINGER, [good, 3], r"^recordings\[2\]: int; expected a path, a DataFrame or a Recording$"),
        (FINGER, [good, bad], r"^DataFrame 2: column time, row 2"),
        (FINGER, [bad], r"^DataFrame: column time, row 2"),
        (FINGER, {"time": [0.0]}, r"dict; expected .*, such as Recording\.from_frame\(pd\.DataFrame"),
        (3, [TRAINING], "int; expected a path, a dictionary or a Finger"),
    ):
        with pytest.raises(tf.InputError, match=words):
            function(finger, recordings)


def test_a_command_says_once_which_columns_it_ignores(frame: pd.DataFrame, tmp_path: Path, call: Call) -> None:
    file = tmp_path / "rec.parquet"
    frame.iloc[:100].assign(current=1.0, phase="start").to_parquet(file)
    for _ in range(2):  # also in the same process again
        answer = call("run", FINGER, file, "-o", tmp_path / "out.csv")
        warned = [line for line in answer.err.splitlines() if "warning" in line]
        assert len(warned) == 1
        assert warned[0].startswith(
            f"tendonfmu: warning: {file}: ignored columns: 'current', 'phase'; a recording has "
        )
    assert call("run", FINGER, file, "-o", tmp_path / "out.csv", "--quiet").err == ""


def test_warnings_name_the_line_of_the_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    """And are in the result, escaped where it is shown."""
    made = replace(examples.adequate(), warnings=("too little <motion>",))
    monkeypatch.setattr("tendonfmu.diagnosis.diagnose", lambda *_, **__: made)
    unlabelled = pd.read_parquet(PUSHES).drop(columns="contact").iloc[:4000]
    for category, compute in (
        (tf.FitWarning, lambda: tf.fit(FINGER, TRAINING, only="joints[1].friction.coulomb", passes=2)),
        (tf.TuneWarning, lambda: tf.tune(INDEX, DEMO / "index_finger_free.parquet")),
        (tf.ScoreWarning, lambda: tf.score(INDEX, unlabelled)),
        (tf.DiagnosisWarning, lambda: tf.diagnose(INDEX, TRAINING)),
    ):
        with pytest.warns(category) as warned:
            result = compute()
        own = [warning for warning in warned if warning.category is category]
        assert {warning.filename for warning in own} == {__file__}
        assert [str(warning.message) for warning in own] == list(result.warnings)
    assert "<li>too little &lt;motion&gt;</li>" in result._repr_html_()


# --- in a notebook ----------------------------------------------------------------------------------------------------


def test_names_are_escaped_where_results_are_shown() -> None:
    evil = "<script>&amp;"
    finger = tf.read_finger(INDEX).replace({"name": evil, "joints[2].name": evil, "tendons[3].name": evil})
    recording = tf.Recording.from_frame(pd.read_parquet(PUSHES), name=evil)
    diagnosis = Diagnosis(replace(examples.three_causes(), finger=evil))
    for shown in (finger, recording, diagnosis):
        page = shown._repr_html_()
        assert "<script>" not in page and "&lt;script&gt;" in page
    for figure in (recording.plot(), diagnosis.plot()):
        assert "<script>" not in figure.layout.title.text and len(figure.data) > 3


def test_a_wrong_argument_names_the_function() -> None:
    with pytest.raises(TypeError, match=r"^fit\(\) got an unexpected keyword argument 'hold_out'"):
        tf.fit("finger.json", [], hold_out=0.2)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match=r"^score\(\) missing a required argument: 'recordings'"):
        tf.score("finger.json")  # type: ignore[call-arg]
