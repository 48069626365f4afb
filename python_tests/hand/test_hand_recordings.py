"""A recording of a hand split into those of its fingers, the wrist's angles, and the run of all fingers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tendonfmu as tf
from command import Call
from map_cases import VALIDATOR
from small_hand import FINGERS, Columns, worn_columns, write_worn_hand, write_wrist_hand
from tendonfmu.errors import InputError, InputWarning
from tendonfmu.files.tables import read_table, write_table


@pytest.fixture
def columns() -> Columns:
    return worn_columns(1, seconds=2.0)


@pytest.fixture
def hand(tmp_path: Path) -> tf.Hand:
    return tf.read_hand(write_worn_hand(tmp_path)["hand"])


def test_each_finger_gets_its_columns(hand: tf.Hand, columns: Columns) -> None:
    """As a file and as a DataFrame, all groups, with the finger's name in messages."""
    file = hand.path.with_name("day.csv")
    write_table(file, columns)
    for source in (file, pd.DataFrame(columns)):
        split = tf.split_recording(hand, source)
        assert list(split) == list(FINGERS) and split["ring"].path.name.endswith(":ring")
        for name in FINGERS:
            for column in ("tendon_force[2]", "tendon_position[1]", "joint_velocity[1]"):
                np.testing.assert_array_equal(split[name][column], columns[f"{name}_{column}"])
            assert split[name].contact is None
    with pytest.warns(InputWarning, match="ignored columns: 'camera'; no finger of .*hand.json has them"):
        tf.split_recording(hand, pd.DataFrame(columns | {"camera": columns["time"]}))


def test_convert_table_writes_what_a_hand_takes(call: Call, hand: tf.Hand, columns: Columns) -> None:
    """In one command, from a log with other names and units; what a map says wrongly is named with its finger."""
    folder = hand.path.parent
    signals = [name for name in columns if "tendon_" in name]
    log = {"ms": 1000 * columns["time"]} | {f"s{k}": 1000 * columns[name] for k, name in enumerate(signals)}
    log["touch"] = (columns["time"] < 0.5).astype(float)
    pd.DataFrame(log).to_csv(folder / "log.csv", index=False)
    units = {name: "mN" if "force" in name else "mm" for name in signals}
    mapped = {name: {"column": f"s{k}", "unit": units[name]} for k, name in enumerate(signals)}
    mapped |= {"time": {"column": "ms", "unit": "ms"}, "ring_contact": {"column": "touch"}}
    document = {"format": "tendonfmu-map-1", "columns": mapped}
    VALIDATOR.validate(document)
    (folder / "hand_map.json").write_text(json.dumps(document), encoding="utf-8")
    answer = call("convert", "table", "log.csv", "--map", "hand_map.json", "-o", "day.parquet")
    assert answer.status == 0, answer.err
    split = tf.split_recording(hand, folder / "day.parquet")
    for name in FINGERS:
        for group in ("tendon_force", "tendon_position"):
            column = f"{group}[2]"
            np.testing.assert_allclose(split[name][column], columns[f"{name}_{column}"], rtol=1e-12, atol=1e-12)
    assert split["ring"].contact is not None and split["index"].contact is None
    for wrong in ("index_tendon_force[1]", "index_time", "index_torque[1]"):
        changed = {key: value for key, value in mapped.items() if key != wrong}
        changed |= {} if wrong in mapped else {wrong: {"column": "s0", "unit": "N"}}
        (folder / "hand_map.json").write_text(json.dumps(document | {"columns": changed}), encoding="utf-8")
        answer = call("convert", "table", "log.csv", "--map", "hand_map.json", "-o", "day.parquet")
        assert answer.status == 2 and wrong in answer.err, answer.err


def test_a_label_is_of_one_finger_or_of_all(hand: tf.Hand, columns: Columns) -> None:
    early = (columns["time"] < 0.5).astype(float)
    split = tf.split_recording(hand, pd.DataFrame(columns | {"contact": early, "ring_contact": 1 - early}))
    np.testing.assert_array_equal(split["index"].contact, early == 1)
    np.testing.assert_array_equal(split["ring"].contact, early == 0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda c: c.pop("ring_tendon_force[2]"),
            "day.csv:ring: 2 columns tendon_position[...], expected 1 as of tendon_force[...]",
        ),
        (
            lambda c: [c.pop(f"ring_tendon_{kind}[2]") for kind in ("force", "position")],
            "day.csv:ring: 1 column tendon_force[...], expected 2: the finger has 1 joint and 2 tendons",
        ),
        (
            lambda c: [c.pop(name) for name in list(c) if name.startswith("ring_")],
            "day.csv:ring: no column tendon_force[1]; expected one tendon_force[i] per tendon, in N",
        ),
        (lambda c: c.pop("time"), "no column time; expected the time of every sample in s"),
        (
            lambda c: c.update({"ring_tendon_force_1": c.pop("ring_tendon_force[1]")}),
            "day.csv:ring: column 'tendon_force_1'; expected the name tendon_force[1]",
        ),
        (
            lambda c: c.update({"ring_tendon_force[3]": c["time"]}),
            "day.csv:ring: 2 columns tendon_position[...], expected 3 as of tendon_force[...]",
        ),
    ],
)
def test_what_is_refused(hand: tf.Hand, columns: Columns, call: Call, change: object, words: str) -> None:
    change(columns)  # type: ignore[operator]
    write_table("day.csv", columns)
    answer = call("run", hand.path, "day.csv", "-o", "out.csv")
    assert answer.status == 2 and words in answer.err and answer.err.count("\n") == 1 and not Path("out.csv").exists()
    if "ring" not in words:  # what one finger lacks is its row
        answer = call("diagnose", hand.path, "day.csv", "-o", "out")
        assert answer.status == 2 and words in answer.err and not Path("out").exists()


def test_a_run_is_that_of_each_finger(hand: tf.Hand, columns: Columns, call: Call) -> None:
    write_table("day.csv", columns)
    answer = call("run", hand.path, "day.csv", "-o", "out.parquet", "--kinematics", "3", "--json")
    assert answer.status == 0
    report = json.loads(answer.out)
    assert report["format"] == "tendonfmu-hand-run-1" and list(report["fingers"]) == list(FINGERS)
    table = read_table(Path("out.parquet"), lambda file, names: names)
    assert [name for name in table if "." not in name] == ["time"]
    for name in FINGERS:
        alone = tf.run(hand.path.with_name(f"{name}.json"), tf.split_recording(hand, "day.csv")[name], kinematics=3)
        for column, values in alone.columns().items():
            np.testing.assert_array_equal(table["time" if column == "time" else f"{name}.{column}"], values)
    refused = call("run", hand.path, "day.csv", "-o", "out.csv", "--report", "page.html")
    assert refused.status == 2 and "a hand, given with --report; expected a finger" in refused.err


# --- the wrist --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wrist", ["measured", "tendons"])
def test_fingers_get_the_angles_of_all_joints(tmp_path: Path, wrist: str) -> None:
    """Those of the wrist are read once; those of the finger follow from its tendons, exactly as they were made."""
    hand, recording, truth = write_wrist_hand(tmp_path, wrist)
    split = tf.split_recording(tf.read_hand(hand), recording)
    for name in FINGERS:
        np.testing.assert_allclose(split[name]["joint_position"], truth[name], rtol=0, atol=1e-13)
        assert "joint_velocity" not in split[name].groups


def test_encoders_of_the_fingers_are_used(tmp_path: Path) -> None:
    hand, recording, _ = write_wrist_hand(tmp_path, "measured")
    table = read_table(recording, lambda file, names: names)
    seen = {f"ring.joint_{kind}[{j}]": 0.1 * j + table["time"] for kind in ("position", "velocity") for j in (2, 3)}
    velocity = {"wrist.joint_velocity[1]": np.cos(table["time"])}
    split = tf.split_recording(tf.read_hand(hand), pd.DataFrame(table | seen | velocity))
    np.testing.assert_array_equal(split["ring"]["joint_position[3]"], 0.1 * 3 + table["time"])
    np.testing.assert_array_equal(split["ring"]["joint_velocity[1]"], velocity["wrist.joint_velocity[1]"])
    np.testing.assert_array_equal(split["ring"]["joint_velocity[2]"], 0.1 * 2 + table["time"])
    assert "joint_velocity" not in split["index"].groups
    own = {"ring.joint_position[1]": table["time"]}
    with pytest.raises(InputError, match=r"column ring\.joint_position\[1\]; expected none, since joint 1 of ring is"):
        tf.split_recording(tf.read_hand(hand), pd.DataFrame(table | seen | own))
    table.pop("wrist.joint_position[1]")
    with pytest.raises(InputError, match=r"no column wrist\.joint_position\[1\]; expected the measured angles of the"):
        tf.split_recording(tf.read_hand(hand), pd.DataFrame(table))


@pytest.mark.parametrize("wrist", ["measured", "tendons"])
def test_the_torque_at_the_wrist_is_that_of_all_tendons(tmp_path: Path, wrist: str) -> None:
    hand, recording, truth = write_wrist_hand(tmp_path, wrist)
    outputs = tf.run_hand(hand, recording).frame
    parts = [*FINGERS, *(["wrist"] if wrist == "tendons" else [])]
    table = read_table(recording, lambda file, names: names)
    pulled = np.zeros(len(table["time"]))
    for part in parts:
        arms = tf.read_finger(hand.with_name(f"{part}.json")).moment_arms
        pulled += sum(row[0] * table[f"{part}.tendon_force[{i}]"] for i, row in enumerate(arms, start=1))
    np.testing.assert_allclose(outputs["wrist.joint_torque[1]"], pulled, rtol=0, atol=1e-12)
    left = outputs["wrist.joint_torque[1]"] - outputs["wrist.friction_torque[1]"]
    np.testing.assert_allclose(outputs["wrist.compensated_torque[1]"], left, rtol=0, atol=1e-12)
    if wrist == "measured":
        own = sum(outputs[f"{name}.compensated_torque[1]"] for name in FINGERS)
        np.testing.assert_allclose(outputs["wrist.compensated_torque[1]"], own, rtol=0, atol=1e-15)
    assert ("wrist.contact" in outputs) is (wrist == "tendons")
    np.testing.assert_allclose(outputs["wrist.joint_angle[1]"], truth["ring"][:, 0], rtol=0, atol=1e-13)
