"""What the page of a fit, `report.html`, shows, and its figures as PNG files beside it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from tendonfmu.drawing import Sheet
from tendonfmu.errors import InputError
from tendonfmu.estimate import FitPicture
from tendonfmu.files import whole_file
from tendonfmu.report.fit_error_figures import strongest_pairs
from tendonfmu.report.fit_figures import fit_sheets
from tendonfmu.report.fit_summary import (
    NumberGroup,
    ResidualTable,
    Summary,
    Told,
    UncertaintyRow,
    rounded,
    summarise,
)
from tendonfmu.report.page import render

PAGE = "report.html"
PAIRS = 20  # most strongly correlated pairs in the table

Cells = tuple[str, ...]
Entry = Mapping[str, Any]


def write_fit_page(picture: FitPicture, folder: Path) -> dict[Path, str]:
    """Write `report.html` and one PNG file per sheet to a folder. Files appear whole or not at all."""
    from tendonfmu.drawing import draw_panel, write_sheet

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
    sheets, written = fit_sheets(picture), {}
    for sheet in sheets:
        file = folder / f"{sheet.name}.png"
        write_sheet(sheet, [draw_panel(panel) for panel in sheet.panels], file)
        written[file] = sheet.title
    page = folder / PAGE
    text = fit_page(picture, summarise(picture), sheets)
    with whole_file(page) as partial:
        partial.write_text(text, encoding="utf-8")
    return {page: "all results, to be read in a browser"} | written


def fit_page(picture: FitPicture, summary: Summary, sheets: Sequence[Sheet]) -> str:
    """Return the HTML text of the page of a fit."""
    pairs = [
        (f"{each.correlation:+.3f}".replace("-", "−"), each.first, each.second)
        for each in strongest_pairs(picture, PAIRS)
    ]
    return render(
        "fit.html.jinja",
        sheets,
        report=picture.report,
        joint_names=picture.joint_names,
        summary=summary,
        residuals=[_residuals(each) for each in summary.residuals],
        uncertainty=[tuple(_uncertainty(row)) for row in summary.uncertainty],
        doubts=[(each.reason, [_doubtful(entry) for entry in each.numbers]) for each in summary.doubts],
        pairs=pairs,
        recordings=[_recording(each) for each in picture.report["recordings"]],
        options=_options(picture.report),
        groups=[_group(each) for each in summary.groups],
    )


# --- tables -----------------------------------------------------------------------------------------------------------


def _residuals(table: ResidualTable) -> dict[str, Any]:
    """Return title and rows (name, torque, fitted, left, before the fit, bias alone, friction alone) of a table."""

    def cells(values: Sequence[float | None]) -> Iterator[str]:
        return (rounded(value) for value in values)

    rows = [
        (
            row.name,
            *cells((row.torque, row.fitted)),
            "" if row.left is None else f"{rounded(100 * row.left, 2)} %",
            *cells((row.start, row.bias_only, row.model_only)),
        )
        for row in table.rows
    ]
    return {"title": f"{table.title}: rms in {table.unit}", "rows": rows}


def _uncertainty(row: UncertaintyRow) -> Iterator[str]:
    yield from (row.joint, _number(row.inflation), str(row.directions), f"{rounded(100 * row.captured, 2)} %")
    for told in row.sets:
        known = told or Told(float("nan"), None, None)
        yield rounded(known.std)
        yield from ("–" if each is None else f"{rounded(100 * each, 2)} %" for each in (known.error, known.worst))


def _doubtful(entry: Entry) -> Cells:
    return entry["path"], *_value(entry), _unit(entry["unit"]), entry["advice"] or ""


def _group(group: NumberGroup) -> dict[str, Any]:
    """Return a group with rows (number, start, fitted, standard error, unit, identified)."""
    return {
        "name": group.name,
        "identified": group.identified,
        "doubtful": [not entry["identified"] for _, entry in group.numbers],
        "rows": [
            (path, _number(entry["start"], 4), *_value(entry), _unit(entry["unit"]), _identified(entry))
            for path, entry in group.numbers
        ],
    }


def _value(entry: Entry) -> tuple[str, str]:
    return _number(entry["value"], 4), _number(entry["standard_error"], 2)


def _identified(entry: Entry) -> str:
    bound = f", at its {entry['at_bound']} bound" if entry["at_bound"] else ""
    return ("yes" if entry["identified"] else "no") + bound


def _recording(each: Entry) -> Cells:
    counts = (str(each[key]) for key in ("samples", "used", "held_out", "contact_left_out"))
    return each["path"], _number(each["duration"], 4), *counts, _number(each["mean_force"]), str(each["kinematics"])


def _options(report: Mapping[str, Any]) -> dict[str, str]:
    """Return the options that were given, as text."""

    def text(value: Any) -> str:
        if isinstance(value, list | tuple):
            return ", ".join(map(text, value)) or "none"
        return {True: "yes", False: "no", None: "none"}.get(value, str(value)) if not value else str(value)

    return {key: text(value) for key, value in report.get("options", {}).items()}


def _unit(name: str) -> str:
    """Format a unit; empty for a plain number."""
    return "" if name == "1" else name.replace(".", "·")


def _number(value: float | None, digits: int = 3) -> str:
    """Format a number with some significant digits; a dash where there is none."""
    return "–" if value is None or value != value else f"{value:.{digits}g}"
