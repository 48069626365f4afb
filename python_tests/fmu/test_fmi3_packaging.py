"""`build --fmi 3`: what is in the FMU, and that validators find nothing."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest

pytest.importorskip("tendonfmu._native", reason="SKIPPED: tendonfmu is not installed")
pytest.importorskip("fmpy", reason="SKIPPED: fmpy is not installed")

import fmpy
import fmpy.validation

import tendonfmu as tf
from command import Call
from fmi3_binary import UnpackedFmu3
from fmu_binary import FINGER, UnpackedFmu
from repository_paths import ROOT
from tendonfmu.recordings import Recording, read_recording

EXAMPLES = ROOT / "examples"
LARGE = [EXAMPLES / "fingers/index_finger.json", EXAMPLES / "demo_recording/index_finger_calibrated.json"]


def model_of(fmu: Path) -> ElementTree.Element:
    with zipfile.ZipFile(fmu) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


def findings(fmu: Path) -> list[str]:
    """What FMI's schemas and fmpy's rules of names, units, start values and structure find."""
    description = fmpy.read_model_description(str(fmu), validate=True)
    assert description.fmiVersion == "3.0"
    assert len(description.buildConfigurations[0].sourceFileSets[0].sourceFiles) > 60
    found: list[str] = fmpy.validation.validate_fmu(str(fmu))
    return found


def test_validators_find_nothing(small_fmu3_path: Path) -> None:
    assert findings(small_fmu3_path) == []


@pytest.mark.long  # fmpy takes half a minute for the names of 800 variables
@pytest.mark.parametrize("finger", LARGE, ids=lambda path: path.stem)
def test_validators_find_nothing_in_large_fingers(finger: Path, tmp_path: Path) -> None:
    assert findings(tf.build(finger, tmp_path / "finger.fmu", fmi=3)) == []


def test_the_archive(small_fmu3: UnpackedFmu3, small_fmu: UnpackedFmu) -> None:
    """As of FMI 2.0 but for binary, sources and their descriptions; one table, so one identifier."""

    def files(folder: Path) -> set[str]:
        return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}

    def others(folder: Path) -> set[str]:
        return {name for name in files(folder) if not name.startswith(("binaries/", "sources/"))}

    assert others(small_fmu3.folder) == others(small_fmu.folder)
    assert small_fmu3.token == small_fmu.guid
    sources = {path.name for path in (small_fmu3.folder / "sources").iterdir()}
    build = ElementTree.parse(small_fmu3.folder / "sources" / "buildDescription.xml").getroot()
    configuration = build.find("BuildConfiguration")
    assert configuration is not None and configuration.attrib["modelIdentifier"] == "small_finger"
    listed = [file.attrib["name"] for file in build.iter("SourceFile")]
    assert len(listed) > 60 and set(listed) == {name for name in sources if name.endswith(".c")}
    assert not [name for name in sources if name.startswith(("fmi2", "fmi3Func", "fmi3Plat"))]
    page = (small_fmu3.folder / "documentation" / "index.html").read_text()
    assert "FMI3_FUNCTION_PREFIX" in page and "tendon_force" in page and "FMI 2" not in page


def test_arrays_say_that_elements_count_from_1(small_fmu3: UnpackedFmu3) -> None:
    root = ElementTree.parse(small_fmu3.folder / "modelDescription.xml").getroot()
    arrays = [each for each in root.find("ModelVariables") or () if each.find("Dimension") is not None]
    assert len(arrays) > 12
    for each in arrays:
        dimension = each.find("Dimension")
        assert dimension is not None
        text = each.attrib["description"]
        assert text.endswith(f". Element i of {dimension.attrib['start']}, counted from 1") and "{i}" not in text
        assert len(each.attrib.get("start", "0.0").split()) in (1, int(dimension.attrib["start"]))


def test_dependencies_are_those_of_fmi2(small_fmu3: UnpackedFmu3, small_fmu: UnpackedFmu) -> None:
    """An array depends on another where an element depends on an element."""
    two = ElementTree.parse(small_fmu.folder / "modelDescription.xml").getroot()
    names = [each.attrib["name"].partition("[")[0] for each in two.iter("ScalarVariable")]
    outputs = two.find("ModelStructure/Outputs")
    assert outputs is not None
    expected: dict[str, set[str]] = {}
    for each in outputs:
        known = expected.setdefault(names[int(each.attrib["index"]) - 1], set())
        known |= {names[int(index) - 1] for index in each.attrib["dependencies"].split()}
    three = ElementTree.parse(small_fmu3.folder / "modelDescription.xml").getroot()
    name_of = {variable.vr: name for name, variable in small_fmu3.variables.items()}
    found = {
        name_of[int(each.attrib["valueReference"])]: {name_of[int(vr)] for vr in each.attrib["dependencies"].split()}
        for each in three.iter("Output")
    }
    assert found == expected and len(found) > 8
    kinds = {
        name_of[int(each.attrib["valueReference"])]: set(each.attrib["dependenciesKind"].split())
        for each in three.iter("Output")
    }
    assert kinds["joint_torque"] == {"fixed"} and kinds["compensated_torque"] == {"dependent"}


def test_command_and_function(call: Call, tmp_path: Path) -> None:
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))
    answer = call("build", tmp_path / "finger.json", "-o", tmp_path / "command.fmu", "--fmi", "3", "--json")
    assert answer.status == 0, answer.err
    report = json.loads(answer.out)
    assert (report["fmi_version"], report["inputs"], report["name"]) == ("3.0", 10, "small_finger")
    two = tf.build(tmp_path / "finger.json", tmp_path / "two.fmu")
    three = tf.build(tf.read_finger(tmp_path / "finger.json"), tmp_path / "three.fmu", fmi=3)
    assert three.read_bytes() == (tmp_path / "command.fmu").read_bytes()
    assert (model_of(two).attrib["fmiVersion"], model_of(three).attrib["fmiVersion"]) == ("2.0", "3.0")


def test_reference_results_of_arrays(tmp_path: Path) -> None:
    """The check that is copied into a user's CI runs the FMU in fmpy, and finds no deviation."""
    finger = EXAMPLES / "demo_recording" / "two_joints.json"
    recording = read_recording(EXAMPLES / "demo_recording" / "two_joints_unseen.parquet")
    beginning = Recording(
        recording.path, recording.time[:500], {name: each[:500] for name, each in recording.groups.items()}
    )
    fmu = tf.build(finger, tmp_path / "finger.fmu", fmi=3, reference=beginning)
    command = [sys.executable, str(EXAMPLES / "ci_reference_check" / "check_reference.py"), str(fmu)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "0 of 21 variables differ" in done.stdout


@pytest.mark.parametrize("version", ["1", "4", "three"])
def test_other_versions_are_refused(call: Call, tmp_path: Path, version: str) -> None:
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))
    answer = call("build", tmp_path / "finger.json", "-o", tmp_path / "out.fmu", "--fmi", version)
    assert answer.status == 2 and "--fmi" in answer.err and not (tmp_path / "out.fmu").exists()


def test_a_rig_is_refused(call: Call, tmp_path: Path) -> None:
    rig = ROOT / "examples" / "rigs" / "index_finger.json"
    answer = call("build", rig, "-o", tmp_path / "out.fmu", "--fmi", "3")
    assert answer.status == 2 and not (tmp_path / "out.fmu").exists()
    assert "the simulated finger of a rig is an FMI 2.0 FMU; expected 2" in answer.err


def test_without_a_binary(tmp_path: Path) -> None:
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))
    (tmp_path / "binaries" / "linux64").mkdir(parents=True)
    (tmp_path / "binaries" / "linux64" / "tendonfmu.so").write_bytes(b"of FMI 2.0")
    with pytest.raises(tf.InputError, match=r"no binary; expected <FMI platform>/tendonfmu_fmi3\.so, \.dll or \.dylib"):
        tf.build(tmp_path / "finger.json", tmp_path / "out.fmu", binaries=tmp_path / "binaries", fmi=3)
