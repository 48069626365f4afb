"""examples/davinci against the recordings, by the commands of docs/evidence/davinci.md.

Needs the recordings in ../shared/data or $TENDONFMU_DATA.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from optional_parts import DATA, needs
from repository_paths import ROOT

JAW = ROOT / "examples" / "davinci" / "jaw.json"
RUNS = DATA / "davinci_tool" / "Tool_4_Maryland_L_4"

pytestmark = needs("davinci data")

LIMIT = 0.025  # N·m
SLOW = [f"0{load}" for load in range(10)]
FAULT = {"07": 16.5}  # s; the instrument jams afterwards
SETTLED = 2.5  # s; the data's notes give their figures from here on


def command(*arguments: str | Path) -> None:
    main = "from tendonfmu.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", main, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def rms(values: NDArray[Any]) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.fixture(scope="module")
def jaw(tmp_path_factory: pytest.TempPathFactory) -> Path:
    fmu = tmp_path_factory.mktemp("davinci") / "jaw.fmu"
    command("build", JAW, "-o", fmu)
    return fmu


def run(jaw: Path, folder: Path, name: str) -> pd.DataFrame:
    """Recording and outputs side by side, up to the fault."""
    recording, outputs = folder / "recording.csv", folder / "outputs.csv"
    command("convert", "davinci", RUNS / f"{name}.TXT", "-o", recording)
    command("run", jaw, recording, "-o", outputs)
    table = pd.read_csv(recording).merge(pd.read_csv(outputs), on="time", validate="one_to_one")
    assert len(table) > 19_900
    return table[table["time"] <= FAULT.get(name, np.inf)]


@pytest.mark.long
@pytest.mark.parametrize("name", SLOW)
def test_compensated_torque_follows_the_jaw_sensor(jaw: Path, tmp_path: Path, name: str) -> None:
    table = run(jaw, tmp_path, name)
    error = rms((table["compensated_torque[1]"] - table["external_torque[1]"]).to_numpy())
    assert error <= LIMIT


@pytest.mark.parametrize(("name", "expected"), [("00", 0.051), ("09", 0.087)])
def test_signs_and_units_by_the_error_without_a_friction_model(tmp_path: Path, name: str, expected: float) -> None:
    """51 and 87 mN·m, which a wrong sign, unit or radius would miss by far."""
    command("convert", "davinci", RUNS / f"{name}.TXT", "-o", tmp_path / "recording.csv")
    table = pd.read_csv(tmp_path / "recording.csv")
    moment_arm = json.loads(JAW.read_text())["tendons"][0]["moment_arms"][0]
    friction = moment_arm * table["tendon_force[1]"] - table["external_torque[1]"]
    assert rms(friction[table["time"] >= SETTLED].to_numpy()) == pytest.approx(expected, abs=0.001)
