"""What all commands have in common: -h, --quiet, --json, --no-progress, --jobs, `-`, help of 80 columns, status."""

from __future__ import annotations

import gzip
import inspect
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer

import map_cases
from command import Answer, Call
from fmu_binary import FINGER
from plant_fmu_rig import fmu_rig
from repository_paths import ROOT
from tendonfmu.cli.program import app
from tendonfmu.files import by_kind

GROUP: Any = typer.main.get_command(app)
COMMANDS = dict(GROUP.commands)
PAGE = (ROOT / "docs" / "reference" / "commands" / "README.md").read_text(encoding="utf-8")
COLUMNS = 80

# Enough of each command that it starts; {finger} and the others are files of `case`.
CALLS = {
    "check": ["{finger}"],
    "build": ["{finger}", "-o", "out.fmu"],
    "run": ["{finger}", "{recording}", "-o", "out.csv"],
    "simulate": ["{rig}", "-o", "out.csv"],
    "convert": ["emps", "{recording}", "-o", "out.csv"],
    "import": ["mjcf", "{model}", "--joints", "hinge", "-o", "imported.json"],
    "export": ["mjcf", "{finger}", "{model}", "-o", "out.xml"],
    "describe": ["joint", "--name", "servo", "--recording", "{recording}", "-o", "out.json"],
    "excite": ["{finger}", "-o", "motion.csv", "--duration", "20"],
    "fit": ["{finger}", "{recording}", "-o", "fitted.json"],
    "calibrate": ["{finger}", "{recording}", "-o", "calibration"],
    "diagnose": ["{finger}", "{recording}", "-o", "diagnosis"],
    "tune": ["{finger}", "{recording}", "-o", "tuned.json"],
    "score": ["{finger}", "{recording}", "-o", "score.json"],
    "demo": ["-o", "demo"],
}
# What each command calls first of the package, so that a test can make it fail.
FIRST = {
    "check": "tendonfmu.model.read_finger",
    "build": "tendonfmu.interface.build",
    "run": "tendonfmu.interface.run",
    "simulate": "tendonfmu.simulate.simulate",
    "convert": "tendonfmu.recordings.convert_file",
    "import": "tendonfmu.mjcf.import_finger",
    "export": "tendonfmu.mjcf.export_numbers",
    "describe": "tendonfmu.recordings.describe_recorded_joint",
    "excite": "tendonfmu.excite.training_motion.excite",
    "fit": "tendonfmu.interface.fit",
    "calibrate": "tendonfmu.calibration.calibrate",
    "diagnose": "tendonfmu.interface.diagnose",
    "tune": "tendonfmu.interface.tune",
    "score": "tendonfmu.interface.score",
    "demo": "tendonfmu.demo.Story",
}
QUICK = ("check", "build", "run", "simulate", "excite")  # the others are seen with --json where they are tested
every_command = pytest.mark.parametrize("name", COMMANDS)


def options_of(name: str) -> dict[str, Any]:
    """Every option of a command by each of its names."""
    return {word: each for each in COMMANDS[name].params for word in (*each.opts, *each.secondary_opts)}


@pytest.fixture
def case(tmp_path: Path) -> dict[str, str]:
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))
    (tmp_path / "rig.json").write_text(json.dumps(fmu_rig()))
    (tmp_path / "model.xml").write_text("<mujoco/>")
    tendons = range(1, len(FINGER["tendons"]) + 1)
    names = ["time", *(f"tendon_{key}[{i}]" for key in ("force", "position") for i in tendons)]
    rows = [[0.01 * k, *(5.0 for _ in tendons), *(1e-4 * k for _ in tendons)] for k in range(50)]
    lines = [",".join(names), *(",".join(map(repr, row)) for row in rows)]
    (tmp_path / "recording.csv").write_text("\n".join(lines) + "\n")
    files = {"finger": "finger.json", "rig": "rig.json", "recording": "recording.csv"}
    return {**files, "model": "model.xml"}


def words(name: str, case: dict[str, str]) -> list[str]:
    return [name, *(word.format(**case) for word in CALLS[name])]


# --- options and help -------------------------------------------------------------------------------------------------


def test_the_calls_are_of_all_commands() -> None:
    assert set(CALLS) == set(FIRST) == set(COMMANDS)
    assert all(f"`{name}" in PAGE or f"[`{name}`]" in PAGE for name in COMMANDS)


@every_command
def test_every_command_has_the_common_options(name: str) -> None:
    options, source = options_of(name), inspect.getsource(inspect.unwrap(COMMANDS[name].callback))
    assert options["-q"] is options["--quiet"] and "--json" in options
    if "progress_bar(" in source or "PhaseDisplay(" in source:
        assert options["--progress"] is options["--no-progress"]
    computing = {word for word, each in options.items() if "processor" in (each.help or "")}
    assert computing <= {"--jobs"}
    assert not {"--workers", "--threads", "--processes", "--verbose", "--silent"} & set(options)
    assert "print_json(" in source or name == "diagnose"


@every_command
def test_help_is_readable_at_80_columns(call: Call, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    short, long = call(name, "-h"), call(name, "--help")
    assert short == long and short.status == 0 and short.err == ""
    lines = short.out.splitlines()
    assert max(map(len, lines)) <= COLUMNS
    assert "…" not in short.out and "\\" not in short.out
    text = " ".join(short.out.split())
    for word, each in options_of(name).items():
        if word.startswith("-"):
            assert re.search(rf"(?<![\w-]){re.escape(word)}(?![\w-])", text), word
            assert word in ("-h", "--help") or (each.help and each.help[0] != " "), word


def test_the_list_of_commands_is_readable_at_80_columns(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    answer = call("-h")
    assert answer == call("--help") and answer.status == 0
    assert max(map(len, answer.out.splitlines())) <= COLUMNS and all(f"  {name} " in answer.out for name in COMMANDS)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_has_a_script_for_each_shell(shell: str) -> None:
    # by default the shell is that of the caller
    environment = {**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    command = [sys.executable, "-m", "tendonfmu.cli", "--show-completion", shell]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert "_TENDONFMU_COMPLETE" in done.stdout and f"complete_{shell}" in done.stdout
    assert "tendonfmu" in done.stdout and done.stderr == ""


def test_completion_knows_commands_and_options() -> None:
    def completed(line: str) -> list[str]:
        told = {"_TENDONFMU_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}
        command = [sys.executable, "-m", "tendonfmu.cli"]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **told})
        return done.stdout.split()

    assert completed("tendonfmu ca") == ["calibrate"]
    assert completed("tendonfmu diagnose --j") == ["--json", "--jobs"] or set(completed("tendonfmu diagnose --j")) == {
        "--jobs",
        "--json",
    }


# --- what is printed --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", QUICK)
def test_quiet_prints_nothing_and_writes_the_same(call: Call, case: dict[str, str], tmp_path: Path, name: str) -> None:
    told = call(*words(name, case))
    assert told.status == 0 and (told.out + told.err)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    shown = ["--progress"] if "--progress" in options_of(name) else []
    assert call(*words(name, case), "--quiet", *shown) == Answer(0, "", "")
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


@pytest.mark.parametrize("name", QUICK)
def test_json_is_all_that_standard_output_holds(call: Call, case: dict[str, str], name: str) -> None:
    answer = call(*words(name, case), "--json")
    report = json.loads(answer.out)
    assert answer.status == 0 and re.fullmatch(r"tendonfmu-[a-z-]+-\d", report["format"])
    assert f"`{report['format']}`" in PAGE
    assert call(*words(name, case), "--json", "-q") == Answer(0, answer.out.replace(" --json", " --json -q"), "")


def test_quiet_and_json_leave_errors_and_status_alone(call: Call, case: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "unsound.json").write_text(json.dumps({**FINGER, "tendons": []}))
    plain = call("check", "unsound.json")
    assert plain.status == 1 and plain.out == "" and plain.err.startswith("tendonfmu: unsound.json: ")
    assert call("check", "unsound.json", "--quiet") == plain
    told = call("check", "unsound.json", "--json", "--quiet")
    assert (told.status, told.err) == (1, plain.err)
    report = json.loads(told.out)
    assert report["sound"] is False and plain.err == f"tendonfmu: {report['reason']}\n"
    assert call("check", "absent.json", "--json").out == ""


def test_json_of_check_tells_which_recording_belongs(call: Call, case: dict[str, str]) -> None:
    plain, told = call("check", "finger.json", "recording.csv"), call("check", "finger.json", "recording.csv", "--json")
    (found,) = json.loads(told.out)["recordings"]
    assert plain.status == told.status == (0 if found["belongs"] else 1)
    assert found["verdict"] in plain.out and found["samples"] == 50
    assert all(finding["line"] in plain.out for finding in found["findings"])


def test_a_warning_has_the_same_form_everywhere() -> None:
    """No command writes the words itself: `console.warn` does, and so does `console.fail` for errors."""
    for file in (ROOT / "python" / "tendonfmu" / "cli").glob("*.py"):
        if file.name != "console.py":
            assert not re.search(r"say\(f?\"tendonfmu: ", file.read_text(encoding="utf-8")), file.name


# --- exit status ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", COMMANDS)
def test_bad_usage_is_2(call: Call, case: dict[str, str], name: str) -> None:
    answer = call(*words(name, case), "--no-such-option")
    assert answer.status == 2 and answer.out == "" and answer.err.count("\n") == 1
    assert "--no-such-option" in answer.err and f"tendonfmu {name} --help" in answer.err


@pytest.mark.parametrize("name", COMMANDS)
def test_a_missing_file_is_2(call: Call, case: dict[str, str], tmp_path: Path, name: str) -> None:
    (tmp_path / "taken").write_text("a file")
    absent = {key: f"absent{Path(file).suffix}" for key, file in case.items()}
    answer = call("demo", "-o", "taken") if name == "demo" else call(*words(name, absent))
    assert answer.status == 2 and answer.out == "" and answer.err.count("\n") == 1, answer
    assert answer.err.startswith(f"tendonfmu: {'taken' if name == 'demo' else 'absent'}")


@pytest.mark.parametrize(
    ("raised", "status"), [(RuntimeError("lost"), 3), (KeyboardInterrupt(), 130)], ids=["3", "130"]
)
@pytest.mark.parametrize("name", COMMANDS)
def test_a_fault_is_3_and_an_interruption_130(
    call: Call, monkeypatch: pytest.MonkeyPatch, case: dict[str, str], name: str, raised: BaseException, status: int
) -> None:
    def fail(*_: Any, **__: Any) -> Any:
        raise raised

    monkeypatch.setattr(FIRST[name], fail)
    answer = call(*words(name, case))
    assert answer.status == status and answer.err.splitlines()[-1].startswith(
        "tendonfmu: internal error" if status == 3 else "tendonfmu: interrupted"
    )


def page_of(name: str) -> str:
    """What the reference says of a command: its row in the list, the pages named there, and what all have in common."""
    (row,) = re.findall(rf"^\| .*`{name}\b.*$", PAGE.partition("## Options")[0], re.MULTILINE)
    folder = ROOT / "docs" / "reference" / "commands"
    pages = [(folder / link).read_text("utf-8") for link in re.findall(r"\]\(([^)#]+\.md)", row)]
    return "\n".join([row, *pages, PAGE.partition("## Options")[2]])


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_is_in_the_reference(name: str) -> None:
    page = page_of(name)
    options = [option for each in COMMANDS[name].params for option in (*each.opts, *each.secondary_opts)]
    missing = [option for option in options if option.startswith("-") and not re.search(rf"(?<![\w-]){option}\b", page)]
    assert not missing


def test_the_page_has_every_status() -> None:
    assert [int(number) for number in re.findall(r"^\| (\d+) \|", PAGE, re.MULTILINE)] == [0, 1, 2, 3, 130, 143, 129]


# --- standard input and output ----------------------------------------------------------------------------------------

Feed = Callable[[bytes], None]


@pytest.fixture
def feed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Feed:
    """Puts bytes on standard input."""

    def put(content: bytes) -> None:
        (tmp_path / "fed").write_bytes(content)
        monkeypatch.setattr(sys, "stdin", (tmp_path / "fed").open(encoding="utf-8"))

    return put


def test_a_recording_and_a_finger_come_from_standard_input(
    call: Call, feed: Feed, case: dict[str, str], tmp_path: Path
) -> None:
    assert call("run", "finger.json", "recording.csv", "-o", "file.csv").status == 0
    feed((tmp_path / "recording.csv").read_bytes())
    assert call("run", "finger.json", "-", "-o", "piped.csv").status == 0
    feed((tmp_path / "finger.json").read_bytes())
    assert call("run", "-", "recording.csv", "-o", "finger.csv").status == 0
    assert call("build", "finger.json", "-o", "finger.fmu").status == 0
    feed((tmp_path / "finger.fmu").read_bytes())
    assert call("run", "-", "recording.csv", "-o", "fmu.csv").status == 0
    expected = (tmp_path / "file.csv").read_bytes()
    assert [(tmp_path / f"{name}.csv").read_bytes() == expected for name in ("piped", "finger", "fmu")] == [True] * 3


def test_parquet_comes_from_standard_input(call: Call, feed: Feed, case: dict[str, str], tmp_path: Path) -> None:
    from tendonfmu.files.tables import read_table, write_table

    write_table(tmp_path / "recording.parquet", read_table(tmp_path / "recording.csv", lambda *_: None))
    feed((tmp_path / "recording.parquet").read_bytes())
    assert call("run", "finger.json", "-", "-o", "piped.csv").status == 0
    assert call("run", "finger.json", "recording.csv", "-o", "file.csv").status == 0
    assert (tmp_path / "piped.csv").read_bytes() == (tmp_path / "file.csv").read_bytes()


@pytest.mark.parametrize("packed", [False, True])
def test_a_log_is_converted_in_a_pipe(call: Call, feed: Feed, tmp_path: Path, packed: bool) -> None:
    log, _ = map_cases.written(tmp_path)
    assert call("convert", "table", str(log), "--map", "map.json", "-o", "file.csv").status == 0
    feed(gzip.compress(log.read_bytes()) if packed else log.read_bytes())
    answer = call("convert", "table", "-", "--map", "map.json", "-o", "-")
    assert answer.status == 0 and answer.out == (tmp_path / "file.csv").read_text("utf-8")
    assert answer.err.splitlines()[-1].startswith("standard output: 3 samples")
    feed(log.read_bytes())
    assert call("convert", "inspect", "-", "-o", "proposed.json").status == 0
    assert json.loads((tmp_path / "proposed.json").read_text("utf-8"))["format"] == "tendonfmu-map-1"


def test_messages_and_reports_name_standard_input(call: Call, feed: Feed, case: dict[str, str], tmp_path: Path) -> None:
    feed((tmp_path / "recording.csv").read_bytes().replace(b"5.0", b"five", 1))
    answer = call("run", "finger.json", "-", "-o", "out.csv")
    assert answer.status == 2 and answer.err.startswith("tendonfmu: standard_input.csv: column tendon_force[1], row 1")
    feed((tmp_path / "recording.csv").read_bytes())
    assert json.loads(call("run", "finger.json", "-", "-o", "o.csv", "--json").out)["recording"] == "standard_input.csv"
    feed((tmp_path / "finger.json").read_bytes())
    assert json.loads(call("check", "-", "--json").out)["file"] == "standard_input.json"


def test_standard_input_is_read_once(call: Call, feed: Feed, case: dict[str, str], tmp_path: Path) -> None:
    feed(b"{}")
    for arguments, where in (
        (("run", "-", "-", "-o", "out.csv"), "model and recording"),
        (("fit", "finger.json", "-", "-", "-o", "fitted.json"), "recordings"),
        (("tune", "-", "recording.csv", "-", "-o", "tuned.json"), "finger and recordings"),
    ):
        answer = call(*arguments)
        assert (answer.status, answer.out) == (2, "")
        assert answer.err == f"tendonfmu: -: given 2 times, for {where}; standard input can be read once\n"
    feed(b" \n")
    assert "standard input is empty" in call("check", "-").err


@pytest.mark.parametrize("name", ["run", "simulate", "excite"])
def test_a_table_goes_to_standard_output(call: Call, case: dict[str, str], tmp_path: Path, name: str) -> None:
    to_file = call(*words(name, case))
    arguments = words(name, case)
    file = tmp_path / arguments[arguments.index("-o") + 1]
    arguments[arguments.index("-o") + 1] = "-"
    answer = call(*arguments)
    assert answer.status == 0 and answer.out == file.read_text(encoding="utf-8")
    assert answer.err.splitlines()[-1] == to_file.err.splitlines()[-1].replace(file.name, "standard output")
    assert call(*arguments, "-q") == Answer(0, answer.out, "")
    both = call(*arguments, "--json")
    assert both.status == 2 and both.out == "" and "--output -: given with --json" in both.err


@pytest.mark.parametrize("name", ["build", "fit", "tune", "score", "diagnose", "calibrate", "demo"])
def test_other_outputs_do_not_go_to_standard_output(
    call: Call, case: dict[str, str], tmp_path: Path, name: str
) -> None:
    arguments = words(name, case)
    arguments[arguments.index("-o") + 1] = "-"
    answer = call(*arguments)
    assert (answer.status, answer.out) == (2, "") and answer.err.startswith("tendonfmu: -: ")
    assert not (tmp_path / "-").exists()


def test_a_reader_that_leaves_ends_nothing(case: dict[str, str], tmp_path: Path) -> None:
    """As in `tendonfmu run ... -o - | head -1`: no message, and done."""
    command = [sys.executable, "-m", "tendonfmu.cli", "simulate", "rig.json", "-o", "-", "-q"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, cwd=tmp_path) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b"" and process.wait(60) == 0


# --- asking for help --------------------------------------------------------------------------------------------------


def test_help_and_version_by_other_names(call: Call) -> None:
    assert call("help").out == call("--help").out and call("help", "fit").out == call("fit", "--help").out
    assert call("-V").out == call("--version").out
    module = subprocess.run([sys.executable, "-m", "tendonfmu", "-V"], capture_output=True, text=True, check=True)
    assert module.stdout == call("--version").out


def test_summaries_of_commands_are_whole(call: Call) -> None:
    commands = call("--help").out.partition("Commands:")[2]
    assert commands.count("\n") > 14 and "..." not in commands and "…" not in commands


def test_warnings_of_a_kind_are_one_line() -> None:
    """A page began with twelve, one for each tendon and file."""
    rest = "probably numbers that nobody measured; tendonfmu calibrate learns them"
    alike = [
        f"{file}: tendon_position[{i}]: zero is off by 0.{i} mm; {rest}" for file in ("a.csv", "b.csv") for i in (1, 2)
    ]
    alone = ["c.csv: time: 1 gap, the first of 0.7 s; probably an interrupted log; split it there"]
    counts = ["d.csv: 5 numbers at a bound", "e.csv: 7 numbers at a bound"]
    kinds = by_kind([*alike, *alone, *counts, *alike])
    assert [sentences for _, sentences in kinds] == [alike, alone, counts]
    first, second, third = (words for words, _ in kinds)
    assert first == f"tendon_position[1], tendon_position[2]: 2 columns of 2 files: {rest}"
    assert second == alone[0] and third == f"{counts[0]} (and 1 more of this kind)"
