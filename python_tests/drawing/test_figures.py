"""Panels as Plotly figures: what is drawn is where it belongs, in numbers with units; names are text."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest
from PIL import Image

from real_browser import Elements, figures_of, needs_nothing_else
from repository_paths import ROOT
from tendonfmu.drawing import (
    DIVERGING,
    GREEN,
    ORANGE,
    Panel,
    Sheet,
    Trace,
    band,
    bars,
    curve,
    dots,
    draw_finger,
    figures_json,
    heat,
    histogram,
    lane,
    mark,
    panel,
    series_figure,
    sheets_figure,
    stripes,
)
from tendonfmu.model import finger_drawing
from tendonfmu.report import write_figures

X = np.linspace(0.0, 10.0, 5)


def over_time(*parts: Trace | list[Trace], **axes: Any) -> Panel:
    return panel("title", "what it shows", "time (s)", "torque (mN·m)", *parts, **{"x_limits": (0.0, 10.0)} | axes)


def everything(name: str = "before it sees the sample", **labels: str) -> Panel:
    parts = (
        histogram(X, 0.0, 10.0, "where it was"),
        band(X, X - 1, X + 1, name),
        bars(X, X - 1, X + 1, "95 % interval"),
        curve(X, X, name),
        dots(X, X),
        dots(X, X, "floor", GREEN),
        stripes([(2.0, 3.0)], "held out", ORANGE, 0.16),
        mark(4.0),
    )
    words = {"title": "all", "alt": name, "x_label": "time (s)", "y_label": "torque (mN·m)"} | labels
    return panel(*words.values(), *parts, x_ticks=[(1.0, name)])


MATRIX = panel(
    *("m", "what", "the same order", ""),
    heat(100 * np.eye(4), np.arange(4), np.arange(4), DIVERGING, (-100, 100), "%"),
    x_limits=(-0.5, 3.5),
    y_limits=(3.5, -0.5),
    y_ticks=((1.0, "one"), (3.0, "two")),
)
LOGARITHMIC = over_time(curve(X[1:], X[1:]), x_limits=(0.1, 10.0), log_x=True, log_y=True)
NEAR = over_time(curve(X, X), bars(X, X - 1, X + 1), x_limits=None, near_x=0.1, near_y=0.2)
ROWS = over_time(dots([1.0, 3.0], [0.0, 1.0]), lane([(1.0, 2.0), (5.0, 6.0)], 1, "contact", ORANGE), rows=("a", "b"))
KINDS = (everything(), MATRIX, LOGARITHMIC, NEAR, ROWS)


@pytest.mark.parametrize("shown", KINDS)
def test_plotly_knows_all_names_and_values(shown: Panel) -> None:
    page = json.loads(figures_json([shown]))
    (drawn,) = page["figures"]
    known = go.Figure(data=drawn["data"], layout={**drawn["layout"], "template": page["template"]})
    assert len(known.data) == len(shown.traces) > 0


def test_plotly_knows_the_figures_of_a_notebook() -> None:
    sheets = [Sheet("", "one", "one", KINDS[:2]), Sheet("", "two", "two", KINDS[2:])]
    rows = {"a (N)": {"first": X, "second": X}, "b (m)": {"first": X}}
    stretches = {("contact", ORANGE): [(1.0, 2.0)]}
    for figure, count in (
        (sheets_figure("<b>", sheets), sum(len(each.traces) for each in KINDS)),
        (series_figure("<b>", "time (s)", X, rows, stretches), 3),
    ):
        known = go.Figure(figure.to_dict())
        assert len(known.data) == count and known.layout.title.text == "&lt;b&gt;"
        areas = [(axis.domain, known.layout[axis.anchor.replace("x", "xaxis")].domain) for axis in upright(known)]
        assert len(set(areas)) == len(areas) and all(0.0 <= low < high <= 1.0 for area in areas for low, high in area)
    assert known.layout.xaxis2.matches == "x" and len(known.layout.shapes) == 2


def upright(figure: Any) -> list[Any]:
    """The y axes that are shown."""
    return [axis for axis in figure.select_yaxes() if axis.overlaying is None]


def test_a_curve_has_its_numbers_and_its_gaps() -> None:
    y = np.array([1.0, 2.0, np.nan, 2.0, 1.23456789])
    (drawn,) = over_time(curve(X, y)).traces
    assert drawn["mode"] == "lines" and drawn["x"].tolist() == X.tolist()
    np.testing.assert_array_equal(drawn["y"], y)
    assert over_time(curve(X, np.full(5, np.nan), "unknown")).traces == []


def test_a_band_goes_round_each_of_its_stretches() -> None:
    low = np.array([0.0, 1.0, np.nan, 3.0, 4.0])
    area, limits = over_time(band(X, low, low + 1)).traces
    assert area["fill"] == "toself"
    np.testing.assert_array_equal(area["y"], [0, 1, 2, 1, np.nan, 3, 4, 5, 4])
    np.testing.assert_array_equal(area["x"], [0, 2.5, 2.5, 0, np.nan, 7.5, 10, 10, 7.5])
    np.testing.assert_array_equal(limits["customdata"][:, 0], low)


def test_keys_are_what_is_drawn() -> None:
    """Points first, areas last, each once; none of what has no name, or no number."""
    unknown = over_time(curve(X, np.full(5, np.nan), "unknown"), stripes([], "never", ORANGE, 0.2))
    sheet = Sheet("", "", "", [everything("all"), unknown, everything("all")])
    shapes = {meaning: shape for shape, _, _, meaning in sheet.keys}
    assert [(shape, meaning) for shape, _, _, meaning in sheet.keys] == [
        ("dot", "floor"),
        ("line", "95 % interval"),
        ("line", "all"),
        ("patch", "where it was"),
        ("patch", "all"),
        ("patch", "held out"),
    ], shapes


def test_a_stretched_axis_shows_its_numbers_under_the_pointer() -> None:
    line = next(trace for trace in NEAR.traces if trace["x"].shape == X.shape)
    np.testing.assert_array_equal(line["customdata"][:, -1], X)
    np.testing.assert_allclose(line["x"][1:], 0.6 + np.log10(X[1:] / 0.1))
    ticks = dict(zip(NEAR.layout["xaxis"]["ticktext"], NEAR.layout["xaxis"]["tickvals"], strict=True))
    assert ticks["0"] == 0.0 and ticks["0.1"] == 0.6 and ticks["1"] == pytest.approx(1.6)


def test_many_points_are_thinned_and_none_that_stands_out_is_lost() -> None:
    x = np.arange(20_000.0)
    first, second = np.sin(x / 500), np.cos(x / 700)
    first[1234], second[4321], second[7000] = 5.0, -5.0, np.nan
    area = band(x[:2500], x[:2500], x[:2500] + 1, "band")
    *_, one, other = over_time(area, curve(x, first), curve(x, second)).traces
    assert 1000 < len(one["x"]) < 2100 and np.array_equal(one["x"], other["x"])
    assert (one["x"][0], one["x"][-1]) == (0.0, 19_999.0)
    assert one["y"].max() == 5.0 and np.nanmin(other["y"]) == -5.0 and np.isnan(other["y"][one["x"] == 7000.0]).all()
    np.testing.assert_array_equal(one["y"], first[one["x"].astype(int)])


def test_names_are_text() -> None:
    hostile = "<script>alert('x')</script><b>$\\frac{指"
    named = everything(hostile, x_label=f"{hostile} ({hostile})", y_label=f"{hostile} ({hostile})")
    rows = over_time(dots([1.0], [0.0]), rows=(hostile, "b"))
    text = figures_json([named, rows])
    assert "<" not in text
    figures = json.dumps(json.loads(text)["figures"])
    assert "<script>" not in figures and "&lt;script&gt;" in figures


def test_a_page_of_figures_needs_nothing_else_and_takes_any_name(tmp_path: Path) -> None:
    hostile = "<script>alert('x')</script>指"
    sheets = [Sheet("", name, hostile, [over_time(curve(X, X, hostile)), everything()]) for name in ("one", "other")]
    write_figures(tmp_path / "new" / "page.html", "kind", hostile, sheets)
    page = (tmp_path / "new" / "page.html").read_text("utf-8")
    needs_nothing_else(page)
    assert len(figures_of(page)) == 4
    assert "<script>alert" not in page and page.count('<div class="plot"') == 4
    assert [section["id"] for section in Elements(page).all("section")] == ["one", "other"]


def test_the_icon_of_a_finger_marks_edges() -> None:
    """Red is an edge; without friction there is none."""
    finger = json.loads((ROOT / "examples" / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
    bare = {"joints": [{"name": "j"}], "tendons": [{"name": "a", "stiffness": 1e5, "moment_arms": [0.004]}]}
    for description, edges in ((finger, True), (bare, False)):
        icon = draw_finger(finger_drawing(description))
        image = np.asarray(Image.open(io.BytesIO(icon)).convert("RGB"))
        assert (image == (0xCC, 0x1F, 0x1A)).all(axis=-1).any() == edges and (image < 100).any()
        assert image.shape == (480, 480, 3) and icon == draw_finger(finger_drawing(description))
