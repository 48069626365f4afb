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
from pathlib import Path
from typing import Any

import pytest

import tendonfmu
from command import Call
from fmu_binary import FINGER
from repository_paths import ROOT
from tendonfmu.commands.console import reader_may_leave
from tendonfmu.errors import InputError, InternalError, OutputError, line_of, own_fault, write_fault_report
from tendonfmu.files.writing import whole_file
from tendonfmu.model import native

NAME = re.compile(r"tendonfmu-error-\d{8}-\d{6}(-\d+)?\.txt")
SCHEMA = str(Path(tendonfmu.__file__).parent / "schema" / "gone.json")
Fail = Callable[[BaseException], None]


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Fail:
    """Puts an error in the place of reading a description; finger.json is sound."""
    (tmp_path / "finger.json").write_text(json.dumps(FINGER))

    def put(error: BaseException) -> None:
        def fail(*_: Any) -> Any:
            raise error

        monkeypatch.setattr("tendonfmu.model.read_finger", fail)

    return put


@pytest.mark.parametrize(
    "fault",
    [
        RuntimeError("lost count\nof it"),
        InternalError("the fitted description is refused"),
        native.NativeError("tendons[1].stiffness = -1"),
        FileNotFoundError(errno.ENOENT, "No such file or directory", SCHEMA),
        OSError("no such library"),
    ],
    ids=lambda fault: type(fault).__name__,
)
def test_a_fault_ends_with_a_report_and_one_line(call: Call, failing: Fail, tmp_path: Path, fault: Exception) -> None:
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
    ("error", "status", "said"),
    [
        (InputError("finger.json: name: expected a text"), 1, "finger.json: "),  # a description that is not sound
        (OSError(errno.EACCES, os.strerror(errno.EACCES), "finger.json"), 2, "finger.json: Permission denied\n"),
        (MemoryError(), 2, "not enough memory\n"),
        (ImportError("libarrow.so: failed to map segment from shared object"), 2, "not enough memory\n"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), 2, "not enough memory\n"),
        (RuntimeError("can't start new thread"), 2, "not enough memory\n"),
    ],
)
def test_a_refusal_or_too_little_memory_is_no_fault(
    call: Call, failing: Fail, tmp_path: Path, error: Exception, status: int, said: str
) -> None:
    failing(error)
    answer = call("check", "finger.json")
    assert answer.status == status and answer.err.startswith(f"tendonfmu: {said}") and "Errno" not in answer.err
    assert [file.name for file in tmp_path.iterdir()] == ["finger.json"]


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="SKIPPED: limits of Unix")
@pytest.mark.parametrize("megabytes", [150, 250, 350, 450, 500, 550])
def test_under_a_limit_a_lack_of_memory_is_one_line(tmp_path: Path, megabytes: int) -> None:
    demo = ROOT / "examples" / "demo_recording"
    given = (demo / "two_joints.json", demo / "two_joints_training.parquet")
    limit = f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({megabytes} << 20, -1)); "
    script = f"{limit}from tendonfmu.commands.program import main; main()"
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


def test_a_report_goes_where_it_can_and_replaces_no_other(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Into the folder for temporary files when the current one takes none; nowhere when that takes none either."""
    here, temporary = tmp_path / "here", tmp_path / "temporary"
    for folder in (here, temporary):
        folder.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    written = {write_fault_report(ValueError(str(k)), ["check", "a b.json"]) for k in range(3)}
    assert len(written) == 3 and None not in written
    for file in here.iterdir():
        assert NAME.fullmatch(file.name) and "check 'a b.json'" in file.read_text()
        file.unlink()
    here.rmdir()  # nothing can be written into a folder that is gone
    report = write_fault_report(ValueError("x"), [])
    assert report is not None and report.parent == temporary and NAME.fullmatch(report.name)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))
    assert write_fault_report(ValueError("x"), []) is None


def test_errors_keep_their_kind(tmp_path: Path) -> None:
    """What has been checked is no input any more; what the runtime refuses is one only with its file."""
    with pytest.raises(InternalError, match="the extended model: finger: stiffness"), own_fault("the extended model"):
        raise InputError("finger: stiffness")
    with pytest.raises(OutputError, match=r"^out: cannot be written"), own_fault("the extended model"):
        raise OutputError("out: cannot be written (No space left on device)")
    assert not issubclass(native.NativeError, InputError) and not issubclass(InternalError, InputError)
    with pytest.raises(OSError, match="Input/output"), reader_may_leave(sys.stdout):  # no closed terminal
        raise OSError(errno.EIO, os.strerror(errno.EIO))
    elsewhere = FileNotFoundError(errno.ENOENT, "No such file or directory", "/somewhere/else")
    with pytest.raises(FileNotFoundError), whole_file(tmp_path / "out.txt"):  # no matter of the disk
        raise elsewhere
    for own in (OSError(errno.ENOSPC, "No space left"), OSError(errno.EIO, "", str(tmp_path / "x"))):
        with pytest.raises(InputError, match=r"out\.txt: cannot be written"), whole_file(tmp_path / "out.txt"):
            raise own
    assert list(tmp_path.iterdir()) == []
    assert line_of(OSError(errno.ENOSPC, "No space left")) == "No space left"
