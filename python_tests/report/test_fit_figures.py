"""The figures of a fit: what is drawn is what the model does, what the report says, and what the covariance means."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from tendonfmu.arrays import Numbers
from tendonfmu.drawing import Panel
from tendonfmu.estimate.fit_report import CONFIDENCE, FitPicture, LawBands
from tendonfmu.model import finger_from_data, native
from tendonfmu.model.friction_places import Effect, effects
from tendonfmu.report.fit_figures import (
    SHOWN,
    law_sheets,
    torque_sheets,
)
from tendonfmu.report.kit import rms

MILLI = 1e3
EDGE = "tendons[1].edge_friction[1]"  # with a law at each of two angles


def drawn_as(panel: Panel, name: str) -> tuple[Numbers, Numbers]:
    """x and y of the curve of a name."""
    (trace,) = [trace for trace in panel.traces if trace["name"] == name and trace["mode"] == "lines"]
    return trace["x"], trace["y"]


# --- over time --------------------------------------------------------------------------------------------------------


def test_torque_over_time_is_that_of_the_recording(fit: FitPicture) -> None:
    """Measured, predicted before the sample is seen, and the bias's part; the note's share is of what is drawn."""
    training, held_out, compared = torque_sheets(fit)
    for sheet, series, flags in (
        (training, fit.series[0], fit.series[0].used),
        (held_out, fit.series[0], fit.series[0].held_out),
        (compared, fit.series[1], None),
    ):
        (panel,) = sheet.panels
        time, measured = drawn_as(panel, "measured joint torque")
        _, predicted = drawn_as(panel, "model with bias, before the bias learns from the sample")
        _, bias = drawn_as(panel, "bias alone")
        rows = np.searchsorted(series.time, time)
        np.testing.assert_array_equal(series.time[rows], time)
        np.testing.assert_allclose(measured, MILLI * series.torque[rows, 0])
        np.testing.assert_allclose(measured - predicted, MILLI * series.residual[rows, 0], atol=1e-9)
        np.testing.assert_allclose(predicted - bias, MILLI * series.model_torque[rows, 0], atol=1e-9)
        inside = (series.time >= time[0]) & (series.time <= time[-1])  # all of them; the curves are thinned
        share = rms(series.residual[inside, 0]) / rms(series.torque[inside, 0])
        assert panel.note == f"residual {100 * share:.0f} % of torque"
        assert flags is None or flags[rows[:-1]].all()
        assert 0.8 * SHOWN < time[-1] - time[0] < SHOWN + 0.01


# --- friction laws ----------------------------------------------------------------------------------------------------


def test_a_law_is_drawn_as_the_model_has_it(fit: FitPicture) -> None:
    """The C core's torque of a joint that has no other friction, at the drawn velocities."""
    law = {
        "positive": {"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.2, "viscous": 0.004},
        "negative": {"static": 0.05, "coulomb": 0.01, "stribeck_velocity": 0.1, "viscous": 0.002},
    }
    data: dict[str, Any] = {
        "format": "tendonfmu-finger-1",
        "name": "one joint",
        "joints": [{"name": "only", "friction": law}],
        "tendons": [{"stiffness": 4000.0, "moment_arms": [arm]} for arm in (0.01, -0.01)],
        "velocity_threshold": {"joint": 0.02},
        "contact": {"threshold": [10.0]},
    }
    finger = finger_from_data(data)
    bare = FitPicture({"parameters": []}, finger, finger, [], np.zeros(0), np.zeros((0, 0)), [])
    (sheet,) = law_sheets(bare)
    x, friction = drawn_as(sheet.panels[0], "fitted")
    velocity = x[np.abs(x) > 0.0201]
    inputs = {
        "time": np.arange(len(velocity)) * 0.01,
        "tendon_force": np.full((len(velocity), 2), 5.0),
        "joint_position": np.zeros((len(velocity), 1)),
        "joint_velocity": velocity[:, None],
    }
    outputs = native.Instance.from_description(data, 3).run(inputs)
    torque = (outputs["friction_torque"] - outputs["bias_torque"])[:, 0]
    np.testing.assert_allclose(friction[np.abs(x) > 0.0201], MILLI * torque, rtol=1e-9)
    assert (friction[np.abs(x) < 0.0199] == 0.0).all()


def effect_at(fit: FitPicture, path: str) -> Effect:
    return next(effect for effect in effects(fit.fitted.data) if effect.path == path)


@pytest.mark.parametrize("path", ["joints[1].friction", EDGE])
def test_bands_are_what_draws_from_the_covariance_give(fit: FitPicture, path: str) -> None:
    """Standard deviation of the curve over 4000 draws of z, errors of a few percent, strongly correlated."""
    effect, count = effect_at(fit, path), len(fit.unknowns)
    here = [k for k, unknown in enumerate(fit.unknowns) if unknown.path.startswith(f"{path}.")]
    generator = np.random.default_rng(4)
    mixing = generator.normal(size=(len(here), len(here))) * (0.02 * np.abs(fit.z[here]))[:, None]
    covariance = np.zeros((count, count))
    covariance[np.ix_(here, here)] = mixing @ mixing.T
    bands = LawBands(dataclasses.replace(fit, covariance=covariance))
    speed, angle = np.geomspace(1e-3, 0.05, 7), np.linspace(-0.5, 0.5, 7)
    at = np.full(7, 0.004) if effect.angles else speed
    over_angle = effect.angles and bands.over_angle(effect, effect, 1, 0.004, angle)
    drawn = over_angle or bands.over_speed(effect, effect, 1, speed)
    points = effect.angles or (0.0,)
    weights = np.column_stack([np.interp(angle, points, row) for row in np.eye(len(points))])
    index = {(fit.unknowns[k].path, fit.unknowns[k].role): i for i, k in enumerate(here)}
    curves = []
    for draw in fit.z[here] + generator.normal(size=(4000, len(here))) @ mixing.T:
        laws = []
        for law, start in zip(effect.law_paths, effect.laws, strict=True):
            keys = (("coulomb", "coulomb"), ("static", "drop"), ("stribeck_velocity", "rate"), ("viscous", "viscous"))
            given = (start["coulomb"], start["static"] - start["coulomb"], 1.0 / start["stribeck_velocity"], 0.0)
            coulomb, drop, rate, viscous = (
                draw[index[f"{law}.{name}", role]] if (f"{law}.{name}", role) in index else value
                for (name, role), value in zip(keys, given, strict=True)
            )
            laws.append(coulomb + drop * np.exp(-at * rate) + viscous * at)
        curves.append(np.sum(weights * np.column_stack(laws), axis=1))
    np.testing.assert_allclose(drawn.fitted, np.mean(curves, axis=0), rtol=0.01)
    np.testing.assert_allclose((drawn.high - drawn.fitted) / CONFIDENCE, np.std(curves, axis=0), rtol=0.08)
