"""How often does `diagnose` name the right cause, and how often a wrong one?

Fingers that share no code and no friction law with the product: recordings of somebody else's, simulators in numpy, and
MuJoCo. Each description lacks one effect that the finger has, or nothing (evidence/fingers). Constants of the product
were chosen on the cases of odd number; those of even number judge it.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evidence.cases import run_cases
from evidence.diagnosis.case import Case, diagnosed
from evidence.diagnosis.judge import UNKNOWN, Truth, judge, leaves_unnamed
from evidence.fingers import foreign
from evidence.part import Figures, Part
from evidence.table import NOTHING, Row, count, table, where
from tendonfmu.statistics.intervals import share

FAMILIES = {"recorded": "recorded", "numpy": "numpy_cases", "mujoco": "mujoco_cases"}
# Effects that refitting the description's own numbers takes up, so that less than VISIBLE of the residual's variance is
# left to see. Not naming them is right, naming them is right too; another name is wrong as anywhere.
VISIBLE = 0.1
ABSORBED = (
    "inertia",  # slow motion: a share of a mN·m, within the friction's own misfit
    "force_gain",  # a gain scales the friction of its tendon, and so do the laws
    "asymmetric_friction",  # the slow bias takes the mean of both directions
    "moment_arm",  # co-contraction makes it a nearly constant torque
    "force_offset",  # a constant torque and a constant angle: the bias and the covers' rest angles take them
)
NONE = "none"


# --- cases ------------------------------------------------------------------------------------------------------------


def make(family: str, number: int) -> tuple[Case, str]:
    """The case of that number, and what it hides. Joint angles are left unused."""
    made = importlib.import_module(f"evidence.fingers.{FAMILIES[family]}").make(number)
    return Case(made.nominal, made.train, truth_of(made.truth), test=made.test), made.truth.hidden


def truth_of(truth: foreign.Truth) -> Truth:
    """What counts. Presliding is right in every case: no simulator's friction jumps as the paper's laws do; and what is
    on no list may look like a contact."""
    outside = is_outside(truth.hidden)
    absorbed = truth.hidden in ABSORBED or (truth.survives is not None and truth.survives < VISIBLE)
    return Truth(
        effects=() if outside or truth.hidden == NONE else (truth.hidden,),
        joint=truth.joint,
        tendon=truth.tendon,
        allowed=(*truth.also, "contact") if outside else truth.also,
        ignored=("presliding", UNKNOWN),
        visible=not absorbed,
    )


def is_outside(hidden: str) -> bool:
    """Whether what is hidden is no effect that `diagnose` knows."""
    return hidden.startswith("unknown")


def run_case(family: str, number: int) -> Row:
    case, hidden = make(family, number)
    report, seconds = diagnosed(case)
    return {
        "family": family,
        "number": number,
        "hidden": hidden,
        "verdict": report["verdict"],
        "causes": [in_words(cause) for cause in report["causes"]],
        "too_small": [in_words(cause) for cause in report["too_small"]],
        **judge(report["causes"], case.truth, report["too_small"]),
        "unnamed": leaves_unnamed(report),
        "seconds": round(seconds, 1),
    }


def in_words(cause: Mapping[str, Any]) -> str:
    """An effect and its place in a few signs: gravity j1, edge_friction j2 t3."""
    places = [f"{sign}{cause[key]}" for key, sign in (("joint", "j"), ("tendon", "t")) if cause.get(key)]
    return " ".join([cause["effect"], *places])


def measure(folder: Path, workers: int) -> Figures:
    cases = {
        f"{family}_{number:02d}": (family, number)
        for family, module in FAMILIES.items()
        for number in importlib.import_module(f"evidence.fingers.{module}").NUMBERS
    }
    return figures_of(run_cases(run_case, cases, folder, workers))


# --- figures and tables -----------------------------------------------------------------------------------------------

Question = Callable[[Row], bool | None]  # None: it does not arise


def of_nulls(question: Question) -> Question:
    return lambda row: question(row) if row["hidden"] == NONE else None


def of_outsiders(question: Question) -> Question:
    return lambda row: question(row) if is_outside(row["hidden"]) else None


RATES: dict[str, tuple[str, str, Question]] = {
    "right": ("the hidden effect is named", "≥ 85 %", lambda row: row["right"]),
    "is_cause": ("the same, without names that are too small to matter", "", lambda row: row["is_cause"]),
    "first": ("it is named first", "≥ 75 %", lambda row: row["first"]),
    "at_place": ("its joint and tendon are right, where it is named", "≥ 90 %", lambda row: row["at_place"]),
    "wrong": ("a wrong cause", "≤ 15 %", lambda row: bool(row["wrong"])),
    "wrong_null": ("nothing hidden: a wrong cause", "≤ 3 %", of_nulls(lambda row: bool(row["wrong"]))),
    "unnamed_null": ("nothing hidden: reported as unexplained", "≤ 3 %", of_nulls(lambda row: row["unnamed"])),
    "unnamed": ("no effect of the list: reported as unexplained", "≥ 85 %", of_outsiders(lambda row: row["unnamed"])),
    "misled": (
        "no effect of the list: a wrong cause, and nothing unexplained",
        "≤ 5 %",
        of_outsiders(lambda row: bool(row["wrong"]) and not row["unnamed"]),
    ),
}


def figures_of(rows: Sequence[Row]) -> Figures:
    """Rates by the half of the cases, and of the even half by family; and the rows."""
    even, odd = ([row for row in rows if row["number"] % 2 == half] for half in (0, 1))
    groups = {"even": even, **{family: where(even, family=family) for family in FAMILIES}, "odd": odd}
    return {"rates": {name: rates(members) for name, members in groups.items()}, "cases": list(rows)}


def rates(rows: Sequence[Row]) -> dict[str, Any]:
    seconds = [row["seconds"] for row in rows]
    answers = {name: [a for a in map(question, rows) if a is not None] for name, (_, _, question) in RATES.items()}
    spent = {"median": float(np.median(seconds)), "most": max(seconds)}
    return {name: _rate(found) for name, found in answers.items()} | {"seconds": spent}


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
    spent = [f"{group['seconds']['median']:.0f} s, {group['seconds']['most']:.0f} s" for group in groups.values()]
    names = [name if name in ("even", "odd") else f"{name}, even" for name in groups]
    return table(["", "goal", *names], [*lines, ["processor time, median and most", "", *spent]], 2)


def effects_table(figures: Figures) -> str:
    """What becomes of each effect, over all cases."""
    rows = figures["cases"]
    lines = []
    for hidden in dict.fromkeys(row["hidden"] for row in sorted(rows, key=lambda row: order(row["hidden"]))):
        members = where(rows, hidden=hidden)
        wrong = dict.fromkeys(name for row in members for name in row["wrong"])
        answers = [count(row[key] for row in members if row[key] is not None) for key in ("right", "first", "at_place")]
        unnamed = sum(row["unnamed"] for row in members)
        lines.append([hidden, len(members), *answers, unnamed, ", ".join(wrong) or NOTHING])
    head = ["hidden", "cases", "named", "first", "at its place", "reported as unexplained", "wrong causes"]
    return table(head, lines)


def order(hidden: str) -> tuple[bool, bool, str]:
    return hidden != NONE, is_outside(hidden), hidden


PARTS = {
    "hidden_effects": Part(
        run=measure,
        minutes=24.0,
        needs=("../shared/foreign", "mujoco"),
        headlines={
            "rates.even.right.share": (0.75, 1.0),
            "rates.even.at_place.share": (0.85, 1.0),
            "rates.even.wrong.share": (0.0, 0.2),
            "rates.even.wrong_null.share": (0.0, 0.0),
            "rates.even.unnamed.share": (0.75, 1.0),
        },
        tables={"rates": rates_table, "effects": effects_table},
    )
}
