"""Puts panels, or rows of curves over the same x, into one Plotly figure, as notebooks show it."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.drawing.figures import TEMPLATE, figure_of, go, make_subplots, thinned
from tendonfmu.drawing.panel import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    STYLES,
    VERMILION,
    Curve,
    Interval,
    Panel,
    Sheet,
)

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
    log_y: bool = False


def series_figure(
    title: str,
    x_label: str,
    x: Numbers,  # [N]
    rows: Sequence[SeriesRow],
    stripes: Mapping[str, Sequence[Interval]] | None = None,  # colour -> intervals of x
) -> Any:
    """Draw rows of curves below each other; they are zoomed together along x."""
    height = 80.0 + _SERIES * len(rows)
    figure = make_subplots(len(rows), 1, shared_xaxes=True, vertical_spacing=0.35 * _GAP[1] / height)
    shapes = []
    for k, row in enumerate(rows, start=1):
        curves = [Curve(name, x, np.asarray(values, dtype=float)) for name, values in row.curves.items()]
        for i, curve in enumerate(thinned(curves)):
            line = {"color": COLOURS[i % len(COLOURS)], "width": 1.2}
            shown = k == 1 or row.curves.keys() != rows[0].curves.keys()
            trace = go.Scatter(x=curve.x, y=curve.y, mode="lines", line=line, showlegend=shown)
            figure.add_trace(trace.update(name=html.escape(curve.style)), k, 1)
        figure.update_yaxes(title_text=html.escape(row.label), type="log" if row.log_y else "linear", row=k, col=1)
        figure.update_xaxes(matches="x" if k > 1 else None, row=k, col=1)
        number = "" if k == 1 else k
        upright = {"xref": f"x{number}", "yref": f"y{number} domain", "y0": 0, "y1": 1, "layer": "below"}
        shapes += [
            {"type": "rect", "x0": begin, "x1": end, "fillcolor": colour, "opacity": 0.18, "line": {"width": 0}}
            | upright
            for colour, intervals in (stripes or {}).items()
            for begin, end in intervals
        ]
    figure.update_xaxes(title_text=html.escape(x_label), row=len(rows), col=1)
    figure.update_layout(title_text=html.escape(title), height=height, hovermode="x", shapes=shapes)
    return _with_look(figure, {"t": 50, "b": 40})


def sheets_figure(title: str, sheets: Sequence[Sheet]) -> Any:
    """Draw the panels of sheets, two in a row."""
    panels = [(sheet, panel) for sheet in sheets for panel in sheet.panels]
    if not panels:
        return _with_look(go.Figure(layout_title_text=html.escape(title)), {"t": 50, "b": 40})
    columns = min(_COLUMNS, len(panels))
    rows = math.ceil(len(panels) / columns)
    keys = _keys(sheets)
    top = 75.0 + _LINE * len(keys)
    inside = (_ROW + _GAP[1]) * rows - _GAP[1]
    cells: list[dict[str, bool] | None] = [{"secondary_y": panel.data is not None} for _, panel in panels]
    cells += [None] * (rows * columns - len(cells))
    figure = make_subplots(
        rows,
        columns,
        specs=[[cells[row * columns + column] for column in range(columns)] for row in range(rows)],
        horizontal_spacing=_GAP[0],
        vertical_spacing=_GAP[1] / inside,
        subplot_titles=[f"<b>{_heading(sheet, panel)}</b>" for sheet, panel in panels],
    )
    for k, (sheet, panel) in enumerate(panels):
        _place(figure, figure_of(panel, dict(sheet.keys)), k // columns + 1, k % columns + 1)
    for number, annotation in enumerate(figure.layout.annotations):
        left = figure.layout["xaxis" if number == 0 else f"xaxis{number + 1}"].domain[0]
        annotation.update(x=left, xanchor="left", align="left", font={"size": 12})
    heading = f"{html.escape(title)}<br><sup>{'<br>'.join(keys)}</sup>"
    figure.update_layout(title={"text": heading, "y": 1, "yanchor": "top", "pad": {"t": 12, "l": 12}}, showlegend=False)
    figure.update_layout(height=top + inside + _BOTTOM, hovermode="closest")
    return _with_look(figure, {"t": top, "b": _BOTTOM})


def _place(figure: Any, drawn: Any, row: int, column: int) -> None:
    """Add the figure of a panel to a cell of a grid."""
    for trace in drawn.data:
        figure.add_trace(trace, row, column, secondary_y=trace.yaxis == "y2")
    for shape in drawn.layout.shapes:
        figure.add_shape(shape, row=row, col=column)
    layout = drawn.layout.to_plotly_json()
    figure.update_xaxes(layout["xaxis"], row=row, col=column)
    figure.update_yaxes(layout["yaxis"], row=row, col=column, secondary_y=False)
    if "yaxis2" in layout:
        counts = {key: value for key, value in layout["yaxis2"].items() if key != "overlaying"}
        figure.update_yaxes(counts, row=row, col=column, secondary_y=True)


def _keys(sheets: Sequence[Sheet]) -> list[str]:
    """Return the meanings of the styles, each in its colour, in lines."""
    colours = {meaning: STYLES[style].colour for sheet in sheets for style, meaning in sheet.keys}
    lines: list[list[str]] = [[]]
    for meaning in colours:
        if len("".join([*lines[-1], meaning])) > _MOST_LETTERS[0]:
            lines.append([])
        lines[-1].append(meaning)
    return [
        " ".join(f'<span style="color:{colours[meaning]}">■ {html.escape(meaning)}</span>' for meaning in line)
        for line in lines
    ]


def _heading(sheet: Sheet, panel: Panel) -> str:
    """Return the title of a panel; of the first one with that of its sheet, in two lines if it is long."""
    if not panel.title or sheet.panels[0] is panel:
        together = f"{sheet.title}: {panel.title}".rstrip(": ")
        between = "<br>" if panel.title and len(together) > _MOST_LETTERS[1] else ": "
        return between.join(html.escape(part) for part in (sheet.title, panel.title) if part)
    return html.escape(panel.title)


def _with_look(figure: Any, margin: Mapping[str, float]) -> Any:
    """Give a figure the look of the pages, with its title at the left: the buttons are at the right."""
    figure.update_layout(template=TEMPLATE, paper_bgcolor="#fff", plot_bgcolor="#fff", margin=margin)
    figure.update_layout(title={"x": 0, "xref": "container", "xanchor": "left", "font": {"size": 14}})
    if figure.layout.showlegend is None:
        figure.update_layout(showlegend=True)
    if figure.layout.title.pad.l is None:
        figure.update_layout(title_pad_l=12)
    return figure
