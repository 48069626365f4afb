"""The files of a history: a table, a picture, a page."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tendonfmu.change_history import History, Line
from tendonfmu.diagnosis_size import NBSP
from tendonfmu.diagnosis_text import Names, at_place
from tendonfmu.fit_page import keys_of, render
from tendonfmu.fit_plots import draw_panel, write_sheet
from tendonfmu.fit_sheet import Bars, Curve, Dots, Panel, Sheet
from tendonfmu.history_text import columns_of, headline, rows_of_lines, trend_sentence
from tendonfmu.svg_panel import panel_svg
from tendonfmu.whole_file import whole_file

TABLE, PICTURE, PAGE = "history.csv", "history.png", "history.html"


def write_history(found: History, names: Names, folder: Path) -> dict[Path, str]:
    """file -> what is in it. Raises InputError where one cannot be written."""
    sheet = history_sheet(found, names)
    written: dict[Path, str] = {}
    with whole_file(folder / PAGE) as file:
        file.write_text(_page(found, names, sheet), encoding="utf-8")
    written[folder / PAGE] = "all of it, to be read in a browser"
    with whole_file(folder / TABLE) as file, file.open("w", encoding="utf-8", newline="") as stream:
        columns = columns_of(found)
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    written[folder / TABLE] = "a row per recording and cause"
    if found.lines:
        panels = [panel for panel in sheet.panels if isinstance(panel, Panel)]
        write_sheet(sheet, [draw_panel(each) for each in panels], folder / PICTURE)
        written[folder / PICTURE] = "sizes over time"
    return written


def history_sheet(found: History, names: Names) -> Sheet:
    return Sheet(
        section="history",
        name="history",
        title=f"{found.finger}: {headline(found)}",
        caption="",
        keys=(
            ("after_dots", "named by the diagnosis of that recording"),
            ("before_dots", "not named"),
            ("start", "in the reference"),
            ("after", "95 % interval"),
        ),
        panels=tuple(_panel(line, found, names) for line in found.lines),
    )


def _panel(line: Line, found: History, names: Names) -> Panel:
    when = dict(zip(found.recordings, found.times, strict=True))
    x = np.array([when[each.recording] for each in line.sizes])
    unit = line.sizes[0].size.unit
    factor, told = (100.0, "%") if unit in ("", "1") else (1.0, unit.replace(".", "·"))
    values = [[getattr(each.size.now, end) for each in line.sizes] for end in ("value", "low", "high")]
    value, low, high = (factor * np.array(each) for each in values)
    named = np.array([each.named for each in line.sizes])
    then = factor * line.sizes[0].size.reference.value
    title = at_place(line.title[:1].upper() + line.title[1:], line.where, names)
    axis = "weeks since the reference" if found.dated else "recording"
    return Panel(
        title=title,
        alt=trend_sentence(line, found, names).replace(NBSP, " "),
        x_label=axis,
        y_label=f"{line.sizes[0].size.number.replace('_', ' ')} ({told})",
        size="medium",
        curves=(Curve("after_line", x, value), Curve("start", x[[0, -1]], np.array([then, then]))),
        bars=(Bars("after", x, low, high),),
        dots=tuple(
            Dots(style, x[chosen], value[chosen])
            for style, chosen in (("after_dots", named), ("before_dots", ~named))
            if chosen.any()
        ),
    )


def _page(found: History, names: Names, sheet: Sheet) -> str:
    return render(
        "history.html.jinja",
        found=found,
        headline=headline(found),
        sentences=list(_sentences(found, names)),
        rows=list(rows_of_lines(found, names)),
        recordings=[
            (Path(name).name, f"{time:.1f}" if found.dated else f"{time:.0f}", verdict)
            for name, time, verdict in zip(found.recordings, found.times, found.verdicts, strict=True)
        ],
        keys=keys_of(sheet),
        drawings=[panel_svg(each) for each in sheet.panels if isinstance(each, Panel)],
    )


def _sentences(found: History, names: Names) -> Iterator[str]:
    for line in found.lines:
        text = trend_sentence(line, found, names)
        yield f"{text[:1].upper()}{text[1:]}."
