"""A run as a recording for Rerun, read back: numbers of the table, contacts, residual and bound.

The viewer takes 0.5 GB, so what needs it is long.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
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
from tendonfmu.files.tables import read_table
from tendonfmu.interface.running import RunResult
from tendonfmu.recordings.recording import Recording, flagged_stretches
from tendonfmu.report.rerun_recording import write_rerun

DEMO = ROOT / "examples" / "demo_recording"
CALIBRATED = DEMO / "index_finger_calibrated.json"
JOINTS = ["mcp_abduction", "mcp_flexion", "pip_flexion", "dip_flexion"]


@dataclass
class Contents:
    """What a file of Rerun holds, by entity."""

    times: dict[str, NDArray[np.float64]] = field(default_factory=dict)  # s
    values: dict[str, dict[str, list[Any]]] = field(default_factory=dict)  # by component, one list for each time

    def curve(self, path: str) -> NDArray[np.float64]:
        return np.array([value for (value,) in self.values[path]["Scalars:scalars"]])


def contents_of(file: Path) -> Contents:
    require("rerun")
    try:
        from rerun.chunk import RrdReader
    except ImportError:
        from rerun.experimental import RrdReader  # of 0.39 and before
    reader = RrdReader(file)
    found = Contents()
    for chunk in reader.stream():
        path, batch = chunk.entity_path.removeprefix("/"), chunk.to_record_batch()
        if chunk.is_static:
            continue
        assert chunk.timeline_names == ["time"]
        found.times[path] = batch["time"].cast("int64").to_numpy() / 1e9
        found.values[path] = {name: batch[name].to_pylist() for name in batch.schema.names if ":" in name}
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
        for group, output in (("torque", "joint_torque"), ("torque", "compensated_torque"), ("motion", "joint_angle")):
            path = f"joints/{name}/{group}/{output}"
            np.testing.assert_allclose(found.times[path], time, rtol=0, atol=1e-9)
            np.testing.assert_array_equal(found.curve(path), written.output(output, j))
        reference = written.recording.groups["external_torque"][:, j - 1]
        np.testing.assert_array_equal(found.curve(f"joints/{name}/torque/external_torque"), reference)
    forces = written.recording.groups["tendon_force"]
    for name, force in zip(tf.read_finger(CALIBRATED).tendon_names, forces.T, strict=True):
        np.testing.assert_array_equal(found.curve(f"tendons/{name}/tendon_force"), force)


@pytest.mark.long
def test_contacts_and_labels_are_lanes(written: Written) -> None:
    time = written.result.outputs["time"]
    flags = {f"contact/{j}_{name}": written.output("joint_contact", j) for j, name in enumerate(JOINTS, start=1)}
    assert written.recording.contact is not None
    flags["contact/label"] = written.recording.contact
    for path, expected in flags.items():
        states = [state for (state,) in written.contents.values[path]["StateChange:state"]]
        begins = written.contents.times[path]
        ends = np.append(begins[1:], time[-1])
        spans = [(begin, end) for begin, end, state in zip(begins, ends, states, strict=True) if state]
        np.testing.assert_allclose(spans, flagged_stretches(time, expected), rtol=0, atol=1e-9)


def test_the_residual_exceeds_its_bound_in_contact_and_only_then() -> None:
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
    for without in ("friction_bound", "uncertainty"):  # each is a part of it
        other = {**data, "contact": {key: value for key, value in data["contact"].items() if key != without}}
        lower = residual_and_bound(tf.read_finger(other), recording, 1)[1]
        assert (bound - lower).max() > 0.01 * bound.max()
    plain = {**data, "contact": {key: data["contact"][key] for key in kept[:2]}}
    expected = plain["contact"]["threshold"] + force[:, None] * plain["contact"]["threshold_per_force"]
    np.testing.assert_allclose(residual_and_bound(tf.read_finger(plain), recording, 1)[1], expected, rtol=1e-15)


@pytest.mark.long
def test_residual_and_bound_are_drawn(written: Written) -> None:
    residual, bound = residual_and_bound(tf.read_finger(CALIBRATED), written.recording, 1)
    for j, name in enumerate(JOINTS):
        path, found = f"joints/{name}/residual", written.contents
        np.testing.assert_array_equal(found.curve(f"{path}/residual"), residual[:, j])
        np.testing.assert_array_equal(found.curve(f"{path}/bound"), bound[:, j])
        contact = written.output("joint_contact", j + 1) > 0
        np.testing.assert_array_equal(found.curve(f"{path}/in_contact"), np.where(contact, residual[:, j], np.nan))


# --- the command ------------------------------------------------------------------------------------------------------


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
    table = read_table(tmp_path / "out.csv", lambda *_: None)
    name = FINGER["joints"][0]["name"]
    for found in (first, second):
        np.testing.assert_array_equal(found.curve(f"joints/{name}/torque/joint_torque"), table["joint_torque[1]"])


def test_without_the_package_it_names_what_to_install(
    call: Call, files: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    answer = call("run", *files, "-o", "out.csv", "--rerun", "out.rrd")
    assert answer.status == 2 and 'pip install "tendonfmu[rerun]"' in answer.err and answer.err.count("\n") == 1
    assert not (tmp_path / "out.csv").exists()


def test_a_hand_is_refused(call: Call, files: tuple[str, str], tmp_path: Path) -> None:
    (tmp_path / "hand.json").write_text(json.dumps({"format": "tendonfmu-hand-1"}))
    answer = call("run", "hand.json", files[1], "-o", "out.csv", "--rerun", "out.rrd")
    assert answer.status == 2 and "hand.json: a hand; --rerun shows one finger" in answer.err
