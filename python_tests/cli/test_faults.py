"""What a command does with a fault of tendonfmu itself, and that it is never taken for a fault of the input."""

from __future__ import annotations

import errno
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tendonfmu
from command import Call
from fmu_binary import FINGER
from repetitions import repeated
from repository_paths import ROOT
from tendonfmu.cli.console import reader_may_leave
from tendonfmu.errors import InputError, InternalError, OutputError, line_of, own_fault
from tendonfmu.fault_report import write_fault_report
from tendonfmu.files.writing import whole_file
from tendonfmu.model import native
from tendonfmu.recordings import read_recording

NAME = re.compile(r"tendonfmu-error-\d{8}-\d{6}(-\d+)?\.txt")


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[BaseException], None]:
    """Puts an error in the place of reading a description; finger.json is sound."""
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))

    def put(error: BaseException) -> None:
        def fail(*_: Any) -> Any:
            raise error

        monkeypatch.setattr("tendonfmu.model.read_finger", fail)

    return put


def os_error(number: int | None, file: str | None) -> OSError:
    return OSError("no such library") if number is None else OSError(number, os.strerror(number), file)


@pytest.mark.parametrize(
    "fault",
    [
        RuntimeError("lost count\nof it"),
        ValueError("not of the user"),
        KeyError("edge"),
        AssertionError(),
        InternalError("the fitted description is refused"),
        native.NativeError("tendons[1].stiffness = -1"),
        np.linalg.LinAlgError("singular"),
        FileNotFoundError(
            errno.ENOENT, "No such file or directory", str(Path(tendonfmu.__file__).parent / "schema" / "gone.json")
        ),
        os_error(None, None),
    ],
    ids=lambda fault: type(fault).__name__,
)
def test_a_fault_ends_with_a_report_and_one_line(
    call: Call, failing: Callable[[BaseException], None], tmp_path: Path, fault: Exception
) -> None:
    failing(fault)
    answer = call("check", "finger.json")
    assert answer.status == 3 and answer.out == "" and answer.err.count("\n") == 1, answer
    assert "a fault of tendonfmu, not of its input" in answer.err and type(fault).__name__ in answer.err
    (report,) = (file for file in tmp_path.iterdir() if file.name != "finger.json")
    assert NAME.fullmatch(report.name) and answer.err.rstrip().endswith(report.name)
    text = report.read_text(encoding="utf-8")
    for words in ("tendonfmu check finger.json", "platform:", "python:", "numpy:", "Traceback", type(fault).__name__):
        assert words in text, text


@pytest.mark.parametrize(
    "refused",
    [InputError("finger.json: name: expected a text"), os_error(errno.EACCES, "finger.json")],
    ids=["input", "permission"],
)
def test_a_refusal_is_no_fault(
    call: Call, failing: Callable[[BaseException], None], tmp_path: Path, refused: Exception
) -> None:
    failing(refused)
    answer = call("check", "finger.json")
    assert answer.status == (1 if isinstance(refused, InputError) else 2)  # 1: a description that is not sound
    assert answer.err.startswith("tendonfmu: finger.json: ") and "Errno" not in answer.err
    assert [file.name for file in tmp_path.iterdir()] == ["finger.json"]


def test_no_report_takes_the_place_of_another(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    written = {write_fault_report(ValueError(str(k)), ["check", "a b.json"]) for k in range(5)}
    assert len(written) == 5 and all(file is not None and NAME.fullmatch(file.name) for file in written)
    assert "check 'a b.json'" in next(tmp_path.iterdir()).read_text()


def test_a_report_goes_where_it_can(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Into the folder for temporary files when the current one takes none; nowhere when that takes none either."""
    here, temporary = tmp_path / "here", tmp_path / "temporary"
    for folder in (here, temporary):
        folder.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    here.rmdir()  # nothing can be written into a folder that is gone
    report = write_fault_report(ValueError("x"), [])
    assert report is not None and report.parent == temporary and NAME.fullmatch(report.name)
    assert [file.name for file in temporary.iterdir()] == [report.name]
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))
    assert write_fault_report(ValueError("x"), []) is None


def test_what_has_been_checked_is_no_input_any_more() -> None:
    with pytest.raises(InternalError, match="the extended model: finger: stiffness"), own_fault("the extended model"):
        raise InputError("finger: stiffness")
    with pytest.raises(KeyError), own_fault("the extended model"):
        raise KeyError
    with pytest.raises(OutputError, match=r"^out: cannot be written"), own_fault("the extended model"):
        raise OutputError("out: cannot be written (No space left on device)")


def test_recordings_of_which_nothing_is_left_are_no_fault() -> None:
    """Between touches single samples are left; it was called an internal error."""
    demo = ROOT / "examples" / "demo_recording"
    free, now = read_recording(demo / "two_joints_unseen.parquet"), read_recording(demo / "two_joints_training.parquet")
    touched = replace(now, contact=np.arange(len(now)) % 3 > 0)
    with pytest.raises(InputError, match="are labelled contact"):
        tendonfmu.diagnose(demo / "two_joints.json", touched, reference=free)


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        ImportError("libarrow.so: failed to map segment from shared object"),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        RuntimeError("can't start new thread"),
    ],
    ids=["Python", "loader", "system", "thread"],
)
def test_too_little_memory_is_said_and_no_fault(
    call: Call, failing: Callable[[BaseException], None], tmp_path: Path, error: Exception
) -> None:
    failing(error)
    answer = call("check", "finger.json")
    assert (answer.status, answer.out, answer.err) == (2, "", "tendonfmu: not enough memory\n")
    assert {file.name for file in tmp_path.iterdir()} == {"finger.json"}


@pytest.mark.skipif(sys.platform == "win32", reason="limits of Unix")
@pytest.mark.parametrize("megabytes", repeated([150, 250, 350, 450, 500, 550], 1, 4))
def test_under_a_limit_a_lack_of_memory_is_one_line(tmp_path: Path, megabytes: int) -> None:
    """It was "interrupted" (130), a text of OpenBLAS (1), "not a whole Parquet file", or an abort, by its size."""
    demo = ROOT / "examples" / "demo_recording"
    given = (demo / "two_joints.json", demo / "two_joints_training.parquet")
    limit = f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({megabytes} << 20, -1)); "
    script = f"{limit}import tendonfmu.cli; tendonfmu.cli.main()"
    ended = subprocess.run(
        [sys.executable, "-c", script, "run", *given, "-o", tmp_path / "out.csv"],
        env={name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")},
        capture_output=True,
        text=True,
    )
    if megabytes > 400 and ended.returncode == 0:
        return  # enough
    assert (ended.returncode, ended.stdout, ended.stderr) == (2, "", "tendonfmu: not enough memory\n")
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fails_under_results_is_not_taken_for_a_closed_terminal() -> None:
    gone = OSError(errno.EIO, os.strerror(errno.EIO))
    with pytest.raises(OSError, match="Input/output"), reader_may_leave(sys.stdout):
        raise gone


@pytest.mark.parametrize("error", [native.NativeError("x"), InternalError("x")])
def test_what_the_runtime_refuses_is_an_input_error_only_with_its_file(error: Exception) -> None:
    assert not isinstance(error, InputError)


def test_a_fault_in_writing_is_no_matter_of_the_disk(tmp_path: Path) -> None:
    elsewhere = FileNotFoundError(errno.ENOENT, "No such file or directory", "/somewhere/else")
    with pytest.raises(FileNotFoundError), whole_file(tmp_path / "out.txt"):
        raise elsewhere
    for own in (OSError(errno.ENOSPC, "No space left"), os_error(errno.EIO, str(tmp_path / "x"))):
        with pytest.raises(InputError, match=r"out\.txt: cannot be written"), whole_file(tmp_path / "out.txt"):
            raise own
    assert list(tmp_path.iterdir()) == []


def test_an_error_of_the_system_is_plain() -> None:
    assert line_of(os_error(errno.EACCES, "a.json")) == "a.json: Permission denied"
    assert line_of(OSError(errno.ENOSPC, "No space left")) == "No space left"
