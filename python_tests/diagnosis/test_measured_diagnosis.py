"""The diagnosed models of EMPS, the da Vinci jaw and PSM hold: needs ../shared/data or $TENDONFMU_DATA."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from optional_parts import DATA, needs
from repository_paths import ROOT
from tendonfmu.diagnosis.diagnosis import diagnose
from tendonfmu.files.tables import write_table
from tendonfmu.interface import diagnose as find
from tendonfmu.model.native import run_recording
from tendonfmu.recordings import describe_recorded_joint
from tendonfmu.recordings.converters import convert_file
from tendonfmu.recordings.recording import Recording

emps = needs("emps data")
davinci = needs("davinci data")
psm = needs("psm data")
EMPS_LIMITS = {"DATA_EMPS": 2.2, "DATA_EMPS_PULSES": 3.1}  # % of the force
JAW_LIMIT = 0.008  # N·m
ODD = ("01", "03", "05", "07", "09")
STALL = (17.08, 17.45)  # s, run 07


def read_json(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def example(folder: str, module: str) -> ModuleType:
    """A module of examples/FOLDER, whose modules import each other by name."""
    place = str(ROOT / "examples" / folder)
    if place not in sys.path:
        sys.path.insert(0, place)
    return importlib.import_module(module)


@emps
@pytest.mark.parametrize(("name", "limit"), EMPS_LIMITS.items())
def test_the_diagnosed_carriage_misses_little_of_the_force(name: str, limit: float) -> None:
    recordings = example("emps", "emps_recordings")
    recording = recordings.read_emps(DATA / "emps" / f"{name}.mat", decimation=1)
    model = read_json(ROOT / "examples" / "emps" / "emps_extended.json")
    assert recordings.relative_as_published(model, recording) <= limit


def jaw_error(model: dict[str, Any]) -> float:
    """rms of compensated minus external torque over the odd loads, N·m, before run 07 jams."""
    recordings = example("davinci", "jaw_recordings")
    missed = []
    for name in ODD:
        columns = convert_file("davinci", recordings.data_folder() / f"{name}.TXT", {"pretension": 13.0})
        groups = {key.removesuffix("[1]"): value[:, None] for key, value in columns.items() if key != "time"}
        recording = Recording(Path(name), columns["time"], groups)
        error = recordings.torque_error(recording, run_recording(model, recording.arrays()))
        missed.append(error[recording.time <= recordings.FAULT.get(name, np.inf)])
    return float(np.sqrt(np.mean(np.concatenate(missed) ** 2)))


@davinci
def test_the_diagnosed_jaw_tells_the_torque_at_loads_it_was_not_trained_on() -> None:
    assert jaw_error(read_json(ROOT / "examples" / "davinci" / "jaw_extended.json")) <= JAW_LIMIT
    assert jaw_error(read_json(ROOT / "examples" / "davinci" / "jaw_nominal.json")) > 2 * JAW_LIMIT


def written(file: Path, format_: str, source: Path, options: dict[str, float]) -> Path:
    write_table(file, convert_file(format_, source, options))
    return file


@emps
@pytest.mark.long
def test_the_carriage_s_causes_are_named(tmp_path: Path) -> None:
    """The published cause, and those that the publication does not have; nothing of the mass, which is known."""
    source = DATA / "emps" / "DATA_EMPS.mat"
    recording = written(tmp_path / "emps.parquet", "emps", source, {"decimation": 1})
    found = diagnose(ROOT / "examples" / "emps" / "emps.json", [recording], kinematics=3)
    named = [cause.where.effect for cause in found.causes]
    assert {"asymmetric_friction", "time_delay", "stribeck"} <= set(named[:3])
    assert "inertia" not in named
    assert found.extended_data["extensions"]
    recordings = example("emps", "emps_recordings")
    whole = recordings.read_emps(source, decimation=1)
    assert recordings.relative_as_published(found.extended_data, whole) <= EMPS_LIMITS["DATA_EMPS"]


@davinci
@pytest.mark.long
def test_the_jaw_s_causes_are_named_and_its_stall_is_an_event(tmp_path: Path) -> None:
    folder = DATA / "davinci_tool" / "Tool_4_Maryland_L_4"
    even, odd = (
        [written(tmp_path / f"{k}.parquet", "davinci", folder / f"{k}.TXT", {"pretension": 13.0}) for k in names]
        for names in (("00", "02", "04", "06", "08"), ODD)
    )
    found = diagnose(ROOT / "examples" / "davinci" / "jaw_nominal.json", even, odd)
    growing = {"load_friction", "joint_load_friction", "edge_friction"}
    named = [cause.where.effect for cause in found.causes[:3]]
    assert "presliding" in named and growing & set(named)
    stalls = [event for event in found.events if Path(event.recording).stem == "07"]
    assert any(event.start < STALL[1] and event.end > STALL[0] for event in stalls)
    assert jaw_error(dict(found.extended_data)) <= JAW_LIMIT


@psm
@pytest.mark.long
def test_the_arm_s_inertia_varies_as_it_folds() -> None:
    recordings = example("psm", "psm_recordings")
    starts = [
        describe_recorded_joint(f"joint_{j}", recordings.recording_of(recordings.FIRST[0], j), 1.0) for j in (1, 2)
    ]
    seen, unseen = (
        [recordings.coupled_recording(name, (1, 2)) for name in names]
        for names in (recordings.FIRST, recordings.SECOND)
    )
    report = find(recordings.coupled_finger(starts), seen, test=unseen, kinematics=3).report
    cause = report["causes"][0]
    assert (cause["effect"], cause["joint"]) == ("inertia_variation", 1)
    assert max(report["extended"]["test_rms"]) < 0.15  # N·m, of efforts of 0.8
