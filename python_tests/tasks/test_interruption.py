"""Signals at any moment of a command: one line, its status, and results as they were or whole."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from importlib.resources import as_file, files
from pathlib import Path

import pytest

from repetitions import repeated
from repository_paths import SUPPORT

if os.name != "posix":
    pytest.skip("SKIPPED: signals as POSIX has them", allow_module_level=True)


import diagnosis_examples as examples
from tendonfmu.errors import InputError
from tendonfmu.report.diagnosis_files import REPORT, write_diagnosis
from tendonfmu.tasks.phases import ended_by_signals, uninterrupted

HERE = SUPPORT
PROMPT = 10.0  # s; on a busy machine
SAID = "tendonfmu: interrupted; no file was left half written"
STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}

# `tendonfmu diagnose` with another computation; "ready" says that its moment has come
PROGRAM = """
import os, sys, time
sys.path.insert(0, {here!r})
import numpy as np
from dataclasses import replace
import diagnosis_examples as examples
from tendonfmu.diagnosis import diagnosis
from tendonfmu.report import diagnosis_files
from tendonfmu.report import diagnosis_page
def ready(): os.write(1, b"ready\\n")
def brief(): return replace(examples.one_cause(), views=examples.one_cause().views[:1])
{body}
diagnosis.diagnose = compute
sys.argv = ["tendonfmu", "diagnose", "finger.json", "a.csv", "-o", "out"]
from tendonfmu.cli import main
main()
"""

MOMENTS = {
    "python": """
def compute(*_, **__):
    ready()
    while True: sum(range(1000))
""",
    "numpy": """
def compute(*_, **__):
    matrix = np.ones((400, 400)); ready()
    while True: matrix = np.linalg.svd(matrix)[0]
""",
    "a swallowed exception": """
def compute(*_, **__):
    ready()
    while True:
        try: time.sleep(0.01)
        except Exception: pass
""",
    "an import fails by it": """
def compute(*_, **__):
    ready()
    try:
        while True: time.sleep(0.01)
    except KeyboardInterrupt: raise ImportError("numpy.core.multiarray failed to import") from None
""",
    "the files are made": """
def compute(*_, **__): return brief()
whole = diagnosis_files.build_fmu
def slow(*arguments, **options): ready(); time.sleep(60)
diagnosis_files.build_fmu = slow
""",
}
MOVING = """
def compute(*_, **__): return brief()
whole = os.replace
def slow(source, target):
    whole(source, target)
    if os.path.basename(os.path.dirname(target)) in ("old", "out"):
        ready(); time.sleep(0.1)
os.replace = slow
"""


def foreground() -> None:
    """A job in the background of a shell inherits that SIGINT is ignored, and behind nohup SIGHUP."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def started(
    folder: Path, body: str, first: Callable[[], None] = foreground, stderr: int = subprocess.PIPE
) -> subprocess.Popen[str]:
    """A process that stands where it has to be interrupted; `out` holds an earlier diagnosis."""
    (folder / "finger.json").write_text("{}")
    (folder / "a.csv").write_text("")
    code = PROGRAM.format(here=str(HERE), body=body)
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
        preexec_fn=first,
    )
    assert process.stdout is not None
    if process.stdout.readline() != "ready\n":
        raise AssertionError(process.communicate())
    return process


def ended(process: subprocess.Popen[str], number: signal.Signals) -> tuple[int, str, float]:
    """Status, standard error and seconds until it had gone."""
    begin = time.perf_counter()
    process.send_signal(number)
    try:
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
    return process.returncode, err, time.perf_counter() - begin


def content(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.fixture(scope="module")
def earlier(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a diagnosis."""
    folder = tmp_path_factory.mktemp("earlier") / "out"
    write_diagnosis(examples.adequate(), folder)
    return folder


def copied(earlier: Path, folder: Path) -> None:
    (folder / "out").mkdir()
    for name, text in content(earlier).items():
        (folder / "out" / name).write_bytes(text)


@pytest.mark.parametrize("moment", repeated(MOMENTS, 1))
@pytest.mark.parametrize("number", repeated(STATUS, 1), ids=lambda number: number.name)
def test_nothing_is_left_and_nothing_is_lost(
    tmp_path: Path, earlier: Path, moment: str, number: signal.Signals
) -> None:
    copied(earlier, tmp_path)
    process = started(tmp_path, MOMENTS[moment])
    before = content(earlier)
    status, err, seconds = ended(process, number)
    assert (status, err.splitlines()) == (STATUS[number], [SAID])
    assert seconds < PROMPT
    assert content(tmp_path / "out") == before
    assert {file.name for file in tmp_path.iterdir()} == {"finger.json", "a.csv", "out"}


def test_a_terminal_that_closes_ends_a_command(tmp_path: Path, earlier: Path) -> None:
    """Its one line can be read by nobody."""
    import fcntl  # POSIX alone, as these two
    import pty
    import termios

    copied(earlier, tmp_path)
    terminal, own = pty.openpty()

    def inside() -> None:
        foreground()
        os.setsid()
        fcntl.ioctl(own, termios.TIOCSCTTY, 0)

    process = started(tmp_path, MOMENTS["python"], inside, own)
    os.close(own)
    os.close(terminal)
    try:
        assert process.wait(60) == 129
    finally:
        process.kill()
    assert content(tmp_path / "out") == content(earlier)


def test_nohup_is_respected() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ended_by_signals():
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_the_folder_changes_at_once(tmp_path: Path, earlier: Path) -> None:
    """Interrupted while the files take their places: all of them do, and then the command ends."""
    copied(earlier, tmp_path)
    (tmp_path / "out" / "notes.txt").write_text("mine")
    status, err, _ = ended(started(tmp_path, MOVING), signal.SIGINT)
    assert (status, err.splitlines()) == (130, [SAID])
    report = json.loads((tmp_path / "out" / REPORT).read_text())
    assert report["verdict"] == examples.one_cause().verdict
    assert set(content(tmp_path / "out")) == {*report["files"], "notes.txt"}
    assert {file.name for file in tmp_path.iterdir()} == {"finger.json", "a.csv", "out"}


def test_a_disk_that_fails_in_between_changes_nothing(
    tmp_path: Path, earlier: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copied(earlier, tmp_path)
    whole, calls = os.replace, 0

    def failing(source: Path, target: Path) -> None:
        nonlocal calls
        calls += Path(target).parent in (tmp_path / "out", tmp_path / "new")
        if calls == 4:
            calls += 1  # only once: what is moved back is
            raise OSError(28, "No space left on device", str(target))
        whole(source, target)

    monkeypatch.setattr(os, "replace", failing)
    with pytest.raises(InputError, match="cannot be written"):
        write_diagnosis(examples.one_cause(), tmp_path / "out")
    assert calls > 4 and content(tmp_path / "out") == content(earlier)
    calls = 0
    with pytest.raises(InputError, match="cannot be written"):
        write_diagnosis(examples.one_cause(), tmp_path / "new")
    assert {file.name for file in tmp_path.iterdir()} == {"out"}


def test_a_disk_that_is_full_as_files_are_made_is_no_fault(
    tmp_path: Path, earlier: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was said to be one of tendonfmu, and of a file in a hidden folder."""
    copied(earlier, tmp_path)

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(InputError, match=rf"^{re.escape(str(tmp_path / 'out'))}/[\w.]+: cannot be written \(No space"):
        write_diagnosis(examples.one_cause(), tmp_path / "out")
    assert content(tmp_path / "out") == content(earlier)


# --- for real ---------------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("seconds", repeated([1.0, 3.0, 8.0], 1))
def test_a_real_diagnosis_is_interrupted(tmp_path: Path, seconds: float) -> None:
    """Wherever it is then."""
    with as_file(files("tendonfmu") / "data") as data:
        names = ("two_joints.json", "two_joints_training.parquet", "two_joints_unseen.parquet")
        finger, training, unseen = (str(data / name) for name in names)
        words = ["diagnose", finger, training, "--test", unseen, "-o", "out"]
        code = "import sys; from tendonfmu.cli import main; print('ready', flush=True); main()"
        process = subprocess.Popen(
            [sys.executable, "-c", code, *words],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=foreground,
        )
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        time.sleep(seconds)
        status, err, took = ended(process, signal.SIGINT)
    assert (status, err.splitlines()) == (130, [SAID])
    assert took < PROMPT and list(tmp_path.iterdir()) == []


LOST = """
import signal, sys
from tendonfmu.tasks import Phases, ended_by_signals

class Swallows:
    def __del__(self):
        signal.raise_signal(signal.Signals[sys.argv[1]])

with ended_by_signals() as ending:
    phases = Phases(["first", "second"])
    try:
        with phases.start("first"):
            Swallows()
            print("swallowed")
        with phases.start("second"):
            print("never")
    except KeyboardInterrupt:
        print(ending.status)
"""


@pytest.mark.parametrize(("name", "status"), [("SIGINT", 130), ("SIGTERM", 143)])
def test_an_interruption_that_a_finaliser_swallows_comes_at_the_next_phase(name: str, status: int) -> None:
    done = subprocess.run([sys.executable, "-c", LOST, name], capture_output=True, text=True, preexec_fn=foreground)
    assert done.stdout.split() == ["swallowed", str(status)], done.stderr


# --- parts ------------------------------------------------------------------------------------------------------------


def test_a_signal_waits_for_the_end() -> None:
    done = False

    def wait() -> None:
        nonlocal done
        with uninterrupted():
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
            done = True

    before = signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # ignored where a shell has put us in its background
    try:
        with pytest.raises(KeyboardInterrupt):
            wait()
        assert done and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


def test_sigterm_has_its_own_status() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with ended_by_signals() as ending:
        assert ending.status == 130
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
    assert ending.status == 143 and signal.getsignal(signal.SIGTERM) == before


def test_other_threads_are_left_alone() -> None:
    found: list[int] = []

    def work() -> None:
        with ended_by_signals() as ending, uninterrupted():
            found.append(ending.status)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [130]
