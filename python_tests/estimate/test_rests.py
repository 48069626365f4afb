"""Logs of machines that move and rest: what a motor holds at rest says nothing of the friction's size.

SIGMAS of `one_joint` was chosen on the seeds 1 to 5; the seeds here are others.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import servo
from command import Call
from map_cases import TURNING, edited
from optional_parts import DATA, needs
from tendonfmu.commands.diagnose import diagnose
from tendonfmu.estimate.fitting import FrictionFit
from tendonfmu.recordings import convert_table, describe_joint, joint_description
from tendonfmu.recordings.prepared import left_at_rest

pytestmark = pytest.mark.filterwarnings("ignore::tendonfmu.estimate.fitting.FitWarning")
CASE = DATA.parent / "cases" / "24-moves-and-rests"


def written(folder: Path, log: dict[str, Any], known: bool = False) -> tuple[Path, Path]:
    wanted = edited(TURNING, "joint/known_load", {"column": "known", "unit": "N.m"}) if known else TURNING
    pd.DataFrame({name: values for name, values in log.items() if name != "sticks"}).to_csv(folder / "log.csv")
    (folder / "map.json").write_text(json.dumps(wanted))
    return folder / "log.csv", folder / "map.json"


def fitted(log: Path, columns: Path, **options: Any) -> tuple[FrictionFit, dict[str, Any]]:
    """The fit, and the description that it began with."""
    converted = convert_table(log, columns)
    data = describe_joint(converted)
    return FrictionFit(data, kinematics=3, threads=1, **options).fit(pd.DataFrame(converted.columns)), data


def numbers(fit: FrictionFit) -> dict[str, float]:
    return {path.rpartition(".")[2]: value for path, value in fit.parameters_.items()}


@pytest.mark.parametrize("seed", [11, 12, 13])
@pytest.mark.parametrize(
    "options",
    [
        {"share": 0.0},
        {"share": 0.2},
        {"share": 0.5},
        {"share": 0.8},
        {"share": 0.5, "begins_at_rest": False, "offset": 0.1},
        {"share": 0.5, "angle_noise": 2e-4},
        {"share": 0.8, "angle_noise": 2e-4, "rate": 500.0},
        {"share": 0.8, "noise": 0.03},
        {"share": 0.5, "rate": 25.0},
    ],
    ids=lambda options: ",".join(f"{name}={value:g}" for name, value in options.items()),
)
def test_the_truth_is_found_whatever_the_share_at_rest(tmp_path: Path, options: dict[str, Any], seed: int) -> None:
    log = servo.servo_log(seed, duration=40.0, **options)
    fit, _ = fitted(*written(tmp_path, {name: log[name] for name in ("t", "torque", "angle")}))
    found = numbers(fit)
    assert found["coulomb"] == pytest.approx(servo.COULOMB, rel=0.05)
    assert found["viscous"] == pytest.approx(servo.VISCOUS, rel=0.05)
    assert found["initial_torque[1]"] == pytest.approx(options.get("offset", 0.0), abs=0.01)
    share = fit.report_["recordings"][0]["at_rest"] / fit.report_["recordings"][0]["samples"]
    assert share == pytest.approx(log["sticks"], abs=0.1)


@pytest.mark.parametrize("seed", [11, 12])
@pytest.mark.parametrize("method", ["batch", "ekf"])
def test_a_known_load_leaves_the_friction(tmp_path: Path, seed: int, method: str) -> None:
    """Without extensions both methods learn sample by sample; friction grows with the weight that it is given."""
    log = servo.servo_log(seed, duration=40.0, load=0.5)
    fit, _ = fitted(*written(tmp_path, log, known=True), method=method)
    found = numbers(fit)
    assert servo.COULOMB < found["coulomb"] < servo.COULOMB + servo.LOAD_SHARE * 0.5
    assert found["viscous"] == pytest.approx(servo.VISCOUS, rel=0.05)


def test_what_is_held_out_and_compared_is_motion(tmp_path: Path) -> None:
    """The share of rests does not dilute an error: with the truth, noise alone is left."""
    log, columns = written(tmp_path, servo.servo_log(14, duration=60.0, noise=0.02))
    converted = convert_table(log, columns)
    table = pd.DataFrame(converted.columns)
    half = len(table) // 2
    fit = FrictionFit(describe_joint(converted), kinematics=3, threads=1, holdout=0.3)
    fit.fit(table[:half].reset_index(drop=True), table[half:].reset_index(drop=True))
    residual = fit.report_["residual"]
    for judged in (residual["train"], residual["held_out"], residual["comparisons"][0]):
        assert judged["rms"][0] == pytest.approx(0.02, rel=0.2)


BIASES: tuple[dict[str, Any], ...] = ({}, {"forget_rate": 0.0}, {"forgetting": "absorption"}, {"drift_variance": 1e-9})


@pytest.mark.parametrize("bias", BIASES, ids=str)
@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_a_finger_with_tendons_and_a_learning_bias(bias: dict[str, Any], share: float) -> None:
    """Two tendons hold the torque of the servo at a pretension; a bias would follow what it sees at rest."""
    log = servo.servo_log(21, duration=40.0, share=share, noise=0.0)
    torque, arm, stiffness = log["torque"] - log["known"], 0.01, 1e5
    noise = np.random.default_rng(21).normal(0.0, 0.1, (len(torque), 2))
    force = 50.0 + np.outer(torque, [0.5 / arm, -0.5 / arm])
    position = np.outer(log["angle"], [arm, -arm]) + force / stiffness
    table = pd.DataFrame({"time": log["t"]})
    columns = [f"tendon_{what}[{i}]" for what in ("force", "position") for i in (1, 2)]
    table[columns] = np.hstack([force + noise, position])
    table["joint_position[1]"] = log["angle"]
    table["joint_velocity[1]"] = log["velocity"]
    law = {"static": 0.2, "coulomb": 0.2, "stribeck_velocity": 0.1, "viscous": 0.1}
    tendons = [{"name": str(way), "stiffness": stiffness, "moment_arms": [way * arm]} for way in (1, -1)]
    finger = {
        "format": "tendonfmu-finger-1",
        "name": "finger",
        "joints": [{"name": "joint", "friction": law}],
        "tendons": tendons,
        "bias": {"noise_std": 1e-3, **bias},
        "contact": {"threshold": [0.1]},
    }
    found = numbers(FrictionFit(finger, kinematics=3, threads=1).fit(table))
    assert (found["coulomb"], found["viscous"]) == pytest.approx((servo.COULOMB, servo.VISCOUS), rel=0.05)


def two_joint_arm(bias: dict[str, Any]) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Two drives that move by turns of 4 s; the one that rests is held with any torque up to Coulomb friction."""
    random = np.random.default_rng(31)
    time = np.arange(0.0, 80.0, 0.002)
    columns: dict[str, Any] = {"time": time}
    for j in (1, 2):
        turn, phase = time // 4.0, time % 4.0 / 4.0
        velocity = np.where(turn % 2 == j - 1, 3.0 * np.sin(4 * np.pi * phase) * np.sin(np.pi * phase) ** 2, 0.0)
        held = random.uniform(-0.9, 0.9, 20)[turn.astype(int)] * servo.COULOMB
        torque = np.where(velocity == 0.0, held, servo.COULOMB * np.sign(velocity) + servo.VISCOUS * velocity)
        angle = np.cumsum(velocity) * 0.002
        columns |= {f"tendon_force[{j}]": torque + random.normal(0.0, NOISE, len(time))}
        columns |= {f"tendon_position[{j}]": angle, f"joint_position[{j}]": angle, f"joint_velocity[{j}]": velocity}
    law = {"static": 0.1, "coulomb": 0.1, "stribeck_velocity": 0.05, "viscous": 0.02}
    finger = {
        "format": "tendonfmu-finger-1",
        "name": "arm",
        "joints": [{"name": name, "friction": law} for name in ("shoulder", "elbow")],
        "tendons": [{"stiffness": 1e9, "bidirectional": True, "moment_arms": row} for row in np.eye(2).tolist()],
        "contact": {"threshold": [1.0, 1.0]},
        "velocity_threshold": {"joint": 0.01, "tendon": 0.01},
        "bias": bias,
    }
    return pd.DataFrame(columns), finger


NOISE = 0.01  # N·m
CONSTANT = {
    "drift_variance": 0.0,
    "initial_variance": 0.0,
    "forget_rate": 0.0,
    "noise_std": 0.02,
    "initial_torque": [0.0, 0.0],
}


@pytest.mark.parametrize("bias", [CONSTANT, {}], ids=["constant bias", "learning bias"])
def test_a_joint_that_rests_while_another_moves_says_nothing(bias: dict[str, Any]) -> None:
    """Samples at rest of a joint count for none, as if they were left out of its own equation alone."""
    table, finger = two_joint_arm(bias)
    fit = FrictionFit(finger, kinematics=3, threads=1).fit(table)
    for j in (1, 2):
        found = fit.parameters_[f"joints[{j}].friction.coulomb"], fit.parameters_[f"joints[{j}].friction.viscous"]
        assert found == pytest.approx((servo.COULOMB, servo.VISCOUS), rel=0.05)
    if bias:
        assert fit.report_["residual"]["train"]["rms"] == pytest.approx([NOISE, NOISE], rel=0.1)


def test_diagnose_learns_nothing_from_a_motor_that_holds(tmp_path: Path) -> None:
    """Kept, rests look like friction that builds up gradually and then decays."""
    log, columns = written(tmp_path, servo.servo_log(17, duration=40.0))
    converted = convert_table(log, columns)
    result = diagnose(describe_joint(converted), pd.DataFrame(converted.columns), kinematics=3)
    assert result.causes == () and result.verdict == "adequate"
    assert result.found.nominal.test_rms[0] == pytest.approx(0.02, rel=0.2)


def test_check_and_fit_name_the_share_at_rest(call: Call, tmp_path: Path) -> None:
    made = servo.servo_log(15, duration=30.0)
    log, columns = written(tmp_path, {name: made[name] for name in ("t", "torque", "angle")})
    converted = call("convert", "table", log.name, "--map", columns.name, "-o", "rec.parquet", "--finger", "f.json")
    assert converted.status == 0, converted.err
    data = json.loads((tmp_path / "f.json").read_text())
    velocity = pd.read_parquet(tmp_path / "rec.parquet")["joint_velocity[1]"].to_numpy()[:, None]
    share = f"{100 * left_at_rest(data, velocity).mean():.2g} % at rest"
    assert share in call("check", "f.json", "rec.parquet").out
    answer = call("fit", "f.json", "rec.parquet", "--kinematics", "3", "-o", "fitted.json")
    assert share in answer.err
    assert "pretension" not in answer.out


def test_a_machine_without_tendons_gets_no_advice_about_pretension(tmp_path: Path) -> None:
    """Five seconds with much noise: numbers are not identified, and the advice is time."""
    fit, _ = fitted(*written(tmp_path, servo.servo_log(16, duration=4.0, begins_at_rest=False, noise=0.5)))
    advice = [number["advice"] for number in fit.report_["parameters"] if number["advice"]]
    assert advice and not any("pretension" in each for each in advice), advice


def test_at_rest_means_that_no_friction_slides() -> None:
    data = describe_joint_of(0.02)
    speed = np.array([[0.0], [0.02], [-0.02], [0.021], [-0.021]])
    assert left_at_rest(data, speed).ravel().tolist() == [True, True, True, False, False]


def describe_joint_of(threshold: float) -> dict[str, Any]:
    data = joint_description("axis", torque=4.0, speed=5.0)
    return data | {"velocity_threshold": {"tendon": threshold, "joint": threshold}}


@needs("cases")
def test_the_case_is_right() -> None:
    found = numbers(fitted(CASE / "rest_1s.csv", CASE / "map.json")[0])
    assert (found["coulomb"], found["viscous"]) == pytest.approx((0.300, 0.250), rel=0.05)
