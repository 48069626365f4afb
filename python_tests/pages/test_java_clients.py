"""docs/reference/clients: FMI4j and Maestro run the FMUs, and say what fmpy and the reference traces say."""

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

from optional_parts import FMI4J, MAESTRO, needs
from plant_fmu_rig import fmu_rig
from plant_rigs import needs_plant
from repository_paths import ROOT, TESTS

PAGES = ROOT / "docs" / "reference" / "clients"
SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
STEPS = 400
# Java finds the memory of the whole machine, not what is left of it; one core is enough.
JAVA = ["java", "-Xmx512m", "-XX:ActiveProcessorCount=1"]


def java(folder: Path, *arguments: str) -> None:
    done = subprocess.run([*JAVA, *arguments], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


def snippets(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (PAGES / page).read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.long
@needs("java", "fmi4j")
def test_the_program_of_fmi4j(tmp_path: Path) -> None:
    """The program of the page, against the trace of the independent implementation."""
    from tendonfmu.fmu.packaging import build_fmu

    shutil.copy(TESTS / "reference" / "cable_loop_in.csv", tmp_path)
    build_fmu(TESTS / "reference" / "cable_loop.json", tmp_path / "cable_loop.fmu")
    (program,) = snippets("fmi4j.md", "java")
    (tmp_path / "Run.java").write_text(program, encoding="utf-8")
    java(tmp_path, "-cp", f"{FMI4J}/*", "Run.java")

    def rows(file: Path, skipped: int) -> Any:
        text = file.read_text().replace("true", "1").replace("false", "0").replace('"', "")
        return np.array([line.split(",") for line in text.splitlines()[skipped:]], dtype=float)

    reference_file = TESTS / "reference" / "cable_loop_ref.csv"
    names = reference_file.read_text().splitlines()[0].replace('"', "").split(",")
    found, reference = rows(tmp_path / "out.csv", 0), rows(reference_file, 1)
    for k, name in enumerate(("compensated_torque[1]", "joint_angle[1]", "contact"), start=1):
        expected = reference[1:, names.index(name)]  # the row of t + h carries the sample at t
        assert np.abs(found[:-1, k] - expected).max() <= 1e-9 * np.abs(expected).max() + 1e-12, name
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
    shown, times = (json.loads(text) for text in snippets("maestro.md", "json"))
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
    java(tmp_path, "-jar", str(MAESTRO), "import", "-output=out", "-i", "sg1", "multimodel.json", "times.json")

    header, *rows = (tmp_path / "out" / "outputs.csv").read_text().splitlines()
    found = dict(zip(header.split(","), np.array([row.split(",") for row in rows], dtype=float).T, strict=True))
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
