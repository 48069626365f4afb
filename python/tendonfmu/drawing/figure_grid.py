"""Puts panels, or rows of curves over the same x, into one Plotly figure, as notebooks show it."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.drawing.interactive import Figure, figure_of, plotly_figure, thinned
from tendonfmu.drawing.panel_data import Curve, MatrixPanel, Panel, Sheet
from tendonfmu.drawing.panel_styles import BLUE, DARK, GREEN, GREY, ORANGE, PURPLE, SKY, STYLES, VERMILION

Interval = tuple[float, float]

COLOURS = (BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE, DARK, GREY)
_COLUMNS = 2
_ROW = 240  # CSS pixels, height of a row of panels
_SERIES = 190  # CSS pixels, height of a row of curves
_GAP = (0.13, 78.0)  # between columns, share of the width; between rows, CSS pixels
_BOTTOM = 50.0  # CSS pixels below
_LINE = 18  # CSS pixels of a line of keys
_MOST_LETTERS = (70, 36)  # in a line of keys, and in one of the heading of a panel


@dataclass(frozen=True)
class SeriesRow:
    """Curves over a common x."""

    label: str  # of the y axis, with its unit in brackets
    curves: Mapping[str, Numbers]  # name -> y [N]
    log_y: bool = False  # whether the y axis is logarithmic


def series_figure(
    title: str,
    x_label: str,
    x: Numbers,
    rows: Sequence[SeriesRow],
    stripes: Mapping[str, Sequence[Interval]] | None = None,
) -> Any:
    """Draw rows of curves below each other; they are zoomed together along x."""
    # x: [N]
    height = 80.0 + _SERIES * len(rows)
    data: list[Figure] = []
    layout: Figure = {"title": {"text": html.escape(title)}, "height": height, "hovermode": "x", "shapes": []}
    layout["margin"] = {"t": 50, "b": 40}
    for k, row in enumerate(rows, start=1):
        low, high = _cell(k - 1, len(rows), 0.35 * _GAP[1] / height)
        last = k == len(rows)
        layout[f"yaxis{k}"] = {"domain": [low, high], "title": {"text": html.escape(row.label)}, "anchor": f"x{k}"}
        layout[f"yaxis{k}"]["type"] = "log" if row.log_y else "linear"
        layout[f"xaxis{k}"] = {"anchor": f"y{k}", "showticklabels": last} | ({"matches": "x1"} if k > 1 else {})
        if last:
            layout[f"xaxis{k}"]["title"] = {"text": html.escape(x_label)}
        curves = [Curve(name, x, np.asarray(values, dtype=float)) for name, values in row.curves.items()]
        for i, curve in enumerate(thinned(curves)):
            line = {"color": COLOURS[i % len(COLOURS)], "width": 1.2}
            data.append(
                {"type": "scatter", "mode": "lines", "x": curve.x, "y": curve.y, "name": html.escape(curve.style)}
                | {"line": line, "xaxis": f"x{k}", "yaxis": f"y{k}"}
                | {"showlegend": k == 1 or row.curves.keys() != rows[0].curves.keys()}
            )
        for colour, intervals in (stripes or {}).items():
            edge = {"type": "rect", "xref": f"x{k}", "yref": f"y{k} domain", "y0": 0, "y1": 1, "layer": "below"}
            layout["shapes"] += [
                edge | {"x0": begin, "x1": end, "fillcolor": colour, "opacity": 0.18, "line": {"width": 0}}
                for begin, end in intervals
            ]
    return plotly_figure(_first_axes(data, layout))


def sheets_figure(title: str, sheets: Sequence[Sheet]) -> Any:
    """Draw the panels of sheets, two in a row."""
    panels = [(sheet, panel) for sheet in sheets for panel in sheet.panels if not isinstance(panel, MatrixPanel)]
    columns = max(1, min(_COLUMNS, len(panels)))
    rows = max(1, math.ceil(len(panels) / columns))
    keys = _keys(sheets)
    top = 75.0 + _LINE * len(keys)
    inside = (_ROW + _GAP[1]) * rows - _GAP[1]
    data: list[Figure] = []
    heading = f"{html.escape(title)}<br><sup>{'<br>'.join(keys)}</sup>"
    placed = {"text": heading, "y": 1, "yanchor": "top", "pad": {"t": 12}}
    layout: Figure = {"title": placed, "showlegend": False}
    layout |= {"height": top + inside + _BOTTOM, "margin": {"t": top, "b": _BOTTOM}}
    layout |= {"shapes": [], "annotations": [], "hovermode": "closest"}
    for k, (sheet, panel) in enumerate(panels):
        across = _cell(columns - 1 - k % columns, columns, _GAP[0])
        upward = _cell(k // columns, rows, _GAP[1] / inside)
        _place(figure_of(panel, dict(sheet.keys)), k + 1, (across, upward), data, layout)
        layout["annotations"].append(
            {
                "text": f"<b>{_heading(sheet, panel)}</b>",
                "x": across[0],
                "y": upward[1],
                "xref": "paper",
                "yref": "paper",
            }
            | {"xanchor": "left", "yanchor": "bottom", "showarrow": False, "align": "left", "font": {"size": 12}}
        )
    return plotly_figure(_first_axes(data, layout))


def _keys(sheets: Sequence[Sheet]) -> list[str]:
    """Return the meanings of the styles, each in its colour, in lines."""
    colours = {meaning: STYLES[style].colour for sheet in sheets for style, meaning in sheet.keys}
    lines: list[list[str]] = [[]]
    for meaning in colours:
        if len("".join([*lines[-1], meaning])) > _MOST_LETTERS[0]:
            lines.append([])
        lines[-1].append(meaning)
    shown = {each: f'<span style="color:{colour}">■ {html.escape(each)}</span>' for each, colour in colours.items()}
    return [" ".join(shown[meaning] for meaning in line) for line in lines]


def _heading(sheet: Sheet, panel: Panel) -> str:
    """Return the title of a panel; of the first one with that of its sheet, in two lines if it is long."""
    if not panel.title or sheet.panels[0] is panel:
        together = f"{sheet.title}: {panel.title}".rstrip(": ")
        between = "<br>" if panel.title and len(together) > _MOST_LETTERS[1] else ": "
        return between.join(html.escape(part) for part in (sheet.title, panel.title) if part)
    return html.escape(panel.title)


def _cell(k: int, count: int, gap: float) -> Interval:
    """Return the share of a page that cell k of `count` takes, counted from the end."""
    size = (1.0 - gap * (count - 1)) / count
    end = 1.0 - k * (size + gap)
    return max(0.0, end - size), end


def _place(drawn: Figure, number: int, cell: tuple[Interval, Interval], data: list[Figure], layout: Figure) -> None:
    """Add a panel's figure with axes of its own: x and y of its number, and for sample counts y of 100 more."""
    across, upward = cell
    own = drawn["layout"]
    layout[f"xaxis{number}"] = own["xaxis"] | {"domain": list(across), "anchor": f"y{number}"}
    layout[f"yaxis{number}"] = own["yaxis"] | {"domain": list(upward), "anchor": f"x{number}"}
    counts = 1000 + number
    if "yaxis2" in own:
        layout[f"yaxis{counts}"] = own["yaxis2"] | {"overlaying": f"y{number}", "anchor": f"x{number}"}
    for trace in drawn["data"]:
        y = counts if trace.get("yaxis") == "y2" else number
        data.append(trace | {"xaxis": f"x{number}", "yaxis": f"y{y}"})
    layout["shapes"] += [shape | {"xref": f"x{number}", "yref": f"y{number} domain"} for shape in own.get("shapes", [])]


def _first_axes(data: list[Figure], layout: Figure) -> Figure:
    """Name the first axes as Plotly does: `xaxis`, not `xaxis1`."""
    for name in ("xaxis", "yaxis"):
        if f"{name}1" in layout:
            layout[name] = layout.pop(f"{name}1")
    short = {"x1": "x", "y1": "y", "y1 domain": "y domain"}

    def named(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: named(each) if key not in ("x", "y", "text") else each for key, each in value.items()}
        if isinstance(value, list):
            return [named(each) for each in value]
        return short.get(value, value) if isinstance(value, str) else value

    return {"data": [named(trace) for trace in data], "layout": named(layout)}
