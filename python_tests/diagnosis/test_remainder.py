"""What of a residual is explainable: silent on noise, sure of what no candidate is; and its pictures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from repetitions import repeated
from synthetic_series import bias_splines, low_passed, make_series, nuisance_of, residual_of, with_effect
from tendonfmu.diagnosis.answer import residual_views, whiteness
from tendonfmu.diagnosis.remainder import measure_remainder
from tendonfmu.diagnosis.samples import Series

Numbers = NDArray[np.float64]


def rubbing(series: Series) -> Numbers:
    apart = series.tendon_velocity[:, 0, 1] - series.tendon_velocity[:, 2, 1]
    return np.asarray(np.tanh(apart / (0.02 * np.abs(apart).max())))


def memory(series: Series) -> Numbers:
    recent = low_passed(np.abs(series.velocity[:, 1]), 4.0)
    return np.asarray(np.tanh(series.velocity[:, 1] / 0.02) * (recent / recent.mean() - 1.0))


def product(series: Series) -> Numbers:
    one, other = (angle / angle.std() for angle in series.angle[:, :2].T)
    return np.asarray(np.sin(1.3 * one) * np.cos(1.1 * other))


def cogging(series: Series) -> Numbers:
    angle = series.angle[:, 1]
    return np.asarray(np.sin(2.0 * np.pi * 6.0 * angle / np.ptp(angle)))


def ripple(series: Series) -> Numbers:
    position = series.position[:, 1]
    return np.asarray(np.sin(2.0 * np.pi * 6.0 * position / np.ptp(position)))


def creep(series: Series) -> Numbers:
    return np.asarray(series.angle[:, 0] - low_passed(series.angle[:, 0], 2.0))


def oscillation(series: Series) -> Numbers:
    return np.sin(2.0 * np.pi * 3.7 * series.time)


@pytest.mark.parametrize("seed", repeated(range(4), 0))
def test_noise_is_not_unknown(seed: int) -> None:
    series = make_series(100 + seed)
    nuisance = nuisance_of(series)
    found = measure_remainder(series, residual_of(series, nuisance), bias_splines(series))
    assert not found.findings
    assert found.description == ""
    assert found.p_value > 0.01
    assert max(found.share) < 0.1


@pytest.mark.parametrize(
    ("signal", "strength", "groups"),
    repeated(
        [
            (rubbing, 1.0, {"rubbing", "tendon", "velocity"}),
            (product, 1.0, {"angle"}),
            (cogging, 1.0, {"angle"}),
            (ripple, 1.0, {"position"}),
            (creep, 2.0, {"memory of angle"}),
            (memory, 4.0, {"memory of speed"}),
            (oscillation, 0.3, {"line"}),
        ],
        3,
    ),
)
def test_finds_what_no_candidate_is(signal: Callable[[Series], Numbers], strength: float, groups: set[str]) -> None:
    series = make_series(7)
    nuisance = nuisance_of(series)
    hidden = with_effect(series, nuisance, signal(series), joint=1, strength=strength)
    found = measure_remainder(hidden, residual_of(hidden, nuisance), bias_splines(hidden))
    assert found.findings[0].joint == 2
    assert "Joint 2" in found.description
    # no friction law of another form would bring it; two tendons that rub do what friction of a joint does
    assert found.beyond.sum() > 0.1 * found.gain.sum() or signal is rubbing
    assert found.findings[0].group in groups
    # of all there is, a shape that must be learned from 60 s gives a fifth at least
    whole = strength / (1.0 + strength)
    assert whole / 5.0 < found.share[1] < whole + 0.07
    assert found.gain[:, 1].sum() == pytest.approx(found.share[1] * found.square[1], rel=0.05)
    if signal is oscillation:
        line = found.findings[0].line
        assert line is not None
        assert line.frequency == pytest.approx(3.7, abs=0.02)
        assert "3.7 Hz" in found.description


def test_too_short_is_not_judged() -> None:
    series = make_series(3, seconds=8.0)
    nuisance = nuisance_of(series)
    found = measure_remainder(series, residual_of(series, nuisance), bias_splines(series))
    assert not found.findings
    assert found.p_value == 1.0


def test_views_show_the_curve_the_spectrum_and_the_memory() -> None:
    series = make_series(4, seconds=40.0)
    drive = 0.01 * np.random.default_rng(2).standard_normal((len(series.time), 2))
    after = np.asarray(lfilter([1.0], [1.0, -0.7], drive, axis=0))
    views = {
        (view.joint, view.kind): view for view in residual_views(series, series.angle**3, after, load=series.angle)
    }
    assert len(views) == 16
    curve = views[1, "angle"]
    np.testing.assert_allclose(curve.before, curve.x**3, atol=0.01)
    spectrum = views[2, "spectrum"]
    assert np.trapezoid(spectrum.after, spectrum.x) == pytest.approx(np.var(after[:, 1]), rel=0.1)
    np.testing.assert_allclose(views[1, "autocorrelation"].after[:3], 0.7 ** np.arange(1, 4), atol=0.06)
    assert whiteness(series, after, drive)[0] == pytest.approx((0.7, 0.0), abs=0.05)
    clock = views[1, "time"].x
    assert np.all(np.diff(clock) > 0.0)
    assert clock[-1] == pytest.approx(40.0, abs=0.1)
