"""How often does `diagnose --reference` name what has changed between two recordings, and how often a wrong change?

One thing of a finger by seed (evidence/families) has changed between two recordings, or nothing. Every other pair of
seeds repeats the motion, with noise of its own. Constants of the product were chosen on even seeds; odd ones judge it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evidence.cases import run_cases
from evidence.diagnosis import ALSO, MEMORY, is_outside
from evidence.diagnosis.case import Case, diagnosed
from evidence.diagnosis.judge import UNKNOWN, Truth, in_words, judge
from evidence.families import cases, finger
from evidence.families.finger import NONE, Hidden
from evidence.families.motion import random_motion
from evidence.part import Figures, Part
from evidence.table import Row, table
from tendonfmu.statistics.intervals import share

SECONDS = 40.0
SEEDS = range(1, 2 * len(cases.ORDER), 2)
SAME = {  # names of the same physics
    "joint_load_friction": ("load_friction",),
    "force_gain": ("moment_arm",),
    "edge_friction": ("pulley_friction",),
}


def make(family: str, seed: int) -> tuple[Case, Hidden] | None:
    """The case of a seed and what has changed; None where nobody can see the change."""
    made, hidden, rng = cases.machine(family, seed)
    joints = len(made.cover)
    nominal = finger.describe(made, Hidden(), rng)
    first, other = (random_motion(joints, made.pretension, rng) for _ in range(2))
    repeats = (seed // 2) % 2 == 0
    then = cases.run(family, made, Hidden(), first, SECONDS, seed)
    now = cases.run(family, made, hidden, first if repeats else other, SECONDS, seed)
    if hidden.effect != NONE:
        without = then if repeats else cases.run(family, made, Hidden(), other, SECONDS, seed)
        seen, noise = cases.changed(made, hidden, now, without)
        if not cases.is_seen(seen, noise, cases.LEFT[family]):
            return None
    before, after = (
        finger.record(trace, what, np.random.default_rng((seed, number)))
        for number, (trace, what) in enumerate(((then, Hidden()), (now, hidden)), start=2)
    )
    nameless = hidden.effect == NONE or is_outside(hidden.effect)
    named = () if nameless else (hidden.effect, *SAME.get(hidden.effect, ()))
    truth = Truth(named, hidden.joint, hidden.tendon, allowed=ALSO[family], ignored=(*MEMORY, UNKNOWN))
    return Case(nominal, after, truth, reference=before, kinematics=2), hidden


def run_case(family: str, seed: int) -> Row:
    made = make(family, seed)
    row: Row = {"family": family, "number": seed, "dropped": made is None}
    if made is None:
        return row
    case, hidden = made
    report, seconds = diagnosed(case)
    return {
        **row,
        "hidden": hidden.effect,
        "named": [in_words(cause) for cause in report["causes"]],
        **judge(report["causes"], case.truth),
        "seconds": round(seconds, 1),
    }


# --- figures and tables -----------------------------------------------------------------------------------------------

LINES: dict[str, Callable[[Row], bool]] = {
    "nothing changed": lambda row: row["hidden"] == NONE,
    "an effect of the list": lambda row: row["hidden"] != NONE and not is_outside(row["hidden"]),
    "no effect of the list": lambda row: is_outside(row["hidden"]),
}


def measure(folder: Path, workers: int) -> Figures:
    named = {f"{family}_{seed:03d}": (family, seed) for family in cases.FAMILIES for seed in SEEDS}
    rows = run_cases(run_case, named, folder, workers)
    counted = counts([row for row in rows if not row["dropped"]])
    return {"counts": counted, "named": counted["an effect of the list"]["share"], "cases": rows}


def counts(rows: Sequence[Row]) -> dict[str, Any]:
    """How many cases a line of the table has, with the true change (None: nobody asks), and with a wrong one."""
    groups = {name: [row for row in rows if belongs(row)] for name, belongs in LINES.items()}
    return {name: _count(members) for name, members in groups.items()}


def _count(members: Sequence[Row]) -> dict[str, Any]:
    asked = [row["right"] for row in members if row["right"] is not None]
    return {
        "cases": len(members),
        "right": sum(asked) if asked else None,
        "share": sum(asked) / len(asked) if asked else None,
        "wrong": sum(bool(row["wrong"]) for row in members),
    }


def counts_table(figures: Figures) -> str:
    lines = [
        [name, line["cases"], _of(line["right"], line["cases"]), _of(line["wrong"], line["cases"])]
        for name, line in figures["counts"].items()
    ]
    return table(["what has changed", "cases", "named", "a wrong change"], lines)


def _of(hits: int | None, cases: int) -> str:
    if hits is None or not cases:
        return ""
    known = share(hits, cases)
    return f"{hits} ({100 * known.low:.0f}–{100 * known.high:.0f} %)"


PARTS = {
    "simulated": Part(
        run=measure,
        needs=("mujoco",),
        headlines={"counts.nothing changed.wrong": (0, 2)},
        tables={"counts": counts_table},
    )
}
