"""Calibrations that several modules read."""

from __future__ import annotations

import json
import shutil
from importlib.resources import as_file, files
from pathlib import Path

import pytest

from command import DemoRun
from pushed_finger import FINGER, FREE, UNSEEN, pushed
from tendonfmu.calibration.calibration import Calibration, calibrate
from tendonfmu.calibration.text import write_calibration
from tendonfmu.files.tables import write_table
from tendonfmu.options import CalibrateOptions
from tendonfmu.recordings.recording import read_recording


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Finger, free motion, a test and pushes."""
    found = tmp_path_factory.mktemp("finger")
    with as_file(files("tendonfmu") / "data") as data:
        for name in (FINGER, FREE, UNSEEN):
            shutil.copy(data / name, found / name)
    columns, _ = pushed(read_recording(found / UNSEEN), json.loads((found / FINGER).read_text()))
    write_table(found / "pushes.parquet", columns)
    return found


@pytest.fixture(scope="session")
def calibrated(folder: Path, demo_run: DemoRun) -> tuple[Calibration, Path]:
    """The result, and the folder that it is written to: that of the demo, without pushes, goes on."""
    out = folder / "out"
    shutil.copytree(demo_run.folder / "calibration", out)
    found = calibrate(
        folder / FINGER,
        [folder / FREE],
        out,
        CalibrateOptions(test=[folder / UNSEEN], pushes=[folder / "pushes.parquet"]),
    )
    write_calibration(found, out)
    return found, out


@pytest.fixture(scope="session")
def short(folder: Path) -> Path:
    """12 s of the free motion."""
    read_recording(folder / FREE)[:12.0].write(folder / "short.parquet")
    return folder / "short.parquet"


@pytest.fixture(scope="session")
def alone(folder: Path, short: Path) -> tuple[Calibration, Path]:
    """The result without a test, and its folder."""
    found = calibrate(folder / FINGER, [short], folder / "alone")
    write_calibration(found, folder / "alone")
    return found, folder / "alone"
