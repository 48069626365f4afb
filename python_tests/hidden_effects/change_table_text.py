"""The tables of the cases of a change, as Markdown: rates with their cases and exact 95 % intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np
from scipy.stats import binomtest

from change_case import NOTHING
from change_judgement import LOAD

Row = Mapping[str, str]
Is = Callable[[Row], bool]


def rate(rows: Sequence[Row], hit: Is) -> str:
    """hits/cases (exact 95 % interval, %); a bar where there is no case."""
    if not rows:
        return "–"
    hits = sum(map(hit, rows))
    low, high = binomtest(hits, len(rows)).proportion_ci(method="exact")
    return f"{hits}/{len(rows)} ({100 * low:.0f}–{100 * high:.0f} %)"


def of(column: str) -> Is:
    return lambda row: row[column] == "True"


def some(column: str) -> Is:
    """The column names something."""
    return lambda row: bool(row[column])


def judged(rows: Iterable[Row], column: str) -> list[Row]:
    """Rows where the question of the column arises."""
    return [row for row in rows if row[column] != ""]


def answered(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if row["exit"] == "0"]


def groups(rows: Sequence[Row], *columns: str) -> Iterator[tuple[tuple[str, ...], list[Row]]]:
    """Rows by their values of the columns, in order."""
    for key in sorted({tuple(row[column] for column in columns) for row in rows}):
        yield key, [row for row in rows if tuple(row[column] for column in columns) == key]


def seconds(rows: Sequence[Row]) -> str:
    """Median and largest CPU time"""
    spent = [float(row["cpu_seconds"]) for row in rows]
    return f"{np.median(spent):.1f}, {max(spent):.1f}"


def table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *lines)]


def quiet(rows: Sequence[Row], *columns: str) -> list[str]:
    """Nothing changed: how often something is named."""
    head = [*columns, "named", "named beyond what speed explains", "unknown", "CPU s: median, most"]
    return table(
        head,
        (
            [*key, rate(group, some("named")), rate(group, some("false")), rate(group, of("unknown")), seconds(group)]
            for key, group in groups(rows, *columns)
        ),
    )


def changed(rows: Sequence[Row], *columns: str) -> list[str]:
    """Something changed: how often it is found."""
    asked = ("in_set", "first", "sign", "at_place")
    head = [*columns, "in the set", "first", "sign right", "at its place", "a wrong name beside", "set", "CPU s"]
    lines = []
    for key, group in groups(rows, *columns):
        sizes = [int(row["set_size"]) for row in judged(group, "set_size")]
        rates = [rate(judged(group, column), of(column)) for column in asked]
        size = f"{np.mean(sizes):.1f}" if sizes else "–"
        lines.append([*key, *rates, rate(group, some("false")), size, seconds(group)])
    return table(head, lines)


def says_load(row: Row) -> bool:
    return bool(set(row["named"].split()) & set(LOAD))


def loads(rows: Sequence[Row], *columns: str) -> list[str]:
    """Another load that no sensor shows: what it is taken for. One report may count in the first column and others."""
    head = [*columns, f"said: {', '.join(LOAD)}", "said: friction", "said: anything else", "said nothing"]
    return table(
        head,
        (
            [
                *key,
                rate(group, says_load),
                rate(group, some("friction")),
                rate(group, lambda row: bool(set(row["false"].split()) - set(row["friction"].split()))),
                rate(group, lambda row: not row["named"]),
            ]
            for key, group in groups(rows, *columns)
        ),
    )


def tables(rows: Sequence[Row]) -> Iterator[str]:
    """All tables that the rows have cases for."""
    done = answered(rows)
    failed = [row for row in rows if row["exit"] != "0"]
    yield f"{len(rows)} rows, {len(failed)} without a report."
    for row in failed[:10]:
        yield f"- {row['case']}, {row['asked']}: exit {row['exit'] or 'none'}: {row['message']}"
    real_loads = [row for row in done if row["bed"] == "real" and row["conditions"] == "load"]
    others = [row for row in done if row not in real_loads]
    nothing = [row for row in others if row["hidden"] == NOTHING]
    something = [row for row in others if row["hidden"] != NOTHING]
    parts = (
        ("Nothing changed", quiet, nothing, (("bed", "asked"), ("bed", "asked", "machine", "conditions"))),
        (
            "Something changed",
            changed,
            something,
            (
                ("bed", "asked", "strength"),
                ("bed", "asked", "conditions", "strength"),
                ("bed", "asked", "machine", "model", "strength"),
                ("bed", "asked", "hidden"),
            ),
        ),
        ("Another load, not shown", loads, real_loads, (("asked", "model"),)),
    )
    for title, show, cases, views in parts:
        for columns in views if cases else ():
            yield from ("", f"**{title}**, by {', '.join(columns)}", "", *show(cases, *columns))
