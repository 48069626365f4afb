"""Panels as Plotly figures: what is drawn is where it belongs, in numbers with units; names are text."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest
from matplotlib.image import imread

from real_browser import Elements, needs_nothing_else
from repository_paths import ROOT
from tendonfmu.drawing import draw_finger
from tendonfmu.drawing.figures import figure_of, figures_json, thinned
from tendonfmu.drawing.panel import DIVERGING, Band, Bars, Curve, Dots, Heat, Panel, Sheet
from tendonfmu.model import finger_drawing
from tendonfmu.report import write_figures

X = np.linspace(0.0, 10.0, 5)
PANEL = Panel(title="title", alt="what it shows", x_label="time (s)", y_label="torque (mN·m)", x_limits=(0.0, 10.0))
NAMES = {"before": "the model, before it sees the sample", "after": "95 % interval"}
EVERYTHING = replace(
    PANEL,
    curves=(Curve("before", X, X),),
    bands=(Band("before_scatter", X, X - 1, X + 1),),
    dots=(Dots("after_dots", X, X, tuple("abcde")), Dots("floor", X, X)),
    bars=(Bars("after", X, X - 1, X + 1),),
    stripes={"held_out": [(2.0, 3.0)]},
    data=(np.linspace(0.0, 10.0, 4), np.array([0.2, 1.0, 0.5])),
    line=4.0,
)
MATRIX = Panel(
    *("m", "what", "the same order", ""),
    heat=Heat((100 * np.eye(4)).astype(np.int8), tuple("abcd"), tuple("abcd"), DIVERGING, -100, 100, "%"),
    x_limits=(-0.5, 3.5),
    y_limits=(3.5, -0.5),
    y_ticks=((1.0, "one"), (3.0, "two")),
)
LOGARITHMIC = replace(PANEL, x_limits=(0.1, 10.0), log_x=True, log_y=True, curves=(Curve("before", X[1:], X[1:]),))
NEAR = replace(PANEL, x_limits=None, near_x=0.1, near_y=0.2, curves=(Curve("before", X, X),))
LYING = Bars("data", np.arange(2.0), np.array([1.0, 2.0]), np.array([3.0, 4.0]), lying=True)
ROWS = replace(PANEL, rows=("a", "b"), bars=(LYING,))
TICKS = replace(PANEL, ticks=((1.0, "one"),), curves=(Curve("before", X, X),))
KINDS = (EVERYTHING, MATRIX, LOGARITHMIC, NEAR, ROWS, TICKS)


def traces(panel: Panel) -> Any:
    return figure_of(panel, NAMES).data


@pytest.mark.parametrize("panel", KINDS)
def test_plotly_knows_all_names_and_values(panel: Panel) -> None:
    figure = figure_of(panel, NAMES)
    text = figures_json([(panel, figure)])
    (drawn,) = json.loads(text)["figures"]
    known = go.Figure(data=drawn["data"], layout={**drawn["layout"], "template": json.loads(text)["template"]})
    assert len(known.data) == len(figure.data) > 0


def test_a_curve_has_its_numbers_and_its_gaps() -> None:
    y = np.array([1.0, 2.0, np.nan, 2.0, 1.23456789])
    (curve,) = traces(replace(PANEL, curves=(Curve("before", X, y),)))
    assert curve.mode == "lines" and curve.x.tolist() == X.tolist()
    np.testing.assert_allclose(curve.y, y, rtol=1e-6)
    assert len(traces(replace(PANEL, curves=(Curve("before", X, np.full(5, np.nan)),)))) == 0


def test_a_band_goes_round_each_of_its_stretches() -> None:
    low = np.array([0.0, 1.0, np.nan, 3.0, 4.0])
    area, limits = traces(replace(PANEL, bands=(Band("before_scatter", X, low, low + 1),)))
    assert area.fill == "toself"
    np.testing.assert_array_equal(area.y, [0, 1, 2, 1, np.nan, 3, 4, 5, 4])
    np.testing.assert_array_equal(area.x, [0, 2.5, 2.5, 0, np.nan, 7.5, 10, 10, 7.5])
    np.testing.assert_array_equal(limits.customdata[:, 0], low)


def test_many_points_are_thinned_and_none_that_stands_out_is_lost() -> None:
    x = np.arange(20_000.0)
    first, second = np.sin(x / 500), np.cos(x / 700)
    first[1234], second[4321], second[7000] = 5.0, -5.0, np.nan
    one, other = thinned((Curve("before", x, first), Curve("after", x, second)))
    assert 1000 < len(one.x) < 2100 and np.array_equal(one.x, other.x) and (one.x[0], one.x[-1]) == (0.0, 19_999.0)
    assert one.y.max() == 5.0 and np.nanmin(other.y) == -5.0 and np.isnan(other.y[one.x == 7000.0]).all()
    np.testing.assert_array_equal(one.y, first[one.x.astype(int)])


def test_names_are_text() -> None:
    hostile = "<script>alert('x')</script><b>$\\frac{指"
    named = replace(
        EVERYTHING, x_label=f"{hostile} ({hostile})", y_label=f"{hostile} ({hostile})", ticks=((1.0, hostile),)
    )
    assert MATRIX.heat is not None
    matrix = replace(MATRIX, heat=replace(MATRIX.heat, x=(hostile, *"bcd")))
    drawn = [(named, figure_of(named, {"before": hostile})), (matrix, figure_of(matrix, {}))]
    text = figures_json(drawn)
    assert "<" not in text
    figures = json.dumps(json.loads(text)["figures"])
    assert "<script>" not in figures and "&lt;script&gt;" in figures


def test_a_page_of_figures_needs_nothing_else_and_takes_any_name(tmp_path: Path) -> None:
    hostile = "<script>alert('x')</script>指"
    sheets = [Sheet("", name, hostile, (("before", hostile),), (PANEL, EVERYTHING)) for name in ("one", "other")]
    write_figures(tmp_path / "new" / "page.html", "kind", hostile, sheets)
    page = (tmp_path / "new" / "page.html").read_text("utf-8")
    needs_nothing_else(page)
    assert "<script>alert" not in page and page.count('<div class="plot"') == 4
    assert [section["id"] for section in Elements(page).all("section")] == ["one", "other"]


def test_the_picture_of_a_finger_marks_edges_and_takes_any_name() -> None:
    """The picture that an FMU carries, and its icon: red is an edge; letters that the font lacks, no friction."""
    finger = json.loads((ROOT / "examples" / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
    finger["joints"][0]["name"] = "$\\frac{手指"
    bare = {"joints": [{"name": "j"}], "tendons": [{"name": "a", "stiffness": 1e5, "moment_arms": [0.004]}]}
    for description, edges in ((finger, True), (bare, False)):
        streams = io.BytesIO(), io.BytesIO()
        draw_finger(finger_drawing(description), *streams)
        for stream in streams:
            image = (255 * imread(io.BytesIO(stream.getvalue()))[:, :, :3]).round()
            assert (image == (0xCC, 0x1F, 0x1A)).all(axis=-1).any() == edges and (image < 100).any()
