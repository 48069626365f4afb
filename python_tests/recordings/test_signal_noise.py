"""Noise of joint positions of made signals whose noise is known, and statistics of residuals against scipy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from tendonfmu.errors import InputError
from tendonfmu.recordings.recording import Recording
from tendonfmu.recordings.residuals import consistency, whiteness
from tendonfmu.recordings.signal_noise import joint_position_noise, white_noise

Array = NDArray[Any]

ARMS = np.array([[0.009, 0.0], [-0.009, 0.0], [-0.007, 0.008], [0.007, -0.008]])
STIFFNESS = np.array([5000.0, 4000.0, 4500.0, 3500.0])
DATA: dict[str, Any] = {
    "format": "tendonfmu-finger-1",
    "name": "noisy",
    "joints": [{}, {}],
    "tendons": [{"stiffness": k, "moment_arms": arms.tolist()} for k, arms in zip(STIFFNESS, ARMS, strict=True)],
    "contact": {"threshold": [1.0, 1.0]},
}


def motion(time: Array) -> Array:
    """[N, 2] rad: strokes of some Hz with rests, half of the time."""
    phase = np.cumsum(np.diff(time, prepend=time[0]) * (0.5 + 0.5 * np.tanh(4.0 * np.sin(0.7 * time))))
    return np.stack([0.5 * np.sin(4.0 * phase), 0.4 * np.sin(7.0 * phase + 1.0)], axis=1)


def times(rng: np.random.Generator, rate: float = 250.0, jitter: float = 0.0, seconds: float = 40.0) -> Array:
    steps = (1.0 + jitter * rng.uniform(-1.0, 1.0, int(seconds * rate))) / rate
    return np.asarray(np.cumsum(steps))


def recording(
    rng: np.random.Generator,
    force_noise: float,
    position_step: float,
    angle_noise: float,
    angle_step: float,
    **kind: Any,
) -> Recording:
    time = times(rng, **kind)
    q = motion(time)
    force = 20.0 + 3.0 * np.sin(1.3 * time[:, None] + np.arange(4))
    position = np.round((q @ ARMS.T + force / STIFFNESS) / position_step) * position_step
    measured = np.round((q + rng.normal(0.0, angle_noise, q.shape)) / angle_step) * angle_step
    noisy = force + rng.normal(0.0, force_noise, force.shape)
    return Recording(
        Path("made"), time, {"tendon_force": noisy, "tendon_position": position, "joint_position": measured}
    )


@pytest.mark.parametrize("jitter", [0.0, 0.4])
@pytest.mark.parametrize("rate", [100.0, 250.0, 1000.0])
def test_of_a_smooth_motion(rate: float, jitter: float) -> None:
    rng = np.random.default_rng(1)
    time = times(rng, rate, jitter)
    noise = np.array([3e-4, 1e-3])
    found = white_noise(time, motion(time) + rng.normal(0.0, noise, (len(time), 2)))
    np.testing.assert_allclose(found, noise, rtol=0.06)


def test_from_tendons() -> None:
    """Through springs and arms: R⁺ of the force noise; the rounding of positions is small beside it."""
    rng = np.random.default_rng(2)
    made = recording(rng, force_noise=0.02, position_step=1e-6, angle_noise=1e-4, angle_step=1e-4)
    expected = np.sqrt(np.linalg.pinv(ARMS) ** 2 @ ((0.02 / STIFFNESS) ** 2 + 1e-12 / 12.0))
    np.testing.assert_allclose(joint_position_noise(DATA, made), expected, rtol=0.05)


def test_of_encoders_with_quantisation() -> None:
    rng = np.random.default_rng(3)
    made = recording(rng, 0.02, 1e-6, angle_noise=1e-4, angle_step=2e-4, jitter=0.3)
    expected = np.hypot(1e-4, 2e-4 / np.sqrt(12.0))
    np.testing.assert_allclose(joint_position_noise(DATA, made, 2), expected, rtol=0.1)


def test_impacts_and_gaps_do_not_count() -> None:
    rng = np.random.default_rng(5)
    time = times(rng)
    values = motion(time) + rng.normal(0.0, 5e-4, (len(time), 2))
    values[rng.integers(0, len(time), 40)] += 0.1
    time[3000:] += 7.0
    values[3000:] += 0.5
    np.testing.assert_allclose(white_noise(time, values), 5e-4, rtol=0.1)


def test_refuses_what_says_nothing() -> None:
    with pytest.raises(InputError, match="recording of 20 samples: expected at least 60"):
        white_noise(np.arange(20.0), np.zeros((20, 1)))
    rng = np.random.default_rng(8)
    made = recording(rng, 0.02, 1e-6, 1e-4, 1e-4)
    bare = Recording(made.path, made.time, {k: v for k, v in made.groups.items() if k != "joint_position"})
    with pytest.raises(InputError, match=r"no column joint_position\[1\]"):
        joint_position_noise(DATA, bare, 2)


# --- residuals of a consistent filter ---------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [40, 1000, 100000])
def test_the_interval_of_the_nis_is_that_of_chi_square(count: int) -> None:
    low, high = consistency([np.ones((count, 1))])["interval"]
    expected = stats.chi2.ppf([0.025, 0.975], count) / count
    assert [low, high] == pytest.approx(list(expected), rel=1e-9)


def test_whiteness_tells_white_from_coloured() -> None:
    white = np.random.default_rng(1).standard_normal((5000, 2))
    white[1000:1500] = np.nan
    coloured = white.copy()
    coloured[1:, 1] += 0.2 * np.nan_to_num(white[:-1, 1])
    found = whiteness([coloured])
    assert abs(found["lag_one"][0]) < 0.04 and found["ljung_box_p"][0] > 0.01
    assert found["lag_one"][1] == pytest.approx(0.2 / 1.04, abs=0.04) and found["ljung_box_p"][1] < 1e-6
