"""A run as a recording for Rerun, read back: numbers of the table, contacts, residual and contact level.

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
from optional_parts import require
from repository_paths import ROOT
from tendonfmu.recordings.recording import flagged_stretches
from tendonfmu.report.rerun_recording import write_rerun

Numbers = NDArray[np.float64]

DEMO = ROOT / "examples" / "demo_recording"
CALIBRATED = DEMO / "index_finger_calibrated.json"


@dataclass
class Contents:
    """What a file of Rerun holds, by entity."""

    times: dict[str, Numbers] = field(default_factory=dict)  # s
    values: dict[str, dict[str, list[Any]]] = field(default_factory=dict)  # by component, one list for each time

    def curve(self, path: str) -> Numbers:
        return np.array([value for (value,) in self.values[path]["Scalars:scalars"]])


def contents_of(file: Path) -> Contents:
    require("rerun")
    try:
        from rerun.chunk import RrdReader
    except ImportError:
        from rerun.experimental import RrdReader  # of 0.39 and before
    found = Contents()
    for chunk in RrdReader(file).stream():
        path, batch = chunk.entity_path.removeprefix("/"), chunk.to_record_batch()
        if not chunk.is_static:
            found.times[path] = batch["time"].cast("int64").to_numpy() / 1e9
            found.values[path] = {name: batch[name].to_pylist() for name in batch.schema.names if ":" in name}
    return found


@pytest.mark.long
def test_what_is_written_is_the_run(tmp_path: Path) -> None:
    """Signals, residual and contact level, contacts and labels of a part of the demo."""
    require("rerun")
    recording, finger = tf.read_recording(DEMO / "index_finger_pushes.parquet")[8.0:16.0], tf.read_finger(CALIBRATED)
    outputs = tf.run(finger, recording).outputs
    write_rerun(tmp_path / "out.rrd", outputs, recording, finger)
    found, time = contents_of(tmp_path / "out.rrd"), outputs["time"]
    assert recording.contact is not None
    flags = {"contact/label": recording.contact}
    for j, name in enumerate(finger.joint_names):
        flags[f"contact/{j + 1}_{name}"] = outputs["joint_contact"][:, j]
        drawn = {
            "torque/external_torque": recording.groups["external_torque"],
            "residual/residual": outputs["residual"],
            "contact_level/contact_level": outputs["contact_level"],
            "motion/joint_angle": outputs["joint_angle"],
            **{f"torque/{output}": outputs[output] for output in ("joint_torque", "compensated_torque")},
        }
        for path, values in drawn.items():
            np.testing.assert_allclose(found.times[f"joints/{name}/{path}"], time, rtol=0, atol=1e-9)
            np.testing.assert_array_equal(found.curve(f"joints/{name}/{path}"), values[:, j])
    for name, force in zip(finger.tendon_names, recording.groups["tendon_force"].T, strict=True):
        np.testing.assert_array_equal(found.curve(f"tendons/{name}/tendon_force"), force)
    for path, expected in flags.items():
        states = [state for (state,) in found.values[path]["StateChange:state"]]
        begins = found.times[path]
        spans = [each[:2] for each in zip(begins, np.append(begins[1:], time[-1]), states, strict=True) if each[2]]
        np.testing.assert_allclose(spans, flagged_stretches(time, expected), rtol=0, atol=1e-9)


# --- the command ------------------------------------------------------------------------------------------------------


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
    assert answer.status == 2 and "hand.json: a hand, given with --rerun; expected a finger" in answer.err
