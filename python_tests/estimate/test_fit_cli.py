"""The command `tendonfmu fit` as a user calls it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import zipfile
from importlib.resources import files as files_of
from pathlib import Path

import jsonschema
import pytest

from command import Answer, Call
from fit_cases import small_finger
from fit_finger import made_recording, moved_start, write_recording
from repetitions import repeated
from repository_paths import ROOT
from tendonfmu.estimate.structure import get_number

pytest.importorskip("tendonfmu._estimation", reason="SKIPPED: built without Eigen, nothing can be estimated")

INDEX = ROOT / "examples" / "fingers" / "index_finger.json"
DEMO = ROOT / "examples" / "demo_recording"
FIT = ("--share", "tendons", "--kinematics", "3")


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    finger = tmp_path / "finger.json"
    finger.write_text(json.dumps(moved_start()))
    return finger, write_recording(made_recording(duration=30.0), tmp_path / "rec.parquet")


def test_a_fit_writes_a_description_and_a_report(call: Call, files: tuple[Path, Path]) -> None:
    finger, recording = files
    answer = call("fit", finger, recording, "-o", "fitted.json", "--report", "r.json", "--holdout", "0.2", *FIT)
    assert answer.status == 0
    assert answer.err.splitlines()[0] == "fitted.json: 70 numbers estimated" and answer.err.count("\n") == 2
    report = json.loads(Path("r.json").read_text())
    assert report["format"] == "tendonfmu-fit-1" and report["method"] == "batch"
    assert report["converged"] and report["finished"]
    assert report["options"]["share"] == ["tendons"] and report["options"]["holdout"] == 0.2
    assert report["recordings"][0]["used"] + report["recordings"][0]["held_out"] == report["recordings"][0]["samples"]
    fitted = json.loads(Path("fitted.json").read_text())
    for parameter in report["parameters"]:
        assert get_number(fitted, parameter["path"]) == parameter["value"]
        assert parameter["identified"] == (parameter["standard_error"] <= 0.3 * abs(parameter["value"]))
        assert (parameter["reason"] is None) == parameter["identified"] == (parameter["advice"] is None)
    unknowns = len(report["correlation"]["paths"])
    assert "joints[1].friction.rate" in report["correlation"]["paths"]
    assert len(report["correlation"]["matrix"]) == unknowns == len(report["correlation"]["matrix"][0]) == 25
    assert "held out" in answer.out and "batch: converged" in answer.out
    assert call("check", "fitted.json").status == 0
    assert call("run", "fitted.json", recording, "-o", "out.csv", "--kinematics", "3").status == 0


def test_a_fit_writes_a_parameter_set_that_an_fmu_carries(call: Call, files: tuple[Path, Path]) -> None:
    finger, recording = files
    refused = call("fit", finger, recording, "-o", "f.json", "--ssv", "f.json", *FIT)
    assert refused.status == 2 and "f.json: expected a name that ends in .ssv" in refused.err
    short = ("--passes", "2", *FIT)
    fitted = call("fit", finger, recording, "-o", "f.json", "--report", "r.json", "--ssv", "f.ssv", *short)
    assert fitted.status == 0
    said = [line.partition(": ")[0] for line in fitted.err.splitlines()]
    assert said[-3:] == ["f.json", "r.json", "f.ssv"]
    text = Path("f.ssv").read_text()
    for parameter in json.loads(Path("r.json").read_text())["parameters"]:
        assert f'name="{parameter["path"]}"' in text and f'value="{parameter["value"]}"' in text
        assert f'standardError="{parameter["standard_error"]!r}"' in text
    built = call("build", finger, "-o", "f.fmu", "--ssv", "f.ssv", "--reference", recording, "--json", "-q")
    assert built.status == 0, built.err
    with zipfile.ZipFile("f.fmu") as archive:
        carried = {name.partition("/")[2] for name in archive.namelist() if name.startswith("extra/")}
    assert {"f.ssv", "fmi-ls-manifest.xml"} < {name.partition("/")[2] for name in carried} and len(carried) == 6


def test_the_report_is_as_its_schema_says(call: Call, files: tuple[Path, Path]) -> None:
    schema = json.loads(files_of("tendonfmu").joinpath("schema", "fit_report.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    finger, recording = files
    printed = call(
        "fit", finger, recording, "-o", "f.json", "--report", "r.json", "--holdout", "0.1", "--json", "-q", *FIT
    )
    assert printed == Answer(0, Path("r.json").read_text(), "")
    jsonschema.validate(json.loads(Path("r.json").read_text()), schema)


def test_a_fit_that_does_not_converge_says_so(call: Call, files: tuple[Path, Path]) -> None:
    answer = call("fit", *files, "-o", "f.json", "--passes", "2", *FIT)
    assert answer.status == 0
    assert "tendonfmu: warning: not converged after 2 passes" in answer.err
    assert "NOT converged" in answer.out


def test_what_was_warned_of_is_in_the_report(call: Call, files: tuple[Path, Path], tmp_path: Path) -> None:
    still = write_recording(made_recording(still=1), tmp_path / "still.parquet")
    answer = call("fit", files[0], still, "-o", "f.json", "--report", "r.json", "--passes", "5", *FIT)
    warned = [line for line in answer.err.splitlines() if line.startswith("tendonfmu: warning: ")]
    report = json.loads(Path("r.json").read_text())
    assert [line.removeprefix("tendonfmu: warning: ") for line in warned] == report["warnings"]
    assert any("joint 2 (tip) never moves" in line for line in warned)


def test_two_sides_are_fitted_apart(call: Call, files: tuple[Path, Path]) -> None:
    answer = call("fit", *files, "-o", "f.json", "--asymmetric", "--only", "joints[1].friction", "--kinematics", "3")
    assert answer.err.endswith("f.json: 8 numbers estimated\n")
    assert "positive" in json.loads(Path("f.json").read_text())["joints"][0]["friction"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("-o", "finger.json"), "finger.json: the same file as the input"),
        (("-o", "rec.json", "--report", "rec.json"), "expected two names"),
        (("-o", "f.csv"), "f.csv: expected a name that ends in .json"),
        (("-o", "f.json", "--figures", "finger.json"), "finger.json: a file; expected a folder"),
        (("-o", "nowhere/f.json"), "no folder nowhere"),
        (("-o", "f.json", "--method", "magic"), "method: 'magic'; expected batch or ekf"),
        (
            ("-o", "f.json", "--resume", "finger.json"),
            'finger.json: format = "tendonfmu-finger-1"; expected "tendonfmu-fit',
        ),
        (("-o", "f.json", "--resume", "nothing.json"), "nothing.json"),
        (("-o", "f.json", "--compare", "nothing.csv"), "nothing.csv: no such file"),
        (("./rec.parquet", "-o", "f.json"), "rec.parquet: given twice; expected each recording once"),
        (("-o", "f.json", "--compare", "rec.parquet"), "rec.parquet: compared with, but trained on as well"),
        (("-o", "left.json", "--resume", "left.json"), "left.json: the same file as the input left.json"),
        (("-o", "f.json", "--figures", "finger.json/figures"), "finger.json is a file; expected a folder"),
        (("-o", "f.json", "--drift", "0.1"), "drift = 0.1: expected 0 with method batch"),
    ],
)
def test_bad_usage_is_one_line_and_writes_nothing(
    call: Call, files: tuple[Path, Path], arguments: tuple[str, ...], words: str
) -> None:
    Path("left.json").write_text('{"format": "tendonfmu-fit-unfinished-1"}')
    before = {path: path.read_bytes() for path in Path().iterdir()}
    answer = call("fit", *files, *arguments)
    assert answer.status == 2
    assert words in answer.err and answer.err.count("\n") == 1
    assert {path: path.read_bytes() for path in Path().iterdir()} == before


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="SKIPPED: no folder here that nobody may write into")
@pytest.mark.parametrize("place", [("-o", "/proc/f.json"), ("-o", "f.json", "--figures", "/proc/figures/new")])
def test_a_folder_that_cannot_be_written_is_refused_before_the_fit(
    call: Call, files: tuple[Path, Path], place: tuple[str, ...]
) -> None:
    answer = call("fit", *files, *place, *FIT)
    assert answer.status == 2 and not answer.out
    assert f"{place[-1]}: cannot be written" in answer.err and answer.err.count("\n") == 1
    assert not Path("f.json").exists()


# --- Ctrl-C -----------------------------------------------------------------------------------------------------------


def spent(process: int) -> float:
    """Processor time of a running process, s; of Linux alone."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def spent_by_ended_ones() -> float:
    found = os.times()
    return found.children_user + found.children_system


def take_interrupts() -> None:
    """A job in the background of a shell inherits that SIGINT is ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="SKIPPED: no SIGINT for another process")
@pytest.mark.parametrize(("method", "phase"), repeated([("batch", b"pass 2"), ("ekf", b"filtering, pass 1")], 0))
def test_ctrl_c_leaves_the_best_so_far_and_resume_goes_on(
    call: Call, tmp_path: Path, method: str, phase: bytes
) -> None:
    """The index finger with 468 numbers takes some seconds: time to interrupt it."""
    free = DEMO / "index_finger_free.parquet"
    command = ["fit", str(INDEX), str(free), "-o", "fitted.json", "--method", method, "--progress"]
    run = subprocess.Popen(
        [sys.executable, "-c", "from tendonfmu.cli import main; main()", *command],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=take_interrupts,
    )
    seen, before = b"", spent_by_ended_ones()
    assert run.stderr is not None
    while phase not in seen and run.poll() is None:
        seen += run.stderr.read1(4096)  # type: ignore[attr-defined]
    until_then = spent(run.pid) if sys.platform == "linux" else 0.0
    run.send_signal(signal.SIGINT)
    _, rest = run.communicate(timeout=300)
    assert run.returncode == 130
    # of the processor: on a loaded machine it may take longer
    assert sys.platform != "linux" or spent_by_ended_ones() - before - until_then < 5.0
    assert method == "ekf" or b"cost" in seen + rest
    last = rest.decode().strip().splitlines()[-1]
    assert (
        "tendonfmu: interrupted; the best estimate so far is in fitted.unfinished.json; continue with --resume" in last
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fitted.unfinished.json"]
    left = json.loads((tmp_path / "fitted.unfinished.json").read_text())
    assert left["format"] == "tendonfmu-fit-unfinished-1" and len(left["z"]) == len(left["unknowns"]) == 468
    answer = call(*command[:-1], "--resume", "fitted.unfinished.json", "--passes", "1", "--holdout", "0.9")
    assert answer.status == 0
    assert call("check", "fitted.json").status == 0


def test_an_unfinished_file_is_no_finger(call: Call, files: tuple[Path, Path]) -> None:
    Path("left.unfinished.json").write_text(
        json.dumps(
            {"format": "tendonfmu-fit-unfinished-1", "z": [1.0], "unknowns": ["x"], "description": small_finger()}
        )
    )
    answer = call("check", "left.unfinished.json")
    assert answer.status == 1
    expected = 'format = "tendonfmu-fit-unfinished-1": file of a fit; expected a finger description'
    assert f"left.unfinished.json: {expected}" in answer.err
    answer = call("fit", *files, "-o", "f.json", "--resume", "left.unfinished.json", *FIT)
    assert answer.status == 2 and "the interrupted fit has 1 unknowns, this fit has 25" in answer.err
