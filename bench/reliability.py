"""Makes the table of docs/evidence/reliability.md: python bench/reliability.py [R7 R8 ...] [--scale 0.1]

A row's result is kept as WORK/ROW.json and not measured again, unless the row is named or --again is given. What is
kept of the rows named, or of all, is printed as Markdown, or written with -o. --scale: of the full numbers that the
issue asks for; --minutes: the most for each row of fuzzing.

Exit status: 0 nothing was found, 1 a row found something or could not be measured.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
from collections.abc import Collection
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from reliability_rows import binary_rows, command_rows, file_rows, fmu_rows, fuzz_rows, learner_rows
from reliability_rows.row import ROOT, Outcome, Row, Run, Unavailable

MODULES = (fuzz_rows, fmu_rows, binary_rows, file_rows, command_rows, learner_rows)
ROWS = {
    row.name: row
    for row in sorted((row for module in MODULES for row in module.ROWS), key=lambda row: int(row.name[1:]))
}


@dataclass(frozen=True)
class Kept:
    """What WORK/ROW.json holds: the outcome, and its time in s of the processors, children included."""

    number: str
    result: str
    sound: bool
    seconds: float


def processor_seconds() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def measure(row: Row, run: Run) -> Kept:
    """Any error of a row is its result: one row that fails does not keep the others from being measured."""
    before = processor_seconds()
    try:
        outcome = row.measure(run)
    except Unavailable as missing:
        outcome = Outcome("–", f"SKIPPED: {missing}", True)
    except Exception as error:
        outcome = Outcome("–", f"NOT MEASURED: {type(error).__name__}: {error}".replace("\n", " "), False)
    return Kept(outcome.number, outcome.result, outcome.sound, round(processor_seconds() - before, 1))


def kept(name: str, work: Path) -> Kept | None:
    file = work / f"{name}.json"
    return Kept(**json.loads(file.read_text(encoding="utf-8"))) if file.is_file() else None


def spoken(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"


def table(work: Path, names: Collection[str]) -> str:
    """The rows `names`, in the order of ROWS, with what is kept of them."""
    head = ("row", "what is tried", "number", "full number", "result", "time of one core", "what that leaves open")
    lines = [f"| {' | '.join(head)} |", "| --- | --- | --- | --- | --- | ---: | --- |"]
    for row in (row for name, row in ROWS.items() if name in names):
        found = kept(row.name, work)
        cells = [row.name, row.title, "0", row.full, "not measured", "", row.leaves]
        if found is not None:
            mark = "" if found.sound else "**found:** "
            cells[2] = found.number
            cells[4:6] = mark + found.result, spoken(found.seconds)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="*", metavar="ROW", help=f"of {', '.join(ROWS)}; default: those not kept yet")
    parser.add_argument("--scale", type=float, default=1.0, help="part of the full numbers (default 1)")
    parser.add_argument("--minutes", type=float, default=60.0, help="most for each row of fuzzing (default 60)")
    parser.add_argument(
        "--work", type=Path, default=ROOT / "build" / "reliability", help="folder for results and builds"
    )
    parser.add_argument("--again", action="store_true", help="measure kept rows, too")
    parser.add_argument("--table", action="store_true", help="measure nothing, print what is kept")
    parser.add_argument("-o", "--output", type=Path, help="file for the table (default: standard output)")
    given = parser.parse_args()
    if unknown := set(given.rows) - set(ROWS):
        parser.error(f"{', '.join(sorted(unknown))}: expected rows of {', '.join(ROWS)}")
    work = given.work.resolve()
    names = given.rows or list(ROWS)
    for name in [] if given.table else names:
        if given.rows or given.again or kept(name, work) is None:
            print(f"{name}: {ROWS[name].title} ...", file=sys.stderr, flush=True)
            (work / name).mkdir(parents=True, exist_ok=True)
            found = measure(ROWS[name], Run(given.scale, given.minutes, work / name))
            (work / f"{name}.json").write_text(json.dumps(asdict(found), indent=1) + "\n", encoding="utf-8")
            print(f"{name}: {found.number}: {found.result} ({spoken(found.seconds)})", file=sys.stderr, flush=True)
    text = table(work, names)
    if given.output:
        given.output.write_text(text, encoding="utf-8")
    else:
        print(text, end="")
    return 0 if all(each.sound for name in names if (each := kept(name, work))) else 1


if __name__ == "__main__":
    sys.exit(main())
