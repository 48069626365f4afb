"""The demo's recordings: what docs/reference/semantics.md#recordings asks, what their rigs give, their story."""

from __future__ import annotations

import copy
import importlib.util
import json
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from plant_rigs import needs_plant
from repetitions import repeated
from repository_paths import ROOT
from tendonfmu.detect.counting import score_detection
from tendonfmu.files.tables import read_table
from tendonfmu.model.description import read_finger
from tendonfmu.model.native import Instance
from tendonfmu.recordings.recording import Recording, read_recording
from tendonfmu.simulate.rig import read_rig
from tendonfmu.simulate.simulation import Table, simulate

EXAMPLES = ROOT / "examples"
FOLDER = EXAMPLES / "demo_recording"
# recording -> rig
RIGS = {
    "index_finger_free": "index_finger.json",
    "index_finger_free_x4": "index_finger_x4.json",
    "index_finger_pushes": "index_finger_pushes.json",
}
TWO_JOINTS = ("two_joints_training", "two_joints_unseen")  # made by make_hidden.py
SIZES = {"tendon_force": 8, "tendon_position": 8, "joint_position": 4, "external_torque": 4}
STEPS = {"tendon_force": 0.002, "tendon_position": 2e-6, "joint_position": 2e-4, "external_torque": 2e-4}
JOINTS = ("mcp_abduction", "mcp_flexion", "pip_flexion", "dip_flexion")

Array = NDArray[Any]


@pytest.fixture(scope="module")
def description() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((EXAMPLES / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
    return found


@pytest.fixture(scope="module")
def calibrated() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((FOLDER / "index_finger_calibrated.json").read_text(encoding="utf-8"))
    return found


@pytest.fixture(scope="module")
def recordings() -> dict[str, Recording]:
    return {name: read_recording(FOLDER / f"{name}.parquet") for name in RIGS}


Outputs = dict[str, dict[str, Array]]


@pytest.fixture(scope="module")
def outputs(description: dict[str, Any], recordings: dict[str, Recording]) -> Outputs:
    return outputs_of(description, recordings)


@pytest.fixture(scope="module")
def calibrated_outputs(calibrated: dict[str, Any], recordings: dict[str, Recording]) -> Outputs:
    return outputs_of(calibrated, recordings)


def outputs_of(description: dict[str, Any], recordings: dict[str, Recording]) -> Outputs:
    return {name: Instance.from_description(description).run(each.arrays()) for name, each in recordings.items()}


def label_of(recording: Recording) -> Array:
    return np.zeros(len(recording), bool) if recording.contact is None else recording.contact


def rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


# --- what they are ----------------------------------------------------------------------------------------------------


def test_nothing_else_is_there_and_together_they_are_small() -> None:
    assert {file.stem for file in FOLDER.glob("*.parquet")} == {*RIGS, *TWO_JOINTS}
    assert sum(file.stat().st_size for file in FOLDER.iterdir()) < 10e6


@pytest.mark.parametrize("name", list(RIGS))
def test_columns_samples_and_steps_of_the_sensors(recordings: dict[str, Recording], name: str) -> None:
    recording = recordings[name]
    wanted = set(SIZES) if name == "index_finger_pushes" else set(SIZES) - {"external_torque"}
    assert {group: array.shape[1] for group, array in recording.groups.items()} == {
        each: SIZES[each] for each in wanted
    }
    assert (recording.contact is not None) == (name == "index_finger_pushes")
    assert np.allclose(recording.time, np.arange(30000) / 500.0, rtol=0.0, atol=1e-12)
    for group, array in recording.groups.items():
        steps = array / STEPS[group]
        assert np.abs(steps - np.round(steps)).max() < 1e-6, group
    assert recording.groups["tendon_force"].min() > 0


@pytest.mark.parametrize("name", list(RIGS))
def test_forces_positions_and_angles_belong_together(
    recordings: dict[str, Recording], description: dict[str, Any], name: str
) -> None:
    """x1 = x0 − f0/k = R q, eqs. (2) and (4)."""
    groups = recordings[name].groups
    arms = np.array([tendon["moment_arms"] for tendon in description["tendons"]])
    stiffness = np.array([tendon["stiffness"] for tendon in description["tendons"]])
    gap = groups["tendon_position"] - groups["tendon_force"] / stiffness - groups["joint_position"] @ arms.T
    # sensor noise: 0.2 mrad and its rounding on up to 13 mm, 3 mN on 5500 N/m, 2 µm steps
    assert np.abs(gap.mean(axis=0)).max() < 1e-7
    assert gap.std(axis=0).max() < 4e-6


def test_load_only_where_the_label_says_contact(recordings: dict[str, Recording]) -> None:
    pushes = recordings["index_finger_pushes"]
    free = ~label_of(pushes)
    # six standard deviations of the sensor; the label begins at 0.05 N on up to 95 mm
    assert np.abs(pushes.groups["external_torque"][free]).max() < 0.0018 + 0.005
    assert (np.diff(label_of(pushes).astype(int)) == 1).sum() == 11
    assert np.abs(pushes.groups["external_torque"]).max() > 0.1


def test_the_second_has_the_same_motor_motion_at_four_times_the_pretension(recordings: dict[str, Recording]) -> None:
    free, more = recordings["index_finger_free"].groups, recordings["index_finger_free_x4"].groups
    assert more["tendon_force"].mean() / free["tendon_force"].mean() == pytest.approx(4.0, rel=0.02)
    # the springs longer by what 30 N more take, all the time
    apart = more["tendon_position"] - free["tendon_position"]
    assert np.ptp(apart, axis=0).max() < 2.5 * STEPS["tendon_position"]
    assert apart.mean(axis=0).min() > 25.0 / 8000.0


# --- where they come from ---------------------------------------------------------------------------------------------


def differs(recording: Recording, fresh: Table) -> dict[str, tuple[float, float]]:
    """Group -> share of samples more than one step of the sensor apart, and rms of the difference in steps."""
    result = {}
    for group, array in recording.groups.items():
        now = np.column_stack([fresh[f"{group}[{k + 1}]"] for k in range(array.shape[1])])
        steps = np.abs(now - array) / STEPS[group]
        result[group] = (float((steps > 1.5).mean()), float(np.sqrt(np.mean(steps**2))))
    return result


def is_same(name: str, recording: Recording, fresh: Table) -> bool:
    """Equal up to what another compiler or C library makes of the last digits, about as another solver tolerance does.

    Measured with tolerances of 3e-7 to 1e-8: (0, 0.07), and (0.1, 1.3) at 40 N, where some strokes stick and slip, and
    a rounding grows into a slip a little earlier or later.
    """
    far, apart = (0.15, 2.0) if name == "index_finger_free_x4" else (0.001, 0.2)
    return all(found[0] < far and found[1] < apart for found in differs(recording, fresh).values())


@needs_plant
@pytest.mark.parametrize("name", repeated(RIGS, 2))
def test_they_are_what_their_rigs_give(recordings: dict[str, Recording], name: str) -> None:
    fresh = simulate(read_rig(EXAMPLES / "rigs" / RIGS[name])).recording
    recording = recordings[name]
    assert list(fresh) == columns_of(recording)
    np.testing.assert_array_equal(fresh["time"], recording.time)
    assert is_same(name, recording, fresh), differs(recording, fresh)
    if recording.contact is not None:
        assert (fresh["contact"].astype(bool) != recording.contact).sum() <= 22


@needs_plant
@pytest.mark.parametrize("name", repeated(["index_finger_free", "index_finger_free_x4"], 0))
def test_one_percent_of_other_friction_at_the_joints_shows(
    recordings: dict[str, Recording], description: dict[str, Any], tmp_path: Path, name: str
) -> None:
    finger = copy.deepcopy(description)
    for joint in finger["joints"]:
        joint["friction"] |= {key: 1.01 * joint["friction"][key] for key in ("static", "coulomb")}
    base = str(EXAMPLES / "rigs" / RIGS[name])
    changed = {"format": "tendonfmu-rig-1", "base": base, "name": "changed", "finger": finger}
    (tmp_path / "changed.json").write_text(json.dumps(changed), encoding="utf-8")
    fresh = simulate(read_rig(tmp_path / "changed.json")).recording
    assert not is_same(name, recordings[name], fresh), differs(recordings[name], fresh)


def columns_of(recording: Recording) -> list[str]:
    names = ["time"] + [f"{group}[{k + 1}]" for group, array in recording.groups.items() for k in range(array.shape[1])]
    return names if recording.contact is None else [*names, "contact"]


# --- the finger that lacks something ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def hidden_rig() -> Iterator[Any]:
    """The script that made its recordings."""
    path = list(sys.path)
    spec = importlib.util.spec_from_file_location("make_hidden", FOLDER / "make_hidden.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.path[:] = path


@pytest.mark.long
def test_the_two_joint_finger_is_what_its_rig_gives(hidden_rig: Any) -> None:
    """Description, label and both recordings; one percent less of what is hidden shows in these."""
    hand, label = hidden_rig.true_hand()
    kept = {
        name: json.loads((FOLDER / f"{name}.json").read_text("utf-8")) for name in ("two_joints", "two_joints_hidden")
    }
    assert is_alike(kept["two_joints"], hidden_rig.description(hand), 1e-9)
    assert is_alike(kept["two_joints_hidden"], label, 1e-6)
    assert not [row for row in kept["two_joints"]["extensions"] if row["effect"] == label["effect"]]
    weaker = replace(hand, hidden=tuple(replace(each, magnitude=0.99 * each.magnitude) for each in hand.hidden))
    for name in TWO_JOINTS:
        file = read_table(FOLDER / f"{name}.parquet", lambda *_: None)
        assert apart(file, hidden_rig.recorded(hand, name)) < 0.001
        assert apart(file, hidden_rig.recorded(weaker, name)) > 0.05
    assert sum((FOLDER / f"{name}.parquet").stat().st_size for name in TWO_JOINTS) < 2.5e6


def apart(one: Table, other: dict[str, Array]) -> float:
    """Share of the samples that differ by more than a step of their sensor, and a bit."""
    assert list(one) == list(other)
    steps = {"tendon_force": 1.2e-4, "tendon_position": 1.2e-7, "time": 1e-12}
    far = [np.abs(one[name] - other[name]) > steps[name.partition("[")[0]] for name in one]
    return float(np.mean(far))


def is_alike(one: Any, other: Any, share: float) -> bool:
    """The same keys and words, numbers equal up to a share of them."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(is_alike(one[key], other[key], share) for key in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(is_alike(*pair, share) for pair in zip(one, other, strict=True))
    return bool(one == other or (isinstance(one, float) and abs(one - other) <= share * abs(one)))


# --- the story --------------------------------------------------------------------------------------------------------


def test_what_is_left_of_free_motion(
    recordings: dict[str, Recording], outputs: Outputs, description: dict[str, Any]
) -> None:
    """A third at the pretension of the training, half at four times that; no false alarm in the first."""
    for name, most in (("index_finger_free", 1 / 3), ("index_finger_free_x4", 1 / 2)):
        left = rms(outputs[name]["compensated_torque"]) / rms(outputs[name]["joint_torque"])
        assert np.all(left < most), (name, left)
    assert not outputs["index_finger_free"]["contact"].any()
    more = recordings["index_finger_free_x4"]
    score = score_detection(more.time, label_of(more), outputs["index_finger_free_x4"]["contact"])
    assert score.free_alarm_share < 0.03


# --- the calibrated finger --------------------------------------------------------------------------------------------


def test_the_calibrated_finger_is_one_that_calibrate_takes_and_writes(
    description: dict[str, Any], calibrated: dict[str, Any]
) -> None:
    """The format of today, the finger that it was made from, and the keys that a calibration leaves."""
    from tendonfmu.calibration.fit import earlier_finger

    given = read_finger(EXAMPLES / "fingers" / "index_finger.json")
    earlier = earlier_finger(given, FOLDER / "index_finger_calibrated.json")
    assert earlier.joint_names == given.joint_names and earlier.tendon_names == given.tendon_names
    for key in ("moment_arms", "stiffness"):
        assert [each[key] for each in calibrated["tendons"]] == [each[key] for each in description["tendons"]]
    assert calibrated["contact"]["method"] == "innovation" and calibrated["contact"]["uncertainty"]
    assert {row["effect"] for row in calibrated["extensions"]} == {"presliding"}


@pytest.mark.parametrize("name", ["index_finger_free", "index_finger_pushes"])
def test_no_false_alarm_of_the_calibrated_finger_lasts(
    recordings: dict[str, Recording], calibrated_outputs: Outputs, name: str
) -> None:
    score = score_detection(recordings[name].time, label_of(recordings[name]), calibrated_outputs[name]["contact"])
    assert all(end - begin <= 0.3 for begin, end in score.false_alarms), score.false_alarms


def test_a_load_that_rises_over_seconds_is_found(recordings: dict[str, Recording]) -> None:
    """30 mN·m at the second joint over 4 s: the bias would have them. With `contact.drift` all are found,
    without it at most a half."""
    free, finger = recordings["index_finger_free"], read_finger(FOLDER / "index_finger_calibrated.json").data
    arms = np.array([tendon["moment_arms"] for tendon in finger["tendons"]])
    stiffness = np.array([tendon["stiffness"] for tendon in finger["tendons"]])
    since = (free.time - free.time[0]) % 14.0 - 8.0
    loaded = (since >= 0.0) & (since < 5.0)
    load = 0.03 * np.outer(np.minimum(since / 4.0, 1.0) * loaded, np.linalg.pinv(arms)[1])
    groups = {
        "time": free.time,
        "tendon_force": free.groups["tendon_force"] + load,
        "tendon_position": free.groups["tendon_position"] + load / stiffness,
    }

    def found(contact: dict[str, Any]) -> tuple[int, int]:
        outputs = Instance.from_description(json.dumps({**finger, "contact": contact})).run(groups)
        score = score_detection(free.time, loaded, outputs["contact"].ravel())
        return score.found, len(score.events)

    with_rule, count = found(finger["contact"])
    without, _ = found({key: value for key, value in finger["contact"].items() if key != "drift"})
    assert count >= 4 and with_rule == count and without <= count / 2


# --- what the page says -----------------------------------------------------------------------------------------------


def test_the_readme_says_what_comes_out(
    recordings: dict[str, Recording], outputs: Outputs, calibrated_outputs: Outputs
) -> None:
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.strip("| ").split("|")] for line in page.splitlines() if "→" in line]
    wanted = [
        (given, name, where)
        for given in (outputs, calibrated_outputs)
        for name, where in (*((name, False) for name in RIGS), ("index_finger_pushes", True))
    ]
    for (given, name, where), (_, _, *cells) in zip(wanted, rows, strict=True):
        part = label_of(recordings[name]) == where
        left = given[name]["compensated_torque"][part]
        before = given[name]["joint_torque"][part]
        if where:
            before = recordings[name].groups["external_torque"][part]
            left = left - before
        said = np.array([[float(number) for number in re.findall(r"[\d.]+", cell)] for cell in cells])
        # another machine may simulate a slip otherwise
        np.testing.assert_allclose(said, 1e3 * np.column_stack([rms(before), rms(left)]), rtol=0.02, atol=0.1)


def test_pushes_are_found_as_the_readmes_say(
    recordings: dict[str, Recording], outputs: Outputs, calibrated_outputs: Outputs
) -> None:
    """Pushes and the longest false alarm of both descriptions, here and in the first README."""
    recording = recordings["index_finger_pushes"]
    own, first = ((folder / "README.md").read_text(encoding="utf-8") for folder in (FOLDER, EXAMPLES.parent))
    given, calibrated = (
        score_detection(recording.time, label_of(recording), output["index_finger_pushes"]["contact"])
        for output in (outputs, calibrated_outputs)
    )
    assert (len(given.events), given.found) == (11, 8) and given.free_alarm_share < 0.12
    assert calibrated.found >= 10 and np.median(calibrated.delays) < 0.03
    assert [int(count) for count in re.findall(r"(\d+) of the 11 pushes", own)] == [given.found, calibrated.found]
    longest = max((end - begin for begin, end in calibrated.false_alarms), default=0.0)
    for page in (own, first):
        said = re.findall(r"no false alarm longer than ([\d.]+)\s+s", page)
        assert len(said) == 1 and longest <= float(said[0]) <= longest + 0.3
    assert f"**{calibrated.found} of 11 pushes**" in first
