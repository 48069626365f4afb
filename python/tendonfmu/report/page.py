"""How a template becomes a page: one HTML file that contains its figures and needs nothing else.

All texts are escaped.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from tendonfmu.drawing import (
    STYLES,
    MatrixPanel,
    Panel,
    Sheet,
    dark_colours,
    figures_json,
    height_in_page,
    packed_plotly,
    size_of,
)
from tendonfmu.files import html_template


class Tile(NamedTuple):
    """An important number and what it is."""

    value: str  # the number as text
    unit: str  # its unit; may be empty
    meaning: str  # what it is


@dataclass(frozen=True)
class PagePanel:
    """A panel as a page shows it."""

    number: int  # index of its figure in the page
    title: str  # texts of the panel
    note: str
    alt: str
    width: int  #
    height: int


@dataclass(frozen=True)
class PageSheet:
    """A sheet as a page shows it."""

    sheet: Sheet  # the sheet
    size: str  # size of its panels
    keys: list[tuple[str, str, float, str]]  # (CSS class, CSS colour, opacity, meaning)
    panels: list[PagePanel]  # its panels


def render(template: str, sheets: Iterable[Sheet] = (), **content: Any) -> str:
    """Return the HTML text of a page."""
    figures: dict[str, list[PageSheet]] = {}
    panels: list[Panel | MatrixPanel] = []
    names: list[dict[str, str]] = []
    for sheet in sheets:
        figures.setdefault(sheet.section, []).append(_placed(sheet, len(panels)))
        panels += sheet.panels
        names += [dict(sheet.keys)] * len(sheet.panels)
    drawing = {"plotly": packed_plotly(), "dark_colours": dark_colours()} if panels else {}
    drawn = figures_json(panels, names) if panels else ""
    return html_template(template).render(figures=figures, drawn=drawn, **drawing, **content)


def _placed(sheet: Sheet, first: int) -> PageSheet:
    panels = [
        PagePanel(
            number,
            panel.title,
            panel.note if isinstance(panel, Panel) else "",
            panel.alt,
            size_of(panel)[0],
            height_in_page(panel),
        )
        for number, panel in enumerate(sheet.panels, start=first)
    ]
    return PageSheet(sheet, sheet.panels[0].size if sheet.panels else "small", _keys(sheet), panels)


def _keys(sheet: Sheet) -> list[tuple[str, str, float, str]]:
    """List the keys of a sheet."""
    # Keys of the correlation also have their style's name as a class, since a dark page inverts its colours.
    styles = [(name, STYLES[name], meaning) for name, meaning in sheet.keys]
    return [(f"{style.shape} {name}", style.colour, style.alpha, meaning) for name, style, meaning in styles]
