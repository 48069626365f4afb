"""The page of a fit: its figures as PNG files, and one HTML file with all of them in it that needs nothing else.

Without scripts and without anything from elsewhere; every text is escaped.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tendonfmu.drawing import STYLES, MatrixPanel, Sheet, size_of
from tendonfmu.errors import InputError
from tendonfmu.estimate import FitPicture
from tendonfmu.files import whole_file
from tendonfmu.report.fit_error_figures import strongest_pairs
from tendonfmu.report.fit_figures import fit_sheets
from tendonfmu.report.fit_summary import Summary, rounded, summarise

PAGE = "report.html"
PAIRS = 20  # most strongly correlated, in a table


@dataclass(frozen=True)
class EmbeddedImage:
    """A panel as the page shows it. source: data URI. width, height: CSS pixels."""

    source: str
    alt: str
    width: int
    height: int


@dataclass(frozen=True)
class PageFigure:
    """A sheet as the page shows it. keys: (CSS class, CSS colour, opacity, meaning)."""

    sheet: Sheet
    size: str
    keys: list[tuple[str, str, float, str]]
    images: list[EmbeddedImage]


def write_fit_page(picture: FitPicture, folder: Path) -> dict[Path, str]:
    """Writes one PNG per sheet and `report.html` into a folder, which is made if missing.

    Returns file -> what is in it. Files appear whole or not at all. Raises InputError where they cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
    figures, written = [], {}
    for sheet in fit_sheets(picture):
        file = folder / f"{sheet.name}.png"
        figures.append(draw_sheet(sheet, file))
        written[file] = sheet.title
    page = folder / PAGE
    text = fit_page(picture, summarise(picture), figures)
    with whole_file(page) as partial:
        partial.write_text(text, encoding="utf-8")
    return {page: "all of it, to be read in a browser"} | written


def draw_sheet(sheet: Sheet, file: Path | None = None) -> PageFigure:
    """Its panels as the page shows them; with a file, the sheet is written there as PNG too."""
    from tendonfmu.drawing import draw_panel, png, write_sheet

    pixels = [draw_panel(panel) for panel in sheet.panels]
    if file is not None:
        write_sheet(sheet, pixels, file)
    images = []
    for panel, drawn in zip(sheet.panels, pixels, strict=True):
        data = base64.b64encode(png(drawn, exact=isinstance(panel, MatrixPanel))).decode("ascii")
        images.append(EmbeddedImage(f"data:image/png;base64,{data}", panel.alt, *size_of(panel)))
    return PageFigure(sheet, sheet.panels[0].size, keys_of(sheet), images)


def keys_of(sheet: Sheet) -> list[tuple[str, str, float, str]]:
    """(CSS class, CSS colour, opacity, meaning) of what is drawn."""
    return [(STYLES[style].shape, STYLES[style].colour, STYLES[style].alpha, meaning) for style, meaning in sheet.keys]


def fit_page(picture: FitPicture, summary: Summary, figures: list[PageFigure]) -> str:
    """HTML text of the page."""
    by_section: dict[str, list[PageFigure]] = {}
    for figure in figures:
        by_section.setdefault(figure.sheet.section, []).append(figure)
    return render(
        "fit_report.html.jinja",
        report=picture.report,
        joint_names=picture.joint_names,
        summary=summary,
        figures=by_section,
        pairs=strongest_pairs(picture, PAIRS),
        options=_options(picture.report),
    )


def render(template: str, **content: Any) -> str:
    """A template of the package with its content, every text escaped."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tendonfmu"),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": _number, "rounded": rounded, "unit": _unit}
    return environment.get_template(template).render(**content)


def _options(report: Mapping[str, Any]) -> dict[str, str]:
    """Those given, as text."""

    def text(value: Any) -> str:
        if isinstance(value, list | tuple):
            return ", ".join(map(text, value)) or "none"
        return {True: "yes", False: "no", None: "none"}.get(value, str(value)) if not value else str(value)

    return {key: text(value) for key, value in report.get("options", {}).items()}


def _unit(name: str) -> str:
    """As people write it; nothing for a plain number."""
    return "" if name == "1" else name.replace(".", "·")


def _number(value: float | None, digits: int = 3) -> str:
    """A number with some significant digits; a dash where there is none."""
    return "–" if value is None or value != value else f"{value:.{digits}g}"
