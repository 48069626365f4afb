"""How a template becomes a page: one HTML file that contains its figures and needs nothing else.

All texts are escaped.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tendonfmu.drawing import STYLES, Sheet
from tendonfmu.errors import InputError
from tendonfmu.files import html_template, write_text

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


def write_figures(page: Path, kicker: str, heading: str, sheets: Iterable[Sheet]) -> None:
    """Write a page of figures; its folder is made if missing."""
    make_folder(page.parent)
    write_text(page, render("figures.html.jinja", drawn(sheets), title=heading, kicker=kicker, heading=heading))


def make_folder(folder: Path) -> None:
    """Make a folder for pages if it is missing. Raise InputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
