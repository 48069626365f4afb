"""`convert inspect`: what it lists and proposes, how sure it says to be, and that its map then works."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("tendonfmu._native", reason="SKIPPED: tendonfmu is not installed")

from command import Call
from map_cases import VALIDATOR
from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.inspection import inspect_log
from tendonfmu.recordings.converters.proposal import Line, propose
from tendonfmu.recordings.converters.table import convert_table

T = np.arange(400) / 200.0
ANGLE = 0.6 * np.sin(3 * T)
FORCE = 12 + 4 * np.cos(2 * T)
SPOOL = 0.009 * ANGLE + FORCE / 4000


def proposed(folder: Path, columns: dict[str, Any], name: str = "log.csv", **how: Any) -> dict[str, Line]:
    pd.DataFrame(columns).to_csv(folder / name, index=False, **how)
    proposal = propose(inspect_log(folder / name))
    VALIDATOR.validate(proposal.document)
    (folder / "map.json").write_text(json.dumps(proposal.document), encoding="utf-8")
    return {line.column: line for line in proposal.lines}


def check(folder: Path, name: str = "log.csv") -> None:
    found = convert_table(folder / name, folder / "map.json").columns
    assert found["time"] - found["time"][0] == pytest.approx(T, abs=1e-6)
    assert found["tendon_force[1]"] == pytest.approx(FORCE, rel=1e-6)
    assert found["tendon_position[1]"] == pytest.approx(SPOOL, abs=1e-9)
    assert found["joint_position[1]"] == pytest.approx(ANGLE, abs=1e-6)


def test_units_in_names_are_sure(tmp_path: Path) -> None:
    """Degrees, millimetres and milliseconds, with ; and decimal commas, in other names and another order."""
    columns = {"q1 (deg)": np.degrees(ANGLE), "Time [ms]": 1000 * T, "Motor1_mm": 1000 * SPOOL}
    columns |= {"loadCell1 [mN]": 1000 * FORCE, "board_temp": 30.0}
    lines = proposed(tmp_path, columns, sep=";", decimal=",")
    assert {name: (line.source, line.unit, line.sure) for name, line in lines.items()} == {
        "time": ("Time [ms]", "ms", "sure"),
        "tendon_force[1]": ("loadCell1 [mN]", "mN", "sure"),
        "tendon_position[1]": ("Motor1_mm", "mm", "sure"),
        "joint_position[1]": ("q1 (deg)", "deg", "sure"),
    }
    check(tmp_path)


def test_units_by_range_are_likely_or_guesses(tmp_path: Path) -> None:
    columns = {"stamp": 1_774_746_000 + T, "tension": FORCE, "spool_position": 1000 * SPOOL, "joint_angle": ANGLE}
    lines = proposed(tmp_path, columns)
    assert {name: (line.unit, line.sure) for name, line in lines.items()} == {
        "time": ("epoch_s", "sure"),
        "tendon_force[1]": ("N", "guess"),
        "tendon_position[1]": ("mm", "likely"),
        "joint_position[1]": ("rad", "likely"),
    }
    check(tmp_path)
    degrees = proposed(tmp_path, {**columns, "joint_angle": np.degrees(ANGLE)})["joint_position[1]"]
    assert (degrees.unit, degrees.sure) == ("deg", "likely") and "too much for radians" in degrees.why


def test_what_cannot_be_decided_is_left_to_the_user_and_refused_by_name(call: Call, tmp_path: Path) -> None:
    """Forces that may be mN or gf; two forces and one position; a motor's angle, which needs a radius."""
    lines = proposed(tmp_path, {"t": T, "F1": 1000 * FORCE, "F2": 900 * FORCE, "x1": 1000 * SPOOL, "motor2_deg": ANGLE})
    assert lines["tendon_force[1]"].unit == "?" and lines["tendon_force[1]"].sure == "undecided"
    assert lines["tendon_position[2]"].unit == "?" or lines["tendon_position[1]"].unit == "?"
    assert any("radius of the spool" in line.why for line in lines.values())
    with pytest.raises(InputError, match=r'map\.json: columns\.tendon_force\[1\]\.unit = "\?".*one of N, mN, kN'):
        convert_table(tmp_path / "log.csv", tmp_path / "map.json")
    answer = call("convert", "inspect", "log.csv", "-o", "new.json")
    assert answer.status == 0 and '"?" is left to you: tendon_force[1]' in answer.err


def test_commands_and_temperatures_are_no_signals(tmp_path: Path) -> None:
    columns = {"time": T, "force": FORCE, "force_cmd": FORCE, "spool_mm": 1000 * SPOOL, "joint_target": ANGLE}
    lines = proposed(tmp_path, columns)
    assert set(lines) == {"time", "tendon_force[1]", "tendon_position[1]"}


def test_a_servo_becomes_one_joint(call: Call, tmp_path: Path) -> None:
    columns = {"t": T, "torque [mN.m]": 800 * np.sign(np.cos(3 * T)), "angle [deg]": np.degrees(ANGLE)}
    proposed(tmp_path, columns, "servo 3.csv")
    document = json.loads((tmp_path / "map.json").read_text(encoding="utf-8"))
    assert document["joint"]["name"] == "servo_3" and document["joint"]["torque"]["unit"] == "mN.m"
    answer = call("convert", "table", "servo 3.csv", "--map", "map.json", "-o", "rec.parquet")
    assert answer.status == 0, answer.err


def test_our_own_names_are_in_si(tmp_path: Path) -> None:
    columns = {"time": T, "tendon_force[1]": FORCE, "tendon_position[1]": SPOOL, "joint_position[1]": 0.01 * ANGLE}
    lines = proposed(tmp_path, columns)
    assert {line.unit for line in lines.values()} == {"s", "N", "m", "rad"}
    assert {line.sure for name, line in lines.items() if name != "time"} == {"sure"}


def test_faults_are_listed(call: Call, tmp_path: Path) -> None:
    """Gaps, repeated times, missing numbers and texts; as text and as JSON."""
    time = np.r_[T[:100], T[99:200], T[260:]] * 1000
    frame = pd.DataFrame({"t_ms": time, "force": 5.0, "spool_mm": 1.0, "state": "run"})
    frame.loc[3:5, "force"] = np.nan
    frame.to_csv(tmp_path / "log.csv", index=False)
    answer = call("convert", "inspect", "log.csv")
    assert answer.status == 0
    for words in ("1 gaps", "1 repeated times", "200 Hz", "largest step 305 ms", "state", "run"):
        assert words in answer.out, words
    answer = call("convert", "inspect", "log.csv", "--json")
    found = json.loads(answer.out)
    assert found["format"] == "tendonfmu-inspection-1" and found["unused"] == ["state"]
    (topic,) = found["topics"]
    clock = {name: topic["clock"][name] for name in ("rows", "gaps", "repeated", "backwards")}
    assert clock == {"rows": 341, "gaps": 1, "repeated": 1, "backwards": 0}
    assert topic["clock"]["rate"] == pytest.approx(200.0) and topic["clock"]["largest_step"] == pytest.approx(0.305)
    force = next(field for field in topic["fields"] if field["name"] == "force")
    assert (force["count"], force["missing"], force["range"]) == (341, 3, [5.0, 5.0])
    VALIDATOR.validate(found["map"])


def test_joint_states_are_found_by_name(call: Call, tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="SKIPPED: tendonfmu is not installed with its extra logs")
    from log_cases import FORMATS, sound, write

    write(tmp_path, FORMATS["ROS 2 bag, MCAP"], sound())
    answer = call("convert", "inspect", "bag", "-o", "map.json")
    assert answer.status == 0, answer.err
    columns = json.loads((tmp_path / "map.json").read_text(encoding="utf-8"))["columns"]
    assert columns["time"] | {"comment": ""} == {"column": "/hand.header.stamp", "unit": "datetime", "comment": ""}
    assert columns["tendon_force[1]"]["column"] == "/hand.force"
    assert columns["tendon_position[1]"]["column"] == "/hand.spool"
    assert columns["tendon_position[1]"]["comment"].startswith("guess: ")  # 4 m by REP 103, which is unusual


def test_bad_usage(call: Call, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,force\n1,2\n")
    for arguments, words in (
        (["inspect", "log.csv", "--map", "map.json"], ["--map", "expected -o"]),
        (["inspect", "log.csv", "-o", "map.csv"], ["map.csv", ".json"]),
        (["inspect", "absent.csv"], ["absent.csv", "no such file"]),
        (["inspect", "log.csv", "-o", "log.json/x.json"], ["log.json"]),
        (["table", "log.csv", "--map", "map.json"], ["--output", "missing"]),
    ):
        answer = call("convert", *arguments)
        assert answer.status == 2 and len(answer.err.splitlines()) == 1, answer
        assert all(word in answer.err for word in words), answer.err
