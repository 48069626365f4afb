"""How a template becomes a page: one HTML file that contains its figures and needs nothing else.

All texts are escaped.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from tendonfmu.drawing import Panel, Sheet, dark_colours, figures_json, packed_plotly
from tendonfmu.errors import InputError
from tendonfmu.files import html_template, write_text


class Tile(NamedTuple):
    """An important number and what it is."""

    value: str
    unit: str  # may be empty
    meaning: str


def render(template: str, sheets: Iterable[Sheet] = (), **content: Any) -> str:
    """Return the HTML text of a page. Its template gets the sheets by section."""
    by_section: dict[str, list[Sheet]] = {}
    panels: list[Panel] = []
    for sheet in sheets:
        by_section.setdefault(sheet.section, []).append(replace(sheet, first=len(panels)))
        panels += sheet.panels
    content["drawn"] = figures_json(panels) if panels else ""
    if panels:
        content |= {"plotly": packed_plotly(), "dark_colours": dark_colours()}
    return html_template(template).render(figures=by_section, **content)


def write_figures(page: Path, kicker: str, heading: str, sheets: Iterable[Sheet]) -> None:
    """Write a page of figures; its folder is made if missing."""
    make_folder(page.parent)
    write_text(page, render("figures.html.jinja", sheets, title=heading, kicker=kicker, heading=heading))


def make_folder(folder: Path) -> None:
    """Make a folder for pages if it is missing. Raise InputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
