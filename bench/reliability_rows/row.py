"""What a row of the table is, and what came of it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SUPPORT = ROOT / "python_tests" / "support"


class Unavailable(Exception):
    """One line: what the row needs and is not here."""


@dataclass(frozen=True)
class Outcome:
    """number: what was tried, with its count. result: one sentence. sound: nothing was found."""

    number: str
    result: str
    sound: bool


@dataclass(frozen=True)
class Run:
    """scale: of the row's full number. minutes: most time of a row that stops when it is over. work: folder for what is
    built and made."""

    scale: float
    minutes: float
    work: Path

    def count(self, full: int, least: int = 1) -> int:
        return max(least, round(full * self.scale))


@dataclass(frozen=True)
class Row:
    """name: R1 to R20. title: what is tried. full: the full number. leaves: what stays open after it."""

    name: str
    title: str
    full: str
    leaves: str
    measure: Callable[[Run], Outcome]

    def number(self) -> int:
        return int(self.name[1:])


def spoken(count: float) -> str:
    """86,400,000 as 8.64e7, small ones with commas."""
    if count < 1e6:
        return f"{count:,.0f}"
    mantissa, exponent = f"{count:.3g}".split("e") if "e" in f"{count:.3g}" else (f"{count:.2e}".split("e"))
    return f"{float(mantissa):g}e{int(exponent)}"


def called(*command: str | Path, timeout: float | None = None, **options: object) -> str:
    """Standard output of a program that has to end well."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=timeout, **options)  # type: ignore[call-overload]
    if done.returncode:
        said = (done.stderr or done.stdout).strip()
        raise RuntimeError(f"{Path(str(command[0])).name} ended with {done.returncode}: {said[-600:]}")
    return str(done.stdout)


def pytest(run: Run, *selected: str, environment: dict[str, str] | None = None) -> tuple[int, int, str]:
    """Tests passed, not passed (failed or in error), and the last line of pytest. `selected`: its arguments."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not campaign", *selected]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env={**os.environ, **(environment or {})})
    (run.work / "pytest.log").write_text(done.stdout + done.stderr, encoding="utf-8")
    last = next((line for line in reversed(done.stdout.splitlines()) if re.search(r"\d+ \w+", line)), "no test ran")

    def count(word: str) -> int:
        found = re.search(rf"(\d+) {word}", last)
        return int(found[1]) if found else 0

    skipped = count("skipped")
    note = f"; {skipped} skipped" if skipped else ""
    return count("passed"), count("failed") + count("error") + (not count("passed")), note
