"""The SSP package of both FMUs (examples/ssp): the same numbers from every master that can be run here."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssv
from lxml import etree
from numpy.typing import NDArray

from optional_parts import require
from plant_fmu_rig import fmu_rig
from plant_rigs import needs_plant
from repository_paths import ROOT
from tendonfmu.errors import InputError
from tendonfmu.simulate.ssp import build_ssp

pytestmark = needs_plant

Table = dict[str, NDArray[Any]]
EXAMPLE = ROOT / "examples" / "ssp"
STEPS, STEP = 400, 0.001  # s
OUTPUTS = [
    *(f"plant.{name}[{i}]" for name in ("tendon_force", "tendon_position") for i in range(1, 5)),
    *(f"plant.{name}[{j}]" for name in ("joint_position", "joint_velocity", "truth.external_torque") for j in (1, 2)),
    *(f"friction.{name}[{j}]" for name in ("compensated_torque", "friction_torque") for j in (1, 2)),
]


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package; what is in it lies in the folder `unpacked` beside it."""
    folder = tmp_path_factory.mktemp("ssp")
    (folder / "rig.json").write_text(json.dumps(fmu_rig()))
    path = build_ssp(folder / "rig.json", folder / "finger.ssp")
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder / "unpacked")
    return path


def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("step_by_hand", EXAMPLE / "step_by_hand.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def by_hand(package: Path) -> Table:
    table: Table = example().run(package, STEPS)
    return table


# --- masters: outputs after each step ---------------------------------------------------------------------------------


def run_ecos(package: Path) -> Table:
    require("ecos")
    from ecospy import EcosSimulation

    rows = []
    with EcosSimulation(ssp_path=str(package), step_size=STEP) as simulation:
        simulation.init()
        for _ in range(STEPS):
            simulation.step()
            rows.append([simulation.get_real(name.replace(".", "::", 1)) for name in OUTPUTS])
        simulation.terminate()
    return dict(zip(OUTPUTS, np.array(rows).T, strict=True))


def run_libcosim(package: Path) -> Table:
    require("libcosim")
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.FATAL)
    execution = CosimExecution.from_ssp_file(str(package.parent / "unpacked"), step_size=round(STEP * 1e9))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    wanted = {}
    for component in ("plant", "friction"):
        index = execution.slave_index_from_instance_name(component)
        references = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
        names = [name.partition(".")[2] for name in OUTPUTS if name.startswith(f"{component}.")]
        wanted[index] = [references[name] for name in names]
    rows = []
    for _ in range(STEPS):
        assert execution.step()
        rows.append([x for index, references in wanted.items() for x in observer.last_real_values(index, references)])
    return dict(zip(OUTPUTS, np.array(rows).T, strict=True))


def run_fmpy(package: Path) -> Table:
    """Its rows carry the time at the beginning of the step. The start values are those of the package."""
    start_values = read_ssv(str(package), "resources/start_values.ssv")
    options = {"stop_time": (STEPS - 0.5) * STEP, "step_size": STEP, "parameter_set": start_values}
    found = simulate_ssp(str(package), **options)
    return {name: found[name] for name in OUTPUTS}


@pytest.mark.parametrize("master", [run_ecos, run_libcosim, run_fmpy])
def test_masters_agree(master: Callable[[Path], Table], package: Path, by_hand: Table) -> None:
    """The plant to the bit; the friction FMU but for the last digit of the masters' clocks."""
    found = master(package)
    for name in OUTPUTS:
        if name.startswith("plant.") or master is run_fmpy:
            np.testing.assert_array_equal(found[name], by_hand[name], name)
        else:
            np.testing.assert_allclose(found[name], by_hand[name], rtol=0, atol=1e-14, err_msg=name)


def test_the_coupling_delays_the_friction_fmu_by_one_step(package: Path, by_hand: Table) -> None:
    """Row k carries the sample that the plant had at its beginning; stepped in sequence, there is no delay."""
    sequential = example().run(package, STEPS, sequential=True)
    for name in OUTPUTS:
        ours, there = by_hand[name], sequential[name]
        if name.startswith("friction."):
            assert np.ptp(ours) > 0.0
            ours, there = ours[1:], there[:-1]
        np.testing.assert_array_equal(ours, there, name)


def test_the_finger_feels_the_push(by_hand: Table) -> None:
    """The push of 0.5 N bends both joints; the friction FMU feels it, a step later."""
    true, felt = by_hand["plant.truth.external_torque[2]"], by_hand["friction.compensated_torque[2]"]
    pushed, free = (by_hand["time"] > 0.24) & (by_hand["time"] < 0.31), by_hand["time"] < 0.19
    assert true[pushed].mean() > 0.01 and np.all(true[free] == 0.0)
    assert felt[pushed].mean() - felt[free].mean() == pytest.approx(true[pushed].mean(), rel=0.5)


def test_a_friction_fmu_that_starts_in_motion_has_no_false_contact(tmp_path: Path) -> None:
    """It takes its first sample at 1.5 s."""
    hand = example()
    with zipfile.ZipFile(
        build_ssp(ROOT / "examples/rigs/index_finger_pushes.json", tmp_path / "finger.ssp")
    ) as archive:
        archive.extractall(tmp_path)
    plant, friction = (hand.Component(tmp_path / "resources" / fmu) for fmu in hand.COMPONENTS)
    plant.fmu.exitInitializationMode()
    plant.fmu.doStep(0.0, 1.5)
    friction.set(friction.inputs, plant.get(friction.inputs))
    friction.fmu.exitInitializationMode()
    results = []
    for k in range(3000):
        friction.set(friction.inputs, plant.get(friction.inputs))
        friction.fmu.doStep(k * STEP, STEP)
        plant.fmu.doStep(1.5 + k * STEP, STEP)
        results.append(friction.results())
    found = dict(zip(friction.outputs + friction.flags, np.array(results).T, strict=True))
    for component in (plant, friction):
        component.close()
    assert not found["contact"].any() and np.abs(found["compensated_torque[2]"]).max() < 0.03


# --- the package ------------------------------------------------------------------------------------------------------


def test_what_is_in_the_package(package: Path, tmp_path: Path) -> None:
    """OMSimulator gets step and tolerance of the plant by an annotation, since SSP 1.0 has no place for them."""
    folder = package.parent / "unpacked"
    root = etree.parse(str(folder / "SystemStructure.ssd")).getroot()
    schema = Path(fmpy.__file__).parent / "ssp" / "schema" / "SystemStructureDescription.xsd"
    etree.XMLSchema(etree.parse(str(schema))).assertValid(root)
    names = {"TendonFinger.fmu", "friction.fmu", "start_values.ssv"}
    assert {path.name for path in (folder / "resources").iterdir()} == names
    connections = [each.attrib for each in root.iterfind(".//ssd:Connection", root.nsmap)]
    assert len(connections) == 2 * 4 + 2 * 2 == len(root.findall(".//ssd:Connector[@kind='input']", root.nsmap))
    assert all(each["startConnector"] == each["endConnector"] for each in connections)
    (master,) = root.findall(".//oms:SimulationInformation/oms:FixedStepMaster", root.nsmap)
    with zipfile.ZipFile(folder / "resources" / "TendonFinger.fmu") as fmu:
        default = ElementTree.fromstring(fmu.read("modelDescription.xml")).find("DefaultExperiment")
    assert default is not None and master.attrib["description"] == "oms-ma"
    assert float(master.attrib["stepSize"]) == float(default.attrib["stepSize"])
    assert float(master.attrib["relativeTolerance"]) == float(default.attrib["tolerance"])
    assert build_ssp(package.parent / "rig.json", tmp_path / "again.ssp").read_bytes() == package.read_bytes()


def test_the_package_never_takes_the_place_of_its_rig(tmp_path: Path) -> None:
    base, rig = tmp_path / "base.json", tmp_path / "rig.json"
    base.write_text(json.dumps(fmu_rig()))
    rig.write_text(json.dumps({"format": fmu_rig()["format"], "name": "small", "base": "base.json"}))
    before = base.read_bytes(), rig.read_bytes()
    for output in (rig, base):
        with pytest.raises(InputError, match="the same file as the input"):
            build_ssp(rig, output)
    assert (base.read_bytes(), rig.read_bytes()) == before


# --- examples/ssp -----------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_the_scripts_of_the_example(tmp_path: Path) -> None:
    calls = [(0, "make_ssp.py"), (0, "step_by_hand.py", "finger.ssp", "0.3"), (2, "make_ssp.py", "missing.json")]
    for status, script, *arguments in calls:
        command = [sys.executable, str(EXAMPLE / script), *arguments]
        assert subprocess.run(command, cwd=tmp_path, check=False).returncode == status


@pytest.mark.long
@pytest.mark.parametrize(("module", "part"), [("fmpy", None), ("ecospy", "ecos"), ("libcosimpy", "libcosim")])
def test_the_snippets_of_its_page(
    module: str, part: str | None, package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = (EXAMPLE / "README.md").read_text(encoding="utf-8")
    (code,) = [code for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if f"from {module}" in code]
    if part is not None:
        require(part)
    monkeypatch.chdir(package.parent)
    names: dict[str, Any] = {}
    exec(compile(code, f"README.md, {module}", "exec"), names)
    expected = example().run(package, 2000)["friction.compensated_torque[2]"]
    np.testing.assert_allclose(names["torque"], expected, rtol=0, atol=1e-12)
