"""The command: exit codes, one-line errors, results as docs/reference/semantics.md#commands has them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import oracle
import random_fingers
from agreement import compare
from command import Answer, Call
from repetitions import repeated
from repository_paths import ROOT
from tendonfmu.files.tables import read_table, write_table

INDEX_FINGER = ROOT / "examples" / "fingers" / "index_finger.json"


def refused(answer: Answer, status: int = 2) -> str:
    """The one line of a refusal; nothing on standard output."""
    assert answer.status == status, answer
    assert answer.out == ""
    lines = answer.err.splitlines()
    assert len(lines) == 1, answer.err
    assert lines[0].startswith("tendonfmu: ")
    return lines[0]


def described(folder: Path, description: Any, name: str = "finger.json") -> Path:
    (folder / name).write_text(description if isinstance(description, str) else json.dumps(description))
    return folder / name


def recorded(folder: Path, recording: dict[str, Any], name: str = "rec.csv") -> Path:
    columns: dict[str, Any] = {"time": recording["time"]}
    for group, array in recording.items():
        if group != "time" and array is not None:
            columns |= {f"{group}[{i + 1}]": array[:, i] for i in range(array.shape[1])}
    write_table(folder / name, columns)
    return folder / name


@pytest.fixture
def finger(tmp_path: Path) -> tuple[Path, Path, dict[str, Any], dict[str, Any]]:
    """Files of a random finger of every kind of friction and of a recording of it, and what is in them."""
    description = random_fingers.random_finger(3)
    recording = random_fingers.random_recording(description, 3)
    return described(tmp_path, description), recorded(tmp_path, recording), description, recording


# --- usage ------------------------------------------------------------------------------------------------------------


def test_help_needs_no_heavy_import() -> None:
    """A user waits for each of them; on the command line that is most of the time."""
    code = (
        "import sys; sys.argv = ['tendonfmu', '--help']\n"
        "from tendonfmu.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "heavy = ('numpy', 'pandas', 'pyarrow', 'fmpy', 'matplotlib', 'jinja2')\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_version(call: Call) -> None:
    from importlib.metadata import version

    assert call("--version") == Answer(0, f"tendonfmu {version('tendonfmu')}\n", "")


def test_no_command_is_bad_usage(call: Call) -> None:
    answer = call()
    assert answer.status == 2
    assert "Usage" in answer.out + answer.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["dance"], ["dance"]),
        (["check"], ["FINGER.json"]),
        (["check", "a.json", "b.json"], ["b.json"]),
        (["build", "a.json"], ["--output"]),
        (["run", "a.json", "-o", "out.csv"], ["RECORDING"]),
        (["run", "a.json", "rec.csv", "-o", "out.csv", "--kinematics", "4"], ["--kinematics", "3"]),
        (["run", "a.json", "rec.csv", "-o", "out.csv", "--kinematics", "one"], ["--kinematics", "integer"]),
        (["run", "a.json", "rec.csv", "-o", "out.csv", "--speed", "1"], ["--speed"]),
        (["convert", "davinci", "f", "-o", "r.csv", "--radius", "-1"], ["--radius", "0.000001"]),
        (["convert", "sputnik", "f", "-o", "r.csv"], ["sputnik", "davinci"]),
    ],
)
def test_bad_usage_is_one_line(call: Call, arguments: list[str], words: list[str]) -> None:
    line = refused(call(*arguments))
    assert all(word in line for word in words), line


# --- check ------------------------------------------------------------------------------------------------------------


def test_check_says_what_the_finger_is(call: Call) -> None:
    answer = call("check", INDEX_FINGER)
    assert answer.status == 0 and answer.err == ""
    for word in ("index_finger", "mcp_abduction", "dip_extensor", "472", "116", "86 working points"):
        assert word in answer.out


def test_check_says_no_to_an_unsound_finger(call: Call, tmp_path: Path) -> None:
    description = random_fingers.random_finger(1)
    description["tendons"][0]["stiffness"] = -4000.0
    line = refused(call("check", described(tmp_path, description)), status=1)
    for word in ("finger.json", "tendons[1].stiffness", "-4000", "N/m"):
        assert word in line


@pytest.mark.parametrize("text", ["", "{", "[]", "42", '{"format": "tendonfmu-finger-2"}', '{"a": 1, "a": 2}', "\x00"])
def test_check_of_something_else(call: Call, tmp_path: Path, text: str) -> None:
    assert "finger.json" in refused(call("check", described(tmp_path, text)), status=1)


def test_check_of_files_in_the_wrong_order_says_so(call: Call) -> None:
    answer = call("check", ROOT / "examples/demo_recording/two_joints_training.parquet", ROOT / "finger.json")
    assert answer.status == 2 and "a recording; expected the description first: check FINGER.json" in answer.err


def test_check_of_a_file_that_is_not_there(call: Call, tmp_path: Path) -> None:
    assert "absent.json" in refused(call("check", "absent.json"))
    assert str(tmp_path) in refused(call("check", tmp_path))


# --- build ------------------------------------------------------------------------------------------------------------


def test_build_writes_an_fmu(call: Call, tmp_path: Path) -> None:
    answer = call("build", INDEX_FINGER, "-o", "finger.fmu")
    assert answer.status == 0 and answer.out == ""
    with zipfile.ZipFile(tmp_path / "finger.fmu") as fmu:
        assert "modelDescription.xml" in fmu.namelist()
        assert fmu.read("resources/finger.json") == INDEX_FINGER.read_bytes()


def test_build_refuses_and_writes_nothing(call: Call, tmp_path: Path) -> None:
    (tmp_path / "old.fmu").write_text("old")
    described(tmp_path, {"format": "tendonfmu-finger-1"}, "bad.json")
    assert "bad.json" in refused(call("build", "bad.json", "-o", "old.fmu"))
    assert "absent.json" in refused(call("build", "absent.json", "-o", "new.fmu"))
    assert "nowhere" in refused(call("build", INDEX_FINGER, "-o", "nowhere/new.fmu"))
    assert (tmp_path / "old.fmu").read_text() == "old"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["bad.json", "old.fmu"]


def test_no_result_takes_the_place_of_what_it_is_made_from(
    call: Call, finger: tuple[Path, Path, dict[str, Any], dict[str, Any]], tmp_path: Path
) -> None:
    path, recording_path, *_ = finger
    (tmp_path / "link.csv").symlink_to(recording_path)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    for arguments in (
        ("build", path, "-o", path),
        ("run", path, recording_path, "-o", recording_path),
        ("run", path, recording_path, "-o", "link.csv"),
        ("convert", "davinci", recording_path, "-o", f"./{recording_path.name}"),
    ):
        assert "the same file as the input" in refused(call(*arguments))
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


# --- run --------------------------------------------------------------------------------------------------------------


def outputs_of(file: Path) -> dict[str, Any]:
    """The table that `run` wrote, as groups: name -> [N, ...]."""
    table = read_table(file, lambda *_: None)
    groups: dict[str, list[Any]] = {}
    for name, column in table.items():
        groups.setdefault(name.split("[")[0], []).append(column)
    found = {name: np.column_stack(columns) for name, columns in groups.items()}
    flags = {name: found[name].astype(bool) for name in ("joint_contact", "slack")}
    return found | flags | {"time": table["time"], "contact": table["contact"].astype(bool)}


def columns_of_section_4(joints: int, tendons: int) -> list[str]:
    per_joint = (
        "compensated_torque",
        "joint_torque",
        "friction_torque",
        "bias_torque",
        "joint_angle",
        "joint_speed",
        "compensated_torque_std",
        "joint_contact",
    )
    names = [f"{name}[{j}]" for name in per_joint for j in range(1, joints + 1)]
    return ["time", *names, "contact", *(f"slack[{i}]" for i in range(1, tendons + 1))]


@pytest.mark.parametrize("source", repeated([1, 2, 3], 0))
def test_run_gives_every_sample_at_its_own_time(
    call: Call, finger: tuple[Path, Path, dict[str, Any], dict[str, Any]], tmp_path: Path, source: int
) -> None:
    path, recording_path, description, recording = finger
    answer = call("run", path, recording_path, "-o", "out.csv", "--kinematics", str(source))
    assert answer.status == 0 and answer.out == ""
    header = (tmp_path / "out.csv").read_text().splitlines()[0].split(",")
    assert header == columns_of_section_4(len(description["joints"]), len(description["tendons"]))
    found = outputs_of(tmp_path / "out.csv")
    assert np.array_equal(found["time"], recording["time"])
    result = compare(oracle.run(description, recording, source).outputs, found)
    assert result.agrees, result


def test_measured_joints_are_used_only_when_asked_for(
    call: Call, finger: tuple[Path, Path, dict[str, Any], dict[str, Any]], tmp_path: Path
) -> None:
    path, recording_path, _, recording = finger
    less = {name: array for name, array in recording.items() if not name.startswith("joint_")}
    assert call("run", path, recording_path, "-o", "all.csv").status == 0
    assert call("run", path, recorded(tmp_path, less, "less.csv"), "-o", "less_out.csv").status == 0
    assert (tmp_path / "all.csv").read_bytes() == (tmp_path / "less_out.csv").read_bytes()
    assert "joint_position" in refused(call("run", path, "less.csv", "-o", "no.csv", "--kinematics", "2"))
    half = less | {"joint_position": recording["joint_position"]}
    recorded(tmp_path, half, "half.csv")
    assert "joint_velocity" in refused(call("run", path, "half.csv", "-o", "no.csv", "--kinematics", "3"))
    assert not (tmp_path / "no.csv").exists()


def test_run_reads_and_writes_parquet(
    call: Call, finger: tuple[Path, Path, dict[str, Any], dict[str, Any]], tmp_path: Path
) -> None:
    path, recording_path, _, recording = finger
    recorded(tmp_path, recording, "rec.parquet")
    assert call("run", path, recording_path, "-o", "a.csv").status == 0
    assert call("run", path, "rec.parquet", "-o", "b.parquet").status == 0
    a, b = outputs_of(tmp_path / "a.csv"), outputs_of(tmp_path / "b.parquet")
    assert a.keys() == b.keys()
    assert all(np.array_equal(a[name], b[name]) for name in a)


def test_a_recording_of_one_sample(
    call: Call, finger: tuple[Path, Path, dict[str, Any], dict[str, Any]], tmp_path: Path
) -> None:
    path, _, description, recording = finger
    one = {name: array[:1] for name, array in recording.items()}
    assert call("run", path, recorded(tmp_path, one, "one.csv"), "-o", "out.csv").status == 0
    expected = oracle.run(description, one, 1).outputs
    found = outputs_of(tmp_path / "out.csv")
    assert np.allclose(found["friction_torque"], expected["joint_torque"], atol=1e-12)


def test_run_refuses_by_name_and_writes_nothing(
    call: Call, finger: tuple[Path, Path, dict[str, Any], dict[str, Any]], tmp_path: Path
) -> None:
    path, recording_path, *_ = finger
    other = described(tmp_path, random_fingers.random_finger(8), "other.json")
    (tmp_path / "not.fmu").write_bytes(b"PK\x03\x04 no archive")
    (tmp_path / "note.txt").write_text("hello")
    with zipfile.ZipFile(tmp_path / "empty.fmu", "w") as archive:
        archive.writestr("readme.txt", "no FMU")
    before = sorted(file.name for file in tmp_path.iterdir())
    for model, recording, output, word in (
        ("absent.json", recording_path, "out.csv", "absent.json"),
        ("absent.fmu", recording_path, "out.csv", "absent.fmu"),
        ("not.fmu", recording_path, "out.csv", "not.fmu"),
        ("empty.fmu", recording_path, "out.csv", "empty.fmu"),
        ("note.txt", recording_path, "out.csv", "note.txt"),
        (recording_path, path, "out.csv", "expected FINGER.json or FINGER.fmu here"),
        ("empty.fmu", recording_path, "out.csv", "no modelDescription.xml"),
        (path, "absent.csv", "out.csv", "absent.csv"),
        (path, "note.txt", "out.csv", "note.txt"),
        (path, recording_path, "out.mat", "out.mat"),
        (path, recording_path, "nowhere/out.csv", "nowhere"),
        (other, recording_path, "out.csv", "rec.csv"),
    ):
        assert word in refused(call("run", model, recording, "-o", output))
    assert sorted(file.name for file in tmp_path.iterdir()) == before


def test_a_value_that_the_fmu_refuses_is_named_by_its_row(
    call: Call, finger: tuple[Path, Path, dict[str, Any], dict[str, Any]], tmp_path: Path
) -> None:
    path, _, _, recording = finger
    huge = {name: array.copy() for name, array in recording.items()}
    huge["tendon_force"][50, 0] = 1e30
    line = refused(call("run", path, recorded(tmp_path, huge, "huge.csv"), "-o", "out.csv"))
    for word in ("huge.csv", "row 51", "tendon_force[1] = 1e+30", "expected"):
        assert word in line


def test_run_says_how_long_and_how_far(
    call: Call, finger: tuple[Path, Path, dict[str, Any], dict[str, Any]], tmp_path: Path
) -> None:
    path, recording_path, _, recording = finger
    said = call("run", path, recording_path, "-o", "out.csv").err
    angles = outputs_of(tmp_path / "out.csv")["joint_angle"]
    time = recording["time"]
    assert f"{len(time)} samples in {time[-1] - time[0]:.6g} s" in said
    assert f"{angles.min():.3g} to {angles.max():.3g} rad" in said


def test_a_negative_time_and_a_late_start(
    call: Call, finger: tuple[Path, Path, dict[str, Any], dict[str, Any]], tmp_path: Path
) -> None:
    path, _, _, recording = finger
    late = dict(recording) | {"time": recording["time"] + 1e6}
    early = dict(recording) | {"time": recording["time"] - 1e3}
    for name, shifted in (("late", late), ("early", early)):
        assert call("run", path, recorded(tmp_path, shifted, f"{name}.csv"), "-o", f"{name}_out.csv").status == 0
        assert np.array_equal(outputs_of(tmp_path / f"{name}_out.csv")["time"], shifted["time"])


# --- nothing that a command reads is lost -----------------------------------------------------------------------


def test_build_keeps_what_a_rig_refers_to(call: Call, tmp_path: Path) -> None:
    """Its base, its finger and its motion file are inputs as well."""
    rigs = ROOT / "examples" / "rigs"
    finger = tmp_path / "finger.json"
    finger.write_bytes((rigs.parent / "fingers" / "index_finger.json").read_bytes())
    base = tmp_path / "base.json"
    base.write_text(json.dumps(json.loads((rigs / "index_finger.json").read_text()) | {"finger": "finger.json"}))
    rig = tmp_path / "rig.json"
    rig.write_text(json.dumps({"format": "tendonfmu-rig-1", "name": "own", "base": "base.json"}))
    for victim in (finger, base, rig):
        before = victim.read_bytes()
        for arguments in (
            ("build", rig, "-o", victim),
            ("excite", rig, "-o", "motion.csv", "--report", victim, "--duration", "5"),
        ):
            result = call(*map(str, arguments))
            assert result.status == 2 and "the same file as the input" in result.err
            assert victim.read_bytes() == before


def test_excite_keeps_motion_and_report_apart(call: Call, tmp_path: Path) -> None:
    result = call("excite", str(INDEX_FINGER), "-o", str(tmp_path / "m.csv"), "--report", str(tmp_path / "m.csv"))
    assert result.status == 2 and "the same file for motion and report" in result.err
    assert not (tmp_path / "m.csv").exists()


def test_outputs_replace_files_only(call: Call, tmp_path: Path) -> None:
    pipe, kept = tmp_path / "pipe.fmu", tmp_path / "kept.fmu"
    os.mkfifo(pipe)
    kept.write_text("kept")
    kept.chmod(0o444)
    for output, reason in ((pipe, "a device or pipe"), (kept, "read-only")):
        result = call("build", str(INDEX_FINGER), "-o", str(output))
        assert result.status == 2 and reason in result.err
    assert pipe.is_fifo() and kept.read_text() == "kept"


def test_fingers_and_rigs_are_told_apart(call: Call, tmp_path: Path) -> None:
    nameless = tmp_path / "nameless.json"
    nameless.write_text(json.dumps({"name": "x", "physics": {}}))
    for arguments, line in (
        (("excite", nameless, "-o", "m.csv"), "format: missing"),
        (("build", nameless, "-o", "x.fmu"), "format: missing"),
        (("simulate", INDEX_FINGER, "-o", "out.csv"), 'expected "tendonfmu-rig-1"'),
        (("check", nameless), "format: missing"),
    ):
        result = call(*map(str, arguments))
        assert result.status in (1, 2) and line in result.err, result.err
