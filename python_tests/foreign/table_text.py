"""The table of judged runs as markdown: a row a case, and what all of them come to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

Row = dict[str, Any]  # of table.py: case, truth, run, report (or None), judgement (or None)

HEAD = (
    "| case | hidden, N·m rms | exit | verdict | causes in order, gain | in the set | first | at its place | false |"
    " gain ≥ 0 | intervals > 0 | error, extended / nominal | CPU, s | peak, MB |"
)


def markdown(rows: Sequence[Row], title: str) -> str:
    rule = "| --- " * (HEAD.count("|") - 1) + "|"
    lines = [f"# {title}", "", HEAD, rule, *(line(row) for row in rows), ""]
    for family in dict.fromkeys(row["family"] for row in rows):
        lines += [f"## {family}", "", *summary_lines([row for row in rows if row["family"] == family]), ""]
    if len({row["family"] for row in rows}) > 1:
        lines += ["## all", "", *summary_lines(rows), ""]
    nothing = [row for row in rows if row["truth"]["hidden"] == "none" and row["report"] is not None]
    if nothing:
        lines += ["## nothing hidden: rms of r on the test, mN·m by joint", "", *error_lines(nothing), ""]
    return "\n".join(lines)


def line(row: Row) -> str:
    report, judged, run = row["report"], row["judgement"], row["run"]
    cells = [row["case"], hidden(row["truth"]), str(run["exit"])]
    if report is None or judged is None:
        cells += ["no report", run["message"].replace("|", "/")[:80], *[""] * 7]
    else:
        cells += [
            report["verdict"],
            "; ".join(f"{at(cause)} {100 * cause['gain']['value']:.0f} %" for cause in report["causes"]) or "–",
            *(mark(judged[key]) for key in ("in_set", "first", "at_place")),
            ", ".join(judged["false"]) or "–",
            *(mark(judged[key]) for key in ("gain_not_negative", "intervals_positive")),
            f"{judged['error_ratio']:.2f}",
        ]
    return "| " + " | ".join([*cells, f"{run['cpu_seconds']:.0f}", f"{run['peak_megabytes']:.0f}"]) + " |"


def error_lines(rows: Sequence[Row]) -> list[str]:
    lines = ["| case | joints | nominal | extended |", "| --- | --- | ---: | ---: |"]
    for row in rows:
        errors = [row["report"][model]["test_rms"] for model in ("nominal", "extended")]
        spoken = (", ".join(f"{1e3 * value:.2f}" for value in each) for each in errors)
        lines.append(f"| {row['case']} | {len(errors[0])} | " + " | ".join(spoken) + " |")
    return lines


def hidden(truth: Row) -> str:
    size = "" if truth["rms"] is None or truth["hidden"] == "none" else f", {truth['rms']:.4f}"
    return f"{at({'effect': truth['hidden'], **truth})}{size}"


def at(cause: Row) -> str:
    """An effect and its place in a few signs: gravity j1, edge_friction j2 t3."""
    parts = [cause["effect"]]
    parts += [f"{sign}{cause[key]}" for key, sign in (("joint", "j"), ("tendon", "t")) if cause.get(key)]
    return " ".join(parts)


def mark(value: bool | None) -> str:
    return "" if value is None else "yes" if value else "**no**"


def summary(rows: Sequence[Row]) -> dict[str, str]:
    """What the rows come to; runs without a report count as wrong wherever the question arises."""
    ended = [row for row in rows if row["judgement"] is not None]
    listed = [row for row in rows if row["visible"]]
    nothing = [row for row in rows if row["truth"]["hidden"] == "none"]
    outside = [row for row in rows if row["truth"]["hidden"].startswith("unknown")]
    absorbed = [row for row in rows if row["absorbed"]]
    return {
        "runs that end with a report": count(rows, lambda row: row["judgement"] is not None),
        "true cause in the set": count(listed, lambda row: judged(row, "in_set")),
        "true cause first beside presliding": count(listed, lambda row: judged(row, "first")),
        "true cause at its place": count(listed, lambda row: judged(row, "at_place")),
        "false causes per case": per_case(ended),
        "false causes per case with nothing hidden": per_case([row for row in nothing if row in ended]),
        "nothing hidden, no false cause": count(nothing, no_false),
        "outside the list, left without a confident name": count(outside, lambda row: judged(row, "unnamed")),
        "absorbed by refitting, no false cause": count(absorbed, no_false),
        "gain ≥ 0": count(rows, lambda row: judged(row, "gain_not_negative")),
        "intervals of all causes above 0": count(rows, lambda row: judged(row, "intervals_positive")),
        "CPU, median and most": spread([row["run"]["cpu_seconds"] for row in rows], "s"),
        "peak memory, most": f"{max((row['run']['peak_megabytes'] for row in rows), default=0.0):.0f} MB",
    }


def summary_lines(rows: Sequence[Row]) -> list[str]:
    return [
        "| over the cases | |",
        "| --- | --- |",
        *(f"| {name} | {value} |" for name, value in summary(rows).items()),
    ]


def judged(row: Row, key: str) -> bool:
    return row["judgement"] is not None and bool(row["judgement"][key])


def no_false(row: Row) -> bool:
    return row["judgement"] is not None and not row["judgement"]["false"]


def count(rows: Sequence[Row], test: Callable[[Row], bool]) -> str:
    return f"{sum(test(row) for row in rows)} of {len(rows)}"


def per_case(rows: Sequence[Row]) -> str:
    return f"{sum(len(row['judgement']['false']) for row in rows) / len(rows):.2f}" if rows else "–"


def spread(values: Sequence[float], unit: str) -> str:
    return f"{sorted(values)[len(values) // 2]:.0f} {unit}, {max(values):.0f} {unit}" if values else "–"
