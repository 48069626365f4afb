"""Signals at any moment of a command: one line, its status, and results as they were or whole."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from repository_paths import SUPPORT

if os.name != "posix":
    pytest.skip("SKIPPED: signals as POSIX has them", allow_module_level=True)


import diagnosis_examples as examples
from tendonfmu.errors import InputError
from tendonfmu.report.diagnosis_files import REPORT, write_diagnosis
from tendonfmu.tasks.phases import Phases, ended_by_signals, uninterrupted

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
from tendonfmu.commands.program import main
main()
"""

MOMENTS = {
    "python": """
def compute(*_, **__):
    ready()
    while True: sum(range(1000))
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
def slow(*arguments, **options): ready(); time.sleep(60)
diagnosis_files.pack = slow
""",
}
MOVING = """
def compute(*_, **__): return brief()
whole = os.replace
def slow(source, target):
    whole(source, target)
    if os.path.basename(os.path.dirname(target)) == "out":
        ready(); time.sleep(0.1)
os.replace = slow
"""


def foreground() -> None:
    """A job in the background of a shell inherits that SIGINT is ignored, and behind nohup SIGHUP."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def started(folder: Path, body: str) -> subprocess.Popen[str]:
    """A process that stands where it has to be interrupted; `out` holds an earlier diagnosis."""
    (folder / "finger.json").write_text("{}")
    (folder / "a.csv").write_text("")
    code = PROGRAM.format(here=str(SUPPORT), body=body)
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=foreground,
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


def lost_in(moment: str, number: signal.Signals) -> Any:
    usual = (moment, number) in (("python", signal.SIGTERM), ("the files are made", signal.SIGINT))
    return pytest.param(moment, number, marks=[] if usual else [pytest.mark.long], id=f"{moment}, {number.name}")


@pytest.mark.parametrize(("moment", "number"), [lost_in(moment, number) for moment in MOMENTS for number in STATUS])
def test_nothing_is_left_and_nothing_is_lost(
    tmp_path: Path, earlier: Path, moment: str, number: signal.Signals
) -> None:
    copied(earlier, tmp_path)
    process = started(tmp_path, MOMENTS[moment])
    status, err, seconds = ended(process, number)
    assert (status, err.splitlines()) == (STATUS[number], [SAID])
    assert seconds < PROMPT
    assert content(tmp_path / "out") == content(earlier)
    assert {file.name for file in tmp_path.iterdir()} == {"finger.json", "a.csv", "out"}


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
    whole, calls = Path.write_bytes, 0

    def failing(target: Path, content: bytes) -> int:
        nonlocal calls
        calls += 1
        if calls % 4 == 0:
            raise OSError(28, "No space left on device", str(target))
        return whole(target, content)

    monkeypatch.setattr(Path, "write_bytes", failing)
    for folder in (tmp_path / "out", tmp_path / "new"):
        with pytest.raises(InputError, match="cannot be written"):
            write_diagnosis(examples.one_cause(), folder)
    assert calls == 8 and content(tmp_path / "out") == content(earlier)
    assert not content(tmp_path / "new")


def test_signals_are_held_back_only_where_they_must_be() -> None:
    """SIGTERM has a status of its own, behind nohup SIGHUP stays ignored, other threads keep their handlers."""
    before = {number: signal.getsignal(number) for number in STATUS}
    done: list[str] = []

    def wait() -> None:
        with uninterrupted():
            signal.raise_signal(signal.SIGINT)
            done.append("whole")

    try:
        foreground()  # ignored where a shell has put us in its background
        signal.signal(signal.SIGINT, signal.default_int_handler)
        with pytest.raises(KeyboardInterrupt):
            wait()
        assert done == ["whole"] and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        with ended_by_signals() as ending:
            assert ending.status == 130 and signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)
            with pytest.raises(KeyboardInterrupt):  # also where the first one was swallowed, as in a finaliser
                Phases(["next"]).start("next").__enter__()
        assert ending.status == 143

        def work() -> None:
            with ended_by_signals(), uninterrupted():
                done.append("thread")

        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
        assert done == ["whole", "thread"]
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
