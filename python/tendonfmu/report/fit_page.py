"""What the page of a fit, `report.html`, shows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from tendonfmu.estimate import FitPicture, FitReport, FittedNumber, verdicts
from tendonfmu.files import write_text
from tendonfmu.model import part_of
from tendonfmu.recordings import RecordingEntry
from tendonfmu.report import fit_text as text
from tendonfmu.report.fit_figures import fit_sheets, strongest_pairs
from tendonfmu.report.numbers import Row, percent, unit_text
from tendonfmu.report.page import Tile, make_folder, render

PAGE = "report.html"
PAIRS = 20  # most strongly correlated pairs in the table


def write_fit_page(picture: FitPicture, folder: Path) -> dict[Path, str]:
    """Write `report.html` to a folder, which is made if missing, whole or not at all."""
    make_folder(folder)
    write_text(folder / PAGE, fit_page(picture))
    return {folder / PAGE: "all results, to be read in a browser"}


def fit_page(picture: FitPicture) -> str:
    """Return the HTML text of the page of a fit."""
    report, joints = picture.report, picture.fitted.joint_names
    tables = text.residual_tables(report, joints)
    return render(
        "fit.html.jinja",
        fit_sheets(picture),
        report=report,
        state=text.state_of(report),
        tiles_shown=_tiles(report, tables),
        sentences=list(text.summary_sentences(picture, tables)),
        joint_names=joints,
        residuals=[
            (f"{each.title}: rms in {each.unit}", [(row.name, *row.texts) for row in each.rows])
            for each in text.page_tables(tables, joints)
        ],
        residual_headings=text.RESIDUAL_HEADINGS,
        consistency=list(text.consistency(picture)),
        doubts=list(_doubts(report)),
        pairs=[
            (f"{pair.correlation:+.3f}".replace("-", "−"), pair.first, pair.second)
            for pair in strongest_pairs(picture, PAIRS)
        ],
        recordings=[_recording(recording) for recording in report["recordings"]],
        options={name: _option(value) for name, value in report["options"].items()},
        groups=list(_groups(picture)),
    )


def _tiles(report: FitReport, tables: Sequence[text.ResidualTable]) -> list[Tile]:
    few, many = text.apart(tables)
    tiles = [
        Tile(percent(table.all.left), "", f"of the torque is left: {table.title[0].lower() + table.title[1:]}")
        for table in few
        if table.all.left is not None
    ]
    if many:
        tiles.append(Tile(text.range_of(many), "", f"of the torque is left in {len(many)} recordings not trained on"))
    bias = tables[0].all.share(tables[0].all.bias_only) if tables else None
    if bias is not None:
        tiles.append(Tile(percent(bias), "", "would be left by the bias alone"))
    return [*tiles, Tile(f"{report['identified']['count']}/{report['identified']['of']}", "", "numbers identified")]


# --- tables -----------------------------------------------------------------------------------------------------------


def _doubts(report: FitReport) -> Iterator[tuple[str, list[Row]]]:
    """List the numbers that are not identified by reason, most frequent first."""
    by_reason: dict[str, list[FittedNumber]] = {}
    for entry in report["parameters"]:
        if not entry["identified"]:
            by_reason.setdefault(entry["reason"] or "unknown", []).append(entry)
    for reason, entries in sorted(by_reason.items(), key=lambda item: -len(item[1])):
        rows: list[Row] = [
            (entry["path"], *_value(entry), unit_text(entry["unit"]), entry["advice"] or "") for entry in entries
        ]
        yield verdicts.CAUSES.get(reason, reason), rows


def _groups(picture: FitPicture) -> Iterator[dict[str, Any]]:
    """List all numbers by joint and tendon: (number, start, fitted, standard error, unit, identified)."""
    groups: dict[str, list[tuple[str, FittedNumber]]] = {}
    for entry in picture.report["parameters"]:
        name, path = "Others", entry["path"]
        if place := part_of(path):
            part, number, path = place
            names = picture.fitted.joint_names if part == "joints" else picture.fitted.tendon_names
            name = f"{part[:-1].capitalize()} {number}: {names[number - 1]}"
        groups.setdefault(name, []).append((path, entry))
    for name, numbers in groups.items():
        yield {
            "name": name,
            "identified": sum(bool(entry["identified"]) for _, entry in numbers),
            "doubtful": [not entry["identified"] for _, entry in numbers],
            "rows": [
                (path, _number(entry["start"], 4), *_value(entry), unit_text(entry["unit"]), _identified(entry))
                for path, entry in numbers
            ],
        }


def _value(entry: FittedNumber) -> tuple[str, str]:
    return _number(entry["value"], 4), _number(entry["standard_error"], 2)


def _identified(entry: FittedNumber) -> str:
    bound = f", at its {entry['at_bound']} bound" if entry["at_bound"] else ""
    return ("yes" if entry["identified"] else "no") + bound


def _recording(recording: RecordingEntry) -> Row:
    counts = recording["samples"], recording["used"], recording["held_out"], recording["contact_left_out"]
    length, force = _number(recording["duration"], 4), _number(recording["mean_force"])
    return recording["path"], length, *map(str, counts), force, str(recording["kinematics"])


def _option(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(_option, value)) or "none"
    return {True: "yes", False: "no", None: "none"}.get(value, str(value)) if not value else str(value)


def _number(value: float | None, digits: int = 3) -> str:
    """Format a number with some significant digits; a dash where there is none."""
    return "–" if value is None or value != value else f"{value:.{digits}g}"
