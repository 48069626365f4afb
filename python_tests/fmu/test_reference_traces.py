"""FMUs against reference traces, by fmpy: those of the independent implementation in python_tests/reference.

Then what `build --reference` puts into an FMU for others to check by, and the script that does (examples).
"""

from __future__ import annotations

import io
import re
import shutil
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from fmpy.util import read_csv, read_ref_opt_file, validate_result
from reference import make_reference_traces as traces

import tendonfmu as tf
from command import Answer, run_script
from repository_paths import ROOT, TESTS
from tendonfmu.fmu import build_fmu

REFERENCE = TESTS / "reference"
EXAMPLE = ROOT / "examples" / "ci_reference_check"
NAMES = list(traces.TRACES)
FMUS = [(name, fmi) for name in NAMES for fmi in (2, 3)]
DESCRIPTION, INPUTS = REFERENCE / "cable_loop.json", REFERENCE / "cable_loop_in.csv"
FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
MANIFEST, EXPERIMENT = f"{FOLDER}/fmi-ls-manifest.xml", f"{FOLDER}/cable_loop.exp"
RESULT, STIMULI, OPTIONS = (f"{FOLDER}/cable_loop_{end}" for end in ("ref.csv", "in.csv", "ref.opt"))


# --- by fmpy ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the FMUs of each trace: NAME.fmu, and NAME.fmu in the folder 3."""
    folder = tmp_path_factory.mktemp("fmus")
    (folder / "3").mkdir()
    for name, fmi in FMUS:
        output = (folder if fmi == 2 else folder / "3") / f"{name}.fmu"
        build_fmu(traces.TRACES[name][0], output, fmi=fmi)
    return folder


def with_arrays(signals: Any) -> Any:
    """Columns name[1], name[2], ... as arrays of FMI 3.0."""
    groups: dict[str, list[str]] = {}
    for column in signals.dtype.names:
        groups.setdefault(column.partition("[")[0], []).append(column)
    types = [(name, float, () if name == "time" else (len(columns),)) for name, columns in groups.items()]
    arrays = np.zeros(len(signals), dtype=types)
    for name, columns in groups.items():
        whole = np.column_stack([signals[column] for column in columns])
        arrays[name] = whole[:, 0] if name == "time" else whole
    return arrays


def simulated(fmu: Path, name: str, fmi: int, **start_values: float) -> tuple[Any, Any, dict[str, Any]]:
    """What fmpy gives over the inputs of a trace, the reference, and its options. Columns are those of FMI 2.0."""
    signals, reference = (read_csv(REFERENCE / f"{name}_{end}.csv") for end in ("in", "ref"))
    options = read_ref_opt_file(REFERENCE / f"{name}_ref.opt")
    outputs = list(dict.fromkeys(each if fmi == 2 else each.partition("[")[0] for each in reference.dtype.names[1:]))
    result = fmpy.simulate_fmu(
        str(fmu),
        validate=False,
        start_time=options["StartTime"],
        stop_time=options["StopTime"],
        output_interval=options["StepSize"],
        input=signals if fmi == 2 else with_arrays(signals),
        output=outputs,
        start_values=start_values,
    )
    columns = np.column_stack([result[each].reshape(len(result), -1) for each in ["time", *outputs]]).astype(float)
    return np.rec.fromarrays(columns.T, names=list(reference.dtype.names)), reference, options


@pytest.mark.parametrize(("name", "fmi"), FMUS)
def test_fmpy_yields_the_reference_trace(fmus: Path, name: str, fmi: int) -> None:
    """Within the tolerances of the trace, and without an outlier by fmpy's own comparison of the FMI cross-check."""
    fmu = (fmus if fmi == 2 else fmus / "3") / f"{name}.fmu"
    result, reference, options = simulated(fmu, name, fmi)
    assert len(reference) == 256 and len(reference.dtype.names) > 10
    for each in reference.dtype.names:
        allowed = options["RelTol"] * np.abs(reference[each]).max() + options["AbsTol"]
        assert np.abs(result[each] - reference[each]).max() <= allowed, each
    assert validate_result(result, reference, options["StopTime"]) == 0.0
    changed, _, _ = simulated(fmu, name, fmi, **{"bias.forget_rate": 5.5})
    torque = "compensated_torque[1]"
    assert np.abs(changed[torque] - reference[torque]).max() > 1e-6 * np.abs(reference[torque]).max()


# --- examples/ci_reference_check --------------------------------------------------------------------------------------


def check(fmu: Path, *more: Path | str) -> Answer:
    return run_script(EXAMPLE / "check_reference.py", fmu, *more)


def test_the_script_agrees_and_shows_a_changed_number(fmus: Path) -> None:
    """With another value of a parameter, what does not depend on it still agrees."""
    for name in NAMES:
        done = check(fmus / f"{name}.fmu", REFERENCE / name)
        assert done.status == 0, done.out + done.err
        rows = [line.split() for line in done.out.splitlines()]
        assert [row[0] for row in rows[1:-1]] == list(read_csv(REFERENCE / f"{name}_ref.csv").dtype.names)[1:]
        assert {row[-1] for row in rows[1:-1]} == {"agrees"}
    done = check(fmus / "asymmetric_pair.fmu", REFERENCE / "asymmetric_pair", "--set", "bias.forget_rate=5.5")
    assert done.status == 1, done.out + done.err
    assert re.search(r"^compensated_torque\[\d\] .* DIFFERS$", done.out, re.MULTILINE)
    assert re.search(r"^joint_torque\[1\] .* agrees$", done.out, re.MULTILINE)
    assert check(fmus / "cable_loop.fmu", REFERENCE / "asymmetric_pair").status == 2


SPOILED = {
    "missing output": ("_ref.csv", r'"bias_torque\[1\]"', '"bias.forget_rate"', r"no column bias_torque\[1\]"),
    "text": ("_ref.csv", r"\n0\.0078125,[^,]*", "\n0.0078125,high", r"line 3, column compensated_torque\[1\]: 'high'"),
    "NaN": ("_in.csv", r"\n0\.0078125,[^,]*", "\n0.0078125,nan", r"line 3, column tendon_force\[1\]: 'nan'; expected"),
    "no stop time": ("_ref.opt", "StopTime", "Stop", "StopTime missing"),
}


@pytest.mark.parametrize("spoiled", SPOILED)
def test_the_script_names_a_bad_file(fmus: Path, tmp_path: Path, spoiled: str) -> None:
    end, pattern, replacement, message = SPOILED[spoiled]
    for file in REFERENCE.glob("cable_loop_*"):
        shutil.copy(file, tmp_path)
    file = tmp_path / f"cable_loop{end}"
    file.write_text(re.sub(pattern, replacement, file.read_text(encoding="utf-8"), count=1), encoding="utf-8")
    done = check(fmus / "cable_loop.fmu", tmp_path / "cable_loop")
    assert done.status == 2 and done.err.count("\n") == 1 and done.out == ""
    assert re.search(re.escape(file.name) + ".*" + message, done.err), done.err


def test_the_script_refuses_what_is_no_fmu_or_setting(fmus: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.fmu").write_bytes(b"PK no archive")
    done = check(tmp_path / "bad.fmu", REFERENCE / "cable_loop")
    assert done.status == 2 and "bad.fmu: " in done.err and done.err.count("\n") == 1
    for setting in ("bias.forget_rate", "forget=1", "bias.forget_rate=nan"):
        done = check(fmus / "cable_loop.fmu", REFERENCE / "cable_loop", "--set", setting)
        assert done.status == 2 and done.out == ""


# --- what build puts into an FMU --------------------------------------------------------------------------------------

Edit = Callable[[dict[str, bytes]], None]


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tf.build(DESCRIPTION, tmp_path_factory.mktemp("fmu") / "cable_loop.fmu", reference=INPUTS)


def members(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def table(text: bytes) -> Any:
    return np.genfromtxt(io.BytesIO(text.replace(b'"', b"")), delimiter=",", names=True, deletechars="")


def test_the_files_are_as_the_layered_standard_asks(fmu: Path) -> None:
    """fmi-ls-ref: the manifest lists every file; FMI's schema names the attributes of its root; CSV as FMI has it."""
    from lxml import etree

    files = members(fmu)
    root = etree.fromstring(files[MANIFEST])
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3LayeredStandardManifest.xsd"
    alike = etree.Element("{http://fmi-standard.org/fmi-ls-manifest}fmiLayeredStandardManifest", dict(root.attrib))
    etree.XMLSchema(etree.parse(str(schema))).assertValid(alike)
    assert root.tag == "fmiReferences" and FOLDER.endswith(root.attrib[f"{{{root.nsmap['fmi-ls']}}}fmi-ls-name"])
    related = {f"{FOLDER}/{each.attrib['source']}": each.attrib for each in root}
    assert set(related) | {MANIFEST} == {name for name in files if name.startswith("extra/")}
    assert related[RESULT]["role"] == "result" and related[EXPERIMENT]["role"] == "experiment/smoke-test"
    for name in (STIMULI, RESULT):
        header, *rows = files[name].decode().splitlines()
        assert re.fullmatch(r'"time"(,"[^",]+")+', header)
        assert all(re.fullmatch(r"[-+.e\d]+(,[-+.e\d]+)+", row) for row in rows) and len(files[name]) < 1_000_000


def test_inputs_results_and_experiment_are_those_of_the_recording(fmu: Path) -> None:
    """The trace of the oracle over the same recording, row by row; a client that simulates by defaults runs it."""
    files = members(fmu)
    expected, found = table(INPUTS.with_name("cable_loop_ref.csv").read_bytes()), table(files[RESULT])
    assert set(found.dtype.names) == set(expected.dtype.names)
    for name in expected.dtype.names:
        assert np.abs(found[name] - expected[name]).max() <= 1e-9 * np.abs(expected[name]).max() + 1e-12, name
    signals = table(INPUTS.read_bytes())
    for name in ("time", "tendon_force[1]", "tendon_position[1]"):
        assert (table(files[STIMULI])[name] == signals[name]).all()
    options = dict(line.split(",") for line in files[OPTIONS].decode().splitlines())
    times = {"startTime": "0.0", "stopTime": "1.9921875", "stepSize": "0.0078125"}
    assert options == {k[0].upper() + k[1:]: x for k, x in times.items()} | {"RelTol": "1e-09", "AbsTol": "1e-12"}
    default = ElementTree.fromstring(files["modelDescription.xml"]).find("DefaultExperiment")
    for of in (ElementTree.fromstring(files[EXPERIMENT])[0], default):
        assert of is not None and {name: of.attrib[name] for name in times} == times


def test_the_same_input_gives_the_same_bytes(fmu: Path, tmp_path: Path) -> None:
    again = tf.build(DESCRIPTION, tmp_path / "again.fmu", reference=tf.read_recording(INPUTS))
    assert again.read_bytes() == fmu.read_bytes()


def test_an_uneven_recording_is_interpolated_to_its_median_step(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    time = 1.7e9 + 0.002 * np.arange(400) + rng.uniform(-4e-4, 4e-4, 400)  # as a clock of a robot gives it
    time[200:] += 0.1
    position = 0.01 * np.sin(8 * (time - time[0]))[:, None]
    recording = tf.Recording.from_arrays(time, tendon_force=5.0 + 100.0 * position, tendon_position=position)
    with pytest.warns(tf.InputWarning) as warned:
        fmu = tf.build(DESCRIPTION, tmp_path / "uneven.fmu", reference=recording)
    signals = table(members(fmu)[STIMULI])
    (warning,) = [str(each.message) for each in warned]
    assert f"gaps, over which 50 of {len(signals)} rows of the reference are interpolated" in warning
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


def test_what_cannot_be_a_reference_is_refused(tmp_path: Path) -> None:
    for name in ("finger.zip", ".fmu", "finger.fmu.json"):
        with pytest.raises(tf.InputError, match=rf"{re.escape(name)}: expected a name that ends in \.fmu"):
            tf.build(DESCRIPTION, tmp_path / name)
    one = tf.Recording.from_arrays([0.0], tendon_force=[[5.0]], tendon_position=[[0.0]])
    with pytest.raises(tf.InputError, match="one sample; expected two or more"):
        tf.build(DESCRIPTION, tmp_path / "a.fmu", reference=one)
    two_tendons = tf.Recording.from_arrays([0.0, 0.1], tendon_force=[[5.0] * 2] * 2, tendon_position=[[0.0] * 2] * 2)
    with pytest.raises(tf.InputError, match="2 columns tendon_force"):
        tf.build(DESCRIPTION, tmp_path / "a.fmu", reference=two_tendons)
    with pytest.raises(tf.InputError, match="a rig; expected a finger description"):
        tf.build(ROOT / "examples/rigs/index_finger.json", tmp_path / "a.fmu", reference=INPUTS)
    assert not list(tmp_path.iterdir())


# --- the script on what an FMU carries --------------------------------------------------------------------------------


def edited(fmu: Path, folder: Path, edit: Edit) -> Path:
    """A copy of the FMU with other files in it."""
    files = members(fmu)
    edit(files)
    with zipfile.ZipFile(folder / "edited.fmu", "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return folder / "edited.fmu"


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_fmu_agrees_with_what_it_carries(tmp_path: Path, fmi: int) -> None:
    """A cell of an array of FMI 3.0 has the numbers of its elements."""
    recording = INPUTS.with_name("asymmetric_pair_in.csv")
    fmu = tf.build(REFERENCE / "asymmetric_pair.json", tmp_path / "pair.fmu", reference=recording, fmi=fmi)
    header = members(fmu)[f"{FOLDER}/asymmetric_pair_ref.csv"].decode().partition("\n")[0]
    assert ("joint_torque[2]" in header) == (fmi == 2)
    done = check(fmu)
    assert done.status == 0 and "joint_torque[2] " in done.out and " 0 of 24 variables differ" in done.out, done.err
    done = check(fmu, "--set", "bias.forget_rate=6")
    assert done.status == 1 and re.search(r"compensated_torque\[\d\] .* DIFFERS", done.out)


def test_the_forms_of_other_tools_are_read(fmu: Path, tmp_path: Path) -> None:
    def alone(files: dict[str, bytes]) -> None:
        """As in the Reference FMUs: a result alone, with inputs and options beside it."""
        files.pop(EXPERIMENT)

    def without_options(files: dict[str, bytes]) -> None:
        files.pop(OPTIONS)

    largest = np.abs(table(members(fmu)[RESULT])["compensated_torque[1]"]).max()
    for edit, arguments, allowed in (
        (alone, (), 1e-9 * largest + 1e-12),
        (without_options, (), 1e-3 * largest),
        (without_options, ("--tolerance", "1e-9"), 1e-9 * largest),
    ):
        done = check(edited(fmu, tmp_path, edit), *arguments)
        assert done.status == 0, done.err
        assert float(done.out.splitlines()[1].split()[2]) == pytest.approx(allowed, rel=1e-3)


MISSING: dict[str, tuple[str, bytes | None, str]] = {
    "no result": (RESULT, None, "no extra/.* in it; expected reference results there, or FOLDER/NAME"),
    "no inputs": (STIMULI, None, "cable_loop_in.csv: cannot be read; expected the inputs of the FMU"),
    "no table": (RESULT, b"time\n1,2\n", "cable_loop_ref.csv: expected `time` first"),
    "no stop time": (OPTIONS, b"StartTime,0", "StopTime, StepSize missing"),
}


@pytest.mark.parametrize("missing", MISSING)
def test_a_bad_file_in_the_fmu_is_named(fmu: Path, tmp_path: Path, missing: str) -> None:
    name, content, message = MISSING[missing]

    def edit(files: dict[str, bytes]) -> None:
        files.pop(name)
        files.update({} if content is None else {name: content})

    done = check(edited(fmu, tmp_path, edit))
    assert done.status == 2 and done.err.count("\n") == 1 and done.out == ""
    assert re.search(message, done.err), done.err
