"""Makes the table of docs/evidence/reliability.md: python -m evidence.reliability [R7 R8 ...] [--scale 0.1]

A row's result is kept as WORK/ROW.json and not measured again, unless the row is named or --again is given. What is
kept of the rows named, or of all, is printed as Markdown, or written with -o. --scale: of the full numbers that the
page names; --minutes: the most for each row of fuzzing.

Exit status: 0 nothing was found, 1 a row found something or could not be measured.
"""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Any

from evidence import tables
from evidence.reliability import binaries, by_tests, commands, fuzz
from evidence.reliability.row import Outcome, Row, Run, Unavailable
from evidence.runner import ROOT, parser, say, write

MODULES = (fuzz, binaries, commands, by_tests)
ROWS: dict[str, Row] = {
    row.name: row for row in sorted((r for module in MODULES for r in module.ROWS), key=lambda row: int(row.name[1:]))
}


def processor_seconds() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in used)


def measure(row: Row, run: Run) -> dict[str, Any]:
    """What WORK/ROW.json holds. Any error of a row is its result: the others are still measured."""
    before = processor_seconds()
    try:
        outcome = row.measure(run)
    except Unavailable as missing:
        outcome = Outcome("–", f"SKIPPED: {missing}", True)
    except Exception as error:
        outcome = Outcome("–", f"NOT MEASURED: {type(error).__name__}: {error}".replace("\n", " "), False)
    return {**vars(outcome), "seconds": round(processor_seconds() - before, 1)}


def kept(name: str, work: Path) -> dict[str, Any] | None:
    file = work / f"{name}.json"
    return dict(json.loads(file.read_text(encoding="utf-8"))) if file.is_file() else None


def clock(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"


def table(work: Path, names: Collection[str]) -> str:
    """The rows `names`, in the order of ROWS, with what is kept of them."""
    lines = []
    for row in (row for name, row in ROWS.items() if name in names):
        cells = ["0", row.full, "not measured", ""]
        outcome = kept(row.name, work)
        if outcome is not None:
            mark = "" if outcome["sound"] else "**found:** "
            cells = [outcome["number"], row.full, mark + outcome["result"], clock(outcome["seconds"])]
        lines.append([row.name, row.title, *cells, row.leaves])
    head = ["row", "what is tried", "number", "full number", "result", "time of one core", "what that leaves open"]
    return tables.table(head, lines, len(head)) + "\n"


def main() -> int:
    options = parser(__doc__, output=None)
    options.add_argument("rows", nargs="*", metavar="ROW", help=f"of {', '.join(ROWS)}; default: those not kept yet")
    options.add_argument("--scale", type=float, default=1.0, help="part of the full numbers (default 1)")
    options.add_argument("--minutes", type=float, default=60.0, help="most for each row of fuzzing (default 60)")
    options.add_argument("--work", type=Path, default=ROOT / "build" / "reliability", help="folder of results, builds")
    options.add_argument("--again", action="store_true", help="measure kept rows, too")
    options.add_argument("--table", action="store_true", help="measure nothing, print what is kept")
    options.add_argument("-o", "--output", type=Path, help="file for the table (default: standard output)")
    given = options.parse_args()
    if unknown := set(given.rows) - set(ROWS):
        options.error(f"{', '.join(sorted(unknown))}: expected rows of {', '.join(ROWS)}")
    work = given.work.resolve()
    names = given.rows or list(ROWS)
    for name in [] if given.table else names:
        if given.rows or given.again or kept(name, work) is None:
            say(f"{name}: {ROWS[name].title} ...")
            (work / name).mkdir(parents=True, exist_ok=True)
            outcome = measure(ROWS[name], Run(given.scale, given.minutes, work / name))
            write(work / f"{name}.json", outcome)
            say(f"{name}: {outcome['number']}: {outcome['result']} ({clock(outcome['seconds'])})")
    if given.output:
        write(given.output, table(work, names))
    else:
        print(table(work, names), end="")
    return 0 if all(outcome["sound"] for name in names if (outcome := kept(name, work))) else 1


if __name__ == "__main__":
    sys.exit(main())
