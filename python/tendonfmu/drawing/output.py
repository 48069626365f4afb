"""Panels in a page and in a notebook.

A page contains the figures of its panels as JSON, and plotly.js once, compressed; `templates/report.js` draws them.
Colours are those of a light page. `dark_colours` returns CSS that changes them for readers who prefer a dark page.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any

from markupsafe import Markup
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.drawing import figures as fig
from tendonfmu.drawing.figures import panel

# Replacements on a dark page. The other colours are visible on both.
IN_DARK = {
    fig.DARK: "#E4E8EC",
    fig.BLUE: "#6E95FF",
    fig.GREY: "#A4ABB3",
    fig.VERMILION: "#F0803C",
    fig.GREEN: "#2FC79B",
    fig.SILVER: "#7C858E",
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


# --- in a page --------------------------------------------------------------------------------------------------------


def figures_json(panels: Iterable[fig.Panel]) -> Markup:
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


def sheets_figure(title: str, sheets: Sequence[fig.Sheet]) -> Any:
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
    shaded: Mapping[tuple[str, str], Sequence[fig.Interval]],  # (name, colour) -> intervals of x
) -> Any:
    """Draw rows of curves below each other; they are zoomed together along x."""
    below = [fig.stripes(intervals, name, colour, 0.18) for (name, colour), intervals in shaded.items()]
    panels = []
    for label, curves in rows.items():
        lines = [fig.curve(x, y, name, fig.COLOURS[k % len(fig.COLOURS)]) for k, (name, y) in enumerate(curves.items())]
        panels.append(panel("", "", x_label, label, lines, *below))
    return _figure(title, panels)


def _figure(title: str, panels: Sequence[fig.Panel], titles: Sequence[str] = (), columns: int = 1) -> Any:
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
