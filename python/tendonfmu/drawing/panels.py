"""Draws panels (`panel_data.py`) as PNG files. It computes nothing: the data come ready-made.

Panels have fixed margins, so that they align with each other.
"""

from __future__ import annotations

from io import BytesIO
from math import ceil
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.image import imsave
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from tendonfmu.drawing.panel_data import MatrixPanel, Panel, Sheet
from tendonfmu.drawing.panel_styles import DIVERGING, SIZES, STYLES, Style, size_of
from tendonfmu.drawing.plot_style import DARK, GREY, LIGHT, any_names, clean
from tendonfmu.files import whole_file

Pixels = NDArray[np.uint8]

COLUMNS = {"small": 3, "medium": 2, "large": 1}
_DPI, _CSS = 150, 100  # pixels and CSS pixels per inch of the drawing
_LEFT, _RIGHT, _BOTTOM, _TOP = 62, 18, 44, 28  # CSS pixels
_NAMES = 215.0  # CSS pixels, widest left margin with names
_TITLE, _LABEL, _NUMBER = 10.0, 8.8, 8.4  # pt
_WIDER = 1.12  # factor on the text of medium panels, which narrow screens shrink


_DIVERGING = LinearSegmentedColormap.from_list("diverging", DIVERGING)


def draw_panel(panel: Panel | MatrixPanel) -> Pixels:
    """Draw a panel alone."""
    # returns pixels [height, width, 3]
    width, height = size_of(panel)
    figure = Figure(figsize=(width / _CSS, height / _CSS), facecolor="white")
    named = isinstance(panel, MatrixPanel) or bool(panel.rows)
    left = _room_for_names(panel) if named else _LEFT
    right = 2 * _RIGHT if named else _RIGHT
    box = (left / width, _BOTTOM / height, 1 - (left + right) / width, 1 - (_BOTTOM + _TOP) / height)
    axes = figure.add_axes(box)
    if isinstance(panel, MatrixPanel):
        _draw_matrix(axes, panel)
    else:
        _draw_axes(axes, panel)
    return _pixels(figure)


def _room_for_names(panel: Panel | MatrixPanel) -> float:
    """Return the room in CSS pixels that the longest name needs."""
    if isinstance(panel, MatrixPanel):
        return _NAMES
    return min(_NAMES, 18 + 6.4 * _enlarged(panel) * max(len(name) for name in panel.rows))


def png(pixels: Pixels, *, exact: bool = False) -> bytes:
    """Encode pixels as PNG; the same pixels give the same bytes."""
    file = BytesIO()
    if not exact:
        pixels = ((pixels.astype(np.uint16) * 31 + 127) // 255 * 255 // 31).astype(np.uint8)
    metadata: dict[str, Any] = {"Software": None}
    imsave(file, pixels, format="png", metadata=metadata)
    return file.getvalue()


def write_sheet(sheet: Sheet, panels: list[Pixels], file: Path) -> None:
    """Write all panels of a sheet side by side below its title and its keys, as PNG, whole or not at all."""
    columns = min(COLUMNS[sheet.panels[0].size], len(panels))
    rows = [panels[k : k + columns] for k in range(0, len(panels), columns)]
    width = columns * panels[0].shape[1]
    lines = [_head(sheet, width)]
    for row in rows:
        line: Pixels = np.concatenate(row, axis=1)
        rest = np.full((line.shape[0], width - line.shape[1], 3), 255, np.uint8)
        lines.append(np.concatenate([line, rest], axis=1))
    with whole_file(file) as partial:
        partial.write_bytes(png(np.concatenate(lines), exact=isinstance(sheet.panels[0], MatrixPanel)))


def _head(sheet: Sheet, width: int) -> Pixels:
    room = width * _CSS / _DPI  # CSS pixels
    title = wrap(sheet.title, max(int((room - 20) / 9.9), 20))
    wanted = sum(50 + 6.8 * len(meaning) for _, meaning in sheet.keys)
    rows = ceil(wanted / room)
    height = 16 + 20 * (len(title) + rows)
    figure = Figure(figsize=(width / _DPI, height / _CSS), facecolor="white")
    left = 12 / room
    text = "\n".join(title)
    figure.text(left, 1 - 4 / height, text, fontsize=12, fontweight="bold", color=DARK, va="top", linespacing=1.15)
    figure.legend(
        handles=[_handle(STYLES[style], meaning) for style, meaning in sheet.keys],
        loc="lower left",
        bbox_to_anchor=(left, 0.0),
        ncols=ceil(len(sheet.keys) / rows),
        frameon=False,
        fontsize=9,
        borderaxespad=0.0,
        borderpad=0.2,
    )
    return _pixels(figure)


def _handle(style: Style, label: str) -> Line2D | Patch:
    if style.patch:
        return Patch(facecolor=style.colour, edgecolor=LIGHT, alpha=style.alpha, label=label)
    if style.width == 0:
        return Line2D(
            [], [], linestyle="none", marker="o", color=_face(style), markeredgecolor=style.colour, label=label
        )
    return Line2D([], [], color=style.colour, linewidth=style.width + 0.4, linestyle=style.dash, label=label)


def _face(style: Style) -> str:
    return style.colour if style.filled else "white"


def _pixels(figure: Figure) -> Pixels:
    figure.set_dpi(_DPI)
    width, height = figure.canvas.get_width_height(physical=True)
    file = BytesIO()
    with any_names(figure):
        figure.savefig(file, format="rgba", dpi=_DPI, facecolor="white")
    return np.frombuffer(file.getvalue(), np.uint8).reshape(height, width, 4)[:, :, :3]


# --- one panel --------------------------------------------------------------------------------------------------------


def _draw_axes(axes: Axes, panel: Panel) -> None:
    clean(axes, _NUMBER * _enlarged(panel))
    _draw_data(axes, panel)
    for begin, end in panel.stripes:
        style = STYLES[panel.stripe_style]
        axes.axvspan(begin, end, color=style.colour, alpha=style.alpha, linewidth=0)
    for band in panel.bands:
        style = STYLES[band.style]
        axes.fill_between(band.x, band.low, band.high, color=style.colour, alpha=style.alpha, linewidth=0)
    for curve in panel.curves:
        style = STYLES[curve.style]
        axes.plot(curve.x, curve.y, color=style.colour, linewidth=style.width, linestyle=style.dash, alpha=style.alpha)
    for dots in panel.dots:
        style = STYLES[dots.style]
        face, edge = _face(style), style.colour
        axes.plot(dots.x, dots.y, "o", ms=2.8, color=face, markeredgecolor=edge, alpha=style.alpha, clip_on=False)
    for bars in panel.bars:
        style = STYLES[bars.style]
        lines = axes.hlines if bars.lying else axes.vlines
        lines(bars.x, bars.low, bars.high, color=style.colour, linewidth=1.2, alpha=style.alpha)
    for wanted, axis in ((panel.log_x, "x"), (panel.log_y, "y")):
        if wanted:
            axes.set(**{f"{axis}scale": "log"})
            # The default formatter writes mathematics, which is not parsed here, since names may contain a $.
            getattr(axes, f"{axis}axis").set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            getattr(axes, f"{axis}axis").set_minor_formatter(NullFormatter())
    if panel.near_x > 0:
        axes.set_xscale("symlog", linthresh=panel.near_x, linscale=0.6)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    if panel.line is not None:
        axes.axvline(panel.line, color=GREY, linewidth=1.0, linestyle="--")
    _scale(axes, panel)
    _label(axes, panel)


def _draw_data(axes: Axes, panel: Panel) -> None:
    if panel.data is None:
        return
    edges, heights = panel.data
    style = STYLES["data"]
    axes.fill_between(
        edges,
        0.16 * np.append(heights, heights[-1]),
        step="post",
        color=style.colour,
        alpha=style.alpha,
        linewidth=0,
        transform=axes.get_xaxis_transform(),
        zorder=0.5,
    )


def _scale(axes: Axes, panel: Panel) -> None:
    if panel.ticks:
        axes.set_xticks([at for at, _ in panel.ticks], [name for _, name in panel.ticks])
        axes.minorticks_off()
    if panel.x_limits is not None:
        axes.set_xlim(*panel.x_limits)
    if panel.y_limits is not None:
        axes.set_ylim(*panel.y_limits)
    if panel.rows:
        axes.set_yticks(range(len(panel.rows)), panel.rows)
        axes.set_ylim(len(panel.rows) - 0.4, -0.6)
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="x", color="#EEEEEE", linewidth=0.8)


def _enlarged(panel: Panel | MatrixPanel) -> float:
    return _WIDER if panel.size == "medium" else 1.0


def _label(axes: Axes, panel: Panel) -> None:
    larger = _enlarged(panel)
    axes.set_title(_short(panel), loc="left", fontsize=_TITLE * larger, fontweight="bold", color=DARK, pad=5)
    if panel.note:
        axes.set_title(panel.note, loc="right", fontsize=_NUMBER * larger, color="#555555", pad=5)
    axes.set_xlabel(panel.x_label, fontsize=_LABEL * larger, labelpad=2)
    axes.set_ylabel(panel.y_label, fontsize=_LABEL * larger)
    if not panel.rows:
        axes.yaxis.set_label_coords(-46 / (SIZES[panel.size][0] - _LEFT - _RIGHT), 0.5)


def _short(panel: Panel) -> str:
    """Return the title, shortened where it would overlap the note."""
    width, _ = SIZES[panel.size]
    room = int((width - _LEFT - 6.2 * len(panel.note)) / (8.6 * _enlarged(panel)))
    return panel.title if len(panel.title) <= room else f"{panel.title[: room - 1]}…"


def _draw_matrix(axes: Axes, panel: MatrixPanel) -> None:
    axes.imshow(panel.matrix, cmap=_DIVERGING, vmin=-1.0, vmax=1.0, interpolation="nearest", aspect="equal")
    rows, columns = panel.marked.T
    axes.scatter(columns, rows, 5.0, panel.matrix[rows, columns], cmap=_DIVERGING, vmin=-1.0, vmax=1.0, linewidths=0)
    middles = [(begin + end - 1) / 2 for _, begin, end in panel.groups]
    names = [name for name, _, _ in panel.groups]
    axes.set_yticks(middles, names)
    axes.set_xticks(middles, [""] * len(names))
    axes.set_xlabel("the same order", fontsize=_LABEL)
    for _, begin, _ in panel.groups[1:]:
        axes.axhline(begin - 0.5, color=LIGHT, linewidth=0.7)
        axes.axvline(begin - 0.5, color=LIGHT, linewidth=0.7)
    axes.tick_params(labelsize=_LABEL, length=2)
    axes.set_title(panel.title, loc="left", fontsize=_TITLE, fontweight="bold", color=DARK, pad=5)
