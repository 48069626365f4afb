"""What pages and notebooks show: traces of Plotly, panels of them, sheets of panels, made by small functions.

A trace is a dictionary as Plotly has it. Its `key` (CSS class, colour, opacity) is shown beside its name above a sheet.
A page contains the figures of its panels as JSON, and plotly.js once, compressed; `templates/report.js` draws them. The
colours are those of Okabe and Ito, which colour-blind readers can distinguish; CSS replaces them on a dark page.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike, NDArray

from tendonfmu.arrays import Numbers

Interval = tuple[float, float]
Ticks = Iterable[tuple[float, str]]  # (place, name)
Trace = dict[str, Any]
Key = tuple[str, str, float, str]  # CSS class, colour, opacity, meaning
Size = Literal["small", "medium", "large", "wide"]

BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION = "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00"
DARK, GREY, LIGHT, SKIN, SILVER, SAND = "#222222", "#8A8A8A", "#D5D8DC", "#F4F1EC", "#BDBDBD", "#F0C27A"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE, DARK, GREY)  # of curves that are alike
DIVERGING = ("#2166AC", "#6BAED6", "#FFFFFF", "#F4895F", "#B2182B")  # from −1 over 0 to 1
SIZES: Mapping[Size, tuple[int, int]]  # CSS pixels
SIZES = {"small": (370, 230), "medium": (560, 230), "large": (560, 380), "wide": (1120, 210)}

_HISTOGRAM = 0.16  # share of the height of the axes
_INNER = 0.6  # decades that the linear part of a stretched axis takes on each side of 0
_APART = 0.15  # share of a stretched axis, least distance of its numbers
_MOST_POINTS = 2000  # of a curve; longer curves that share their x are thinned
_UPRIGHT = {"yref": "y domain", "y0": 0, "y1": 1, "layer": "below"}


# Replacements on a dark page. The other colours are visible on both.
IN_DARK = {
    DARK: "#E4E8EC",
    BLUE: "#6E95FF",
    GREY: "#A4ABB3",
    VERMILION: "#F0803C",
    GREEN: "#2FC79B",
    SILVER: "#7C858E",
    "#5A5A5A": "#B9BFC6",
    "#332288": "#A495F5",
    "#999933": "#C4C45A",
    "#CC1F1A": "#FF6B62",
}
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
TEMPLATE = {  # what all figures share
    "layout": {
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
}
_COLUMNS, _ROW, _GAP = 2, 230, 84  # of a notebook's figure; heights in CSS pixels


@dataclass(frozen=True)
class Panel:
    """One pair of axes."""

    title: str
    alt: str  # what the panel shows, in words, for readers who cannot see it
    traces: list[Trace]
    layout: dict[str, Any]
    keys: list[Key]
    note: str  # small text at the right end of the title's line
    size: Size
    extent: tuple[int, int]  # width and height in CSS pixels
    zoom: str  # panels of a page with the same word are zoomed together along x; empty: this one alone


@dataclass(frozen=True)
class Sheet:
    """Panels that belong together."""

    section: str  # heading of the page under which the sheet is
    name: str
    title: str
    panels: Sequence[Panel]
    caption: str = ""  # what to see, in a sentence or two
    folded: bool = False  # shown on demand only
    first: int = 0  # index of the figure of its first panel in the page

    @property
    def keys(self) -> list[Key]:
        """Return what is drawn, each once: points, then lines, then areas."""
        keys = dict.fromkeys(key for panel in self.panels for key in panel.keys)
        return sorted(keys, key=lambda key: (key[0] == "patch", key[0] != "dot"))


# --- traces -----------------------------------------------------------------------------------------------------------


def curve(
    x: ArrayLike, y: ArrayLike, name: str = "", colour: str = BLUE, width: float = 1.2, dash: str = "", alpha: float = 1
) -> Trace:
    """Return a line, which NaN breaks. dash: empty, "dash" or "dot"."""
    line = {"color": colour, "width": width, "dash": dash or "solid"}
    shape = {"": "line", "dash": "dashed", "dot": "dotted"}[dash]
    return _scatter(x, y, name, (shape, colour, alpha), mode="lines", line=line, opacity=alpha)


def lane(stretches: Sequence[Interval], row: float, name: str, colour: str, width: float = 9.0) -> Trace:
    """Return a thick line in a row, broken between stretches of x."""
    x = np.array([place for begin, end in stretches for place in (begin, end, np.nan)])
    return curve(x, np.where(np.isfinite(x), float(row), np.nan), name, colour, width)


def dots(x: ArrayLike, y: ArrayLike, name: str = "", colour: str = BLUE) -> Trace:
    """Return single points."""
    marker = {"color": colour, "size": 6, "line": {"color": colour, "width": 1}}
    return _scatter(x, y, name, ("dot", colour, 1.0), mode="markers", marker=marker, cliponaxis=False)


def band(
    x: Numbers, low: Numbers, high: Numbers, name: str = "", colour: str = BLUE, alpha: float = 0.2
) -> list[Trace]:
    """Return the area of each stretch without gaps, and its limits for the pointer."""
    x, low, high = (np.asarray(values, dtype=float) for values in (x, low, high))
    known = np.isfinite(x + low + high)
    around: list[Numbers] = []
    for part in np.split(np.arange(len(x)), np.flatnonzero(np.diff(known)) + 1):
        if len(part) and known[part[0]]:
            back = part[::-1]
            gap = np.full((1, 2), np.nan)
            around += [np.column_stack([x[part], low[part]]), np.column_stack([x[back], high[back]]), gap]
    if not around:
        return []
    outline = np.concatenate(around[:-1])
    area = _scatter(outline[:, 0], outline[:, 1], name, ("patch", colour, alpha), **_filled(colour, alpha))
    return [area, _limits(x, low, high, name, colour)]


def bars(
    x: Numbers, low: Numbers, high: Numbers, name: str = "", colour: str = BLUE, width: float = 1.2
) -> list[Trace]:
    """Return error bars: at each x one from low to high."""
    at = np.repeat(np.asarray(x, dtype=float), 3)
    ends = np.column_stack([low, high, np.full(len(x), np.nan)]).ravel()
    line = curve(at, ends, name, colour, width) | {"hoverinfo": "skip"}
    return [line, _limits(np.asarray(x), low, high, name, colour)]


def histogram(values: Numbers, low: float, high: float, name: str) -> list[Trace]:
    """Return where values are, from low to high along the bottom of the panel; nothing without values."""
    if not values.size:
        return []
    counts, edges = np.histogram(values, 60, (low, high))
    x = np.concatenate([edges[:1], np.repeat(edges, 2)[1:-1], edges[-1:]])
    y = np.concatenate([[0.0], np.repeat(counts / max(int(counts.max()), 1), 2), [0.0]])
    return [_scatter(x, y, name, ("patch", SILVER, 0.6), **_filled(SILVER, 0.6), yaxis="y2")]


def heat(values: Numbers, x: Numbers, y: Numbers, colours: Sequence[str], limits: Interval, unit: str) -> Trace:
    """Return a matrix [rows, columns] as colours; x, y: the middle of each column and row."""
    return {
        "type": "heatmap",
        "z": np.asarray(values),
        "x": np.asarray(x, dtype=float),
        "y": np.asarray(y, dtype=float),
        "zmin": limits[0],
        "zmax": limits[1],
        "colorscale": [[k / (len(colours) - 1), colour] for k, colour in enumerate(colours)],
        "showscale": False,
        "hovertemplate": f"%{{z:.3~g}} {html.escape(unit)}<br>%{{y}}<br>%{{x}}<extra></extra>",
    }


def stripes(intervals: Sequence[Interval], name: str, colour: str, alpha: float) -> Trace:
    """Return intervals of x that are shaded over the whole height."""
    fill = {
        "type": "rect",
        "fillcolor": _faint(colour, alpha),
        "line": {"width": 0},
        "name": html.escape(name),
        **_UPRIGHT,
    }
    shapes = [{**fill, "x0": begin, "x1": end} for begin, end in intervals]
    return {"shapes": shapes, "name": name, "key": ("patch", colour, alpha) if name and shapes else None}


def mark(x: float) -> Trace:
    """Return a dashed line at x."""
    line = {"color": GREY, "width": 1, "dash": "dash"}
    return {"shapes": [{"type": "line", "x0": x, "x1": x, "line": line, **_UPRIGHT}], "key": None}


def _scatter(x: ArrayLike, y: ArrayLike, name: str, key: tuple[str, str, float], **settings: Any) -> Trace:
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    return {"type": "scatter", "x": x, "y": y, "name": name, "key": key if name else None, **settings}


def _limits(x: Numbers, low: Numbers, high: Numbers, name: str, colour: str) -> Trace:
    """Return both ends of areas or bars for the pointer, without a line of their own."""
    return curve(x, high, name, colour, 0.0) | {"key": None, "customdata": np.asarray(low, dtype=float)[:, None]}


def _filled(colour: str, alpha: float) -> dict[str, Any]:
    fill = {"fill": "toself", "fillcolor": _faint(colour, alpha), "hoverinfo": "skip"}
    return {"mode": "lines", "line": {"width": 0}, **fill}


def _faint(colour: str, alpha: float) -> str:
    return f"rgba({','.join(map(str, bytes.fromhex(colour[1:])))},{alpha})"


# --- panels -----------------------------------------------------------------------------------------------------------


def panel(
    title: str,
    alt: str,
    x_label: str,
    y_label: str,
    *parts: Trace | list[Trace],
    note: str = "",
    size: Size = "small",
    height: int = 0,  # CSS pixels; 0: that of its size
    zoom: str = "",
    x_limits: Interval | None = None,  # None: those of the data
    y_limits: Interval | None = None,
    x_ticks: Ticks = (),
    y_ticks: Ticks = (),
    log_x: bool = False,
    log_y: bool = False,
    near_x: float = 0.0,  # x is linear up to this value on both sides of 0 and logarithmic beyond; 0: linear
    near_y: float = 0.0,
    rows: Sequence[str] = (),  # names of y = 0, 1, ... from the top; empty: y is a number
) -> Panel:
    """Put traces on a pair of axes. Units are in brackets at the end of the labels."""
    flat = [trace for part in parts for trace in (part if isinstance(part, list) else [part])]
    shapes = [shape for trace in flat for shape in trace.get("shapes", ())]
    drawn = [trace for trace in flat if "shapes" not in trace and _is_drawn(trace)]
    keys = [(*trace["key"], trace["name"]) for trace in flat if trace.get("key") and _is_drawn(trace)]
    if rows:
        y_ticks, y_limits = enumerate(rows), (len(rows) - 0.4, -0.6)
    unit = unit_of(x_label if rows else y_label)
    across = _axis(x_label, x_limits, x_ticks, log_x, near_x, drawn, "x")
    place = f"%{{x:.5~g}} {unit_of(x_label)}".rstrip()
    across["unifiedhovertitle"] = {"text": across["title"]["text"] if near_x else place}
    upright = _axis(y_label, y_limits, y_ticks, log_y, near_y, drawn, "y")
    if "tickvals" in upright and not near_y:
        upright |= {"automargin": True, "showgrid": False}
    layout: dict[str, Any] = {"xaxis": across, "yaxis": upright, "shapes": shapes}
    if rows or any(trace["type"] == "heatmap" for trace in drawn):
        layout["hovermode"] = "closest"
    if any("yaxis" in trace for trace in drawn):
        layout["yaxis2"] = {"overlaying": "y", "range": [0, 1 / _HISTOGRAM], "visible": False, "fixedrange": True}
    value = "%{x:.4~g}" if rows and all(trace["mode"] != "lines" for trace in drawn) else "%{y:.4~g}"
    traces = [_placed(trace, value, unit, near_x, near_y) for trace in _thinned(drawn)]
    extent = SIZES[size][0], height - 20 if height else SIZES[size][1]
    return Panel(title, alt, traces, layout, keys, note, size, extent, zoom)


def _is_drawn(trace: Trace) -> bool:
    return "shapes" in trace or bool(np.isfinite(trace["z" if trace["type"] == "heatmap" else "y"]).any())


def _placed(trace: Trace, value: str, unit: str, near_x: float, near_y: float) -> Trace:
    """Return a trace as Plotly takes it, on stretched axes, with value, unit and name under the pointer."""
    if trace["type"] == "heatmap":
        return trace
    placed = {name: each for name, each in trace.items() if name != "key"} | {"showlegend": bool(trace["key"])}
    for axis, near in (("x", near_x), ("y", near_y)):
        placed[axis] = stretched(trace[axis], near) if near else trace[axis]
    if "hoverinfo" not in trace:
        data = trace.get("customdata", np.empty((len(trace["x"]), 0)))
        text = f"%{{customdata[0]:.4~g}} to {value}" if data.size else value
        text = f"{text} {unit} {html.escape(trace['name'].split(',')[0])}".replace("  ", " ").rstrip()
        if near_x:  # also x as it is
            text = f"%{{customdata[{data.shape[1]}]:.4~g}}: {text}"
            placed["customdata"] = np.column_stack([data, trace["x"]])
        placed["hovertemplate"] = f"{text}<extra></extra>"
    return placed | {"name": html.escape(trace["name"])}


def _thinned(traces: Sequence[Trace]) -> Iterator[Trace]:
    """Thin long curves to the points that show: minimum and maximum of each stretch, at the same x in all curves."""
    curves = [
        trace for trace in traces if trace.get("mode") == "lines" and not {"hoverinfo", "customdata"} & trace.keys()
    ]
    x = curves[0]["x"] if curves else np.empty(0)
    if len(x) <= _MOST_POINTS or not all(np.array_equal(one["x"], x, equal_nan=True) for one in curves):
        yield from traces
        return
    values = np.stack([one["y"] for one in curves])
    gaps = ~np.isfinite(values).all(axis=0)
    kept = [np.flatnonzero(gaps), np.array([0, len(gaps) - 1])]
    for part in np.array_split(np.flatnonzero(~gaps), _MOST_POINTS // (2 * len(curves))):
        if len(part):
            kept += [part[values[:, part].argmin(axis=1)], part[values[:, part].argmax(axis=1)]]
    rows = np.unique(np.concatenate(kept))
    for trace in traces:
        thin = any(trace is one for one in curves)
        yield trace | {"x": trace["x"][rows], "y": trace["y"][rows]} if thin else trace


# --- axes -------------------------------------------------------------------------------------------------------------


def unit_of(label: str) -> str:
    """Return what is in brackets at the end of an axis label."""
    _, bracket, rest = label.partition(" (")
    return html.escape(rest[:-1]) if bracket and rest.endswith(")") else ""


def _axis(
    label: str, limits: Interval | None, ticks: Ticks, log: bool, near: float, drawn: Sequence[Trace], name: str
) -> dict[str, Any]:
    axis: dict[str, Any] = {"title": {"text": html.escape(label)}}
    if log:
        axis |= {"type": "log", "dtick": 1, "tickformat": "~g"}
    if limits is not None:
        axis["range"] = [math.log10(end) if log else float(stretched(end, near)) for end in limits]
    if near and not ticks:
        ticks = [(value, f"{value:g}".replace("-", "−")) for value in _spaced([trace[name] for trace in drawn], near)]
    if ticks := list(ticks):
        axis["tickvals"] = [float(stretched(place, near)) for place, _ in ticks]
        axis["ticktext"] = [html.escape(text) for _, text in ticks]
    return axis


def stretched(values: ArrayLike, near: float) -> Numbers:
    """Map numbers to an axis that is linear up to `near` on both sides of 0 and logarithmic beyond."""
    given = np.asarray(values, dtype=float)
    if not near:
        return given
    size = np.abs(given) / near
    return np.asarray(np.sign(given) * np.where(size <= 1, _INNER * size, _INNER + np.log10(np.maximum(size, 1.0))))


def _spaced(drawn: Sequence[Numbers], near: float) -> list[float]:
    """Choose 0 and round numbers on both sides of it within the range drawn, the more important ones first."""
    values = np.concatenate([*drawn, np.zeros(1)])
    low, high = (float(end(values[np.isfinite(values)])) for end in (np.min, np.max))
    powers = range(math.floor(math.log10(near)) - 1, math.ceil(math.log10(max(high, -low, near))) + 1)
    signed = [side * factor * 10.0**power for factor in (1, 5, 2) for power in powers[::-1] for side in (1, -1)]
    begin, end = stretched([low, high], near)
    taken: dict[float, float] = {}  # number -> its place
    for number in [0.0, *signed]:
        place = float(stretched(number, near))
        if begin <= place <= end and all(abs(place - other) > _APART * (end - begin) for other in taken.values()):
            taken[number] = place
    return sorted(taken)


# --- in a page --------------------------------------------------------------------------------------------------------


def figures_json(panels: Iterable[Panel]) -> Markup:
    """Return the figures of a page as JSON that is safe inside a `script` element."""
    figures = [
        {"data": panel.traces, "layout": panel.layout, "height": panel.extent[1], "zoom": panel.zoom}
        for panel in panels
    ]
    page = {"template": TEMPLATE, "figures": figures}
    text = json.dumps(page, allow_nan=False, separators=(",", ":"), default=_packed)
    return Markup(text.replace("<", "\\u003c"))


def _packed(values: NDArray[Any]) -> dict[str, str]:
    """Return an array as Plotly takes it in JSON. Single precision has seven digits, more than a screen shows."""
    packed = {"dtype": "f4", "bdata": base64.b64encode(values.astype("<f4").tobytes()).decode("ascii")}
    return packed | ({"shape": ", ".join(map(str, values.shape))} if values.ndim > 1 else {})


@cache
def packed_plotly() -> Markup:
    """Return plotly.js, compressed with gzip and encoded in base64: two fifths of its size."""
    from plotly.offline import get_plotlyjs  # plotly takes 0.1 s to import

    return Markup(base64.b64encode(gzip.compress(get_plotlyjs().encode(), 4, mtime=0)).decode("ascii"))


def dark_colours() -> Markup:
    """Return CSS rules that replace the colours of the light page by those of the dark page."""
    rules = []
    for light, dark in IN_DARK.items():
        rgb = ", ".join(map(str, bytes.fromhex(light[1:])))
        rules += [f'.plot [style*="{use}: rgb({rgb})"] {{ {use}: {dark} !important; }}' for use in ("stroke", "fill")]
        rules.append(f'.keys [style*="{light}"] {{ color: {dark} !important; }}')
        rules += [f'.finger [{use}="{light}"] {{ {use}: {dark}; }}' for use in ("stroke", "fill")]
    return Markup("\n".join(rules))


# --- in a notebook ----------------------------------------------------------------------------------------------------


def sheets_figure(title: str, sheets: Sequence[Sheet]) -> Any:
    """Draw the panels of sheets, two in a row."""
    headings = [(sheet.title if k == 0 else "", panel) for sheet in sheets for k, panel in enumerate(sheet.panels)]
    panels = [panel for _, panel in headings]
    titles = ["<br>".join(map(html.escape, filter(None, (above, panel.title)))) for above, panel in headings]
    return _figure(title, panels, titles, _COLUMNS)


def series_figure(
    title: str,
    x_label: str,
    x: Numbers,  # [N]
    rows: Mapping[str, Mapping[str, Numbers]],  # label with its unit in brackets -> name -> y [N]
    shaded: Mapping[tuple[str, str], Sequence[Interval]],  # (name, colour) -> intervals of x
) -> Any:
    """Draw rows of curves below each other; they are zoomed together along x."""
    below = [stripes(intervals, name, colour, 0.18) for (name, colour), intervals in shaded.items()]
    panels = []
    for label, curves in rows.items():
        lines = [curve(x, y, name, COLOURS[k % len(COLOURS)]) for k, (name, y) in enumerate(curves.items())]
        panels.append(panel("", "", x_label, label, lines, *below))
    return _figure(title, panels)


def _figure(title: str, panels: Sequence[Panel], titles: Sequence[str] = (), columns: int = 1) -> Any:
    """Draw panels as one Plotly figure; those in one column are zoomed together along x."""
    from plotly import graph_objects as go

    columns = max(1, min(columns, len(panels)))
    rows = -(-len(panels) // columns)
    gap = _GAP if titles else 30
    height = (_ROW + gap) * rows - gap
    layout: dict[str, Any] = {"annotations": [], "shapes": []}
    traces, named = [], set[str]()
    for k, shown in enumerate(panels):
        left, top = (k % columns) * 1.07 / columns, 1 - (_ROW + gap) * (k // columns) / height
        number, other = k + 1 if k else "", k + 1 + len(panels)
        x, y, counts = f"x{number}", f"y{number}", f"y{other}"
        domain = [left, left + (0.93 if columns > 1 else 1.0) / columns]
        together: dict[str, Any] = {"matches": "x"} if columns == 1 and k else {}
        if columns == 1 and k < len(panels) - 1:
            together["title"] = {}
        layout[f"xaxis{number}"] = shown.layout["xaxis"] | {"domain": domain, "anchor": y} | together
        layout[f"yaxis{number}"] = shown.layout["yaxis"] | {"domain": [max(top - _ROW / height, 0), top], "anchor": x}
        if "yaxis2" in shown.layout:
            layout[f"yaxis{other}"] = shown.layout["yaxis2"] | {"overlaying": y, "anchor": x}
        for trace in shown.traces:
            axes = {"xaxis": x, "yaxis": counts if "yaxis" in trace else y}
            traces.append(trace | axes | _in_legend(trace, trace.get("showlegend", False), named))
        for shape in shown.layout["shapes"]:
            axes = {"xref": x, "yref": f"{y} domain"}
            layout["shapes"].append(shape | axes | _in_legend(shape, bool(shape.get("name")), named))
        if titles:
            at = {"xref": "paper", "yref": "paper", "x": left, "y": top, "xanchor": "left", "yanchor": "bottom"}
            text = {"text": f"<b>{titles[k]}</b>", "showarrow": False, "align": "left", "font": {"size": 12}}
            layout["annotations"].append(at | text)
    letters = sum(8 + len(name) for name in named)  # of the legend
    margin = {"t": 60 + 22 * (1 + letters // 150) + (30 if any(titles) else 0), "b": 50, "l": 58, "r": 12}
    whole = height + margin["t"] + margin["b"]
    heading = {"text": html.escape(title), "x": 0, "xref": "container", "font": {"size": 14}}
    heading |= {"y": 1, "yref": "container", "yanchor": "top", "pad": {"l": 12, "t": 14}}
    legend = {"orientation": "h", "y": 1 - 44 / whole, "yref": "container", "yanchor": "top"}
    figure = go.Figure(traces, layout | {"title": heading, "legend": legend, "showlegend": True}, _validate=False)
    figure.update_layout(template=TEMPLATE, paper_bgcolor="#fff", plot_bgcolor="#fff", hovermode="closest")
    return figure.update_layout(height=whole, margin=margin)


def _in_legend(drawn: Mapping[str, Any], shown: bool, named: set[str]) -> dict[str, Any]:
    """Show a name in the legend once."""
    name = drawn.get("name", "")
    first = shown and name not in named
    if first:
        named.add(name)
    return {"showlegend": first, "legendgroup": name}
