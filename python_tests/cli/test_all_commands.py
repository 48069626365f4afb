"""What all commands have in common: options, exit status, one-line refusals, standard input and output, their files."""

from __future__ import annotations

import gzip
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import typer

import map_cases
from command import Answer, Call, DemoRun
from fmu_binary import FINGER
from plant_fmu_rig import fmu_rig
from repetitions import repeated
from repository_paths import ROOT
from tendonfmu.commands.program import app

GROUP: Any = typer.main.get_command(app)
COMMANDS = {name: GROUP.get_command(None, name) for name in GROUP.commands}
EXAMPLES = ROOT / "examples"

# Enough of each command that it starts, and what it calls first of the package, so that a test can make it fail.
CALLS = {
    "check": ("{finger}", "tendonfmu.model.read_finger"),
    "build": ("{finger} -o out.fmu", "tendonfmu.commands.build.build"),
    "run": ("{finger} {recording} -o out.csv", "tendonfmu.commands.run.run"),
    "simulate": ("{rig} -o out.csv", "tendonfmu.simulate.simulate"),
    "convert": ("emps {recording} -o out.csv", "tendonfmu.recordings.convert_file"),
    "import": ("mjcf {model} --joints hinge -o imported.json", "tendonfmu.mjcf.import_finger"),
    "export": ("mjcf {finger} {model} -o out.xml", "tendonfmu.mjcf.export_numbers"),
    "describe": (
        "joint --name servo --recording {recording} -o out.json",
        "tendonfmu.recordings.describe_recorded_joint",
    ),
    "excite": ("{finger} -o motion.csv --duration 20", "tendonfmu.excite.training_motion.excite"),
    "fit": ("{finger} {recording} -o fitted.json", "tendonfmu.commands.fit.fit"),
    "calibrate": ("{finger} {recording} -o calibration", "tendonfmu.calibration.calibrate"),
    "diagnose": ("{finger} {recording} -o diagnosis", "tendonfmu.commands.diagnose.diagnose"),
    "tune": ("{finger} {recording} -o tuned.json", "tendonfmu.commands.detection.tune"),
    "score": ("{finger} {recording} -o score.json", "tendonfmu.commands.detection.score"),
    "demo": ("-o demo", "tendonfmu.commands.demo.Story"),
}
LEARNING = ("fit", "calibrate", "diagnose", "tune")  # what takes seconds
QUICK = ("check", "build", "run", "simulate", "excite")  # the others are seen with --json where they are tested
FILES = {"finger": "finger.json", "rig": "rig.json", "recording": "recording.csv", "model": "model.xml"}
Feed = Callable[[bytes], None]


@pytest.fixture
def case(tmp_path: Path) -> Path:
    """A folder with `FILES`."""
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))
    (tmp_path / "rig.json").write_text(json.dumps(fmu_rig()))
    (tmp_path / "model.xml").write_text("<mujoco/>")
    tendons = range(1, len(FINGER["tendons"]) + 1)
    names = ["time", *(f"tendon_{key}[{i}]" for key in ("force", "position") for i in tendons)]
    rows = [[0.01 * k, *(5.0 for _ in tendons), *(1e-4 * k for _ in tendons)] for k in range(50)]
    lines = [",".join(names), *(",".join(map(repr, row)) for row in rows)]
    (tmp_path / "recording.csv").write_text("\n".join(lines) + "\n")
    return tmp_path


@pytest.fixture
def feed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Feed:
    """Puts bytes on standard input."""

    def put(content: bytes) -> None:
        (tmp_path / "fed").write_bytes(content)
        monkeypatch.setattr(sys, "stdin", (tmp_path / "fed").open(encoding="utf-8"))

    return put


def words(name: str, files: dict[str, str] = FILES) -> list[str]:
    return [name, *CALLS[name][0].format(**files).split()]


def refused(answer: Answer, status: int = 2) -> str:
    """The one line of a refusal; nothing on standard output."""
    assert answer.status == status and answer.out == "" and answer.err.count("\n") == 1, answer
    assert answer.err.startswith("tendonfmu: ")
    return answer.err


# --- options and exit status ------------------------------------------------------------------------------------------


def test_version_and_help(call: Call) -> None:
    assert call("--version") == call("-V") == Answer(0, f"tendonfmu {version('tendonfmu')}\n", "")
    assert call("--help") == call("-h") == call("help") and all(f"  {name} " in call("-h").out for name in COMMANDS)
    assert call().status == 2


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_has_help_and_the_common_options(call: Call, name: str) -> None:
    assert call(name, "-h") == call(name, "--help") == call("help", name)
    options = {word: each for each in COMMANDS[name].params for word in (*each.opts, *each.secondary_opts)}
    assert options["-q"] is options["--quiet"] and "--json" in options
    assert {word for word, each in options.items() if "processor" in (each.help or "")} <= {"--jobs"}
    assert all(each.help for word, each in options.items() if word.startswith("-") and word not in ("-h", "--help"))


@pytest.mark.parametrize("name", repeated(COMMANDS, *(k for k, name in enumerate(COMMANDS) if name not in LEARNING)))
def test_the_example_of_its_help_runs(call: Call, tmp_path: Path, demo_run: DemoRun, name: str) -> None:
    (tmp_path / "tendonfmu-demo").symlink_to(demo_run.folder)
    (tmp_path / "examples").symlink_to(EXAMPLES)
    line = call(name, "--help").out.partition("Example:\n")[2].strip()
    program, command, *given = shlex.split(line)
    assert (program, command) == ("tendonfmu", name)
    if name != "demo":  # which has run
        answer = call(name, *given)
        assert answer.status == 0, answer


@pytest.mark.parametrize("name", COMMANDS)
def test_exit_status(call: Call, case: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """2 for bad usage and a missing file, 3 for a fault of tendonfmu, 130 for an interruption."""
    assert f"tendonfmu {name} --help" in refused(call(*words(name), "--no-such-option"))
    (case / "taken").write_text("a file")
    absent = words(name, {key: f"absent{Path(file).suffix}" for key, file in FILES.items()})
    line = refused(call(*(["demo", "-o", "taken"] if name == "demo" else absent)))
    assert line.startswith(f"tendonfmu: {'taken' if name == 'demo' else 'absent'}")
    for raised, status, said in (
        (RuntimeError("lost"), 3, "internal error"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ):

        def fail(*_: Any, raised: BaseException = raised, **__: Any) -> Any:
            raise raised

        monkeypatch.setattr(CALLS[name][1], fail)
        answer = call(*words(name))
        assert answer.status == status and answer.err.splitlines()[-1].startswith(f"tendonfmu: {said}")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("dance", ["dance"]),
        ("check", ["FINGER.json"]),
        ("build a.json", ["--output"]),
        ("run a.json -o out.csv", ["RECORDING"]),
        ("run a.json rec.csv -o out.csv --kinematics 4", ["--kinematics", "3"]),
        ("run a.json rec.csv -o out.csv --kinematics one", ["--kinematics", "integer"]),
        ("convert davinci f -o r.csv --radius -1", ["--radius", "0.000001"]),
        ("convert sputnik f -o r.csv", ["sputnik", "davinci"]),
    ],
)
def test_bad_usage_is_one_line(call: Call, arguments: str, said: list[str]) -> None:
    line = refused(call(*arguments.split()))
    assert all(word in line for word in said), line


@pytest.mark.parametrize("name", QUICK)
def test_quiet_prints_nothing_and_json_is_all_that_is_printed(call: Call, case: Path, name: str) -> None:
    told = call(*words(name))
    assert told.status == 0 and told.out + told.err
    before = {file.name: file.read_bytes() for file in case.iterdir()}
    assert call(*words(name), "--quiet") == Answer(0, "", "")
    assert {file.name: file.read_bytes() for file in case.iterdir()} == before
    answer = call(*words(name), "--json", "-q")
    assert (answer.status, answer.err) == (0, "")
    assert re.fullmatch(r"tendonfmu-[a-z-]+-\d", json.loads(answer.out)["format"])


def test_check_answers_by_its_status(call: Call, case: Path) -> None:
    """0 and 1 are answers, with --json too; what cannot be answered is 2."""
    (case / "unsound.json").write_text(json.dumps({**FINGER, "tendons": []}))
    plain, told = call("check", "unsound.json", "-q"), call("check", "unsound.json", "--json", "-q")
    report = json.loads(told.out)
    assert refused(plain, 1) == told.err == f"tendonfmu: {report['reason']}\n" and report["sound"] is False
    for text in ("", "{", "[]", '{"a": 1, "a": 2}', "\x00"):
        (case / "other.json").write_text(text)
        assert "other.json" in refused(call("check", "other.json"), 1)
    assert refused(call("check", "absent.json")) and refused(call("check", case))
    training = EXAMPLES / "demo_recording/two_joints_training.parquet"
    assert "expected the description first: check FINGER.json" in call("check", training, "finger.json").err
    plain, told = call("check", "finger.json", "recording.csv"), call("check", "finger.json", "recording.csv", "--json")
    (found,) = json.loads(told.out)["recordings"]
    assert plain.status == told.status == (0 if found["belongs"] else 1) and found["samples"] == 50
    assert all(finding["line"] in plain.out for finding in found["findings"])


# --- files ------------------------------------------------------------------------------------------------------------


def test_refusals_name_the_file_and_write_nothing(call: Call, case: Path) -> None:
    (case / "not.fmu").write_bytes(b"PK\x03\x04 no archive")
    (case / "note.txt").write_text("hello")
    (case / "nameless.json").write_text(json.dumps({"name": "x", "physics": {}}))
    (case / "kept.fmu").write_text("kept")
    (case / "kept.fmu").chmod(0o444)
    os.mkfifo(case / "pipe.fmu")
    (case / "link.csv").symlink_to("recording.csv")
    (case / "huge.csv").write_text((case / "recording.csv").read_text().replace("5.0", "1e30", 1))
    before = {file: file.read_bytes() for file in case.iterdir() if not file.is_fifo()}
    for arguments, said in (
        ("build absent.json -o new.fmu", "absent.json"),
        ("build nameless.json -o new.fmu", "format: missing"),
        ("build finger.json -o nowhere/new.fmu", "nowhere"),
        ("build finger.json -o kept.fmu", "read-only"),
        ("build finger.json -o pipe.fmu", "a device or pipe"),
        ("build finger.json -o finger.json", "the same file as the input"),
        ("build rig.json -o rig.json", "the same file as the input"),
        ("run finger.json recording.csv -o recording.csv", "the same file as the input"),
        ("run finger.json recording.csv -o link.csv", "the same file as the input"),
        ("convert davinci recording.csv -o ./recording.csv", "the same file as the input"),
        ("run absent.fmu recording.csv -o out.csv", "absent.fmu"),
        ("run not.fmu recording.csv -o out.csv", "not.fmu"),
        ("run note.txt recording.csv -o out.csv", "note.txt"),
        ("run recording.csv finger.json -o out.csv", "expected FINGER.json or FINGER.fmu here"),
        ("run finger.json note.txt -o out.csv", "note.txt"),
        ("run finger.json recording.csv -o out.mat", "out.mat"),
        ("run finger.json huge.csv -o out.csv", "huge.csv: row 1: tendon_force[1] = 1e+30"),
        ("run finger.json recording.csv -o out.csv --kinematics 2", "joint_position"),
        ("excite finger.json -o m.csv --report m.csv", "the same file for motion and report"),
        ("excite nameless.json -o m.csv", "format: missing"),
        ("simulate finger.json -o out.csv", 'expected "tendonfmu-rig-1"'),
    ):
        line = refused(call(*arguments.split()))
        assert said in line, line
    assert {file: file.read_bytes() for file in case.iterdir() if not file.is_fifo()} == before


def test_what_a_rig_refers_to_is_not_overwritten(call: Call, tmp_path: Path) -> None:
    """Its base and its finger are inputs as well."""
    finger, base, rig = (tmp_path / name for name in ("finger.json", "base.json", "rig.json"))
    finger.write_bytes((EXAMPLES / "fingers/index_finger.json").read_bytes())
    base.write_text(json.dumps(json.loads((EXAMPLES / "rigs/index_finger.json").read_text()) | {"finger": finger.name}))
    rig.write_text(json.dumps({"format": "tendonfmu-rig-1", "name": "own", "base": "base.json"}))
    for victim in (finger, base, rig):
        before = victim.read_bytes()
        assert "the same file as the input" in refused(call("build", rig, "-o", victim))
        excited = call("excite", rig, "-o", "motion.csv", "--report", victim, "--duration", "5")
        assert "the same file as the input" in refused(excited) and victim.read_bytes() == before


# --- standard input and output ----------------------------------------------------------------------------------------


def test_recording_finger_and_fmu_come_from_standard_input(call: Call, feed: Feed, case: Path) -> None:
    from tendonfmu.files.tables import read_table, write_table

    write_table(case / "recording.parquet", read_table(case / "recording.csv", lambda *_: None))
    assert call("build", "finger.json", "-o", "finger.fmu").status == 0
    assert call("run", "finger.json", "recording.csv", "-o", "file.csv").status == 0
    for fed, model, recording in (
        ("recording.csv", "finger.json", "-"),
        ("recording.parquet", "finger.json", "-"),
        ("finger.json", "-", "recording.csv"),
        ("finger.fmu", "-", "recording.csv"),
    ):
        feed((case / fed).read_bytes())
        assert call("run", model, recording, "-o", "piped.csv").status == 0
        assert (case / "piped.csv").read_bytes() == (case / "file.csv").read_bytes()
    feed((case / "recording.csv").read_bytes().replace(b"5.0", b"five", 1))
    assert refused(call("run", "finger.json", "-", "-o", "o.csv")).startswith("tendonfmu: standard_input.csv: column")


@pytest.mark.parametrize("packed", [False, True])
def test_a_log_is_converted_in_a_pipe(call: Call, feed: Feed, tmp_path: Path, packed: bool) -> None:
    log, _ = map_cases.written(tmp_path)
    assert call("convert", "table", str(log), "--map", "map.json", "-o", "file.csv").status == 0
    feed(gzip.compress(log.read_bytes()) if packed else log.read_bytes())
    answer = call("convert", "table", "-", "--map", "map.json", "-o", "-")
    assert answer.status == 0 and answer.out == (tmp_path / "file.csv").read_text("utf-8")
    feed(log.read_bytes())
    assert call("convert", "inspect", "-", "-o", "proposed.json").status == 0
    assert json.loads((tmp_path / "proposed.json").read_text("utf-8"))["format"] == "tendonfmu-map-1"


@pytest.mark.parametrize(
    "arguments",
    ["run - - -o out.csv", "fit finger.json - - -o fitted.json", "tune - recording.csv - -o tuned.json"],
)
def test_standard_input_is_read_once(call: Call, feed: Feed, case: Path, arguments: str) -> None:
    feed(b"{}")
    assert "-: given 2 times, for " in refused(call(*arguments.split()))
    feed(b" \n")
    assert "standard input is empty" in call("check", "-").err


@pytest.mark.parametrize(
    "name", ["run", "simulate", "excite", "build", "fit", "tune", "score", "diagnose", "calibrate", "demo"]
)
def test_tables_go_to_standard_output_and_nothing_else_does(call: Call, case: Path, name: str) -> None:
    arguments = words(name)
    at = arguments.index("-o") + 1
    file, arguments[at] = arguments[at], "-"
    if name in ("run", "simulate", "excite"):
        assert call(*words(name), "-q").status == 0
        assert call(*arguments, "-q") == Answer(0, (case / file).read_text(encoding="utf-8"), "")
        assert "--output -: given with --json" in refused(call(*arguments, "--json"))
    else:
        assert refused(call(*arguments)).startswith("tendonfmu: -: ")
    assert not (case / "-").exists()


def test_a_reader_that_leaves_ends_nothing(case: Path) -> None:
    """As in `tendonfmu run ... -o - | head -1`: no message, and done."""
    command = [sys.executable, "-m", "tendonfmu", "simulate", "rig.json", "-o", "-", "-q"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, cwd=case) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b"" and process.wait(60) == 0


# --- imports ----------------------------------------------------------------------------------------------------------


HEAVY = {"dask", "fmpy", "jinja2", "lxml", "mcap", "mujoco", "pandas", "pint", "plotly", "pyarrow",
         "scipy"}  # fmt: skip
START = """
import contextlib, io, json, sys
import tendonfmu
before = sorted(sys.modules)
from tendonfmu.commands import program
with contextlib.redirect_stdout(io.StringIO()):
    for name in sys.argv[1:]:
        with contextlib.suppress(SystemExit):
            program.app([name, "--help"], standalone_mode=False)
print(json.dumps([before, sorted(sys.modules)]))
"""


def test_package_and_help_import_nothing_heavy() -> None:
    """A user waits for each import; for help that is most of the time."""
    done = subprocess.run([sys.executable, "-c", START, *COMMANDS], capture_output=True, text=True, check=True)
    package, help_of_all = ({name.partition(".")[0] for name in names} for names in json.loads(done.stdout))
    assert "tendonfmu" in package and package & (HEAVY | {"numpy", "typer", "rich"}) == set()
    assert "typer" in help_of_all and help_of_all & HEAVY == set()
