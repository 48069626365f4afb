"""A run as a recording for Rerun, read back: numbers of the table, contacts, residual and bound, drawing, layout.

The viewer takes 0.5 GB, so what needs it is long.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import tendonfmu as tf
from command import Call
from fmu_binary import FINGER
from optional_parts import require
from repository_paths import ROOT
from tendonfmu.detect.contact_bound import residual_and_bound
from tendonfmu.files.tables import read_table, write_table
from tendonfmu.interface.running import RunResult
from tendonfmu.recordings.recording import Recording, flagged_stretches
from tendonfmu.report.rerun_recording import FRAMES_PER_SECOND, write_rerun

DEMO = ROOT / "examples" / "demo_recording"
CALIBRATED = DEMO / "index_finger_calibrated.json"
JOINTS = ["mcp_abduction", "mcp_flexion", "pip_flexion", "dip_flexion"]


@dataclass
class Contents:
    """What a file of Rerun holds, by entity."""

    times: dict[str, NDArray[np.float64]] = field(default_factory=dict)  # s
    values: dict[str, dict[str, list[Any]]] = field(default_factory=dict)  # by component, one list for each time
    constant: set[str] = field(default_factory=set)
    views: set[str] = field(default_factory=set)  # names of the layout's views
    origins: set[str] = field(default_factory=set)

    def curve(self, path: str) -> NDArray[np.float64]:
        return np.array([value for (value,) in self.values[path]["Scalars:scalars"]])


def contents_of(file: Path) -> Contents:
    require("rerun")
    try:
        from rerun.chunk import RrdReader
    except ImportError:
        from rerun.experimental import RrdReader  # of 0.39 and before
    reader = RrdReader(file)
    (layout,) = reader.blueprints()
    found = Contents()
    for chunk in reader.stream():
        path, batch = chunk.entity_path.removeprefix("/"), chunk.to_record_batch()
        if chunk.is_static:
            found.constant.add(path)
            continue
        assert chunk.timeline_names == ["time"]
        found.times[path] = batch["time"].cast("int64").to_numpy() / 1e9
        assert path not in found.values
        found.values[path] = {name: batch[name].to_pylist() for name in batch.schema.names if ":" in name}
    for chunk in reader.stream(store=layout):
        columns = chunk.to_record_batch().to_pydict()
        found.views |= {row[0] for row in columns.get("ViewBlueprint:display_name", []) if row}
        found.origins |= {row[0] for row in columns.get("ViewBlueprint:space_origin", []) if row}
    return found


@dataclass(frozen=True)
class Written:
    """A part of the demo as it was written and read."""

    recording: Recording
    result: RunResult
    contents: Contents

    def output(self, name: str, index: int) -> NDArray[np.float64]:
        return np.asarray(self.result.columns()[f"{name}[{index}]"], dtype=np.float64)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Written:
    require("rerun")
    recording = tf.read_recording(DEMO / "index_finger_pushes.parquet")[8.0:16.0]
    finger = tf.read_finger(CALIBRATED)
    result = tf.run(finger, recording)
    file = tmp_path_factory.mktemp("rerun") / "out.rrd"
    write_rerun(file, result.outputs, recording, finger, 1)
    return Written(recording, result, contents_of(file))


@pytest.mark.long
def test_the_signals_are_those_of_the_table(written: Written) -> None:
    time, found = written.result.outputs["time"], written.contents
    for j, name in enumerate(JOINTS, start=1):
        for group, outputs in (
            ("torque", ("joint_torque", "friction_torque", "compensated_torque")),
            ("motion", ("joint_angle", "joint_speed")),
        ):
            for output in outputs:
                path = f"joints/{name}/{group}/{output}"
                assert path in found.constant  # its name and colour
                np.testing.assert_allclose(found.times[path], time, rtol=0, atol=1e-9)
                np.testing.assert_array_equal(found.curve(path), written.output(output, j))
        reference = written.recording.groups["external_torque"][:, j - 1]
        np.testing.assert_array_equal(found.curve(f"joints/{name}/torque/external_torque"), reference)
    forces = written.recording.groups["tendon_force"]
    names = tf.read_finger(CALIBRATED).tendon_names
    for name, force in zip(names, forces.T, strict=True):
        np.testing.assert_array_equal(found.curve(f"tendons/{name}/tendon_force"), force)


@pytest.mark.long
def test_contacts_and_labels_are_lanes(written: Written) -> None:
    time = written.result.outputs["time"]
    flags = {f"contact/{j}_{name}": written.output("joint_contact", j) for j, name in enumerate(JOINTS, start=1)}
    assert written.recording.contact is not None
    flags["contact/label"] = written.recording.contact
    seen = 0
    for path, expected in flags.items():
        states = [state for (state,) in written.contents.values[path]["StateChange:state"]]
        times = written.contents.times[path]
        word = "labelled" if path.endswith("label") else "contact"
        assert states == ["", word][: len(states)] or set(states) == {"", word}
        spans = [
            (begin, end)
            for begin, end, state in zip(times, np.append(times[1:], time[-1]), states, strict=True)
            if state == word
        ]
        np.testing.assert_allclose(spans, flagged_stretches(time, expected), rtol=0, atol=1e-9)
        seen += len(spans)
    assert seen >= 5  # all joints and the label


@pytest.mark.long
def test_the_residual_exceeds_its_bound_in_contact_and_only_then(tmp_path: Path) -> None:
    """By the rule of the paper the bound decides alone. It has all that adds to the threshold."""
    data = json.loads(CALIBRATED.read_text(encoding="utf-8"))
    kept = ("threshold", "threshold_per_force", "uncertainty", "friction_bound")
    data["contact"] = {key: data["contact"][key] for key in kept}
    data.pop("sensor_fault", None)
    finger, recording = tf.read_finger(data), tf.read_recording(DEMO / "index_finger_pushes.parquet")[:20000]
    outputs = tf.run(finger, recording).outputs
    residual, bound = residual_and_bound(finger, recording, 1)  # in several blocks
    assert outputs["joint_contact"].any(axis=0).all()
    np.testing.assert_array_equal((np.abs(residual) > bound)[1:], outputs["joint_contact"][1:])
    force = np.abs(recording.groups["tendon_force"]).mean(axis=1)
    for without, part in (("friction_bound", 0.01), ("uncertainty", 0.01)):  # each is a part of it
        other = {**data, "contact": {key: value for key, value in data["contact"].items() if key != without}}
        lower = residual_and_bound(tf.read_finger(other), recording, 1)[1]
        assert (bound - lower).max() > part * bound.max()
    plain = {**data, "contact": {key: data["contact"][key] for key in kept[:2]}}
    expected = plain["contact"]["threshold"] + force[:, None] * plain["contact"]["threshold_per_force"]
    np.testing.assert_allclose(residual_and_bound(tf.read_finger(plain), recording, 1)[1], expected, rtol=1e-15)


@pytest.mark.long
def test_residual_and_bound_are_drawn(written: Written) -> None:
    finger = tf.read_finger(CALIBRATED)
    residual, bound = residual_and_bound(finger, written.recording, 1)
    for j, name in enumerate(JOINTS):
        path, found = f"joints/{name}/residual", written.contents
        np.testing.assert_array_equal(found.curve(f"{path}/residual"), residual[:, j])
        np.testing.assert_array_equal(found.curve(f"{path}/bound"), bound[:, j])
        np.testing.assert_array_equal(found.curve(f"{path}/minus_bound"), -bound[:, j])
        contact = written.output("joint_contact", j + 1) > 0
        np.testing.assert_array_equal(found.curve(f"{path}/in_contact"), np.where(contact, residual[:, j], np.nan))


@pytest.mark.long
def test_the_drawing_moves_with_the_joints(written: Written) -> None:
    found = written.contents
    times, places = found.times["finger/joints"], found.values["finger/joints"]["Points2D:positions"]
    duration = written.result.outputs["time"][-1] - written.result.outputs["time"][0]
    assert 0.8 * FRAMES_PER_SECOND * duration < len(times) <= FRAMES_PER_SECOND * duration + 1
    angle = written.result.outputs["joint_angle"]
    rows = np.searchsorted(written.result.outputs["time"], times - 1e-9)
    step = np.diff(np.array(places), axis=1)  # from joint to joint, y downwards
    # The finger bends evenly around each joint: a line between two joints has half of the bend at either end.
    turned = np.arctan2(-step[..., 1], step[..., 0])
    link = np.cumsum(angle[rows], axis=1)[:, :-1]
    ends = 0.5 * (np.abs(angle[rows][:, :-1]) + np.abs(angle[rows][:, 1:]))
    assert (np.abs(turned - link) <= ends + 1e-6).all() and np.ptp(turned) > 0.3
    colours = np.array(found.values["finger/joints"]["Points2D:colors"])
    contact = written.result.outputs["joint_contact"][rows]
    assert len(np.unique(colours[contact])) == 1 and len(np.unique(colours[~contact])) == 1
    assert np.unique(colours[contact]) != np.unique(colours[~contact])
    assert len([path for path in found.times if path.startswith("finger/tendons/")]) == 8


@pytest.mark.long
def test_it_opens_with_a_layout(written: Written) -> None:
    views, origins = written.contents.views, written.contents.origins
    assert {"finger", "contact", "tendon forces (N)"} <= views
    for name in JOINTS:
        expected = ("torque (N·m)", "residual and bound (N·m)", "angle (rad), speed (rad/s)")
        assert {f"{name}: {title}" for title in expected} <= views
    paths = {*written.contents.times, *written.contents.constant}
    assert all(any(path.startswith(origin.strip("/")) for path in paths) for origin in origins)


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))
    columns: dict[str, Any] = {"time": np.arange(50) / 100}
    for i in range(1, len(FINGER["tendons"]) + 1):
        columns |= {f"tendon_force[{i}]": np.full(50, 5.0), f"tendon_position[{i}]": np.linspace(0, 1e-3, 50)}
    write_table(tmp_path / "r.csv", columns)
    return "finger.json", "r.csv"


@pytest.mark.long
def test_the_command_writes_the_same_of_a_description_and_its_fmu(
    call: Call, files: tuple[str, str], tmp_path: Path
) -> None:
    require("rerun")
    answer = call("run", *files, "-o", "out.csv", "--rerun", "a.rrd")
    assert answer.status == 0 and "a.rrd: the run, for the viewer Rerun" in answer.err
    assert call("build", "finger.json", "-o", "f.fmu").status == 0
    assert call("run", "f.fmu", "r.csv", "-o", "out.csv", "--rerun", "b.rrd").status == 0
    first, second = contents_of(tmp_path / "a.rrd"), contents_of(tmp_path / "b.rrd")
    assert first.values.keys() == second.values.keys() and len(first.values) > 10
    assert first.views == second.views
    table = read_table(tmp_path / "out.csv", lambda *_: None)
    name = FINGER["joints"][0]["name"]
    for found in (first, second):
        np.testing.assert_array_equal(found.curve(f"joints/{name}/torque/joint_torque"), table["joint_torque[1]"])


@pytest.mark.long
def test_without_a_description_it_has_numbers_for_names(files: tuple[str, str], tmp_path: Path) -> None:
    require("rerun")
    recording = tf.read_recording(tmp_path / "r.csv")
    outputs = tf.run(FINGER, recording).outputs
    write_rerun(tmp_path / "out.rrd", outputs, recording, None, 1)
    found = contents_of(tmp_path / "out.rrd")
    assert "joints/joint_1/torque/joint_torque" in found.values
    assert not any(path.startswith("finger/") or "/residual/" in path for path in found.values)


@pytest.mark.long
def test_joints_of_one_name_stay_apart(files: tuple[str, str], tmp_path: Path) -> None:
    require("rerun")
    data = json.loads(json.dumps(FINGER))
    for joint in data["joints"]:
        joint["name"] = "a/b"
    recording, finger = tf.read_recording(tmp_path / "r.csv"), tf.read_finger(data)
    write_rerun(tmp_path / "out.rrd", tf.run(finger, recording).outputs, recording, finger, 1)
    torques = [path for path in contents_of(tmp_path / "out.rrd").values if path.endswith("/joint_torque")]
    assert len(torques) == len(data["joints"]) > 1


def test_without_the_package_it_names_what_to_install(
    call: Call, files: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    answer = call("run", *files, "-o", "out.csv", "--rerun", "out.rrd")
    assert answer.status == 2 and 'pip install "tendonfmu[rerun]"' in answer.err and answer.err.count("\n") == 1
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.long
@pytest.mark.parametrize(
    ("target", "words"), [("out.csv", "unknown format '.csv'; expected .rrd"), ("absent/out.rrd", "no folder absent")]
)
def test_a_file_that_cannot_be_is_refused_first(
    call: Call, files: tuple[str, str], tmp_path: Path, target: str, words: str
) -> None:
    require("rerun")
    answer = call("run", *files, "-o", "first.csv", "--rerun", target)
    assert answer.status == 2 and words in answer.err and not (tmp_path / "first.csv").exists()


def test_a_hand_is_refused(call: Call, files: tuple[str, str], tmp_path: Path) -> None:
    (tmp_path / "hand.json").write_text(json.dumps({"format": "tendonfmu-hand-1"}))
    answer = call("run", "hand.json", files[1], "-o", "out.csv", "--rerun", "out.rrd")
    assert answer.status == 2 and "hand.json: a hand; --rerun shows one finger" in answer.err


@pytest.mark.long
def test_times_that_rerun_cannot_hold_are_refused(files: tuple[str, str], tmp_path: Path) -> None:
    require("rerun")
    recording = replace(tf.read_recording(tmp_path / "r.csv"), time=1e10 + np.arange(50.0))
    with pytest.raises(tf.InputError, match=r"time 1e\+10 to 1e\+10 s; Rerun holds times up to 9\.2e\+09 s"):
        write_rerun(tmp_path / "out.rrd", tf.run(FINGER, recording).outputs, recording, None, 1)
    assert not (tmp_path / "out.rrd").exists()
