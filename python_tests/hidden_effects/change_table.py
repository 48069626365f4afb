"""Runs `tendonfmu diagnose` on cases of a change, one process a case, and prints how often it is right.

    python python_tests/hidden_effects/change_table.py CASES -o rows.csv [--half even] [--without-reference]
    python python_tests/hidden_effects/change_table.py -o rows.csv --print-only

CASES is a folder that change_cases.py made. A row is written as its case ends;
cases that the file has already, by the same way of asking, are not run again. Reports are kept with --keep.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from change_case import FINGER, HALVES, TRUTH, Truth, read_truth, recordings_of  # noqa: E402
from change_judgement import judge  # noqa: E402
from change_table_text import tables  # noqa: E402

LIMIT = 1800.0  # s that a case may take
WITH, WITHOUT = "reference", "no reference"


@dataclass(frozen=True)
class Run:
    """exit: None if it was ended after the time limit. message: its last line. report: diagnosis.json, if written."""

    exit: int | None
    message: str
    cpu_seconds: float
    report: dict[str, Any] | None


@dataclass(frozen=True)
class Row:
    """One case, one way of asking. Lists are separated by spaces; what does not arise is empty."""

    case: str
    asked: str
    bed: str
    half: str
    machine: str
    model: str
    hidden: str
    conditions: str
    strength: float
    exit: str
    message: str
    cpu_seconds: float
    verdict: str = ""
    causes: str = ""
    named: str = ""
    false: str = ""
    friction: str = ""
    unknown: str = ""
    in_set: str = ""
    first: str = ""
    at_place: str = ""
    sign: str = ""
    set_size: str = ""


def program() -> str:
    """The command of this Python's environment, else the one on the PATH."""
    beside = Path(sys.executable).parent / "tendonfmu"
    found = str(beside) if beside.is_file() else shutil.which("tendonfmu")
    if found is None:
        sys.exit("no program `tendonfmu` beside this Python or on the PATH: run ./test or ./run first")
    return found


def command(folder: Path, truth: Truth, asked: str, output: Path) -> list[str]:
    then, now = (list(map(str, recordings_of(folder, kind))) for kind in ("then", "now"))
    before = [argument for file in then for argument in ("--reference", file)] if asked == WITH else []
    given = [program(), "diagnose", str(folder / FINGER), *now, *before, "--kinematics", str(truth.kinematics)]
    return [*given, "-o", str(output), "--no-progress"]


def diagnose(arguments: Sequence[str], output: Path, limit: float) -> Run:
    """CPU time is that of the process and of what it waited for."""
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as messages:
        process = subprocess.Popen(arguments, stdout=messages, stderr=messages)
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
        said = [line.strip() for line in messages if line.strip()]
    written = output / "diagnosis.json"
    report = json.loads(written.read_text(encoding="utf-8")) if process.returncode == 0 and written.is_file() else None
    message = f"ended after {limit:g} s" if late.is_set() else (said or [""])[-1]
    return Run(None if late.is_set() else process.returncode, message, usage.ru_utime + usage.ru_stime, report)


def row_of(folder: Path, asked: str, limit: float, keep: Path | None) -> Row:
    truth = read_truth(folder)
    with tempfile.TemporaryDirectory() as scratch:
        output = Path(scratch) / "report"
        run = diagnose(command(folder, truth, asked, output), output, limit)
        if keep is not None and output.is_dir():
            kept = keep / asked.replace(" ", "_") / truth.name
            shutil.copytree(output, kept, dirs_exist_ok=True)
    return judged_row(truth, asked, run)


def judged_row(truth: Truth, asked: str, run: Run) -> Row:
    """The row of a run; without a report nothing is judged."""
    common = {name: getattr(truth, name) for name in ("bed", "half", "machine", "model", "hidden", "conditions")}
    row: dict[str, Any] = common | {
        "case": truth.name,
        "asked": asked,
        "strength": truth.strength,
        "exit": "" if run.exit is None else str(run.exit),
        "message": run.message if run.report is None else "",
        "cpu_seconds": round(run.cpu_seconds, 2),
    }
    if run.report is None:
        return Row(**row)
    judgement = judge(run.report, truth)
    row |= {name: text_of(getattr(judgement, name)) for name in judgement.__dataclass_fields__}
    return Row(**row, verdict=run.report["verdict"], causes=" ".join(map(in_words, run.report["causes"])))


def text_of(value: Any) -> str:
    return "" if value is None else " ".join(value) if isinstance(value, tuple) else str(value)


def in_words(cause: dict[str, Any]) -> str:
    """effect/alternative/... of a cause"""
    return "/".join([cause["effect"], *(each["effect"] for each in cause.get("confusable_with") or ())])


def read_rows(file: Path) -> list[dict[str, str]]:
    if not file.is_file():
        return []
    with file.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def folders_of(cases: Path, half: str) -> list[Path]:
    """In an order that is drawn, always the same: those that can be run in some minutes are a fair part of all."""
    found = sorted(each.parent for each in cases.glob(f"*/{TRUTH}"))
    wanted = [folder for folder in found if half in ("all", read_truth(folder).half)]
    return [wanted[k] for k in np.random.default_rng(0).permutation(len(wanted))]


def run_all(folders: Sequence[Path], asked: str, file: Path, limit: float, minutes: float, keep: Path | None) -> None:
    """Appends a row as each case ends; begins no new one after so many minutes."""
    done = {(row["case"], row["asked"]) for row in read_rows(file)}
    end = time.monotonic() + 60.0 * minutes
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, [each.name for each in fields(Row)])
        if stream.tell() == 0:
            writer.writeheader()
        for folder in folders:
            if (read_truth(folder).name, asked) in done:
                continue
            if time.monotonic() > end:
                break
            row = row_of(folder, asked, limit, keep)
            writer.writerow(vars(row))
            stream.flush()
            print(f"{row.case}: exit {row.exit}, {row.causes or 'nothing'} {row.message}", file=sys.stderr)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", type=Path, nargs="?", help="folder of cases")
    parser.add_argument("-o", "--output", type=Path, required=True, help="rows, .csv; goes on where it ended")
    parser.add_argument("--half", choices=(*HALVES.values(), "all"), default="all", help="cases of odd or even number")
    parser.add_argument("--without-reference", action="store_true", help="the same `now` recordings alone")
    parser.add_argument("--limit", type=float, default=LIMIT, help="s of time that a case may take")
    parser.add_argument("--minutes", type=float, default=1e6, help="begin no case after these")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep the reports here")
    parser.add_argument("--print-only", action="store_true", help="run nothing")
    given = parser.parse_args()
    if not given.print_only:
        if given.cases is None:
            parser.error("no folder of cases; expected CASES or --print-only")
        asked = WITHOUT if given.without_reference else WITH
        folders = folders_of(given.cases, given.half)
        run_all(folders, asked, given.output, given.limit, given.minutes, given.keep)
    rows = [row for row in read_rows(given.output) if given.half in ("all", row["half"])]
    print("\n".join(tables(rows)))


if __name__ == "__main__":
    main()
