"""What several tests of pages show: a real fit, a diagnosis with everything in it, the outputs of a run."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import diagnosis_examples as examples
import worn_finger
from fmu_binary import FINGER
from tendonfmu.diagnosis.result import Diagnosis
from tendonfmu.estimate.fit_report import FitPicture
from tendonfmu.estimate.fitting import FrictionFit
from tendonfmu.files.tables import write_table
from tendonfmu.report.run_page import run_report

JOINTS, TENDONS, SAMPLES = 2, 3, 400
CONTACT = (slice(100, 150), slice(300, 320))


@pytest.fixture(scope="session")
def fit() -> FitPicture:
    """One recording, 30 % of it held out, and one at four times the pretension; an edge has a law at each of two
    angles."""
    data = worn_finger.described()
    (law,) = data["tendons"][0]["edge_friction"]
    data["tendons"][0]["edge_friction"] = [{"angles": [-0.3, 0.4], "laws": [law, {**law, "coulomb": 0.015}]}]
    training = worn_finger.recording(worn_finger.record(seconds=60.0), "train.parquet")
    other = worn_finger.recording(worn_finger.record(noise=2, pretension=80.0), "x4.parquet")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return FrictionFit(data, kinematics=3, holdout=0.3).fit([training], compare=[other]).picture()


@pytest.fixture(scope="session")
def full() -> Diagnosis:
    """The example with everything in it."""
    return examples.three_causes()


@pytest.fixture(scope="session")
def table() -> dict[str, Any]:
    """Outputs of a run with two contacts at the first joint, and one slack tendon."""
    time, random = np.arange(SAMPLES) / 100, np.random.default_rng(1)
    flags = np.zeros(SAMPLES, dtype=bool)
    for part in CONTACT:
        flags[part] = True
    found: dict[str, Any] = {"time": time, "contact": flags}
    for j in range(1, JOINTS + 1):
        friction = 0.02 * j * np.sin(3 * time)
        left = 0.001 * random.standard_normal(SAMPLES) + 0.05 * (flags & (j == 1))
        found |= {
            f"joint_torque[{j}]": friction + left,
            f"friction_torque[{j}]": friction,
            f"compensated_torque[{j}]": left,
            f"compensated_torque_std[{j}]": np.full(SAMPLES, 0.002 * (j == 1)),
            f"joint_angle[{j}]": np.cos(time) - j,
            f"joint_speed[{j}]": -np.sin(time),
            f"joint_contact[{j}]": flags & (j == 1),
        }
    return found | {f"slack[{i}]": (time > 3.0) & (i == 2) for i in range(1, TENDONS + 1)}


@pytest.fixture(scope="session")
def run_numbers(table: dict[str, Any]) -> dict[str, Any]:
    return run_report(Path("f.json"), Path("r.csv"), table, None, kinematics=1, output="out.csv")


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    """A finger and a recording of it, in the empty folder of the command."""
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))
    columns: dict[str, Any] = {"time": np.arange(50) / 100}
    for i in range(1, len(FINGER["tendons"]) + 1):
        columns |= {f"tendon_force[{i}]": np.full(50, 5.0), f"tendon_position[{i}]": np.linspace(0, 1e-3, 50)}
    write_table(tmp_path / "r.csv", columns)
    return "finger.json", "r.csv"
