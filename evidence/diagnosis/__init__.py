"""How often does `diagnose` name the right cause, and how often a wrong one?

Fingers that share no code and no friction law with the product: recordings of somebody else's, and fingers by seed
(evidence/families). Each description lacks one effect that the finger has, or nothing. Constants of the product were
chosen on even seeds and numbers; the odd ones judge it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from evidence.cases import FOREIGN, run_cases
from evidence.diagnosis import sizes
from evidence.diagnosis.case import Case, diagnosed
from evidence.diagnosis.judge import UNKNOWN, Truth, in_words, judge, leaves_unnamed
from evidence.families import cases
from evidence.families.finger import NONE
from evidence.part import Figures, Part
from evidence.table import NOTHING, Row, count, table, where
from tendonfmu.statistics.intervals import share

FAMILIES = ("recorded", *cases.FAMILIES)
SEEDS = range(1, 2 * len(cases.ORDER), 2)
RECORDED = range(1, 27, 2)
# What a simulator has although no description says so; naming it is not false. Presliding and what belongs to it are
# right in every case: no simulator's friction jumps as the paper's laws do.
ALSO = {
    "elastic": ("inertia", "inertia_variation", "cord_stretch", "relaxation"),
    "dahl": (),
    "maxwell": (),
    "recorded": (),
}
MEMORY = ("presliding", "relaxation", "cord_stretch")
# Effects that refitting the description's own numbers takes up on the recorded fingers, so that less than a tenth of
# the residual's variance is left to see: naming them is right, and so is not naming them.
ABSORBED = ("inertia", "force_gain", "asymmetric_friction", "moment_arm", "force_offset")


# --- cases ------------------------------------------------------------------------------------------------------------


def run_case(family: str, number: int, folder: Path) -> Row:
    """The row of a case; `hidden` alone where what it hides cannot be seen in its torque."""
    row: Row = {"family": family, "number": number}
    if family == "recorded":
        case, hidden = recorded(number)
        truth, true = case.truth, {}
    else:
        kept = cases.kept(folder, family, number)
        hidden = kept.hidden.effect
        if not cases.is_case(kept, cases.LEFT[family]):
            return {**row, "hidden": hidden, "dropped": True}
        truth = truth_of(family, hidden, kept.hidden.joint, kept.hidden.tendon)
        train, test = kept.recordings["train"], kept.recordings["test"]
        case, true = (
            Case(kept.nominal, train, truth, test, kinematics=2),
            sizes.true_numbers(*cases.machine(family, number)[:2]),
        )
    report, seconds = diagnosed(case)
    return {
        **row,
        "hidden": hidden,
        "dropped": False,
        "verdict": report["verdict"],
        "left": report["extended"]["test_rms"],
        "causes": [in_words(cause) for cause in report["causes"]],
        "gains": [cause["gain"]["value"] for cause in report["causes"]],
        "sizes": [cause["size"] for cause in report["causes"]],
        "too_small": [in_words(cause) for cause in report["too_small"]],
        **judge(report["causes"], truth, report["too_small"]),
        "sized": sizes.are_covered(report["causes"], truth, true),
        "unnamed": leaves_unnamed(report),
        "seconds": round(seconds, 1),
    }


def recorded(number: int) -> tuple[Case, str]:
    """A LuGre finger that nobody of the project made, in `shared/foreign` beside the repository; what it hides."""
    name = f"case_{number:02d}"
    truth, finger = (json.loads((FOREIGN / f"{file}.json").read_text(encoding="utf-8")) for file in ("truth", name))
    hidden, (joint, tendon) = truth[name]["hidden"], map(truth[name].get, ("joint", "tendon"))
    train, test = (pd.read_parquet(FOREIGN / f"{name}_{part}.parquet") for part in ("train", "test"))
    visible = hidden not in ABSORBED
    return Case(finger, train, truth_of("recorded", hidden, joint, tendon, visible), test), hidden


def truth_of(family: str, hidden: str, joint: int | None, tendon: int | None, visible: bool = True) -> Truth:
    """What counts; what is on no list may look like a contact."""
    outside = is_outside(hidden)
    return Truth(
        effects=() if outside or hidden == NONE else (hidden,),
        joint=joint,
        tendon=tendon,
        allowed=(*ALSO[family], "contact") if outside else ALSO[family],
        ignored=(*MEMORY, UNKNOWN),
        visible=visible,
    )


def is_outside(hidden: str) -> bool:
    """Whether what is hidden is no effect that `diagnose` knows."""
    return hidden.startswith("unknown")


def measure(folder: Path, workers: int) -> Figures:
    numbers = {family: RECORDED if family == "recorded" else SEEDS for family in FAMILIES}
    rows = run_cases(
        run_case,
        {f"{family}_{n:03d}": (family, n, folder / "cases") for family in FAMILIES for n in numbers[family]},
        folder,
        workers,
    )
    return figures_of(rows)


# --- figures and tables -----------------------------------------------------------------------------------------------

Question = Callable[[Row], bool | None]  # None: it does not arise


def of_nulls(question: Question) -> Question:
    return lambda row: question(row) if row["hidden"] == NONE else None


def of_outsiders(question: Question) -> Question:
    return lambda row: question(row) if is_outside(row["hidden"]) else None


RATES: dict[str, tuple[str, str, Question]] = {
    "right": ("the hidden effect is in the set", "≥ 95 %", lambda row: row["right"]),
    "is_cause": ("the same, without names that are too small to matter", "", lambda row: row["is_cause"]),
    "first": ("it is named first", "≥ 90 %", lambda row: row["first"]),
    "at_place": ("its joint and tendon are right, where it is named", "≥ 95 %", lambda row: row["at_place"]),
    "sized": ("its size lies within the 95 % interval", "≥ 88 %", lambda row: row["sized"]),
    "wrong": ("a wrong cause", "≤ 5 %", lambda row: bool(row["wrong"])),
    "wrong_null": ("nothing hidden: a wrong cause", "≤ 2 %", of_nulls(lambda row: bool(row["wrong"]))),
    "unnamed_null": ("nothing hidden: reported as unexplained", "", of_nulls(lambda row: row["unnamed"])),
    "unnamed": ("no effect of the list: reported to remain", "≥ 90 %", of_outsiders(lambda row: row["unnamed"])),
    "misled": (
        "no effect of the list: a wrong cause, and nothing unexplained",
        "",
        of_outsiders(lambda row: bool(row["wrong"]) and not row["unnamed"]),
    ),
}


def figures_of(rows: Sequence[Row]) -> Figures:
    """Rates of all cases and by family; and the rows."""
    judged = [row for row in rows if not row["dropped"]]
    groups = {"all": judged, **{family: where(judged, family=family) for family in FAMILIES}}
    return {"rates": {name: rates(members) for name, members in groups.items() if members}, "cases": list(rows)}


def rates(rows: Sequence[Row]) -> dict[str, Any]:
    seconds = [row["seconds"] for row in rows]
    answers = {name: [a for a in map(question, rows) if a is not None] for name, (_, _, question) in RATES.items()}
    left = [1e3 * float(np.sqrt(np.mean(np.square(row["left"])))) for row in rows if row["hidden"] == NONE]
    return {name: _rate(found) for name, found in answers.items()} | {
        "seconds": {"median": float(np.median(seconds)), "most": max(seconds)},
        "left": float(np.median(left)) if left else None,
    }


def _rate(answers: Sequence[bool]) -> dict[str, Any]:
    if not answers:
        return {"hits": 0, "of": 0, "share": None}
    known = share(sum(answers), len(answers))
    return {"hits": sum(answers), "of": len(answers), "share": known.value, "interval": [known.low, known.high]}


def rates_table(figures: Figures) -> str:
    groups = figures["rates"]
    lines = [
        [words, goal, *(f"{group[name]['hits']} of {group[name]['of']}" for group in groups.values())]
        for name, (words, goal, _) in RATES.items()
    ]
    left = [NOTHING if group["left"] is None else f"{group['left']:.2f}" for group in groups.values()]
    spent = [f"{group['seconds']['median']:.0f} s, {group['seconds']['most']:.0f} s" for group in groups.values()]
    lines.append(["nothing hidden: left on the test, mN·m, median", "", *left])
    return table(["", "goal", *groups], [*lines, ["processor time, median and most", "", *spent]], 2)


def effects_table(figures: Figures) -> str:
    """What becomes of each effect, over all cases."""
    rows = [row for row in figures["cases"] if not row["dropped"]]
    lines = []
    for hidden in dict.fromkeys(row["hidden"] for row in sorted(rows, key=lambda row: order(row["hidden"]))):
        members = where(rows, hidden=hidden)
        wrong = dict.fromkeys(name for row in members for name in row["wrong"])
        keys = ("right", "first", "at_place", "sized")
        answers = [count(row[key] for row in members if row[key] is not None) for key in keys]
        unnamed = sum(row["unnamed"] for row in members)
        lines.append([hidden, len(members), *answers, unnamed, ", ".join(wrong) or NOTHING])
    head = ["hidden", "cases", "in the set", "first", "at its place", "size covered", "unexplained", "wrong causes"]
    return table(head, lines)


def order(hidden: str) -> tuple[bool, bool, str]:
    return hidden != NONE, is_outside(hidden), hidden


PARTS = {
    "hidden_effects": Part(
        run=measure,
        needs=("../shared/foreign", "mujoco"),
        headlines={"rates.all.wrong_null.share": (0.0, 0.1)},
        tables={"rates": rates_table, "effects": effects_table},
    )
}
