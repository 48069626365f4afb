"""Which rates a campaign found: every rate with its number of cases and its exact 95 % interval."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from tendonfmu.statistics import intervals

Row = Mapping[str, Any]
REPORT_FORMAT = "tendonfmu-campaign-rates-1"
STRENGTHS = (0.03, 0.1, 0.3, 1.0)
NEAR = 1.4  # a case counts as one of these strengths within this factor
COVERAGE = "the gain's interval covers the true gain"
SHOWN = 0.3  # strength from which a motion shows an absorbed effect, and at which two effects must both be named


@dataclass(frozen=True)
class Rate:
    """One line of a table."""

    what: str  # what is counted, and its goal, in words
    goal: str
    hits: int | None  # number of cases for which it holds; None for a mean
    cases: int  # number of cases that it is based on
    value: float  # share, or mean, and its interval
    low: float
    high: float

    def cells(self) -> list[str]:
        if not self.cases:
            return [self.what, self.goal, "–", "0", "–"]
        if self.hits is None:
            return [self.what, self.goal, f"{self.value:.2f}", str(self.cases), f"{self.low:.2f} to {self.high:.2f}"]
        return [
            self.what,
            self.goal,
            f"{100 * self.value:.1f} %",
            f"{self.hits}/{self.cases}",
            f"{100 * self.low:.1f} to {100 * self.high:.1f} %",
        ]


HEADINGS = ("rate", "goal", "found", "cases", "95 % interval")


def rate(what: str, goal: str, rows: Iterable[Row], holds: Callable[[Row], Any]) -> Rate:
    """Return the share of the rows for which `holds` is true."""
    # Rows for which the question does not apply (None) are left out.
    answers = [bool(answer) for answer in (holds(row) for row in rows) if answer is not None]
    found = intervals.share(sum(answers), len(answers))
    return Rate(what, goal, sum(answers), len(answers), found.value, found.low, found.high)


def mean(what: str, goal: str, values: Sequence[float]) -> Rate:
    """Return a mean with its normal interval."""
    count = len(values)
    if not count:
        return Rate(what, goal, None, 0, math.nan, math.nan, math.nan)
    middle = sum(values) / count
    spread = math.sqrt(sum((v - middle) ** 2 for v in values) / max(1, count - 1) / count)
    return Rate(what, goal, None, count, middle, middle - 1.96 * spread, middle + 1.96 * spread)


def of_strength(rows: Iterable[Row], strength: float) -> list[Row]:
    return [row for row in rows if row.get("strength") and strength / NEAR < float(row["strength"]) < strength * NEAR]


def rates(rows: Sequence[Row]) -> list[Rate]:
    """Compute the lines of the table in docs/evidence/fit.md."""
    good = [row for row in rows if not row.get("error")]

    def group(name: str) -> list[Row]:
        return [row for row in good if row["group"] == name]

    single, double, unknown, absorbed = (group(name) for name in ("single", "double", "unknown", "absorbed"))
    found = [rate("nothing hidden: a false cause", "≤ 1.5 %", group("null"), lambda row: row["cause_count"] > 0)]
    goals = {0.1: ("≥ 98 %", "≥ 97 %", "≥ 93 %", "≤ 1.7")}
    for strength in STRENGTHS:
        some = of_strength(single, strength)
        if some or strength == 0.1:
            found += _one_effect(f"one effect at {strength:g}", some, goals.get(strength, ("as found",) * 4))
    of_own_size = [row for row in single if not row.get("strength")]
    if of_own_size:
        found += _one_effect("one effect of a size of its own", of_own_size, ("as found",) * 4)
    found.append(rate("right place, of those named", "≥ 95 %", single, lambda row: row["place"]))
    found += [
        rate("two effects at 0.3: both", "≥ 93 %", double, lambda row: row["both"]),
        rate("two effects at 0.3: exactly both", "≥ 85 %", double, lambda row: row["exactly"]),
        rate(
            "absorbed by refitting: “not visible”, with an experiment",
            "≥ 95 %",
            absorbed,
            lambda row: None if row["not_visible"] is None else row["not_visible"] and row["experiment"],
        ),
        rate("the same where a motion shows it: named after the experiment", "≥ 90 %", absorbed, _named_afterwards),
        rate("not in the list: unknown", "≥ 95 %", unknown, lambda row: row["unknown"]),
        rate("not in the list: a wrong confident name", "≤ 5 %", unknown, lambda row: row["wrong_name"]),
        rate("contact: found as an event", "as found", group("contact"), lambda row: row["events"] > 0),
        rate(COVERAGE, "92-98 %", good, _covered),
    ]
    return found


def rates_by_part(rows: Sequence[Row]) -> list[Rate]:
    """Compute the rates that differ most, by what made the recordings and by number of joints."""
    good = [row for row in rows if not row.get("error")]
    parts = [(f"{value}", [row for row in good if row["rig"] == value]) for value in _values(good, "rig")]
    counts = _values(good, "joints")
    parts += [(_joints(count), [row for row in good if row.get("joints") == count]) for count in counts]
    found = []
    for what, holds in (
        ("nothing hidden: a false cause", lambda row: _of_group(row, "null", row["cause_count"] > 0)),
        ("one effect: true cause in the set", lambda row: _of_group(row, "single", row["in_set"])),
        ("one effect: true cause first", lambda row: _of_group(row, "single", row["first"])),
        ("two effects: both", lambda row: _of_group(row, "double", row["both"])),
        ("not in the list: unknown", lambda row: _of_group(row, "unknown", row["unknown"])),
        (COVERAGE, _covered),
    ):
        lines = [rate(f"{what}; {part}", "", some, holds) for part, some in parts]
        found += [line for line in lines if line.cases]
    return found


def _values(rows: Sequence[Row], key: str) -> list[Any]:
    """Return the different values in order; none if all rows are alike."""
    found = sorted({row[key] for row in rows if row.get(key)})
    return found if len(found) > 1 else []


def _joints(count: float) -> str:
    return "1 joint" if count == 1 else f"{count:g} joints"


def _of_group(row: Row, group: str, answer: bool | None) -> bool | None:
    return answer if row["group"] == group else None


def _named_afterwards(row: Row) -> bool | None:
    """Return whether the effect was named after the experiment."""
    # None if, by the rig's own computation, no motion shows the effect.
    shown = row.get("shown_strength")
    return None if shown is not None and shown < SHOWN else row.get("named_after_experiment")


def rivals_of(rows: Sequence[Row]) -> list[str]:
    """Return the rivals that ran, too, from the columns that they left."""
    keys = dict.fromkeys(key for row in rows for key in row if key.endswith(".cause_count"))
    return [key.rsplit(".", 1)[0] for key in keys]


def seen_by(rows: Sequence[Row], rival: str) -> list[Row]:
    """Return the rows with a rival's answers in place of those of the diagnosis."""
    silent = dict.fromkeys(("set_size", "not_visible", "experiment", "unknown", "true_gain"))
    own = [
        {key.removeprefix(f"{rival}."): value for key, value in row.items() if key.startswith(f"{rival}.")}
        for row in rows
    ]
    return [
        dict(row) | silent | answers
        for row, answers in zip(rows, own, strict=True)
        if answers.get("cause_count") is not None
    ]


def _one_effect(what: str, rows: Sequence[Row], goals: Sequence[str]) -> list[Rate]:
    return [
        rate(f"{what}: detected", goals[0], rows, lambda row: row["detected"]),
        rate(f"{what}: true cause in the set", goals[1], rows, lambda row: row["in_set"]),
        rate(f"{what}: true cause first", goals[2], rows, lambda row: row["first"]),
        mean(f"{what}: size of the set", goals[3], [float(row["set_size"]) for row in rows if row.get("set_size")]),
    ]


def _covered(row: Row) -> bool | None:
    low, high, true = row.get("gain_low"), row.get("gain_high"), row.get("true_gain")
    if low is None or high is None or true is None or not row["named_count"]:
        return None
    return bool(low <= true <= high)


def by_effect(rows: Sequence[Row]) -> list[list[str]]:
    """Count the answers for each hidden effect."""
    single = [row for row in rows if row["group"] == "single" and not row.get("error")]
    lines = []
    for effect in sorted({str(row["true_effect"]) for row in single}):
        own = [row for row in single if row["true_effect"] == effect]
        places = [row["place"] for row in own if row.get("place") is not None]
        counts = [sum(bool(row[key]) for row in own) for key in ("detected", "in_set", "first")]
        lines.append([effect, str(len(own)), *map(str, counts), f"{sum(map(bool, places))}/{len(places)}"])
    return lines


EFFECT_HEADINGS = ("hidden effect", "cases", "detected", "in the set", "first", "place")


def campaign_report(rows: Sequence[Row], cases: int) -> dict[str, Any]:
    """Return what `tendonfmu campaign --json` prints."""
    return {
        "format": REPORT_FORMAT,
        "cases": cases,
        "rows": len(rows),
        "rates": [asdict(each) for each in rates(rows)],
        "by_part": [asdict(each) for each in rates_by_part(rows)],
        "rivals": {name: [asdict(each) for each in rates(seen_by(rows, name))] for name in rivals_of(rows)},
        "by_effect": [_effect_entry(*cells) for cells in by_effect(rows)],
        "errors": {str(row["name"]): str(row["error"]) for row in rows if row.get("error")},
    }


def _effect_entry(effect: str, *counts: str) -> dict[str, Any]:
    """Return a row of `by_effect` with its counts as numbers."""
    *plain, place = counts
    right, known = place.split("/")
    named = dict(zip(("cases", "detected", "in_set", "first"), map(int, plain), strict=True))
    return {"effect": effect, **named, "place": int(right), "place_known": int(known)}


def markdown(rows: Sequence[Row]) -> str:
    """Format all tables of a campaign in Markdown."""
    parts = [_table(HEADINGS, [each.cells() for each in rates(rows)])]
    by_part = rates_by_part(rows)
    if by_part:
        parts.append(_table(HEADINGS, [each.cells() for each in by_part]))
    for rival in rivals_of(rows):
        cells = [each.cells() for each in rates(seen_by(rows, rival)) if each.cases]
        parts.append(f"The same by {rival}:\n\n" + _table(HEADINGS, cells))
    lines = by_effect(rows)
    if lines:
        parts.append(_table(EFFECT_HEADINGS, lines))
    failed = [row for row in rows if row.get("error")]
    if failed:
        parts.append(f"{len(failed)} of {len(rows)} cases ended in an error and are not included in the rates.")
    return "\n\n".join(parts) + "\n"


def _table(headings: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    marks = ["---", *["---:"] * (len(headings) - 1)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [list(headings), marks, *map(list, lines)])
