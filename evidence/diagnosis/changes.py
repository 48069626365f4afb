"""How often `tendonfmu diagnose --reference` says what changed: python -m evidence.diagnosis.changes hidden -o FOLDER

The beds are described in README.md. Develop on odd cases, report even ones. Writes FOLDER/changes.md. `history` writes
no table, but six dated recordings:

    python -m evidence.diagnosis.changes history -o history
    tendonfmu diagnose history/finger.json history/2026-*.parquet --history -o out
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np

from evidence.diagnosis.case import Case, Run, run_command
from evidence.diagnosis.change_measured import ARM, LOAD_NAMES, UNCHANGED, Makers, hidden_makers, real_makers
from evidence.fingers.families import HALVES
from evidence.judge import Cause, alternatives, judge
from evidence.runner import parser, publish, run_cases
from evidence.tables import Row, by, count, table

BEDS = ("hidden", "arm", "real", "simulated")
WITH, WITHOUT = "reference", "no reference"
ASKED = {"hidden": (WITH, WITHOUT), "arm": (WITH, WITHOUT), "real": (WITH,), "simulated": (WITH,)}


def makers(bed: str) -> Makers:
    if bed == "simulated":
        made: Makers = simulated_changes().makers()
        return made
    return hidden_makers() if bed == "hidden" else hidden_makers(ARM) if bed == "arm" else real_makers()


def simulated_changes() -> ModuleType:
    return importlib.import_module("evidence.diagnosis.change_simulated")  # mujoco need not be there for the others


# --- one case ---------------------------------------------------------------------------------------------------------


def run_case(bed: str, number: int) -> dict[str, Any]:
    try:
        case = makers(bed)[number]()
    except ValueError as impossible:
        return {"bed": bed, "impossible": str(impossible)}
    answers = []
    for asked in ASKED[bed]:
        usual = usual_names(case) if asked == WITHOUT and case.unaltered else ()
        answers.append(answer_of(case, asked, run_command(case, with_reference=asked == WITH), usual))
    return {"bed": bed, **case.facts, "answers": answers}


def usual_names(case: Case) -> Sequence[str]:
    """What the machine by itself lacks, by its model: named without a change, so that it is not false beside one."""
    run = run_command(replace(case, recordings=case.unaltered), with_reference=False)
    return [cause["effect"] for cause in run.report["causes"]] if run.report else ()


def answer_of(case: Case, asked: str, run: Run, usual: Sequence[str] = ()) -> dict[str, Any]:
    answer: dict[str, Any] = {"asked": asked, "exit": run.exit, "message": run.message, "seconds": run.seconds}
    if run.report is None:
        return answer
    (truth,), causes = case.truths, run.report["causes"]
    judgement = judge(causes, replace(truth, allowed=(*truth.allowed, *usual)))
    answer |= {"verdict": run.report["verdict"], "causes": [words(cause) for cause in causes], **vars(judgement)}
    return answer | {"at_place": judgement.at_place if truth.has_place else None}


def words(cause: Cause) -> str:
    """The effect and its alternatives."""
    return "/".join([cause["effect"], *(other["effect"] for other in alternatives(cause))])


def cases_of(bed: str, half: str) -> dict[str, tuple[str, int]]:
    """Cases of a half, in an order that is drawn, always the same: a run that is cut has a fair part of all."""
    numbers = np.random.default_rng(0).permutation([n for n in sorted(makers(bed)) if n % 2 in HALVES[half]])
    return {f"{bed}_{number:04d}": (bed, number) for number in numbers.tolist()}


# --- tables -----------------------------------------------------------------------------------------------------------

Cells = Callable[[Sequence[Row]], Sequence[str]]


def rate(rows: Sequence[Row], key: str) -> str:
    """Of the rows for which the question arises; a list counts if it is not empty."""
    return count((row[key] for row in rows if row[key] is not None), with_interval=True)


def seconds(rows: Sequence[Row]) -> str:
    spent = [row["seconds"] for row in rows]
    return f"{np.median(spent):.1f}, {max(spent):.1f}"


def unchanged_cells(rows: Sequence[Row]) -> list[str]:
    return [*(rate(rows, key) for key in ("named", "false", "unknown")), seconds(rows)]


def changed_cells(rows: Sequence[Row]) -> list[str]:
    return [*(rate(rows, key) for key in ("in_set", "first", "sign", "at_place", "false")), seconds(rows)]


def load_cells(rows: Sequence[Row]) -> list[str]:
    """What another load is taken for. One report may count in the first column and others."""
    answers: Iterable[Iterable[Any]] = (
        (set(row["named"]) & set(LOAD_NAMES) for row in rows),
        (row["friction"] for row in rows),
        (set(row["false"]) - set(row["friction"]) for row in rows),
        (not row["named"] for row in rows),
    )
    return [count(hits, with_interval=True) for hits in answers]


UNCHANGED_HEAD = ("named", "named beyond what speed explains", "unknown", "CPU s: median, most")
CHANGED_HEAD = ("in the set", "first", "sign right", "at its place", "a wrong name beside", "CPU s: median, most")
LOAD_HEAD = (f"said: {', '.join(LOAD_NAMES)}", "said: friction", "said: anything else", "said nothing")
BY_STRENGTH = (("strength",), ("conditions", "strength"), ("machine", "model", "strength"), ("hidden",))


def markdown(rows: Sequence[Row]) -> str:
    """All tables that the rows have cases for."""
    answers = [row | answer for row in rows for answer in row.get("answers", ())]
    failed = [answer for answer in answers if answer["exit"] != 0]
    good = [answer for answer in answers if answer["exit"] == 0]
    loads = [row for row in good if row["bed"] == "real" and row["conditions"] == "load"]
    others = [row for row in good if row not in loads]
    unchanged = [row for row in others if row["hidden"] == UNCHANGED]
    # without a reference, a number of the model that has changed is simply its number
    taken_up = [row for row in others if row["asked"] == WITHOUT and row.get("by") == "whole"]
    changed = [row for row in others if row["hidden"] != UNCHANGED and row not in taken_up]
    parts = [
        f"{len(answers)} answers, {len(failed)} without a report; {len(rows)} cases, "
        f"{sum('impossible' in row for row in rows)} that cannot be made.",
        f"{len(taken_up)} answers without a reference are left out: refitting takes the change up.",
        *(f"- {row['name']}, {row['asked']}: exit {row['exit']}: {row['message']}" for row in failed),
        *views("Nothing changed", unchanged, ((), ("machine", "conditions")), UNCHANGED_HEAD, unchanged_cells),
        *views("Something changed", changed, BY_STRENGTH, CHANGED_HEAD, changed_cells),
        *views("Another load, not shown", loads, (("model",),), LOAD_HEAD, load_cells),
    ]
    return "\n\n".join(parts) + "\n"


def views(
    title: str, rows: Sequence[Row], keys: Iterable[tuple[str, ...]], head: Sequence[str], cells: Cells
) -> Iterator[str]:
    for more in keys if rows else ():
        columns = ("asked", *more)
        ordered = sorted(rows, key=lambda row: tuple(row[column] for column in columns))
        lines = table((*columns, *head), by(ordered, columns, cells), len(columns))
        yield f"**{title}**, by {', '.join(columns)}\n\n{lines}"


def main() -> None:
    options = parser(__doc__)
    options.add_argument("bed", choices=(*BEDS, "history"))
    options.add_argument("--half", choices=HALVES, default="all", help="cases of odd or even number")
    given = options.parse_args()
    if given.bed == "history":
        given.output.mkdir(parents=True, exist_ok=True)
        simulated_changes().write_history(given.output)
        return
    cases = cases_of(given.bed, given.half)
    rows = run_cases(run_case, cases, given.output, given.workers, given.scheduler)
    publish(given.output / "changes.md", markdown(rows))


if __name__ == "__main__":
    main()
