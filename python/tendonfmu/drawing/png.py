"""Draws the Plotly figures of a sheet as one PNG file, with matplotlib: no browser is needed.

What figures of panels consist of is drawn: lines, areas, points with texts, matrices, shapes, and axes with their
limits, scales and named ticks.
"""

from __future__ import annotations

import html
import warnings
from collections.abc import Sequence
from io import BytesIO
from math import ceil
from pathlib import Path
from textwrap import wrap
from typing import IO, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.image import imsave
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from tendonfmu.drawing.figures import HISTOGRAM, pooled
from tendonfmu.drawing.panel import DARK, LIGHT, STYLES, Panel, Sheet, Style
from tendonfmu.files import whole_file

Target = Path | IO[bytes]

COLUMNS = {"small": 3, "medium": 2, "large": 1, "wide": 1}
_DPI, _CSS = 150, 100  # pixels and CSS pixels per inch of the drawing
_LEFT, _RIGHT, _BOTTOM, _TOP = 62, 18, 44, 28  # CSS pixels around the axes of a panel
_NAMES = 215.0  # CSS pixels, widest left margin with names
_TITLE, _LABEL, _NUMBER = 10.0, 8.8, 8.4  # pt
_WIDER = 1.12  # factor on the text of medium panels, which narrow screens shrink
_CELLS = 180  # rows and columns of a matrix; in larger ones neighbours are drawn as one
_DASHES = {"solid": "-", "dash": "--", "dot": ":"}


def write_sheet(sheet: Sheet, figures: Sequence[Any], target: Target) -> None:
    """Write the figures of a sheet side by side below its title and its keys, as PNG, whole or not at all."""
    with rc_context({"text.parse_math": False}):  # names may contain a $
        _write(_drawn(sheet, figures), target, exact=sheet.panels[0].heat is not None)


def _drawn(sheet: Sheet, figures: Sequence[Any]) -> Figure:
    first = sheet.panels[0]
    columns = min(COLUMNS[first.size], len(sheet.panels))
    rows = [range(k, min(k + columns, len(figures))) for k in range(0, len(figures), columns)]
    heights = [max(sheet.panels[k].extent[1] for k in row) for row in rows]
    width = columns * first.extent[0]
    title = wrap(sheet.title, max(int((width - 20) / 9.9), 20))
    key_rows = _key_rows([_key_length(meaning) for _, meaning in sheet.keys], width)
    top = 16 + 20 * (len(title) + key_rows)
    height = top + sum(heights)
    figure = Figure(figsize=(width / _CSS, height / _CSS), dpi=_DPI, facecolor="white")
    _draw_head(figure, sheet, title, key_rows, (width, height, top))
    for row, line in enumerate(rows):
        bottom = height - top - sum(heights[: row + 1])
        for column, k in enumerate(line):
            panel = sheet.panels[k]
            left, right = _margins(panel)
            own_width, own_height = panel.extent
            box = (column * own_width + left, bottom + _BOTTOM, own_width - left - right, own_height - _BOTTOM - _TOP)
            axes = figure.add_axes((box[0] / width, box[1] / height, box[2] / width, box[3] / height))
            _draw_figure(axes, figures[k], _NUMBER * _enlarged(panel))
            _label(axes, panel)
    return figure


def save(figure: Figure, target: Target, dpi: int) -> None:
    """Save a figure of matplotlib as PNG without date or version: the same drawing gives the same bytes."""
    figure.set_dpi(dpi)
    for text in figure.findobj(Text):
        text.set_parse_math(False)
    _write(figure, target, exact=True)


def clean(axes: Axes, labels: float = 12.0) -> None:
    """Leave two spines and a light grid of horizontal lines."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="#E6E6E6", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=labels)


def _write(figure: Figure, target: Target, *, exact: bool) -> None:
    """Write a figure whose texts may contain letters that the font lacks (drawn as boxes)."""
    canvas: Any = FigureCanvasAgg(figure)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")
        canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[:, :, :3]
    if not exact:  # fewer colours make a third of the bytes
        pixels = ((pixels.astype(np.uint16) * 31 + 127) // 255 * 255 // 31).astype(np.uint8)
    file = BytesIO()
    without_version: Any = {"Software": None}
    imsave(file, pixels, format="png", metadata=without_version)
    if isinstance(target, Path):
        with whole_file(target) as partial:
            partial.write_bytes(file.getvalue())
    else:
        target.write(file.getvalue())


# --- around the axes --------------------------------------------------------------------------------------------------


def _draw_head(figure: Figure, sheet: Sheet, title: list[str], rows: int, size: tuple[int, int, int]) -> None:
    width, height, top = size
    left = 12 / width
    text = "\n".join(title)
    longest = max((_key_length(meaning) for _, meaning in sheet.keys), default=0.0)
    figure.text(left, 1 - 4 / height, text, fontsize=12, fontweight="bold", color=DARK, va="top", linespacing=1.15)
    if not sheet.keys:
        return
    figure.legend(
        handles=[_handle(STYLES[style], meaning) for style, meaning in sheet.keys],
        loc="lower left",
        bbox_to_anchor=(left, 1 - top / height),
        ncols=ceil(len(sheet.keys) / rows),
        frameon=False,
        fontsize=min(9.0, 9.0 * (width - 24) / longest),
        borderaxespad=0.0,
        borderpad=0.2,
    )


def _key_length(meaning: str) -> float:
    """Return about how many CSS pixels a key takes."""
    return 50 + 6.8 * len(meaning)


def _key_rows(lengths: Sequence[float], room: float) -> int:
    """Return in how many rows keys of these lengths fit; a legend fills its columns one after the other."""
    rows = 1
    while sum(max(lengths[k : k + rows]) for k in range(0, len(lengths), rows)) > room and rows < len(lengths):
        rows += 1
    return rows


def _handle(style: Style, label: str) -> Line2D | Patch:
    if style.patch:
        return Patch(facecolor=style.colour, edgecolor=LIGHT, alpha=style.alpha, label=label)
    if style.width == 0:
        face = style.colour if style.filled else "white"
        return Line2D([], [], linestyle="none", marker="o", color=face, markeredgecolor=style.colour, label=label)
    return Line2D([], [], color=style.colour, linewidth=style.width + 0.4, linestyle=style.dash, label=label)


def _margins(panel: Panel) -> tuple[float, float]:
    """Return the room left and right of the axes in CSS pixels; longer names of rows need more."""
    names = panel.rows or tuple(name for _, name in panel.y_ticks)
    if not names:
        return _LEFT, _RIGHT
    left = min(_NAMES, 18 + 6.4 * _enlarged(panel) * max(map(len, names)))
    return (max(left, _LEFT), _RIGHT) if panel.size == "wide" else (left, 2 * _RIGHT)


def _enlarged(panel: Panel) -> float:
    return _WIDER if panel.size in ("medium", "wide") else 1.0


def _label(axes: Axes, panel: Panel) -> None:
    larger = _enlarged(panel)
    width, _ = panel.extent
    room = int((width - _LEFT - 6.2 * len(panel.note)) / (8.6 * larger))  # the title is cut where the note begins
    title = panel.title if len(panel.title) <= room else f"{panel.title[: room - 1]}…"
    axes.set_title(title, loc="left", fontsize=_TITLE * larger, fontweight="bold", color=DARK, pad=5)
    if panel.note:
        axes.set_title(panel.note, loc="right", fontsize=_NUMBER * larger, color="#555555", pad=5)
    axes.set_xlabel(panel.x_label, fontsize=_LABEL * larger, labelpad=2)
    axes.set_ylabel(panel.y_label, fontsize=_LABEL * larger)
    if not (panel.rows or panel.y_ticks):
        axes.yaxis.set_label_coords(-46 / (width - _LEFT - _RIGHT), 0.5)


# --- a Plotly figure --------------------------------------------------------------------------------------------------


def _draw_figure(axes: Axes, figure: Any, numbers: float) -> None:
    """Draw all of a figure but the titles of its axes; `numbers`: size of theirs in pt."""
    clean(axes, numbers)
    for shape in figure.layout.shapes:
        _draw_shape(axes, shape)
    for trace in figure.data:
        if trace.type == "heatmap":
            _draw_heat(axes, trace)
        else:
            _draw_scatter(axes, trace)
    _scale(axes, "x", figure.layout.xaxis)
    _scale(axes, "y", figure.layout.yaxis)
    if figure.layout.yaxis.showgrid is False:  # rows have names in place of numbers
        axes.tick_params(axis="y", length=0)
        axes.grid(visible=False)
        if figure.data and figure.data[0].type != "heatmap":
            axes.grid(axis="x", color="#EEEEEE", linewidth=0.8)


def _draw_shape(axes: Axes, shape: Any) -> None:
    line = {"color": shape.line.color, "linewidth": shape.line.width, "linestyle": _DASHES[shape.line.dash or "solid"]}
    if shape.type == "rect":
        axes.axvspan(shape.x0, shape.x1, color=_colour(shape.fillcolor), linewidth=0)
    elif shape.x0 == shape.x1:
        axes.axvline(shape.x0, **line)
    else:
        axes.axhline(shape.y0, **line)


def _draw_scatter(axes: Axes, trace: Any) -> None:
    x, y = np.asarray(trace.x, dtype=float), np.asarray(trace.y, dtype=float)
    if trace.fill:
        counts = trace.yaxis is not None
        height = HISTOGRAM if counts else 1.0
        below: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "zorder": 0.5} if counts else {}
        corners = np.column_stack([x, height * y])
        parts = [part[np.isfinite(part[:, 0])] for part in np.split(corners, np.flatnonzero(np.isnan(x)))]
        areas = PolyCollection(parts, facecolors=_colour(trace.fillcolor), linewidths=0, **below)
        axes.add_collection(areas, autolim=not counts)
        axes.autoscale_view()
        return
    if "lines" in trace.mode and trace.line.width:
        line = {"color": trace.line.color, "linewidth": trace.line.width, "alpha": trace.opacity}
        axes.plot(x, y, linestyle=_DASHES[trace.line.dash or "solid"], solid_capstyle="butt", **line)
    if "markers" in trace.mode:
        marker = trace.marker
        face = "white" if marker.symbol == "circle-open" else marker.color
        size = 0.6 * marker.size
        axes.plot(x, y, "o", ms=size, color=face, mec=marker.color, alpha=marker.opacity, clip_on=False)
    for place, text in zip(zip(x, y, strict=True), trace.text if "text" in trace.mode else (), strict=False):
        axes.annotate(html.unescape(text), place, (4, 3), textcoords="offset points", fontsize=_NUMBER, color=DARK)


def _draw_heat(axes: Axes, trace: Any) -> None:
    colours = LinearSegmentedColormap.from_list("heat", [colour for _, colour in trace.colorscale])
    of_pairs = isinstance(trace.x[0], str)
    values, _ = pooled(np.asarray(trace.z), (_CELLS, _CELLS if of_pairs else 6 * _CELLS))
    ends = []
    for places in (trace.x, trace.y):
        middles = np.arange(len(places)) if isinstance(places[0], str) else np.asarray(places, dtype=float)
        half = 0.5 * (middles[-1] - middles[0]) / max(len(middles) - 1, 1) or 0.5
        ends.append((middles[0] - half, middles[-1] + half))
    axes.imshow(
        values,
        cmap=colours.with_extremes(bad=LIGHT),
        vmin=trace.zmin,
        vmax=trace.zmax,
        interpolation="nearest",
        aspect="equal" if of_pairs else "auto",
        extent=(*ends[0], *ends[1][::-1]),
    )


def _colour(text: str) -> tuple[float, ...]:
    """Read "rgba(red,green,blue,alpha)"."""
    *rgb, alpha = (float(part) for part in text[5:-1].split(","))
    return (*(part / 255 for part in rgb), alpha)


def _scale(axes: Axes, name: str, given: Any) -> None:
    axis = getattr(axes, f"{name}axis")
    log = given.type == "log"
    if log:
        axes.set(**{f"{name}scale": "log"})
        axis.set_major_locator(LogLocator())
        # The default formatter writes mathematics, which is not parsed here, since names may contain a $.
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    if given.tickvals is not None:
        texts = [html.unescape(text) for text in given.ticktext]
        shown = given.showticklabels is not False
        axis.set_ticks(list(given.tickvals), texts if shown else [""] * len(texts), minor=False)
        axes.minorticks_off()
    if given.range is not None:
        ends = [10.0**end for end in given.range] if log else list(given.range)
        axes.set(**{f"{name}lim": ends})
