"""Functions that the tests of tasks/jobs.py and bench/job_scaling.py have workers call."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any


def note(number: int, seconds: float, log: str) -> dict[str, Any]:
    """Appends a line to a file as it begins: what ran, and in which process."""
    with Path(log).open("a", encoding="utf-8") as file:
        file.write(f"{number} {os.getpid()}\n")
    time.sleep(seconds)
    return {"number": number, "process": os.getpid()}


def fail(number: int) -> dict[str, Any]:
    if number == 2:
        raise ValueError("two is\nrefused")
    return {"number": number, "bad": float("nan")}


def end_its_worker(number: int) -> dict[str, Any]:
    if number == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"number": number}


def compute(seconds: float) -> dict[str, Any]:
    """Takes that processor time, whatever else runs on the machine."""
    begin, turns = time.process_time(), 0
    while time.process_time() - begin < seconds:
        turns += sum(range(1000)) > 0
    return {"turns": turns, "process": os.getpid()}


def wait(seconds: float) -> dict[str, Any]:
    time.sleep(seconds)
    return {"process": os.getpid()}
