"""Traps of real logs, each put into a sound recording and named."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command import Call
from repository_paths import ROOT
from tendonfmu.arrays import Numbers
from tendonfmu.model import Finding, Finger, finger_from_data, read_finger
from tendonfmu.recordings import Recording, belongs, read_recording
from tendonfmu.recordings.converters.table import convert_table
from tendonfmu.recordings.routing import learn_routing
from tendonfmu.recordings.traps import find_traps, is_magnitude, wrap_of

INDEX = ROOT / "examples" / "fingers" / "index_finger.json"
DEMO = ROOT / "examples" / "demo_recording"
FREE = DEMO / "index_finger_free.parquet"


@pytest.fixture(scope="module")
def sound() -> tuple[Finger, Recording]:
    return read_finger(INDEX), read_recording(FREE)[:30.0]


def found(sound: tuple[Finger, Recording], **groups: Numbers) -> list[Finding]:
    finger, recording = sound
    return belongs(finger, [replace(recording, groups={**recording.groups, **groups})])


def test_signed_numbers_stored_as_unsigned(sound: tuple[Finger, Recording]) -> None:
    counts = np.round(sound[1].groups["tendon_position"] / 2e-6)
    counts[:, 0] = (counts[:, 0] - np.round(np.median(counts[:, 0]))) % 65536
    (finding,) = found(sound, tendon_position=2e-6 * counts)
    assert (finding.kind, finding.columns, finding.severity) == ("wrapped", ("tendon_position[1]",), "error")
    assert "jumps by 65536 steps" in finding.line() and '"wrap": 65536' in finding.line()
    assert wrap_of(np.sign(np.sin(np.arange(1000) / 50.0))) is None  # a command in steps


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


def test_a_burst_at_the_end_is_no_unit() -> None:
    """A tendon that snaps back from slack passes 4.1 times a force within a sample: it was told to be in lbf."""
    rng, count = np.random.default_rng(1), 24 * 600
    force, position = 14.0 + 0.03 * rng.normal(size=(count, 4)), 1e-5 * rng.normal(size=(count, 4))
    force[-100:-93, 0] = 14.0, 0.0, 6.07, 25.0, 27.64, 15.7, 3.3
    recording = Recording(Path("x"), 0.004 * np.arange(count), {"tendon_force": force, "tendon_position": position})
    assert list(find_traps(read_finger(DEMO / "two_joints.json"), recording)) == []
    force[-100:-93, 0] = 14.0
    force[-4000:, 0] *= 4.448222
    (trap,) = find_traps(read_finger(DEMO / "two_joints.json"), recording)
    assert (trap.kind, trap.numbers["unit"]) == ("switched", "lbf")
    assert trap.numbers["at"] == pytest.approx(41.6, abs=2.4)


def test_a_slow_encoder_of_14_bits_repeats_its_values(sound: tuple[Finger, Recording]) -> None:
    """In degrees with four decimals its steps are unequal by rounding, and slow motion counted as fast."""
    step = 360.0 / 2**14
    degrees = np.round(np.round(np.degrees(0.3 * sound[1].groups["joint_position"]) / step) * step, 4)
    columns = np.radians(degrees) / 0.3
    repeats = (np.diff(columns, axis=0) == 0.0).all(axis=1).mean()
    assert repeats > 0.05 and "repeated" not in [each.kind for each in found(sound, joint_position=columns)]


def moving(stiffness_at: float = 1.0, stuck: bool = False) -> tuple[Finger, Recording]:
    """A minute of both joints; the second stands half of the time, or its encoder is stuck."""
    finger = read_finger(DEMO / "two_joints.json")
    time = np.arange(30000) / 500.0
    strokes = 0.5 - 0.5 * np.cos(np.pi * np.clip(time % 4.0, 0.0, 2.0))
    angle = np.column_stack([0.5 * np.sin(1.7 * time), strokes])
    noise = 0.02 * np.random.default_rng(1).normal(size=(30000, 4))
    force = 12.0 + 3.0 * np.sin(0.9 * time[:, None] + np.arange(4)) + noise
    stiffness = stiffness_at * np.array([tendon["stiffness"] for tendon in finger.data["tendons"]])
    stretch = (force - 12.0) / stiffness + 12.0 * stiffness_at / stiffness  # as described at the mean force
    position = angle @ np.array(finger.moment_arms).T + stretch
    measured = np.round(angle / 4e-4) * 4e-4
    if stuck:
        measured[2000:4000, 1] = measured[2000, 1]
    groups = {"tendon_force": force, "tendon_position": position, "joint_position": measured}
    return finger, Recording(Path("x"), time, groups)


def test_a_joint_that_stands_is_not_stuck() -> None:
    """The guessed arms made its tendons seem to move it, with those of the joint before."""
    finger, recording = moving()
    arms = np.array(finger.moment_arms)
    arms[:, 0] *= 1.4, 1.0, 0.7, 1.0
    guessed = finger.replace({f"tendons[{i + 1}].moment_arms": row.tolist() for i, row in enumerate(arms)})
    assert "held" not in [finding.kind for finding in belongs(guessed, [recording])]
    stuck = [each for each in belongs(guessed, [moving(stuck=True)[1]]) if each.kind == "held"]
    assert [finding.columns for finding in stuck] == [("joint_position[2]",)]


def test_a_calibrated_finger_is_not_told_to_be_calibrated() -> None:
    """A spring that stiffens has another stiffness and zero at each pretension, which give the same angle."""
    finger, recording = moving(stiffness_at=1.06)
    assert any(each.differs for each in learn_routing(finger, [recording])) and belongs(finger, [recording]) == []
    finger, recording = moving()
    off = finger.replace({"tendons[1].zero": 2e-4})
    (finding,) = belongs(off, [recording])
    assert finding.kind == "routing" and "zero is off by -0.2" in finding.line()


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
    assert "count: jumps by 256:" in answer.err and "device_ms: runs +50 ppm against t: two clocks" in answer.err


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


def test_a_load_that_friction_nearly_balances_one_way_is_no_magnitude() -> None:
    phase = np.linspace(0.0, 40.0, 4000)
    angle, way = np.sin(phase), np.tanh(20.0 * np.cos(phase))
    signed = 10.0 + 9.99 * way + 0.005 * np.sin(300.0 * phase)  # closing against a spring, opening with it
    assert 0.0 <= signed.min() < 0.005 * signed.max()
    assert not is_magnitude(signed, angle)
