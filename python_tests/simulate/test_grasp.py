"""examples/grasp: a short grasp with compensation and without, and the same loop in the masters of its SSP package."""

from __future__ import annotations

import importlib
import math
import zipfile
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from optional_parts import require
from plant_rigs import needs_plant
from repository_paths import ROOT
from tendonfmu.simulate.ssp import build_ssp

pytestmark = needs_plant

EXAMPLE = ROOT / "examples" / "grasp"
FINGER = EXAMPLE.parent / "fingers" / "index_finger.json"
SHORT = {"speed": 0.4, "forces": (1.0,), "hold": 2.5, "frequency": 1.0}
SHORTEST = {"speed": 0.8, "way": (0.8,), "touch": 0.2, "forces": (1.0,), "hold": 0.1}


@pytest.fixture(scope="module")
def example() -> Any:
    """Modules of the example by name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(EXAMPLE)
        yield importlib.import_module


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_ssp(EXAMPLE / "rig.json", tmp_path_factory.mktemp("grasp") / "grasp.ssp", FINGER)


@pytest.fixture(scope="module")
def fmus(package: Path) -> tuple[Path, Path]:
    """Those of the package."""
    with zipfile.ZipFile(package) as archive:
        archive.extractall(package.parent)
    resources = package.parent / "resources"
    return resources / "TendonFinger.fmu", resources / "friction.fmu"


@pytest.mark.long
def test_compensation_stops_gently_and_holds_the_force(example: Any, fmus: tuple[Path, Path]) -> None:
    """On the way the finger pauses and turns back; while it holds 1 N the plate moves by 3 mm, friction with it."""
    grasp, task = example("grasp"), example("controller").Task(**SHORT)
    table, loop = grasp.run(*fmus, task)
    ours = grasp.measures(table, loop)
    assert 0.0 < ours["delay"] < 0.06
    assert ours["stop_force"] < 0.75 and ours["peak_force"] < 0.9
    assert ours["rms_error_1N"] < 0.3 and abs(ours["mean_error_1N"]) < 0.15
    holding = (table["time"] - loop.held_at) > grasp.SETTLED
    assert table["contact"][holding].all(), "the bias must stay while a force is held"
    assert np.ptp(table["joint_angle[2]"][holding]) > 0.02, "friction never changed its direction"

    without = grasp.measures(*grasp.run(*fmus, replace(task, compensated=False)))
    assert without["delay"] > 0.0
    spread = math.sqrt(without["rms_error_1N"] ** 2 - without["mean_error_1N"] ** 2)
    assert without["rms_error_1N"] > 2.0 * ours["rms_error_1N"]
    assert spread > 1.5 * ours["rms_error_1N"], "even with the best offset"


# --- SSP --------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def by_hand(example: Any, fmus: tuple[Path, Path]) -> Any:
    return example("grasp").run(*fmus, example("controller").Task(**SHORTEST))


def run_master(example: Any, name: str, package: Path) -> Any:
    masters: ModuleType = example("ssp_masters")
    require(name)
    return masters.run(name, package, example("controller").Task(**SHORTEST))


def test_libcosim_runs_the_same_grasp(example: Any, package: Path, by_hand: Any) -> None:
    found, expected = run_master(example, "libcosim", package)[0], by_hand[0]
    assert expected["force"].max() > 0.5
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=0, atol=1e-9, err_msg=name)
