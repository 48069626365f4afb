"""The figures of a fit: what is drawn is what the model does, what the report says, and what the covariance means."""

from __future__ import annotations

import copy
import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from fit_pictures import finger_of, index_finger, internal_values, made_up_picture, made_up_unknowns
from tendonfmu.drawing.panel import Curve, Panel, Sheet
from tendonfmu.estimate.picture import CONFIDENCE, FitPicture, LawBands
from tendonfmu.model import native
from tendonfmu.model.friction_places import Effect, effects
from tendonfmu.report.fit_figures import (
    SHOWN,
    correlation,
    correlation_sheet,
    error_sheet,
    fit_sheets,
    relative_error,
    residual_sheets,
    strongest_pairs,
    torque_sheets,
)
from tendonfmu.report.fit_laws import law_sheets
from tendonfmu.report.numbers import rms

MM, PERCENT, MILLI = 1e3, 1e2, 1e3


@pytest.fixture(scope="module")
def picture() -> FitPicture:
    return made_up_picture()


@pytest.fixture(scope="module")
def sheets(picture: FitPicture) -> list[Sheet]:
    return fit_sheets(picture)


def curve(panel: Panel, style: str) -> Curve:
    (drawn,) = [one for one in panel.curves if one.style == style]
    return drawn


# --- torque over time -------------------------------------------------------------------------------------------------


def test_torque_over_time_is_that_of_the_recording(picture: FitPicture) -> None:
    """Measured, predicted before the sample is seen, and the bias's part; the note's share from what is drawn."""
    training, held_out, compared = torque_sheets(picture)
    for sheet, series in ((training, picture.series[0]), (held_out, picture.series[0]), (compared, picture.series[1])):
        assert len(sheet.panels) == 4
        for j, panel in enumerate(sheet.panels):
            measured, predicted, bias = (curve(panel, style) for style in ("measured", "predicted", "bias"))
            rows = np.searchsorted(series.time, measured.x)
            np.testing.assert_array_equal(series.time[rows], measured.x)
            np.testing.assert_allclose(measured.y, MILLI * series.torque[rows, j])
            np.testing.assert_allclose(measured.y - predicted.y, MILLI * series.residual[rows, j], atol=1e-9)
            np.testing.assert_allclose(predicted.y - bias.y, MILLI * series.model_torque[rows, j], atol=1e-9)
            share = rms(measured.y - predicted.y) / rms(measured.y)
            assert panel.note == f"residual {100 * share:.0f} % of torque"


def test_the_seconds_shown_belong_to_what_the_title_says(picture: FitPicture) -> None:
    training, held_out, compared = (curve(sheet.panels[0], "measured").x for sheet in torque_sheets(picture))
    series = picture.series[0]
    assert series.held_out is not None
    for shown, flags in ((training, series.used), (held_out, series.held_out)):
        assert flags[np.searchsorted(series.time, shown)].all()
        assert shown[-1] - shown[0] == pytest.approx(SHOWN, abs=0.01)
    assert compared[0] == pytest.approx(training[0], abs=0.01)  # the same motion, other pretension


def test_sixty_seconds_on_where_the_recording_is_long_enough(picture: FitPicture) -> None:
    """As figs. 6 and 7 of the paper."""
    series = dataclasses.replace(picture.series[1], time=picture.series[1].time * 3)
    sheet = next(iter(torque_sheets(dataclasses.replace(picture, series=[series]))))
    shown = curve(sheet.panels[0], "measured").x
    assert (shown[0], shown[-1]) == pytest.approx((60.0, 70.0), abs=0.01)
    assert "60 to 70 s" in sheet.title


def test_a_gap_breaks_the_line(picture: FitPicture) -> None:
    series = picture.series[1]
    time = series.time + np.where(series.time > 28.0, 1.5, 0.0)
    sheet = next(iter(torque_sheets(dataclasses.replace(picture, series=[dataclasses.replace(series, time=time)]))))
    drawn = curve(sheet.panels[0], "predicted")
    (broken,) = np.flatnonzero(np.isnan(drawn.x))
    assert np.isnan(drawn.y[broken])
    assert drawn.x[broken + 1] - drawn.x[broken - 1] > 1.4


# --- residual ---------------------------------------------------------------------------------------------------------


def test_residual_over_angle_and_velocity_shows_what_is_in_it(picture: FitPicture) -> None:
    """A residual that is 10 mN·m per rad/s of its joint, plus 1 mN·m of noise: median on the line, band 10 to 90 %."""
    series = picture.series[0]
    noise = np.random.default_rng(3).normal(scale=1e-3, size=series.torque.shape)
    planted = dataclasses.replace(series, residual=0.01 * series.joint_speed + noise)
    sheet = next(iter(residual_sheets(dataclasses.replace(picture, series=[planted]))))
    velocity = [panel for panel in sheet.panels if panel.title.endswith("velocity")]
    assert len(velocity) == 4
    for panel in velocity:
        middle = curve(panel, "median")
        assert len(middle.x) > 20
        (band,) = panel.bands
        slow = np.abs(np.gradient(middle.x)) < 0.02  # in wide bins the slope itself spreads it
        np.testing.assert_allclose(middle.y[slow], 10.0 * middle.x[slow], atol=0.15)
        np.testing.assert_allclose((band.high - band.low)[slow], 2 * 1.2816, rtol=0.15)


def test_residual_of_contact_and_faults_is_not_shown(picture: FitPicture) -> None:
    """Samples neither used nor held out count for nothing, nor do those without a number."""
    series = picture.series[0]
    wild = series.residual.copy()
    wild[1000:2000] = 5.0
    used = series.used.copy()
    used[1000:2000] = False
    angle = series.joint_angle.copy()
    wild[3000:3010], angle[3000:3010] = np.nan, np.nan
    changed = dataclasses.replace(series, residual=wild, used=used, joint_angle=angle)
    for panel in next(iter(residual_sheets(dataclasses.replace(picture, series=[changed])))).panels:
        assert np.max(np.abs(curve(panel, "median").y)) < 100.0
        assert np.isfinite(panel.bands[0].high).all()


def test_recordings_stand_end_to_end(picture: FitPicture) -> None:
    one = picture.series[0]
    sheet = next(iter(residual_sheets(dataclasses.replace(picture, series=[one, one]))))
    panel = sheet.panels[0]
    assert curve(panel, "median").x[-1] == pytest.approx(120.0, abs=2.0)
    assert [round(begin) for begin, _ in panel.stripes["held_out"]] == [40, 100]


# --- friction laws ----------------------------------------------------------------------------------------------------


def find(data: dict[str, Any], path: str) -> Effect:
    return next(effect for effect in effects(data) if effect.path == path)


def test_a_law_is_drawn_as_the_model_has_it() -> None:
    """The C core's torque of a joint that has no other friction, at the drawn velocities."""
    law = {
        "positive": {"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.2, "viscous": 0.004},
        "negative": {"static": 0.05, "coulomb": 0.01, "stribeck_velocity": 0.1, "viscous": 0.002},
    }
    tendons = [{"stiffness": 4000.0, "moment_arms": [arm]} for arm in (0.01, -0.01)]
    data: dict[str, Any] = {
        "format": "tendonfmu-finger-1",
        "name": "one joint",
        "joints": [{"name": "only", "friction": law}],
        "tendons": tendons,
        "velocity_threshold": {"joint": 0.02},
        "contact": {"threshold": [10.0]},
    }
    picture = bare_picture(data, np.eye(8) * 1e-12)
    (sheet,) = law_sheets(picture)
    drawn = curve(sheet.panels[0], "fitted")
    velocity = drawn.x[np.abs(drawn.x) > 0.0201]
    n = len(velocity)
    outputs = native.Instance.from_description(data, 3).run(
        {
            "time": np.arange(n) * 0.01,
            "tendon_force": np.full((n, 2), 5.0),
            "joint_position": np.zeros((n, 1)),
            "joint_velocity": velocity[:, None],
        }
    )
    torque = (outputs["friction_torque"] - outputs["bias_torque"])[:, 0]
    np.testing.assert_allclose(drawn.y[np.abs(drawn.x) > 0.0201], MILLI * torque, rtol=1e-9)
    assert (drawn.y[np.abs(drawn.x) < 0.0199] == 0.0).all()
    assert sheet.panels[0].stripes == {"standstill": [(-0.02, 0.02)]}


def bare_picture(
    data: dict[str, Any], covariance: np.ndarray[Any, Any], start: dict[str, Any] | None = None
) -> FitPicture:
    """Without recordings."""
    found = made_up_unknowns(data)
    z = internal_values(data, found)
    assert covariance.shape == (len(z), len(z))
    return FitPicture({"parameters": []}, finger_of(start or data), finger_of(data), found, z, covariance, [])


EDGE = "tendons[7].edge_friction[2]"  # with working points


@pytest.mark.parametrize("path", ["joints[2].friction", "tendons[5].pulley_friction[2]", EDGE])
def test_bands_are_what_draws_from_the_covariance_give(path: str) -> None:
    """Standard deviation of the curve over 4000 draws of z, errors of a few percent, strongly correlated."""
    data = index_finger()
    found = made_up_unknowns(data)
    z = internal_values(data, found)
    here = [k for k, unknown in enumerate(found) if unknown.path.startswith(f"{path}.")]
    generator = np.random.default_rng(4)
    mixing = generator.normal(size=(len(here), len(here))) * (0.02 * np.abs(z[here]))[:, None]
    covariance = np.zeros((len(z), len(z)))
    covariance[np.ix_(here, here)] = mixing @ mixing.T
    picture = bare_picture(data, covariance)
    effect, bands = find(data, path), LawBands(picture)
    speed, angle = np.geomspace(1e-3, 0.05, 7), np.linspace(-0.4, 0.4, 7)
    at = np.full(7, 0.004) if effect.angles else speed
    drawn = (
        bands.over_angle(effect, effect, 1, 0.004, angle)
        if effect.angles
        else bands.over_speed(effect, effect, 1, speed)
    )
    points = effect.angles or (0.0,)
    weights = np.column_stack([np.interp(angle, points, row) for row in np.eye(len(points))])
    index = {(found[k].path, found[k].role): i for i, k in enumerate(here)}
    curves = []
    for draw in z[here] + generator.normal(size=(4000, len(here))) @ mixing.T:
        laws = []
        for law in effect.law_paths:
            coulomb, drop = draw[index[f"{law}.coulomb", "coulomb"]], draw[index[f"{law}.static", "drop"]]
            rate, viscous = draw[index[f"{law}.stribeck_velocity", "rate"]], draw[index[f"{law}.viscous", "viscous"]]
            laws.append(coulomb + drop * np.exp(-at * rate) + viscous * at)
        curves.append(np.sum(weights * np.column_stack(laws), axis=1))
    np.testing.assert_allclose(drawn.fitted, np.mean(curves, axis=0), rtol=0.01)
    np.testing.assert_allclose((drawn.high - drawn.fitted) / CONFIDENCE, np.std(curves, axis=0), rtol=0.08)


def test_shared_values_add_up_in_a_band() -> None:
    """Two working points with one coulomb value between them: halfway its error is whole, not divided by √2."""
    data = index_finger()
    found = made_up_unknowns(data)
    first, second = (next(k for k, u in enumerate(found) if u.path == f"{EDGE}.laws[{i}].coulomb") for i in (1, 2))
    joined = dataclasses.replace(found[first], parameters=found[first].parameters + found[second].parameters)
    shared = [joined if k == first else unknown for k, unknown in enumerate(found) if k != second]
    covariance = np.zeros((len(shared), len(shared)))
    covariance[first, first] = 1e-6
    picture = FitPicture(
        {"parameters": []}, finger_of(data), finger_of(data), shared, np.zeros(len(shared)), covariance, []
    )
    effect = find(data, EDGE)
    middle = np.array([0.5 * (effect.angles[0] + effect.angles[1])])
    drawn = LawBands(picture).over_angle(effect, effect, 1, 0.01, middle)
    assert (drawn.high - drawn.fitted)[0] == pytest.approx(CONFIDENCE * 1e-3)


def test_no_friction_below_zero(picture: FitPicture) -> None:
    wide = dataclasses.replace(picture, covariance=1e4 * picture.covariance)
    for sheet in law_sheets(wide):
        for panel in sheet.panels:
            assert panel.y_limits is not None
            highest = max(
                float(each.y.max()) for each in panel.curves if each.style in ("fitted", "unknown", "slow", "start")
            )
            assert panel.y_limits[1] <= 2.8 * highest  # a hopeless band leaves the panel, the curves stay readable
            for band in panel.bands:
                above = band.x > 0 if "velocity" in panel.x_label else band.x == band.x
                assert (band.low[above] >= 0).all()


def test_every_law_has_its_panel(picture: FitPicture, sheets: list[Sheet]) -> None:
    laws = [sheet for sheet in sheets if sheet.section == "laws"]
    assert [sheet.name for sheet in laws] == ["laws_joints", *(f"laws_tendon_{i}" for i in range(1, 9))]
    assert sum(len(sheet.panels) for sheet in laws) == len(effects(picture.fitted.data)) == 44
    notes = [panel.note for sheet in laws for panel in sheet.panels]
    known, of = np.array([[int(x) for x in note.split(" ")[0].split("/")] for note in notes]).sum(axis=0)
    covers = [entry for entry in picture.report["parameters"] if ".cover." in entry["path"]]
    assert of == picture.report["identified"]["of"] - len(covers)
    assert known == picture.report["identified"]["count"] - sum(entry["identified"] for entry in covers)


def test_directions_differ_where_the_law_does() -> None:
    data = index_finger()
    edge = data["tendons"][6]["edge_friction"][1]
    for k, law in enumerate(edge["laws"]):
        edge["laws"][k] = {"positive": law, "negative": {**law, "coulomb": 0.5 * law["coulomb"]}}
    count = len(made_up_unknowns(data))
    tendon = list(law_sheets(bare_picture(data, np.eye(count) * 1e-12)))[7]
    (panel,) = [panel for panel in tendon.panels if panel.title == "edge 2 (mcp_flexion)"]
    assert np.all(curve(panel, "negative").y < curve(panel, "fitted").y)
    assert "negative" in dict(tendon.keys)


# --- errors and correlation -------------------------------------------------------------------------------------------


def test_every_number_has_its_dot(picture: FitPicture) -> None:
    (panel,) = error_sheet(picture).panels
    counts = {dots.style: len(dots.x) for dots in panel.dots}
    known = picture.report["identified"]
    assert counts == {"identified": known["count"], "unidentified": known["of"] - known["count"]}
    for dots in panel.dots:
        assert ((dots.x < 0.3) == (dots.style == "identified")).all()
    assert "edge: stribeck velocity" in " ".join(panel.rows)
    assert sum(int(row.rsplit("/", 1)[1]) for row in panel.rows) == known["of"]


def test_numbers_without_an_error_lie_at_the_end(picture: FitPicture) -> None:
    report = copy.deepcopy(dict(picture.report))
    first, second = report["parameters"][:2]
    first["standard_error"], first["identified"] = None, False
    second["value"], second["identified"] = 0.0, False
    assert relative_error(first) == relative_error(second) == float("inf")
    (panel,) = error_sheet(dataclasses.replace(picture, report=report)).panels
    assert panel.x_limits is not None
    assert sum(np.count_nonzero(dots.x == panel.x_limits[1]) for dots in panel.dots) == 2


def test_the_strongest_pair_comes_first(picture: FitPicture) -> None:
    covariance = np.diag(np.diag(picture.covariance))
    for a, b, value in ((5, 300, -0.97), (17, 40, 0.8)):
        covariance[a, b] = covariance[b, a] = value * np.sqrt(covariance[a, a] * covariance[b, b])
    first, second, third = strongest_pairs(dataclasses.replace(picture, covariance=covariance), 3)
    assert (first.correlation, second.correlation, third.correlation) == pytest.approx((-0.97, 0.8, 0.0))
    for name, k in ((first.first, 5), (first.second, 300)):
        unknown = picture.unknowns[k]
        assert name.endswith(f".{unknown.role}") or name == unknown.path
        assert name.rsplit(".", 1)[0] == unknown.path.rsplit(".", 1)[0]


def test_correlation_without_variance_is_zero() -> None:
    found = correlation(np.array([[4.0, 0.0, 2.0], [0.0, 0.0, 0.0], [2.0, 0.0, 4.0]]))
    np.testing.assert_array_equal(found, [[1.0, 0.0, 0.5], [0.0, 0.0, 0.0], [0.5, 0.0, 1.0]])


def test_groups_cover_the_matrix(picture: FitPicture) -> None:
    """Unknowns in any order end up grouped by joint, then tendon; small groups share a name; neighbours are pooled."""
    mixed = np.random.default_rng(5).permutation(len(picture.unknowns))
    shuffled = dataclasses.replace(
        picture,
        unknowns=[picture.unknowns[k] for k in mixed],
        covariance=picture.covariance[np.ix_(mixed, mixed)],
    )
    for each in (picture, shuffled):
        (panel,) = correlation_sheet(each).panels
        assert panel.heat is not None
        count = len(picture.unknowns)
        assert (
            panel.heat.values.shape == (math.ceil(count / 2), math.ceil(count / 2))
            and (np.diag(panel.heat.values) == 100).all()
        )
        assert [name for _, name in panel.y_ticks] == ["mcp_abduction … dip_flexion", *picture.fitted.tendon_names]
        fourth = panel.borders[4] - panel.borders[3]
        assert 2 * fourth == sum(unknown.path.startswith("tendons[3].") for unknown in picture.unknowns)
