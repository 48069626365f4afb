#!/usr/bin/env python3
"""Plants faults into a copy of the repository, one at a time, and says which of them `./test` notices.

    git worktree add ../faults && (cd ../faults && ./test)     # a copy, built
    python tools/planted_faults.py ../faults                   # an hour on two cores

Each fault is one changed line (`tools/planted_faults.json`). After the change, `./test` runs in the copy: first ctest,
then pytest up to its first failure, beginning with the tests that are near. A fault that neither notices needs a test.
The files are put back after each.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
COMPILED = (".c", ".h", ".cpp")
# It fails with every fault: its text is not in the file any more.
WITHOUT = ("--deselect", "python_tests/repository/test_planted_faults.py::test_every_fault_fits_its_file")


@dataclass(frozen=True)
class Fault:
    """what: in words. area: core, fit, detect, diagnose, fmu or converters. near: the folder of tests that run first.
    old: a text that the file holds once, replaced by new."""

    what: str
    area: str
    near: str
    file: str
    old: str
    new: str

    @contextmanager
    def planted(self, folder: Path) -> Iterator[None]:
        file = folder / self.file
        text = file.read_text(encoding="utf-8")
        if text.count(self.old) != 1:
            raise SystemExit(f"{self.file}: holds {self.old!r} {text.count(self.old)} times; expected once")
        file.write_text(text.replace(self.old, self.new), encoding="utf-8")
        try:
            yield
        finally:
            file.write_text(text, encoding="utf-8")


def faults() -> list[Fault]:
    return [Fault(**each) for each in json.loads((HERE / "planted_faults.json").read_text(encoding="utf-8"))]


def run(folder: Path, log: Path, *command: str) -> bool:
    """Whether it succeeds; its output is added to the log."""
    with log.open("a", encoding="utf-8") as stream:
        return subprocess.run(command, cwd=folder, stdout=stream, stderr=subprocess.STDOUT, check=False).returncode == 0


def first_failure(log: Path) -> str:
    """The name of the first test that failed, as either runner reports it."""
    for line in log.read_text(encoding="utf-8", errors="replace").splitlines():
        if "***" in line and "Test" in line:
            return line.split(":", 1)[-1].split()[0]
        if line.startswith(("FAILED ", "ERROR ")):
            return line.split()[1].split("/", 1)[-1]
    return ""


def noticed_by(fault: Fault, folder: Path, logs: Path, number: int) -> str:
    """The first test that fails with the fault; nothing if all pass."""
    log = logs / f"{number:02d}.log"
    log.write_text(f"{fault.what}\n", encoding="utf-8")
    with fault.planted(folder):
        if Path(fault.file).suffix in COMPILED:
            if not run(folder, log, "cmake", "--build", "build/tests"):
                return "does not compile"
            if not run(folder, log, "ctest", "--test-dir", "build/tests", "--stop-on-failure", "--parallel", "2"):
                return first_failure(log)
        for where in (f"python_tests/{fault.near}", "python_tests"):
            if not run(folder, log, "./test", "-x", "-q", *WITHOUT, where):
                return first_failure(log) or "./test"
        return ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="a copy of the repository in which ./test has run; not this one")
    parser.add_argument("--only", type=int, nargs="*", help="numbers of faults, from 1")
    given = parser.parse_args()
    folder = given.folder.resolve()
    if folder == HERE.parent or not (folder / "build" / "tests").is_dir():
        raise SystemExit(f"{folder}: expected a copy of the repository with build/tests")
    logs = folder / "build" / "planted_faults"
    logs.mkdir(exist_ok=True)
    missed = 0
    print("| | area | fault | noticed by | s |\n| --- | --- | --- | --- | --- |")
    for number, fault in enumerate(faults(), start=1):
        if given.only and number not in given.only:
            continue
        begin = time.monotonic()
        found = noticed_by(fault, folder, logs, number)
        missed += not found
        shown = f"`{found}`" if found else "**nothing**"
        print(f"| {number} | {fault.area} | {fault.what} | {shown} | {time.monotonic() - begin:.0f} |", flush=True)
    sys.exit(1 if missed > 1 else 0)


if __name__ == "__main__":
    main()
