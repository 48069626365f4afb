"""Panels drawn as SVG: what is drawn is where it belongs, numbers at the axes are few and right, names are escaped."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

pytest.importorskip("tendonfmu._native", reason="SKIPPED: tendonfmu is not installed")

from tendonfmu.drawing.panel_data import Band, Bars, Curve, Dots, Panel
from tendonfmu.drawing.svg import panel_svg

X = np.linspace(0.0, 10.0, 5)
PANEL = Panel(title="title", alt="what it shows", x_label="time (s)", y_label="torque (mN·m)", x_limits=(0.0, 10.0))


def parsed(panel: Panel) -> ElementTree.Element:
    return ElementTree.fromstring(str(panel_svg(panel)))


def numbers(panel: Panel, anchor: str) -> list[str]:
    """At the x axis ("middle") or the y axis ("end")."""
    found = [each for each in parsed(panel).iter("text") if each.get("class") == "number"]
    return [each.text or "" for each in found if each.get("text-anchor") == anchor]


def test_a_curve_goes_from_corner_to_corner() -> None:
    panel = replace(PANEL, curves=(Curve("before", X, X),), y_limits=(0.0, 10.0))
    paths = [each.get("d") or "" for each in parsed(panel).iter("path") if each.get("fill") == "none"]
    points = re.findall(r"[ML]([\d.]+) ([\d.]+)", paths[0])
    assert [(float(x), float(y)) for x, y in (points[0], points[-1])] == [(58.0, 206.0), (358.0, 28.0)]


def test_gaps_stay_gaps() -> None:
    y = np.array([1.0, 2.0, np.nan, 2.0, 1.0])
    panel = replace(PANEL, curves=(Curve("before", X, y),), dots=(Dots("after_dots", X, y),))
    (path,) = [each.get("d") or "" for each in parsed(panel).iter("path") if each.get("fill") == "none"]
    assert path.count("M") == 2 and "nan" not in str(panel_svg(panel))
    assert len(list(parsed(panel).iter("circle"))) == 4


def test_bands_and_bars_are_drawn() -> None:
    band, bars = Band("before_scatter", X, X - 1, X + 1), Bars("after", X, X - 1, X + 1)
    paths = [each.get("d") or "" for each in parsed(replace(PANEL, bands=(band,), bars=(bars,))).iter("path")]
    assert any(path.endswith("Z") and path.count("L") == 9 for path in paths)
    assert any(path.count("V") == 5 for path in paths)


@pytest.mark.parametrize(
    ("settings", "shown"),
    [
        ({"x_limits": (0.0, 10.0)}, ["0", "2", "4", "6", "8", "10"]),
        ({"x_limits": (-0.3, 0.3)}, ["−0.3", "−0.2", "−0.1", "0", "0.1", "0.2", "0.3"]),
        ({"x_limits": (0.01, 100.0), "log_x": True}, ["0.01", "0.1", "1", "10", "100"]),
        ({"x_limits": (-1.0, 1.0), "near_x": 0.1}, ["−1", "−0.1", "0", "0.1", "1"]),
        ({"x_limits": (2e-7, 9e-7)}, ["2e−7", "4e−7", "6e−7", "8e−7"]),
        ({"x_limits": (3.0, 3.0)}, ["3"]),
    ],
)
def test_numbers_at_an_axis(settings: dict[str, object], shown: list[str]) -> None:
    assert numbers(replace(PANEL, curves=(Curve("before", X, X),), **settings), "middle") == shown  # type: ignore[arg-type]


def test_nothing_to_draw_is_drawn() -> None:
    nothing = np.full(3, np.nan)
    for log in (False, True):
        empty = replace(PANEL, x_limits=None, curves=(Curve("before", nothing, nothing),), log_x=log, log_y=log)
        assert "nan" not in str(panel_svg(empty)) and len(numbers(empty, "end")) > 1


def test_names_are_escaped_and_it_is_described() -> None:
    hostile = "<script>\"&'"
    found = parsed(replace(PANEL, title=hostile, alt=hostile, x_label=hostile, y_label=hostile))
    assert found.get("aria-label") == hostile and found.get("role") == "img"
    assert [each.text for each in found.iter("text")].count(hostile) == 3
