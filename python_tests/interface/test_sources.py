"""What the functions take: a finger as object, dictionary or path; a recording as object, DataFrame, arrays or path."""

from __future__ import annotations

import dataclasses
import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import tendonfmu as tf
from random_fingers import random_case
from repository_paths import ROOT

FINGER = ROOT / "examples/demo_recording/two_joints.json"
RECORDING = ROOT / "examples/demo_recording/two_joints_unseen.parquet"


@pytest.fixture(scope="module")
def finger() -> tf.Finger:
    return tf.read_finger(FINGER)


@pytest.fixture(scope="module")
def recording() -> tf.Recording:
    return tf.read_recording(RECORDING)


# --- fingers ----------------------------------------------------------------------------------------------------------


def test_a_finger_is_read_from_path_text_dictionary_and_finger(finger: tf.Finger) -> None:
    assert tf.read_finger(str(FINGER)) == finger
    assert tf.read_finger(finger) is finger
    given = json.loads(FINGER.read_text())
    found = tf.read_finger(given)
    assert found == finger and hash(found) == hash(finger)
    given["tendons"][0]["stiffness"] = 1.0
    found.to_dict()["tendons"].clear()
    assert found == finger  # it has its own copy, and gives copies
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.text = b""  # type: ignore[misc]
    numbers = finger.to_dict()
    numbers["tendons"][0]["moment_arms"] = np.array(numbers["tendons"][0]["moment_arms"])
    numbers["tendons"][0]["stiffness"] = np.float64(numbers["tendons"][0]["stiffness"])
    assert tf.read_finger(numbers) == finger
    assert (finger.name, finger.joints, finger.tendons) == ("two_joints", 2, 4)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ({}, "finger: format: missing"),
        ({"format": "tendonfmu-rig-1"}, "a rig; expected a finger description"),
        (3, "finger: int; expected a path, a dictionary or a Finger"),
        ({"format": "tendonfmu-finger-1", "name": object()}, "expected a number, text, list, dictionary or None"),
        ("", "finger: ''; expected a path, a dictionary or a Finger"),
        (FINGER.read_text(), "finger: a text; expected a path, a dictionary or a Finger, such as json.loads(text)"),
        (
            {"format": "tendonfmu-finger-1", "tendons": [{}, {"stiffness": np.float64("nan")}]},
            "finger: tendons[2].stiffness = nan: expected a finite number",
        ),
        ("missing.json", "missing.json: No such file or directory; expected a finger description"),
    ],
)
def test_what_is_no_finger_is_refused(source: Any, words: str) -> None:
    with pytest.raises(tf.InputError) as refused:
        tf.read_finger(source)
    assert words in str(refused.value) and "\n" not in str(refused.value)


def test_other_data_make_another_image_and_text(finger: tf.Finger) -> None:
    """`dataclasses.replace` left image and text, and so `to_dict()`, `run` and `build`, as they were."""
    data = finger.to_dict() | {"name": "another"}
    data["tendons"][0]["stiffness"] = 1234.0
    changed = dataclasses.replace(finger, data=data)
    assert changed.to_dict() == data and changed == tf.read_finger(data) and hash(changed) != hash(finger)
    assert changed.image == tf.read_finger(data).image != finger.image and b"1234" in changed.text
    assert pickle.loads(pickle.dumps(changed)) == changed
    data["tendons"][0]["stiffness"] = -1.0
    with pytest.raises(tf.InputError, match=r"two_joints\.json: .*stiffness"):
        tf.run(dataclasses.replace(finger, data=data), RECORDING)


def test_replace_makes_another_finger(finger: tf.Finger, tmp_path: Path) -> None:
    """Paths of the FMU, also those of numbers that the description leaves to the defaults."""
    found = finger.replace(
        {
            "name": "changed",
            "tendons[1].stiffness": np.float64(5000.0),
            "contact.threshold_per_force[2]": 0.01,
            "joints[2].cover": {"stiffness": 0.02},
            "joints[2].cover.rest_angle": 0.1,
            "tendons[1].pulley_friction[1]": {"static": 0.02, "coulomb": 0.01, "stribeck_velocity": 0.1},
            "bias.noise_time": 0.01,
        }
    )
    data = found.to_dict()
    assert found.name == "changed" and data["tendons"][0]["stiffness"] == 5000.0
    assert data["contact"]["threshold_per_force"] == [0.0, 0.01]
    assert data["joints"][1]["cover"] == {"stiffness": 0.02, "rest_angle": 0.1}
    assert data["tendons"][0]["pulley_friction"][0]["static"] == 0.02
    assert data["bias"]["noise_time"] == 0.01
    assert finger == tf.read_finger(FINGER)
    found.write(tmp_path / "changed.json")
    assert tf.read_finger(tmp_path / "changed.json") == found


def test_other_numbers_compile_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Any number of any random finger; the run has the bits of a finger that is compiled from the new description."""
    for seed in range(4):
        description, recording = random_case(seed, samples=60, extensions=True)
        finger = tf.read_finger(description)
        values = {path: number.start * 1.01 for path, number in finger.numbers.items() if path.endswith(".stiffness")}
        values |= {"bias.forget_rate": 0.25}
        with monkeypatch.context() as patch:
            patch.setattr("tendonfmu.model.native.image_from_json", None)
            changed = finger.replace(values).replace({"bias.noise_std": 0.02})
            found = changed.instance(3).run(recording)
        anew = tf.read_finger(changed.to_dict())
        assert changed == anew and changed.numbers == anew.numbers and changed.image == anew.image
        for name, expected in anew.instance(3).run(recording).items():
            np.testing.assert_array_equal(found[name], expected, err_msg=name)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"tendons[9].stiffness": 1.0}, "tendons[9]: no such path; expected 1 to 4"),
        ({"tendons[1].stiffness": -1.0}, "tendons[1].stiffness = -1: expected above 0"),
        ({"tendons[1].stiffness": float("nan")}, "json: tendons[1].stiffness = nan: expected a finite number"),
        ({"tendons[0].stiffness": 1.0}, "'tendons[0].stiffness': expected a path such as"),
        ({"": 1.0}, "'': expected a path such as"),
        ({"joints[1].cover.rest_angle": 0.1}, "joints[1].cover.stiffness"),
    ],
)
def test_replace_names_what_it_refuses(finger: tf.Finger, values: dict[str, Any], words: str) -> None:
    if "cover" in next(iter(values)):
        finger = finger.replace({"joints[1].cover": None})
    with pytest.raises(tf.InputError) as refused:
        finger.replace(values)
    assert str(refused.value).startswith(f"{FINGER}: ") and words in str(refused.value)


# --- recordings -------------------------------------------------------------------------------------------------------


def test_a_recording_becomes_a_frame_and_comes_back(recording: tf.Recording, tmp_path: Path) -> None:
    frame = recording.frame
    assert list(frame.columns) == [
        "time",
        *(f"{group}[{i}]" for group in ("tendon_force", "tendon_position") for i in range(1, 5)),
    ]
    pd.testing.assert_frame_equal(frame, pd.read_parquet(RECORDING)[frame.columns].astype(float), check_exact=True)
    shuffled = tf.Recording.from_frame(frame[frame.columns[::-1]].set_index("time", drop=False))
    pd.testing.assert_frame_equal(shuffled.frame, frame, check_exact=True)
    shuffled.write(tmp_path / "again.csv")
    pd.testing.assert_frame_equal(tf.read_recording(tmp_path / "again.csv").frame, frame, check_exact=True)


SMALL = {"time": [0.0, 0.1], "tendon_force[1]": [1.0, 2.0], "tendon_position[1]": [0.0, 0.1]}


@pytest.mark.parametrize(
    "changed",
    [
        {"time": [0.0, 0.0]},
        {"tendon_force[1]": [1.0, np.nan]},
        {"tendon_force[2]": [1.0, 2.0]},
        {"contact": [0.0, 0.5]},
    ],
)
def test_a_frame_is_refused_with_the_words_of_a_file(changed: dict[str, Any], tmp_path: Path) -> None:
    frame = pd.DataFrame({name: values for name, values in {**SMALL, **changed}.items() if values is not None})
    frame.to_parquet(tmp_path / "r.parquet")
    with pytest.raises(tf.InputError) as of_frame:
        tf.Recording.from_frame(frame)
    with pytest.raises(tf.InputError) as of_file:
        tf.read_recording(tmp_path / "r.parquet")
    line = str(of_frame.value)
    assert line.startswith("DataFrame: ")
    assert line.removeprefix("DataFrame: ") == str(of_file.value).removeprefix(f"{tmp_path / 'r.parquet'}: ")


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (
            {"time": pd.to_datetime(["2026-01-01", "2026-01-02"])},
            "column time: datetime64[us] values; expected seconds as numbers, such as "
            "(df['time'] - df['time'].iloc[0]).dt.total_seconds()",
        ),
        ({"time": pd.to_timedelta([0, 1], unit="s")}, "such as df['time'].dt.total_seconds()"),
        ({"tendon_force[1]": ["1,5", "2,5"]}, "column tendon_force[1], row 1: '1,5'; expected a finite number"),
        ({"tendon_force[1]": pd.array([1, None], dtype="Int64")}, "column tendon_force[1], row 2: nan; expected"),
    ],
)
def test_a_frame_of_other_types_is_refused(changed: dict[str, Any], words: str) -> None:
    with pytest.raises(tf.InputError) as refused:
        tf.Recording.from_frame(pd.DataFrame({**SMALL, **changed}), name="monday")
    assert str(refused.value).startswith("monday: ") and words in str(refused.value).replace("[ns]", "[us]")


def test_a_frame_may_have_numbers_of_any_kind() -> None:
    columns = {
        "time": pd.array([0, 1], dtype="Int64"),
        "tendon_force[1]": np.array([1, 2], dtype=np.float32),
        "tendon_position[1]": pd.Series([1, 2.5], dtype=object),
        "contact": [False, True],
    }
    found = tf.Recording.from_frame(pd.DataFrame(columns))
    assert found.groups["tendon_position"].tolist() == [[1.0], [2.5]]
    assert found.contact is not None and found.contact.tolist() == [False, True]


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"tendon_force": np.ones(3)}, "arrays: tendon_force: shape (3,); expected numbers [N, m]"),
        ({"tendon_force": np.ones((2, 2))}, "arrays: tendon_force: 2 rows; expected 3 as of time"),
        ({"tendon_force": np.ones((3, 1))}, "2 columns tendon_position[...], expected 1 as of tendon_force[...]"),
        ({"tendon_force": np.full((3, 2), np.nan)}, "column tendon_force[1], row 1: nan; expected a finite number"),
        ({"time": [0.0, 2.0, 1.0]}, "column time, row 3: 1.0 s after 2.0 s; expected increasing times"),
        ({"time": np.ma.masked_equal([0.0, 1.0, 2.0], 1.0)}, "arrays: time: masked in row 2; expected numbers [N]"),
        (
            {"tendon_force": np.ma.masked_equal([[1.0, 2.0]] * 2 + [[3.0, 9.0]], 9.0)},
            "arrays: tendon_force: masked in row 3; expected numbers [N, m]",
        ),
        ({"joint_position": np.zeros((3, 0))}, "joint_position: no columns; expected one per joint"),
        ({"time": [], "tendon_force": np.ones((0, 2)), "tendon_position": np.ones((0, 2))}, "no samples"),
    ],
)
def test_arrays_are_checked(changed: dict[str, Any], words: str) -> None:
    given = {"time": np.arange(3.0), "tendon_force": np.ones((3, 2)), "tendon_position": np.ones((3, 2)), **changed}
    with pytest.raises(tf.InputError) as refused:
        tf.Recording.from_arrays(**given)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("index", "way"),
    [
        (
            pd.to_datetime(["2026-01-01", "2026-01-02"]),
            "df.assign(time=(df.index - df.index[0]).total_seconds()).reset_index(drop=True)",
        ),
        (pd.to_timedelta([0, 1], unit="s"), "df.assign(time=df.index.total_seconds()).reset_index(drop=True)"),
        (pd.Index([0.0, 1.0], name="time"), "df.reset_index()"),
    ],
)
def test_a_time_in_the_index_is_refused_with_a_way_that_works(index: Any, way: str) -> None:
    df = pd.DataFrame({name: values for name, values in SMALL.items() if name != "time"}).set_axis(index)
    with pytest.raises(tf.InputError) as refused:
        tf.Recording.from_frame(df)
    assert str(refused.value).startswith("DataFrame: no column time, only an index (")
    assert str(refused.value).endswith(f"expected a column in s, such as {way}")
    assert tf.Recording.from_frame(eval(way, {"df": df})).time[0] == 0.0


def test_messages_name_the_list() -> None:
    good, bad = pd.read_parquet(RECORDING), pd.DataFrame({**SMALL, "time": [0.0, 0.0]})
    with pytest.raises(tf.InputError, match=r"^compare: DataFrame 2: column time, row 2"):
        tf.fit(FINGER, good, compare=[good, bad])
    with pytest.raises(tf.InputError, match=r"^test\[1\]: int; expected"):
        tf.diagnose(FINGER, good, test=[3])  # type: ignore[list-item]


# --- columns, stretches and names -------------------------------------------------------------------------------------


def test_a_recording_gives_columns_groups_and_stretches(recording: tf.Recording) -> None:
    assert recording["tendon_force[2]"] is not None
    np.testing.assert_array_equal(recording["tendon_force[2]"], recording.groups["tendon_force"][:, 1])
    np.testing.assert_array_equal(recording["tendon_force"], recording.groups["tendon_force"])
    part = recording[1.0:2.0]
    assert isinstance(part, tf.Recording) and part.time[0] >= 1.0 and part.time[-1] < 2.0
    rows = (recording.time >= 1.0) & (recording.time < 2.0)
    np.testing.assert_array_equal(part["tendon_position"], recording["tendon_position"][rows])
    np.testing.assert_array_equal(recording[:][1.0:].time, recording.time[recording.time >= 1.0])
    for key, words in (("tendon_forc[1]", "no column"), (slice(1e6, None), "no sample"), (3, "expected the name")):
        with pytest.raises(tf.InputError, match=words):
            recording[key]  # type: ignore[index]


def test_tendons_and_joints_may_be_named(finger: tf.Finger, recording: tf.Recording) -> None:
    tendon, joint = finger.tendon_names[2], finger.joint_names[1]
    by_name = finger.replace({f"tendons[{tendon}].stiffness": 5000.0, f"contact.threshold[{joint}]": 0.5})
    assert by_name == finger.replace({"tendons[3].stiffness": 5000.0, "contact.threshold[2]": 0.5})
    with pytest.raises(tf.InputError, match="nobody"):
        finger.replace({"tendons[nobody].stiffness": 5000.0})
    fitted = tf.fit(finger, recording[:5.0], only=f"joints[{joint}].friction.coulomb")
    assert list(fitted.parameters.index) == ["joints[2].friction.coulomb"]
