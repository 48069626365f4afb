"""examples/grasp: a short grasp with compensation and without."""

from __future__ import annotations

import importlib
import math
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plant_rigs import needs_plant
from repository_paths import ROOT
from tendonfmu.simulate.ssp import build_ssp

pytestmark = [needs_plant, pytest.mark.long]

EXAMPLE = ROOT / "examples" / "grasp"
FINGER = EXAMPLE.parent / "fingers" / "index_finger.json"


@pytest.fixture(scope="module")
def example() -> Any:
    """Modules of the example by name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(EXAMPLE)
        yield importlib.import_module


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The SSP package, and what is in it beside it."""
    path = build_ssp(EXAMPLE / "rig.json", tmp_path_factory.mktemp("grasp") / "grasp.ssp", FINGER)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(path.parent)
    return path


def run(example: Any, package: Path, task: Any) -> Any:
    resources = package.parent / "resources"
    return example("grasp").run(resources / "TendonFinger.fmu", resources / "friction.fmu", task)


def test_compensation_stops_gently_and_holds_the_force(example: Any, package: Path) -> None:
    """On the way the finger pauses and turns back; while it holds 1 N the plate moves by 3 mm, friction with it."""
    grasp = example("grasp")
    task = example("controller").Task(speed=0.4, forces=(1.0,), hold=2.5, frequency=1.0)
    table, loop = run(example, package, task)
    ours = grasp.measures(table, loop)
    assert 0.0 < ours["delay"] < 0.06
    assert ours["stop_force"] < 0.75 and ours["peak_force"] < 0.9
    assert ours["rms_error_1N"] < 0.3 and abs(ours["mean_error_1N"]) < 0.15
    holding = (table["time"] - loop.held_at) > grasp.SETTLED
    assert table["contact"][holding].all(), "the bias must stay while a force is held"
    assert np.ptp(table["joint_angle[2]"][holding]) > 0.02, "friction never changed its direction"

    without = grasp.measures(*run(example, package, replace(task, compensated=False)))
    spread = math.sqrt(without["rms_error_1N"] ** 2 - without["mean_error_1N"] ** 2)
    assert without["rms_error_1N"] > 2.0 * ours["rms_error_1N"]
    assert spread > 1.5 * ours["rms_error_1N"], "even with the best offset"
