"""How many independent samples a series is worth: white noise, coloured noise whose answer is known, gaps."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonfmu.statistics.whitening import _correlation, effective_samples, sample_weights

Numbers = NDArray[np.float64]


def correlation_time(values: Numbers) -> float:
    return _correlation(values)[0]


def coloured(seed: int, samples: int, memory: float) -> Numbers:
    """e_k = memory·e_(k−1) + white noise: τ = (1 + memory)/(1 − memory)."""
    noise = np.random.default_rng(seed).standard_normal(samples)
    found = np.empty(samples)
    state = 0.0
    for k, value in enumerate(noise):
        found[k] = state = memory * state + value
    return found


@pytest.mark.parametrize("samples", [50, 2000, 20000])
def test_white_noise_is_worth_every_sample(samples: int) -> None:
    found = [correlation_time(np.random.default_rng(seed).standard_normal(samples)) for seed in range(100)]
    # one of 740 is beyond three standard deviations by chance; such a one loses little
    assert sum(each == 1.0 for each in found) >= 98
    assert max(found) < 2.0


@pytest.mark.parametrize(("memory", "expected"), [(0.5, 3.0), (0.9, 19.0), (0.98, 99.0)])
def test_the_time_of_coloured_noise_is_the_one_of_its_equation(memory: float, expected: float) -> None:
    found = [correlation_time(coloured(seed, 20000, memory)) for seed in range(20)]
    assert np.mean(found) == pytest.approx(expected, rel=0.15)


def test_the_least_and_the_most_that_samples_are_worth() -> None:
    for series in (np.zeros(0), np.zeros(500), np.full(500, np.nan), np.ones(10), coloured(3, 5000, -0.7)):
        assert correlation_time(series) == 1.0  # what tells nothing, or alternates, counts as it is
    assert correlation_time(np.ones(1000)) > 500
    with_gaps = coloured(4, 40000, 0.9)
    with_gaps[np.arange(40000) // 500 % 4 == 0] = np.nan
    assert correlation_time(with_gaps) == pytest.approx(19.0, rel=0.25)
    slow = coloured(1, 20000, 0.99)  # under a white sensor
    series = np.random.default_rng(2).standard_normal(20000) + 0.3 * slow / slow.std()
    assert 1 + 0.5 * 2 * 0.083 * 99 < correlation_time(series) < 1 + 2 * 2 * 0.083 * 99


def test_each_joint_has_its_own_share() -> None:
    both = np.stack([np.random.default_rng(5).standard_normal(8000), coloured(6, 8000, 0.9)], axis=1)
    weights = sample_weights(both, 1e-3, 1.0)
    assert weights[0] == 1.0 and weights[1] == pytest.approx(1 / 19, rel=0.3)
    both[:1000, 1] = np.nan
    samples, worth = effective_samples([both], [np.broadcast_to(weights, both.shape)])
    assert samples.tolist() == [8000.0, 7000.0]
    assert worth == pytest.approx([8000.0, 7000.0 * weights[1]])


@pytest.mark.parametrize(("again", "most"), [(True, 4.0), (False, 1000.0)])
def test_an_error_that_returns_with_every_stroke_is_worth_little(again: bool, most: float) -> None:
    """20 strokes of 1 s: the same error in each, or another one."""
    strokes = [coloured(8 if again else stroke, 1000, 0.9) for stroke in range(20)]
    noise = 0.2 * np.random.default_rng(9).standard_normal(20_000)
    worth = 20_000 * sample_weights((np.concatenate(strokes) + noise)[:, None], 1e-3, 1.0)[0]
    assert 0.5 * most < worth < 2.0 * most


@pytest.mark.parametrize(("memory", "least", "most"), [(0.02, 300.0, 700.0), (0.5, 8.0, 40.0)])
def test_an_error_that_lasts_counts_as_new_with_every_stroke(memory: float, least: float, most: float) -> None:
    """Noise is forgotten within 0.1 s; s, a stroke of 1 s, 20 s."""
    series = coloured(11, 20_000, float(np.exp(-1e-3 / memory)))
    assert least < 20_000 * sample_weights(series[:, None], 1e-3, 1.0)[0] < most
