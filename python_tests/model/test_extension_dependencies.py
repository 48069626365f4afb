"""The dependencies that `extensions` add to the ModelStructure, by perturbing and looking; a few by hand."""

from __future__ import annotations

import copy
import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_dependencies import Influence, Sample, declared, lively_recording, pairs, slopes, steps_apart

from extension_cases import ROWS, name_of, random_rows
from fmu_binary import FINGER
from random_fingers import random_case
from tendonfmu.fmu.model_variables import describe_model, read_table
from tendonfmu.model.description import read_finger
from tendonfmu.model.native import Instance
from tendonfmu.model.output_names import NUMBERS

SEEDS = range(12)
TORQUES = ("compensated_torque", "friction_torque", "bias_torque")


def rows_of(recording: Sample, begin: int, end: int) -> Sample:
    return {name: values[begin:end] for name, values in recording.items()}


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_undeclared_influences(seed: int, tmp_path: Path) -> None:
    """Random fingers, each with ten extensions."""
    description, recording = random_case(seed, samples=100)
    rng = np.random.default_rng([seed, 21])
    tendons = len(description["tendons"])
    description["extensions"] = random_rows(rng, len(description["joints"]), tendons, 10)
    allowed = pairs(declared(description, tmp_path))
    seen: Influence = set()
    for source in (1, 2, 3):
        finger = Instance.from_description(description, source)
        begin = 0
        for k in (1, 50, 99):
            finger.run(rows_of(recording, begin, k))
            state, begin = finger.save_state(), k
            seen |= steps_apart(finger, state, rows_of(recording, k, k + 1))
            finger.restore_state(state)
    assert seen - allowed == set()
    assert len(seen) > 0.3 * len(allowed)


def bare(row: dict[str, Any]) -> dict[str, Any]:
    """A finger with nothing that depends on the motion but one extension, and what that acts on."""
    finger = copy.deepcopy(FINGER)
    friction = row["effect"] in ("presliding", "friction_drift", "stribeck")
    for part in (*finger["joints"], *finger["tendons"]):
        for key in ("cover", "friction", "load_friction", "pulley_friction", "edge_friction"):
            if not friction:
                part.pop(key, None)
    least = 1e-9 if name_of(row) == "presliding" else 0.0  # it multiplies them
    return finger | {"extensions": [row], "velocity_threshold": {"tendon": least, "joint": least}}


@pytest.mark.parametrize("row", ROWS, ids=name_of)
def test_each_declared_number_influences(row: dict[str, Any], tmp_path: Path) -> None:
    """Declared is what has a slope somewhere, or turns the side of a friction that has none."""
    description = bare(row)
    description["contact"]["threshold"] = [1e6, 1e6]
    recording = lively_recording(description, 5)
    wanted = {pair for pair in pairs(declared(description, tmp_path)) if pair[0] in NUMBERS}
    seen: Influence = set()
    for source in (1, 2, 3):
        finger = Instance.from_description(description, source)
        seen |= slopes(finger, recording)
        finger.reset()
        finger.set_kinematics_source(source)
        finger.run(rows_of(recording, 0, 30))
        for k in range(30, 40):
            state = finger.save_state()
            seen |= steps_apart(finger, state, rows_of(recording, k, k + 1))
            finger.restore_state(state)
            finger.run(rows_of(recording, k, k + 1))
    assert {pair for pair in seen if pair[0] in NUMBERS} == wanted


@pytest.mark.parametrize(
    ("row", "angles", "velocities"),
    [
        ({"effect": "gravity", "joint": 3, "sine": 1}, [[0, 2], [], [0, 2]], [[], [], []]),
        ({"effect": "inertia", "joint": 2, "inertia": 1}, [[], [1], []], [[], [1], []]),
        ({"effect": "joint_coupling", "joint": 2, "stiffness": 1}, [[], [1, 2], [1, 2]], [[], [], []]),
        # passes joints 1 and 3
        ({"effect": "preload_friction", "tendon": 1, "coulomb": 1}, [[0, 2], [], [0, 2]], [[0, 2], [], [0, 2]]),
        ({"effect": "preload_friction", "joint": 2, "tendon": 1, "coulomb": 1}, [[], [], [2]], [[], [], [2]]),
        ({"effect": "load_friction", "joint": 1, "tendon": 1, "coulomb": 1}, [[0], [], []], [[0], [], []]),
        ({"effect": "force_gain", "tendon": 1, "correction": 1}, [[], [], []], [[], [], []]),
    ],
    ids=lambda value: value["effect"] if isinstance(value, dict) else "",
)
def test_by_hand(row: dict[str, Any], angles: list[list[int]], velocities: list[list[int]], tmp_path: Path) -> None:
    """Three joints, the axis of the second one across the others, the first tendon passing joints 1 and 3."""
    arms = [[0.01, 0.0, 0.005], [-0.01, 0.004, 0.0], [0.0, -0.004, -0.005], [0.003, 0.002, 0.001]]
    description = {
        "format": "tendonfmu-finger-1",
        "name": "bare",
        "joints": [{}, {}, {}],
        "tendons": [{"stiffness": 1e3, "moment_arms": each} for each in arms],
        "contact": {"threshold": [0.1] * 3},
        "links": [{"axis": [0, 0, 1]}, {"axis": [0, 1, 0]}, {"axis": [0, 0, -3]}],
        "tip": [0.1, 0, 0],
        "extensions": [row],
    }
    found = declared(description, tmp_path)
    for output in TORQUES:
        assert [each["joint_position"] for each in found[output]] == angles
        assert [each["joint_velocity"] for each in found[output]] == velocities


# --- in the model description -----------------------------------------------------------------------------------------


def described(rows: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
    (folder / "finger.json").write_text(json.dumps(FINGER | {"extensions": rows}))
    table = read_table((files("tendonfmu") / "model_description" / "variables.json").read_text(encoding="utf-8"))
    return describe_model(read_finger(folder / "finger.json"), table)


def test_a_delay_leaves_no_fixed_factor(tmp_path: Path) -> None:
    """Not even from forces to joint torques, which follow from forces of earlier samples if it is negative."""
    others = [row for row in ROWS if row["effect"] != "time_delay"]
    plain, late = described(others, tmp_path), described(ROWS, tmp_path)
    assert "fixed" in {kind for output in plain["outputs"] for kind in output["kinds"]}
    assert {kind for output in late["outputs"] for kind in output["kinds"]} == {"dependent"}


def test_numbers_say_of_which_effect_they_are(tmp_path: Path) -> None:
    found = {variable["name"]: variable for variable in described(ROWS, tmp_path)["variables"]}
    numbers = {name: found[name] for name in found if name.startswith("extensions[")}
    assert len(numbers) == 44
    assert (
        numbers["extensions[10].coulomb"]["description"]
        == "Extension 10: coulomb, of load_friction at joint 2, tendon 1"
    )
    assert numbers["extensions[25].delay"]["description"] == "Extension 25: delay, of time_delay"
    for number in numbers.values():
        assert number["variability"] == "tunable" and number["causality"] == "parameter"
    assert {numbers[f"extensions[{k}].displacement"]["unit"] for k in (17, 18, 28)} == {"rad", "m", "s"}
