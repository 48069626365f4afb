"""The command `tendonfmu fit` as a user calls it; what the fit itself refuses is tested where it refuses."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import zipfile
from importlib.resources import files as files_of
from pathlib import Path

import jsonschema
import pytest

from command import Answer, Call
from fit_finger import made_recording, moved_start, write_recording
from repository_paths import ROOT
from tendonfmu.model import get_number

needs_proc = pytest.mark.skipif(
    not Path("/proc/self").is_dir(), reason="SKIPPED: no folder here that nobody may write into"
)
FIT = ("--share", "tendons", "--kinematics", "3")


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    finger = tmp_path / "finger.json"
    finger.write_text(json.dumps(moved_start()))
    return finger, write_recording(made_recording(duration=30.0), tmp_path / "rec.parquet")


def test_a_fit_writes_a_description_and_a_report(call: Call, files: tuple[Path, Path]) -> None:
    finger, recording = files
    words = ("fit", finger, recording, "-o", "fitted.json", "--report", "r.json", "--holdout", "0.2", *FIT)
    answer = call(*words)
    assert answer.status == 0 and answer.err.splitlines()[0] == "fitted.json: 70 numbers estimated"
    report = json.loads(Path("r.json").read_text())
    schema = json.loads(files_of("tendonfmu").joinpath("schema", "fit_report.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(report, schema)
    assert report["converged"] and report["finished"] and report["method"] == "batch"
    assert report["options"]["share"] == ["tendons"] and report["options"]["holdout"] == 0.2
    assert report["recordings"][0]["used"] + report["recordings"][0]["held_out"] == report["recordings"][0]["samples"]
    fitted = json.loads(Path("fitted.json").read_text())
    for parameter in report["parameters"]:
        assert get_number(fitted, parameter["path"]) == parameter["value"]
        assert parameter["identified"] == (parameter["standard_error"] <= 0.3 * abs(parameter["value"]))
        assert (parameter["reason"] is None) == parameter["identified"] == (parameter["advice"] is None)
    correlation = report["correlation"]
    assert "joints[1].friction.rate" in correlation["paths"]
    assert [len(row) for row in correlation["matrix"]] == [25] * 25 == [len(correlation["paths"])] * 25
    assert call("run", "fitted.json", recording, "-o", "out.csv", "--kinematics", "3").status == 0
    assert call(*words, "--json", "-q") == Answer(0, Path("r.json").read_text(), "")


def test_warnings_are_printed_and_in_the_report(call: Call, files: tuple[Path, Path], tmp_path: Path) -> None:
    still = write_recording(made_recording(still=1), tmp_path / "still.parquet")
    answer = call("fit", files[0], still, "-o", "f.json", "--report", "r.json", "--passes", "2", *FIT)
    assert answer.status == 0 and "NOT converged" in answer.out
    start = "tendonfmu: warning: "
    warned = [line.removeprefix(start) for line in answer.err.splitlines() if line.startswith(start)]
    assert warned == json.loads(Path("r.json").read_text())["warnings"]
    assert any("joint 2 (tip) never moves" in line for line in warned)
    assert any("not converged after 2 passes" in line for line in warned)


def test_a_fit_writes_a_parameter_set_that_an_fmu_carries(call: Call, files: tuple[Path, Path]) -> None:
    finger, recording = files
    words = ("fit", finger, recording, "-o", "f.json", "--report", "r.json", "--ssv", "f.ssv", "--passes", "2", *FIT)
    assert call(*words).status == 0
    text = Path("f.ssv").read_text()
    for parameter in json.loads(Path("r.json").read_text())["parameters"]:
        assert f'name="{parameter["path"]}"' in text and f'value="{parameter["value"]}"' in text
        assert f'standardError="{parameter["standard_error"]!r}"' in text
    built = call("build", finger, "-o", "f.fmu", "--ssv", "f.ssv", "--reference", recording, "--json", "-q")
    assert built.status == 0, built.err
    with zipfile.ZipFile("f.fmu") as archive:
        carried = {name.partition("/")[2].partition("/")[2] for name in archive.namelist() if name.startswith("extra/")}
    assert {"f.ssv", "fmi-ls-manifest.xml"} < carried and len(carried) == 6


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("-o", "finger.json"), "finger.json: the same file as the input"),
        (("-o", "rec.json", "--report", "rec.json"), "expected two names"),
        (("-o", "f.csv"), "f.csv: expected a name that ends in .json"),
        (("-o", "f.json", "--ssv", "f.json"), "f.json: expected a name that ends in .ssv"),
        (("-o", "f.json", "--figures", "finger.json"), "finger.json: a file; expected a folder"),
        (("-o", "f.json", "--figures", "finger.json/figures"), "finger.json is a file; expected a folder"),
        (("-o", "f.json", "--from", "nothing.json"), "nothing.json"),
        (("./rec.parquet", "-o", "f.json"), "rec.parquet: given twice; expected each recording once"),
        (("-o", "f.json", "--compare", "rec.parquet"), "rec.parquet: compared with, but trained on as well"),
        pytest.param(("-o", "/proc/f.json"), "/proc/f.json: cannot be written", marks=needs_proc),
        pytest.param(
            ("-o", "f.json", "--figures", "/proc/figures/new"),
            "/proc/figures/new: cannot be written",
            marks=needs_proc,
        ),
    ],
)
def test_bad_usage_is_one_line_and_writes_nothing(
    call: Call, files: tuple[Path, Path], arguments: tuple[str, ...], words: str
) -> None:
    before = {path: path.read_bytes() for path in Path().iterdir()}
    answer = call("fit", *files, *arguments)
    assert answer.status == 2 and words in answer.err and answer.err.count("\n") == 1, answer
    assert {path: path.read_bytes() for path in Path().iterdir()} == before


def take_interrupts() -> None:
    """A job in the background of a shell inherits that SIGINT is ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="SKIPPED: no SIGINT for another process")
@pytest.mark.parametrize(("method", "phase"), [("batch", b"pass 2"), ("ekf", b"filtering, pass 1")])
def test_ctrl_c_leaves_the_best_so_far_from_which_a_fit_goes_on(
    call: Call, tmp_path: Path, method: str, phase: bytes
) -> None:
    """The index finger with 468 numbers takes some seconds: time to interrupt it."""
    examples = ROOT / "examples"
    given = (examples / "fingers" / "index_finger.json", examples / "demo_recording" / "index_finger_free.parquet")
    command = ["fit", *map(str, given), "-o", "fitted.json", "--method", method]
    main = "from tendonfmu.commands.program import main; main()"
    pipe = subprocess.PIPE
    run = subprocess.Popen(
        [sys.executable, "-c", main, *command, "--progress"],
        cwd=tmp_path,
        stdout=pipe,
        stderr=pipe,
        preexec_fn=take_interrupts,
    )
    assert run.stderr is not None
    seen = b""
    while phase not in seen and run.poll() is None:
        seen += run.stderr.read1(4096)  # type: ignore[attr-defined]
    run.send_signal(signal.SIGINT)
    _, rest = run.communicate(timeout=300)
    assert run.returncode == 130
    assert "the best estimate so far is in fitted.unfinished.json" in rest.decode().splitlines()[-1]
    assert [path.name for path in tmp_path.iterdir()] == ["fitted.unfinished.json"]
    if method == "batch":
        command += ["--start", "fitted.unfinished.json"]
    else:
        command[1] = "fitted.unfinished.json"
    answer = call(*command, "--passes", "1", "--holdout", "0.9")
    assert answer.status == 0
    assert call("check", "fitted.json").status == 0
