"""Panels as Plotly figures and as PNG: what is drawn is where it belongs, in numbers with units; names are text."""

from __future__ import annotations

import base64
import gzip
import io
import json
from dataclasses import replace
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest
from matplotlib.image import imread

from repetitions import repeated
from tendonfmu.drawing.figures import dark_colours, figure_of, figures_json, packed_plotly, pooled, stretched, thinned
from tendonfmu.drawing.panel import DIVERGING, STYLES, Band, Bars, Curve, Dots, Heat, Panel, Sheet
from tendonfmu.drawing.png import write_sheet

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
    borders=(2.5,),
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


@pytest.mark.parametrize("panel", repeated(KINDS, 0, 3))
def test_a_png_has_ink_at_its_size_and_the_same_bytes_again(panel: Panel) -> None:
    sheet = Sheet("", "name", "heading", (("before", "a key"),), (panel, panel))
    made = []
    for _ in range(2):
        file = io.BytesIO()
        write_sheet(sheet, [figure_of(panel, NAMES)] * 2, file)
        made.append(file.getvalue())
    image = imread(io.BytesIO(made[0]))[:, :, :3]
    assert made[0] == made[1]
    assert image.shape[1] == 2 * panel.extent[0] * 3 // 2 and image.shape[0] > panel.extent[1] * 3 // 2
    assert 0.005 < np.mean(image < 0.98) < 0.6


def test_a_png_shows_what_the_figure_holds() -> None:
    """A curve at the middle of the axes is there in its colour, and nowhere else."""
    file = io.BytesIO()
    flat = replace(PANEL, curves=(Curve("before", X, np.full(5, 0.5)),), y_limits=(0.0, 1.0))
    write_sheet(Sheet("", "name", "heading", (), (flat,)), [figure_of(flat, NAMES)], file)
    image = (255 * imread(io.BytesIO(file.getvalue()))).astype(int)
    colour = np.array([int(STYLES["before"].colour[k : k + 2], 16) for k in (1, 3, 5)])
    rows = np.flatnonzero((np.abs(image[:, image.shape[1] // 2, :3] - colour).sum(axis=1)) < 60)
    # 44 CSS pixels below the axes, 28 above them
    assert len(rows) in (1, 2, 3)
    assert image.shape[0] - rows.mean() == pytest.approx(1.5 * (44 + 0.5 * (250 - 44 - 28)), abs=2.0)


def test_a_curve_has_its_numbers_and_its_gaps() -> None:
    y = np.array([1.0, 2.0, np.nan, 2.0, 1.23456789])
    (curve,) = traces(replace(PANEL, curves=(Curve("before", X, y),)))
    assert curve.mode == "lines" and curve.x.tolist() == X.tolist()
    np.testing.assert_allclose(curve.y, y, rtol=1e-6)
    assert len(traces(replace(PANEL, curves=(Curve("before", X, np.full(5, np.nan)),)))) == 0


def test_values_have_units_and_names() -> None:
    (curve,) = traces(replace(PANEL, curves=(Curve("before", X, X),)))
    assert curve.hovertemplate == "%{y:.4~g} mN·m the model<extra></extra>"
    assert figure_of(PANEL, NAMES).layout.xaxis.unifiedhovertitle.text == "%{x:.5~g} s"
    *_, limits = traces(replace(PANEL, bars=(Bars("after", X, X - 1, X + 1),)))
    assert limits.customdata[:, 0].tolist() == (X - 1).tolist() and limits.y.tolist() == (X + 1).tolist()


def test_a_band_goes_round_each_of_its_stretches() -> None:
    low = np.array([0.0, 1.0, np.nan, 3.0, 4.0])
    area, limits = traces(replace(PANEL, bands=(Band("before_scatter", X, low, low + 1),)))
    assert area.fill == "toself"
    np.testing.assert_array_equal(area.y, [0, 1, 2, 1, np.nan, 3, 4, 5, 4])
    np.testing.assert_array_equal(area.x, [0, 2.5, 2.5, 0, np.nan, 7.5, 10, 10, 7.5])
    np.testing.assert_array_equal(limits.customdata[:, 0], low)


def test_bars_lie_where_they_should() -> None:
    (drawn,) = traces(ROWS)
    np.testing.assert_array_equal(drawn.x, [1, 3, np.nan, 2, 4, np.nan])
    assert drawn.y.tolist() == [0, 0, 0, 1, 1, 1]


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
    layout = figure_of(
        replace(PANEL, x_limits=None, near_x=0.1, near_y=0.1, curves=(Curve("before", x, x),)), {}
    ).layout
    for axis in (layout.xaxis, layout.yaxis):
        assert list(axis.ticktext) == ["−10", "−1", "0", "1", "10"]
        assert list(axis.tickvals) == pytest.approx(stretched(np.array([-10.0, -1.0, 0.0, 1.0, 10.0]), 0.1))
    short = np.linspace(0.0, 0.47, 9)
    axis = figure_of(replace(PANEL, near_x=0.12, curves=(Curve("before", short, short),)), {}).layout.xaxis
    assert len(axis.ticktext) >= 3 and axis.ticktext[0] == "0"


def test_limits_of_a_logarithmic_axis_are_powers() -> None:
    axis = figure_of(replace(PANEL, log_x=True, x_limits=(0.01, 100.0)), NAMES).layout.xaxis
    assert axis.type == "log" and list(axis.range) == [-2, 2]


def test_the_strongest_of_many_stays_visible() -> None:
    matrix = np.full((1001, 1001), 10, np.int8)
    matrix[998, 3] = -90
    drawn, every = pooled(matrix, (400, 400))
    assert every == (3, 3) and drawn.shape == (334, 334) and drawn[332, 1] == -90 and drawn[0, 0] == 10


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
    file = io.BytesIO()  # a PNG takes it as well, and names without a glyph
    write_sheet(Sheet("", "", hostile, (("before", hostile),), (named,)), [drawn[0][1]], file)
    assert file.getvalue()


def test_plotly_is_whole_and_packed_alike_each_time() -> None:
    unpacked = gzip.decompress(base64.b64decode(packed_plotly())).decode()
    assert unpacked.lstrip().startswith("/**\n* plotly.js v") and len(packed_plotly()) < 0.45 * len(unpacked)


def test_what_is_dark_on_a_light_page_is_light_on_a_dark_one() -> None:
    assert '.plot [style*="stroke: rgb(34, 34, 34)"] { stroke: #E4E8EC !important; }' in dark_colours()
