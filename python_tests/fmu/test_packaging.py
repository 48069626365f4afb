"""FMUs as they are packed: what is in them, the same bytes again, clean before fmpy, the same results when compiled."""

from __future__ import annotations

import io
import json
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import pytest
from fmpy.validation import validate_fmu

from command import Call
from fmi3_binary import UnpackedFmu3
from fmu_binary import FINGER, Instance, UnpackedFmu, fmi_platform, unpack
from plant_rigs import needs_plant
from random_fingers import random_finger
from repetitions import repeated
from repository_paths import ROOT
from tendonfmu import build, read_finger
from tendonfmu.errors import InputError
from tendonfmu.fmu.packaging import build_fmu, model_identifier
from tendonfmu.model import native
from tendonfmu.model.output_dependencies import dependencies, structure_of

INDEX_FINGER = ROOT / "examples" / "fingers" / "index_finger.json"
CALIBRATED = ROOT / "examples" / "demo_recording" / "index_finger_calibrated.json"
LAW = {"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005}
# Fewest parameters with something of each kind: fmpy's validation takes its time per variable.
TINY: dict[str, Any] = {
    "format": "tendonfmu-finger-1",
    "name": 'tiny <finger> & "son"',
    "joints": [{"name": "mcp", "cover": {"stiffness": 0.02}, "friction": LAW}],
    "tendons": [{"stiffness": 4e3, "moment_arms": [0.009], "edge_friction": [{"angles": [0.0], "laws": [LAW]}]}],
    "contact": {"threshold": [0.03]},
    "bias": {"initial_torque": [0.01], "initial_variance": 1e-4, "noise_time": 0.002},
    "extensions": [{"effect": "cover_hardening", "joint": 1, "stiffness": 0.1}],
}

BUILD = "import sys, pathlib, tendonfmu.fmu.packaging as p; p.build_fmu(*map(pathlib.Path, sys.argv[1:]))"

Pack = Callable[[dict[str, Any]], Path]


@pytest.fixture
def packed(tmp_path: Path) -> Pack:
    def pack(description: dict[str, Any]) -> Path:
        (tmp_path / "finger.json").write_text(json.dumps(description))
        return build_fmu(tmp_path / "finger.json", tmp_path / "finger.fmu")

    return pack


def members(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


# --- contents ---------------------------------------------------------------------------------------------------------


def test_everything_is_in(packed: Pack) -> None:
    files = members(packed(FINGER))
    assert files["resources/finger.json"] == json.dumps(FINGER).encode()
    assert files["resources/model.image"] == native.image_from_json(json.dumps(FINGER))
    suffix = {"linux": "so", "win32": "dll", "darwin": "dylib"}[sys.platform]
    assert f"binaries/{fmi_platform()}/small_finger.{suffix}" in files
    assert files["model.png"][:8] == b"\x89PNG\r\n\x1a\n"
    assert files["documentation/licenses/license.txt"] == (ROOT / "LICENSE").read_bytes()
    page = files["documentation/index.html"].decode()
    assert 'src="../model.png"' in page
    finger = native.Instance(files["resources/model.image"])
    for parameter in finger.parameters():
        assert f'<code>{parameter.path}</code></td><td class="number">{parameter.start}</td>' in page


def test_start_values_and_names_are_those_of_the_image(packed: Pack) -> None:
    fmu = packed(FINGER)
    finger = native.Instance(native.image_from_json(json.dumps(FINGER)))
    root = ElementTree.fromstring(members(fmu)["modelDescription.xml"])
    found = {
        scalar.attrib["name"]: scalar
        for scalar in root.iter("ScalarVariable")
        if scalar.attrib["causality"] == "parameter"
    }
    parameters = finger.parameters()
    assert list(found) == ["kinematics_source", *(parameter.path for parameter in parameters)]
    for parameter in parameters:
        scalar = found[parameter.path]
        assert float(scalar[0].attrib["start"]) == parameter.start
        assert scalar.attrib["variability"] == ("tunable" if parameter.tunable else "fixed")
        assert scalar[0].attrib["unit"] == parameter.unit
    for scalar in root.iter("ScalarVariable"):
        assert scalar.attrib["description"]
        assert "unit" in scalar[0].attrib or scalar[0].tag in ("Boolean", "Integer")


def test_model_structure_is_that_of_the_finger(packed: Pack, tmp_path: Path) -> None:
    description = random_finger(4)
    root = ElementTree.fromstring(members(packed(description))["modelDescription.xml"])
    names = [scalar.attrib["name"] for scalar in root.iter("ScalarVariable")]
    outputs = root.find("ModelStructure/Outputs")
    assert outputs is not None
    found = {
        names[int(unknown.attrib["index"]) - 1]: {names[int(k) - 1] for k in unknown.attrib["dependencies"].split()}
        for unknown in outputs
    }
    wanted = {}
    for output, elements in dependencies(structure_of(read_finger(tmp_path / "finger.json"))).items():
        for k, inputs in enumerate(elements):
            name = output if output == "contact" else f"{output}[{k + 1}]"
            wanted[name] = {f"{source}[{i + 1}]" for source, indices in inputs.items() for i in indices}
    assert found == wanted


@pytest.mark.parametrize(
    ("name", "identifier"),
    [
        ("index_finger", "index_finger"),
        ("Zeigefinger (rechts)", "Zeigefinger_rechts"),
        ("Müller's 3. Finger", "Muller_s_3_Finger"),
        ("3 fingers", "finger_3_fingers"),
        ("人差し指", "finger"),
        ("../../etc/passwd", "etc_passwd"),
        ("double", "finger_double"),
        ("CON", "finger_CON"),
    ],
)
def test_model_identifier(name: str, identifier: str) -> None:
    assert model_identifier(name) == identifier
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", identifier)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.filterwarnings("error")
def test_names_of_any_text_survive(tmp_path: Path, fmi: int) -> None:
    joint = TINY["joints"][0] | {"name": "$\\frac{$ 関節 <i>"}
    fmu = build_fmu(TINY | {"name": "für <b>&\"';\ufffe", "joints": [joint]}, tmp_path / "odd.fmu", fmi=fmi)
    description = fmpy.read_model_description(str(fmu))
    assert description.modelName == "für <b>&\"';?"
    assert b"<title>f\xc3\xbcr &lt;b&gt;" in members(fmu)["documentation/index.html"]


def test_fmi_3_0_has_the_same_files(small_fmu3: UnpackedFmu3, small_fmu: UnpackedFmu) -> None:
    """As of FMI 2.0 but for binary, sources and their descriptions; one table, so one identifier."""
    of_both = []
    for fmu in (small_fmu3, small_fmu):
        names = [path.relative_to(fmu.folder).as_posix() for path in fmu.folder.rglob("*") if path.is_file()]
        of_both.append({name for name in names if not name.startswith(("binaries/", "sources/"))})
    assert of_both[0] == of_both[1] and small_fmu3.token == small_fmu.guid
    sources = {path.name for path in (small_fmu3.folder / "sources").iterdir()}
    build_description = ElementTree.parse(small_fmu3.folder / "sources" / "buildDescription.xml").getroot()
    configuration = build_description.find("BuildConfiguration")
    assert configuration is not None and configuration.attrib["modelIdentifier"] == "small_finger"
    listed = [file.attrib["name"] for file in build_description.iter("SourceFile")]
    assert len(listed) > 60 and set(listed) == {name for name in sources if name.endswith(".c")}
    assert not [name for name in sources if name.startswith(("fmi2", "fmi3Func", "fmi3Plat"))]
    page = (small_fmu3.folder / "documentation" / "index.html").read_text()
    assert "FMI3_FUNCTION_PREFIX" in page and "tendon_force" in page and "FMI 2" not in page


def test_arrays_say_that_elements_count_from_1(small_fmu3: UnpackedFmu3) -> None:
    root = ElementTree.parse(small_fmu3.folder / "modelDescription.xml").getroot()
    arrays = [variable for variable in root.find("ModelVariables") or () if variable.find("Dimension") is not None]
    assert len(arrays) > 12
    for array in arrays:
        dimension = array.find("Dimension")
        assert dimension is not None
        text = array.attrib["description"]
        assert text.endswith(f". Element i of {dimension.attrib['start']}, counted from 1") and "{i}" not in text
        assert len(array.attrib.get("start", "0.0").split()) in (1, int(dimension.attrib["start"]))


def test_dependencies_of_arrays_are_those_of_fmi2(small_fmu3: UnpackedFmu3, small_fmu: UnpackedFmu) -> None:
    """An array depends on another where an element depends on an element."""
    two = ElementTree.parse(small_fmu.folder / "modelDescription.xml").getroot()
    names = [scalar.attrib["name"].partition("[")[0] for scalar in two.iter("ScalarVariable")]
    outputs = two.find("ModelStructure/Outputs")
    assert outputs is not None
    expected: dict[str, set[str]] = {}
    for unknown in outputs:
        known = expected.setdefault(names[int(unknown.attrib["index"]) - 1], set())
        known |= {names[int(index) - 1] for index in unknown.attrib["dependencies"].split()}
    three = ElementTree.parse(small_fmu3.folder / "modelDescription.xml").getroot()
    name_of = {str(variable.vr): name for name, variable in small_fmu3.variables.items()}
    found, kinds = {}, {}
    for output in three.iter("Output"):
        name = name_of[output.attrib["valueReference"]]
        found[name] = {name_of[reference] for reference in output.attrib["dependencies"].split()}
        kinds[name] = set(output.attrib["dependenciesKind"].split())
    assert found == expected and len(found) > 8
    assert kinds["joint_torque"] == {"fixed"} and kinds["compensated_torque"] == {"dependent"}


# --- the archive ------------------------------------------------------------------------------------------------------


def test_same_input_same_bytes(tmp_path: Path) -> None:
    """Also in another process, with another hash seed and name of the output."""
    first = build_fmu(INDEX_FINGER, tmp_path / "first.fmu").read_bytes()
    other = tmp_path / "other.fmu"
    subprocess.run(
        [sys.executable, "-c", BUILD, str(INDEX_FINGER), str(other)], check=True, env={"PYTHONHASHSEED": "7"}
    )
    assert other.read_bytes() == first
    with zipfile.ZipFile(io.BytesIO(first)) as archive:
        infos = archive.infolist()
    assert [info.filename for info in infos] == sorted(info.filename for info in infos)
    assert {info.date_time for info in infos} == {(1980, 1, 1, 0, 0, 0)}


def test_the_index_finger_is_packed_fast(tmp_path: Path) -> None:
    """Under 0.4 s on an idle machine; processor time is counted since tests share theirs, with room for slow ones."""
    look = (
        "; import time; print(time.process_time());"
        "assert not {'fmpy', 'pandas', 'pyarrow', 'matplotlib', 'scipy', 'typer'} & set(sys.modules)"
    )
    arguments = [sys.executable, "-c", BUILD + look, str(INDEX_FINGER), str(tmp_path / "index.fmu")]
    done = subprocess.run(arguments, check=True, capture_output=True, text=True)
    assert float(done.stdout) < 2.0


def test_the_command_imports_no_more_than_the_function(tmp_path: Path) -> None:
    """What reads recordings, runs FMUs and draws figures takes a second to import."""
    code = (
        "import sys; from tendonfmu.cli import main\n"
        "try: main()\n"
        "except SystemExit as ended: assert not ended.code\n"
        "print({'fmpy', 'pandas', 'pyarrow', 'matplotlib', 'scipy', 'tendonfmu.recordings'} & set(sys.modules))"
    )
    arguments = [sys.executable, "-c", code, "build", str(INDEX_FINGER), "-o", str(tmp_path / "index.fmu")]
    done = subprocess.run(arguments, check=True, capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "set()"


def test_no_compiler_is_needed(tmp_path: Path) -> None:
    """No program is started, and PATH leads nowhere."""
    forbid = (
        "import sys; events = ('subprocess.Popen', 'os.system', 'os.exec', 'os.posix_spawn', 'os.fork');"
        "sys.addaudithook(lambda event, of: sys.exit(event) if event in events else None);"
    )
    arguments = [sys.executable, "-c", forbid + BUILD, str(INDEX_FINGER), str(tmp_path / "index.fmu")]
    done = subprocess.run(arguments, env={"PATH": "", "HOME": str(tmp_path)}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_binaries_of_a_folder_take_the_place_of_the_installed_ones(tmp_path: Path) -> None:
    for platform, suffix in (("win64", "dll"), ("darwin64", "dylib")):
        (tmp_path / "cross" / platform).mkdir(parents=True)
        (tmp_path / "cross" / platform / f"tendonfmu.{suffix}").write_bytes(platform.encode())
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))
    files = members(build_fmu(tmp_path / "finger.json", tmp_path / "out.fmu", binaries=tmp_path / "cross"))
    assert {name: data for name, data in files.items() if name.startswith("binaries/")} == {
        "binaries/win64/small_finger.dll": b"win64",
        "binaries/darwin64/small_finger.dylib": b"darwin64",
    }


@needs_plant
def test_folders_of_binaries_are_those_that_importers_look_for(
    small_fmu_path: Path, small_fmu3_path: Path, plant_fmu_path: Path
) -> None:
    """FMI 2.0 keeps linux64, win64, darwin64: some of its importers do not find the platform tuples of FMI 3.0."""
    for fmu, pattern in (
        (small_fmu_path, r"(linux|win|darwin)64"),
        (plant_fmu_path, r"(linux|win|darwin)64"),
        (small_fmu3_path, r"(x86_64|aarch64)-(linux|windows|darwin)"),
    ):
        folders = {name.split("/")[1] for name in members(fmu) if name.startswith("binaries/")}
        assert folders and all(re.fullmatch(pattern, folder) for folder in folders), (fmu.name, folders)


def test_command_and_function_build_fmi_3_0(call: Call, tmp_path: Path) -> None:
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))
    answer = call("build", tmp_path / "finger.json", "-o", tmp_path / "command.fmu", "--fmi", "3", "--json")
    assert answer.status == 0, answer.err
    report = json.loads(answer.out)
    assert (report["fmi_version"], report["inputs"], report["name"]) == ("3.0", 10, "small_finger")
    three = build(read_finger(tmp_path / "finger.json"), tmp_path / "three.fmu", fmi=3)
    assert three.read_bytes() == (tmp_path / "command.fmu").read_bytes()
    assert fmpy.read_model_description(str(three), validate=False).fmiVersion == "3.0"


def test_other_versions_are_refused(call: Call, tmp_path: Path) -> None:
    for version in ("1", "4", "three"):
        answer = call("build", INDEX_FINGER, "-o", tmp_path / "out.fmu", "--fmi", version)
        assert answer.status == 2 and "--fmi" in answer.err
    answer = call("build", ROOT / "examples/rigs/index_finger.json", "-o", tmp_path / "out.fmu", "--fmi", "3")
    assert answer.status == 2 and "the simulated finger of a rig is an FMI 2.0 FMU; expected 2" in answer.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("problem", ["finger", "folder", "binaries", "directory"])
def test_a_failure_is_one_line_and_leaves_nothing(problem: str, tmp_path: Path) -> None:
    (tmp_path / "finger.json").write_text(json.dumps(FINGER | ({"tendons": []} if problem == "finger" else {})))
    output = tmp_path / {"folder": "missing/out.fmu", "directory": "taken"}.get(problem, "out.fmu")
    if problem == "directory":
        output.mkdir()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError) as refused:
        build_fmu(tmp_path / "finger.json", output, binaries=tmp_path / "none" if problem == "binaries" else None)
    named = {"finger": "finger.json: tendons", "binaries": "none"}.get(problem, output.name)
    assert named in str(refused.value) and "\n" not in str(refused.value)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_failure_keeps_the_file_that_was_there(tmp_path: Path) -> None:
    (tmp_path / "finger.json").write_text("{}")
    (tmp_path / "out.fmu").write_text("before")
    with pytest.raises(InputError):
        build_fmu(tmp_path / "finger.json", tmp_path / "out.fmu")
    assert (tmp_path / "out.fmu").read_text() == "before"


# --- before fmpy ------------------------------------------------------------------------------------------------------


def findings(fmu: Path, version: int) -> list[str]:
    """What FMI's schemas and fmpy's rules of names, units, start values and structure find."""
    description = fmpy.read_model_description(str(fmu), validate=True)
    assert description.fmiVersion == f"{version}.0"
    if version == 3:
        assert len(description.buildConfigurations[0].sourceFileSets[0].sourceFiles) > 60
    found: list[str] = validate_fmu(str(fmu))
    return found


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("description", repeated([TINY, FINGER], 0), ids=["tiny", "small"])
def test_fmpy_finds_nothing(description: dict[str, Any], fmi: int, tmp_path: Path) -> None:
    assert findings(build(description, tmp_path / "finger.fmu", fmi=fmi), fmi) == []


@pytest.mark.long  # fmpy takes half a minute for the names of 800 variables
@pytest.mark.parametrize(("finger", "fmi"), [(INDEX_FINGER, 2), (INDEX_FINGER, 3), (CALIBRATED, 3)])
def test_fmpy_finds_nothing_in_large_fingers(finger: Path, fmi: int, tmp_path: Path) -> None:
    assert findings(build(finger, tmp_path / "finger.fmu", fmi=fmi), fmi) == []


def test_another_guid_is_refused(packed: Pack, tmp_path: Path) -> None:
    """Of another image, or of a binary compiled with another table of variables."""
    fmu = unpack(packed(FINGER), tmp_path / "unpacked")
    other = native.image_guid(native.image_from_json(json.dumps(TINY)), 1)
    refused = Instance(fmu, guid=other.encode())
    assert refused.component is None and "guid" in refused.last_message.lower()
    shutil.copy(fmu.folder / "resources" / "model.image", tmp_path / "kept")
    (fmu.folder / "resources" / "model.image").write_bytes(native.image_from_json(json.dumps(TINY)))
    assert Instance(fmu).component is None
    shutil.copy(tmp_path / "kept", fmu.folder / "resources" / "model.image")
    assert Instance(fmu).component is not None
