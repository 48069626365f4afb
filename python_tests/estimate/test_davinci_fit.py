"""The da Vinci recordings by the commands of a user: converted, and fitted on even loads and judged on odd ones.

Needs the recordings in ../shared/data or $TENDONFMU_DATA.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from evidence import machines
from optional_parts import DATA, needs
from tendonfmu.recordings.recording import read_recording

START = machines.HERE / "davinci" / "two_laws.json"
RUNS = DATA / "davinci_tool" / "Tool_4_Maryland_L_4"
RADIUS = 0.005  # m, of the spindle
LIMIT = 0.020  # N·m
SETTLED = 2.5  # s; the data's notes give their figures from here on

pytestmark = needs("davinci data")


def command(*arguments: str | Path) -> None:
    main = "from tendonfmu.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", main, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def converted(folder: Path, name: str) -> Path:
    command("convert", "davinci", RUNS / f"{name}.TXT", "-o", folder / f"{name}.parquet")
    return folder / f"{name}.parquet"


@pytest.mark.parametrize(("name", "expected"), [("00", 0.051), ("09", 0.087)])
def test_signs_and_units_by_the_error_without_a_friction_model(tmp_path: Path, name: str, expected: float) -> None:
    """51 and 87 mN·m, which a wrong sign, unit or radius would miss by far."""
    recording = read_recording(converted(tmp_path, name))
    friction = (RADIUS * recording.groups["tendon_force"] - recording.groups["external_torque"])[:, 0]
    settled = friction[recording.time >= SETTLED]
    assert np.sqrt(np.mean(settled**2)) == pytest.approx(expected, abs=0.001)


@pytest.mark.long
def test_odd_loads_are_met_by_what_the_even_ones_taught(tmp_path: Path) -> None:
    even = [converted(tmp_path, name) for name in machines.EVEN]
    command("fit", START, *even, "-o", tmp_path / "fitted.json", "--report", tmp_path / "report.json")

    def missed(names: tuple[str, ...]) -> float:
        runs = [machines.jaw_run(name, pretension=None) for name in names]
        return float(machines.errors(tmp_path / "fitted.json", runs, 1, "compensated_torque")[0])

    assert missed(machines.ODD) <= LIMIT
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert report["converged"] and report["finished"]
    assert [entry["used"] for entry in report["recordings"]] == [entry["samples"] for entry in report["recordings"]]
    found = {entry["path"]: entry for entry in report["parameters"]}
    negative, positive = (found[f"tendons[1].edge_friction[1].{side}.coulomb"] for side in ("negative", "positive"))
    assert negative["value"] < 0.1 * positive["value"]  # it rubs one way
    assert positive["identified"]
    rms = report["residual"]["train"]["rms"][0]
    assert rms == pytest.approx(missed(machines.EVEN), rel=1e-3)
    assert report["residual"]["train"]["bias_only_rms"][0] > 2 * rms  # the constant offset does not do the work
