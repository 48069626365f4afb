"""The statistics of a diagnosis: on columns and noise made here, and once from recording to named cause."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from fit_cases import plain
from fit_data import make_recording, wavy_forces, wavy_motion
from tendonfmu import significance
from tendonfmu.balance import moment_arms
from tendonfmu.cause_search import bias_of, blocks_of, predicted_of, series_of
from tendonfmu.description import FingerDescription
from tendonfmu.diagnosis_search import search
from tendonfmu.diagnosis_series import Bank, Columns, Series, Trial, block_prediction, exact_model, make_grid
from tendonfmu.fit_recordings import FitRecording, Held, prepare
from tendonfmu.naming import Judged, Selection, alike, held_out_gains, judge, null_p_value
from tendonfmu.native import image_from_json
from tendonfmu.nuisance import basis, bias_splines, constant_bias, without
from tendonfmu.recording import Recording
from tendonfmu.significance import Problem, effective_blocks, family_wise, residual_of
from tendonfmu.significance import prepare as prepared_of
from tendonfmu.whitening import valid_rows, whitener

STEP = 0.01
BLOCKS = 3000
JOINTS = 2

Array = Any


def waves(rng: np.random.Generator, count: int, slowest: float = 0.1, fastest: float = 3.0) -> Array:
    """[B, n, c] sums of sines, some of them as slow as the bias."""
    time = STEP * np.arange(BLOCKS)[:, None, None, None]
    frequency = np.exp(rng.uniform(np.log(slowest), np.log(fastest), (JOINTS, count, 4)))
    phase = rng.uniform(0, 2 * np.pi, (JOINTS, count, 4))
    return np.sin(2 * np.pi * frequency * time + phase).sum(axis=3)


def coloured(rng: np.random.Generator, wander: float = 0.02) -> Array:
    """[B, n] noise that remembers 20 ms, and a random walk."""
    a = np.exp(-STEP / 0.02)
    noise = lfilter([np.sqrt(1 - a * a)], [1, -a], rng.standard_normal((BLOCKS, JOINTS)), axis=0)
    return noise + np.cumsum(wander * rng.standard_normal((BLOCKS, JOINTS)), axis=0)


def series_with(target: Array) -> Series:
    time = STEP * (np.arange(BLOCKS) + 0.5)
    one, many = np.zeros((BLOCKS, JOINTS)), np.zeros((BLOCKS, 4))
    return Series(
        time=time, recording=np.zeros(BLOCKS, dtype=np.int64), segment=np.zeros(BLOCKS, dtype=np.int64), target=target,
        used=np.ones(BLOCKS, dtype=bool), step=STEP, angle=one, velocity=one, acceleration=one, force=many,
        tendon_velocity=np.zeros((BLOCKS, 4, JOINTS)), travel=one,
    )  # fmt: skip


def bank_of(values: Array, sizes: list[int], signs: int = 0) -> Bank:
    firsts = np.cumsum([0, *sizes])[:-1]
    trials = tuple(
        Trial(f"effect_{k}", k + 1, None, (signs,) * size, {}, int(first), size)
        for k, (first, size) in enumerate(zip(firsts, sizes, strict=True))
    )
    return Bank(Columns(values.astype(np.float32), tuple(map(str, range(values.shape[2])))), trials)


def made_problem(target: Array, values: Array, sizes: list[int], nominal: Array) -> Problem:
    series = series_with(target)
    return Problem(series, bank_of(values, sizes), bias_splines(series), nominal)


@pytest.fixture(scope="module")
def columns() -> tuple[Array, Array]:
    """Of candidates [B, n, 24] and of the nominal model [B, n, 8]."""
    rng = np.random.default_rng(5)
    return waves(rng, 24), waves(rng, 8)


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
    span = basis(bias_splines(series))
    slow, fast = (np.sin(2 * np.pi * series.time / period)[:, None] for period in (20.0, 0.5))
    assert np.sum(without(slow, span) ** 2) < 1e-3 * np.sum(slow**2)
    assert np.sum(without(fast, span) ** 2) > 0.97 * np.sum(fast**2)
    series.segment[1500:] = 1
    assert np.array_equal(constant_bias(series).sum(axis=0), [1500, 1500])


def test_basis_leaves_out_what_is_there_already() -> None:
    values = np.random.default_rng(3).standard_normal((400, 3))
    double = np.column_stack([values, values @ [1.0, -2.0, 0.5], np.zeros(400)])
    span = basis(double)
    assert span.shape == (400, 3)
    assert np.allclose(span.T @ span, np.eye(3), atol=1e-12)
    assert np.allclose(without(double, span), 0.0, atol=1e-9)


def test_prepared_columns_are_free_of_all_nuisance(columns: tuple[Array, Array]) -> None:
    values, nominal = columns
    values = np.concatenate([values[:, :, :2], nominal[:, :, :1] * 3.0], axis=2)
    found = prepared_of(made_problem(coloured(np.random.default_rng(4)), values, [1, 1, 1], nominal))
    power = np.einsum("vnc,vnc->c", found.columns, found.columns)
    assert power[2] < 1e-6 * power[0], "a nominal column is nothing new"


# --- significance -----------------------------------------------------------------------------------------------------


def test_p_values_keep_what_they_promise_under_noise_that_remembers(columns: tuple[Array, Array]) -> None:
    values, nominal = columns
    sizes = [1] * 12 + [2] * 6
    p_values = []
    for seed in range(30):
        target = coloured(np.random.default_rng([seed, 1])) + nominal @ np.linspace(-3, 3, 8)
        found = judge(
            prepared_of(made_problem(target, values, sizes, nominal)), bank_of(values, sizes).trials, [True] * 18, seed
        )
        p_values.append(null_p_value(found))
    # binomial bounds of 1 in 1000: at p = 0.02, 0.1 and 0.3
    assert np.sum(np.array(p_values) < 0.02) <= 4
    assert np.sum(np.array(p_values) < 0.1) <= 9
    assert 5 <= np.sum(np.array(p_values) < 0.5) <= 25


def test_the_nuisance_does_not_hide_the_noise_of_slow_columns() -> None:
    """Without CR2 the variance of a score that is hardly faster than the splines comes out far too small."""
    rng = np.random.default_rng(6)
    values = waves(rng, 8, 0.2, 0.35)
    problem = made_problem(coloured(rng, 0.0), values, [1] * 8, np.zeros((BLOCKS, JOINTS, 0)))
    totals, shrunk, given_back = [], [], []
    for seed in range(20):
        noise = np.random.default_rng([seed, 2]).standard_normal((BLOCKS, JOINTS))
        found = prepared_of(replace(problem, series=replace(problem.series, target=noise)))
        totals.append(found.scores.sum(axis=0) ** 2)
        shrunk.append((found.scores**2).sum(axis=0))
        given_back.append((found.unshrunk_scores**2).sum(axis=0))
    true, before, after = (np.mean(each) for each in (totals, shrunk, given_back))
    assert before < 0.8 * true
    assert after == pytest.approx(true, rel=0.25)


def test_an_effect_is_found_named_and_put_in_no_needless_set(columns: tuple[Array, Array]) -> None:
    values, nominal = columns
    noise = coloured(np.random.default_rng(7))
    problem = made_problem(noise + 0.25 * values[:, :, 3], values, [1] * 24, nominal)
    found = Selection(problem, [True] * 24).run()
    assert [each.trial.effect for each in found] == ["effect_3"]
    assert found[0].p_value < 1e-4
    assert found[0].magnitudes[0] == pytest.approx(0.25, rel=0.2)
    assert found[0].alike == ()


def test_what_cannot_be_told_apart_is_said(columns: tuple[Array, Array]) -> None:
    values, nominal = columns
    twin = values[:, :, 3] + 0.02 * values[:, :, 4]
    values = np.concatenate([values[:, :, :8], twin[:, :, None]], axis=2)
    target = coloured(np.random.default_rng(8)) + 0.25 * values[:, :, 3]
    problem = made_problem(target, values, [1] * 9, nominal)
    found = Selection(problem, [True] * 9).run()
    assert len(found) == 1
    named = {found[0].trial.effect, *(trial.effect for trial in found[0].alike)}
    assert named == {"effect_3", "effect_8"}


def test_two_causes_are_found_where_one_hides_the_other(columns: tuple[Array, Array]) -> None:
    """A third column, the sum of both, fits best at first; any two of the three then explain all."""
    values, nominal = columns
    both = values[:, :, 1] + values[:, :, 2]
    values = np.concatenate([values[:, :, :8], both[:, :, None]], axis=2)
    target = coloured(np.random.default_rng(9)) + 0.3 * values[:, :, 1] + 0.7 * values[:, :, 2]
    selection = Selection(made_problem(target, values, [1] * 9, nominal), [True] * 9)
    first = selection.given([])
    assert max(first.gains, key=lambda place: first.gains[place].sum())[0] == "effect_8"
    found = {each.trial.effect for each in selection.run()}
    assert len(found) == 2
    assert found < {"effect_1", "effect_2", "effect_8"}


def test_sign_says_what_a_magnitude_may_be(columns: tuple[Array, Array]) -> None:
    values, nominal = columns
    target = coloured(np.random.default_rng(10)) - 0.25 * values[:, :, 0]
    series = series_with(target)
    for sign, found in ((1, False), (-1, True), (0, True)):
        problem = Problem(series, bank_of(values[:, :, :1], [1], sign), bias_splines(series), nominal)
        assert bool(Selection(problem, [True]).run()) == found, sign


def test_held_out_gain_of_noise_is_a_loss() -> None:
    rng = np.random.default_rng(11)
    gram = np.tile(np.eye(3) * 50.0, (30, 1, 1))
    gains = [held_out_gains(rng.standard_normal((30, 3)) * np.sqrt(50.0), gram, (0, 0, 0))[0].sum() for _ in range(200)]
    assert np.mean(gains) < 0
    score = 25.0 + rng.standard_normal((30, 3)) * np.sqrt(50.0)
    assert held_out_gains(score, gram, (0, 0, 0))[0].sum() > 0
    assert held_out_gains(score, gram, (-1, -1, -1))[0].sum() == 0.0


def test_tail_goes_beyond_the_draws_and_never_below_a_single_test() -> None:
    rng = np.random.default_rng(12)
    least = rng.uniform(size=(2000, 30)).min(axis=1)
    asked = np.array([1e-9, 1e-6, 1e-4, 0.01, 0.5])
    found = family_wise(asked, least)
    assert np.all(np.diff(found) >= 0)
    assert np.all(found >= asked)
    for single, family in zip(asked[:3], found[:3], strict=True):
        assert 30 * single / 5 < family < (30 * single) * 60, single
    assert found[3] == pytest.approx(1 - 0.99**30, abs=0.05)


def test_visits_count_blocks_that_share_the_energy() -> None:
    energy = np.zeros((20, 1, 1))
    energy[:5] = 2.0
    assert effective_blocks(energy) == pytest.approx(5.0)


def test_equal_gains_are_alike_and_clear_ones_are_not() -> None:
    rng = np.random.default_rng(13)
    gain = 3.0 + rng.standard_normal(40)
    places = [("a", 1, None), ("b", 1, None), ("c", 1, None)]
    gains = {places[0]: gain, places[1]: gain + 0.3 * rng.standard_normal(40) - 0.02, places[2]: gain - 1.0}
    nothing = significance.Tested(np.zeros(0), np.zeros(0), np.zeros(0), 0)
    judged = Judged(gains, dict.fromkeys(places, 0), dict.fromkeys(places, 1e-6), nothing, {})
    assert alike(judged, places[0]) == [places[1]]


# --- from recordings --------------------------------------------------------------------------------------------------


def finger() -> dict[str, Any]:
    arms = [[0.009, 0.006], [0.009, -0.006], [-0.008, 0.005], [-0.008, -0.005]]
    tendons = [
        {"name": f"t{i}", "stiffness": 4000.0, "moment_arms": row, "edge_friction": [plain(0.03, 0.004), None]}
        for i, row in enumerate(arms, start=1)
    ]
    return {
        "format": "tendonfmu-finger-1", "name": "nominal", "tendons": tendons,
        "joints": [{"name": "a", "friction": plain(0.006, 0.08)}, {"name": "b", "friction": plain(0.004, 0.08)}],
        "bias": {"drift_variance": 1e-6, "noise_std": 0.002, "forget_rate": 3.0}, "contact": {"threshold": [1.0, 1.0]},
    }  # fmt: skip


@pytest.fixture(scope="module")
def hidden() -> FitRecording:
    """40 s in which the second joint has a cover that the description lacks; the noise is in the forces."""
    truth = copy.deepcopy(finger())
    truth["joints"][1]["cover"] = {"stiffness": 0.02}
    motion = wavy_motion(21, 40.0, 200.0, 2)
    made = make_recording(truth, motion, wavy_forces(21, motion["time"], 4), 21, noise_in_forces=True)
    groups = dict(made.recording)
    recording = Recording(Path("made.parquet"), groups.pop("time"), groups)
    text = json.dumps(finger()).encode()
    given = FingerDescription(Path("finger.json"), text, finger(), image_from_json(text))
    return prepare(given, recording, 3, Held())


def test_predicted_forces_lack_exactly_the_unexplained_torque(hidden: FitRecording) -> None:
    grid = make_grid([hidden])
    series = series_of(finger(), [hidden], grid)
    predicted = predicted_of(finger(), [hidden], grid, series)[0]
    arms = moment_arms(finger())
    taken = (hidden.recording.groups["tendon_force"] - predicted.recording.groups["tendon_force"]) @ arms
    nothing = np.zeros((*series.target.shape, 0))
    left = residual_of(series, bias_of(finger(), series), nothing)
    blocks = grid.segments[0].mean(taken[grid.segments[0].part])
    assert np.abs(blocks - left).max() < 0.2 * left.std()
    assert np.corrcoef(blocks[:, 0], left[:, 0])[0, 1] > 0.99
    stretch = (hidden.recording.groups["tendon_position"] - predicted.recording.groups["tendon_position"]) * 4000.0
    force = hidden.recording.groups["tendon_force"] - predicted.recording.groups["tendon_force"]
    assert np.allclose(stretch, force, atol=1e-9), "angles stay as they were measured"


def test_blocks_are_those_of_the_candidates(hidden: FitRecording) -> None:
    grid = make_grid([hidden])
    blocks = blocks_of(grid, [hidden])
    assert blocks.count == grid.blocks == len(series_of(finger(), [hidden], grid).time)
    exact = exact_model(finger(), hidden)
    means = np.array([exact[blocks.of[0] == k].mean(axis=0) for k in (0, 7, grid.blocks - 1)])
    assert np.allclose(block_prediction(finger(), [hidden], grid)[[0, 7, -1]], means, atol=1e-15)


def test_a_hidden_spring_is_found_and_fitted(hidden: FitRecording) -> None:
    found = search(finger(), [hidden], 1, lambda what, done, total: None, 1)
    first = found.causes[0]
    named = [first.found.trial, *first.found.alike]
    assert ("cover_stiffness", 2, None) in [trial.place for trial in named]
    assert len(found.causes) == 1
    assert first.found.p_value < 1e-3
    if first.found.trial.effect == "cover_stiffness":
        assert found.extended.data["joints"][1]["cover"]["stiffness"] == pytest.approx(0.02, rel=0.2)
    used = found.last.series.used
    assert np.mean(found.last.residual[used] ** 2) < np.mean(found.first.residual[used] ** 2)
