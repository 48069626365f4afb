"""Held-out errors from Gram matrices are those of refitting by least squares; folds cut time where it may be cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from made_columns import BLOCKS, JOINTS, STEP, coloured, grams_of, series_with, waves
from synthetic_series import bias_splines
from tendonfmu.statistics.block_grams import MEMORY, Grams, Products, bounded, standard_error
from tendonfmu.statistics.blocks import basis, make_folds, without

Numbers = NDArray[np.float64]

FREE = np.full(3, -np.inf), np.full(3, np.inf)
MIX = np.eye(6)[:, [0, 2, 5]]


@pytest.fixture(scope="module")
def made() -> tuple[Numbers, Numbers, Numbers]:
    """Target [B, n], columns of the nominal model [B, n, 4] and of candidates [B, n, 6]."""
    rng = np.random.default_rng(1)
    nominal, values = waves(rng, 4), waves(rng, 6)
    target = coloured(rng) + nominal @ [1.0, -2.0, 0.5, 3.0] + 0.4 * values[:, :, 2]
    return target, nominal, values


def brute_force(
    target: Numbers, nominal: Numbers, chosen: Numbers, low: Numbers, high: Numbers, ridge: Numbers
) -> tuple[float, Numbers]:
    """Σ e² on each fold in turn with everything refitted without it, and its part of each stretch."""
    series = series_with(target)
    folds, splines = make_folds(series), basis(bias_splines(series).toarray())
    bare = [np.stack([without(each[:, j], splines) for j in range(JOINTS)], axis=1) for each in (nominal, chosen)]
    y = np.stack([without(target[:, j], splines) for j in range(JOINTS)], axis=1)
    columns, u = np.concatenate(bare, axis=2), nominal.shape[2]
    total, by_stretch = 0.0, np.zeros(folds.stretches)
    for number in range(folds.folds):
        own = folds.fold == number
        a, b = columns[~own].reshape(-1, columns.shape[2]), y[~own].reshape(-1)
        a = np.concatenate([a, np.sqrt(np.diag(np.concatenate([ridge, np.zeros(chosen.shape[2])])))[: len(ridge)]])
        b = np.concatenate([b, np.zeros(len(ridge))])
        bounds = np.concatenate([np.full(u, -np.inf), low]), np.concatenate([np.full(u, np.inf), high])
        found = lsq_linear(a, b, bounds, tol=1e-14).x
        left = np.sum((y[own] - columns[own] @ found) ** 2, axis=1)
        total += left.sum()
        by_stretch += np.bincount(folds.stretch[own], left, minlength=folds.stretches)
    return total, by_stretch


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("bound", [False, True])
def test_held_out_error_is_that_of_refitting(made: tuple[Numbers, Numbers, Numbers], known: bool, bound: bool) -> None:
    target, nominal, values = made
    scale = np.array([0.1, 0.2, np.nan, 0.1]) if known else np.full(4, np.nan)
    grams = grams_of(target, nominal, values, scale)
    # a number that is expected to be small weighs as much as MEMORY samples of noise would
    ridge = np.where(known & np.isfinite(scale), grams.square / target.size * MEMORY / scale**2, 0.0)
    low, high = (np.array([0.0, -np.inf, -0.01]), np.array([np.inf, 0.1, 0.01])) if bound else FREE
    error, magnitudes = grams.error(MIX, low, high)
    expected, by_stretch = brute_force(target, nominal, values @ MIX, low, high, ridge)
    assert error == pytest.approx(expected, rel=1e-5)  # columns are kept in single precision
    assert grams.by_stretch(MIX, magnitudes) == pytest.approx(by_stretch, rel=1e-3)
    none = grams_of(target, nominal, values[:, :, :0], scale)
    assert none.without == pytest.approx(grams.without)  # of a description that lacks nothing
    assert magnitudes.shape == (8, 3) and np.all(magnitudes >= low) and np.all(magnitudes <= high)
    assert (np.max(magnitudes[:, 1]) == 0.1) == bound
    nothing = brute_force(target, nominal, values[:, :, :0], *(np.zeros(0),) * 2, ridge)[0]
    assert grams.without == pytest.approx(nothing, rel=1e-5)
    assert grams.by_stretch(None, None).sum() == pytest.approx(nothing, rel=1e-5)


def test_errors_of_other_targets_are_those_of_their_own_grams(made: tuple[Numbers, Numbers, Numbers]) -> None:
    target, nominal, values = made
    others = np.stack([target, target + values[:, :, 1], 2.0 * target], axis=2)
    found = grams_of(target, nominal, values).errors_of(others)
    expected = [grams_of(others[:, :, k], nominal, values).without for k in range(3)]
    assert found == pytest.approx(expected, rel=1e-5)


def test_surviving_share_is_what_refitting_leaves(made: tuple[Numbers, Numbers, Numbers]) -> None:
    target, nominal, values = made
    twin = 2.0 * nominal[:, :, 0] + 0.1 * values[:, :, 0]
    grams = grams_of(target, nominal, np.concatenate([values, twin[:, :, None]], axis=2))
    splines = basis(bias_splines(series_with(target)).toarray())

    def bare(columns: Numbers) -> Numbers:
        return np.stack([without(columns[:, j], splines) for j in range(JOINTS)], axis=1).reshape(-1, columns.shape[2])

    span = basis(bare(nominal))
    for column, mix in ((values[:, :, :1], np.eye(7)[:, :1]), (twin[:, :, None], np.eye(7)[:, 6:])):
        whole = bare(column)
        share = np.sum(without(whole, span) ** 2) / np.sum(whole**2)
        assert grams.surviving(mix) == pytest.approx(share, rel=1e-3)
    assert 1e-4 < grams.surviving(np.eye(7)[:, 6:]) < 0.01
    # of two directions the one that survives best counts
    assert grams.surviving(np.eye(7)[:, [0, 6]]) >= grams.surviving(np.eye(7)[:, :1]) - 1e-9
    assert grams.surviving(np.zeros((7, 1))) == 0.0


def test_ordinary_gain_is_what_adding_the_effect_and_correcting_it_shows(
    made: tuple[Numbers, Numbers, Numbers],
) -> None:
    target, nominal, values = made
    size = 1.5 * float(np.std(target))
    before = grams_of(target, nominal, values)
    found = before.ordinary_gain(np.eye(6)[:, :1], np.array([size]))
    with_it = grams_of(target + size * values[:, :, 0], nominal, values)
    assert found == pytest.approx(1.0 - np.sqrt(before.without / with_it.without), rel=0.1)
    assert before.ordinary_gain(np.eye(6)[:, :2], np.array([size, 0.0])) < found
    assert before.ordinary_gain(np.zeros((6, 1)), np.array([size])) == 0.0


def test_residual_and_magnitudes_are_those_of_one_fit_of_everything(made: tuple[Numbers, Numbers, Numbers]) -> None:
    target, nominal, values = made
    grams = grams_of(target, nominal, values)
    found = grams.magnitudes(np.eye(6), np.full(6, -np.inf), np.full(6, np.inf))
    assert found[2] == pytest.approx(0.4, abs=0.05)
    assert standard_error([1.0]) == np.inf
    assert np.abs(np.delete(found, 2)).max() < 0.1
    splines = basis(bias_splines(series_with(target)).toarray())
    y = np.stack([without(target[:, j], splines) for j in range(JOINTS)], axis=1)
    own = np.stack([without(nominal[:, j], splines) for j in range(JOINTS)], axis=1).reshape(-1, 4)
    left = without(y.reshape(-1), basis(own)).reshape(y.shape)
    assert grams.residual() == pytest.approx(left, abs=1e-4 * left.std())


def test_what_lies_in_the_bias_is_nothing(made: tuple[Numbers, Numbers, Numbers]) -> None:
    target, nominal, values = made
    slow = np.sin(2 * np.pi * np.arange(BLOCKS) * STEP / 60.0)[:, None].repeat(JOINTS, axis=1)
    plain, shifted = grams_of(target, nominal, values), grams_of(target + 100.0 * slow, nominal, values)
    assert shifted.without == pytest.approx(plain.without, rel=1e-2)
    constant = np.concatenate([values, np.ones((BLOCKS, JOINTS, 1))], axis=2)
    grams = grams_of(target, nominal, constant)
    assert grams.surviving(np.eye(7)[:, 6:]) == 0.0
    assert grams.error(np.eye(7)[:, 6:], FREE[0][:1], FREE[1][:1])[0] == pytest.approx(grams.without)


@pytest.mark.parametrize("seed", range(4))
def test_bounded_is_bounded_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((50, 6)) @ np.diag(10.0 ** rng.uniform(-4, 4, 6))
    b = a @ (rng.standard_normal(6) / np.sqrt(np.sum(a**2, axis=0)) * 7.0) + 0.1 * rng.standard_normal(50)
    size = 1.0 / np.sqrt(np.sum(a**2, axis=0))
    low = np.where(rng.uniform(size=6) < 0.5, -np.inf, -rng.uniform(0, 1, 6) * size)
    high = np.where(rng.uniform(size=6) < 0.5, np.inf, rng.uniform(0, 1, 6) * size)
    found = bounded((a.T @ a)[None], (a.T @ b)[None], low, high)[0]
    assert np.all(found >= low - 1e-12 * size) and np.all(found <= high + 1e-12 * size)
    best = lsq_linear(a, b, (low, high), tol=1e-14)
    # numbers are set to their bounds one after another: near the best, not always it
    assert 0.5 * np.sum((a @ found - b) ** 2) <= best.cost * 1.05 + 1e-9


# --- folds ------------------------------------------------------------------------------------------------------------


def test_folds_are_contiguous_and_alike() -> None:
    folds = make_folds(series_with(np.zeros((BLOCKS, JOINTS))))
    assert (folds.stretches, folds.folds, folds.enough) == (16, 8, True)
    assert np.all(np.diff(folds.stretch) >= 0) and np.all(np.diff(folds.fold) >= 0)
    sizes = np.bincount(folds.stretch)
    assert sizes.min() == sizes.max() == 200
    assert set(np.bincount(folds.fold)) == {400}


def test_no_stretch_reaches_across_a_gap() -> None:
    series = series_with(np.zeros((BLOCKS, JOINTS)))
    series.segment[1100:] = 1
    series.used[500:560] = False
    folds = make_folds(series)
    assert len(folds.rows) == BLOCKS - 60
    assert not np.any((folds.rows >= 500) & (folds.rows < 560))
    for edge in (500, 1100):
        before, after = folds.stretch[folds.rows < edge], folds.stretch[folds.rows >= edge]
        assert before.max() < after.min()
    assert folds.run.max() == 2


@pytest.mark.parametrize(
    ("seconds", "stretches", "folds"), [(1.0, 1, 1), (5.0, 2, 1), (9.0, 4, 2), (16.0, 8, 4), (0.0, 0, 0)]
)
def test_short_recordings_have_fewer_folds(seconds: float, stretches: int, folds: int) -> None:
    series = series_with(np.zeros((round(seconds / STEP) or 300, JOINTS)))
    found = make_folds(series if seconds else replace(series, used=np.zeros(300, dtype=bool)))
    assert (found.stretches, found.enough) == (stretches, stretches >= 4)
    assert found.folds == folds or not seconds


def test_unused_blocks_do_not_matter(made: tuple[Numbers, Numbers, Numbers]) -> None:
    target, nominal, values = made
    series = series_with(target)
    series.used[700:900] = False
    splines = bias_splines(series)

    def grams(spoilt: float) -> Grams:
        own = [each.copy() for each in (target, nominal, values)]
        for each in own:
            each[700:900] += spoilt
        return Grams(Products(make_folds(series), own[1], own[2], splines), own[0], np.full(4, np.nan))

    assert grams(1e3).error(MIX, *FREE)[0] == grams(0.0).error(MIX, *FREE)[0]
