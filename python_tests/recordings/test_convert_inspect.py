"""`convert inspect`: what it lists and proposes, how sure it says to be, and that its map then works."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from command import Call
from made_logs import json_messages
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
    columns: dict[str, Any] = {"q1 (deg)": np.degrees(ANGLE), "Time [ms]": 1000 * T, "Motor1_mm": 1000 * SPOOL}
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


def test_numbered_motors_turn_spools(tmp_path: Path) -> None:
    columns = {"time": T, "force_1": FORCE, "m1_pos_deg": np.degrees(ANGLE), "m1_cur_mA": 30 * FORCE}
    lines = proposed(tmp_path, columns)
    assert set(lines) == {"time", "tendon_force[1]", "tendon_position[1]"}
    assert lines["tendon_position[1]"].source == "m1_pos_deg"
    assert "radius of the spool" in lines["tendon_position[1]"].why


def test_a_servo_becomes_one_joint(call: Call, tmp_path: Path) -> None:
    columns = {"t": T, "torque [mN.m]": 800 * np.sign(np.cos(3 * T)), "angle [deg]": np.degrees(ANGLE)}
    proposed(tmp_path, columns, "servo 3.csv")
    document = json.loads((tmp_path / "map.json").read_text(encoding="utf-8"))
    assert document["joint"]["name"] == "servo_3" and document["joint"]["torque"]["unit"] == "mN.m"
    answer = call("convert", "table", "servo 3.csv", "--map", "map.json", "-o", "rec.parquet")
    assert answer.status == 0, answer.err


def test_faults_are_listed(call: Call, tmp_path: Path) -> None:
    """Gaps, repeated times, missing numbers and texts; as text and as JSON."""
    time = np.r_[T[:100], T[99:200], T[260:]] * 1000
    frame = pd.DataFrame({"t_ms": time, "force": 5.0, "spool_mm": np.cos(time), "state": "run"})
    frame.loc[0, "force"] = 6.0
    frame.loc[3:5, "force"] = np.nan
    frame.to_csv(tmp_path / "log.csv", index=False)
    answer = call("convert", "inspect", "log.csv")
    assert answer.status == 0
    for words in ("1 gap of", "1 repeated time", "200 Hz", "largest step 305 ms", "state", "run"):
        assert words in answer.out, words
    answer = call("convert", "inspect", "log.csv", "--json")
    found = json.loads(answer.out)
    assert found["format"] == "tendonfmu-inspection-1" and found["unused"] == ["state"]
    (topic,) = found["topics"]
    clock = {name: topic["clock"][name] for name in ("rows", "gaps", "repeated", "backwards")}
    assert clock == {"rows": 341, "gaps": 1, "repeated": 1, "backwards": 0}
    assert topic["clock"]["rate"] == pytest.approx(200.0) and topic["clock"]["largest_step"] == pytest.approx(0.305)
    force = next(field for field in topic["fields"] if field["name"] == "force")
    assert (force["count"], force["missing"], force["range"]) == (341, 3, [5.0, 6.0])
    VALIDATOR.validate(found["map"])
    assert found["map"]["log"]["missing"] == "?"  # left to the user


def test_joint_states_are_found_by_name(call: Call, tmp_path: Path) -> None:
    from made_logs import FORMATS, sound, write

    write(tmp_path, FORMATS["ROS 2 bag, MCAP"], sound())
    answer = call("convert", "inspect", "bag", "-o", "map.json")
    assert answer.status == 0, answer.err
    columns = json.loads((tmp_path / "map.json").read_text(encoding="utf-8"))["columns"]
    assert columns["time"] | {"comment": ""} == {"column": "/hand.header.stamp", "unit": "datetime", "comment": ""}
    assert columns["tendon_force[1]"]["column"] == "/hand.force"
    assert columns["tendon_position[1]"]["column"] == "/hand.spool"
    assert columns["tendon_position[1]"]["comment"].startswith("guess: ")  # 4 m by REP 103, which is unusual


FOUR = ("flex", "ext", "side", "back")


def of_tendons(force: str, position: str, names: tuple[str, ...] = FOUR) -> dict[str, Any]:
    """Forces in an order, positions in the other."""
    columns = {"time [s]": T} | {force.format(name): FORCE for name in names}
    return columns | {position.format(name): SPOOL for name in reversed(names)}


@pytest.mark.parametrize(("force", "position"), [("F_{} [N]", "x_{} [m]"), ("force{}_N", "tendonpos{}_m")])
def test_tendons_without_numbers_keep_the_order_of_the_log(
    call: Call, tmp_path: Path, force: str, position: str
) -> None:
    """With equal arms `check` cannot notice tendons that are exchanged, so no line of a tendon is sure."""
    lines = proposed(tmp_path, of_tendons(force, position))
    for k, name in enumerate(FOUR, start=1):
        assert lines[f"tendon_force[{k}]"].source == force.format(name)
        assert lines[f"tendon_position[{k}]"].source == position.format(name)
    assert {line.sure for name, line in lines.items() if name != "time"} == {"likely"}
    said = "order of tendons as in the log, a guess; check it against the finger: 1 = "
    answer = call("convert", "inspect", "log.csv")
    assert answer.out.count(f"{said}{force.format('flex')} and {position.format('flex')}, 2 = ") == 1
    found = json.loads(call("convert", "inspect", "log.csv", "--json").out)
    (order,) = found["orders"]
    assert (order["of"], order["sure"]) == ("tendons", "guess") and order["line"].startswith(said)
    assert order["elements"][3] == [force.format("back"), position.format("back")]
    assert found["map"]["comment"] == order["line"]


def test_positions_numbered_like_forces_are_those_of_tendons(tmp_path: Path) -> None:
    numbers = tuple(str(k) for k in range(1, 12))
    lines = proposed(tmp_path, of_tendons("F{}", "pos{}", numbers))
    assert len(lines) == 23
    for number in numbers:
        line = lines[f"tendon_position[{number}]"]
        assert (line.source, line.sure) == (f"pos{number}", "likely") and "as many as forces" in line.why
    joints = proposed(tmp_path, of_tendons("F{}", "pos{}", numbers) | {"pos12": SPOOL})
    assert "joint_position[12]" in joints  # not as many as forces: angles of joints, as by the word alone


# --- messages ---------------------------------------------------------------------------------------------------------


def joint_states(folder: Path, topic: str, names: tuple[str, ...], **more: list[float]) -> dict[str, Line]:
    """A topic of messages like JointState, with names, positions (m) and efforts."""
    messages: list[dict[str, Any]] = [
        {"t": k / 200, "name": names, "position": [spool] * len(names), "effort": [force] * len(names)}
        | {key: [value * force for value in values] for key, values in more.items()}
        for k, (force, spool) in enumerate(zip(FORCE, SPOOL, strict=True))
    ]
    inspection = inspect_log(json_messages(folder / "log.mcap", topic, messages))
    return {line.column: line for line in propose(inspection).lines}


def test_tendons_of_messages_keep_the_order_of_name(tmp_path: Path) -> None:
    lines = joint_states(tmp_path, "/hand/tendons", FOUR)
    for k, name in enumerate(FOUR, start=1):
        assert lines[f"tendon_force[{k}]"].source == f"/hand/tendons.effort[{name}]"
        assert lines[f"tendon_position[{k}]"].source == f"/hand/tendons.position[{name}]"
    assert not any(name.startswith("external_torque") for name in lines)


def test_the_name_of_one_element_does_not_make_it_an_external_torque(tmp_path: Path) -> None:
    lines = joint_states(tmp_path, "/joint_states", ("tendon_flex", "ext", "tendon_side"))
    assert [lines[f"tendon_force[{k}]"].source for k in (1, 2, 3)] == [
        f"/joint_states.effort[{name}]" for name in ("tendon_flex", "ext", "tendon_side")
    ]
    assert lines["tendon_position[2]"].source == "/joint_states.position[ext]"
    assert not any(name.startswith("external_torque") for name in lines)
    lines = joint_states(tmp_path, "/tendons", ("flex", "ext"), external_torque=[1.0, 2.0])
    assert lines["external_torque[2]"].source == "/tendons.external_torque[ext]"  # the array says so


def test_names_of_elements_are_those_of_the_message_they_are_in(tmp_path: Path) -> None:
    """As in DynamicJointState: interfaces in another order at one joint, fewer at another, and as many as joints."""
    interfaces = {"flexor": ("position", "effort"), "extensor": ("effort", "position")}
    measured = {name: list(zip(SPOOL, FORCE + k, strict=True)) for k, name in enumerate(interfaces)}
    messages: list[dict[str, Any]] = [
        {
            "joint_names": list(interfaces),
            "interface_values": [
                {"interface_names": names, "values": [measured[joint][k][name == "effort"] for name in names]}
                for joint, names in interfaces.items()
            ],
        }
        for k in range(len(T))
    ]
    proposal = propose(inspect_log(json_messages(tmp_path / "log.mcap", "/dynamic_joint_states", messages)))
    sources = {line.column: line.source for line in proposal.lines}
    for k, joint in enumerate(interfaces, start=1):
        values = f"/dynamic_joint_states.interface_values[{joint}].values"
        assert sources[f"tendon_force[{k}]"] == f"{values}[effort]"
        assert sources[f"tendon_position[{k}]"] == f"{values}[position]"
    (tmp_path / "map.json").write_text(json.dumps(proposal.document), encoding="utf-8")
    columns = convert_table(tmp_path / "log.mcap", tmp_path / "map.json").columns
    assert columns["tendon_force[2]"] == pytest.approx(FORCE + 1.0)


def test_fields_that_start_late_are_listed(tmp_path: Path) -> None:
    messages: list[dict[str, Any]] = [
        {"name": ["flexor"], "position": [spool], "effort": [force] if k >= 20 else []}
        for k, (force, spool) in enumerate(zip(FORCE, SPOOL, strict=True))
    ]
    inspection = inspect_log(json_messages(tmp_path / "log.mcap", "/joint_states", messages))
    fields = {part.field.name: (part.count, part.missing) for topic in inspection.topics for part in topic.fields}
    assert fields["/joint_states.effort[flexor]"] == (400, 20)
    assert "log.missing" in propose(inspection).undecided


def test_the_structure_of_a_message_is_no_signal(tmp_path: Path) -> None:
    messages: list[dict[str, Any]] = [
        {"layout": {"dim": [], "data_offset": k}, "data": [force, force + 1.0, 0.5]} for k, force in enumerate(FORCE)
    ]
    proposal = propose(inspect_log(json_messages(tmp_path / "log.mcap", "/tendon_tensions", messages)))
    lines = {line.column: line for line in proposal.lines}
    assert lines["tendon_force[1]"].source == "/tendon_tensions.data[1]" and "tendon_force[4]" not in lines
    assert lines["tendon_force[3]"].unit == "?" and "constant at 0.5" in lines["tendon_force[3]"].why


def test_numbers_from_zero_are_elements(tmp_path: Path) -> None:
    for force, spool in (("force{}", "spool{}_mm"), ("F{}", "motor_count{}"), ("tension_{}", "x0_{}_spool")):
        columns = {"time": T} | {force.format(k): FORCE + k for k in range(4)}
        columns |= {spool.format(k): 1000 * SPOOL + k for k in range(4)}
        lines = proposed(tmp_path, columns)
        for k in range(4):
            assert lines[f"tendon_force[{k + 1}]"].source == force.format(k)
            assert lines[f"tendon_position[{k + 1}]"].source == spool.format(k)


def test_a_constant_is_no_signal_and_what_moves_with_one_is_marked(call: Call, tmp_path: Path) -> None:
    noise = np.random.default_rng(1).normal(size=len(T))
    columns = {"time": T, "force": FORCE, "spool_mm": 1000 * SPOOL, "force_offset": 3.0, "amps": 2 * FORCE + noise}
    lines = proposed(tmp_path, columns | {"humidity": noise})
    assert {line.source for line in lines.values()} == {"time", "force", "spool_mm"}
    answer = call("convert", "inspect", "log.csv")
    assert "not used: force_offset, amps ?, humidity" in answer.out
    assert "? amps: moves with tendon_force[1], correlation 0." in answer.out
    frame = pd.DataFrame({"time": T, "f1": FORCE, "f2": FORCE, "p1": SPOOL, "p2": SPOOL})
    frame.columns = pd.Index(["time", "force", "force", "pos", "pos"])
    frame.to_csv(tmp_path / "alike.csv", index=False)
    proposal = propose(inspect_log(tmp_path / "alike.csv"))
    assert [line.source for line in proposal.lines] == ["time", 2, 3, 4, 5] and not proposal.unused


def test_a_clock_is_found_by_its_values(tmp_path: Path) -> None:
    """Whatever its name is; a counter of samples is none, and a ramp of a motor is not even."""
    columns = {"n": np.arange(400), "Zeit": 7.0 + T, "tension": FORCE, "spool_position": SPOOL, "joint_angle": ANGLE}
    line = proposed(tmp_path, columns)["time"]
    assert (line.source, line.unit) == ("Zeit", "s")
    columns.pop("Zeit")
    assert proposed(tmp_path, columns)["time"].source == "?"


def test_unused_fields_that_come_as_a_group_may_be_joints(call: Call, tmp_path: Path) -> None:
    """Encoders of joints with a name of their own; temperatures never cross 0, and one field alone is no group."""
    names = ("flex", "back")
    columns = of_tendons("F_{} [N]", "x_{} [m]", names) | {f"halla_{name}": np.degrees(ANGLE) for name in names}
    columns |= {f"heat_{name}": 30.0 + 0.1 * ANGLE for name in names} | {"odd": ANGLE}
    lines = proposed(tmp_path, columns)
    for k, name in enumerate(names, start=1):
        line = lines[f"joint_position[{k}]"]
        assert (line.source, line.unit, line.sure) == (f"halla_{name}", "?", "undecided")
    assert not {"heat_flex", "odd"} & {line.source for line in lines.values()}
    assert (
        '"?" is left to you: joint_position[1], joint_position[2]'
        in call("convert", "inspect", "log.csv", "-o", "new.json").err
    )
