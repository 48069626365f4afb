"""Reference results inside an FMU: what build writes, and examples/ci_reference_check on it and on FMUs of others."""

from __future__ import annotations

import io
import re
import subprocess
import sys
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from lxml import etree

import tendonfmu as tf
from command import Answer, run_script
from optional_parts import require
from repository_paths import ROOT, TESTS

EXAMPLE = ROOT / "examples" / "ci_reference_check"
DESCRIPTION = TESTS / "reference" / "cable_loop.json"
INPUTS = TESTS / "reference" / "cable_loop_in.csv"
FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
MANIFEST, EXPERIMENT = f"{FOLDER}/fmi-ls-manifest.xml", f"{FOLDER}/cable_loop.exp"
RESULT, STIMULI, OPTIONS = (f"{FOLDER}/cable_loop_{end}" for end in ("ref.csv", "in.csv", "ref.opt"))
LS = "{http://fmi-standard.org/fmi-ls-manifest}"

# The manifest of the Reference FMUs: a result alone, without the description of the standard.
RESULT_ALONE = """<?xml version="1.0" encoding="UTF-8"?>
<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest"
    fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref" fmi-ls:fmi-ls-version="1.0.0-alpha.1">
    <Related type="text/csv" source="SOURCE" role="result" description="Output of the default experiment"/>
</fmiReferences>
"""
LARGEST = np.abs(np.genfromtxt(INPUTS.with_name("cable_loop_ref.csv"), delimiter=",", skip_header=1, usecols=1)).max()
Edit = Callable[[dict[str, bytes]], None]


@pytest.fixture(autouse=True)
def beside_the_script(monkeypatch: pytest.MonkeyPatch) -> None:
    """The script imports a file of its folder, as it does when Python runs it."""
    monkeypatch.syspath_prepend(EXAMPLE)


def check(fmu: Path, *more: Path | str) -> Answer:
    return run_script(EXAMPLE / "check_reference.py", fmu, *more)


def members(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def tolerance_in(done: Answer) -> float:
    """Of the first row, that of compensated_torque[1], which LARGEST is of."""
    return float(done.out.splitlines()[1].split()[2])


def table(text: bytes) -> Any:
    return np.genfromtxt(io.BytesIO(text.replace(b'"', b"")), delimiter=",", names=True, deletechars="")


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tf.build(DESCRIPTION, tmp_path_factory.mktemp("fmu") / "cable_loop.fmu", reference=INPUTS)


@pytest.fixture
def edited(fmu: Path, tmp_path: Path) -> Callable[[Edit], Path]:
    """Makes a copy of the FMU with other files in it."""

    def make(edit: Edit) -> Path:
        files = members(fmu)
        edit(files)
        with zipfile.ZipFile(tmp_path / "edited.fmu", "w") as archive:
            for name, content in files.items():
                archive.writestr(name, content)
        return tmp_path / "edited.fmu"

    return make


# --- what build writes ------------------------------------------------------------------------------------------------


def test_the_manifest_lists_every_file_as_its_schema_asks(fmu: Path) -> None:
    files = members(fmu)
    root = ElementTree.fromstring(files[MANIFEST])
    assert root.tag == "fmiReferences"
    assert root.attrib[f"{LS}fmi-ls-name"] == "org.fmi-standard.fmi-ls-ref"
    related = {f"{FOLDER}/{each.attrib['source']}": each.attrib for each in root}
    assert set(related) | {MANIFEST} == {name for name in files if name.startswith("extra/")}
    assert root.attrib[f"{LS}fmi-ls-version"] == "1.0.0-beta.1"
    assert all(set(attributes) == {"type", "source", "role", "description"} for attributes in related.values())
    roles = {name.rpartition("cable_loop")[2]: attributes["role"] for name, attributes in related.items()}
    assert roles["_ref.csv"] == "result" and roles[".exp"] == "experiment/smoke-test"


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_default_experiment_is_the_span_of_the_check(tmp_path: Path, fmi: int) -> None:
    """So a client that simulates by defaults runs what the reference results are of; else 10 s in steps of 1 ms."""
    time = table(INPUTS.read_bytes())["time"]
    plain = tf.build(DESCRIPTION, tmp_path / "plain.fmu", fmi=fmi)
    carrying = tf.build(DESCRIPTION, tmp_path / "carrying.fmu", reference=INPUTS, fmi=fmi)
    of_run = ElementTree.fromstring(members(carrying)[EXPERIMENT])[0].attrib
    for fmu, expected in ((plain, (0.0, 10.0, 0.001)), (carrying, (0.0, time[-1] - time[0], np.median(np.diff(time))))):
        found = ElementTree.fromstring(members(fmu)["modelDescription.xml"]).find("DefaultExperiment")
        assert found is not None
        names = ("startTime", "stopTime", "stepSize")
        assert [float(found.attrib[name]) for name in names] == pytest.approx(expected, rel=1e-9)
        assert fmu == plain or [found.attrib[name] for name in names] == [of_run[name] for name in names]


def test_the_manifest_has_the_attributes_of_fmi_s_schema(fmu: Path) -> None:
    """FMI's schema of all manifests names the attributes of the root; the rest is the layered standard's."""
    schema = etree.XMLSchema(
        etree.parse(str(Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3LayeredStandardManifest.xsd"))
    )
    root = etree.fromstring(members(fmu)[MANIFEST])
    manifest = etree.Element("{http://fmi-standard.org/fmi-ls-manifest}fmiLayeredStandardManifest", dict(root.attrib))
    assert schema.validate(manifest), schema.error_log


def test_inputs_and_results_are_those_of_the_independent_implementation(fmu: Path) -> None:
    """The trace of the oracle over the same recording, row by row."""
    files = members(fmu)
    expected = table(INPUTS.with_name("cable_loop_ref.csv").read_bytes())
    found = table(files[RESULT])
    assert set(found.dtype.names) == set(expected.dtype.names)
    for name in expected.dtype.names:
        assert np.abs(found[name] - expected[name]).max() <= 1e-9 * np.abs(expected[name]).max() + 1e-12, name
    signals = table(INPUTS.read_bytes())
    for name in ("time", "tendon_force[1]", "tendon_position[1]"):
        assert (table(files[STIMULI])[name] == signals[name]).all()


def test_names_are_quoted_and_numbers_are_not(fmu: Path) -> None:
    """The rules of fmi-standard.org for CSV files."""
    files = members(fmu)
    for name in (STIMULI, RESULT):
        header, *rows = files[name].decode().splitlines()
        assert re.fullmatch(r'"time"(,"[^",]+")+', header)
        assert all(re.fullmatch(r"[-+.e\d]+(,[-+.e\d]+)+", row) for row in rows) and len(files[name]) < 1_000_000


def test_the_experiment_and_the_options_say_the_same(fmu: Path) -> None:
    files = members(fmu)
    (experiment,) = ElementTree.fromstring(files[EXPERIMENT])
    options = dict(line.split(",") for line in files[OPTIONS].decode().splitlines())
    assert options == {
        "StartTime": "0.0",
        "StopTime": "1.9921875",
        "StepSize": "0.0078125",
        "RelTol": "1e-09",
        "AbsTol": "1e-12",
    }
    assert [experiment.attrib[name] for name in ("startTime", "stopTime", "stepSize")] == list(options.values())[:3]
    assert [each.attrib["source"] for each in experiment] == ["cable_loop_in.csv", "cable_loop_ref.csv"]


def test_the_same_input_gives_the_same_bytes(fmu: Path, tmp_path: Path) -> None:
    again = tf.build(DESCRIPTION, tmp_path / "again.fmu", reference=tf.read_recording(INPUTS))
    assert again.read_bytes() == fmu.read_bytes()


def test_an_fmu_without_a_reference_has_no_folder(tmp_path: Path) -> None:
    files = members(tf.build(DESCRIPTION, tmp_path / "plain.fmu"))
    assert not [name for name in files if name.startswith(("extra/", "documentation/fmi-ls-ref"))]


def test_an_uneven_recording_is_interpolated_to_its_median_step(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    time = 1.7e9 + 0.002 * np.arange(400) + rng.uniform(-4e-4, 4e-4, 400)  # as a clock of a robot gives it
    time[200:] += 0.1
    position = 0.01 * np.sin(8 * (time - time[0]))[:, None]
    recording = tf.Recording.from_arrays(time, tendon_force=5.0 + 100.0 * position, tendon_position=position)
    with pytest.warns(tf.InputWarning) as warned:
        fmu = tf.build(DESCRIPTION, tmp_path / "uneven.fmu", reference=recording)
    signals = table(members(fmu)[STIMULI])
    (said,) = [str(each.message) for each in warned]
    assert f"gaps, over which 50 of {len(signals)} rows of the reference are interpolated" in said
    step = np.median(np.diff(time))
    assert np.abs(np.diff(signals["time"]) - step).max() < 1e-12 and signals["time"][0] == 0.0
    assert time[-1] - time[0] - step < signals["time"][-1] <= time[-1] - time[0] + 1e-9
    assert np.abs(signals["tendon_position[1]"] - 0.01 * np.sin(8 * signals["time"])).max() < 0.01 * (8 * 0.11) ** 2 / 8
    done = check(fmu)
    assert done.status == 0, done.out + done.err


def test_a_recording_of_another_finger_is_warned_of(tmp_path: Path) -> None:
    """The same that `tendonfmu check` calls an error; the recording of the finger itself raises no warning."""
    demo = ROOT / "examples" / "demo_recording"
    signals = tf.read_recording(demo / "two_joints_unseen.parquet").frame[:2000]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tf.build(demo / "two_joints.json", tmp_path / "same.fmu", reference=signals)
    signals["tendon_position[2]"] *= -1
    with pytest.warns(tf.InputWarning, match=r"tendon_position\[2\]: .*; probably a wrong sign.*") as found:
        tf.build(demo / "two_joints.json", tmp_path / "other.fmu", reference=signals)
    assert len(found) == 1 and found[0].filename == __file__
    assert (tmp_path / "other.fmu").exists()


@pytest.mark.parametrize("name", ["finger.zip", "finger", ".fmu", "finger.fmu.json"])
@pytest.mark.parametrize("source", [DESCRIPTION, ROOT / "examples/rigs/index_finger.json"])
def test_an_output_of_another_suffix_is_refused(tmp_path: Path, source: Path, name: str) -> None:
    with pytest.raises(tf.InputError, match=rf"{re.escape(name)}: expected a name that ends in \.fmu"):
        tf.build(source, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_the_suffix_may_be_in_capitals(tmp_path: Path) -> None:
    assert tf.build(DESCRIPTION, tmp_path / "FINGER.FMU").exists()


def test_what_cannot_be_a_reference_is_refused(tmp_path: Path) -> None:
    one = tf.Recording.from_arrays([0.0], tendon_force=[[5.0]], tendon_position=[[0.0]])
    with pytest.raises(tf.InputError, match="one sample; expected two or more"):
        tf.build(DESCRIPTION, tmp_path / "a.fmu", reference=one)
    two_tendons = tf.Recording.from_arrays([0.0, 0.1], tendon_force=[[5.0] * 2] * 2, tendon_position=[[0.0] * 2] * 2)
    with pytest.raises(tf.InputError, match="2 columns tendon_force"):
        tf.build(DESCRIPTION, tmp_path / "a.fmu", reference=two_tendons)
    with pytest.raises(tf.InputError, match="a rig; expected a finger description"):
        tf.build(ROOT / "examples/rigs/index_finger.json", tmp_path / "a.fmu", reference=INPUTS)
    assert not list(tmp_path.iterdir())


# --- the check of what an FMU carries ---------------------------------------------------------------------------------


def test_the_fmu_agrees_with_what_it_carries(fmu: Path) -> None:
    done = check(fmu)
    assert done.status == 0, done.out + done.err
    variables = fmpy.read_model_description(str(fmu), validate=False).modelVariables
    names = {each.name for each in variables if each.causality == "output"}
    rows = [line.split() for line in done.out.splitlines()[1:-1]]
    assert {row[0] for row in rows} == names and {row[-1] for row in rows} == {"agrees"}
    assert done.out.splitlines()[-1] == f"cable_loop.fmu: 0 of {len(names)} variables differ from cable_loop"


def test_arrays_of_fmi_3_0(tmp_path: Path) -> None:
    """A cell of an array has the numbers of its elements: the same numbers as in the columns of FMI 2.0."""
    recording = INPUTS.with_name("asymmetric_pair_in.csv")
    built = {
        version: tf.build(
            DESCRIPTION.with_name("asymmetric_pair.json"), tmp_path / f"{version}.fmu", reference=recording, fmi=version
        )
        for version in (2, 3)
    }
    tables = {version: members(fmu)[f"{FOLDER}/asymmetric_pair_ref.csv"].decode() for version, fmu in built.items()}
    numbers = {version: sorted(re.split(r"[, \n]", text.partition("\n")[2])) for version, text in tables.items()}
    assert "joint_torque[2]" in tables[2] and "joint_torque[" not in tables[3] and numbers[2] == numbers[3]
    for fmu in built.values():
        done = check(fmu)
        assert done.status == 0 and "joint_torque[2] " in done.out and " 0 of 20 variables differ" in done.out, done.err
        done = check(fmu, "--set", "bias.forget_rate=6")
        assert done.status == 1 and re.search(r"compensated_torque\[\d\] .* DIFFERS", done.out)


def test_fmpy_finds_no_outlier(fmu: Path, tmp_path: Path) -> None:
    """fmpy's own functions for the FMI cross-check: they read the three files, and compare within a band."""
    from fmpy.util import read_csv, read_ref_opt_file, validate_result

    for name, content in members(fmu).items():
        if name.startswith(FOLDER):
            (tmp_path / Path(name).name).write_bytes(content)
    options = read_ref_opt_file(tmp_path / "cable_loop_ref.opt")
    reference = read_csv(tmp_path / "cable_loop_ref.csv")
    result = fmpy.simulate_fmu(
        str(fmu),
        validate=False,
        start_time=options["StartTime"],
        stop_time=options["StopTime"],
        output_interval=options["StepSize"],
        input=read_csv(tmp_path / "cable_loop_in.csv"),
        output=list(reference.dtype.names[1:]),
    )
    assert validate_result(result, reference, options["StopTime"]) == 0.0
    moved = reference.copy()
    moved["joint_angle[1]"] += 0.2 * np.ptp(reference["joint_angle[1]"])
    assert validate_result(result, moved, options["StopTime"]) > 0.0


def alone(source: str) -> Edit:
    """Only the result is left in the manifest, as in the Reference FMUs."""

    def edit(files: dict[str, bytes]) -> None:
        files[MANIFEST] = RESULT_ALONE.replace("SOURCE", source).encode()
        files.pop(EXPERIMENT)

    return edit


def test_a_result_alone_takes_inputs_and_options_that_lie_beside_it(edited: Callable[[Edit], Path]) -> None:
    done = check(edited(alone("cable_loop_ref.csv")))
    assert done.status == 0, done.err
    assert tolerance_in(done) == pytest.approx(1e-9 * LARGEST + 1e-12, rel=1e-3)  # of the options


def test_an_experiment_without_a_tolerance_gets_a_stated_one(edited: Callable[[Edit], Path]) -> None:
    def without_options(files: dict[str, bytes]) -> None:
        files.pop(OPTIONS)
        files[MANIFEST] = re.sub(rb"<Related [^>]*ref\.opt[^>]*>", b"", files[MANIFEST])

    fmu = edited(without_options)
    done = check(fmu)
    assert done.status == 0, done.err
    assert tolerance_in(done) == pytest.approx(1e-3 * LARGEST, rel=1e-3)
    assert tolerance_in(check(fmu, "--tolerance", "1e-9")) == pytest.approx(1e-9 * LARGEST, rel=1e-3)


def test_an_experiment_in_the_newer_form_sets_parameters(edited: Callable[[Edit], Path]) -> None:
    """Times in a child element, and a parameter set with another value than the FMU's."""

    def edit(files: dict[str, bytes]) -> None:
        files[EXPERIMENT] = b"""<Experiments name="two"><Experiment name="first"><TransientSimulation startTime="0"
            stopTime="1.9921875" stepSize="0.0078125"/><Parameters source="set.ssv"/>
            <Stimuli source="cable_loop_in.csv"/><References source="cable_loop_ref.csv"/></Experiment></Experiments>"""
        files[f"{FOLDER}/set.ssv"] = b"""<ssv:ParameterSet version="1.0" name="set"
            xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"><ssv:Parameters>
            <ssv:Parameter name="bias.forget_rate"><ssv:Real value="7"/></ssv:Parameter>
            <ssv:Parameter name="of another model"><ssv:Real value="1"/></ssv:Parameter>
            </ssv:Parameters></ssv:ParameterSet>"""

    done = check(edited(edit))
    assert done.status == 1 and done.out.splitlines()[-1].endswith("differ from first"), done.err
    assert re.search(r"compensated_torque\[1\] .* DIFFERS", done.out) and re.search(r"joint_angle.* agrees", done.out)


def put(name: str, content: bytes | None) -> Edit:
    def edit(files: dict[str, bytes]) -> None:
        files.pop(name)
        files.update({} if content is None else {name: content})

    return edit


def add_a_row(files: dict[str, bytes]) -> None:
    files[RESULT] += b"5.0" + b",0" * files[RESULT].split(b"\n")[0].count(b",") + b"\n"


def widen_a_cell(files: dict[str, bytes]) -> None:
    files[RESULT] = re.sub(rb"\n0\.0,", b"\n0.0,1.0 ", files[RESULT], count=1)


ELSEWHERE = b'<fmiReferences><Related source="https://example.org/a.csv" role="result"/></fmiReferences>'
SPOILED: dict[str, tuple[Edit, str]] = {
    "no manifest": (put(MANIFEST, None), "no extra/.* in it; expected reference results in the FMU, or FOLDER/NAME"),
    "no XML": (put(MANIFEST, b"<a>"), "manifest.xml: .*; expected XML"),
    "nothing to compare": (put(MANIFEST, b"<fmiReferences/>"), "no experiment with references and no result"),
    "result missing": (put(RESULT, None), r"cable_loop_ref\.csv: not in the FMU"),
    "options missing": (put(OPTIONS, None), r"ref\.opt: not in the FMU; expected it, as .*manifest\.xml lists it"),
    "file elsewhere": (put(MANIFEST, ELSEWHERE), "expected a relative path in the FMU"),
    "a row too many": (add_a_row, r"cable_loop_ref\.csv, column time: outside of 0\.0 to 1\.99"),
    "cells of two sizes": (widen_a_cell, r"line 3, column compensated_torque\[1\]: 1 number; expected 2"),
}


@pytest.mark.parametrize("spoiled", SPOILED)
def test_a_bad_file_in_the_fmu_is_named(edited: Callable[[Edit], Path], spoiled: str) -> None:
    edit, message = SPOILED[spoiled]
    done = check(edited(edit))
    assert done.status == 2 and done.err.count("\n") == 1 and done.out == ""
    assert re.search(message, done.err), done.err


def test_a_file_of_the_fmu_outside_of_its_folder_may_be_listed(edited: Callable[[Edit], Path]) -> None:
    def edit(files: dict[str, bytes]) -> None:
        listed = b'<Related source="../../documentation/%s" role="documentation"/></fmiReferences>'
        files[MANIFEST] = files[MANIFEST].replace(b"</fmiReferences>", listed % b"index.html")

    assert check(edited(edit)).status == 0


@pytest.mark.parametrize("member", [RESULT, OPTIONS, "sources/finger_model.c"])
def test_a_damaged_member_is_named(fmu: Path, tmp_path: Path, member: str) -> None:
    """One byte in the middle of what the archive holds of it, where a checksum or the decompression finds it."""
    with zipfile.ZipFile(fmu) as archive:
        where = archive.getinfo(member)
    content = bytearray(fmu.read_bytes())
    content[where.header_offset + 30 + len(member) + where.compress_size // 2] ^= 0xFF
    (tmp_path / "damaged.fmu").write_bytes(content)
    done = check(tmp_path / "damaged.fmu")
    assert done.status == 2 and done.err.count("\n") == 1 and done.out == ""
    assert "damaged.fmu: " in done.err and "whole" in done.err


# --- FMUs of another tool ---------------------------------------------------------------------------------------------

STEP = """
    def do_step(self, time, step):
        self.x -= step * self.rate * self.x
        self.high = self.x > 0.5
        self.steps += 1
        return True
"""
DECAY_2 = """
from pythonfmu import Boolean, DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real, String

class Decay(Fmi2Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.x, self.rate, self.high, self.label, self.steps = 1.0, 1.0, True, "no number", 0
        output = {"causality": Fmi2Causality.output, "variability": Fmi2Variability.discrete}
        self.register_variable(String("label", **output))
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        self.register_variable(Boolean("high", **output))
        self.register_variable(Real("rate", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        self.default_experiment = DefaultExperiment(start_time=0, stop_time=5, step_size=0.1)
"""
DECAY_3 = """
from pythonfmu3 import Boolean, DefaultExperiment, Float64, Int32
from pythonfmu3 import Fmi3Causality, Fmi3Slave, Fmi3Variability

class Decay(Fmi3Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.time, self.x, self.rate, self.high, self.steps = 0.0, 1.0, 1.0, True, 0
        output = {"causality": Fmi3Causality.output, "variability": Fmi3Variability.discrete}
        continuous = Fmi3Variability.continuous
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=continuous))
        self.register_variable(Float64("x", causality=Fmi3Causality.output, variability=continuous))
        self.register_variable(Boolean("high", **output))
        self.register_variable(Int32("steps", **output))
        self.register_variable(Float64("rate", causality=Fmi3Causality.parameter, variability=Fmi3Variability.tunable))
        self.default_experiment = DefaultExperiment(start_time=0, stop_time=5, step_size=0.1)
"""


@pytest.mark.long
@pytest.mark.parametrize(("tool", "source"), [("pythonfmu", DECAY_2), ("pythonfmu3", DECAY_3)])
def test_the_fmu_of_another_tool_with_its_result(tmp_path: Path, tool: str, source: str) -> None:
    """FMI 2.0 and 3.0, a result as the Reference FMUs have it: Euler's steps, in closed form."""
    require(tool)
    # a name for each: the FMUs import it into this process
    (tmp_path / f"of_{tool}.py").write_text(source + STEP)
    subprocess.run([sys.executable, "-m", tool, "build", "-f", f"of_{tool}.py"], cwd=tmp_path, check=True)
    steps = np.arange(51)
    columns = {
        "x": 0.9**steps,
        "high": np.where(0.9**steps > 0.5, "true", "false"),
        **({"label": np.full(51, "no number")} if tool == "pythonfmu" else {"steps": steps}),
    }
    rows = [",".join(["time", *columns])]
    rows += [",".join([repr(0.1 * int(k)), *(str(each[k]) for each in columns.values())]) for k in steps]
    with zipfile.ZipFile(tmp_path / "Decay.fmu", "a") as archive:
        archive.writestr(MANIFEST, RESULT_ALONE.replace("SOURCE", "Decay_out.csv"))
        archive.writestr(f"{FOLDER}/Decay_out.csv", "\n".join(rows) + "\n")
    done = check(tmp_path / "Decay.fmu", "--tolerance", "1e-12")
    assert done.status == 0, done.out + done.err
    compared = [name for name in columns if name != "label"]
    assert [line.split()[0] for line in done.out.splitlines()[1:-1]] == compared
    done = check(tmp_path / "Decay.fmu", "--set", "rate=1.1")
    assert done.status == 1 and re.search(r"^x .* DIFFERS$", done.out, re.MULTILINE)
