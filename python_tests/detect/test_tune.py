"""Tuning on free motion: weights, levels, factors on data whose truth is known, and the command as a user calls it."""

from __future__ import annotations

import json
import math
from importlib.resources import files as files_of
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from numpy.typing import NDArray

import tendonfmu
from command import Call, run_script
from repository_paths import ROOT
from tendonfmu.detect.free_motion import FreePart, free_parts
from tendonfmu.detect.learning import (
    BANDS,
    NAMES,
    Terms,
    bands_of,
    close_the_loop,
    gamma_weights,
    levels_of,
    numbers_of,
    seconds_of,
    terms_of,
    weights_of,
)
from tendonfmu.detect.noise import Residuals, bias_noise, deviation, drift_variance, time_constant
from tendonfmu.detect.tune_report import sentence
from tendonfmu.detect.tuning import QUARTERS, ContactTuning, TuneWarning, groups_of, pushed_part, size_found
from tendonfmu.errors import InputError
from tendonfmu.files.tables import read_table, write_table
from tendonfmu.model import native, read_finger
from tendonfmu.options import KinematicsSource
from tendonfmu.recordings import read_recording

INDEX = ROOT / "examples" / "fingers" / "index_finger.json"
DEMO = ROOT / "examples" / "demo_recording"
FREE, FREE_X4 = DEMO / "index_finger_free.parquet", DEMO / "index_finger_free_x4.parquet"
PUSHES = DEMO / "index_finger_pushes.parquet"
WISHED = 200.0  # 1/h; what two minutes can show

Table = dict[str, NDArray[np.float64]]


# --- weights and levels -----------------------------------------------------------------------------------------------


def made_terms(seed: int, seconds: float, weights: NDArray[np.float64]) -> Terms:
    """Distances that are normal with the variance that the weights [4, 6] say, of one joint, by cell of 10 ms."""
    draws = np.random.default_rng(seed)
    cells = round(100 * seconds)
    squares = draws.gamma(0.5, 2.0, (cells, 1, BANDS, len(NAMES)))
    squares[..., 0] = 1.0
    distance = np.sqrt(np.einsum("cjkp,kp->cjk", squares, weights)) * draws.standard_normal((cells, 1, BANDS))
    return Terms(distance.astype(np.float32), squares.astype(np.float32), np.arange(cells) / 100.0)


def test_weights_are_those_of_the_variance() -> None:
    """By a gamma likelihood on all samples: those that are there are found, and the others are small."""
    truth = np.array([4e-6, 0.0, 9e-6, 0.0, 0.0, 1e-6])
    terms = made_terms(0, 600.0, np.tile(truth, (4, 1)))
    found = gamma_weights(terms.level[:, 0, 0].astype(float) ** 2, terms.squares[:, 0, 0].astype(float))
    np.testing.assert_allclose(found[[0, 2]], truth[[0, 2]], rtol=0.1)
    assert found[5] == pytest.approx(1e-6, rel=0.5) and (found[[1, 3, 4]] < 3e-7).all()
    unseen = np.where(np.arange(6) == 3, 0.0, terms.squares[:, 0, 0].astype(float))
    assert gamma_weights(terms.level[:, 0, 0].astype(float) ** 2, unseen)[3] == 0.0, "a term that is always 0"


def test_a_level_keeps_its_share_of_the_rate() -> None:
    """On other data of the same kind: the rate that a level was chosen for is found, within what so few alarms say."""
    weights = np.tile([4e-6, 0.0, 9e-6, 0.0, 0.0, 0.0], (4, 1))
    learned, other = made_terms(1, 1800.0, weights), made_terms(2, 7200.0, weights)
    rate = 240.0
    found = weights_of([learned])
    numbers = numbers_of(found, levels_of(seconds_of([learned], found), rate))
    above = (seconds_of([other], numbers**2) > 1.0).any(axis=(1, 2)).sum()
    assert 0.6 * rate * 2.0 < above < 1.6 * rate * 2.0, above


def test_few_seconds_have_a_level_too() -> None:
    maxima = np.random.default_rng(3).exponential(1.0, (8, 2, 4))
    levels = levels_of(maxima, 6.0)
    assert levels.shape == (2, 4) and (levels > np.quantile(maxima, 0.5, axis=0)).all() and np.isfinite(levels).all()


@pytest.mark.parametrize("slope", [-5.0, -12.0])
def test_the_factor_has_the_rate_that_is_asked_for(slope: float) -> None:
    """Alarms by a known law, half of them in one group: the factor is that of the law, and each group has its own."""
    hours = np.array([1.0, 1.0, 2.0])

    def count(group: int, factor: float) -> int:
        return round(40.0 * (1.0, 2.0, 0.5)[group] * hours[group] * factor**slope)

    loop = close_the_loop(count, hours, 20.0)
    true = (20.0 / (40.0 * (1.0 + 2.0 + 1.0) / 4.0)) ** (1.0 / slope)
    assert loop.factor == pytest.approx(true, rel=0.05)
    assert loop.kept_out[1] < loop.factor < loop.kept_out[2], "the others have fewer alarms, or more"
    assert (np.diff(loop.tried) < 0).all() and loop.alarms.shape == (len(loop.tried), 3)


def test_without_any_alarm_the_factor_is_the_lowest_that_was_tried() -> None:
    loop = close_the_loop(lambda group, factor: 0, np.array([0.1, 0.1]), 6.0)
    assert loop.factor == loop.tried.min() == loop.kept_out[0]


def test_the_size_of_which_nine_of_ten_are_found() -> None:
    """By logistic regression on pushes that are found with a known probability."""
    draws = np.random.default_rng(4)
    sizes = np.exp(draws.uniform(np.log(1e-3), np.log(4e-2), 3000))
    found = draws.random(3000) < 1.0 / (1.0 + (1e-2 / sizes) ** 4)
    assert size_found(sizes, found) == pytest.approx(1e-2 * 9.0**0.25, rel=0.1)
    assert 9e-3 < size_found(sizes, sizes > 1e-2) < 1.3e-2, "a sharp limit"
    assert math.isnan(size_found(sizes, np.zeros(3000, dtype=bool)))


@pytest.mark.parametrize("kinematics", [1, 2, 3])
def test_a_push_turns_the_joints_and_changes_the_torque(kinematics: int) -> None:
    """By its size at its joint, by nothing at the others, and with angles that agree with forces and springs."""
    data = json.loads(INDEX.read_text())
    arms = np.array([tendon["moment_arms"] for tendon in data["tendons"]])
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]])
    time = np.arange(1000) / 500.0
    arrays = {"time": time, "tendon_force": np.full((1000, 8), 20.0), "tendon_position": np.zeros((1000, 8))}
    angle = -arrays["tendon_force"] / stiffness @ np.linalg.pinv(arms).T
    arrays |= {"joint_position": angle} if kinematics > 1 else {}
    arrays |= {"joint_velocity": np.zeros((1000, 4))} if kinematics == 3 else {}
    counted = np.ones(1000, dtype=bool)
    part = FreePart("made", arrays, np.full(1000, 20.0), counted, np.full(1000, 2e-3), KinematicsSource(kinematics))
    pushed = pushed_part(data, part, 2, np.array([0.5]), np.array([0.01])).arrays
    torque = (pushed["tendon_force"] - arrays["tendon_force"]) @ arms
    held = (time >= 0.52) & (time < 0.78)
    np.testing.assert_allclose(torque[held], np.tile([0.0, 0.0, 0.01, 0.0], (held.sum(), 1)), atol=1e-12)
    assert not torque[(time < 0.5) | (time > 0.8)].any()
    by_springs = (pushed["tendon_position"] - pushed["tendon_force"] / stiffness) @ np.linalg.pinv(arms).T
    if kinematics > 1:
        np.testing.assert_allclose(pushed["joint_position"], by_springs, atol=1e-12)
    if kinematics == 3:
        moved = np.cumsum(pushed["joint_velocity"], axis=0) * 2e-3
        np.testing.assert_allclose(moved[held], (by_springs - angle)[held], atol=1e-4)


def test_a_cell_keeps_the_sample_with_the_largest_distance() -> None:
    """By joint and band alone, with its terms squared; samples that do not count are none."""
    draws = np.random.default_rng(5)
    time, values = np.arange(400) * 2.5e-3, draws.standard_normal((400, 2, 4, 8))
    counted = (time >= 0.1) & ~((time >= 0.5) & (time < 0.6))
    terms = terms_of(time, values, counted)
    assert len(terms.time) == round((1.0 - 0.1 - 0.1) * 100)
    k = 7
    inside = np.flatnonzero((time >= terms.time[k] - 1e-9) & (time < terms.time[k] + 0.01 - 1e-9) & counted)
    for j, band in np.ndindex(2, 4):
        row = inside[np.argmax(np.abs(values[inside, j, band, 1]))]
        assert terms.level[k, j, band] == pytest.approx(values[row, j, band, 1], rel=1e-6)
        np.testing.assert_allclose(terms.squares[k, j, band], values[row, j, band, 2:] ** 2, rtol=1e-5)


def test_numbers_that_are_0_are_left_out_of_the_description() -> None:
    numbers = np.zeros((2, 4, 6))
    numbers[:, :, 0], numbers[1, 2, 5] = 0.0123456, 0.5
    bands = bands_of(numbers)
    assert bands[0] == {"noise": [0.01235, 0.01235]} and bands[2]["friction_reserve"] == [0.0, 0.5]


# --- what is left out together ----------------------------------------------------------------------------------------


def free_part(source: str, minutes: float = 1.0) -> FreePart:
    samples = round(60 * 100 * minutes)
    time = np.arange(samples) / 100.0
    return FreePart(source, {"time": time}, np.full(samples, 10.0), time >= 2.0, np.full(samples, 0.01))


def test_three_recordings_are_left_out_one_by_one() -> None:
    groups = groups_of([free_part(name) for name in "abcb"])
    assert [[part.source for part in group] for group in groups] == [["a"], ["b", "b"], ["c"]]


@pytest.mark.parametrize("sources", ["a", "aa", "ab"])
def test_of_fewer_recordings_each_quarter_of_their_time_is_left_out(sources: str) -> None:
    groups = groups_of([free_part(name) for name in sources])
    assert len(groups) == QUARTERS
    for group in groups:
        assert {part.source for part in group} == set(sources)
        assert sum(part.seconds.sum() for part in group) == pytest.approx(60.0 * len(sources) / QUARTERS, abs=0.05)
        assert not any(part.counted[part.time - part.time[0] < 2.0].any() for part in group), "the finger starts anew"


# --- the bias ---------------------------------------------------------------------------------------------------------


def made_residuals(spread: tuple[float, ...], forces: tuple[float, ...] = (10.0, 20.0, 40.0)) -> Residuals:
    draws, cells = np.random.default_rng(1), 20_000
    residual = np.concatenate([each * draws.standard_normal((cells, 2)) for each in spread])
    force, group = np.repeat(forces, cells), np.repeat(np.arange(len(forces)), cells)
    return Residuals(residual, np.zeros_like(residual), force, group, np.full(len(force), 0.01 / 3600.0))


@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_the_time_constant_of_the_bias(rate: float) -> None:
    """A step is followed to 1 − 1/e in that time, at any sample rate, with the drift that the relation gives."""
    noise, noise_time, wished = 0.01, 0.002, 0.4
    drift = drift_variance(noise, noise_time, wished)
    assert time_constant(drift, noise, noise_time) == pytest.approx(wished)
    time = np.arange(round(8 * rate)) / rate
    bias = {"drift_variance": drift, "noise_std": noise, "noise_time": noise_time}
    finger = {"format": "tendonfmu-finger-1", "name": "bare", "joints": [{"name": "j"}], "bias": bias}
    finger |= {"tendons": [{"moment_arms": [1.0], "stiffness": 1e3}], "contact": {"threshold": [1e9]}}
    signals = {"joint_position": np.zeros((len(time), 1)), "joint_velocity": np.zeros((len(time), 1))}
    step = np.where(time < 5.0, 1.0, 2.0)[:, None]
    left = native.run_recording(finger, {"time": time, "tendon_force": step, **signals}, 3)
    followed = time[np.flatnonzero(left["bias_torque"][:, 0] > 2 - math.exp(-1))[0]] - 5.0
    assert followed == pytest.approx(wished, rel=0.03, abs=1.5 / rate)


def test_noise_follows_the_mean_force() -> None:
    found = bias_noise(made_residuals((3e-3, 4e-3, 6e-3)), 0.002, 0.5)
    assert found.noise_std == pytest.approx(2e-3, rel=0.05)
    assert found.noise_std_per_force == pytest.approx(1e-4, rel=0.05)
    at = 2e-3 + 1e-4 * found.force
    assert found.drift_variance == pytest.approx(at**2 * 0.002 / 0.25, rel=0.05)


@pytest.mark.parametrize("low", [1e-3, 1.0])
def test_a_standard_deviation_is_found_for_any_growth_with_the_force(low: float) -> None:
    """Residuals that fall with the force fit no line that rises: the mean of r²/std² is 1 nevertheless."""
    residuals = made_residuals((1.0, low, low))
    found = deviation(residuals)
    std = found.base + residuals.force[:, None] * found.per_force
    assert (residuals.residual**2 / std**2).mean(axis=0) == pytest.approx(np.ones(2), rel=1e-3)


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tuned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the demo's free motion was tuned."""
    folder = tmp_path_factory.mktemp("tuned")
    names = ["-o", folder / "t.json", "--report", folder / "r.json", "--figures", folder / "fig"]
    main = Path(tendonfmu.__file__).with_name("__main__.py")
    answer = run_script(main, "tune", INDEX, FREE, FREE_X4, *names, "--false-alarms-per-hour", str(WISHED))
    assert answer.status == 0, answer.err
    return folder


def test_the_demo_is_tuned(tuned: Path) -> None:
    report = json.loads((tuned / "r.json").read_text())
    schema = json.loads(files_of("tendonfmu").joinpath("schema", "tune_report.schema.json").read_text())
    jsonschema.validate(report, schema, cls=jsonschema.Draft202012Validator)
    before, after = json.loads(INDEX.read_text()), json.loads((tuned / "t.json").read_text())
    for key in set(before) - {"bias", "contact"}:
        assert after[key] == before[key], key
    assert {"jump_margin", "force_resolution"} <= set(after["sensor_fault"])
    changed = {"noise_std", "noise_std_per_force", "drift_variance"}
    assert {key: value for key, value in after["bias"].items() if key not in changed} == {
        key: value for key, value in before["bias"].items() if key not in changed
    }
    contact = after["contact"]
    assert contact == report["contact"] and contact["method"] == "bands" and len(contact["bands"]) == 4
    assert contact["threshold"] == before["contact"]["threshold"], "that of the paper is kept"
    assert all(min(band["noise"]) > 0 for band in contact["bands"])
    low, high = report["kept_out"]["interval"]
    assert low <= WISHED <= high, report["kept_out"]
    assert [round(each["mean_force"]) for each in report["pretensions"]] == [10, 40]
    assert report["sentence"].startswith("At most 200 alarms an hour were asked for; ")
    assert report["sentence"].endswith("are found within 60 ms, nine of ten.")
    assert "confidence" not in report["sentence"]
    many = report | {"kept_out": report["kept_out"] | {"interval": [250.0, 400.0]}}
    assert "of motion that was kept out, with 95 % confidence more than 250 an hour. Pushes" in sentence(many)
    assert [file.name for file in (tuned / "fig").iterdir()] == ["tuning.html"]


def test_the_rule_of_the_paper_is_tuned_for_the_same_rate() -> None:
    tuning = ContactTuning(INDEX, false_alarms_per_hour=WISHED, method="paper")
    with pytest.warns(TuneWarning):
        contact = tuning.tune([FREE, FREE_X4]).description_.data["contact"]
    assert contact["method"] == "paper" and "bands" not in contact
    at_10_newton = np.array(contact["threshold"]) + 10.0 * np.array(contact["threshold_per_force"])
    assert min(contact["threshold"]) >= 0 and (at_10_newton > 0).all() and (at_10_newton < 1.0).all()
    assert tuning.kept_out_.alarms <= 3 * WISHED * tuning.hours_


def test_little_motion_of_one_pretension_is_warned_of(call: Call) -> None:
    answer = call("tune", INDEX, FREE, "-o", "t.json", "--report", "r.json", "--json")
    assert answer.status == 0 and answer.out == Path("r.json").read_text(), answer
    report = json.loads(answer.out)
    assert report["more_minutes"] == pytest.approx(30.0 - report["minutes"])
    assert "show a rate of 6 false alarms an hour only by extrapolation; record 29." in answer.err
    held = report["holds_for"]
    assert 9 < held["lowest_force"] < held["highest_force"] < 11 and len(report["pretensions"]) == 1
    assert "one pretension, " in answer.err and "record several pretensions" in answer.err


@pytest.fixture(scope="module")
def pushes() -> Table:
    whole = read_table(PUSHES, lambda _file, _names: None)
    return {name: np.array(column[4000:8000]) for name, column in whole.items()}


def unlabelled(table: Table) -> Table:
    return {name: column for name, column in table.items() if name != "contact"}


def still(table: Table) -> Table:
    quiet = {name: column for name, column in unlabelled(table).items() if not name.startswith("external")}
    return {name: column if name == "time" else 0 * column + column[0] for name, column in quiet.items()}


@pytest.mark.parametrize("change", [dict, unlabelled])
def test_contact_that_a_label_or_a_reference_sensor_shows_is_left_out(
    call: Call, pushes: Table, tmp_path: Path, change: Any
) -> None:
    write_table(tmp_path / "rec.parquet", change(pushes))
    recording = read_recording(tmp_path / "rec.parquet")
    parts, sentences = free_parts(read_finger(INDEX), recording, 1)
    counted = np.concatenate([part.time[part.counted] for part in parts])
    times = pushes["time"][np.flatnonzero(pushes["contact"])]
    assert len(counted) > 300 and not np.isin(counted, times).any()
    last = times[np.searchsorted(times, counted, side="right") - 1][counted > times[0]]
    assert (counted[counted > times[0]] - last > 2.0).all(), "the bias settles after a touch"
    assert any("of contact are left out" in sentence for sentence in sentences)


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        (still, (), ("no motion", "velocity_threshold.joint = 0.01 rad/s")),
        (dict, ("--method", "cusum"), ("method: 'cusum'", "bands or paper")),
        (dict, ("--kinematics", "3"), ("no column joint_velocity[1]",)),
        (dict, ("--false-alarms-per-hour", "0"), ("--false-alarms-per-hour",)),
    ],
)
def test_bad_input_is_named_and_leaves_nothing(
    call: Call, pushes: Table, change: Any, options: tuple[str, ...], words: tuple[str, ...]
) -> None:
    write_table(Path("rec.parquet"), change(pushes) if "--kinematics" not in options else still(pushes))
    answer = call("tune", INDEX, "rec.parquet", "-o", "t.json", *options)
    assert answer.status == 2 and len(answer.err.splitlines()) == 1, answer
    assert all(word in answer.err for word in words), answer.err
    assert not Path("t.json").exists()


@pytest.mark.long
def test_a_bias_without_a_time_constant_needs_one() -> None:
    data = json.loads(INDEX.read_text())
    data["bias"]["drift_variance"] = 0.0
    with pytest.raises(InputError, match="drift_variance = 0"):
        ContactTuning(data, false_alarms_per_hour=WISHED).tune([FREE, FREE_X4])
