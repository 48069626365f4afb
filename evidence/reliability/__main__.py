"""Makes the table of docs/evidence/reliability.md: python -m evidence.reliability [R16 R17 ...] [--scale 0.1]

The page has what each row tries, its full number and what it leaves open; a row's measurement is made here. Its result
is kept as WORK/ROW.json and not measured again, unless the row is named or --again is given. What is
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
from evidence.reliability import commands, fuzz
from evidence.reliability.row import Measure, Outcome, Run, Unavailable
from evidence.runner import ROOT, parser, say, write

PAGE = ROOT / "docs" / "evidence" / "reliability.md"
ROWS: dict[str, Measure] = {**fuzz.ROWS, **commands.ROWS}


def rows_of_the_page() -> dict[str, list[str]]:
    """Cells of the table of all rows, by name; the first line is its head."""
    lines = [line.strip("| ").split(" | ") for line in PAGE.read_text(encoding="utf-8").splitlines()]
    return {cells[0]: cells for cells in lines if len(cells) == 7 and cells[0] != "---"}


def processor_seconds() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in used)


def measured(measure: Measure, run: Run) -> dict[str, Any]:
    """What WORK/ROW.json holds. Any error of a row is its result: the others are still measured."""
    before = processor_seconds()
    try:
        outcome = measure(run)
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
    """The rows `names`, in the order of the page, with what is kept of them."""
    head, *rows = [cells for name, cells in rows_of_the_page().items() if name in ("row", *names)]
    lines = []
    for name, title, _, full, _, _, leaves in rows:
        cells = ["0", full, "not measured", ""]
        outcome = kept(name, work)
        if outcome is not None:
            mark = "" if outcome["sound"] else "**found:** "
            cells = [outcome["number"], full, mark + outcome["result"], clock(outcome["seconds"])]
        lines.append([name, title, *cells, leaves])
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
    names = given.rows or [name for name in rows_of_the_page() if name in ROWS]
    for name in [] if given.table else names:
        if given.rows or given.again or kept(name, work) is None:
            say(f"{name} ...")
            (work / name).mkdir(parents=True, exist_ok=True)
            outcome = measured(ROWS[name], Run(given.scale, given.minutes, work / name))
            write(work / f"{name}.json", outcome)
            say(f"{name}: {outcome['number']}: {outcome['result']} ({clock(outcome['seconds'])})")
    if given.output:
        write(given.output, table(work, names))
    else:
        print(table(work, names), end="")
    outcomes = [kept(name, work) for name in names]
    return 0 if all(outcome["sound"] for outcome in outcomes if outcome) else 1


if __name__ == "__main__":
    sys.exit(main())
