"""Machines with one joint: what `convert table` makes of their logs; docs/reference/commands/convert.md to the end."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command import Call
from map_cases import TURNING, VALIDATOR, edited, written
from tendonfmu.errors import InputError
from tendonfmu.files.tables import write_table
from tendonfmu.model.description import read_finger
from tendonfmu.recordings.converters.one_joint import central_velocity, starting_numbers
from tendonfmu.recordings.converters.table import convert_table

COULOMB, VISCOUS, INERTIA, OFFSET = 0.8, 0.3, 0.05, 0.1


def machine(rate: float = 500.0, rest: float = 0.4, noise: float = 0.0) -> dict[str, Any]:
    """time, angle, velocity, acceleration and torque of a joint that rests and then swings; all exact but for noise."""
    time = np.arange(0.0, 12.0, 1 / rate)
    t = np.maximum(time - rest, 0.0)
    parts = [(1.0, 2.1), (0.4, 5.3)]
    angle = sum(a * (1 - np.cos(w * t)) for a, w in parts)
    velocity = sum(a * w * np.sin(w * t) for a, w in parts)
    acceleration = sum(a * w * w * np.cos(w * t) for a, w in parts) * (time >= rest)
    torque = COULOMB * np.sign(velocity) + VISCOUS * velocity + INERTIA * acceleration + OFFSET
    torque = torque + np.random.default_rng(1).normal(0.0, noise, len(time)) if noise else torque
    return {"t": time, "angle": angle, "speed": velocity, "accelerating": INERTIA * acceleration, "torque": torque}


def machine_log(folder: Path, signals: dict[str, Any], wanted: dict[str, Any] = TURNING) -> tuple[Path, Path]:
    write_table(folder / "log.csv", signals)
    VALIDATOR.validate(wanted)
    return written(folder, (folder / "log.csv").read_bytes(), wanted)


def test_torque_is_the_force_of_one_tendon(tmp_path: Path) -> None:
    """The start at rest is left out; the velocity is within 1 % of the largest one, without delay."""
    signals = machine()
    log = convert_table(*machine_log(tmp_path, signals))
    found = log.columns
    begin = len(signals["t"]) - len(found["time"])
    # the filter without delay begins some milliseconds early
    assert 0.39 * 500 <= begin < 0.45 * 500 and f"{begin} samples at rest" in log.notes[1]
    assert found["tendon_force[1]"].tolist() == signals["torque"][begin:].tolist()
    assert found["tendon_position[1]"].tolist() == found["joint_position[1]"].tolist()
    assert found["joint_position[1]"].tolist() == signals["angle"][begin:].tolist()
    error = np.abs(found["joint_velocity[1]"] - signals["speed"][begin:])[20:-20]
    assert error.max() < 0.01 * np.abs(signals["speed"]).max()
    assert "20 Hz" in log.notes[0]


def test_a_given_velocity_and_known_load_are_taken_as_they_are(tmp_path: Path) -> None:
    wanted = edited(TURNING, "joint/velocity", {"column": "speed", "unit": "rad/s"})
    wanted = edited(wanted, "joint/known_load", {"column": "accelerating", "unit": "N.m"})
    signals = machine(rest=0.0)
    found = convert_table(*machine_log(tmp_path, signals, wanted)).columns
    kept = len(found["time"])
    assert found["joint_velocity[1]"].tolist() == signals["speed"][-kept:].tolist()
    assert found["external_torque[1]"].tolist() == signals["accelerating"][-kept:].tolist()
    numbers = starting_numbers(found, 1e-3)
    truth = {"coulomb": COULOMB, "viscous": VISCOUS, "offset": OFFSET}
    assert {name: numbers[name] for name in truth} == pytest.approx(truth, rel=1e-5)


def test_a_sliding_axis_is_the_same_in_metres(tmp_path: Path) -> None:
    parts = {"force": "torque", "position": "angle"}
    sliding = {"kind": "sliding", "time": {"column": "t", "unit": "s"}}
    sliding |= {"force": {"column": "torque", "unit": "mN"}, "position": {"column": "angle", "unit": "mm"}}
    turning = convert_table(*machine_log(tmp_path, machine())).columns
    signals = machine() | {name: 1e3 * machine()[name] for name in parts.values()}
    found = convert_table(*machine_log(tmp_path, signals, {"format": "tendonfmu-map-1", "joint": sliding})).columns
    for name, values in turning.items():
        assert found[name] == pytest.approx(values, rel=1e-9, abs=1e-9), name
    for wrong, words in (("torque", "unknown key"), ("angle", "unknown key")):
        bad = {"format": "tendonfmu-map-1", "joint": {**sliding, wrong: {"column": "t", "unit": "rad"}}}
        with pytest.raises(InputError, match=words):
            convert_table(*written(tmp_path, wanted=bad))


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("joint/angle", ..., ["joint.angle: missing", "rad", "deg"]),
        ("joint/kind", "flying", ["joint.kind", "turning", "sliding"]),
        ("joint/velocity_cutoff", 200, ["500 samples per second", "joint.velocity_cutoff = 200", "at most 100 Hz"]),
        ("joint/velocity_cutoff", -1, ["joint.velocity_cutoff", "at least 0"]),
        ("joint/angle/unit", "mm", ["joint.angle.unit", "rad, mrad, deg, turn"]),
        ("joint/angle/column", "angel", ["'angel'", "joint.angle", "it has angle"]),
    ],
)
def test_wrong_joints_are_refused(tmp_path: Path, path: str, value: Any, words: list[str]) -> None:
    write_table(tmp_path / "log.csv", machine())
    with pytest.raises(InputError) as refused:
        convert_table(*written(tmp_path, (tmp_path / "log.csv").read_bytes(), edited(TURNING, path, value)))
    assert all(word in str(refused.value) for word in words), refused.value


def test_what_does_not_move_is_refused(tmp_path: Path) -> None:
    still = {name: values[:100] for name, values in machine(rest=5.0).items()}
    with pytest.raises(InputError, match=r"log\.csv: the joint does not move"):
        convert_table(*machine_log(tmp_path, still))
    with pytest.raises(InputError, match=r"19 samples; expected at least 20"):
        convert_table(*machine_log(tmp_path, {name: values[:19] for name, values in machine(rest=0.0).items()}))


# --- the example ------------------------------------------------------------------------------------------------------


def test_no_filter_passes_over_a_gap() -> None:
    """A joint that is elsewhere after the log was interrupted: no velocity comes of the jump."""
    time = np.r_[np.arange(0.0, 1.0, 0.002), np.arange(5.0, 6.0, 0.002)]
    angle = 0.5 * time + 3.0 * (time > 3.0)
    assert central_velocity(time, angle, 20.0) == pytest.approx(0.5, rel=1e-6)


def test_the_description_is_sound_and_its_numbers_are_those_of_the_log(call: Call, tmp_path: Path) -> None:
    machine_log(tmp_path, machine(noise=0.02))
    answer = call("convert", "table", "log.csv", "--map", "map.json", "-o", "rec.parquet", "--finger", "finger.json")
    assert answer.status == 0, answer.err
    data = read_finger(tmp_path / "finger.json").data
    law = data["joints"][0]["friction"]
    assert law["static"] == law["coulomb"] == pytest.approx(COULOMB, rel=0.02)
    assert law["viscous"] == pytest.approx(VISCOUS, rel=0.02)
    assert data["extensions"][0]["inertia"] == pytest.approx(INERTIA, rel=0.05)
    assert data["bias"]["initial_torque"][0] == pytest.approx(OFFSET, abs=0.01)
    answer = call("check", "finger.json", "rec.parquet")
    assert answer.status == 0 and "belongs to this finger" in answer.out and answer.err == ""
    assert call("fit", "finger.json", "rec.parquet", "--kinematics", "3", "-o", "fitted.json").status == 0
    fitted = read_finger(tmp_path / "fitted.json").data["joints"][0]["friction"]
    assert (fitted["coulomb"], fitted["viscous"]) == pytest.approx((COULOMB, VISCOUS), rel=0.02)


# --- describe joint ---------------------------------------------------------------------------------------------------


def test_a_description_without_a_log(call: Call, tmp_path: Path) -> None:
    """It is sound, holds what was given, and a recording fits it to the friction of the machine."""
    answer = call("describe", "joint", "--name", "axis 3", "--torque", "4", "--coulomb", "0.5", "-o", "axis.json")
    assert answer.status == 0 and "axis 3" in answer.err, answer
    data = read_finger(tmp_path / "axis.json").data
    law = data["joints"][0]["friction"]
    assert (data["name"], law["coulomb"], law["viscous"]) == ("axis 3", 0.5, pytest.approx(0.02 * 4 / 5))
    machine_log(tmp_path, machine(noise=0.02))
    assert call("convert", "table", "log.csv", "--map", "map.json", "-o", "rec.parquet").status == 0
    assert call("check", "axis.json", "rec.parquet").status == 0
    assert call("fit", "axis.json", "rec.parquet", "--kinematics", "3", "-o", "fitted.json").status == 0
    fitted = read_finger(tmp_path / "fitted.json").data["joints"][0]["friction"]
    assert (fitted["coulomb"], fitted["viscous"]) == pytest.approx((COULOMB, VISCOUS), rel=0.03)


def test_a_description_from_a_recording_is_that_of_convert(call: Call, tmp_path: Path) -> None:
    machine_log(tmp_path, machine(noise=0.02))
    made = call("convert", "table", "log.csv", "--map", "map.json", "-o", "rec.parquet", "--finger", "one.json")
    assert made.status == 0
    assert call("describe", "joint", "--name", "joint", "--recording", "rec.parquet", "-o", "other.json").status == 0
    assert json.loads((tmp_path / "one.json").read_text()) == json.loads((tmp_path / "other.json").read_text())
    for arguments, words in (
        (["servo", "--name", "a"], ["'servo'", "joint or finger"]),
        (["joint", "--name", " "], ["--name"]),
        (["joint", "--name", "a", "--recording", "rec.parquet", "--torque", "3"], ["--torque", "--recording"]),
        (["joint", "--name", "a", "--recording", "absent.csv"], ["absent.csv"]),
    ):
        answer = call("describe", *arguments, "-o", "new.json")
        assert answer.status == 2 and len(answer.err.splitlines()) == 1, answer
        assert all(word in answer.err for word in words) and not (tmp_path / "new.json").exists()
