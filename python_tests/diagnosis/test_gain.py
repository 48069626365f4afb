"""The refit with causes and the gain: the FMUs' residuals are those of step 5, the gain and its interval are true."""

from __future__ import annotations

import copy
import json
import math
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import binom

from fit_cases import lasting_finger
from fit_data import make_recording, wavy_forces, wavy_motion
from repository_paths import ROOT
from tendonfmu.diagnosis.change_search import gain_of, interval_of
from tendonfmu.diagnosis.contact_scan import detection_gain
from tendonfmu.diagnosis.effects import MECHANISMS, Place, Term
from tendonfmu.diagnosis.extension_fit import (
    FitSettings,
    cause_parameters,
    fit_extended,
    fit_numbers,
    intervals_of,
)
from tendonfmu.diagnosis.gain import Unseen, measure_gain, require_unseen
from tendonfmu.diagnosis.samples import Samples
from tendonfmu.errors import InputError
from tendonfmu.model.description import Finger, read_finger
from tendonfmu.recordings.prepared import FitRecording, Held, prepare
from tendonfmu.recordings.recording import Recording, read_recording
from tendonfmu.statistics.intervals import blocks_of, gain_interval

Array = NDArray[Any]
EXAMPLES = ROOT / "examples"
NOISE = 0.002


def described(data: dict[str, Any]) -> Finger:
    return Finger(Path("finger"), data)


def nominal() -> dict[str, Any]:
    return lasting_finger(noise_std=NOISE, drift_variance=1e-10, forget_rate=0.0)


def hidden(*rows: dict[str, Any]) -> dict[str, Any]:
    return {**nominal(), "extensions": list(rows)}


@lru_cache
def recorded(truth: str, seed: int, seconds: float = 30.0, rate: float = 100.0) -> Recording:
    """Made by the core of a description (JSON), kinematics source 3."""
    motion = wavy_motion(seed, seconds, rate, 2)
    made = make_recording(json.loads(truth), motion, wavy_forces(seed, motion["time"], 4), seed)
    groups = dict(made.recording)
    return Recording(Path(f"made_{seed}"), groups.pop("time"), groups)


def prepared(truth: dict[str, Any], seed: int, holdout: float = 0.0, seconds: float = 30.0) -> FitRecording:
    return prepare(described(nominal()), recorded(json.dumps(truth), seed, seconds), 3, Held(holdout, 2.0))


def accepted(name: str, place: Place, magnitudes: list[float], **shape: float) -> Term:
    candidate = next(each for each in MECHANISMS if each.name == name)
    return Term(candidate, place, shape, magnitudes)


# --- the interval -----------------------------------------------------------------------------------------------------


def coloured(rng: np.random.Generator, seconds: float, rate: float) -> tuple[Array, Array, Array]:
    """time, residual of a nominal model and of an extended one: noise of 0.1 s, an effect that follows slow motion."""
    samples = int(seconds * rate)

    def remembering(time: float, columns: int) -> Array:
        keep = np.exp(-1 / (rate * time))
        start = int(5 * time * rate)
        noise = rng.standard_normal((samples + start, columns))
        return np.asarray(lfilter([np.sqrt(1 - keep**2)], [1, -keep], noise, axis=0)[start:])

    motion, noise = remembering(1.0, 2), remembering(0.1, 2)
    noise *= 0.6 + 0.4 * np.abs(motion)
    return np.arange(samples) / rate, noise + 0.7 * np.sign(motion), noise + 0.05 * motion


@pytest.mark.long
def test_the_interval_covers_the_true_gain() -> None:
    rng = np.random.default_rng(7)
    _, before, after = coloured(rng, 20_000.0, 50.0)
    true = 1 - np.sqrt(np.sum(after**2) / np.sum(before**2))
    covered, below, naive = 0, 0, 0
    cases = 200
    for _ in range(cases):
        time, before, after = coloured(rng, 60.0, 50.0)
        blocks = blocks_of(time, np.ones(len(time), dtype=bool))
        squares = [np.sum(each**2, axis=1) for each in (before, after)]
        found = gain_interval(blocks.sums(squares[0]), blocks.sums(squares[1]))
        covered += found.low <= true <= found.high
        below += true < found.low
        # samples taken for independent: what the blocks are for
        ratio = (squares[1] / squares[1].sum() - squares[0] / squares[0].sum()) / 2
        reach = 1.96 * np.sqrt(np.sum(ratio**2)) * (1 - found.value)
        naive += found.value - reach <= true <= found.value + reach
    assert 0.92 <= covered / cases <= 0.98
    assert 0.005 <= below / cases <= 0.06
    assert naive / cases < 0.85


def test_a_gain_is_that_of_the_rms() -> None:
    before, after = np.array([4.0, 8.0, 4.0, 4.0]), np.array([1.0, 2.0, 1.0, 1.0])
    found = gain_interval(before, after)
    assert found.value == pytest.approx(0.5)
    assert found.low == pytest.approx(0.5) and found.high == pytest.approx(0.5)  # the same in every block
    assert np.isnan(gain_interval(before[:2], after[:2]).low)
    assert gain_interval(np.zeros(4), np.zeros(4)).value == 0.0


def test_blocks_do_not_pass_over_what_is_left_out() -> None:
    time = np.arange(4000) / 100
    chosen = np.ones(4000, dtype=bool)
    chosen[1450:1550] = False
    chosen[3000:3010] = False
    blocks = blocks_of(time, chosen)
    assert (blocks.index[~chosen] == -1).all() and (blocks.index[chosen] >= 0).all()
    sizes = np.bincount(blocks.index[chosen], minlength=blocks.count)
    assert sizes.min() >= 150 and sizes.max() <= 300
    for k in range(blocks.count):
        rows = np.flatnonzero(blocks.index == k)
        assert rows[-1] - rows[0] + 1 == len(rows)
    assert blocks.sums(np.ones(4000)).sum() == chosen.sum()


# --- refit and gain ---------------------------------------------------------------------------------------------------


def test_a_hidden_effect_is_fitted_and_its_gain_is_true() -> None:
    """Two causes, one of them not there: sizes, gains of each, and the gain on far more data of the same kind."""
    truth = hidden({"effect": "cover_hardening", "joint": 1, "stiffness": 1.0})
    training, test = prepared(truth, 1), prepared(truth, 2)
    samples, settings = Samples.of(nominal(), [training]), FitSettings(threads=1)
    before = fit_numbers(nominal(), samples, settings)
    causes = [accepted("cover_hardening", Place(1), [0.5, 0.5]), accepted("inertia", Place(2), [0.0001])]
    found = fit_extended(before, causes, samples, settings)
    parameters = cause_parameters(before.data, causes, found)
    value, unit = parameters[0]["extensions[1].stiffness"]
    assert value == pytest.approx(1.0, rel=0.2) and unit == "N.m/rad3"
    assert list(parameters[1]) == ["extensions[2].inertia"]
    intervals = intervals_of(found, samples, settings)
    for path, true in (("extensions[1].stiffness", 1.0), ("extensions[2].inertia", 0.0)):
        assert intervals[path].low <= true <= intervals[path].high
    assert intervals["extensions[1].stiffness"].high < 3.0
    without = [fit_extended(before, [other], samples, settings).data for other in causes[::-1]]
    result = measure_gain(before.data, found.data, [training], [test], between=[without[1]])
    unseen = Unseen(before.data, [training], [test])
    gains = [unseen.gain(each, found.data, 0) for each in without]
    assert gains[0].low > 0.1 and gains[1].high < 0.05
    assert result.gain.value > 0.0 and not result.held_out
    first, _, last = result.steps
    assert 1 - last / first == pytest.approx(result.gain.value)
    assert result.steps[1] == pytest.approx(last, rel=0.05)
    assert all(a < b for a, b in zip(result.extended.test_rms, result.bias_only_rms, strict=True))
    blocks = measure_gain(before.data, found.data, [prepared(truth, 1, holdout=0.3)])
    assert blocks.held_out and blocks.gain.low > 0


def test_a_bias_does_not_hide_what_is_slow() -> None:
    """A missing spring is seen in full; r, which the bias follows, shows a part of it."""
    covered, bare = (lasting_finger(noise_std=NOISE, drift_variance=1e-3, forget_rate=0.0) for _ in range(2))
    cover = covered["joints"][1].get("cover") or {}
    covered["joints"][1]["cover"] = {**cover, "stiffness": cover.get("stiffness", 0.0) + 0.02}
    quiet = {**covered, "bias": {**covered["bias"], "drift_variance": 1e-10}}
    test = prepared(quiet, 2)
    result = measure_gain(bare, covered, [prepared(quiet, 1)], [test])
    angle = test.model.joint_angle[test.tracked, 1]
    assert result.nominal.test_rms[1] > 0.8 * 0.02 * angle.std()
    assert result.delivered[0].test_rms[1] < 0.6 * result.nominal.test_rms[1]


def test_a_number_that_was_driven_to_nothing_comes_back() -> None:
    """Its expected size is that of the description that was given, not what is left of it."""
    samples = Samples.of(nominal(), [prepared(nominal(), 1)])
    starved = copy.deepcopy(nominal())
    law = starved["joints"][0]["friction"]
    law["static"], law["coulomb"] = 1e-9 + law["static"] - law["coulomb"], 1e-9
    settings = FitSettings(threads=1)
    path = "joints[1].friction.coulomb"
    known = fit_numbers(nominal(), samples, settings).values[path]
    assert fit_numbers(starved, samples, settings, given=nominal()).values[path] == pytest.approx(known, rel=0.2)
    assert fit_numbers(starved, samples, settings).values[path] < 1e-4 * known  # pinned to what it starts from


def test_a_described_row_is_fitted_whole() -> None:
    """A cover that hardens about another angle than described: the number that says so was not described."""
    spring = {"effect": "cover_hardening", "joint": 1, "stiffness": 1.0}
    samples = Samples.of(hidden(spring), [prepared(hidden(spring | {"quadratic": -0.3}), 1)])
    found = fit_numbers(hidden(spring), samples, FitSettings(threads=1)).values
    assert found["extensions[1].quadratic"] == pytest.approx(-0.3, rel=0.2)


def test_a_constant_bias_is_fitted() -> None:
    """A fit that leaves slow errors out of its residual still says what they are on average."""
    made, before = prepared(nominal(), 1), nominal()
    before["bias"]["initial_torque"] = [0.0, 0.0]
    torque = made.recording.groups["external_torque"] + np.array([0.05, -0.03])
    samples = Samples.of(before, [made.with_groups(external_torque=torque)])
    data = fit_numbers(before, samples, FitSettings(threads=1)).data
    assert data["bias"]["initial_torque"] == pytest.approx([-0.05, 0.03], abs=0.002)


def test_what_cannot_be_compared_is_refused() -> None:
    with pytest.raises(InputError, match="no sample to measure the gain on"):
        require_unseen([prepared(nominal(), 1)], [])


# --- detection --------------------------------------------------------------------------------------------------------


def test_detection_before_and_after() -> None:
    """Half the friction of a finger that was recorded with pushes: tuned alike, the true one finds more, or sooner."""
    finger = read_finger(EXAMPLES / "fingers" / "index_finger.json")
    files = ("index_finger_free.parquet", "index_finger_pushes.parquet")
    recordings = [prepare(finger, read_recording(EXAMPLES / "demo_recording" / each), 1, Held()) for each in files]
    poor = copy.deepcopy(dict(finger.data))
    for tendon in poor["tendons"]:
        tendon.pop("edge_friction", None)
        tendon.pop("pulley_friction", None)
    found = detection_gain(poor, finger.data, recordings)
    assert found is not None and found.events > 5
    assert (found.found_after, -found.false_alarms_after) >= (found.found_before, -found.false_alarms_before)
    both = list(zip(found.smallest_push_after, found.smallest_push_before, strict=True))
    known = [(after, before) for after, before in both if not math.isnan(after + before)]  # in one minute few pushes
    assert known and all(after < before for after, before in known)
    assert detection_gain(poor, finger.data, recordings[:1]) is None


# --- the gain of a change ---------------------------------------------------------------------------------------------

STRETCHES, ROWS, JOINTS = 24, 200, 2  # 2 s each, in blocks of 10 ms
MEMORY = 0.9  # of the noise from block to block, 0.1 s
DRAWS = 300


def difference(strength: float) -> tuple[Array, NDArray[np.int64]]:
    """[r, n] what a change makes of a motion that is uneven from stretch to stretch, and [r] stretch."""
    time = np.arange(STRETCHES * ROWS)
    stretch = time // ROWS
    uneven = np.random.default_rng(4).uniform(0.2, 1.8, STRETCHES)[stretch]
    return strength * (uneven * np.sign(np.sin(time / 37.0)))[:, None] * np.array([1.0, 0.4]), stretch


def noise(rng: np.random.Generator) -> Array:
    """[r, n] of variance 1 with a memory."""
    white = np.sqrt(1 - MEMORY**2) * rng.standard_normal((STRETCHES * ROWS + 100, JOINTS))
    return np.asarray(lfilter([1.0], [1.0, -MEMORY], white, axis=0)[100:])


@pytest.mark.parametrize("strength", [0.2, 0.5, 1.5])
def test_the_interval_covers_the_gain_of_this_motion(strength: float) -> None:
    """The true gain: of this motion and the noise's own variance. Of 300 intervals of 95 % as many hold it as a
    binomial number does in all but one of 10,000 tries; on both sides."""
    rng = np.random.default_rng(11)
    made, stretch = difference(strength)
    true = 1.0 - np.sqrt(JOINTS / (JOINTS + float(np.mean(np.sum(made**2, axis=1)))))
    found = []
    for _ in range(DRAWS):
        left = noise(rng)
        # the noise's own variance differs from draw to draw, which is no matter of the change
        left *= np.sqrt(JOINTS / np.mean(np.sum(left**2, axis=1)))
        found.append(interval_of(left + made, left, stretch))
    covered = sum(each.low <= true <= each.high for each in found)
    fewest, most = binom.ppf([5e-5, 1 - 5e-5], DRAWS, 0.95)
    assert fewest <= covered <= most, covered
    assert sum(true < each.low for each in found) <= binom.ppf(1 - 5e-5, DRAWS, 0.025)
    errors = [gain_of(noise(rng) + made, noise(rng), stretch)[1] for _ in range(3)]
    assert all(np.isfinite(errors))


def test_a_gain_has_no_unit_and_no_first_stretch() -> None:
    made, stretch = difference(0.7)
    left = noise(np.random.default_rng(14))
    one = gain_of(left + made, left, stretch)
    for scale in (1e-6, 1e6):
        assert gain_of(scale * (left + made), scale * left, stretch) == pytest.approx(one, rel=1e-9)
    assert gain_of(left + made, left, stretch + 40) == pytest.approx(one, rel=1e-12)
    assert gain_of(left + made, left, 3 * stretch) == pytest.approx(one, rel=1e-12)  # stretches between are not used
    order = np.random.default_rng(1).permutation(len(left))
    assert gain_of((left + made)[order], left[order], stretch[order]) == pytest.approx(one, rel=1e-9)


def test_one_block_that_holds_most_of_what_is_left_does_not_hide_a_gain() -> None:
    rng = np.random.default_rng(3)
    before, after = rng.uniform(0.8, 1.2, 29), 0.005 * rng.uniform(0.8, 1.2, 29)
    before[6], after[6] = 1.0, 0.3
    found = gain_interval(before, after)
    assert 0.1 < found.low < found.value < found.high
