"""Turns panels (`panel_data.py`) into Plotly figures for a page: zoom, values under the pointer, light and dark.

A page contains the figures of its panels as JSON, and plotly.js once, compressed; `templates/report.js` draws them.
Colours are those of a light page. `dark_colours` returns CSS that changes them for readers who prefer a dark page.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.drawing.panel_data import Band, Bars, Curve, Dots, MatrixPanel, Panel
from tendonfmu.drawing.panel_styles import DIVERGING, IN_DARK, STYLES, Style, size_of

Figure = dict[str, Any]

_DASHES = {"-": "solid", "--": "dash", ":": "dot"}
_INNER = 0.6  # decades that the linear part of a stretched axis takes on each side of 0
_APART = 0.15  # share of a stretched axis, least distance of its numbers
_HISTOGRAM = 0.16  # share of the height of the axes
_MATRIX = 540  # CSS pixels, height
_TITLE = 20  # CSS pixels of the title, which is part of the page, not of the figure
_MOST_POINTS = 2000  # of a curve; longer curves that share their x are thinned
_MOST_CELLS = 400  # rows of a matrix; in larger ones neighbours are drawn as one
_FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif'
_AXIS = {
    "showline": True,
    "linecolor": "#1d2329",
    "zeroline": False,
    "ticks": "outside",
    "ticklen": 4,
    "title": {"standoff": 6, "font": {"size": 12}},
    "minor": {"ticks": "", "showgrid": False},
}
_LOGARITHMIC = {"type": "log", "dtick": 1, "tickformat": "~g"}
# what all figures of a page share
_TEMPLATE = {
    "layout": {
        "font": {"family": _FONT, "size": 11, "color": "#5b6570"},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "margin": {"l": 58, "r": 12, "t": 6, "b": 42},
        "showlegend": False,
        "hovermode": "x unified",
        "hoverlabel": {"bgcolor": "#fff", "font": {"family": _FONT, "size": 12}},
        "xaxis": {**_AXIS, "showgrid": False, "ticklabelposition": "outside"},
        "yaxis": {**_AXIS, "showline": False, "ticks": "", "gridcolor": "#e6e6e6"},
    }
}


def figures_json(panels: Sequence[Panel | MatrixPanel], names: Sequence[dict[str, str]]) -> Markup:
    """Return the figures of a page as JSON that is safe inside a `script` element."""
    figures = [figure_of(panel, named) for panel, named in zip(panels, names, strict=True)]
    text = json.dumps({"template": _TEMPLATE, "figures": figures}, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c"))


@cache
def packed_plotly() -> Markup:
    """Return plotly.js, compressed with gzip and encoded in base64: two fifths of its size."""
    from plotly.offline import get_plotlyjs

    return Markup(base64.b64encode(gzip.compress(get_plotlyjs().encode(), 6, mtime=0)).decode("ascii"))


def plotly_figure(figure: Figure) -> Any:
    """Return data and layout as a `plotly.graph_objects.Figure` with the look of the pages."""
    from plotly.graph_objects import Figure as PlotlyFigure

    # the title is at the left: the buttons are at the right
    title = {"x": 0, "xref": "container", "xanchor": "left", "pad": {"l": 12}, "font": {"size": 14}}
    own = {"paper_bgcolor": "#fff", "plot_bgcolor": "#fff", "showlegend": True, "title": title}
    template = {"layout": _TEMPLATE["layout"] | own}
    return PlotlyFigure(data=figure["data"], layout=figure["layout"] | {"template": template})


def dark_colours() -> Markup:
    """Return CSS rules that replace the colours of the light page by those of the dark page."""
    rules = []
    for light, dark in IN_DARK.items():
        red, green, blue = (int(light[k : k + 2], 16) for k in (1, 3, 5))
        rules += [
            f'.plot [style*="{use}: rgb({red}, {green}, {blue})"] {{ {use}: {dark} !important; }}'
            for use in ("stroke", "fill")
        ]
        rules.append(f'.keys [style*="{light}"] {{ color: {dark} !important; }}')
    return Markup("\n".join(rules))


def height_in_page(panel: Panel | MatrixPanel) -> int:
    """Return the height of a panel in CSS pixels, without its title; a matrix is about square."""
    return _MATRIX if isinstance(panel, MatrixPanel) else size_of(panel)[1] - _TITLE


def figure_of(panel: Panel | MatrixPanel, names: dict[str, str]) -> Figure:
    """Return data and layout of a panel as Plotly expects them."""
    if isinstance(panel, MatrixPanel):
        return _matrix(panel)
    drawing = _Drawing(panel, names)
    layout: Figure = {"xaxis": _x_axis(panel, drawing), "yaxis": _y_axis(panel)}
    if panel.rows:
        layout["hovermode"] = "closest"
    if panel.data is not None:
        layout["yaxis2"] = {"overlaying": "y", "range": [0, 1 / _HISTOGRAM], "visible": False, "fixedrange": True}
    shapes = list(_shapes(panel))
    if shapes:
        layout["shapes"] = shapes
    return {"data": drawing.traces(), "layout": layout, "height": height_in_page(panel), "zoom": panel.zoom}


# --- what is drawn ----------------------------------------------------------------------------------------------------


class _Drawing:
    """Traces of a panel. They are stretched along x if the panel's axis is."""

    def __init__(self, panel: Panel, names: dict[str, str]) -> None:
        self._panel = panel
        self._names = {style: html.escape(name.split(",")[0]) for style, name in names.items()}
        self._unit = unit_of(panel.x_label if panel.rows else panel.y_label)

    def x(self, values: Numbers) -> Numbers:
        return stretched(values, self._panel.near_x) if self._panel.near_x > 0 else np.asarray(values, dtype=float)

    def traces(self) -> list[Figure]:
        panel = self._panel
        found = [self._data(*panel.data)] if panel.data is not None else []
        for bars in panel.bars:
            found += self._bars(bars)
        for band in panel.bands:
            found += self._band(band)
        found += [self._curve(curve) for curve in thinned(panel.curves) if np.isfinite(curve.y).any()]
        return found + [self._dots(dots) for dots in panel.dots]

    def _data(self, edges: Numbers, heights: Numbers) -> Figure:
        """Show where samples are, as a histogram along the bottom."""
        style = STYLES["data"]
        filled = {"fill": "tozeroy", "fillcolor": _rgba(style), "line": {"width": 0, "shape": "hv"}}
        return _trace(self.x(edges), np.append(heights, heights[-1]), "lines", yaxis="y2", hoverinfo="skip", **filled)

    def _curve(self, curve: Curve) -> Figure:
        style = STYLES[curve.style]
        line = {"color": style.colour, "width": style.width, "dash": _DASHES[style.dash]}
        hover = self._hover(curve.style, curve.x, "%{y:.4~g}")
        return _trace(self.x(curve.x), curve.y, "lines", line=line, opacity=style.alpha, **hover)

    def _dots(self, dots: Dots) -> Figure:
        style = STYLES[dots.style]
        marker = {
            "color": style.colour,
            "size": 6,
            "symbol": "circle" if style.filled else "circle-open",
            "line": {"color": style.colour, "width": 1},
            "opacity": style.alpha,
        }
        hover = self._hover(dots.style, dots.x, "%{x:.4~g}" if self._panel.rows else "%{y:.4~g}")
        return _trace(self.x(dots.x), dots.y, "markers", marker=marker, cliponaxis=False, **hover)

    def _band(self, band: Band) -> Iterator[Figure]:
        """Draw the area of each stretch without gaps, and show its limits under the pointer."""
        x, low, high = self.x(band.x), np.asarray(band.low, dtype=float), np.asarray(band.high, dtype=float)
        known = np.isfinite(x + low + high)
        around: list[Numbers] = []
        for part in np.split(np.arange(len(x)), np.flatnonzero(np.diff(known)) + 1):
            if len(part) and known[part[0]]:
                back = part[::-1]
                gap = np.full((1, 2), np.nan)
                around += [np.column_stack([x[part], low[part]]), np.column_stack([x[back], high[back]]), gap]
        if around:
            outline = np.concatenate(around[:-1])
            filled = {"fill": "toself", "fillcolor": _rgba(STYLES[band.style]), "line": {"width": 0}}
            yield _trace(outline[:, 0], outline[:, 1], "lines", hoverinfo="skip", **filled)
            yield self._limits(band.style, band.x, low, high)

    def _bars(self, bars: Bars) -> Iterator[Figure]:
        style = STYLES[bars.style]
        at = np.repeat(np.asarray(bars.x if bars.lying else self.x(bars.x), dtype=float), 3)
        ends = np.column_stack([bars.low, bars.high, np.full(len(bars.x), np.nan)]).ravel()
        x, y = (ends, at) if bars.lying else (at, ends)
        line = {"color": style.colour, "width": 1.2}
        yield _trace(x, y, "lines", line=line, opacity=style.alpha, hoverinfo="skip")
        if not bars.lying:
            yield self._limits(bars.style, bars.x, bars.low, bars.high)

    def _limits(self, name: str, x: Numbers, low: Numbers, high: Numbers) -> Figure:
        """Show both ends under the pointer, without a line of their own."""
        hover = self._hover(name, x, "%{customdata:.4~g} to %{y:.4~g}")
        line = {"width": 0, "color": STYLES[name].colour}
        return _trace(self.x(x), high, "lines", line=line, customdata=_listed(low), **hover)

    def _hover(self, style: str, x: Numbers, value: str) -> Figure:
        """Show value, unit and name; on a stretched axis also x as a plain number."""
        text = f"{value} {self._unit} {self._names.get(style, '')}".replace("  ", " ").rstrip()
        if self._panel.near_x > 0:
            return {"text": [f"{each:.4g}" for each in x], "hovertemplate": f"%{{text}}: {text}<extra></extra>"}
        return {"hovertemplate": f"{text}<extra></extra>"}


def thinned(curves: Sequence[Curve]) -> Iterator[Curve]:
    """Thin long curves to the points that show: minimum and maximum of each stretch, at the same x in all curves."""
    same = [each for each in curves if len(each.x) == len(curves[0].x) and np.array_equal(each.x, curves[0].x, True)]
    if len(same) < len(curves) or not curves or len(curves[0].x) <= _MOST_POINTS:
        yield from curves
        return
    values = np.stack([np.asarray(each.y, dtype=float) for each in curves])
    gaps = ~np.isfinite(values).all(axis=0)
    kept = [np.flatnonzero(gaps), np.array([0, len(gaps) - 1])]
    known = np.flatnonzero(~gaps)
    for part in np.array_split(known, max(1, _MOST_POINTS // (2 * len(curves)))):
        if len(part):
            kept += [part[values[:, part].argmin(axis=1)], part[values[:, part].argmax(axis=1)]]
    rows = np.unique(np.concatenate(kept))
    yield from (Curve(each.style, each.x[rows], each.y[rows]) for each in curves)


def _trace(x: Numbers, y: Numbers, mode: str, **settings: Any) -> Figure:
    return {"type": "scatter", "mode": mode, "x": _listed(x), "y": _listed(y), **settings}


def _listed(values: Numbers) -> list[float | None]:
    """Round to six digits, more than a screen shows; None where there is no number."""
    return [float(f"{each:.6g}") if math.isfinite(each) else None for each in np.asarray(values, dtype=float).tolist()]


def _rgba(style: Style) -> str:
    red, green, blue = (int(style.colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{style.alpha})"


def _shapes(panel: Panel) -> Iterator[Figure]:
    """Return the stripes and the marked x."""
    style = STYLES[panel.stripe_style]
    upright = {"yref": "paper", "y0": 0, "y1": 1, "layer": "below"}
    for begin, end in panel.stripes:
        yield {"type": "rect", "x0": begin, "x1": end, **upright, "fillcolor": _rgba(style), "line": {"width": 0}}
    if panel.line is not None:
        line = {"color": STYLES["start"].colour, "width": 1, "dash": "dash"}
        yield {"type": "line", "x0": panel.line, "x1": panel.line, **upright, "line": line}


# --- axes -------------------------------------------------------------------------------------------------------------


def unit_of(label: str) -> str:
    """Return what is in brackets at the end of an axis label."""
    _, bracket, rest = label.partition(" (")
    return html.escape(rest[:-1]) if bracket and rest.endswith(")") else ""


def _x_axis(panel: Panel, drawing: _Drawing) -> Figure:
    found: Figure = {"title": {"text": html.escape(panel.x_label)}}
    found["unifiedhovertitle"] = {"text": f"%{{x:.5~g}} {unit_of(panel.x_label)}".rstrip()}
    if panel.log_x:
        found |= _LOGARITHMIC
    if panel.x_limits is not None:
        low, high = panel.x_limits
        found["range"] = (
            [math.log10(low), math.log10(high)] if panel.log_x else _listed(drawing.x(np.array([low, high])))
        )
    if panel.ticks:
        found |= _named_ticks([at for at, _ in panel.ticks], [name for _, name in panel.ticks])
    elif panel.near_x > 0:
        values = _spaced(panel)
        found |= _named_ticks(_listed(drawing.x(np.array(values))), [f"{each:g}".replace("-", "−") for each in values])
        found["unifiedhovertitle"] = {"text": html.escape(panel.x_label)}
    return found


def _y_axis(panel: Panel) -> Figure:
    found: Figure = {"title": {"text": html.escape(panel.y_label)}}
    if panel.rows:
        found |= _named_ticks(list(range(len(panel.rows))), panel.rows)
        return found | {"range": [len(panel.rows) - 0.4, -0.6], "automargin": True, "showgrid": False}
    if panel.log_y:
        found |= _LOGARITHMIC
    if panel.y_limits is not None:
        found["range"] = [math.log10(each) if panel.log_y else each for each in panel.y_limits]
    return found


def _named_ticks(places: Sequence[float | None], names: Iterable[str]) -> Figure:
    return {"tickvals": list(places), "ticktext": [html.escape(name) for name in names]}


def stretched(values: Numbers, near: float) -> Numbers:
    """Map numbers to an axis that is linear up to `near` on both sides of 0 and logarithmic beyond."""
    given = np.asarray(values, dtype=float)
    size = np.abs(given) / near
    return np.asarray(np.sign(given) * np.where(size <= 1, _INNER * size, _INNER + np.log10(np.maximum(size, 1.0))))


def _spaced(panel: Panel) -> list[float]:
    """Choose 0 and round numbers on both sides of it within the range drawn, the more important ones first."""
    drawn = [each.x for part in (panel.curves, panel.bands, panel.dots, panel.bars) for each in part]
    values = np.concatenate([np.asarray(each, dtype=float) for each in drawn] or [np.zeros(1)])
    low, high = (float(end(values[np.isfinite(values)], initial=0.0)) for end in (np.min, np.max))
    powers = range(math.floor(math.log10(panel.near_x)) - 1, math.ceil(math.log10(max(high, -low, panel.near_x))) + 1)
    numbers = [
        0.0,
        *(side * factor * 10.0**power for factor in (1, 5, 2) for power in powers[::-1] for side in (1, -1)),
    ]
    places = stretched(np.array(numbers), panel.near_x)
    begin, end = stretched(np.array([low, high]), panel.near_x)
    taken: list[int] = []
    for k, place in enumerate(places):
        if begin <= place <= end and all(abs(place - places[j]) > _APART * (end - begin) for j in taken):
            taken.append(k)
    return sorted(numbers[k] for k in taken)


# --- a matrix ---------------------------------------------------------------------------------------------------------


def _matrix(panel: MatrixPanel) -> Figure:
    """Show correlations as colours; in a large matrix the strongest of neighbours, so that none is overlooked."""
    matrix, every = pooled(panel.matrix)
    more = f" and {every - 1} more" if every > 1 else ""
    names = [f"{html.escape(name)}{more}" for name in panel.names[::every]]
    middles = [((begin + end - 1) / 2 + 0.5) / every - 0.5 for _, begin, end in panel.groups]
    ticks = _named_ticks(middles, [name for name, _, _ in panel.groups])
    side = len(matrix)
    borders = [begin / every - 0.5 for _, begin, _ in panel.groups[1:]]
    line = {"color": "#8A8A8A", "width": 0.5}
    shapes = [{"type": "line", "x0": at, "x1": at, "y0": -0.5, "y1": side - 0.5, "line": line} for at in borders]
    shapes += [{"type": "line", "y0": at, "y1": at, "x0": -0.5, "x1": side - 0.5, "line": line} for at in borders]
    steps = len(DIVERGING) - 1
    heat: Figure = {
        "type": "heatmap",
        "z": {"dtype": "i1", "bdata": base64.b64encode(matrix.tobytes()).decode("ascii"), "shape": f"{side}, {side}"},
        "zmin": -100,
        "zmax": 100,
        "colorscale": [[k / steps, colour] for k, colour in enumerate(DIVERGING)],
        "showscale": False,
        "x": names,
        "y": names,
        "hovertemplate": "%{z} %<br>%{y}<br>%{x}<extra></extra>",
    }
    layout: Figure = {
        "hovermode": "closest",
        "xaxis": {**ticks, "showticklabels": False, "range": [-0.5, side - 0.5], "title": {"text": "the same order"}},
        "yaxis": {**ticks, "range": [side - 0.5, -0.5], "automargin": True, "showgrid": False},
        "shapes": shapes,
    }
    return {"data": [heat], "layout": layout, "height": height_in_page(panel), "zoom": ""}


def pooled(matrix: Numbers) -> tuple[NDArray[np.int8], int]:
    """Return a matrix in per cent, and how many of its rows each row stands for."""
    every = math.ceil(len(matrix) / _MOST_CELLS) or 1
    room = -len(matrix) % every
    whole = np.pad(matrix, ((0, room), (0, room)))
    side = len(whole) // every
    blocks = whole.reshape(side, every, side, every).swapaxes(1, 2).reshape(side, side, -1)
    best = np.take_along_axis(blocks, np.abs(blocks).argmax(axis=2)[:, :, None], axis=2)[:, :, 0]
    return np.round(100 * best).astype(np.int8), every
