"""The test of a cause keeps its level under noise that remembers and a bias that wanders, and sees what is there."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from made_columns import BLOCKS, JOINTS, STEP, coloured, series_with, waves
from repetitions import repeated
from synthetic_series import bias_splines
from tendonfmu.diagnosis.samples import Series
from tendonfmu.diagnosis.view import Confirmation
from tendonfmu.statistics.blocks import basis, make_folds, without
from tendonfmu.statistics.whitening import valid_rows, whitener

Numbers = NDArray[np.float64]


def confirmation(series: Series, nominal: Numbers) -> Confirmation:
    return Confirmation(series, make_folds(series), bias_splines(series), nominal)


def most(level: float, tests: int) -> int:
    """Rejections that are passed once in 1,000 times."""
    return int(binom.isf(1e-3, tests, level))


# --- the level --------------------------------------------------------------------------------------------------------


def by_chance(memory: float, wander: float, slowest: float, fastest: float) -> Numbers:
    """p-values of columns of one, two and four numbers that have nothing to do with the noise."""
    found = []
    nominal = waves(np.random.default_rng(1), 6)
    for seed in range(6):
        rng = np.random.default_rng([seed, 2])
        test = confirmation(series_with(coloured(rng, wander, memory) + nominal @ np.linspace(-3, 3, 6)), nominal)
        values = waves(rng, 12, slowest, fastest)
        parts = [[k] for k in range(12)] + [[k, k + 1] for k in range(0, 8, 2)] + [[8, 9, 10, 11]]
        found += [test.p_value(values[:, :, part], 1) for part in parts]
    return np.array(found)


@pytest.mark.parametrize(("memory", "wander"), repeated([(0.0, 0.0), (0.61, 0.02), (0.97, 0.0)], 1))
def test_noise_is_not_confirmed(memory: float, wander: float) -> None:
    """Of 102 columns of 0.1 to 3 Hz, in noise with a lag-one correlation up to 0.97."""
    found = by_chance(memory, wander, 0.1, 3.0)
    for level in (0.01, 0.05, 0.2):
        assert np.sum(found < level) <= most(level, len(found)), level
    assert np.mean(found < 0.5) > 0.1, "it never says anything"


def test_what_was_tried_counts() -> None:
    rng = np.random.default_rng(3)
    values = waves(rng, 1)
    test = confirmation(series_with(coloured(rng) + 0.15 * values[:, :, 0]), np.zeros((BLOCKS, JOINTS, 0)))
    one = test.p_value(values, 1)
    assert test.p_value(values, 100) == pytest.approx(100 * one)
    assert test.p_value(waves(rng, 1), 1000) == 1.0


# --- the power --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("memory", "size"), repeated([(0.0, 0.12), (0.61, 0.2), (0.97, 0.3)], 1))
def test_a_fraction_of_the_noise_is_confirmed(memory: float, size: float) -> None:
    """Amplitudes of 0.12 to 0.3 in noise of variance 1, 32 s; 400 tried."""
    found = []
    for seed in range(10):
        rng = np.random.default_rng([seed, 4])
        values, nominal = waves(rng, 1, 0.5, 3.0), waves(rng, 6)
        target = coloured(rng, 0.0, memory) + size * values[:, :, 0]
        found.append(confirmation(series_with(target), nominal).p_value(values, 400))
    assert np.mean(np.array(found) < 0.01) >= 0.9


# --- what is asked of it ----------------------------------------------------------------------------------------------


def test_columns_are_asked_for_together_and_their_scale_is_nothing() -> None:
    rng = np.random.default_rng(5)
    values = waves(rng, 3)
    test = confirmation(series_with(coloured(rng) + 0.3 * values[:, :, 1]), waves(rng, 4))
    whole = test.p_value(values, 1)
    assert whole < 1e-3
    turned = values @ np.linalg.qr(rng.standard_normal((3, 3)))[0] * 1e-6
    assert test.p_value(turned, 1) == pytest.approx(whole, rel=1e-3)
    # twice the same is asked once
    assert test.p_value(np.concatenate([values, values], axis=2), 1) == pytest.approx(whole, rel=1e-3)


def test_what_is_nuisance_is_nothing_new() -> None:
    rng = np.random.default_rng(6)
    nominal = waves(rng, 4)
    test = confirmation(series_with(coloured(rng) + 5.0 * nominal[:, :, 0]), nominal)
    assert test.p_value(np.zeros((BLOCKS, JOINTS, 1)), 1) == 1.0
    assert test.p_value(np.ones((BLOCKS, JOINTS, 1)), 1) > 0.01


def test_too_few_stretches_confirm_nothing() -> None:
    rng = np.random.default_rng(7)
    values = waves(rng, 2)[:500]
    target = coloured(rng)[:500] + 5.0 * values[:, :, 0]
    assert confirmation(series_with(target), np.zeros((500, JOINTS, 0))).p_value(values, 1) == 1.0


# --- noise and nuisance -----------------------------------------------------------------------------------------------


def test_whitened_noise_is_white_and_of_variance_one() -> None:
    noise = coloured(np.random.default_rng(1), wander=0.0)
    found = whitener(series_with(noise), noise)
    white = found.apply(noise)[found.valid]
    assert np.allclose(np.mean(white**2, axis=0), 1.0, atol=1e-6)
    for lag in (1, 2, 3, 5, 10, 40):
        correlation = np.mean(white[lag:] * white[:-lag], axis=0)
        assert np.all(np.abs(correlation) < 4.0 / np.sqrt(BLOCKS)), lag


def test_whitening_never_looks_across_gaps_or_unused_blocks() -> None:
    noise = coloured(np.random.default_rng(2))
    series = series_with(noise)
    series.segment[1000:] = 1
    series.used[2000:2010] = False
    found = whitener(series, noise)
    spoilt = noise.copy()
    spoilt[:1000] += 50.0  # the other stretch
    spoilt[2000:2010] += 50.0  # what is not used
    kept = found.valid & (np.arange(BLOCKS) >= 1000)
    assert kept.sum() > 1000
    assert np.array_equal(found.valid, valid_rows(series, 0) & found.valid)
    assert np.allclose(found.apply(spoilt)[kept], found.apply(noise)[kept], atol=1e-9)


def test_splines_take_a_slow_bias_and_leave_a_fast_one() -> None:
    series = series_with(np.zeros((BLOCKS, JOINTS)))
    span = basis(bias_splines(series).toarray())
    slow, fast = (np.sin(2 * np.pi * series.time / period)[:, None] for period in (20.0, 0.5))
    assert np.sum(without(slow, span) ** 2) < 1e-3 * np.sum(slow**2)
    assert np.sum(without(fast, span) ** 2) > 0.97 * np.sum(fast**2)
    trends = basis(bias_splines(series, 10.0).toarray())
    assert trends.shape[1] < span.shape[1] / 2
    middle = np.sin(2 * np.pi * series.time / 8.0)[:, None]
    assert np.sum(without(middle, trends) ** 2) > 0.5 * np.sum(middle**2) > 10.0 * np.sum(without(middle, span) ** 2)
    series.segment[1500:] = 1
    assert series.step == STEP
