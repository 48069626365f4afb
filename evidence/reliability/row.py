"""How a row of docs/evidence/reliability.md is measured, and what came of it."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


class Unavailable(Exception):
    """One line: what the row needs and is not here."""


@dataclass(frozen=True)
class Outcome:
    number: str  # what was tried, with its count
    result: str  # one sentence
    sound: bool  # nothing was found


@dataclass(frozen=True)
class Run:
    scale: float  # of the row's full number
    minutes: float  # most time of a row that stops when it is over
    work: Path  # folder for what is built and made

    def count(self, full: int, least: int = 1) -> int:
        return max(least, round(full * self.scale))


Measure = Callable[[Run], Outcome]


def spoken(count: float) -> str:
    """86,400,000 as 8.64e7, small ones with commas."""
    if count < 1e6:
        return f"{count:,.0f}"
    mantissa, exponent = f"{count:.2e}".split("e")
    return f"{float(mantissa):g}e{int(exponent)}"


def called(*command: str | Path, **options: Any) -> str:
    """Standard output of a program that has to end well."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, **options)
    if done.returncode:
        message = (done.stderr or done.stdout).strip()
        raise RuntimeError(f"{Path(str(command[0])).name} ended with {done.returncode}: {message[-600:]}")
    return str(done.stdout)


def with_wrong(result: str, wrong: Sequence[str]) -> str:
    """The result, and the first things that were wrong."""
    return "; ".join([f"{result}; {len(wrong)} wrong", *wrong[:4]])
