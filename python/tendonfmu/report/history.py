"""A history of causes: how it reads in plain words, its figure, its table, its page and its files."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.diagnosis import NBSP, History, Line, Names, at_place, quantity, share_of
from tendonfmu.drawing import BLUE, GREY, VERMILION, Panel, Sheet, bars, curve, dots, panel
from tendonfmu.files import counted, whole_file, write_text
from tendonfmu.report.kit import Row, capital, percent, render, unit_text, with_ends

FORMAT = "tendonfmu-history-1"
TABLE, PAGE = "history.csv", "history.html"


# --- files ------------------------------------------------------------------------------------------------------------


def write_history(history: History, names: Names, folder: Path) -> dict[Path, str]:
    """Write the table and the page of a history."""
    write_text(folder / PAGE, _page(history, names))
    with whole_file(folder / TABLE) as file, file.open("w", encoding="utf-8", newline="") as stream:
        columns = columns_of(history)
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return {folder / PAGE: "all results, to be read in a browser", folder / TABLE: "a row per recording and cause"}


def history_report(history: History, written: Iterable[Path] = ()) -> dict[str, Any]:
    """Return what `tendonfmu diagnose --history --json` prints."""
    return {
        "format": FORMAT,
        "finger": history.finger,
        "references": list(history.references),
        "recordings": [
            {"file": name, "time": time, "verdict": verdict}
            for name, time, verdict in zip(history.recordings, history.times, history.verdicts, strict=True)
        ],
        "unit_of_time": history.unit,
        "causes": [asdict(line) for line in history.lines],
        "failed": [{"file": name, "reason": why} for name, why in history.failed],
        "files": [str(file) for file in written],
    }


def _page(history: History, names: Names) -> str:
    panels = [_panel(line, history, names) for line in history.lines]
    title = f"{history.finger}: {headline(history).rstrip('.')}"
    times = [f"{time:.1f}" if history.dated else f"{time:.0f}" for time in history.times]
    files = [Path(name).name for name in history.recordings]
    return render(
        "history.html.jinja",
        [Sheet("history", "history", title, panels)] if panels else [],
        history=history,
        headline=headline(history),
        sentences=[f"{capital(trend_sentence(line, history, names))}." for line in history.lines],
        rows=list(rows_of_lines(history, names)),
        recordings=[
            *zip(files, times, history.verdicts, strict=True),
            *((name, "–", f"not diagnosed: {why}") for name, why in history.failed),
        ],
    )


# --- words ------------------------------------------------------------------------------------------------------------


def headline(history: History) -> str:
    """Say in one sentence what has changed over all recordings."""
    count = counted(len(history.recordings), "recording")
    if not history.lines and history.different:
        return f"{history.different} of {count} differ from the reference, by no change to follow: diagnose each alone."
    if not history.lines:
        return f"Nothing has changed in {count}."
    return f"{counted(len(history.lines), 'change')} in {count}."


def trend_sentence(line: Line, history: History, names: Names) -> str:
    """Describe the trend of one cause."""
    return f"{at_place(line.title, line.where, names)}: {_trend(line, history)}"


def _trend(line: Line, history: History) -> str:
    since = f", different from the reference since {Path(line.since).name}" if line.since else ""
    if line.trend is None:
        return f"{quantity(line.sizes[-1].size.now.value, line.sizes[-1].size.unit)}{since}"
    if line.trend.low <= 0.0 <= line.trend.high:
        return f"no trend{since}"
    grows = "grows" if line.trend.value * line.sizes[-1].size.now.value > 0 else "falls"
    share, unit = share_of(line), line.sizes[0].size.unit
    slope = line.trend if share is None else share
    low, high = sorted((abs(slope.low), abs(slope.high)))
    value, least, most = (
        quantity(size, unit) if share is None else percent(size) for size in (abs(slope.value), low, high)
    )
    return f"{grows} {value} a {history.unit} ({least} to {most}){since}"


def rows_of_lines(history: History, names: Names) -> Iterator[Row]:
    """List (cause, place, reference, last, named in, trend) for each cause."""
    for line in history.lines:
        last = line.sizes[-1].size
        yield (
            line.where.effect,
            names.place(line.where) or "everywhere",
            quantity(last.reference.value, last.unit),
            quantity(last.now.value, last.unit),
            f"{sum(size.named for size in line.sizes)} of {len(line.sizes)}",
            _trend(line, history),
        )


def columns_of(history: History) -> dict[str, list[Any]]:
    """Return the columns of the table: one row per recording and cause, in SI units; 0 means no joint or tendon."""
    times = dict(zip(history.recordings, history.times, strict=True))
    rows = [(times[size.recording], size, line) for line in history.lines for size in line.sizes]
    return {
        "recording": [size.recording for _, size, _ in rows],
        f"time_{history.unit}s": [time for time, _, _ in rows],
        "effect": [line.where.effect for _, _, line in rows],
        "joint": [line.where.joint or 0 for _, _, line in rows],
        "tendon": [line.where.tendon or 0 for _, _, line in rows],
        "number": [size.size.number for _, size, _ in rows],
        "unit": [size.size.unit for _, size, _ in rows],
        "reference": [size.size.reference.value for _, size, _ in rows],
        "now": [size.size.now.value for _, size, _ in rows],
        "now_low": [size.size.now.low for _, size, _ in rows],
        "now_high": [size.size.now.high for _, size, _ in rows],
        "named": [int(size.named) for _, size, _ in rows],
        "gain": [size.gain for _, size, _ in rows],
    }


# --- the figure -------------------------------------------------------------------------------------------------------


def _panel(line: Line, history: History, names: Names) -> Panel:
    when = dict(zip(history.recordings, history.times, strict=True))
    x = np.array([when[size.recording] for size in line.sizes])
    unit = unit_text(line.sizes[0].size.unit)
    factor, unit = (1.0, unit) if unit else (100.0, "%")
    value, low, high = with_ends((size.size.now for size in line.sizes), factor)
    named = np.array([size.named for size in line.sizes])
    then = factor * line.sizes[0].size.reference.value
    title = at_place(line.where.effect.replace("_", " ").capitalize(), line.where, names)
    shown = ((named, "named by the diagnosis of that recording", BLUE), (~named, "not named", VERMILION))
    return panel(
        title,
        trend_sentence(line, history, names).replace(NBSP, " "),
        "weeks" if history.dated else "recording",
        f"{line.sizes[0].size.number.replace('_', ' ')} ({unit})",
        bars(x, low, high, "95 % interval", BLUE, 1.0),
        curve(x, value, "", BLUE, 0.9, alpha=0.45),
        curve(x[[0, -1]], np.array([then, then]), "in the reference", GREY, 1.1, "dash"),
        *(dots(x[chosen], value[chosen], name, colour) for chosen, name, colour in shown if chosen.any()),
        size="medium",
    )
