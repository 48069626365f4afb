"""Traps of real logs, each put into a sound recording and named."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command import Call
from optional_parts import require
from repository_paths import ROOT
from tendonfmu.arrays import Numbers
from tendonfmu.model import Finding, Finger, finger_from_data, read_finger
from tendonfmu.recordings import Recording, belongs, read_recording
from tendonfmu.recordings.converters.table import convert_table
from tendonfmu.recordings.traps import is_magnitude, wrapped

INDEX = ROOT / "examples" / "fingers" / "index_finger.json"
FREE = ROOT / "examples" / "demo_recording" / "index_finger_free.parquet"


@pytest.fixture(scope="module")
def sound() -> tuple[Finger, Recording]:
    return read_finger(INDEX), read_recording(FREE)[:30.0]


def found(sound: tuple[Finger, Recording], **groups: Numbers) -> list[Finding]:
    finger, recording = sound
    return belongs(finger, [replace(recording, groups={**recording.groups, **groups})])


def test_a_sound_recording_has_none(sound: tuple[Finger, Recording]) -> None:
    assert found(sound) == []


def test_signed_numbers_stored_as_unsigned(sound: tuple[Finger, Recording]) -> None:
    counts = np.round(sound[1].groups["tendon_position"] / 2e-6)
    counts[:, 0] = (counts[:, 0] - np.round(np.median(counts[:, 0]))) % 65536
    (finding,) = found(sound, tendon_position=2e-6 * counts)
    assert (finding.kind, finding.columns, finding.severity) == ("wrapped", ("tendon_position[1]",), "error")
    assert "jumps by 65536 steps" in finding.line() and '"wrap": 65536' in finding.line()
    assert wrapped(np.sign(np.sin(np.arange(1000) / 50.0))) is None  # a command in steps


def test_a_gap_filled_by_straight_lines(sound: tuple[Finger, Recording]) -> None:
    time, filled = sound[1].time, {}
    for name, values in sound[1].groups.items():
        filled[name] = values.copy()
        for column in filled[name].T:
            column[5000:5150] = np.interp(time[5000:5150], time[[4999, 5150]], column[[4999, 5150]])
    (finding,) = found(sound, **filled)
    assert finding.kind == "filled" and "for 0.302 s from 9.998 s" in finding.line()


@pytest.mark.parametrize("every", [2, 5])
def test_a_slower_sensor(sound: tuple[Finger, Recording], every: int) -> None:
    force = sound[1].groups["tendon_force"]
    (finding,) = found(sound, tendon_force=force[np.arange(len(force)) // every * every])
    assert finding.kind == "slow" and f"only once in {every} samples, of 500 a second" in finding.line()


def test_a_log_written_by_another_clock(sound: tuple[Finger, Recording]) -> None:
    """At 490 samples a second of a sensor and 500 of the log each 50th sample repeats; at 450 each tenth."""
    position = sound[1].groups["tendon_position"]
    for rate, named in ((490.0, []), (450.0, ["repeated"])):
        held = position[np.floor(np.floor(np.arange(len(position)) * rate / 500.0) * 500.0 / rate).astype(int)]
        kinds = [finding.kind for finding in found(sound, tendon_position=held)]
        assert kinds == named


@pytest.mark.parametrize(
    ("group", "factor", "unit"),
    [("tendon_position", 1e3, "mm"), ("tendon_force", 1e3, "mN"), ("joint_position", 180 / np.pi, "degrees")],
)
def test_another_unit_from_the_middle_on(sound: tuple[Finger, Recording], group: str, factor: float, unit: str) -> None:
    values = sound[1].groups[group].copy()
    values[len(values) // 2 :, 1] *= factor
    (finding,) = found(sound, **{group: values})
    assert (finding.kind, finding.columns) == ("switched", (f"{group}[2]",)) and unit in finding.line()
    assert "times as much after 1" in finding.line()  # 15 s


@pytest.mark.parametrize("ppm", [10.0, 100.0])
def test_two_clocks(sound: tuple[Finger, Recording], ppm: float) -> None:
    time, angles = sound[1].time, sound[1].groups["joint_position"]
    drifting = np.column_stack([np.interp(time * (1 + 1e-6 * ppm), time, angle) for angle in angles.T])
    (finding,) = found(sound, joint_position=drifting)
    assert finding.kind == "drift" and finding.severity == "warning"
    assert float(finding.seen.split("run ")[1].split(" ")[0]) == pytest.approx(ppm, abs=4.0)


# --- logs -------------------------------------------------------------------------------------------------------------


def servo(folder: Path) -> Path:
    """A log with lists in its cells, efforts without a sign, and counts without one."""
    time = np.arange(2000) / 100.0
    speed = np.cos(time)
    lists = [f'"[{np.sin(t):.6f}, 0.5]"' for t in time]
    count = np.round(40 * np.sin(time)).astype(int) % 256
    rows = zip(
        time, lists, speed, np.abs(0.3 * speed + 0.1 * np.sin(3 * time)), count, 1e3 * 1.00005 * time, strict=True
    )
    lines = [",".join(map(str, row)) for row in rows]
    (folder / "log.csv").write_text("\n".join(["t,positions,velocity,torque,count,device_ms", *lines]) + "\n")
    return folder / "log.csv"


def test_what_inspect_says(tmp_path: Path, call: Call) -> None:
    answer = call("convert", "inspect", servo(tmp_path), "-o", tmp_path / "map.json")
    assert answer.status == 0 and "positions[2]" in answer.out
    assert "torque: never negative while the joint moves both ways: a magnitude" in answer.err
    assert "count: jumps by 256 steps" in answer.err and "device_ms: runs +50 ppm against t: two clocks" in answer.err


def test_a_magnitude_is_refused_by_check(tmp_path: Path, call: Call) -> None:
    columns = {
        "time": {"rate": 100},
        "torque": {"column": "torque", "unit": "N.m"},
        "angle": {"column": "positions[1]", "unit": "rad"},
    }
    map_ = {"format": "tendonfmu-map-1", "joint": {"name": "servo", **columns}}
    (tmp_path / "map.json").write_text(json.dumps(map_), encoding="utf-8")
    out, finger = tmp_path / "out.parquet", tmp_path / "servo.json"
    said = call("convert", "table", servo(tmp_path), "--map", tmp_path / "map.json", "-o", out, "--finger", finger)
    assert said.status == 0 and "never negative while servo moves both ways: a magnitude" in said.err
    answer = call("check", finger, out)
    assert (
        answer.status == 1 and "tendon_force[1]: never negative while servo moves both ways" in answer.out + answer.err
    )


def test_what_is_no_magnitude_and_no_slow_sensor() -> None:
    """A force that only comes near 0, a sensor without signal, and steps that are far apart."""
    angle = np.sin(np.arange(4000) / 200.0)
    assert is_magnitude(np.abs(angle), angle)
    assert not is_magnitude(1.0005 + np.cos(np.arange(4000) / 200.0), angle) and not is_magnitude(0.0 * angle, angle)
    assert not is_magnitude(np.ones(1), np.ones(1))
    stairs = np.repeat(np.arange(60.0), 1500)[:, None]
    groups = {"tendon_force": stairs, "tendon_position": 1e-3 * stairs}
    recording = Recording(Path("stairs.csv"), np.arange(len(stairs)) / 500.0, groups)
    data = {"format": "tendonfmu-finger-1", "name": "m", "joints": [{"name": "j"}], "contact": {"threshold": [0.1]}}
    data["tendons"] = [{"stiffness": 1e5, "moment_arms": [0.01]}]
    assert "slow" not in [finding.kind for finding in belongs(finger_from_data(data), [recording])]


def test_wrap_and_rate_of_a_map(tmp_path: Path) -> None:
    document = {
        "format": "tendonfmu-map-1",
        "columns": {
            "time": {"rate": 100, "comment": "the log has none"},
            "tendon_force[1]": {"column": "torque", "unit": "N"},
            "tendon_position[1]": {"column": "count", "unit": "mm", "wrap": 256, "offset": 1},
        },
    }
    (tmp_path / "map.json").write_text(json.dumps(document), encoding="utf-8")
    columns = convert_table(servo(tmp_path), tmp_path / "map.json").columns
    np.testing.assert_allclose(columns["time"], np.arange(2000) / 100.0)
    np.testing.assert_allclose(
        columns["tendon_position[1]"], 1e-3 * (np.round(40 * np.sin(columns["time"])) - 1), atol=1e-12
    )


def test_lists_of_another_length_are_named(tmp_path: Path, call: Call) -> None:
    (tmp_path / "log.csv").write_text('t,q\n0.0,"[1, 2]"\n0.1,"[1, 2]"\n0.2,"[1]"\n', encoding="utf-8")
    answer = call("convert", "inspect", tmp_path / "log.csv")
    assert answer.status == 2 or "q" in answer.out


def test_the_servo_arm_s_currents_are_named(call: Call) -> None:
    folder = require("so101 data") / "friction_gravity"
    answer = call("convert", "inspect", folder / "state_motor.csv")
    assert "torques[1], torques[2], torques[3]" in answer.err and "a magnitude" in answer.err


def test_a_load_that_friction_nearly_balances_one_way_is_no_magnitude() -> None:
    phase = np.linspace(0.0, 40.0, 4000)
    angle, way = np.sin(phase), np.tanh(20.0 * np.cos(phase))
    signed = 10.0 + 9.99 * way + 0.005 * np.sin(300.0 * phase)  # closing against a spring, opening with it
    assert 0.0 <= signed.min() < 0.005 * signed.max()
    assert not is_magnitude(signed, angle)
