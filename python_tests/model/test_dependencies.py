"""The ModelStructure's dependencies, by perturbing and looking.

Nothing influences that is not declared, and whatever is declared does influence in some situation: one of the three
kinematics sources, some values of the tunable parameters.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Sequence
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from extension_cases import ROWS, name_of
from fmu_binary import FINGER
from random_extensions import random_extensions
from random_fingers import random_case
from repetitions import repeated
from tendonfmu.fmu.model_variables import describe_model, read_table
from tendonfmu.model.description import read_finger
from tendonfmu.model.native import Instance
from tendonfmu.model.output_dependencies import Dependencies, dependencies, structure_of
from tendonfmu.model.output_names import FLAGS, INPUTS, NUMBERS

SEEDS = range(30)
DECIDED_BY = ("residual", "contact_level")  # a turn of the contact does not change them

Influence = set[tuple[str, int, str, int]]  # output, element, input, element; 0-based
Sample = dict[str, Any]


def declared(description: dict[str, Any], folder: Path) -> Dependencies:
    (folder / "finger.json").write_text(json.dumps(description))
    return dependencies(structure_of(read_finger(folder / "finger.json")))


def pairs(found: Dependencies) -> Influence:
    return {
        (output, k, name, i)
        for output, elements in found.items()
        for k, inputs in enumerate(elements)
        for name, indices in inputs.items()
        for i in indices
    }


def rows_of(recording: Sample, begin: int, end: int) -> Sample:
    return {name: values[begin:end] for name, values in recording.items()}


def with_extension(description: dict[str, Any], seed: int) -> dict[str, Any]:
    """Every third finger gets a term beyond the paper."""
    if seed % 3 == 0:
        joint = seed % len(description["joints"]) + 1
        description["extensions"] = [{"effect": "cover_hardening", "joint": joint, "stiffness": 0.05}]
    return description


# --- nothing that is not declared -------------------------------------------------------------------------------------


def outputs_of(finger: Instance, state: bytes, sample: Sample) -> dict[str, Any]:
    finger.restore_state(state)
    return finger.run(sample)


def steps_apart(finger: Instance, state: bytes, sample: Sample) -> Influence:
    """Outputs whose bits change when one input of the next sample does, by little and by much.

    Branch decisions are frozen (docs/reference/semantics/outputs.md#directional-derivatives): where contact itself
    turns, and with it the bias of every joint stays or moves, only the decisions are looked at.
    """
    found: Influence = set()
    plain = outputs_of(finger, state, sample)
    for name in INPUTS:
        for i in range(sample[name].shape[1]):
            for change in (1e-9, -1e-4, 0.5):
                moved = {**sample, name: sample[name].copy()}
                moved[name][0, i] += change * (10.0 if name == "tendon_force" else 1.0)
                after = outputs_of(finger, state, moved)
                turned = after["contact"][0] != plain["contact"][0]
                for output in (*DECIDED_BY, *FLAGS) if turned else (*NUMBERS, *DECIDED_BY, *FLAGS):
                    differ = np.flatnonzero(np.atleast_1d(after[output][0] != plain[output][0]))
                    found |= {(output, int(k), name, i) for k in differ}
    return found


def nothing_undeclared_influences(
    description: dict[str, Any], recording: Sample, cuts: Sequence[int], folder: Path
) -> None:
    allowed = pairs(declared(description, folder))
    seen: Influence = set()
    for source in (1, 2, 3):
        finger = Instance.from_description(description, source)
        begin = 0
        for k in cuts:
            finger.run(rows_of(recording, begin, k))
            state, begin = finger.save_state(), k
            seen |= steps_apart(finger, state, rows_of(recording, k, k + 1))
            finger.restore_state(state)
    assert seen - allowed == set()
    assert len(seen) > 0.25 * len(allowed)


@pytest.mark.parametrize("seed", repeated(SEEDS, *range(0, len(SEEDS), 6)))
def test_nothing_undeclared_influences(seed: int, tmp_path: Path) -> None:
    description, recording = random_case(seed, samples=160)
    nothing_undeclared_influences(with_extension(description, seed), recording, (1, 40, 80, 120, 159), tmp_path)


@pytest.mark.parametrize("seed", repeated(range(12), *range(0, 12, 3)))
def test_nothing_undeclared_influences_with_extensions(seed: int, tmp_path: Path) -> None:
    description, recording = random_case(seed, samples=100)
    joints, tendons = len(description["joints"]), len(description["tendons"])
    description["extensions"] = random_extensions(np.random.default_rng([seed, 21]), joints, tendons, thresholds=False)
    nothing_undeclared_influences(description, recording, (1, 50, 99), tmp_path)


# --- everything that is declared --------------------------------------------------------------------------------------


def enliven(finger: Instance) -> None:
    """Tunable values with which all that exists acts: nothing sticks, no value is 0, no two laws are alike."""
    values = {}
    for k, parameter in enumerate(p for p in finger.parameters() if p.tunable):
        name = parameter.path.rsplit(".", 1)[-1]
        scale = 1.0 + 0.01 * (k % 89)
        law = {"static": 0.03, "coulomb": 0.01, "stribeck_velocity": 0.05, "viscous": 0.02}
        if name in law:
            values[parameter.path] = law[name] * scale
        elif parameter.path.startswith("velocity_threshold"):
            values[parameter.path] = 0.0
        elif name.startswith("threshold"):
            values[parameter.path] = 1e6
        elif name in ("stiffness", "noise_std", "noise_std_per_force", "drift_variance", "velocity_filter_cutoff"):
            values[parameter.path] = 0.01 * scale
    finger.set(values)


def angles_to_try(description: dict[str, Any], rng: np.random.Generator) -> Sample:
    """[60, n] joint angles, most of them between working points of the edges behind."""
    n = len(description["joints"])
    angles = rng.uniform(-0.8, 0.8, (60, n))
    for j in range(n - 1):
        edges = [(tendon.get("edge_friction") or [])[j + 1 : j + 2] for tendon in description["tendons"]]
        points = [edge[0]["angles"] for edge in edges if edge and edge[0] and edge[0].get("angles")]
        between = [0.5 * (a + b) for angle in points for a, b in pairwise(angle)]
        if between:
            angles[:, j] = rng.choice(between, 60) + rng.uniform(-1e-3, 1e-3, 60)
    return angles


def lively_recording(description: dict[str, Any], seed: int) -> Sample:
    rng = np.random.default_rng([seed, 7])
    R = np.array([tendon["moment_arms"] for tendon in description["tendons"]])
    stiffness = np.array([tendon["stiffness"] for tendon in description["tendons"]])
    angles = angles_to_try(description, rng)
    force = rng.uniform(5.0, 15.0, (60, len(R)))
    return {
        "time": np.cumsum(rng.uniform(0.5, 1.5, 60)),
        "tendon_force": force,
        "tendon_position": angles @ R.T + force / stiffness,
        "joint_position": angles,
        "joint_velocity": rng.uniform(0.1, 1.0, angles.shape) * rng.choice([-1.0, 1.0], angles.shape),
    }


def slopes(finger: Instance, recording: Sample) -> Influence:
    """Outputs with a slope other than 0 at some sample of a recording."""
    found: Influence = set()
    for k in range(len(recording["time"])):
        finger.run({name: values[k : k + 1] for name, values in recording.items()})
        for name in INPUTS:
            for i, unit in enumerate(np.eye(recording[name].shape[1])):
                for output, slope in finger.directional_derivative({name: unit}).items():
                    found |= {(output, int(j), name, i) for j in np.flatnonzero(slope)}
    return found


@pytest.mark.parametrize("seed", repeated(SEEDS, *range(0, len(SEEDS), 6)))
def test_each_declared_number_influences(seed: int, tmp_path: Path) -> None:
    description = with_extension(random_case(seed)[0], seed)
    recording = lively_recording(description, seed)
    wanted = {pair for pair in pairs(declared(description, tmp_path)) if pair[0] in NUMBERS}
    seen: Influence = set()
    for source in (1, 2, 3):
        finger = Instance.from_description(description, source)
        enliven(finger)
        seen |= slopes(finger, recording)
    assert seen == wanted


# --- one finger by hand -----------------------------------------------------------------------------------------------


def test_a_rigid_finger_without_friction_depends_on_forces_alone(tmp_path: Path) -> None:
    description = {
        "format": "tendonfmu-finger-1",
        "name": "bare",
        "joints": [{}],
        "tendons": [{"stiffness": 1e3, "moment_arms": [0.01]}, {"stiffness": 1e3, "moment_arms": [-0.01]}],
        "contact": {"threshold": [0.1]},
    }
    found = declared(description, tmp_path)
    only_forces = {"tendon_force": [0, 1], "tendon_position": [], "joint_position": [], "joint_velocity": []}
    assert found["friction_torque"] == found["joint_contact"] == [only_forces]
    assert found["slack"][1] == {**only_forces, "tendon_force": [1]}


# --- extensions -------------------------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("row", repeated(ROWS, *range(0, len(ROWS), 4)), ids=name_of)
def test_each_declared_number_of_an_extension_influences(row: dict[str, Any], tmp_path: Path) -> None:
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
