"""examples/ci_reference_check: real traces agree, a changed parameter does not, bad files are named."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest
from reference import make_reference_traces as traces

from command import Answer, run_script
from repository_paths import ROOT, TESTS

EXAMPLE = ROOT / "examples" / "ci_reference_check"
REFERENCE = TESTS / "reference"
NAMES = list(traces.TRACES)
# of each finger: a tunable parameter and another value
CHANGED = {
    "index_finger": ("tendons[1].pulley_friction[1].coulomb", 1.01),
    "asymmetric_pair": ("bias.forget_rate", 1.1),
    "cable_loop": ("bias.forget_rate", 1.1),
}


@pytest.fixture(autouse=True)
def beside_the_script(monkeypatch: pytest.MonkeyPatch) -> None:
    """The script imports a file of its folder, as it does when Python runs it."""
    monkeypatch.syspath_prepend(EXAMPLE)


def check(fmu: Path, *more: Path | str) -> Answer:
    return run_script(EXAMPLE / "check_reference.py", fmu, *more)


def number_at(description: dict[str, Any], path: str) -> float:
    """The value of a parameter path in a description: indices count from 1."""
    found: Any = description
    for key in re.findall(r"[a-z_]+|\d+", path):
        found = found[int(key) - 1 if key.isdigit() else key]
    return float(found)


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the FMU of each trace."""
    from tendonfmu.fmu.packaging import build_fmu

    folder = tmp_path_factory.mktemp("fmus")
    for name in NAMES:
        build_fmu(traces.TRACES[name][0], folder / f"{name}.fmu", illustrated=False)
    return folder


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """A copy of the trace of the cable loop, to be spoiled."""
    for file in REFERENCE.glob("cable_loop_*"):
        shutil.copy(file, tmp_path)
    return tmp_path / "cable_loop"


@pytest.mark.parametrize("name", NAMES)
def test_the_fmu_agrees_with_its_trace(fmus: Path, name: str) -> None:
    done = check(fmus / f"{name}.fmu", REFERENCE / name)
    assert done.status == 0, done.out + done.err
    header = (REFERENCE / f"{name}_ref.csv").read_text(encoding="utf-8").split("\n", 1)[0].replace('"', "").split(",")
    rows = [line.split() for line in done.out.splitlines()]
    assert [row[0] for row in rows[1:-1]] == header[1:]
    assert {row[-1] for row in rows[1:-1]} == {"agrees"}
    assert all(float(row[1]) <= float(row[2]) for row in rows[1:-1])


@pytest.mark.parametrize("name", NAMES)
def test_a_changed_start_value_fails(fmus: Path, name: str) -> None:
    path, factor = CHANGED[name]
    value = factor * number_at(traces.read_description(name) | {"bias": {"forget_rate": 5.0}}, path)
    done = check(fmus / f"{name}.fmu", REFERENCE / name, "--set", f"{path}={value!r}")
    assert done.status == 1, done.out + done.err
    assert re.search(r"^compensated_torque\[\d\] .* DIFFERS$", done.out, re.MULTILINE)
    assert re.search(r"^joint_torque\[1\] .* agrees$", done.out, re.MULTILINE)


def test_a_rebuilt_fmu_of_another_finger_fails(tmp_path: Path) -> None:
    from tendonfmu.fmu.packaging import build_fmu

    description = traces.read_description("asymmetric_pair")
    description["tendons"][0]["stiffness"] *= 1.001
    (tmp_path / "other.json").write_text(json.dumps(description))
    build_fmu(tmp_path / "other.json", tmp_path / "other.fmu", illustrated=False)
    done = check(tmp_path / "other.fmu", REFERENCE / "asymmetric_pair")
    assert done.status == 1, done.err
    assert "DIFFERS" in done.out


def spoil(trace: Path, end: str, pattern: str, replacement: str) -> None:
    file = trace.with_name(trace.name + end)
    text, count = re.subn(pattern, replacement, file.read_text(encoding="utf-8"), count=1)
    assert count == 1
    file.write_text(text, encoding="utf-8")


SPOILED = {
    "renamed input": ("_in.csv", r"tendon_force\[1\]", "force", "force is not a numeric variable of the FMU"),
    "output as input": ("_in.csv", r"tendon_force\[1\]", "slack[1]", r"causality output; expected input"),
    "missing output": ("_ref.csv", r'"bias_torque\[1\]"', '"bias.forget_rate"', r"no column bias_torque\[1\]"),
    "unknown output": ("_ref.csv", r'"bias_torque\[1\]"', '"bias"', "bias is not a numeric variable"),
    "same name twice": ("_ref.csv", r'"bias_torque\[1\]"', '"joint_torque[1]"', "no name twice"),
    "no time": ("_ref.csv", r'"time"', '"t"', "expected `time` first"),
    "text": ("_ref.csv", r"\n0\.0078125,[^,]*", "\n0.0078125,high", r"line 3, column compensated_torque\[1\]: 'high'"),
    "NaN": ("_in.csv", r"\n0\.0078125,[^,]*", "\n0.0078125,nan", r"line 3, column tendon_force\[1\]: 'nan'; expected"),
    "time goes back": ("_in.csv", r"\n0\.0078125,", "\n-1,", "column time: expected"),
    "short row": ("_in.csv", r"\n0\.0078125,[^,]*", "\n0.0078125", "line 3: 2 columns; expected 3"),
    "no stop time": ("_ref.opt", "StopTime", "Stop", "StopTime missing"),
    "step of 0": ("_ref.opt", r"StepSize,\S*", "StepSize,0", "StepSize above 0"),
    "tolerance that is no number": ("_ref.opt", r"RelTol,\S*", "RelTol,small", "RelTol: 'small'"),
}


@pytest.mark.parametrize("spoiled", SPOILED)
def test_a_bad_file_is_named(fmus: Path, copied: Path, spoiled: str) -> None:
    end, pattern, replacement, message = SPOILED[spoiled]
    spoil(copied, end, pattern, replacement)
    done = check(fmus / "cable_loop.fmu", copied)
    assert done.status == 2, done.out
    assert re.search(re.escape(f"cable_loop{end}") + ".*" + message, done.err), done.err
    assert done.err.count("\n") == 1 and done.out == ""


@pytest.mark.parametrize("end", ["_in.csv", "_ref.csv", "_ref.opt"])
def test_a_missing_file_is_named(fmus: Path, copied: Path, end: str) -> None:
    copied.with_name(copied.name + end).unlink()
    done = check(fmus / "cable_loop.fmu", copied)
    assert done.status == 2
    assert f"cable_loop{end}: cannot be read; expected" in done.err


def test_what_is_no_fmu_is_named(tmp_path: Path) -> None:
    for content in (b"", b"PK no archive"):
        (tmp_path / "bad.fmu").write_bytes(content)
        done = check(tmp_path / "bad.fmu", REFERENCE / "cable_loop")
        assert done.status == 2 and "bad.fmu: " in done.err and done.err.count("\n") == 1
    assert check(tmp_path / "none.fmu", REFERENCE / "cable_loop").status == 2


def test_an_fmu_without_binaries_is_named(fmus: Path, tmp_path: Path) -> None:
    target = tmp_path / "sources.fmu"
    with zipfile.ZipFile(fmus / "cable_loop.fmu") as source, zipfile.ZipFile(target, "w") as archive:
        for name in source.namelist():
            if not name.startswith("binaries/"):
                archive.writestr(name, source.read(name))
    done = check(target, REFERENCE / "cable_loop")
    assert done.status == 2 and "binaries for c-code; expected" in done.err


@pytest.mark.parametrize("setting", ["bias.forget_rate", "=1", "forget=1"])
def test_a_bad_setting_is_refused(fmus: Path, setting: str) -> None:
    done = check(fmus / "cable_loop.fmu", REFERENCE / "cable_loop", "--set", setting)
    assert done.status == 2 and done.out == ""


@pytest.mark.parametrize("setting", ["bias.forget_rate=abc", "bias.forget_rate=nan", "kinematics_source=1.5"])
def test_a_setting_that_its_variable_cannot_have_is_no_fault_of_the_fmu(fmus: Path, setting: str) -> None:
    done = check(fmus / "cable_loop.fmu", REFERENCE / "cable_loop", "--set", setting)
    assert done.status == 2 and done.err.count("\n") == 1
    name, _, value = setting.partition("=")
    assert done.err.startswith(f"check_reference: --set {name}: {value!r}; expected a ")


@pytest.mark.parametrize("tolerance", ["-1", "nan", "inf", "small"])
def test_a_tolerance_that_is_none_is_refused(fmus: Path, tolerance: str) -> None:
    done = check(fmus / "cable_loop.fmu", REFERENCE / "cable_loop", f"--tolerance={tolerance}")
    assert done.status == 2 and done.out == ""
    assert f"argument --tolerance: {tolerance!r}; expected a number, 0 or more" in done.err


def test_a_python_without_fmpy_is_named(tmp_path: Path) -> None:
    """-S leaves the installed packages out."""
    (tmp_path / "bare").write_text(f'#!/bin/sh\nexec "{sys.executable}" -I -S "$@"\n')
    (tmp_path / "bare").chmod(0o755)
    for command in (
        [str(tmp_path / "bare"), str(EXAMPLE / "check_reference.py"), "some.fmu"],
        ["sh", str(EXAMPLE / "reference_check.sh"), str(REFERENCE), str(REFERENCE)],
    ):
        environment = dict(os.environ, PYTHON=str(tmp_path / "bare"))
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
        assert "no fmpy" in done.stderr and "expected" in done.stderr


@pytest.mark.long
def test_every_fmu_of_a_folder(fmus: Path, tmp_path: Path) -> None:
    """The shell variant: the worst answer of all is its own."""

    def run_all(folder: Path, traces_folder: Path = REFERENCE) -> subprocess.CompletedProcess[str]:
        environment = dict(os.environ, PYTHON=sys.executable)
        command = ["sh", str(EXAMPLE / "reference_check.sh"), str(folder), str(traces_folder)]
        return subprocess.run(command, capture_output=True, text=True, env=environment, check=False)

    done = run_all(fmus)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.findall(r"0 of \d+ variables differ from (\w+)", done.stdout) == sorted(NAMES)
    assert done.stderr == ""
    for name in NAMES:
        shutil.copy(fmus / f"{name}.fmu", tmp_path)
    shutil.copytree(REFERENCE, tmp_path / "traces")
    spoil(tmp_path / "traces" / "cable_loop", "_ref.csv", r"\n0\.0,[^,]*", "\n0.0,1.0")
    one = run_all(tmp_path, tmp_path / "traces")
    assert one.returncode == 1 and one.stderr == f"reference_check: 1 of {len(NAMES)} FMUs failed: cable_loop.fmu\n"
    (tmp_path / "asymmetric_pair.fmu").unlink()
    assert run_all(tmp_path, tmp_path / "traces").returncode == 2
    assert run_all(tmp_path, tmp_path).returncode == 2
