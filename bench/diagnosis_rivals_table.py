"""`diagnose` and its rivals on the same cases, in one table: python bench/diagnosis_rivals_table.py -o FOLDER

Writes FOLDER/cases.json, runs `tendonfmu campaign` with the rivals beside it (the same command goes on where it was
interrupted), and writes FOLDER/rivals.md. Needs requirements-diagnosis-peers.lock and requirements-foreign.lock.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

BENCH = Path(__file__).resolve().parent
sys.path.append(str(BENCH.parent / "python_tests" / "foreign"))

from foreign_case import Truth  # noqa: E402
from judgement import NEUTRAL, is_at_place, is_named, is_true  # noqa: E402

Row = Mapping[str, Any]
Cause = Mapping[str, Any]

OWN = "diagnose"
SETS = ("parity",)  # rivals that name a set without an order
MODELS = (OWN, "discrepancy")  # what predicts


@dataclass(frozen=True)
class Verdict:
    """What an answer is worth. None where a question does not arise. false: causes that are not there."""

    false: int
    in_set: bool | None
    first: bool | None
    at_place: bool | None
    set_size: int | None


def judged(row: Row, who: str) -> Verdict:
    """The same questions for everybody; on foreign fingers presliding is never false (python_tests/foreign)."""
    causes = [cause for cause in _causes(row, who) if _counts(cause, row)]
    if who in SETS and causes:
        causes = [{**causes[0], "confusable_with": causes[1:]}]
    size = len(_effects(causes[0])) if causes else None
    if row["group"] != "single":
        return Verdict(len(causes), None, None, None, size)
    truth = _truth(row)
    true = [cause for cause in causes if is_true(cause, truth)]
    alone = who not in SETS or size == 1
    return Verdict(
        false=sum(cause not in true and cause["effect"] not in truth.also for cause in causes),
        in_set=bool(true),
        first=bool(causes) and alone and is_named(causes[0], truth),
        at_place=any(is_at_place(cause, truth) for cause in true) if true else None,
        set_size=len(_effects(true[0])) if true else size,
    )


def _causes(row: Row, who: str) -> list[dict[str, Any]]:
    """As in a report of `diagnose`."""
    listed = json.loads(row["causes" if who == OWN else f"{who}.causes"])
    return [{**cause, "confusable_with": cause.get("set") or []} for cause in listed]


def _counts(cause: Cause, row: Row) -> bool:
    return cause["effect"] not in NEUTRAL if _is_foreign(row) else cause["effect"] != "unknown"


def _is_foreign(row: Row) -> bool:
    return not str(row["rig"]).startswith("matched")


def _truth(row: Row) -> Truth:
    place = {key: None if row[f"true_{key}"] is None else int(row[f"true_{key}"]) for key in ("joint", "tendon")}
    also = tuple(name for name in str(row.get("simulated_too") or "").split(",") if name)
    return Truth(row["true_effect"], joints=int(row["joints"]), **place, also=also)


def _effects(cause: Cause) -> set[str]:
    return {cause["effect"], *(each["effect"] for each in cause.get("confusable_with") or ())}


# --- the table --------------------------------------------------------------------------------------------------------


def markdown(rows: Sequence[Row]) -> str:
    """rows: of `tendonfmu campaign` with the rivals beside; those that ended in an error are left out."""
    good = [row for row in rows if not row["error"]]
    names = [OWN, *dict.fromkeys(key.rsplit(".", 1)[0] for row in good for key in row if key.endswith(".cause_count"))]
    lines = [["", *names], ["---", *["---:"] * len(names)]]
    for family, own in (
        ("matched", [row for row in good if not _is_foreign(row)]),
        ("foreign", [row for row in good if _is_foreign(row)]),
    ):
        lines += [[f"{family}, {what}", *(cell(own, name) for name in names)] for what, cell in CELLS.items()]
    table = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    failed = len(rows) - len(good)
    return table + "\n" + (f"\n{failed} of {len(rows)} cases ended in an error and are left out.\n" if failed else "")


def _share(group: str, holds: Callable[[Verdict], bool | None]) -> Callable[[Sequence[Row], str], str]:
    def cell(rows: Sequence[Row], who: str) -> str:
        if who == "discrepancy":
            return "names nothing"
        answers = [holds(judged(row, who)) for row in rows if row["group"] == group]
        asked = [answer for answer in answers if answer is not None]
        return f"{sum(asked)} of {len(asked)}" if asked else "–"

    return cell


def _mean(group: str, number: Callable[[Verdict], int | None]) -> Callable[[Sequence[Row], str], str]:
    def cell(rows: Sequence[Row], who: str) -> str:
        values = [number(judged(row, who)) for row in rows if row["group"] == group and who != "discrepancy"]
        known = [value for value in values if value is not None]
        return f"{statistics.fmean(known):.2f}" if known else "–"

    return cell


def _unnamed(group: str) -> Callable[[Sequence[Row], str], str]:
    """Says that something is there that it cannot name; who never says so has a dash."""

    def cell(rows: Sequence[Row], who: str) -> str:
        key = "unknown" if who == OWN else f"{who}.unknown"
        said = [row[key] for row in rows if row["group"] == group and row.get(key) is not None]
        return f"{sum(said)} of {len(said)}" if said else "–"

    return cell


def _gain(group: str) -> Callable[[Sequence[Row], str], str]:
    def cell(rows: Sequence[Row], who: str) -> str:
        key = "gain" if who == OWN else f"{who}.gain"
        values = [row[key] for row in rows if row["group"] == group and who in MODELS and row.get(key) is not None]
        if not values:
            return "–"
        return f"{100 * statistics.median(values):.1f} % ({100 * min(values):.1f} to {100 * max(values):.1f})"

    return cell


CELLS: dict[str, Callable[[Sequence[Row], str], str]] = {
    "nothing hidden: names something": _share("null", lambda it: it.false > 0),
    "one effect: in the set": _share("single", lambda it: it.in_set),
    "one effect: first": _share("single", lambda it: it.first),
    "one effect: at its place, where in the set": _share("single", lambda it: it.at_place),
    "one effect: false causes per case": _mean("single", lambda it: it.false),
    "one effect: effects in the set": _mean("single", lambda it: it.set_size),
    "not on the list: names something": _share("unknown", lambda it: it.false > 0),
    "not on the list: says there is something, unnamed": _unnamed("unknown"),
    "nothing hidden: gain, median and range": _gain("null"),
    "one effect: gain": _gain("single"),
    "not on the list: gain": _gain("unknown"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--seed", type=int, default=88100, help="of the matched rigs")
    parser.add_argument("--workers", type=int, default=1, help="worker processes")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    cases, folder = given.output / "cases.json", given.output / "campaign"
    maker = [str(BENCH / "diagnosis_rivals_cases.py"), "-o", str(cases), "--seed", str(given.seed)]
    subprocess.run([sys.executable, *maker], check=True)
    program = [sys.executable, "-c", "from tendonfmu.cli import main; main()", "campaign", str(cases)]
    beside = ["--beside", f"{BENCH / 'diagnosis_rivals.py'}:beside", "--workers", str(given.workers)]
    one_thread = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    ended = subprocess.run([*program, "-o", str(folder), *beside], env=one_thread).returncode
    if ended not in (0, 1):  # 1: a case ended in an error, and the table says so
        sys.exit(ended)
    listed = json.loads(cases.read_text(encoding="utf-8"))["cases"]
    rows = [json.loads((folder / "rows" / f"{each['name']}.json").read_text(encoding="utf-8")) for each in listed]
    (given.output / "rivals.md").write_text(markdown(rows), encoding="utf-8")
    print(given.output / "rivals.md")


if __name__ == "__main__":
    main()
