"""Makes a Plotly figure of each panel: zoom, values under the pointer, light and dark.

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
from plotly import graph_objects as go
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

from tendonfmu.arrays import Numbers
from tendonfmu.drawing.panel import IN_DARK, STYLES, Band, Bars, Curve, Dots, Heat, Panel, Sheet, Style, Ticks

__all__ = ["dark_colours", "figure_of", "figures_json", "figures_of", "go", "make_subplots", "packed_plotly", "thinned"]

HISTOGRAM = 0.16  # share of the height of the axes
_DASHES = {"-": "solid", "--": "dash", ":": "dot"}
_INNER = 0.6  # decades that the linear part of a stretched axis takes on each side of 0
_APART = 0.15  # share of a stretched axis, least distance of its numbers
_MOST_POINTS = 2000  # of a curve; longer curves that share their x are thinned
_MARKER = 6  # CSS pixels
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
TEMPLATE = go.layout.Template(  # what all figures share
    layout={
        "font": {"family": _FONT, "size": 11, "color": "#5b6570"},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "margin": {"l": 58, "r": 12, "t": 6, "b": 42},
        "showlegend": False,
        "hovermode": "x unified",
        "hoverlabel": {"bgcolor": "#fff", "font": {"family": _FONT, "size": 12}},
        "xaxis": {**_AXIS, "showgrid": False, "ticklabelposition": "outside"},
        "yaxis": {**_AXIS, "showline": False, "ticks": "", "gridcolor": "#e6e6e6", "automargin": "left"},
    },
    _validate=False,
)


def figures_of(sheet: Sheet) -> list[go.Figure]:
    """Return a figure for each panel of a sheet."""
    names = dict(sheet.keys)
    return [figure_of(panel, names) for panel in sheet.panels]


def figures_json(figures: Iterable[tuple[Panel, go.Figure]]) -> Markup:
    """Return the figures of a page as JSON that is safe inside a `script` element."""
    parts = [{**figure.to_dict(), "height": panel.page_height, "zoom": panel.zoom} for panel, figure in figures]
    page = {"template": TEMPLATE.to_plotly_json(), "figures": parts}
    # `to_dict` packs all arrays but those without a number
    text = json.dumps(page, allow_nan=False, separators=(",", ":"), default=np.ndarray.tolist)
    return Markup(text.replace("<", "\\u003c"))


@cache
def packed_plotly() -> Markup:
    """Return plotly.js, compressed with gzip and encoded in base64: two fifths of its size."""
    return Markup(base64.b64encode(gzip.compress(get_plotlyjs().encode(), 4, mtime=0)).decode("ascii"))


def dark_colours() -> Markup:
    """Return CSS rules that replace the colours of the light page by those of the dark page."""
    rules = []
    for light, dark in IN_DARK.items():
        red, green, blue = _rgb(light)
        rules += [
            f'.plot [style*="{use}: rgb({red}, {green}, {blue})"] {{ {use}: {dark} !important; }}'
            for use in ("stroke", "fill")
        ]
        rules.append(f'.keys [style*="{light}"] {{ color: {dark} !important; }}')
        rules += [f'.finger [{use}="{light}"] {{ {use}: {dark}; }}' for use in ("stroke", "fill")]
    return Markup("\n".join(rules))


def figure_of(panel: Panel, names: dict[str, str]) -> go.Figure:
    """Return the figure of a panel; `names` are the meanings of its styles."""
    layout = go.Layout(xaxis=_x_axis(panel), yaxis=_y_axis(panel), shapes=list(_shapes(panel)) or None)
    if panel.rows or panel.heat is not None:
        layout.hovermode = "closest"
    if panel.data is not None:
        layout.yaxis2 = go.layout.YAxis(overlaying="y", range=[0, 1 / HISTOGRAM], visible=False, fixedrange=True)
    return go.Figure(list(_Traces(panel, names).all()), layout, _validate=False)


# --- what is drawn ----------------------------------------------------------------------------------------------------


class _Traces:
    """Traces of a panel, stretched where its axes are."""

    def __init__(self, panel: Panel, names: dict[str, str]) -> None:
        self._panel = panel
        self._names = {style: html.escape(name.split(",")[0]) for style, name in names.items()}
        self._unit = unit_of(panel.x_label if panel.rows else panel.y_label)

    def all(self) -> Iterator[Any]:
        panel = self._panel
        if panel.data is not None:
            yield self._data(*panel.data)
        if panel.heat is not None:
            yield _heat(panel.heat)
        for bars in panel.bars:
            yield from self._bars(bars)
        for band in panel.bands:
            yield from self._band(band)
        yield from (self._curve(curve) for curve in thinned(panel.curves) if np.isfinite(curve.y).any())
        yield from (self._dots(dots) for dots in panel.dots)

    def _lines(self, x: Numbers, y: Numbers, **settings: Any) -> go.Scatter:
        """Return a trace; single precision has seven digits, more than a screen shows."""
        panel = self._panel
        places = (
            np.asarray(stretched(values, near) if near > 0 else values, dtype=np.float32)
            for values, near in ((x, panel.near_x), (y, panel.near_y))
        )
        # Plotly's checks take most of the time; test_figures.py makes them of a figure of each kind.
        return go.Scatter(dict(zip("xy", places, strict=True)), _validate=False, **({"mode": "lines"} | settings))

    def _data(self, edges: Numbers, heights: Numbers) -> go.Scatter:
        """Show where samples are, as a histogram along the bottom."""
        x = np.concatenate([edges[:1], np.repeat(edges, 2)[1:-1], edges[-1:]])
        y = np.concatenate([[0.0], np.repeat(heights, 2), [0.0]])
        return self._lines(x, y, yaxis="y2", hoverinfo="skip", **_filled(STYLES["data"]))

    def _curve(self, curve: Curve) -> go.Scatter:
        style = STYLES[curve.style]
        line = {"color": style.colour, "width": style.width, "dash": _DASHES[style.dash]}
        hover = self._hover(curve.style, curve.x, "%{y:.4~g}")
        return self._lines(curve.x, curve.y, line=line, opacity=style.alpha, **hover)

    def _dots(self, dots: Dots) -> go.Scatter:
        style = STYLES[dots.style]
        marker = {
            "color": style.colour,
            "size": _MARKER,
            "symbol": "circle" if style.filled else "circle-open",
            "line": {"color": style.colour, "width": 1},
            "opacity": style.alpha,
        }
        hover = self._hover(dots.style, dots.x, "%{x:.4~g}" if self._panel.rows else "%{y:.4~g}")
        if dots.texts:
            hover |= {"mode": "markers+text", "text": list(map(html.escape, dots.texts)), "textposition": "top right"}
        return self._lines(dots.x, dots.y, **({"mode": "markers", "marker": marker, "cliponaxis": False} | hover))

    def _band(self, band: Band) -> Iterator[go.Scatter]:
        """Draw the area of each stretch without gaps, and show its limits under the pointer."""
        x, low, high = (np.asarray(values, dtype=float) for values in (band.x, band.low, band.high))
        known = np.isfinite(x + low + high)
        around: list[Numbers] = []
        for part in np.split(np.arange(len(x)), np.flatnonzero(np.diff(known)) + 1):
            if len(part) and known[part[0]]:
                back = part[::-1]
                gap = np.full((1, 2), np.nan)
                around += [np.column_stack([x[part], low[part]]), np.column_stack([x[back], high[back]]), gap]
        if around:
            outline = np.concatenate(around[:-1])
            yield self._lines(outline[:, 0], outline[:, 1], hoverinfo="skip", **_filled(STYLES[band.style]))
            yield self._limits(band.style, x, low, high)

    def _bars(self, bars: Bars) -> Iterator[go.Scatter]:
        style = STYLES[bars.style]
        at = np.repeat(np.asarray(bars.x, dtype=float), 3)
        ends = np.column_stack([bars.low, bars.high, np.full(len(bars.x), np.nan)]).ravel()
        x, y = (ends, at) if bars.lying else (at, ends)
        line = {"color": style.colour, "width": max(style.width, 1.2)}
        yield self._lines(x, y, line=line, opacity=style.alpha, hoverinfo="skip")
        if not bars.lying:
            yield self._limits(bars.style, bars.x, bars.low, bars.high)

    def _limits(self, name: str, x: Numbers, low: Numbers, high: Numbers) -> go.Scatter:
        """Show both ends under the pointer, without a line of their own."""
        line = {"width": 0, "color": STYLES[name].colour}
        return self._lines(x, high, line=line, **self._hover(name, x, "%{y:.4~g}", low))

    def _hover(self, style: str, x: Numbers, value: str, low: Numbers | None = None) -> dict[str, Any]:
        """Show value, unit and name, after the lower end if there is one; on a stretched axis also x as it is."""
        data = [] if low is None else [low]
        text = value if low is None else f"%{{customdata[0]:.4~g}} to {value}"
        text = f"{text} {self._unit} {self._names.get(style, '')}".replace("  ", " ").rstrip()
        if self._panel.near_x > 0:
            text = f"%{{customdata[{len(data)}]:.4~g}}: {text}"
            data.append(x)
        hover: dict[str, Any] = {"hovertemplate": f"{text}<extra></extra>"}
        return hover | {"customdata": np.column_stack(data).astype(np.float32)} if data else hover


def thinned(curves: Sequence[Curve]) -> Iterator[Curve]:
    """Thin long curves to the points that show: minimum and maximum of each stretch, at the same x in all curves."""
    same = all(np.array_equal(curve.x, curves[0].x, equal_nan=True) for curve in curves)
    if not same or not curves or len(curves[0].x) <= _MOST_POINTS:
        yield from curves
        return
    values = np.stack([np.asarray(curve.y, dtype=float) for curve in curves])
    gaps = ~np.isfinite(values).all(axis=0)
    kept = [np.flatnonzero(gaps), np.array([0, len(gaps) - 1])]
    known = np.flatnonzero(~gaps)
    for part in np.array_split(known, max(1, _MOST_POINTS // (2 * len(curves)))):
        if len(part):
            kept += [part[values[:, part].argmin(axis=1)], part[values[:, part].argmax(axis=1)]]
    rows = np.unique(np.concatenate(kept))
    yield from (Curve(curve.style, curve.x[rows], curve.y[rows]) for curve in curves)


def _heat(heat: Heat) -> go.Heatmap:
    steps = len(heat.colours) - 1
    x, y = (list(map(html.escape, names)) if isinstance(names[0], str) else names for names in (heat.x, heat.y))
    return go.Heatmap(
        z=heat.values,
        x=x,
        y=y,
        zmin=heat.low,
        zmax=heat.high,
        colorscale=[[k / steps, colour] for k, colour in enumerate(heat.colours)],
        showscale=False,
        hovertemplate=f"%{{z:.3~g}} {heat.unit}<br>%{{y}}<br>%{{x}}<extra></extra>",
    )


def _filled(style: Style) -> dict[str, Any]:
    red, green, blue = _rgb(style.colour)
    return {"fill": "toself", "fillcolor": f"rgba({red},{green},{blue},{style.alpha})", "line": {"width": 0}}


def _rgb(colour: str) -> tuple[int, ...]:
    return tuple(int(colour[k : k + 2], 16) for k in (1, 3, 5))


def _shapes(panel: Panel) -> Iterator[go.layout.Shape]:
    """Return the stripes and the marked x."""
    upright = {"yref": "y domain", "y0": 0, "y1": 1, "layer": "below"}
    for name, intervals in panel.stripes.items():
        colour = _filled(STYLES[name])["fillcolor"]
        for begin, end in intervals:
            yield go.layout.Shape(type="rect", x0=begin, x1=end, fillcolor=colour, line={"width": 0}, **upright)
    if panel.line is not None:
        line = {"color": STYLES["start"].colour, "width": 1, "dash": "dash"}
        yield go.layout.Shape(type="line", x0=panel.line, x1=panel.line, line=line, **upright)


# --- axes -------------------------------------------------------------------------------------------------------------


def unit_of(label: str) -> str:
    """Return what is in brackets at the end of an axis label."""
    _, bracket, rest = label.partition(" (")
    return html.escape(rest[:-1]) if bracket and rest.endswith(")") else ""


def _x_axis(panel: Panel) -> go.layout.XAxis:
    axis = go.layout.XAxis(title={"text": html.escape(panel.x_label)})
    axis.unifiedhovertitle = {"text": f"%{{x:.5~g}} {unit_of(panel.x_label)}".rstrip()}
    _scale(axis, panel.x_limits, panel.log_x, panel.near_x, panel.ticks, _drawn(panel, "x"))
    if panel.near_x > 0:
        axis.unifiedhovertitle = {"text": html.escape(panel.x_label)}
    return axis


def _y_axis(panel: Panel) -> go.layout.YAxis:
    axis = go.layout.YAxis(title={"text": html.escape(panel.y_label)})
    if panel.rows:
        ticks = tuple(enumerate(panel.rows))
        _scale(axis, (len(panel.rows) - 0.4, -0.6), False, 0.0, ticks, ())
    else:
        _scale(axis, panel.y_limits, panel.log_y, panel.near_y, panel.y_ticks, _drawn(panel, "y"))
    if panel.rows or panel.y_ticks:
        axis.automargin, axis.showgrid = True, False
    return axis


def _scale(
    axis: Any, limits: tuple[float, float] | None, log: bool, near: float, ticks: Ticks, drawn: Sequence[Numbers]
) -> None:
    if log:
        axis.update(type="log", dtick=1, tickformat="~g")
    if limits is not None:
        axis.range = [math.log10(end) if log else float(_on_axis(end, near)) for end in limits]
    if near > 0 and not ticks:
        ticks = tuple((value, f"{value:g}".replace("-", "−")) for value in _spaced(drawn, near))
    if ticks:
        axis.tickvals = [float(_on_axis(place, near)) for place, _ in ticks]
        axis.ticktext = [html.escape(name) for _, name in ticks]


def _drawn(panel: Panel, axis: str) -> list[Numbers]:
    """Return the values drawn along an axis."""
    if axis == "x":
        return [part.x for parts in (panel.curves, panel.bands, panel.dots, panel.bars) for part in parts]
    return [part.y for parts in (panel.curves, panel.dots) for part in parts] + [band.high for band in panel.bands]


def _on_axis(value: float, near: float) -> Numbers:
    return stretched(np.array(value), near) if near > 0 else np.array(value)


def stretched(values: Numbers, near: float) -> Numbers:
    """Map numbers to an axis that is linear up to `near` on both sides of 0 and logarithmic beyond."""
    given = np.asarray(values, dtype=float)
    size = np.abs(given) / near
    return np.asarray(np.sign(given) * np.where(size <= 1, _INNER * size, _INNER + np.log10(np.maximum(size, 1.0))))


def _spaced(drawn: Sequence[Numbers], near: float) -> list[float]:
    """Choose 0 and round numbers on both sides of it within the range drawn, the more important ones first."""
    values = np.concatenate([np.asarray(part, dtype=float) for part in drawn] or [np.zeros(1)])
    low, high = (float(end(values[np.isfinite(values)], initial=0.0)) for end in (np.min, np.max))
    powers = range(math.floor(math.log10(near)) - 1, math.ceil(math.log10(max(high, -low, near))) + 1)
    numbers = [
        0.0,
        *(side * factor * 10.0**power for factor in (1, 5, 2) for power in powers[::-1] for side in (1, -1)),
    ]
    places = stretched(np.array(numbers), near)
    begin, end = stretched(np.array([low, high]), near)
    taken: list[int] = []
    for k, place in enumerate(places):
        if begin <= place <= end and all(abs(place - places[j]) > _APART * (end - begin) for j in taken):
            taken.append(k)
    return sorted(numbers[k] for k in taken)
