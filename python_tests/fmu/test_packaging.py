"""FMUs as they are packed: what is in them, the same bytes again, what importers show, and what checkers find."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import pint
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

import tendonfmu as tf
from command import Call
from fmu_binary import DISCARD, FINGER, OK, Instance, UnpackedFmu, fmi_platform
from fmu_kinds import MAKERS, Kind, declared_dependencies, kinds
from optional_parts import MAESTRO, needs, require
from plant_fmu_rig import DURATION, TOLERANCE, fmu_rig
from plant_rigs import needs_plant
from random_fingers import random_finger
from repetitions import repeated
from repository_paths import ROOT
from tendonfmu.errors import InputError
from tendonfmu.fmu.packaging import build_fmu, members, model_identifier
from tendonfmu.model import native, read_finger
from tendonfmu.model.output_dependencies import dependencies, structure_of

INDEX_FINGER = ROOT / "examples" / "fingers" / "index_finger.json"
INDEX_RIG = ROOT / "examples" / "rigs" / "index_finger.json"
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
PNG = b"\x89PNG\r\n\x1a\n"


def contents(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def described(fmu: UnpackedFmu) -> Any:
    """The model description."""
    return ElementTree.parse(fmu.folder / "modelDescription.xml").getroot()


# --- what is in -------------------------------------------------------------------------------------------------------

DRAWN = {f"terminalsAndIcons/{name}" for name in ("terminalsAndIcons.xml", "icon.png", "input.png", "output.png")}
OF_EACH = {
    "modelDescription.xml",
    "model.png",
    "documentation/index.html",
    "documentation/licenses/license.txt",
} | DRAWN


def test_everything_is_in(kind: Kind) -> None:
    """The page names every variable; each has a description and a unit; sources are beside the binary."""
    fmu, is_plant = kind.fmu, not kind.has_derivatives
    files = {path.relative_to(fmu.folder).as_posix() for path in fmu.folder.rglob("*") if path.is_file()}
    suffix = {"linux": "so", "win32": "dll", "darwin": "dylib"}[sys.platform]
    name = "TendonFinger_small" if is_plant else "small_finger"
    own = {"resources/rig.json", "documentation/licenses/third_party.txt"} if is_plant else set()
    own |= {f"binaries/{fmi_platform(fmu.version)}/{name}.{suffix}"}
    if not is_plant:
        own |= {"resources/model.image", "resources/finger.json"}
        assert (fmu.folder / "resources/finger.json").read_bytes() == json.dumps(FINGER).encode()
        assert (fmu.folder / "resources/model.image").read_bytes() == native.image_from_json(json.dumps(FINGER))
    assert OF_EACH | own <= files
    assert all(file.startswith(("sources/", "documentation/")) for file in files - OF_EACH - own)
    assert all((fmu.folder / file).read_bytes().startswith(PNG) for file in files if file.endswith(".png"))
    page = (fmu.folder / "documentation/index.html").read_text(encoding="utf-8")
    if not is_plant:
        assert all(f"<title>{part['name']}</title>" in page for part in FINGER["joints"] + FINGER["tendons"])
    assert all(f"<code>{name}</code>" in page for name in fmu.variables if name != "time")
    for variable in described(fmu).find("ModelVariables"):
        typed = variable[0] if fmu.version == 2 else variable
        assert variable.get("description"), variable.attrib
        assert "unit" in typed.attrib or typed.tag in ("Boolean", "Integer", "Int32") or variable.get("name") == "time"


def test_start_values_and_names_are_those_of_the_image(small: UnpackedFmu) -> None:
    parameters = native.Instance(native.image_from_json(json.dumps(FINGER))).parameters()
    found = {name: v for name, v in small.variables.items() if v.causality == "parameter"}
    assert list(found) == ["kinematics_source", *(parameter.path for parameter in parameters)]
    for parameter in parameters:
        variable = found[parameter.path]
        assert float(variable.start or "nan") == parameter.start
        assert variable.variability == ("tunable" if parameter.tunable else "fixed")


def test_fmi_3_0_has_the_variables_of_fmi_2_0(small_fmu: UnpackedFmu, small_fmu3: UnpackedFmu) -> None:
    """In the same order, arrays in the place of their elements; an array depends on another where an element does."""
    names = [name for name, v in small_fmu3.variables.items() if v.causality != "independent"]
    assert [element for name in names for element in small_fmu3.elements(name)] == list(small_fmu.variables)
    for name in names:
        variable, one = small_fmu3.variables[name], small_fmu.variables[small_fmu3.elements(name)[0]]
        assert (variable.vr, variable.causality, variable.variability) == (one.vr, one.causality, one.variability)
    assert [small_fmu3.variables[name].size for name in ("tendon_force", "joint_torque", "contact")] == [3, 2, None]
    assert small_fmu3.identifier == small_fmu.identifier

    expected: dict[str, set[str]] = {}
    for name, known in declared_dependencies(small_fmu.folder).items():
        expected.setdefault(name.partition("[")[0], set()).update(each.partition("[")[0] for each in known)
    assert declared_dependencies(small_fmu3.folder) == expected and len(expected) > 8


def test_dependencies_are_those_of_the_finger(tmp_path: Path) -> None:
    finger = read_finger(random_finger(4))
    expected = {}
    for output, elements in dependencies(structure_of(finger)).items():
        for k, inputs in enumerate(elements):
            name = output if output == "contact" else f"{output}[{k + 1}]"
            expected[name] = {f"{source}[{i + 1}]" for source, indices in inputs.items() for i in indices}
    assert declared_dependencies(tf.build(finger, tmp_path / "finger.fmu")) == expected


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


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.filterwarnings("error")
def test_names_of_any_text_survive(tmp_path: Path, fmi: int) -> None:
    joint = TINY["joints"][0] | {"name": "$\\frac{$ 関節 <i>"}
    fmu = build_fmu(TINY | {"name": "für <b>&\"';\ufffe", "joints": [joint]}, tmp_path / "odd.fmu", fmi=fmi)
    assert fmpy.read_model_description(str(fmu)).modelName == "für <b>&\"';?"
    assert b"<title>f\xc3\xbcr &lt;b&gt;" in contents(fmu)["documentation/index.html"]


@needs_plant
def test_the_default_experiment_is_the_rigs(plant_fmu: UnpackedFmu) -> None:
    experiment = fmpy.read_model_description(str(plant_fmu.folder)).defaultExperiment
    found = [experiment.startTime, experiment.stopTime, experiment.stepSize, experiment.tolerance]
    assert list(map(float, found)) == [0.0, DURATION, 0.001, TOLERANCE]


@pytest.mark.parametrize("name", kinds())
def test_folders_of_binaries_are_those_that_importers_look_for(name: str, request: pytest.FixtureRequest) -> None:
    """FMI 2.0 keeps linux64, win64, darwin64: some of its importers do not find the platform tuples of FMI 3.0."""
    fmu = request.getfixturevalue(MAKERS[name][0])
    pattern = r"(linux|win|darwin)64" if fmu.version == 2 else r"(x86_64|aarch64)-(linux|windows|darwin)"
    folders = [path.name for path in (fmu.folder / "binaries").iterdir()]
    assert folders and all(re.fullmatch(pattern, folder) for folder in folders)


def test_binaries_of_a_folder_take_the_place_of_the_installed_ones(tmp_path: Path) -> None:
    for platform, suffix in (("win64", "dll"), ("darwin64", "dylib")):
        (tmp_path / "cross" / platform).mkdir(parents=True)
        (tmp_path / "cross" / platform / f"tendonfmu.{suffix}").write_bytes(platform.encode())
    files = contents(build_fmu(FINGER, tmp_path / "out.fmu", binaries=tmp_path / "cross"))
    assert {name: data for name, data in files.items() if name.startswith("binaries/")} == {
        "binaries/win64/small_finger.dll": b"win64",
        "binaries/darwin64/small_finger.dylib": b"darwin64",
    }


# --- building ---------------------------------------------------------------------------------------------------------

# No program is started, and what reads recordings, runs FMUs and draws figures, a second to import, is not imported.
ALONE = """
import sys, time
events = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.fork")
sys.addaudithook(lambda event, of: sys.exit(event) if event in events else None)
from tendonfmu.commands.program import main
try:
    main()
except SystemExit as ended:
    assert not ended.code, ended.code
assert not {"fmpy", "pandas", "pyarrow", "plotly", "scipy", "tendonfmu.recordings"} & set(sys.modules)
assert time.process_time() < 3.0
"""


@pytest.mark.parametrize(
    ("source", "fmi"),
    [(INDEX_FINGER, "2"), (INDEX_FINGER, "3"), pytest.param(INDEX_RIG, "2", marks=[needs_plant, pytest.mark.long])],
)
def test_the_command_alone_builds_the_same_bytes_fast(tmp_path: Path, source: Path, fmi: str) -> None:
    """Under 0.4 s of an idle processor. In another process, with another hash seed, without a compiler on PATH."""
    first = tf.build(source, tmp_path / "first.fmu", fmi=int(fmi))
    other = tmp_path / "other.fmu"
    environment = {"PYTHONHASHSEED": "7", "PATH": "", "HOME": str(tmp_path)}
    arguments = [sys.executable, "-c", ALONE, "build", str(source), "-o", str(other), "--fmi", fmi]
    done = subprocess.run(arguments, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert other.read_bytes() == first.read_bytes()
    with zipfile.ZipFile(first) as archive:
        infos = archive.infolist()
    assert [info.filename for info in infos] == sorted(info.filename for info in infos)
    assert {info.date_time for info in infos} == {(1980, 1, 1, 0, 0, 0)}


def test_the_command_reports_what_it_built(call: Call, tmp_path: Path) -> None:
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))
    answer = call("build", tmp_path / "finger.json", "-o", tmp_path / "command.fmu", "--fmi", "3", "--json")
    assert answer.status == 0, answer.err
    report = json.loads(answer.out)
    assert (report["fmi_version"], report["inputs"], report["name"]) == ("3.0", 10, "small_finger")
    assert fmpy.read_model_description(str(tmp_path / "command.fmu"), validate=False).fmiVersion == "3.0"


@needs_plant
def test_the_command_builds_the_fmu_of_a_rig(call: Call, tmp_path: Path) -> None:
    (tmp_path / "rig.json").write_text(json.dumps(fmu_rig()))
    assert call("build", "rig.json", "-o", "rig.fmu").status == 0
    description = fmpy.read_model_description(str(tmp_path / "rig.fmu"))
    assert description.coSimulation.modelIdentifier == "TendonFinger_small"


def test_other_versions_are_refused(call: Call, tmp_path: Path) -> None:
    answer = call("build", INDEX_FINGER, "-o", tmp_path / "out.fmu", "--fmi", "4")
    assert answer.status == 2 and "--fmi" in answer.err
    answer = call("build", INDEX_RIG, "-o", tmp_path / "out.fmu", "--fmi", "3")
    assert answer.status == 2 and "the simulated finger of a rig is an FMI 2.0 FMU; expected 2" in answer.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("problem", ["finger", "folder", "binaries", "directory", "seed", "tip"])
def test_a_failure_is_one_line_and_leaves_nothing(problem: str, tmp_path: Path) -> None:
    rigs = {"seed": fmu_rig(seed=2**31), "tip": fmu_rig(physics=fmu_rig()["physics"] | {"tip": [0.0]})}
    source: dict[str, Any] = rigs.get(problem, FINGER | ({"tendons": []} if problem == "finger" else {}))
    (tmp_path / "source.json").write_text(json.dumps(source))
    output = tmp_path / {"folder": "missing/out.fmu", "directory": "taken"}.get(problem, "out.fmu")
    if problem == "directory":
        output.mkdir()
    before = sorted(tmp_path.rglob("*"))
    build: Callable[..., Any] = tf.build if problem in rigs else build_fmu
    options = {"binaries": tmp_path / "none"} if problem == "binaries" else {}
    with pytest.raises(InputError) as refused:
        build(tmp_path / "source.json", output, **options)
    named = {"finger": "source.json: tendons", "binaries": "none", "seed": "seed = 2147483648", "tip": "physics.tip"}
    assert named.get(problem, output.name) in str(refused.value) and "\n" not in str(refused.value)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_failure_keeps_the_file_that_was_there(tmp_path: Path) -> None:
    (tmp_path / "out.fmu").write_text("before")
    with pytest.raises(InputError):
        build_fmu(FINGER | {"tendons": []}, tmp_path / "out.fmu")
    assert (tmp_path / "out.fmu").read_text() == "before"


# --- terminals, units, nominal values, ranges: what importers show and scale by ---------------------------------------

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"


def names_of(terminals: Any, terminal: str) -> list[str]:
    found = terminals.findall(f"Terminals/Terminal[@name='{terminal}']/TerminalMemberVariable")
    assert all(member.attrib["memberName"] == member.attrib["variableName"] for member in found)
    return [member.attrib["variableName"] for member in found]


def test_each_signal_is_in_one_terminal(kind: Kind) -> None:
    fmu = kind.fmu
    data = (fmu.folder / TERMINALS).read_bytes()
    etree.XMLSchema(etree.parse(str(SCHEMA))).assertValid(etree.fromstring(data))
    terminals = ElementTree.fromstring(data)
    causality = {name: v.causality for name, v in fmu.variables.items()}
    listed = [member.attrib["variableName"] for member in terminals.iter("TerminalMemberVariable")]
    assert sorted(listed) == sorted(name for name, of in causality.items() if of in ("input", "output"))
    for terminal in terminals.iter("Terminal"):
        (side,) = {causality[name] for name in names_of(terminals, terminal.attrib["name"])}
        drawn = terminal.find("TerminalGraphicalRepresentation")
        assert drawn is not None and drawn.attrib["iconBaseName"] == side
        assert (float(drawn.attrib["x1"]) < 0) == (side == "input")


@needs_plant
def test_the_sensors_of_both_fmus_match(plant_fmu: UnpackedFmu) -> None:
    """Rule `bus`: each input of the friction FMU of the same finger has an output of that name."""
    from tendonfmu.simulate.rig import read_rig

    plant = names_of(ElementTree.parse(plant_fmu.folder / TERMINALS).getroot(), "sensors")
    rig = read_rig(plant_fmu.folder.parent / "rig.json")
    friction = members(rig.finger)
    wanted = names_of(ElementTree.fromstring(friction[TERMINALS]), "sensors")
    assert len(wanted) > 8 and set(wanted) <= set(plant)


def test_units_and_nominal_values(kind: Kind) -> None:
    """By pint: one unit is `factor` display units. Signals, not parameters, have a nominal value."""
    root, registry, found = described(kind.fmu), pint.UnitRegistry(), {}
    for unit in root.iter("Unit"):
        for display in unit.iter("DisplayUnit"):
            one = registry.Quantity(1.0, unit.attrib["name"].replace(".", "*"))
            shown = one.to(display.attrib["name"].replace(".", "*")).magnitude
            assert float(display.attrib["factor"]) == pytest.approx(shown, rel=1e-15)
            found[unit.attrib["name"]] = display.attrib["name"]
    assert {"rad": "deg", "m": "mm", "N.m": "mN.m"}.items() <= found.items()
    for variable in root.find("ModelVariables"):
        typed = variable[0] if kind.fmu.version == 2 else variable
        unit, causality, nominal = typed.get("unit"), variable.get("causality"), typed.get("nominal")
        assert typed.get("displayUnit") == found.get(unit)
        if causality != "independent":
            assert (nominal is not None) == (causality != "parameter" and unit not in (None, "1")), variable.attrib
            assert nominal is None or float(nominal) > 0


def test_inputs_have_the_range_of_a_finger_and_take_more(small_fmu: UnpackedFmu) -> None:
    """The range is for importers; the binary refuses only what no computation stands (contract: any sane recording)."""
    for variable in described(small_fmu).iter("ScalarVariable"):
        if variable.attrib["causality"] == "input":
            low, high = (float(variable[0].attrib[key]) for key in ("min", "max"))
            assert -1e5 < low == -high < 0 and low <= float(variable[0].attrib["start"]) <= high
            if not variable.attrib["name"].startswith("joint"):  # not used by default
                with Instance(small_fmu) as instance:
                    for value, status in ((100 * high, OK), (1.1e12, DISCARD)):
                        instance.initialise()
                        assert instance.write({variable.attrib["name"]: value}) == OK
                        assert instance.step(0.0) == status and instance.call("Reset") == OK


# --- checkers ---------------------------------------------------------------------------------------------------------


def name_of(source: Any) -> str:
    return source["name"] if isinstance(source, dict) else Path(source).stem


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("source", repeated([TINY, FINGER, INDEX_FINGER, CALIBRATED], 0), ids=name_of)
def test_fmpy_finds_nothing(source: Any, fmi: int, tmp_path: Path) -> None:
    """FMI's schemas, and fmpy's rules of names, units, start values and structure: half a minute for 800 variables."""
    fmu = tf.build(source, tmp_path / "finger.fmu", fmi=fmi)
    assert fmpy.read_model_description(str(fmu), validate=True).fmiVersion == f"{fmi}.0"
    assert validate_fmu(str(fmu)) == []


@needs_plant
@pytest.mark.parametrize("rig", repeated(["small", "index_finger"], 0))
def test_fmpy_finds_nothing_in_the_simulated_finger(rig: str, plant_fmu_path: Path, tmp_path: Path) -> None:
    fmu = plant_fmu_path if rig == "small" else tf.build(INDEX_RIG, tmp_path / "index.fmu")
    assert validate_fmu(str(fmu)) == []


@pytest.mark.long
def test_fmutool_finds_nothing(small_fmu3_path: Path) -> None:
    """The check of the FMU Manipulation Toolbox."""
    command = [require("fmutool"), "-input", str(small_fmu3_path), "-check"]
    report = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "This FMU seems to be compliant with FMI-3.0." in report
    assert "No semantic error against the FMI-3 standard." in report
    assert "ERROR" not in report and "WARNING" not in report


@pytest.mark.long
@needs("java", "maestro")
@pytest.mark.parametrize("name", kinds(only="friction plant"))
def test_vdmcheck_finds_nothing(name: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """VDMCheck2: a formal model of FMI 2.0's text, by INTO-CPS, in Maestro's program, which `tools/nightly` fetches."""
    with zipfile.ZipFile(MAESTRO) as archive:
        for member in archive.namelist():
            if (member.endswith(".vdmsl") and "/" not in member) or member.startswith(("vdmcheck/schema/", "schema/")):
                archive.extract(member, tmp_path)
    schema = tmp_path / "vdmcheck" / "schema"
    (schema / "xsd2vdm.properties").write_bytes((tmp_path / "schema" / "xsd2vdm.properties").read_bytes())
    fmu = request.getfixturevalue(MAKERS[name][0])
    java = ["java", "-Xmx1g", "-XX:ActiveProcessorCount=1", "-cp", str(MAESTRO)]
    convert = ["xsd2vdm.Xsd2VDM", "-xsd", str(schema / "fmi2ModelDescription.xsd"), "-nowarn", "-name", "described"]
    convert += ["-xml", str(fmu.folder / "modelDescription.xml"), "-vdm", "value.vdmsl"]
    subprocess.run([*java, *convert], cwd=tmp_path, check=True, capture_output=True)
    model = sorted(path.name for path in tmp_path.glob("*.vdmsl"))
    check = ["com.fujitsu.vdmj.VDMJ", "-vdmsl", "-q", "-e", "isValidFMIModelDescription(described)", *model]
    done = subprocess.run([*java, *check], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "true"
