"""Which files a history writes: a table, a picture and a page."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tendonfmu.diagnosis import History
from tendonfmu.drawing import Sheet, draw_panel, write_sheet
from tendonfmu.files import whole_file
from tendonfmu.report.diagnosis_text import Names
from tendonfmu.report.history_figures import history_sheet
from tendonfmu.report.history_text import columns_of, headline, rows_of_lines, trend_sentence
from tendonfmu.report.page import render

FORMAT = "tendonfmu-history-1"
TABLE, PICTURE, PAGE = "history.csv", "history.png", "history.html"


def write_history(found: History, names: Names, folder: Path) -> dict[Path, str]:
    """Write the table, the picture and the page of a history."""
    sheet = history_sheet(found, names)
    written: dict[Path, str] = {}
    with whole_file(folder / PAGE) as file:
        file.write_text(_page(found, names, sheet), encoding="utf-8")
    written[folder / PAGE] = "all results, to be read in a browser"
    with whole_file(folder / TABLE) as file, file.open("w", encoding="utf-8", newline="") as stream:
        columns = columns_of(found)
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    written[folder / TABLE] = "a row per recording and cause"
    if found.lines:
        write_sheet(sheet, [draw_panel(each) for each in sheet.panels], folder / PICTURE)
        written[folder / PICTURE] = "sizes over time"
    return written


def history_report(found: History, written: Iterable[Path] = ()) -> dict[str, Any]:
    """Return what `tendonfmu diagnose --history --json` prints."""
    return {
        "format": FORMAT,
        "finger": found.finger,
        "references": list(found.references),
        "recordings": [
            {"file": name, "time": time, "verdict": verdict}
            for name, time, verdict in zip(found.recordings, found.times, found.verdicts, strict=True)
        ],
        "unit_of_time": found.unit,
        "causes": [asdict(line) for line in found.lines],
        "failed": [{"file": name, "reason": why} for name, why in found.failed],
        "files": [str(file) for file in written],
    }


def _page(found: History, names: Names, sheet: Sheet) -> str:
    return render(
        "history.html.jinja",
        [sheet] if found.lines else [],
        found=found,
        headline=headline(found),
        sentences=list(_sentences(found, names)),
        rows=list(rows_of_lines(found, names)),
        recordings=[
            *(
                (Path(name).name, f"{time:.1f}" if found.dated else f"{time:.0f}", verdict)
                for name, time, verdict in zip(found.recordings, found.times, found.verdicts, strict=True)
            ),
            *((name, "–", f"not diagnosed: {why}") for name, why in found.failed),
        ],
    )


def _sentences(found: History, names: Names) -> Iterator[str]:
    for line in found.lines:
        text = trend_sentence(line, found, names)
        yield f"{text[:1].upper()}{text[1:]}."
