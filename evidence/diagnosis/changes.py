"""How often `tendonfmu diagnose --reference` says what changed: python -m evidence.diagnosis.changes hidden -o FOLDER

- hidden: different stretches of EMPS and da Vinci recordings, with a known change put on `now`, or nothing; asked with
  and without the reference (change_measured.py);
- real: another load of the da Vinci instrument that no sensor shows, or another speed (change_measured.py);
- simulated: foreign fingers recorded twice, with one number of the simulator changed, or none (change_simulated.py).

Develop on odd cases, report even ones. Writes FOLDER/changes.md.
"""

from __future__ import annotations

import importlib
import json
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.diagnosis.command import HALVES, Run, run_diagnose
from evidence.judge import UNKNOWN, Truth, alternatives, holds, judge
from evidence.runner import parser, publish, run_cases
from evidence.tables import NOTHING, Row, by, count, table
from tendonfmu.files.tables import write_table

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

UNCHANGED = "nothing"
# What a change of speed alone may show of a model that is not exact: not false where `now` is faster or slower.
BY_SPEED = ("viscous_friction", "stribeck", "time_delay", "inertia")
# A change of load that no sensor shows is a constant torque: these answers say so. Names of friction are wrong there.
LOAD = ("contact", "force_offset", "gravity")
MODULES = {"hidden": "change_measured", "real": "change_real", "simulated": "change_simulated"}
WITH, WITHOUT = "reference", "no reference"
ASKED = {"hidden": (WITH, WITHOUT), "real": (WITH,), "simulated": (WITH,)}


@dataclass(frozen=True)
class Change:
    """The machine as it was (`then`) and with a change, or without one (`now`): no sample is in both."""

    machine: str  # or the simulator
    model: str  # diagnosed, plain, or fitted: as the simulator's is
    hidden: str  # name of the change as its bed calls it
    conditions: str  # how `now` was recorded: repeat, part, motion, load, speed, excitation, pretension, length
    kinematics: int
    finger: Mapping[str, Any]
    then: Sequence[Columns]
    now: Sequence[Columns]
    truth: Truth = field(default_factory=Truth)
    strength: float = 0.0  # variance of the added torque over that of what the model leaves of the unaltered `now`


Makers = dict[int, Callable[[], Change]]


def makers(bed: str) -> Makers:
    """By number, what makes the case. It raises ValueError where the case cannot be."""
    made: Makers = importlib.import_module(f"evidence.diagnosis.{MODULES[bed]}").makers()
    return made


# --- one case ---------------------------------------------------------------------------------------------------------


def run_case(bed: str, number: int) -> dict[str, Any]:
    try:
        change = makers(bed)[number]()
    except ValueError as impossible:
        return {"bed": bed, "impossible": str(impossible)}
    with tempfile.TemporaryDirectory() as folder:
        then, now = write_case(change, Path(folder))
        reference = [argument for file in then for argument in ("--reference", file)]
        arguments = ["finger.json", *now, "--kinematics", str(change.kinematics)]
        answers = [
            answer_of(change, asked, run_diagnose([*arguments, *(reference if asked == WITH else [])], Path(folder)))
            for asked in ASKED[bed]
        ]
    common = {key: getattr(change, key) for key in ("machine", "model", "hidden", "conditions", "strength")}
    return {"bed": bed, **common, "answers": answers}


def write_case(change: Change, folder: Path) -> tuple[list[str], list[str]]:
    """finger.json and the recordings; their names, then and now."""
    (folder / "finger.json").write_text(json.dumps(change.finger), encoding="utf-8")
    names: dict[str, list[str]] = {"then": [], "now": []}
    for kind, recordings in (("then", change.then), ("now", change.now)):
        for k, columns in enumerate(recordings, 1):
            names[kind].append(f"{kind}_{k}.parquet")
            write_table(folder / names[kind][-1], dict(columns))
    return names["then"], names["now"]


def answer_of(change: Change, asked: str, run: Run) -> dict[str, Any]:
    answer = {"asked": asked, "exit": run.exit, "message": run.message, "seconds": run.seconds}
    if run.report is None:
        return answer
    truth, causes = change.truth, [cause for cause in run.report["causes"] if cause["effect"] != UNKNOWN]
    judgement = judge(run.report["causes"], truth)
    return answer | {
        "verdict": run.report["verdict"],
        "causes": " ".join(
            "/".join([cause["effect"], *(other["effect"] for other in alternatives(cause))]) for cause in causes
        ),
        "named": judgement.named,
        "false": judgement.false,
        "friction": judgement.friction,
        "unknown": judgement.unknown,
        "in_set": judgement.in_set,
        "first": judgement.first,
        "at_place": judgement.at_place if truth.has_place else None,
        "sign": judgement.sign,
        "set_size": judgement.set_size if any(holds(cause, truth) for cause in causes) else None,
    }


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
    sizes = [row["set_size"] for row in rows if row["set_size"] is not None]
    rates = [rate(rows, key) for key in ("in_set", "first", "sign", "at_place", "false")]
    return [*rates, f"{np.mean(sizes):.1f}" if sizes else NOTHING, seconds(rows)]


def load_cells(rows: Sequence[Row]) -> list[str]:
    """What another load is taken for. One report may count in the first column and others."""
    answers: Iterable[Iterable[Any]] = (
        (set(row["named"]) & set(LOAD) for row in rows),
        (row["friction"] for row in rows),
        (set(row["false"]) - set(row["friction"]) for row in rows),
        (not row["named"] for row in rows),
    )
    return [count(hits, with_interval=True) for hits in answers]


UNCHANGED_HEAD = ("named", "named beyond what speed explains", "unknown", "CPU s: median, most")
CHANGED_HEAD = ("in the set", "first", "sign right", "at its place", "a wrong name beside", "set", "CPU s")
LOAD_HEAD = (f"said: {', '.join(LOAD)}", "said: friction", "said: anything else", "said nothing")
BY_STRENGTH = (("strength",), ("conditions", "strength"), ("machine", "model", "strength"), ("hidden",))


def markdown(rows: Sequence[Row]) -> str:
    """All tables that the rows have cases for."""
    answers = [row | answer for row in rows for answer in row.get("answers", ())]
    failed = [answer for answer in answers if answer["exit"] != 0]
    good = [answer for answer in answers if answer["exit"] == 0]
    loads = [row for row in good if row["bed"] == "real" and row["conditions"] == "load"]
    others = [row for row in good if row not in loads]
    unchanged = [row for row in others if row["hidden"] == UNCHANGED]
    changed = [row for row in others if row["hidden"] != UNCHANGED]
    parts = [
        f"{len(answers)} answers, {len(failed)} without a report; {len(rows)} cases, "
        f"{sum('impossible' in row for row in rows)} that cannot be made.",
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
    options.add_argument("bed", choices=MODULES)
    options.add_argument("--half", choices=HALVES, default="all", help="cases of odd or even number")
    given = options.parse_args()
    cases = cases_of(given.bed, given.half)
    rows = run_cases(run_case, cases, given.output, given.workers, given.scheduler)
    publish(given.output / "changes.md", markdown(rows))


if __name__ == "__main__":
    main()
