"""The diagnosed models of EMPS and the da Vinci jaw hold: needs the recordings in ../shared/data or $TENDONFMU_DATA."""

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
from tendonfmu.model.native import run_recording
from tendonfmu.recordings.converters import convert_file
from tendonfmu.recordings.recording import Recording

emps = needs("emps data")
davinci = needs("davinci data")
EMPS_LIMITS = {"DATA_EMPS": 2.2, "DATA_EMPS_PULSES": 3.1}  # % of the force
JAW_LIMIT = 0.008  # N·m
ODD = ("01", "03", "05", "07", "09")


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
