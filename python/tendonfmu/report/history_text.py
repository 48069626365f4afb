"""How a history reads in plain words, and as a table."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tendonfmu.diagnosis import History, Line, quantity, share_of
from tendonfmu.files import counted
from tendonfmu.report.diagnosis_numbers import percent
from tendonfmu.report.diagnosis_text import Names, at_place


def headline(found: History) -> str:
    """Say in one sentence what has changed over all recordings."""
    count = counted(len(found.recordings), "recording")
    if not found.lines:
        return f"Nothing has changed in {count}."
    return f"{counted(len(found.lines), 'change')} in {count}."


def trend_sentence(line: Line, found: History, names: Names) -> str:
    """Describe the trend of one cause."""
    what = at_place(line.title, line.where, names)
    since = f", off the reference since {Path(line.since).name}" if line.since else ""
    if line.trend is None:
        return f"{what}: {quantity(line.sizes[-1].size.now.value, line.sizes[-1].size.unit)}{since}"
    if line.trend.low <= 0.0 <= line.trend.high:
        return f"{what}: no trend{since}"
    grows = "grows" if line.trend.value * line.sizes[-1].size.now.value > 0 else "falls"
    share, unit = share_of(line), line.sizes[0].size.unit
    if share is not None:
        low, high = sorted((abs(share.low), abs(share.high)))
        told = f"{percent(abs(share.value))} a {found.unit} ({percent(low)} to {percent(high)})"
    else:
        low, high = sorted((abs(line.trend.low), abs(line.trend.high)))
        told = (
            f"{quantity(abs(line.trend.value), unit)} a {found.unit} ({quantity(low, unit)} to {quantity(high, unit)})"
        )
    return f"{what}: {grows} {told}{since}"


def rows_of_lines(found: History, names: Names) -> Iterator[tuple[str, ...]]:
    """List (cause, place, reference, last, named in, trend) for each cause."""
    for line in found.lines:
        last = line.sizes[-1].size
        yield (
            line.where.effect,
            names.place(line.where) or "everywhere",
            quantity(last.reference.value, last.unit),
            quantity(last.now.value, last.unit),
            f"{sum(each.named for each in line.sizes)} of {len(line.sizes)}",
            trend_sentence(line, found, names).partition(": ")[2],
        )


def columns_of(found: History) -> dict[str, list[Any]]:
    """Return the columns of the table: one row per recording and cause, in SI units; 0 means no joint or tendon."""
    rows = [
        (time, each, line)
        for line in found.lines
        for each in line.sizes
        for recording, time in zip(found.recordings, found.times, strict=True)
        if recording == each.recording
    ]
    return {
        "recording": [each.recording for _, each, _ in rows],
        f"time_{found.unit}s": [time for time, _, _ in rows],
        "effect": [line.where.effect for _, _, line in rows],
        "joint": [line.where.joint or 0 for _, _, line in rows],
        "tendon": [line.where.tendon or 0 for _, _, line in rows],
        "number": [each.size.number for _, each, _ in rows],
        "unit": [each.size.unit for _, each, _ in rows],
        "reference": [each.size.reference.value for _, each, _ in rows],
        "now": [each.size.now.value for _, each, _ in rows],
        "now_low": [each.size.now.low for _, each, _ in rows],
        "now_high": [each.size.now.high for _, each, _ in rows],
        "named": [int(each.named) for _, each, _ in rows],
        "gain": [each.gain for _, each, _ in rows],
    }
