"""TendonFinger.fmu: what is in it, what it computes, steps and time, several instances, settings."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import zipfile
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from command import Call
from fmu_binary import ERROR, FINGER, OK, Instance, UnpackedFmu, fmi_platform
from plant_fmu_rig import SEED, TOLERANCE, fmu_rig, plant_binary, play
from plant_rigs import needs_plant
from repository_paths import ROOT
from tendonfmu.errors import InputError
from tendonfmu.simulate.fmu_packaging import build_plant_fmu
from tendonfmu.simulate.plant import Plant
from tendonfmu.simulate.rig import read_rig

sys.path.insert(0, str(ROOT / "tools"))
from binary_contents import read_contents

pytestmark = needs_plant

INDEX_FINGER = ROOT / "examples" / "rigs" / "index_finger.json"
BUILD = (
    "import sys, pathlib, tendonfmu.simulate.fmu_packaging as p; p.build_plant_fmu(*map(pathlib.Path, sys.argv[1:]))"
)
LARGEST_BINARY = 2_000_000  # bytes
SYSTEM_LIBRARIES = {"libc.so.6", "libm.so.6", "libgcc_s.so.1", "ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}


def pack(folder: Path, rig: dict[str, Any], name: str = "finger.fmu") -> Path:
    (folder / "rig.json").write_text(json.dumps(rig))
    return build_plant_fmu(folder / "rig.json", folder / name)


# --- contents ---------------------------------------------------------------------------------------------------------


def test_everything_is_in(plant_fmu_path: Path) -> None:
    with zipfile.ZipFile(plant_fmu_path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    rig = read_rig(plant_fmu_path.parent / "rig.json")
    suffix = {"linux": "so", "win32": "dll", "darwin": "dylib"}[sys.platform]
    assert set(files) == {
        "modelDescription.xml",
        "model.png",
        *(f"terminalsAndIcons/{name}" for name in ("terminalsAndIcons.xml", "icon.png", "input.png", "output.png")),
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "documentation/licenses/third_party.txt",
        "resources/rig.json",
        f"binaries/{fmi_platform()}/TendonFinger_small.{suffix}",
    }
    assert json.loads(files["resources/rig.json"]) == rig.expanded
    page = files["documentation/index.html"].decode()
    root = ElementTree.fromstring(files["modelDescription.xml"])
    for scalar in root.iter("ScalarVariable"):
        assert scalar.attrib["description"]
        assert f"<code>{scalar.attrib['name']}</code>" in page
        assert "unit" in scalar[0].attrib or scalar[0].tag in ("Boolean", "Integer")
        assert ("initial" in scalar.attrib) == (scalar.attrib["causality"] != "input")  # FMI 2.0.5, section 2.2.7


def test_the_default_experiment_is_the_rigs(plant_fmu_path: Path) -> None:
    experiment = fmpy.read_model_description(str(plant_fmu_path)).defaultExperiment
    found = [experiment.startTime, experiment.stopTime, experiment.stepSize, experiment.tolerance]
    assert list(map(float, found)) == [0.0, 3.0, 0.001, TOLERANCE]


@pytest.mark.long
def test_same_input_same_bytes(tmp_path: Path) -> None:
    first = build_plant_fmu(INDEX_FINGER, tmp_path / "first.fmu").read_bytes()
    command = [sys.executable, "-c", BUILD, str(INDEX_FINGER), str(tmp_path / "other.fmu")]
    subprocess.run(command, check=True, env={"PYTHONHASHSEED": "7"})
    assert (tmp_path / "other.fmu").read_bytes() == first


@pytest.mark.parametrize("rig", ["small", "index_finger"])
def test_fmpy_finds_nothing(rig: str, plant_fmu_path: Path, tmp_path: Path) -> None:
    fmu = plant_fmu_path if rig == "small" else build_plant_fmu(INDEX_FINGER, tmp_path / "index.fmu")
    assert validate_fmu(str(fmu)) == []


def test_the_binary_is_small_and_needs_the_system_alone(plant_fmu: UnpackedFmu, record_testsuite_property: Any) -> None:
    """docs/reference/simulated_finger_fmu.md names size and GLIBC floor."""
    binary = plant_binary(plant_fmu.folder)
    contents = read_contents(binary.read_bytes())
    assert binary.stat().st_size < LARGEST_BINARY
    assert all(name.startswith("fmi2") for name in contents.exports) and len(contents.exports) == 44
    print(f"{binary.name}: {binary.stat().st_size} bytes, GLIBC {contents.glibc}, {contents.libraries}")
    record_testsuite_property("plant_fmu_glibc_floor", ".".join(map(str, contents.glibc_floor)))
    if contents.format == "ELF":
        assert set(contents.libraries) <= SYSTEM_LIBRARIES
        assert contents.glibc_floor <= (2, 17)  # of 2012, whatever the build's own is (fmu_src/glibc_floor)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"seed": 2**31}, "seed = 2147483648: expected at most 2147483647"),
        ({"physics": fmu_rig()["physics"] | {"tip": [0.0]}}, "physics.tip"),
        ({"settle": -1.0}, "settle"),
    ],
)
def test_a_rig_that_is_refused_leaves_no_file(tmp_path: Path, change: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError) as refused:
        pack(tmp_path, fmu_rig(**change))
    assert expected in str(refused.value) and "rig.json: " in str(refused.value) and "\n" not in str(refused.value)
    assert [path.name for path in tmp_path.iterdir()] == ["rig.json"]


def test_the_command_chooses_by_format(call: Call, tmp_path: Path) -> None:
    for name, data, kind in (("rig", fmu_rig(), "TendonFinger_small"), ("finger", FINGER, "small_finger")):
        (tmp_path / f"{name}.json").write_text(json.dumps(data))
        assert call("build", f"{name}.json", "-o", f"{name}.fmu").status == 0
        description = fmpy.read_model_description(str(tmp_path / f"{name}.fmu"))
        assert description.coSimulation.modelIdentifier == kind


def test_another_rig_or_a_damaged_one_is_refused(plant_fmu: UnpackedFmu, tmp_path: Path) -> None:
    text = (plant_fmu.folder / "resources" / "rig.json").read_bytes()
    for bad, expected in (
        (text.replace(b'"seed": 7', b'"seed": 8'), "fmuGUID is not that of this FMU"),
        (text[:-2], "fmi2Instantiate: rig.json: "),
        (text.replace(b'"settle": 0.3', b'"settle": -3'), "fmi2Instantiate: rig.json: settle"),
        (text.replace(b'"seed": 7', b'"seed": 7000000000'), "rig.json: seed: expected at most 2147483647"),
    ):
        assert bad != text
        (tmp_path / "rig.json").write_bytes(bad)
        refused = Instance(plant_fmu, location=tmp_path.as_uri().encode())
        assert refused.component is None and expected in refused.last_message
    assert Instance(plant_fmu, location=b"file:///no/such/folder").component is None


# --- what it computes -------------------------------------------------------------------------------------------------


def test_start_values_are_those_of_the_xml(plant_fmu: UnpackedFmu) -> None:
    with Instance(plant_fmu) as instance:
        assert instance.setup() == OK and instance.call("EnterInitializationMode") == OK
        numbers = [n for n, v in plant_fmu.variables.items() if v.start is not None and v.type == "Real"]
        assert len(numbers) == 13
        assert list(instance.get_real(numbers)) == [float(plant_fmu.variables[n].start or "") for n in numbers]
        for kind, wanted in (("Integer", [1, SEED, 2]), ("Boolean", [1, 1, 1])):
            names = plant_fmu.names("parameter", kind)
            assert instance.get_integers(names, kind) == wanted
            starts = [plant_fmu.variables[n].start for n in names]
            assert starts == (["true"] * 3 if kind == "Boolean" else list(map(str, wanted)))


def test_the_fmu_is_the_plant(plant_fmu: UnpackedFmu) -> None:
    """Every output against the Python binding, sensors and truth, to the bit."""
    plant = Plant(read_rig(plant_fmu.folder.parent / "rig.json").json())
    plant.initialise()
    expected = plant.run(np.arange(1, 301) / 1000)
    with Instance(plant_fmu) as instance:
        instance.initialise()
        names = plant_fmu.names("output")
        rows = []
        for k in range(300):
            assert instance.step(k * 0.001) == OK
            rows.append(instance.get_real(names))
    found = dict(zip(names, np.array(rows).T, strict=True))
    moved = 0
    for name, column in found.items():
        group, _, index = name.partition("[")
        signal = group.removeprefix("truth.") if group.startswith("truth.") else f"measured_{group}"
        array = expected[signal].reshape(300, -1)
        np.testing.assert_array_equal(column, array[:, int(index[:-1]) - 1 if index else 0], name)
        moved += bool(np.ptp(column) > 0.0)
    assert moved > 30


def test_torques_balance(plant_fmu: UnpackedFmu) -> None:
    with Instance(plant_fmu) as instance:
        instance.initialise()
        play(instance, 300)
        parts = ("friction", "external", "inertial", "stop")
        for j in (1, 2):
            total = instance.get_real([f"truth.{part}_torque[{j}]" for part in parts]).sum()
            assert instance.get_real([f"truth.joint_torque[{j}]"])[0] == pytest.approx(total, abs=1e-12)


def test_inputs_show_in_outputs_before_the_first_step(plant_fmu: UnpackedFmu) -> None:
    """A push on the second link's tip (0.04 m out, links 0.04 m): τ = −Jᵀ F, at rest with all angles near 0."""
    with Instance(plant_fmu) as instance:
        assert instance.setup() == OK and instance.call("EnterInitializationMode") == OK
        assert instance.get_integers(["truth.contact"], "Boolean") == [0]
        for force in (1.0, 2.0):
            assert instance.set_real({"push_force[3]": force}) == OK
            torque = instance.get_real(["truth.external_torque[1]", "truth.external_torque[2]"])
            np.testing.assert_allclose(torque, [0.08 * force, 0.04 * force], rtol=0.02)
            assert instance.get_real(["truth.contact_force[3]"]) == [force]
            assert instance.get_integers(["truth.contact"], "Boolean") == [1]
        forces = [f"truth.tendon_force[{i}]" for i in range(1, 5)]
        before = instance.get_real(forces).mean()
        assert instance.set_real({"pretension": 5.0}) == OK
        assert instance.get_real(forces).mean() == pytest.approx(before + 5.0, abs=0.05)  # it has settled with it
        shown = instance.outputs()
        assert instance.call("ExitInitializationMode") == OK
        assert instance.outputs() == shown


def test_looking_at_outputs_in_initialisation_mode_leaves_no_trace(plant_fmu: UnpackedFmu) -> None:
    with Instance(plant_fmu) as curious, Instance(plant_fmu) as plain:
        rows = []
        for instance in (curious, plain):
            assert instance.setup() == OK and instance.call("EnterInitializationMode") == OK
            for command in (1e-3, 0.0):
                assert instance.set_real({"push_force[1]": command, "tendon_position_command[2]": command}) == OK
                if instance is curious:
                    instance.outputs()
            assert instance.call("ExitInitializationMode") == OK
            rows.append(play(instance, 50))
        assert rows[0] == rows[1]


def test_the_motors_hold_until_they_are_commanded(plant_fmu: UnpackedFmu) -> None:
    motors = [f"truth.tendon_position[{i}]" for i in range(1, 5)]
    with Instance(plant_fmu) as instance:
        assert instance.call("SetBoolean", instance.vrs(["scheduled_motion"]), 1, np.zeros(1, np.int32).ctypes) == OK
        instance.initialise()
        first = instance.get_real(motors)
        for k in range(100):
            assert instance.step(k * 0.001) == OK
        np.testing.assert_allclose(instance.get_real(motors), first, rtol=0, atol=1e-9)
        goal = np.add(first, [2e-4, 0.0, 0.0, -1e-4])
        assert instance.set_real({f"tendon_position_command[{i + 1}]": x for i, x in enumerate(goal)}) == OK
        for k in range(100, 600):
            assert instance.step(k * 0.001) == OK
        np.testing.assert_allclose(instance.get_real(motors), goal, rtol=0, atol=1e-7)  # commands are absolute


def test_settings_act(plant_fmu: UnpackedFmu) -> None:
    def run(setting: str, kind: str, value: int) -> dict[str, float]:
        with Instance(plant_fmu) as instance:
            if setting:
                numbers = np.array([value], np.int32)
                assert instance.call("Set" + kind, instance.vrs([setting]), 1, numbers.ctypes) == OK
            instance.initialise()
            play(instance, 280)
            names = plant_fmu.names("output")
            return dict(zip(names, instance.get_real(names), strict=True))

    plain, again = run("", "", 0), run("seed", "Integer", SEED)
    assert plain == again
    seed = run("seed", "Integer", 8)
    measured = [name for name in plain if not name.startswith("truth.")]
    assert {name for name in plain if plain[name] != seed[name]} <= set(measured)
    assert plain["tendon_force[1]"] != seed["tendon_force[1]"]
    exact = run("sensors", "Boolean", 0)
    assert all(exact[name] == exact[f"truth.{name}"] for name in measured)
    assert run("scheduled_pushes", "Boolean", 0)["truth.contact_force[3]"] == 0.0 != plain["truth.contact_force[3]"]
    fixed = run("integrator", "Integer", 2)
    truth = [name for name in plain if name.startswith("truth.tendon_force")]
    difference = max(abs(fixed[name] - plain[name]) for name in truth)
    assert 0.0 < difference < 0.1  # N; the fixed step is 0.5 ms


# --- time -------------------------------------------------------------------------------------------------------------


def test_a_start_time_other_than_zero_changes_nothing(plant_fmu: UnpackedFmu) -> None:
    rows = []
    for start in (0.0, 5.0, -1.25, 1e5):
        with Instance(plant_fmu) as instance:
            instance.initialise(start=start)
            rows.append(play(instance, 250, start=start))
    assert rows[0] == rows[1] == rows[2] == rows[3]


def test_steps_of_any_length_agree_within_the_tolerance(plant_fmu: UnpackedFmu) -> None:
    """The truth at 0.6 s by 1 ms, 10 ms, 1/60 s, uneven and one single step."""
    truth = [n for n in plant_fmu.names("output") if n.startswith(("truth.joint_position", "truth.tendon_force"))]
    ends = []
    uneven = [0.0, 0.013, 0.013 + 1e-9, 0.2, 0.21, 0.377, 0.6]
    for times in (np.arange(601) * 1e-3, np.arange(61) * 1e-2, np.arange(37) / 60, uneven, [0.0, 0.6]):
        with Instance(plant_fmu) as instance:
            instance.initialise()
            for now, then in pairwise(times):
                assert instance.step(now, then - now) == OK, instance.last_message
            ends.append(instance.get_real(truth))
    for end in ends[1:]:
        np.testing.assert_allclose(end, ends[0], rtol=1e-4, atol=1e-5)


def test_experiments_tolerance(plant_fmu: UnpackedFmu) -> None:
    def tolerance(instance: Instance) -> float:
        assert instance.call("EnterInitializationMode") == OK
        return float(instance.get_real(["relative_tolerance"])[0])

    with Instance(plant_fmu) as instance:
        assert instance.call("SetupExperiment", 1, 1e-4, 0.0, 0, 0.0) == OK
        assert tolerance(instance) == 1e-4
    for written_first in (True, False):  # a value that was written stands, whatever the order
        with Instance(plant_fmu) as instance:
            for write in (written_first, not written_first):
                status = (
                    instance.set_real({"relative_tolerance": 1e-8})
                    if write
                    else instance.call("SetupExperiment", 1, 1e-4, 0.0, 0, 0.0)
                )
                assert status == OK
            assert tolerance(instance) == 1e-8
    for bad in (0.0, -1.0, float("nan"), float("inf")):
        with Instance(plant_fmu) as instance:
            assert instance.call("SetupExperiment", 1, bad, 0.0, 0, 0.0) == ERROR
            assert "tolerance = " in instance.last_message and "a finite number above 0" in instance.last_message
    for given, used in ((0.1, 0.01), (1e-12, 1e-10)):  # 0.1 is Maestro's, for all FMUs of a system
        with Instance(plant_fmu) as instance:
            assert instance.call("SetupExperiment", 1, given, 0.0, 0, 0.0) == OK
            assert f"this FMU goes on with {used:g}" in instance.last_message
            assert tolerance(instance) == used


# --- its page ---------------------------------------------------------------------------------------------------------

PAGE = ROOT / "docs" / "reference" / "simulated_finger_fmu.md"


def test_the_page_names_every_variable_and_the_floor(plant_fmu: UnpackedFmu) -> None:
    page = PAGE.read_text(encoding="utf-8")
    groups = {name.partition("[")[0] for name in plant_fmu.variables}
    sizes = {"tendon": "[1..m]", "joint": "[1..n]"}
    for group in groups:
        count = sum(name.partition("[")[0] == group for name in plant_fmu.variables)
        shown = {1: "", 2: sizes["joint"], 3: "[1..3]", 4: sizes["tendon"]}[count]
        assert f"`{group}{shown}`" in page, group
    contents = read_contents(plant_binary(plant_fmu.folder).read_bytes())
    if contents.format == "ELF":
        named = re.search(r"\*\*GLIBC ([\d.]+)\*\*", page)
        assert named and contents.glibc_floor <= tuple(map(int, named[1].split(".")))


def test_the_snippets_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "rig.json").write_text(json.dumps(fmu_rig()))
    monkeypatch.chdir(tmp_path)
    page = PAGE.read_text(encoding="utf-8")
    shell, code = (re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL) for language in ("sh", "python"))
    command = [sys.executable, "-m", "tendonfmu.cli", *shell[0].split()[1:]]
    subprocess.run(command, check=True, capture_output=True)
    names: dict[str, Any] = {}
    exec(compile(code[0], PAGE.name, "exec"), names)
    result = names["result"]
    assert len(result) == 2001
    assert result["truth.external_torque[1]"][0] == pytest.approx(0.04, rel=0.05)  # 0.5 N at 0.08 m
    exec(compile(code[1], PAGE.name, "exec"), names)
    held, pulled = np.ptp(names["angles"][:250]), np.ptp(names["angles"][250:])
    assert held < 1e-4 and pulled > 0.005
