"""Friction that remembers: its hidden numbers are found, what is not there is left out, and the form is chosen."""

from __future__ import annotations

import copy
import re
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fit_cases import small_finger
from fit_data import make_recording, wavy_forces, wavy_motion
from fit_finger import moved_start
from tendonfmu import diagnose
from tendonfmu.errors import InputError
from tendonfmu.estimate.fitting import FrictionFit
from tendonfmu.estimate.learning import posterior_factor
from tendonfmu.estimate.memory_choice import NEAR, _Search, choose_memory
from tendonfmu.estimate.memory_methods import STEP, full_problem
from tendonfmu.estimate.structure import Choice
from tendonfmu.model import finger_from_data, get_number, moment_arms, set_number
from tendonfmu.recordings import FitRecording, Held, Recording, best_angles, make_grid, prepare

pytestmark = pytest.mark.filterwarnings(
    "ignore::tendonfmu.estimate.fitting.FitWarning", "ignore::tendonfmu.commands.diagnose.DiagnosisWarning"
)

Rows = tuple[dict[str, Any], ...]
RELATIVE = {"effect": "presliding", "displacement": 0.3}  # s: 0.15 mm at tendons, 3 mrad at joints
ABSOLUTE = {"effect": "presliding", "stiffness": 3000.0}


def finger(*extensions: dict[str, Any], start: bool = False) -> dict[str, Any]:
    """The small finger, or with numbers that are off."""
    data = moved_start() if start else copy.deepcopy(small_finger())
    data["bias"] |= {"drift_variance": 0.0, "noise_std": 5e-4, "forget_rate": 0.0}  # friction at rest is held
    return data | {"extensions": list(extensions)}


@lru_cache
def _made(rows: str, seed: int, duration: float) -> Recording:
    motion = wavy_motion(seed, duration, 200.0, 2)
    forces = wavy_forces(seed, motion["time"], 4)
    made = make_recording(finger(*eval(rows)), motion, forces, seed, settled=1e-9)
    groups = dict(made.recording)
    return Recording(Path(f"made_{seed}.parquet"), groups.pop("time"), groups)


def recording(*rows: dict[str, Any], seed: int = 1, duration: float = 40.0) -> Recording:
    return _made(repr(rows), seed, duration)


def fitted(given: Rows, truth: Rows, seed: int = 1, **options: Any) -> FrictionFit:
    settings = {"share": ["tendons"], "kinematics": 3} | options
    return FrictionFit(finger(*given, start=True), **settings).fit(recording(*truth, seed=seed))


@pytest.mark.parametrize(
    ("truth", "given"),
    [
        ((RELATIVE,), ({**RELATIVE, "displacement": 4.0},)),
        (({**RELATIVE, "relaxation_time": 0.8},), ({**RELATIVE, "displacement": 2.0, "relaxation_time": 0.05},)),
        (
            ({**ABSOLUTE, "relaxation_time": 0.8}, {"effect": "cord_stretch", "stiffness": 2e4}),
            (
                {**ABSOLUTE, "stiffness": 3e4, "relaxation_time": 0.05},
                {"effect": "cord_stretch", "stiffness": 2e5},
            ),
        ),
    ],
)
def test_hidden_numbers_are_found_from_far_away(truth: Rows, given: Rows) -> None:
    fit = fitted(given, truth)
    rows = fit.description_.data["extensions"]
    for row, true in zip(rows, truth, strict=True):
        assert set(row) == set(true)
        for key in set(true) - {"effect"}:
            assert row[key] == pytest.approx(true[key], rel=0.1), key
    residual = fit.report_["residual"]["train"]
    assert np.max(residual["model_only_rms"]) < 7e-4  # N·m; noise_std is 0.5 mN·m, friction some 40
    assert fit.report_["memory"]["left_out"] == []


def test_what_the_motion_does_not_show_is_left_out() -> None:
    cords = {"effect": "cord_stretch", "stiffness": 5e4}
    fit = fitted(({**RELATIVE, "relaxation_time": 0.1}, cords), (RELATIVE,))
    (row,) = fit.description_.data["extensions"]
    assert set(row) == {"effect", "displacement"}
    assert row["displacement"] == pytest.approx(0.3, rel=0.05)
    assert set(fit.report_["memory"]["left_out"]) == {"extensions[1].relaxation_time", "extensions[2].stiffness"}
    assert any("relaxation_time is left out" in sentence for sentence in fit.warnings_)


def test_a_number_of_another_extension_is_found_beside_it() -> None:
    gravity = {"effect": "gravity", "joint": 1, "sine": 0.05, "cosine": 0.0}
    fit = fitted(({**gravity, "sine": 0.0}, RELATIVE), (gravity, RELATIVE), fix=["joints[1].cover"])  # looks alike
    assert fit.parameters_["extensions[1].sine"] == pytest.approx(0.05, rel=0.05)


def test_the_kalman_filter_refuses_by_name() -> None:
    with pytest.raises(InputError, match=r"presliding: .* expected --method batch, or .* without presliding"):
        fitted((RELATIVE,), (RELATIVE,), method="ekf")


def test_never_worse_on_unseen_motion_than_the_given_numbers() -> None:
    truth = ({**RELATIVE, "relaxation_time": 0.8},)
    fit = FrictionFit(finger(*truth), kinematics=3, holdout=0.3, holdout_block=5.0)
    fit.fit(recording(*truth))
    held = fit.report_["residual"]["held_out"]
    assert fit.report_["given_numbers"]["kept"] or np.mean(held["rms"]) <= 1.02 * np.mean(held["start_rms"])


def _laws(data: dict[str, Any]) -> list[dict[str, float]]:
    """All laws of the small finger, once each."""
    found = [joint[kind] for joint in data["joints"] for kind in ("friction", "load_friction") if kind in joint]
    for tendon in data["tendons"]:
        first, points = tendon["edge_friction"]
        found += [tendon["pulley_friction"][0], first, *points["laws"]]
    return list({id(law): law for law in found}.values())


def test_intervals_hold_the_truth() -> None:
    """95 % intervals of what is identified, on several recordings."""
    truth, inside = {**RELATIVE, "relaxation_time": 0.8}, []
    start = finger({**truth, "displacement": 0.4})
    for law in _laws(start):
        law.update({key: 1.25 * value for key, value in law.items()})
    for seed in range(2, 7):
        fit = FrictionFit(start, share=["tendons"], kinematics=3).fit(recording(truth, seed=seed))
        known = [each["path"] for each in fit.report_["parameters"] if each["identified"]]
        errors = [
            (fit.parameters_[path] - get_number(finger(truth), path)) / fit.standard_errors_[path] for path in known
        ]
        inside.append(np.mean(np.abs(errors) < 1.96))
    assert np.mean(inside) >= 0.88


# --- the form ---------------------------------------------------------------------------------------------------------


def prepared(*rows: dict[str, Any], seed: int = 1) -> FitRecording:
    data = finger_from_data(finger(start=True), Path("small.json"))
    return prepare(data, recording(*rows, seed=seed), 3, Held())


@pytest.mark.parametrize(
    ("truth", "name"),
    [
        ((), "none"),
        ((RELATIVE,), "relative"),
        (({**ABSOLUTE, "relaxation_time": 0.8},), "absolute"),
        (({**RELATIVE, "follows_limit": 1.0},), "relative"),
    ],
)
def test_the_form_is_chosen_by_what_is_left_out(truth: Rows, name: str) -> None:
    given = finger_from_data(finger(start=True), Path("small.json"))
    choice = choose_memory(given, [prepared(*truth)], Choice(share=["tendons"]))
    rows = [row for row in choice.finger.data["extensions"] if row["effect"] == "presliding"]
    assert choice.form.name.split(",")[0] == name
    assert len(rows) == len(truth)
    for row, true in zip(rows, truth, strict=True):
        assert set(row) == set(true)
        assert all(row[key] == pytest.approx(true[key], rel=0.15) for key in set(true) - {"effect"})
    errors = {form.name: form.errors.sum() for form in choice.tried}
    assert errors[choice.form.name] <= errors["none"]
    # with its parts the second one may be the better of two that are near
    whole = {form: errors[form] for form in ("relative", "absolute")}
    grown = {form.partition(",")[0] for form in errors if "," in form.replace(", filtered", "", 1)}
    assert grown == {form for form in whole if whole[form] < NEAR * min(whole.values())}


@pytest.mark.parametrize("noise", [0.0, 1.5e-3])  # rad; joints slip after 3 mrad
def test_noise_of_the_angles_decides_whether_the_travel_is_filtered(noise: float) -> None:
    given, made = finger_from_data(finger(start=True), Path("small.json")), recording(RELATIVE)
    angle = made.groups["joint_position"]
    angle = angle + noise * np.random.default_rng(5).standard_normal(angle.shape)
    noisy = replace(made, groups={**made.groups, "joint_position": angle})
    choice = choose_memory(given, [prepare(given, noisy, 2, Held())], Choice(share=["tendons"]))
    rows = [row for row in choice.finger.data["extensions"] if row["effect"] == "presliding"]
    assert rows and all(row.get("filtered_travel", 0.0) == (noise > 0.0) for row in rows)


def test_a_fit_starts_inside_where_a_number_is_rounded_out_of_its_box() -> None:
    given = finger_from_data(finger(), Path("small.json"))
    search = _Search(given, [prepared()], Choice(), 1)
    _, estimator = search._structure(())
    k, item = next((k, each) for k, each in enumerate(estimator.unknowns) if each.path.endswith("static"))
    data = copy.deepcopy(given.data)
    set_number(data, item.path, 0.997 * item.lower)
    set_number(data, item.path.replace("static", "coulomb"), 0.5 * item.lower)
    begin = search._numbers_of(estimator, data)
    assert begin[k] == item.lower > 0.0
    estimator.values(begin)  # it accepts them


def test_an_initial_bias_is_what_its_joint_leaves() -> None:
    data, left = finger(RELATIVE), [0.05, -0.03]
    data["bias"]["initial_torque"] = [0.0, 0.0]
    made = recording(RELATIVE, duration=10.0)
    torque = made.groups["external_torque"] - np.array(left)  # y gains as much
    moved = Recording(made.path, made.time, made.groups | {"external_torque": torque})
    given = finger_from_data(data, Path("small.json"))
    recordings = [prepare(given, moved, 3, Held())]
    structure, estimator = _Search(given, recordings, Choice(), 1)._structure((RELATIVE,))
    problem = full_problem(structure, estimator, recordings, make_grid(recordings, STEP), 1)
    found = problem.unknowns_at(problem.state(problem.scale.coordinates(estimator.start)))
    of = {unknown.path: k for k, unknown in enumerate(estimator.unknowns)}
    assert [found[of[f"bias.initial_torque[{j}]"]] for j in (1, 2)] == pytest.approx(left, abs=2e-3)


# --- the best angles --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("noise", "stretch", "source"),
    [
        (1e-6, 0.0, "joint encoders"),
        (3e-2, 0.0, "tendon positions"),
        (1e-4, 3e-2, "joint encoders"),
        (2e-4, 0.0, "joint encoders and tendon positions"),
    ],
)
def test_the_angles_known_best(noise: float, stretch: float, source: str) -> None:
    made = recording(RELATIVE)
    rng = np.random.default_rng(1)
    angle = made.groups["joint_position"]
    groups = dict(made.groups)
    groups["joint_position"] = angle + noise * rng.standard_normal(angle.shape)
    slow = np.sin(made.time / 3.0)[:, None] * moment_arms(finger()).sum(axis=1)
    white = 2e-6 * rng.standard_normal(groups["tendon_position"].shape)  # m: about 0.1 to 0.2 mrad
    groups["tendon_position"] = groups["tendon_position"] + stretch * slow + white
    given = finger_from_data(finger(), Path("small.json"))
    found = best_angles(given.data, [prepare(given, Recording(made.path, made.time, groups), 1, Held())])
    assert found.source == source
    best = found.recordings[0].recording.groups["joint_position"]
    away = best - angle
    assert (away - away.mean(axis=0)).std() < 1.1 * min(noise, 1e-2)
    assert found.recordings[0].kinematics == 2


def noisy_positions(noise: float, duration: float) -> Recording:
    """Tendon positions of 15 µm of noise make friction that remembers noisy; the encoders' noise is in rad."""
    made, rng = recording(RELATIVE, duration=duration), np.random.default_rng(3)
    groups = {name: values for name, values in made.groups.items() if name != "joint_velocity"}
    groups["tendon_position"] = groups["tendon_position"] + 1.5e-5 * rng.standard_normal((len(made.time), 4))
    groups["joint_position"] = groups["joint_position"] + noise * rng.standard_normal((len(made.time), 2))
    return Recording(made.path, made.time, groups)


def promised(advice: list[str]) -> float:
    """What joint encoders would leave, of both joints together (N·m)."""
    return (
        float(np.linalg.norm(np.array(re.findall(r"([\d.]+), ([\d.]+) mN·m would", advice[0])[0], dtype=float))) / 1e3
    )


@pytest.mark.parametrize(("noise", "says"), [(1e-5, True), (3e-3, False)])
def test_a_fit_says_what_quieter_encoders_would_leave(noise: float, says: bool) -> None:
    noisy = noisy_positions(noise, 40.0)
    given = finger({**RELATIVE, "displacement": 1.0}, start=True)
    fit = FrictionFit(given, share=["tendons"], kinematics=1).fit(noisy)
    advice = [sentence for sentence in fit.warnings_ if "--kinematics 2" in sentence]
    assert bool(advice) == says
    if says:
        by_encoders = FrictionFit(given, share=["tendons"], kinematics=2).fit(noisy)
        assert not any("--kinematics 2" in sentence for sentence in by_encoders.warnings_)
        left = [np.linalg.norm(each.report_["memory"]["left_delivered"]) for each in (by_encoders, fit)]
        assert left[0] < left[1] / 1.5
        assert promised(advice) < 1.3 * left[0]  # no fewer than --kinematics 2 does leave, and little more


def test_a_diagnosis_says_what_quieter_encoders_would_leave() -> None:
    found = diagnose(finger({**RELATIVE, "displacement": 1.0}, start=True), [noisy_positions(1e-5, 12.0)])
    advice = [sentence for sentence in found.warnings if "--kinematics 2" in sentence]
    assert promised(advice) < np.linalg.norm(found.report["extended"]["test_rms"]) / 1.5


# --- covariance


def test_factor_of_a_covariance_is_exact_and_survives_rounding() -> None:
    rng = np.random.default_rng(7)
    size = 10.0 ** rng.uniform(-9.0, 0.0, 40)  # units of very different size
    columns = rng.standard_normal((30, 40)) / size  # data that know 30 combinations of 40 numbers
    information, units = columns.T @ columns, np.outer(size, size)
    factor, share = posterior_factor(information, np.diag(size**2))
    expected = np.linalg.inv(np.eye(40) + information * units)
    np.testing.assert_allclose(factor @ factor.T / units, expected, atol=1e-9)
    np.testing.assert_allclose(factor.T @ information @ factor, np.diag(share), atol=1e-9)
    # the inverse of what knows some numbers 1e6 times better than others has negative eigenvalues
    factor, share = posterior_factor(1e11 * information, np.diag(size**2))
    covariance = factor @ factor.T
    std = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(std, std)).min() > -1e-12
    assert share.min() >= 0.0 and share.max() <= 1.0 and np.count_nonzero(share > 0.999) == 30
