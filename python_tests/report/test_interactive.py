"""Panels as Plotly draws them: what is drawn is where it belongs, in numbers with units; names are text, not markup."""

from __future__ import annotations

import base64
import gzip
import json
from dataclasses import replace
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

pytest.importorskip("tendonfmu._native", reason="SKIPPED: tendonfmu is not installed")

from tendonfmu.drawing.interactive import (
    dark_colours,
    figure_of,
    figures_json,
    packed_plotly,
    pooled,
    stretched,
    thinned,
    unit_of,
)
from tendonfmu.drawing.panel_data import Band, Bars, Curve, Dots, MatrixPanel, Panel

X = np.linspace(0.0, 10.0, 5)
PANEL = Panel(title="title", alt="what it shows", x_label="time (s)", y_label="torque (mN·m)", x_limits=(0.0, 10.0))
NAMES = {"before": "the model, before it sees the sample", "after": "95 % interval"}
EVERYTHING = replace(
    PANEL,
    curves=(Curve("before", X, X),),
    bands=(Band("before_scatter", X, X - 1, X + 1),),
    dots=(Dots("after_dots", X, X), Dots("floor", X, X)),
    bars=(Bars("after", X, X - 1, X + 1),),
    stripes=((2.0, 3.0),),
    data=(np.linspace(0.0, 10.0, 4), np.array([0.2, 1.0, 0.5])),
    line=4.0,
)
MATRIX = MatrixPanel("m", "what", np.eye(4), (("one", 0, 3), ("two", 3, 4)), np.empty((0, 2), np.intp), tuple("abcd"))


def traces(panel: Panel) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = figure_of(panel, NAMES)["data"]
    return found


@pytest.mark.parametrize(
    "panel",
    [
        EVERYTHING,
        MATRIX,
        replace(PANEL, x_limits=(0.1, 10.0), log_x=True, log_y=True, curves=(Curve("before", X, X),)),
        replace(PANEL, x_limits=None, near_x=0.1, curves=(Curve("before", X, X),)),
        replace(PANEL, rows=("a", "b"), bars=(Bars("data", np.arange(2.0), np.zeros(2), np.ones(2), lying=True),)),
        replace(PANEL, ticks=((1.0, "one"),)),
    ],
)
def test_plotly_knows_all_that_it_is_told(panel: Panel | MatrixPanel) -> None:
    """Its own library refuses a wrong name or value; the page's template is checked too."""
    figure = figure_of(panel, NAMES)
    template = json.loads(figures_json([panel], [NAMES]))["template"]
    known = go.Figure(data=figure["data"], layout={**figure["layout"], "template": template})
    assert len(known.data) == len(figure["data"])


def test_a_curve_has_its_numbers_and_its_gaps() -> None:
    y = np.array([1.0, 2.0, np.nan, 2.0, 1.23456789])
    (curve,) = traces(replace(PANEL, curves=(Curve("before", X, y),)))
    assert (curve["mode"], curve["x"], curve["y"]) == ("lines", X.tolist(), [1.0, 2.0, None, 2.0, 1.23457])
    assert traces(replace(PANEL, curves=(Curve("before", X, np.full(5, np.nan)),))) == []


def test_values_have_units_and_names() -> None:
    (curve,) = traces(replace(PANEL, curves=(Curve("before", X, X),)))
    assert curve["hovertemplate"] == "%{y:.4~g} mN·m the model<extra></extra>"
    assert figure_of(PANEL, NAMES)["layout"]["xaxis"]["unifiedhovertitle"]["text"] == "%{x:.5~g} s"
    bars = traces(replace(PANEL, bars=(Bars("after", X, X - 1, X + 1),)))
    assert bars[-1]["hovertemplate"] == "%{customdata:.4~g} to %{y:.4~g} mN·m 95 % interval<extra></extra>"
    assert bars[-1]["customdata"] == (X - 1).tolist() and bars[-1]["y"] == (X + 1).tolist()
    assert [unit_of(label) for label in ("power ((mN·m)²/Hz)", "recording", "angle of a (b) (rad)")][:2] == [
        "(mN·m)²/Hz",
        "",
    ]


def test_a_band_goes_round_each_of_its_stretches() -> None:
    low = np.array([0.0, 1.0, np.nan, 3.0, 4.0])
    area, limits = traces(replace(PANEL, bands=(Band("before_scatter", X, low, low + 1),)))
    assert area["fill"] == "toself" and area["y"] == [0, 1, 2, 1, None, 3, 4, 5, 4]
    assert area["x"] == [0, 2.5, 2.5, 0, None, 7.5, 10, 10, 7.5]
    assert limits["customdata"] == [0, 1, None, 3, 4]


def test_bars_lie_where_they_should() -> None:
    bars = Bars("data", np.arange(2.0), np.array([1.0, 2.0]), np.array([3.0, 4.0]), lying=True)
    (drawn,) = traces(replace(PANEL, rows=("a", "b"), bars=(bars,)))
    assert drawn["x"] == [1, 3, None, 2, 4, None] and drawn["y"] == [0, 0, 0, 1, 1, 1]


def test_many_points_are_thinned_and_none_that_stands_out_is_lost() -> None:
    x = np.arange(20_000.0)
    first, second = np.sin(x / 500), np.cos(x / 700)
    first[1234], second[4321], second[7000] = 5.0, -5.0, np.nan
    one, other = thinned((Curve("before", x, first), Curve("after", x, second)))
    assert 1000 < len(one.x) < 2100 and np.array_equal(one.x, other.x) and (one.x[0], one.x[-1]) == (0.0, 19_999.0)
    assert one.y.max() == 5.0 and np.nanmin(other.y) == -5.0 and np.isnan(other.y[one.x == 7000.0]).all()
    np.testing.assert_array_equal(one.y, first[one.x.astype(int)])


def test_a_stretched_axis_keeps_the_order_and_names_round_numbers() -> None:
    x = np.array([-10.0, -0.1, -0.05, 0.0, 0.1, 1.0, 10.0])
    assert (np.diff(stretched(x, 0.1)) > 0).all() and np.diff(stretched(x, 0.1)[-3:]) == pytest.approx([1.0, 1.0])
    axis = figure_of(replace(PANEL, near_x=0.1, curves=(Curve("before", x, x),)), NAMES)["layout"]["xaxis"]
    assert axis["ticktext"] == ["−10", "−1", "0", "1", "10"]
    assert axis["tickvals"] == pytest.approx(stretched(np.array([-10.0, -1.0, 0.0, 1.0, 10.0]), 0.1))


def test_a_short_stretched_axis_has_more_than_zero_on_it() -> None:
    x = np.linspace(0.0, 0.47, 9)
    axis = figure_of(replace(PANEL, near_x=0.12, curves=(Curve("before", x, x),)), NAMES)["layout"]["xaxis"]
    assert len(axis["ticktext"]) >= 3 and axis["ticktext"][0] == "0"


def test_limits_of_a_logarithmic_axis_are_powers() -> None:
    axis = figure_of(replace(PANEL, log_x=True, x_limits=(0.01, 100.0)), NAMES)["layout"]["xaxis"]
    assert axis["type"] == "log" and axis["range"] == [-2, 2]


def test_a_matrix_is_drawn_in_per_cent() -> None:
    (heat,) = figure_of(MATRIX, {})["data"]
    numbers = np.frombuffer(base64.b64decode(heat["z"]["bdata"]), np.int8).reshape(4, 4)
    np.testing.assert_array_equal(numbers, 100 * np.eye(4))
    assert heat["x"] == heat["y"] == ["a", "b", "c", "d"]


def test_the_strongest_of_many_stays_visible() -> None:
    matrix = np.full((1001, 1001), 0.1)
    matrix[998, 3] = -0.9
    found, every = pooled(matrix)
    assert every == 3 and found.shape == (334, 334) and found[332, 1] == -90 and found[0, 0] == 10


def test_names_are_text() -> None:
    hostile = "<script>alert('x')</script><b>"
    named = replace(
        EVERYTHING, x_label=f"{hostile} ({hostile})", y_label=f"{hostile} ({hostile})", ticks=((1.0, hostile),)
    )
    text = figures_json([named, replace(MATRIX, names=(hostile, *"bcd"))], [{"before": hostile}, {}])
    assert "<" not in text
    assert "<script>" not in json.dumps(json.loads(text)["figures"]) and "&lt;script&gt;" in text.replace(
        "\\u0026", "&"
    )


def test_plotly_is_whole_and_packed_alike_each_time() -> None:
    unpacked = gzip.decompress(base64.b64decode(packed_plotly())).decode()
    assert unpacked.lstrip().startswith("/**\n* plotly.js v") and len(packed_plotly()) < 0.45 * len(unpacked)


def test_what_is_dark_on_a_light_page_is_light_on_a_dark_one() -> None:
    rules = dark_colours()
    assert '.plot [style*="stroke: rgb(34, 34, 34)"] { stroke: #E4E8EC !important; }' in rules
