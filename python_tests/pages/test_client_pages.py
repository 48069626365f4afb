"""docs/reference/clients: the programs that can run here give what the reference traces and a run by hand give."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import subprocess
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from test_code_blocks import run

from optional_parts import FMI4J, MAESTRO, needs
from plant_fmu_rig import fmu_rig
from plant_rigs import needs_plant
from repository_paths import ROOT, TESTS
from tendonfmu.fmu import build_fmu

PAGES = ROOT / "docs" / "reference" / "clients"
REFERENCE = TESTS / "reference"
SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
STEPS = 400
# Java finds the memory of the whole machine, not what is left of it; one core is enough.
JAVA = ["java", "-Xmx512m", "-XX:ActiveProcessorCount=1"]


def snippets(page: str, language: str) -> list[str]:
    text = (PAGES / f"{page}.md").read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def table(file: Path) -> dict[str, Any]:
    """Columns of a CSV file by name."""
    header, *rows = file.read_text().replace("true", "1").replace("false", "0").replace('"', "").splitlines()
    return dict(zip(header.split(","), np.array([row.split(",") for row in rows], dtype=float).T, strict=True))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as the pages suppose it, with the FMU that they build."""
    for file in ("cable_loop.json", "cable_loop_in.csv"):
        shutil.copy(REFERENCE / file, tmp_path)
    build_fmu(tmp_path / "cable_loop.json", tmp_path / "cable_loop.fmu")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_snippets_of_fmpy(folder: Path) -> None:
    found: dict[str, Any] = {}
    for k, code in enumerate(snippets("fmpy", "python")):
        exec(compile(code, f"fmpy.md, snippet {k + 1}", "exec"), found)
        if k == 1:
            found["of the recording"] = found["compensated_torque"]
    # the row of t_k carries the sample of t_{k−1}
    reference = {name: values[1:] for name, values in table(REFERENCE / "cable_loop_ref.csv").items()}
    torque = reference["compensated_torque[1]"]
    np.testing.assert_allclose(found["of the recording"], torque, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found["torque"][:-1], torque, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found["contact"][:-1], reference["contact"])
    assert found["left_out"] == [40, 41, 42] and abs(found["latest"][0] - found["torque"][-1]) < 0.1  # it went on
    # the tunable parameter changed during the run, and the start value acted
    result = found["result"]
    assert result["contact"][result["time"] <= 0.5].any() and not result["contact"][result["time"] > 0.51].any()
    smoother = found["smoother"]["compensated_torque[1]"][1:]
    assert np.abs(smoother - torque[: len(smoother)]).max() > 1e-5


@pytest.mark.long
@needs("java", "fmi4j")
def test_the_program_of_fmi4j(folder: Path) -> None:
    """The program of the page, against the trace of the independent implementation."""
    (program,) = snippets("fmi4j", "java")
    (folder / "Run.java").write_text(program, encoding="utf-8")
    run([*JAVA, "-cp", f"{FMI4J}/*", "Run.java"], folder)
    names = ("compensated_torque[1]", "joint_angle[1]", "contact")
    (folder / "out.csv").write_text(",".join(("time", *names)) + "\n" + (folder / "out.csv").read_text())
    found, reference = table(folder / "out.csv"), table(REFERENCE / "cable_loop_ref.csv")
    for name in names:
        expected = reference[name][1:]  # the row of t + h carries the sample at t
        assert np.abs(found[name][:-1] - expected).max() <= 1e-9 * np.abs(expected).max() + 1e-12, name
        assert np.ptp(expected) > 0


@pytest.mark.long
@needs_plant
@needs("java", "maestro")
def test_maestro_couples_both_fmus(tmp_path: Path) -> None:
    """Row k of Maestro is step k by hand, to the bit."""
    from tendonfmu.simulate.ssp import build_ssp

    (tmp_path / "rig.json").write_text(json.dumps(fmu_rig()))
    package = build_ssp(tmp_path / "rig.json", tmp_path / "finger.ssp")
    with zipfile.ZipFile(package) as archive:
        archive.extractall(tmp_path)
    system = ElementTree.parse(tmp_path / "SystemStructure.ssd")
    shown, times = (json.loads(text) for text in snippets("maestro", "json"))
    logged = {"{friction}.f": ["compensated_torque[1]", "compensated_torque[2]"]}
    multimodel = shown | {
        "fmus": {
            "{plant}": str(tmp_path / "resources" / "TendonFinger.fmu"),
            "{friction}": str(tmp_path / "resources" / "friction.fmu"),
        },
        "connections": {
            f"{{plant}}.p.{each.attrib['startConnector']}": [f"{{friction}}.f.{each.attrib['endConnector']}"]
            for each in system.iter(f"{SSD}Connection")
        },
        "logVariables": logged,
    }
    assert times["endTime"] == STEPS * multimodel["algorithm"]["size"]
    (tmp_path / "multimodel.json").write_text(json.dumps(multimodel))
    (tmp_path / "times.json").write_text(json.dumps(times))
    command = [*JAVA, "-jar", str(MAESTRO), "import", "-output=out", "-i", "sg1", "multimodel.json", "times.json"]
    subprocess.run(command, cwd=tmp_path, capture_output=True, check=True)

    found = table(tmp_path / "out" / "outputs.csv")
    spec = importlib.util.spec_from_file_location("step_by_hand", ROOT / "examples" / "ssp" / "step_by_hand.py")
    assert spec and spec.loader
    by_hand = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(by_hand)
    expected = by_hand.run(package, STEPS)
    friction = [f"friction.{name}" for name in logged["{friction}.f"]]
    for name in ("plant.tendon_force[1]", "plant.joint_position[2]", *friction):
        component, variable = name.split(".")
        ours = found[f"{{{component}}}.{component[0]}.{variable}"]
        np.testing.assert_array_equal(ours[1:], expected[name][: len(ours) - 1], name)
        assert len(ours) == STEPS and np.ptp(ours) > 0
