"""`tendonfmu fit` on the da Vinci recordings, by the commands of docs/evidence/fit.md: even loads train, odd ones test.

Needs the recordings in ../shared/data or $TENDONFMU_DATA.
"""

from __future__ import annotations

import copy
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from optional_parts import DATA, needs
from repository_paths import ROOT
from tendonfmu.model.native import run_recording
from tendonfmu.recordings.recording import read_recording

EXAMPLE = ROOT / "examples" / "davinci"
START = EXAMPLE / "jaw_start.json"
RUNS = DATA / "davinci_tool" / "Tool_4_Maryland_L_4"

measured = needs("davinci data")

LIMIT = 0.020  # N·m
EVEN, ODD, FAST = ("00", "02", "04", "06", "08"), ("01", "03", "05", "07", "09"), ("40", "42", "44", "46", "48")
FAULT = {"07": 16.5}  # s; the instrument jams afterwards


def command(*arguments: str | Path) -> None:
    main = "from tendonfmu.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", main, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def numbers(finger: dict[str, Any]) -> list[float]:
    edge = finger["tendons"][0]["edge_friction"][0]
    laws = (finger["joints"][0]["friction"], edge["positive"], edge["negative"])
    return [law["coulomb"] for law in laws] + finger["bias"]["initial_torque"]


def test_the_start_differs_from_the_jaw_in_what_is_fitted_alone() -> None:
    start, jaw = (json.loads((EXAMPLE / name).read_text(encoding="utf-8")) for name in ("jaw_start.json", "jaw.json"))
    assert numbers(start) == [0.05, 0.1, 0.1, 0.0]
    same = copy.deepcopy(start)
    same["bias"]["initial_torque"] = jaw["bias"]["initial_torque"]
    same["joints"][0]["friction"] |= {key: jaw["joints"][0]["friction"][key] for key in ("static", "coulomb")}
    for side in ("positive", "negative"):
        law = jaw["tendons"][0]["edge_friction"][0][side]
        same["tendons"][0]["edge_friction"][0][side] |= {key: law[key] for key in ("static", "coulomb")}
    assert same == jaw


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recordings, converted, and fitted.json with report.json of the even ones."""
    folder = tmp_path_factory.mktemp("davinci_fit")
    for name in (*EVEN, *ODD, *FAST):
        command("convert", "davinci", RUNS / f"{name}.TXT", "-o", folder / f"{name}.parquet")
    even = [folder / f"{name}.parquet" for name in EVEN]
    command("fit", START, *even, "-o", folder / "fitted.json", "--report", folder / "report.json")
    return folder


def pooled(folder: Path, names: tuple[str, ...]) -> float:
    """rms in N·m of compensated minus external torque, over all samples before a fault."""
    finger = json.loads((folder / "fitted.json").read_text(encoding="utf-8"))
    missed: list[NDArray[Any]] = []
    for name in names:
        recording = read_recording(folder / f"{name}.parquet")
        outputs = run_recording(finger, recording.arrays())
        error = (outputs["compensated_torque"] - recording.groups["external_torque"])[:, 0]
        missed.append(error[recording.time <= FAULT.get(name, np.inf)])
    return float(np.sqrt(np.mean(np.concatenate(missed) ** 2)))


@pytest.mark.long
@measured
def test_odd_loads_are_met_by_what_the_even_ones_taught(folder: Path) -> None:
    assert pooled(folder, ODD) <= LIMIT


@pytest.mark.long
@measured
def test_the_fit_says_what_it_did(folder: Path) -> None:
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert report["converged"] and report["finished"]
    assert [entry["used"] for entry in report["recordings"]] == [entry["samples"] for entry in report["recordings"]]
    found = {entry["path"]: entry for entry in report["parameters"]}
    negative, positive = (found[f"tendons[1].edge_friction[1].{side}.coulomb"] for side in ("negative", "positive"))
    assert negative["value"] < 0.1 * positive["value"]  # it rubs one way
    assert found["tendons[1].edge_friction[1].positive.coulomb"]["identified"]
    rms = report["residual"]["train"]["rms"][0]
    assert rms == pytest.approx(pooled(folder, EVEN), rel=1e-3)
    assert report["residual"]["train"]["bias_only_rms"][0] > 2 * rms  # the constant offset does not do the work
