"""Runs `tendonfmu diagnose` on the foreign cases and writes one table: python python_tests/foreign/table.py --help.

The command runs as a user calls it, one process a case. Constants of the product are chosen on odd cases; figures that
are published come from even ones.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType
from typing import Any

import recorded
from foreign_case import Case
from judgement import is_absorbed, judge, visibility
from table_text import markdown, summary

FAMILIES = {"recorded": "recorded", "mujoco": "fingers_in_mujoco", "numpy": "fingers_in_numpy"}
HALVES = {"odd": (1,), "even": (0,), "all": (0, 1)}
ROOT = Path(__file__).resolve().parents[2]


@dataclasses.dataclass(frozen=True)
class Run:
    """One call of the command. exit: None if it was ended after the time limit; message: its last line of errors."""

    exit: int | None
    message: str
    cpu_seconds: float
    peak_megabytes: float


def command() -> str:
    """The program of this Python's environment, else the one on the PATH."""
    beside = Path(sys.executable).parent / "tendonfmu"
    found = str(beside) if beside.is_file() else shutil.which("tendonfmu")
    if found is None:
        sys.exit("no program `tendonfmu` beside this Python or on the PATH: run ./test or ./run first")
    return found


def families(wanted: str | None) -> dict[str, ModuleType]:
    """Modules of the families; says loudly which one cannot be made here."""
    found = {}
    for family in [wanted] if wanted else FAMILIES:
        try:
            found[family] = importlib.import_module(FAMILIES[family])
        except ModuleNotFoundError as missing:
            print(f"SKIPPED: the family {family}: {missing.name} is not installed", file=sys.stderr)
    return found


def numbers(module: ModuleType, half: str, only: list[int] | None) -> list[int]:
    every = recorded.numbers() if module is recorded else module.NUMBERS
    return [number for number in every if number % 2 in HALVES[half] and (not only or number in only)]


def write(case: Case, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "finger.json").write_text(json.dumps(case.nominal, indent=1), encoding="utf-8")
    (folder / "truth.json").write_text(json.dumps(dataclasses.asdict(case.truth), indent=1), encoding="utf-8")
    case.train.to_parquet(folder / "train.parquet", index=False)
    case.test.to_parquet(folder / "test.parquet", index=False)


def diagnose(program: str, folder: Path, limit: float) -> Run:
    """Runs the command in the case's folder; CPU time and memory are those of its process and of what it waited for."""
    arguments = [program, "diagnose", "finger.json", "train.parquet", "--test", "test.parquet"]
    with (folder / "messages.txt").open("w+", encoding="utf-8", errors="replace") as messages:
        process = subprocess.Popen(
            [*arguments, "-o", "report", "--no-progress"], cwd=folder, stdout=messages, stderr=messages
        )
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
    kilobytes = usage.ru_maxrss / (1024 if sys.platform == "darwin" else 1)
    message = f"ended after {limit:g} s" if late.is_set() else (said or [""])[-1]
    return Run(
        None if late.is_set() else process.returncode, message, usage.ru_utime + usage.ru_stime, kilobytes / 1024
    )


def row_of(module: ModuleType, number: int, folder: Path, limit: float) -> dict[str, Any]:
    """Makes a case, runs the command on it and judges its report."""
    case = module.make(number)
    write(case, folder / case.name)
    run = diagnose(command(), folder / case.name, limit)
    written = folder / case.name / "report" / "diagnosis.json"
    report = json.loads(written.read_text(encoding="utf-8")) if run.exit == 0 and written.is_file() else None
    judgement = judge(report, case.truth) if report is not None else None
    print(f"{case.name}: hidden {case.truth.hidden}, exit {run.exit}, {run.cpu_seconds:.0f} s", file=sys.stderr)
    return {
        "case": case.name,
        "family": case.family,
        "truth": dataclasses.asdict(case.truth),
        "visible": visibility(case.truth),
        "absorbed": is_absorbed(case.truth),
        "run": dataclasses.asdict(run),
        "report": short(report) if report is not None else None,
        "judgement": dataclasses.asdict(judgement) if judgement is not None else None,
    }


def short(report: dict[str, Any]) -> dict[str, Any]:
    """The report without its curves."""
    keys = ("effect", "joint", "tendon", "places", "gain", "p_value", "confusable_with", "parameters")
    causes = [{key: cause[key] for key in keys if key in cause} for cause in report["causes"]]
    kept: dict[str, Any] = {
        key: report[key] for key in ("verdict", "nominal", "extended", "gain", "unexplained") if key in report
    }
    return {**kept, "causes": causes}


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--family", choices=FAMILIES, help="one family; default: all")
    parser.add_argument("--half", choices=HALVES, default="all", help="cases of odd or even number")
    parser.add_argument("--only", type=int, nargs="+", metavar="NUMBER", help="only cases of these numbers")
    parser.add_argument("--jobs", type=int, default=1, help="cases at once")
    parser.add_argument("--limit", type=float, default=3600.0, help="s of time that a case may take")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "build" / "foreign" / "TABLE.md")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep the cases and their reports here")
    return parser.parse_args()


def main() -> None:
    given = arguments()
    tasks = [
        (module, number)
        for module in families(given.family).values()
        for number in numbers(module, given.half, given.only)
    ]
    if not tasks:
        sys.exit("no cases")
    given.output.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary, ThreadPoolExecutor(given.jobs) as pool:
        folder = (given.keep or Path(temporary)).resolve()
        rows = list(pool.map(lambda task: row_of(task[0], task[1], folder, given.limit), tasks))
    title = f"tendonfmu diagnose on foreign cases ({given.family or 'all families'}, {given.half})"
    given.output.write_text(markdown(rows, title) + "\n", encoding="utf-8")
    results = {"title": title, "summary": summary(rows), "rows": rows}
    given.output.with_suffix(".json").write_text(json.dumps(results, indent=1), encoding="utf-8")
    print(given.output)


if __name__ == "__main__":
    main()
