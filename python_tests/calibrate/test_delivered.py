"""Figures of a calibration are those of the delivered FMU, on motion that chose nothing."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from command import Call, DemoRun
from pushed_finger import FINGER, FREE, UNSEEN, pushed
from tendonfmu.calibration import calibration
from tendonfmu.calibration.calibration import Calibration, calibrate
from tendonfmu.calibration.report import Delivered, Judged
from tendonfmu.detect import stretches
from tendonfmu.detect.scoring import scaled_bounds
from tendonfmu.files.tables import write_table
from tendonfmu.model.description import read_finger
from tendonfmu.model.native import Instance
from tendonfmu.options import CalibrateOptions
from tendonfmu.recordings import Held, prepare
from tendonfmu.recordings.recording import read_recording

Numbers = NDArray[np.float64]


def rms_by_run(call: Call, model: Path, recording: Path, output: Path, chosen: NDArray[np.bool_]) -> list[float]:
    """What `tendonfmu run` leaves of the chosen samples [N], by joint (N·m)."""
    answer = call("run", model, recording, "-o", output)
    assert answer.status == 0, answer.err
    with output.open(encoding="utf-8") as table:
        names = table.readline().strip().split(",")
    columns = dict(zip(names, np.loadtxt(output, delimiter=",", skiprows=1).T, strict=True))
    joints = sum(name.startswith("compensated_torque[") for name in names)
    left = np.column_stack([columns[f"compensated_torque[{j + 1}]"] for j in range(joints)])[chosen]
    return [float(value) for value in np.sqrt(np.mean(left**2, axis=0))]


def every_fifth(time: Numbers) -> NDArray[np.bool_]:
    """[N] the blocks 4, 9, ... of a recording without a gap: of 10 s, of a short one a tenth of it."""
    since = time - time[0]
    return np.asarray(np.floor(since / min(10.0, 0.1 * since[-1])) % 5 == 4)


def test_the_errors_on_a_test_are_those_of_the_fmu(
    call: Call, calibrated: tuple[Calibration, Path], folder: Path, tmp_path: Path
) -> None:
    """Over the whole recording, and by pretension: the parts of it have the same sum of squares."""
    error = calibrated[0].report["error"]
    chosen = np.ones(len(read_recording(folder / UNSEEN)), dtype=bool)
    for name, model in (("calibrated", calibrated[1] / "finger.fmu"), ("as_given", folder / FINGER)):
        found = rms_by_run(call, model, folder / UNSEEN, tmp_path / f"{name}.csv", chosen)
        assert found == pytest.approx(error[name], rel=1e-9)
        parts = sum(each["minutes"] * np.square(each[name]) for each in error["pretensions"])
        assert np.sqrt(parts / error["minutes"]) == pytest.approx(error[name], rel=1e-9)
    assert error["minutes"] == pytest.approx(40.0 / 60.0, rel=1e-3) and not error["held_out"]
    forces = [each["mean_force"] for each in error["pretensions"]]
    assert len(forces) == 2 and forces[0] < 13.0 < 17.0 < forces[1], "as the motion was made"


def test_the_errors_on_held_out_stretches_are_those_of_the_fmu(
    call: Call, alone: tuple[Calibration, Path], folder: Path, short: Path, tmp_path: Path
) -> None:
    error = alone[0].report["error"]
    chosen = every_fifth(read_recording(short).time)
    for name, model in (("calibrated", alone[1] / "finger.fmu"), ("as_given", folder / FINGER)):
        found = rms_by_run(call, model, short, tmp_path / f"{name}.csv", chosen)
        assert found == pytest.approx(error[name], rel=1e-9)
    assert error["held_out"] and error["minutes"] == pytest.approx(0.2 * 12.0 / 60.0, rel=0.01)


def test_no_held_out_sample_chooses_anything(
    alone: tuple[Calibration, Path], folder: Path, short: Path, tmp_path: Path
) -> None:
    """With other forces there, structure, numbers and bounds are the same to the last bit; only the figures change."""
    recording = read_recording(short)
    rows = np.flatnonzero(every_fifth(recording.time))
    force = recording.groups["tendon_force"].copy()
    force[rows] = 1.5 * force[np.random.default_rng(1).permutation(rows)]
    replace(recording, groups={**recording.groups, "tendon_force": force}).write(tmp_path / "short.parquet")
    other = calibrate(folder / FINGER, [tmp_path / "short.parquet"], tmp_path / "out")
    found = alone[0]
    assert other.finger == found.finger
    one, same = ({**each.report["detection"], "kept_out": None} for each in (found, other))
    assert one == same, "but for the files' names"
    assert other.report["structure"] == found.report["structure"] and other.report["next"] == found.report["next"]
    assert min(other.report["error"]["calibrated"]) > 2.0 * max(found.report["error"]["calibrated"])


def test_a_test_chooses_nothing(
    calibrated: tuple[Calibration, Path], demo_run: DemoRun, folder: Path, tmp_path: Path
) -> None:
    """Another one leaves every step as it is, and changes the figures."""
    columns, _ = pushed(read_recording(folder / UNSEEN), json.loads((folder / FINGER).read_text()))
    columns = {name: 1.2 * values if "force" in name else values for name, values in columns.items()}
    kept = {name: values for name, values in columns.items() if name.startswith(("time", "tendon"))}
    write_table(tmp_path / "loaded.parquet", kept)
    shutil.copytree(demo_run.folder / "calibration", tmp_path / "out")
    other = calibrate(
        folder / FINGER, [folder / FREE], tmp_path / "out", CalibrateOptions(test=[tmp_path / "loaded.parquet"])
    )
    assert other.report["steps"]["repeated"] == ["diagnosis", "fit", "tune"], "no step knows the test"
    assert other.finger == calibrated[0].finger
    assert min(other.report["error"]["calibrated"]) > 1.5 * max(calibrated[0].report["error"]["calibrated"])


def test_false_alarms_are_counted_on_the_same_motion(calibrated: tuple[Calibration, Path], folder: Path) -> None:
    """As they are, and with bounds that are too low."""
    recording, finger = read_recording(folder / UNSEEN), read_finger(calibrated[1] / "finger.json")
    judged = Judged([prepare(finger, recording, 1, Held())], held_out=False)
    counts = []
    for factor in (1.0, 0.3):
        scaled = finger.replace(scaled_bounds(finger, factor))
        contact = Instance(scaled.image).run(recording.arrays())["contact"].ravel()
        counts.append(len(stretches(recording.time, contact)))
        assert Delivered(scaled, judged).alarms()["alarms"] == counts[-1]
    assert calibrated[0].report["alarms"]["alarms"] == counts[0] < counts[1]


def test_ctrl_c_says_what_is_kept_and_the_next_call_goes_on(
    call: Call, alone: tuple[Calibration, Path], folder: Path, short: Path, tmp_path: Path, monkeypatch: Any
) -> None:
    """In the last step, and in the first one."""

    def stopped(*given: Any, **options: Any) -> Any:
        raise KeyboardInterrupt

    shutil.copytree(alone[1], tmp_path / "out")
    (tmp_path / "out" / ".steps" / "tune.json").unlink()
    with monkeypatch.context() as patched:
        patched.setattr(calibration.ContactTuning, "tune", stopped)
        answer = call("calibrate", folder / FINGER, short, "-o", tmp_path / "out")
    kept = f"tendonfmu: interrupted; diagnosis, fit done; the same call goes on from there, with {tmp_path / 'out'}"
    assert answer.status == 130 and answer.err.splitlines()[-1] == kept
    with monkeypatch.context() as patched:
        patched.setattr(calibration, "diagnose", stopped)
        answer = call("calibrate", folder / FINGER, short, "-o", tmp_path / "new")
    assert answer.status == 130 and "interrupted; no step done yet" in answer.err
    answer = call("calibrate", folder / FINGER, short, "-o", tmp_path / "out")
    report = json.loads((tmp_path / "out" / "calibration.json").read_text(encoding="utf-8"))
    assert answer.status == 0 and report["steps"]["repeated"] == ["diagnosis", "fit"]
