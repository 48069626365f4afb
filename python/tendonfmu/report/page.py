"""How a template becomes a page: one HTML file that contains its figures and needs nothing else.

All texts are escaped.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tendonfmu.drawing import STYLES, Sheet
from tendonfmu.errors import InputError
from tendonfmu.files import html_template

Drawn = tuple[Sheet, Sequence[Any]]  # a sheet and the Plotly figure of each of its panels


class Tile(NamedTuple):
    """An important number and what it is."""

    value: str
    unit: str  # may be empty
    meaning: str


class PageSheet(NamedTuple):
    """A sheet as the templates show it."""

    sheet: Sheet
    first: int  # index of the figure of its first panel in the page
    keys: list[tuple[str, Any, str]]  # (name of the style, the style, meaning)


def drawn(sheets: Iterable[Sheet]) -> list[Drawn]:
    """Make the figures of sheets."""
    from tendonfmu.drawing import figures_of  # a page is checked for before Plotly is needed

    return [(sheet, figures_of(sheet)) for sheet in sheets]


def render(template: str, sheets: Iterable[Drawn] = (), **content: Any) -> str:
    """Return the HTML text of a page."""
    by_section: dict[str, list[PageSheet]] = {}
    figures: list[Any] = []
    for sheet, of_sheet in sheets:
        keys = [(name, STYLES[name], meaning) for name, meaning in sheet.keys]
        by_section.setdefault(sheet.section, []).append(PageSheet(sheet, len(figures), keys))
        figures += zip(sheet.panels, of_sheet, strict=True)
    return html_template(template).render(figures=by_section, **_embedded(figures), **content)


def _embedded(figures: list[Any]) -> dict[str, Any]:
    if not figures:
        return {"drawn": ""}
    from tendonfmu.drawing import dark_colours, figures_json, packed_plotly

    return {"drawn": figures_json(figures), "plotly": packed_plotly(), "dark_colours": dark_colours()}


def write_figures(sheets: Iterable[Drawn], folder: Path) -> dict[Path, str]:
    """Write the figures of each sheet as a PNG file to a folder, which is made if missing."""
    from tendonfmu.drawing import write_sheet

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
    written = {}
    for sheet, figures in sheets:
        file = folder / f"{sheet.name}.png"
        write_sheet(sheet, figures, file)
        written[file] = sheet.title
    return written
