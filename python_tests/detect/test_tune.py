"""Tuning on free motion: levels, limits and noise on data whose truth is known, and the command as a user calls it."""

from __future__ import annotations

import json
import math
import re
from importlib.resources import files as files_of
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import chdtri, pdtr

import tendonfmu.cli
from command import Call, run_script
from real_browser import Elements
from repetitions import repeated
from repository_paths import ROOT
from tendonfmu.detect.alarm_level import allowed_alarms, cells_of, count_alarms, least_hours, level_for, rate_limit
from tendonfmu.detect.bounds import SHARES, Bound, Line, evidence_line, given_line, level_of, search_for, searched_line
from tendonfmu.detect.free_motion import FreePart, FreeRun, free_parts
from tendonfmu.detect.noise import bias_noise, deviation, drift_variance, time_constant
from tendonfmu.detect.tuning import RELEASE, ContactTuning, TuneWarning
from tendonfmu.errors import InputError
from tendonfmu.files.tables import read_table, write_table
from tendonfmu.model import native, read_finger
from tendonfmu.recordings import read_recording

INDEX = ROOT / "examples" / "fingers" / "index_finger.json"
DEMO = ROOT / "examples" / "demo_recording"
FREE, FREE_X4 = DEMO / "index_finger_free.parquet", DEMO / "index_finger_free_x4.parquet"
PUSHES = DEMO / "index_finger_pushes.parquet"
WISHED = 200.0  # 1/h; what two minutes can support

Table = dict[str, NDArray[np.float64]]


# --- limits and levels ------------------------------------------------------------------------------------------------


def test_the_limit_of_a_rate_is_exact() -> None:
    """By chi square, and by its meaning: at the limit so few alarms are just as improbable as said."""
    for alarms, hours, confidence in ((0, 1.5, 0.9), (4, 1.5, 0.9), (17, 0.2, 0.975)):
        limit = rate_limit(alarms, hours, confidence)
        assert limit == pytest.approx(chdtri(2 * (alarms + 1), 1 - confidence) / 2 / hours, rel=1e-9)
        assert pdtr(alarms, limit * hours) == pytest.approx(1 - confidence, rel=1e-9)
    hours = least_hours(6.0, 0.9)
    assert rate_limit(0, hours, 0.9) == pytest.approx(6.0, rel=1e-12)
    assert allowed_alarms(0.999 * hours, 6.0, 0.9) == -1 and allowed_alarms(1.001 * hours, 6.0, 0.9) == 0
    most = allowed_alarms(1.5, 6.0, 0.9)
    assert rate_limit(most, 1.5, 0.9) <= 6.0 < rate_limit(most + 1, 1.5, 0.9)


@pytest.mark.parametrize("seed", range(3))
def test_a_level_lets_no_more_alarms_through(seed: int) -> None:
    """By counting at every level anew: correlated values, clusters that grow together, gaps between cells."""
    draws = np.random.default_rng(seed)
    order = np.flatnonzero(draws.random(3000) < 0.9).astype(np.int64)
    values = np.convolve(draws.standard_normal(len(order)), np.ones(4), "same")
    counts = {value: count_alarms(order[values > value]) for value in values}
    for allowed in (0, 1, 5, 20):
        level = level_for(values, order, allowed)
        assert all(counts[value] <= allowed for value in values if value >= level)
        assert count_alarms(order[values >= level]) > allowed
    # cells that are in alarm anyway take their part, and cells beside them cost nothing
    others = order[[100, 101, 1500]]
    level = level_for(values, order, 3, others)
    assert count_alarms(np.union1d(order[values > level], others)) <= 3
    assert count_alarms(np.union1d(order[values >= level], others)) > 3


# --- free motion with a known tail ------------------------------------------------------------------------------------

RATE, SLOPES = 2000.0, (1e-4, 3e-4)  # 1/h of bumps of each joint; N·m per N, mean height


def made_up(seed: int, hours: float = 0.5, forces: tuple[float, ...] = (10.0, 20.0, 40.0), rate: float = 50.0) -> Any:
    """Runs with bumps of 40 ms at random times; heights exponential, their mean SLOPES·f. Noise beneath them."""
    draws, runs = np.random.default_rng(seed), []
    for force in forces:
        samples = round(hours * 3600 * rate)
        time = np.arange(samples) / rate
        signal = 1e-5 * draws.standard_normal((samples, len(SLOPES)))
        for j, slope in enumerate(SLOPES):
            at = draws.integers(0, samples - 2, draws.poisson(RATE * hours))
            height = draws.exponential(slope * force, len(at))
            for k in range(2):
                np.maximum.at(signal[:, j], at + k, height)
        part = FreePart(
            "made up", {"time": time}, np.full(samples, force), np.ones(samples, dtype=bool), np.full(samples, 1 / rate)
        )
        quiet = np.zeros_like(signal, dtype=np.float32)
        bumps = signal.astype(np.float32)
        runs.append(FreeRun(part, bumps, bumps, bumps, quiet, quiet, quiet, quiet))
    return runs, cells_of([run.part for run in runs])


def true_rate(base: NDArray[Any], per_force: NDArray[Any], forces: tuple[float, ...] = (10.0, 20.0, 40.0)) -> float:
    """1/h, mean over the forces."""
    levels = base[None, :] + np.outer(forces, per_force)
    return float(
        np.mean(
            [
                RATE * math.exp(-b / (s * f))
                for f, row in zip(forces, levels, strict=True)
                for b, s in zip(row, SLOPES, strict=True)
            ]
        )
        * len(SLOPES)
    )


def test_bounds_keep_a_known_rate() -> None:
    """Tuned on 18 min each, the true rate is at most the wished one in about nine of ten cases or more."""
    true = []
    for seed in range(6):
        runs, cells = made_up(seed, hours=0.1)
        assert cells.groups == 3
        allowed = allowed_alarms(0.3, WISHED, 0.9)
        search = search_for(runs, cells, "innovation", WISHED)
        line = given_line(search, (0.0, 0.0), allowed)
        level = level_of(line, cells, allowed)
        bound = line.bound.scaled(level.factor)
        assert count_alarms(cells.order[line.statistic > level.factor]) <= allowed
        assert count_alarms(cells.order[line.held > level.factor]) <= allowed
        true.append(true_rate(bound.base, bound.per_force))
    assert sum(rate <= WISHED for rate in true) >= 5, true
    assert np.median(true) > 0.3 * WISHED, "bounds far higher than the rate asks for"


@pytest.mark.parametrize(
    ("size", "given", "expected"), repeated([(3.0, None, 1.0), (3.0, 3.0, 3.0), (0.003, None, None)], 0)
)
def test_an_uncertainty_larger_than_the_residual_does_not_hide_pushes(
    size: float, given: float | None, expected: float | None
) -> None:
    """Its level falls to 1 where that lets lighter pushes through, unless the description says a level."""
    data = json.loads(INDEX.read_text(encoding="utf-8"))
    joints, tendons = len(data["joints"]), len(data["tendons"])
    data["contact"] |= {"uncertainty": [[[size] * (tendons + 3)]] * joints, "uncertainty_level": given}
    tuning = ContactTuning(data, false_alarms_per_hour=WISHED)
    with pytest.warns(TuneWarning):
        contact = tuning.tune([FREE, FREE_X4]).description_.data["contact"]
    assert contact.get("uncertainty_level") == expected


def free_part(source: str, force: float, minutes: float) -> FreePart:
    samples = round(60 * 100 * minutes)
    time = np.arange(samples) / 100.0
    return FreePart(
        source, {"time": time}, np.full(samples, force), np.ones(samples, dtype=bool), np.full(samples, 0.01)
    )


def test_whole_recordings_are_held_out_where_each_pretension_has_two() -> None:
    cells = cells_of([free_part(name, force, 4.0) for name, force in (("a", 10), ("b", 40), ("c", 10.1), ("d", 40.1))])
    fold = [set(cells.fold[cells.part == k].tolist()) for k in range(4)]
    assert fold == [{0}, {0}, {1}, {1}]


@pytest.mark.parametrize(
    "parts",
    [
        [("a", 10.0, 4.0), ("b", 40.0, 4.0)],  # one of each pretension
        [("a", 10.0, 4.0), ("a", 10.0, 4.0)],  # one with a gap
        [("a", 10.0, 8.0), ("b", 10.0, 1.0)],  # one that is too short for a half
    ],
)
def test_blocks_are_held_out_elsewhere(parts: list[tuple[str, float, float]]) -> None:
    cells = cells_of([free_part(*each) for each in parts])
    assert all(set(cells.fold[cells.part == k].tolist()) == {0, 1} for k in range(len(parts)))


def test_stiction_is_taken_where_it_explains_the_tail() -> None:
    """Bumps of the stuck share of H, and none otherwise: the rest of the bound is small."""
    draws = np.random.default_rng(0)
    runs, cells = made_up(0, hours=0.1)
    for run in runs:
        stuck = (0.02 * (np.sin(np.arange(len(run.stuck)) / 40.0) > 0.9)).astype(np.float32)
        run.stuck[:] = stuck[:, None]
        run.innovation[:] = 1e-5 * draws.standard_normal(run.stuck.shape) + SHARES[0] * run.stuck * (
            draws.random(run.stuck.shape) < 0.02
        )
    line = searched_line(search_for(runs, cells, "innovation", 60.0), 10)
    assert (line.bound.stuck_share, line.bound.jump_share) == SHARES
    assert (line.bound.own(np.array([20.0])) * level_of(line, cells, 10).factor < 2e-3).all()


def test_evidence_is_what_the_core_computes() -> None:
    """A bump twice the bound for a time: g reaches that time at twice the bound, and none at more."""
    runs, cells = made_up(0, hours=0.02, forces=(10.0,), rate=100.0)
    for run in runs:
        run.innovation[:] = 0.0
        run.innovation[3000:3010] = 0.02
    search = search_for(runs, cells, "innovation", 60.0)
    bound = Bound(np.array([0.02, 0.03]), np.zeros(2))
    line = Line(bound, (bound, bound), np.zeros(len(cells.order)), np.zeros(len(cells.order)))
    found = evidence_line(search, line, [run.part for run in runs], 0.05)
    # |y|/B − 1 = 0.5 for 0.1 s makes 0.05 s: alarm below that bound, to a step of the scale
    assert found.statistic.max() == found.held.max() == pytest.approx(1 / 1.5, rel=0.08)


# --- the bias ---------------------------------------------------------------------------------------------------------


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
    runs, cells = made_up(0, hours=0.1)
    draws = np.random.default_rng(1)
    for run in runs:
        force = float(run.part.mean_force[0])
        run.residual[:] = (2e-3 + 1e-4 * force) * draws.standard_normal(run.residual.shape)
    data = {"bias": {"noise_time": 0.002}}
    found = bias_noise(data, runs, cells, 0.5)
    assert found.noise_std == pytest.approx(2e-3, rel=0.05)
    assert found.noise_std_per_force == pytest.approx(1e-4, rel=0.05)
    at = 2e-3 + 1e-4 * found.force
    assert found.drift_variance == pytest.approx(at**2 * 0.002 / 0.25, rel=0.05)


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tuned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the demo's free motion was tuned."""
    folder = tmp_path_factory.mktemp("tuned")
    names = ["-o", folder / "t.json", "--report", folder / "r.json", "--figures", folder / "fig"]
    main = Path(tendonfmu.cli.__file__).with_name("__main__.py")
    answer = run_script(main, "tune", INDEX, FREE, FREE_X4, *names, "--false-alarms-per-hour", str(WISHED))
    assert answer.status == 0, answer.err
    return folder


@pytest.mark.long
def test_presliding_counts_as_held_while_it_stands() -> None:
    """Where the description has it, and with the short time that presliding leaves to be held."""
    data = json.loads(INDEX.read_text())
    data["extensions"] = [{"effect": "presliding", "displacement": 0.07}]
    with pytest.warns(TuneWarning):
        bound = (
            ContactTuning(data, false_alarms_per_hour=WISHED).tune(FREE).description_.data["contact"]["friction_bound"]
        )
    assert bound["stuck_presliding"] is True and bound["stuck_time"] == 0.06


def test_the_demo_is_tuned(tuned: Path) -> None:
    report = json.loads((tuned / "r.json").read_text())
    schema = json.loads(files_of("tendonfmu").joinpath("schema", "tune_report.schema.json").read_text())
    jsonschema.validate(report, schema, cls=jsonschema.Draft202012Validator)
    before, after = json.loads(INDEX.read_text()), json.loads((tuned / "t.json").read_text())
    for key in set(before) - {"bias", "contact"}:
        assert after[key] == before[key], key
    changed = {"noise_std", "noise_std_per_force", "drift_variance", "start_share"}
    assert after["bias"]["start_share"] == 1
    assert "drift" not in after["contact"] and any("slow loads" in each for each in report["warnings"])
    assert "stuck_presliding" not in after["contact"]["friction_bound"], "it has no presliding"
    assert {"jump_margin", "force_resolution"} <= set(after["sensor_fault"])
    assert {key: value for key, value in after["bias"].items() if key not in changed} == {
        key: value for key, value in before["bias"].items() if key not in changed
    }
    contact = after["contact"]
    assert contact == report["contact"] and contact["method"] == "innovation"
    assert {key: contact[key] for key in RELEASE} == RELEASE and contact["release_time"] == 2.0
    assert report["closed_loop"]["limit"] <= WISHED and report["held_out"]["limit"] <= WISHED
    assert [round(each["mean_force"]) for each in report["pretensions"]] == [10, 40]
    as_chosen = next(each for each in report["tail"] if each["factor"] == 1.0)
    assert (as_chosen["in_sample"], as_chosen["held_out"]) == (report["in_sample"], report["held_out"])
    assert report["in_sample"]["alarms"] == 0 < report["held_out"]["alarms"], "chosen on the one, not on the other"
    page = Elements((tuned / "fig" / "tuning.html").read_text("utf-8"))
    assert [section["id"] for section in page.all("section")] == ["tail", "bounds", "worst"]


def test_little_motion_is_tuned_for_the_rate_that_it_supports(call: Call) -> None:
    """Or refused, where that is asked for. Of one pretension: thresholds are constants, and the forces are said."""
    answer = call("tune", INDEX, FREE, "-o", "t.json", "--report", "r.json", "--json")
    assert answer.status == 0 and answer.out == Path("r.json").read_text(), answer
    report = json.loads(answer.out)
    hours = report["minutes"] / 60
    assert report["tuned_for_per_hour"] == pytest.approx(rate_limit(0, hours, 0.9)) and report["allowed_alarms"] == 0
    assert report["more_minutes"] == pytest.approx(60 * (least_hours(6.0, 0.9) - hours))
    assert "at most 143 false alarms an hour with 90 % confidence; for 6 an hour record 22." in answer.err
    assert report["closed_loop"]["alarms"] == 0 and report["held_out"]["alarms"] == 0
    held = report["holds_for"]
    assert held["pretensions"] == 1 and 9 < held["lowest_force"] < held["highest_force"] < 11
    assert f"{held['lowest_force']:.3g} to {held['highest_force']:.3g} N" in answer.err
    assert not any(report["contact"]["innovation"]["threshold_per_force"])
    answer = call("tune", INDEX, FREE, "-o", "strict.json", "--strict")
    assert answer.status == 1 and not Path("strict.json").exists() and len(answer.err.splitlines()) == 1, answer
    assert float(re.findall(r"([0-9.]+) min more", answer.err)[0]) == pytest.approx(report["more_minutes"], abs=0.1)


def test_friction_that_explains_everything_leaves_a_threshold() -> None:
    """Signals far below the share of stiction: the level that alarms ask for is negative, the bound is not."""
    runs, cells = made_up(0, hours=0.05)
    for run in runs:
        run.stuck[:] = 1.0
    search = search_for(runs, cells, "innovation", 60.0)
    line = searched_line(search, 10)
    level = level_of(line, cells, 10)
    own = line.bound.scaled(level.factor).own(cells.force)
    rms = np.sqrt(search.mean_square.mean(axis=0))
    assert (search.excess(*SHARES) < 0).all()
    assert (own >= 0.02 * rms * (1 - 1e-9)).all()
    # and it is no higher than that at one joint: nothing asks for more
    assert (own.min(axis=0) / (0.02 * rms)).min() == pytest.approx(1.0)


@pytest.mark.parametrize("low", [1e-3, 1.0])
def test_a_standard_deviation_is_found_for_any_growth_with_the_force(low: float) -> None:
    """Residuals that fall with the force fit no line that rises: the mean of r²/std² is 1 nevertheless."""
    runs, cells = made_up(0, hours=0.05)
    draws = np.random.default_rng(2)
    for run, spread in zip(runs, (1.0, low, low), strict=True):
        run.residual[:] = spread * draws.standard_normal(run.residual.shape)
    found = deviation(runs, cells, Bound(np.ones(2), np.zeros(2)))
    square = cells.mean(np.concatenate([run.residual.T**2 for run in runs], axis=1))
    std = found.base + cells.force[:, None] * found.per_force
    assert (square / std**2).mean(axis=0) == pytest.approx(np.ones(2), rel=1e-3)


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
        (dict, ("--method", "paper"), ("method: 'paper'", "innovation or cusum or threshold")),
        (dict, ("--kinematics", "3"), ("no column joint_velocity[1]",)),
        (dict, ("--confidence", "1.5"), ("--confidence",)),
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
