"""Functions that the tests of tasks/jobs.py have workers call."""

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
