"""docs/clients: the snippets that can run here run, and say what the reference traces say."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from repository_paths import ROOT, TESTS

PAGES = ROOT / "docs" / "reference" / "clients"
REFERENCE = TESTS / "reference"
CLIENTS = ["fmpy", "omsimulator", "simulink", "dymola"]


def page(name: str) -> str:
    return (PAGES / f"{name}.md").read_text(encoding="utf-8")


def snippets(name: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page(name), re.DOTALL)


def shell(script: str, folder: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["sh", "-e", "-c", script], cwd=folder, env=dict(os.environ, PATH=path), capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr.decode()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as fmpy.md supposes it, with the FMU built by the page's command."""
    for file in ("cable_loop.json", "cable_loop_in.csv"):
        shutil.copy(REFERENCE / file, tmp_path)
    shell(snippets("fmpy", "sh")[0], tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_page() -> dict[str, Any]:
    """The Python snippets of fmpy.md, one after the other; the variables after each."""
    names: dict[str, Any] = {}
    for k, code in enumerate(snippets("fmpy", "python")):
        exec(compile(code, f"fmpy.md, snippet {k + 1}", "exec"), names)
        if k == 1:
            names["of the recording"] = names["compensated_torque"]
    return names


def test_the_snippets_of_fmpy(folder: Path) -> None:
    found = run_page()
    with (REFERENCE / "cable_loop_ref.csv").open() as file:
        columns = [name.strip('"\n') for name in file.readline().split(",")]
        reference = dict(zip(columns, np.loadtxt(file, delimiter=",").T, strict=True))
    # the row of t_k carries the sample of t_{k−1}
    torque, contact = reference["compensated_torque[1]"][1:], reference["contact"][1:]
    np.testing.assert_allclose(found["of the recording"], torque, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found["torque"][:-1], torque, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found["contact"][:-1], contact)
    assert len(found["torque"]) == len(reference["time"])
    # the tunable parameter changed during the run
    result = found["result"]
    assert result["contact"][result["time"] <= 0.5].any()
    assert not result["contact"][result["time"] > 0.51].any()
    # the start value acted
    expected = reference["compensated_torque[1]"][: len(found["smoother"])]
    assert np.abs(found["smoother"]["compensated_torque[1]"] - expected).max() > 1e-5


@pytest.mark.long
def test_fmpy_compiles_the_sources(folder: Path) -> None:
    shutil.move(folder / "cable_loop.fmu", folder / "packed.fmu")
    shell("cp packed.fmu cable_loop.fmu && " + snippets("fmpy", "sh")[1], folder)
    script = ROOT / "examples" / "ci_reference_check" / "check_reference.py"
    command = [sys.executable, str(script), "cable_loop.fmu", str(REFERENCE / "cable_loop")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (folder / "cable_loop.fmu").read_bytes() != (folder / "packed.fmu").read_bytes()


@pytest.mark.parametrize("name", [*CLIENTS, "README"])
def test_pages_name_only_variables_that_exist(name: str, small_fmu: Any) -> None:
    groups = {re.sub(r"\[.*", "", each) for each in small_fmu.variables}
    mentioned = set(re.findall(r"\b((?:tendon|joint|compensated|friction|bias|kinematics)_[a-z_]+)\b", page(name)))
    assert mentioned - groups <= {"joint_side_position"}
    assert mentioned
