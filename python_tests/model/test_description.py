"""The published JSON Schema says what the native reader says; the counts are those of the file."""

from __future__ import annotations

import copy
import itertools
import json
import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import extension_cases
from fmu_binary import FINGER
from repetitions import repeated
from repository_paths import ROOT
from tendonfmu.errors import InputError
from tendonfmu.model.description import count, read_finger
from tendonfmu.model.description_numbers import EFFECT_NUMBERS
from tendonfmu.model.friction_places import friction_numbers
from tendonfmu.model.native import Instance, NativeError, image_from_json

INDEX_FINGER = ROOT / "examples" / "fingers" / "index_finger.json"
SCHEMA = json.loads((files("tendonfmu") / "schema" / "finger.schema.json").read_text(encoding="utf-8"))
Validator = jsonschema.Draft202012Validator
VALIDATOR = Validator(SCHEMA)

# What the reader refuses and a schema cannot express: relations between values in different places.
BEYOND_THE_SCHEMA = {
    "lengths of lists and the number of joints": r"one per (joint|angle)|list of \d+",
    "a law at the last pulley": r"since no joint comes after",
    "static below coulomb": r"expected at (least|most) .*(coulomb|static)",
    "angles that do not increase": r"above the angle before it",
    "routing without full column rank": r"rank",
    "an extension at a joint that is not there": r"expected a joint (from 1 to|with another one)",
    "an extension at a tendon that is not there": r"expected a tendon from 1 to",
    "a coupling at the last joint": r"since the last one has none after it",
    "an effect too often at a place": r"expected (once|twice at most)",
    "none, or both, of two numbers": r"expected above 0, here or in|expected 0 beside",
}


def accepted(description: Any) -> str | None:
    """The reader's line where it refuses, None where it accepts."""
    try:
        image_from_json(json.dumps(description))
    except NativeError as refused:
        return str(refused)
    return None


def with_everything() -> dict[str, Any]:
    """A valid description that uses every key."""
    description = copy.deepcopy(FINGER)
    description["bias"] = {
        "drift_variance": 1e-6,
        "noise_std": 0.01,
        "noise_std_per_force": 0.0,
        "initial_variance": 1e-4,
        "forget_rate": 5.0,
        "initial_torque": [0.0, 0.01],
        "noise_time": 0.002,
    }
    description["velocity_threshold"] = {"tendon": 0.0005, "joint": 0.01}
    description["velocity_filter_cutoff"] = 20.0
    description["extensions"] = [{"effect": "cover_hardening", "joint": 2, "stiffness": 0.1}]
    description["links"] = [{"axis": [0.0, 0.0, 2.0]}, {"axis": [0.0, 1.0, 0.0], "offset": [0.04, 0.0, 0.0]}]
    description["tip"] = [0.02, 0.0, 0.0]
    bands = [{"noise": [0.02, 0.02], "friction": [0.0, 0.5], "motor_load": [0.1, 0.1]} for _ in range(4)]
    description["contact"] |= {"method": "bands", "watches_motors": True, "bands": bands}
    description["sensor_fault"] = {"hold_time": 0.1, "jump_margin": 0.5, "spring_margin": 0.5, "force_resolution": 0.01}
    description["joints"][0]["load_friction"] = {"static": 1e-4, "coulomb": 8e-5, "stribeck_velocity": 0.1}
    return description


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of all values within."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*path, key)
        yield from places(inner, (*path, key))


def changed(description: dict[str, Any], path: tuple[Any, ...], change: Any) -> dict[str, Any]:
    """A copy with the value at `path` replaced; DELETE and ADD take away, and add an unknown key or an element."""
    result = copy.deepcopy(description)
    place: Any = result
    for key in path[:-1]:
        place = place[key]
    if change == "DELETE":
        del place[path[-1]]
    elif change == "ADD":
        inner = place[path[-1]]
        if isinstance(inner, dict):
            inner["unknown"] = None
        elif isinstance(inner, list):
            inner.append(copy.deepcopy(inner[-1]) if inner else None)
        else:
            place[path[-1]] = [inner]
    else:
        place[path[-1]] = change
    return result


CHANGES: list[Any] = ["DELETE", "ADD", None, True, "text", "", [], {}, -1, 0, 0.25, 1, 1e6, 2e9, 1e13, [0.0, 1.0]]


def assert_agreement(description: Any, what: str, part: Any = None, schema: Validator = VALIDATOR) -> None:
    """part, schema: the only part that may be at fault, and its schema; None: the whole."""
    refused = accepted(description)
    errors = [error.message for error in schema.iter_errors(description if part is None else part)]
    if refused is None:
        assert errors == [], what
    elif not errors:
        assert any(re.search(pattern, refused) for pattern in BEYOND_THE_SCHEMA.values()), f"{what}: {refused}"


def test_schema_is_one_and_takes_valid_fingers() -> None:
    Validator.check_schema(SCHEMA)
    for description in (with_everything(), json.loads(INDEX_FINGER.read_text())):
        assert accepted(description) is None
        VALIDATOR.validate(description)


@pytest.mark.parametrize("every", repeated([7, 1], 0))
def test_schema_agrees_with_the_reader_on_every_changed_value(every: int) -> None:
    """Every seventh of them changes each value in two ways or more."""
    description = with_everything()
    all_changes = list(itertools.product(places(description), CHANGES))
    for path, change in all_changes[::every]:
        assert_agreement(changed(description, path, change), f"{path} = {change!r}")
    assert len(all_changes) > 1500


def test_schema_agrees_with_the_reader_on_every_changed_extension() -> None:
    """Each row alone, with every key changed, left out or added."""
    agreed = 0
    by_effect = {
        row["effect"]: Validator({"$ref": f"#/$defs/{row['effect']}", "$defs": SCHEMA["$defs"]})
        for row in extension_cases.ROWS
    }
    for row in extension_cases.ROWS:
        keys = {"joint": row.get("joint"), "tendon": row.get("tendon")} | row
        for key in keys:
            for change in [*CHANGES, -0.95, 0.05, 1e300]:
                changed_row = {k: v for k, v in row.items() if k != key}
                if change != "DELETE":
                    changed_row[key] = change
                description = FINGER | {"extensions": [changed_row]}
                assert_agreement(description, f"{row} with {key} = {change!r}", changed_row, by_effect[row["effect"]])
                agreed += 1
    assert agreed > 1000


@pytest.mark.parametrize(
    ("what", "path", "change"),
    [
        ("lengths of lists and the number of joints", ("contact", "threshold"), [0.1]),
        ("a law at the last pulley", ("tendons", 0, "pulley_friction", 1), FINGER["tendons"][1]["edge_friction"][0]),
        ("static below coulomb", ("joints", 0, "friction", "static"), 0.001),
        ("angles that do not increase", ("tendons", 0, "edge_friction", 1, "angles"), [0.5, 0.5]),
        ("routing without full column rank", ("tendons",), [FINGER["tendons"][1]]),
        ("an extension at a joint that is not there", ("extensions", 0, "joint"), 3),
        (
            "an extension at a tendon that is not there",
            ("extensions", 0),
            {"effect": "force_gain", "tendon": 4, "correction": 0},
        ),
        (
            "a coupling at the last joint",
            ("extensions", 0),
            {"effect": "joint_coupling", "joint": 2, "stiffness": 1},
        ),
        ("an effect too often at a place", ("extensions",), [{"effect": "time_delay", "delay": 0}] * 2),
    ],
)
def test_the_reader_alone_refuses(what: str, path: tuple[Any, ...], change: Any) -> None:
    description = changed(with_everything(), path, change)
    VALIDATOR.validate(description)
    refused = accepted(description)
    assert refused and re.search(BEYOND_THE_SCHEMA[what], refused)


# --- reading and counting ---------------------------------------------------------------------------------------------


def test_the_index_finger_has_the_papers_472_numbers() -> None:
    """And a pretension that pulls all tendons, none of which rubs beyond its last joint."""
    finger = read_finger(INDEX_FINGER)
    counts = count(finger)
    assert (finger.joints, finger.tendons, counts.pulleys, counts.edges) == (4, 8, 14, 22)
    assert counts.laws == {"friction": 4, "load_friction": 4, "pulley_friction": 14, "edge_friction": 94}
    assert sum(counts.estimated_numbers.values()) == 472
    assert counts.asymmetric_laws == 0 and counts.extensions == []
    arms = np.array(finger.moment_arms)
    pretension = np.ones(8) - arms @ np.linalg.solve(arms.T @ arms, arms.T @ np.ones(8))
    assert np.all(pretension > 0.8) and np.abs(arms.T @ pretension).max() < 1e-12
    for tendon in finger.data["tendons"]:
        last = max(j for j, arm in enumerate(tendon["moment_arms"]) if arm)
        assert not any(tendon["edge_friction"][last + 1 :]) and not any(tendon["pulley_friction"][last:])


def test_absent_friction_is_not_estimated(tmp_path: Path) -> None:
    """viscous 0 and static = coulomb are docs/reference/commands/fit.md#absent-structure; each side counts."""
    description = with_everything()
    description["joints"][0]["friction"] = {"static": 0.1, "coulomb": 0.1, "stribeck_velocity": 1.0, "viscous": 0.0}
    (tmp_path / "finger.json").write_text(json.dumps(description))
    counts = count(read_finger(tmp_path / "finger.json"))
    # one number of the changed law, three of load_friction (no viscous), four of each other side
    assert counts.estimated_numbers == {
        "friction": 1,
        "load_friction": 3,
        "pulley_friction": 4,
        "edge_friction": 4 * 5,
        "cover": 1,
        "extensions": 2,
        "bias": 2,
    }
    assert counts.asymmetric_laws == 1 and counts.bidirectional_tendons == 1 and counts.working_points == 2


def test_numbers_of_extensions_are_those_of_the_runtime() -> None:
    """In order, without those that are left out."""
    description = with_everything() | {"extensions": extension_cases.ROWS}
    known = {parameter.path: parameter.start for parameter in Instance.from_description(description).parameters()}
    known = {path: value for path, value in known.items() if path.startswith("extensions[")}
    assert {row["effect"] for row in extension_cases.ROWS} == set(EFFECT_NUMBERS)
    listed = {number.path: number.value for number in friction_numbers(description) if number.extension}
    assert list(listed.items()) == [(path, value) for path, value in known.items() if path in listed]
    # turns, reaction, and beyond twice: of the mechanism, and not given; and what six rows of presliding do not have
    # or choose
    assert len(known) - len(listed) == 4 + 3 * 3 + 2 + 3 + 2 + 6 * 2


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, "No such file"),
        (b"", "finger.json: "),
        (b'{"format": "tendonfmu-finger-1"', "finger.json: "),
        (json.dumps(FINGER | {"gravity": 9.81}).encode(), "gravity"),
        (json.dumps(FINGER | {"velocity_filter_cutoff": -1}).encode(), "velocity_filter_cutoff = -1"),
    ],
)
def test_a_refusal_is_one_line_with_file_and_key(tmp_path: Path, content: bytes | None, expected: str) -> None:
    path = tmp_path / "finger.json"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError) as refused:
        read_finger(path)
    message = str(refused.value)
    assert message.startswith(f"{path}: ") and expected in message and "\n" not in message


SADDLE = [{"axis": [0.0, 0.0, 1.0]}, {"axis": [0.0, 1.0, 0.0], "offset": [0.04, 0.0, 0.0]}]


@pytest.mark.parametrize(
    ("path", "change", "said"),
    [
        (("contact", "bands"), "DELETE", r"contact\.bands: missing"),
        (("contact", "method"), "DELETE", r"contact\.bands: not allowed"),
        (("contact", "method"), "paper", r"contact\.bands: not allowed"),
        (("contact", "method"), "threshold", r"contact\.method = .?threshold.*paper"),
        (("contact", "method"), "innovation", r"contact\.method = .?innovation"),
        (("contact", "bands"), [{"noise": [0.1, 0.1]}] * 3, r"contact\.bands has 3 elements: expected"),
        (("contact", "bands", 1, "noise"), "DELETE", r"contact\.bands\[2\]\.noise"),
        (("contact", "bands", 2, "noise"), [0.1, 0.0], r"contact\.bands\[3\]\.noise\[2\] = 0: expected above 0"),
        (("contact", "bands", 2, "noise"), [0.1], r"contact\.bands\[3\]\.noise"),
        (("contact", "bands", 3, "motor_load"), [-1.0, 0.0], r"contact\.bands\[4\]\.motor_load\[1\] = -1"),
        (("contact", "bands", 0), "ADD", r"contact\.bands\[1\]\.unknown"),
        (("sensor_fault", "hold_time"), -1.0, r"sensor_fault\.hold_time = -1"),
        (("sensor_fault", "jump_margin"), 0.0, r"sensor_fault\.jump_margin = 0: expected above 0"),
        (("sensor_fault",), "ADD", r"sensor_fault\.unknown"),
        (("tip",), "DELETE", "tip: missing; expected a list of 3 numbers in m"),
        (("links",), "DELETE", "tip: not allowed without links"),
        (("links",), SADDLE[:1], "links has 1 elements?: expected a list of 2 links"),
        (("links", 0), {"axis": [0, 0, 0]}, r"links\[1\].axis\[1\] = 0: expected an axis .* not all 0"),
        (("links", 0), {"axes": [0, 0, 1]}, r"links\[1\].axes: unknown key"),
        (("tip",), [0.0, 0.0, 22.0], r"tip\[3\] = 22: expected -10 to 10 m"),
    ],
)
def test_a_changed_value_is_refused_by_its_key(path: tuple[Any, ...], change: Any, said: str) -> None:
    refused = accepted(changed(with_everything(), path, change))
    assert refused and re.search(said, refused) and "\n" not in refused


@pytest.mark.parametrize(
    "key",
    [
        "innovation", "friction_bound", "uncertainty", "uncertainty_level", "drift", "release_ratio", "hold_time",
        "release_time", "rest", "start_share",
    ],
)  # fmt: skip
def test_an_earlier_key_of_detection_is_refused_with_what_to_do(key: str) -> None:
    table = "bias" if key == "start_share" else "contact"
    description = FINGER | {table: FINGER.get(table, {}) | {key: 1.0}}
    refused = accepted(description)
    expected = rf"{table}\.{key}: no longer a key; leave it out, or calibrate again"
    assert refused and re.search(expected, refused) and "\n" not in refused
