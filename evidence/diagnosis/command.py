"""`tendonfmu diagnose` as a user calls it, one process a case, and what it takes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

LIMIT = 3600.0  # s that a case may take
PROGRAM = (sys.executable, "-c", "from tendonfmu.cli import main; main()")
HALVES = {"odd": (1,), "even": (0,), "all": (0, 1)}  # of a case's number: odd to develop on, even to report


@dataclass(frozen=True)
class Run:
    """One call. CPU time and memory are those of the process and of what it waited for."""

    exit: int | None  # None if it was ended after the time limit
    message: str  # last line of what it printed
    seconds: float  # CPU
    peak_megabytes: float
    report: dict[str, Any] | None  # diagnosis.json, if it was written


def run_diagnose(arguments: Sequence[str], folder: Path, limit: float = LIMIT) -> Run:
    """Run `tendonfmu diagnose ARGUMENTS -o report` in the folder."""
    call = [*PROGRAM, "diagnose", *arguments, "-o", "report", "--no-progress"]
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as messages:
        process = subprocess.Popen(call, cwd=folder, stdout=messages, stderr=messages)
        late = threading.Event()

        def end() -> None:
            late.set()
            process.kill()

        timer = threading.Timer(limit, end)
        timer.start()
        _, status, usage = os.wait4(process.pid, 0)
        timer.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        messages.seek(0)
        lines = [line.strip() for line in messages if line.strip()]
    written = folder / "report" / "diagnosis.json"
    report = json.loads(written.read_text(encoding="utf-8")) if process.returncode == 0 and written.is_file() else None
    kilobytes = usage.ru_maxrss / (1024 if sys.platform == "darwin" else 1)
    return Run(
        exit=None if late.is_set() else process.returncode,
        message=f"ended after {limit:g} s" if late.is_set() else (lines or [""])[-1],
        seconds=usage.ru_utime + usage.ru_stime,
        peak_megabytes=kilobytes / 1024,
        report=report,
    )
