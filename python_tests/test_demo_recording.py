"""The demo recording: what the contract asks of a recording, and the physics that made it."""

from __future__ import annotations

import ast
import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import oracle

EXAMPLES = Path(__file__).parents[1] / "examples"
FOLDER = EXAMPLES / "demo_recording"
PARQUET = FOLDER / "index_finger_demo.parquet"
SIZES = {"tendon_force": 8, "tendon_position": 8, "joint_position": 4, "external_torque": 4}
STEP = 0.001  # s


@pytest.fixture(scope="module")
def recording() -> dict[str, np.ndarray]:
    table = pq.read_table(PARQUET)
    columns = {"time": table["time"].to_numpy(), "contact": table["contact"].to_numpy()}
    for name, size in SIZES.items():
        columns[name] = np.column_stack([table[f"{name}[{k + 1}]"].to_numpy() for k in range(size)])
    assert table.num_columns == 2 + sum(SIZES.values())
    return columns


@pytest.fixture(scope="module")
def finger() -> dict[str, np.ndarray]:
    description: dict[str, Any] = json.loads((EXAMPLES / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
    return {
        "arms": np.array([tendon["moment_arms"] for tendon in description["tendons"]]),
        "stiffness": np.array([tendon["stiffness"] for tendon in description["tendons"]]),
    }


@pytest.fixture(scope="module")
def modules() -> Iterator[dict[str, ModuleType]]:
    """The generator's modules, imported as its script does."""
    sys.path.insert(0, str(FOLDER))
    names = ("contacts", "finger_plant", "motion")
    yield {name: importlib.import_module(name) for name in names}
    sys.path.remove(str(FOLDER))
    for name in names:
        del sys.modules[name]


def test_it_is_a_recording_of_the_contract(recording: dict[str, np.ndarray]) -> None:
    assert PARQUET.stat().st_size < 1_500_000
    assert len(recording["time"]) == 30000
    assert np.diff(recording["time"]).min() > 0
    for values in recording.values():
        assert np.all(np.isfinite(values))
    assert set(np.unique(recording["contact"])) == {0, 1}
    assert recording["tendon_force"].min() > 0


def test_it_starts_and_ends_at_rest_without_contact(recording: dict[str, np.ndarray]) -> None:
    time = recording["time"]
    for part in (time < 0.9, time > time[-1] - 0.5):
        assert not recording["contact"][part].any()
        assert np.ptp(recording["tendon_position"][part], axis=0).max() <= 2e-6
        # four steps of the sensor and five standard deviations of its noise
        assert np.ptp(recording["joint_position"][part], axis=0).max() < 2.5e-3


def test_forces_positions_and_angles_belong_together(
    recording: dict[str, np.ndarray], finger: dict[str, np.ndarray]
) -> None:
    joint_side = recording["tendon_position"] - recording["tendon_force"] / finger["stiffness"]
    gap = joint_side - recording["joint_position"] @ finger["arms"].T
    # sensor noise: 0.2 mrad and its rounding on up to 10 mm, 3 mN on 5500 N/m, 2 um steps
    assert np.abs(gap.mean(axis=0)).max() < 1e-7
    assert gap.std(axis=0).max() < 4e-6


def test_load_only_where_the_label_says_contact(recording: dict[str, np.ndarray]) -> None:
    free = recording["contact"] == 0
    # six standard deviations of the sensor; the label begins at 0.05 N on up to 95 mm
    assert np.abs(recording["external_torque"][free]).max() < 0.0018 + 0.005
    begins = np.flatnonzero(np.diff(recording["contact"].astype(int)) == 1)
    assert len(begins) == 11
    assert np.abs(recording["external_torque"]).max() > 0.1


def test_joints_move_at_the_same_time_reverse_and_rest(recording: dict[str, np.ndarray]) -> None:
    smooth = np.cumsum(recording["joint_position"], axis=0)
    smooth = (smooth[50:] - smooth[:-50]) / 50
    speed = (smooth[50:] - smooth[:-50]) / 0.1
    moving = np.abs(speed) > 0.02
    assert (moving.sum(axis=1) >= 2).mean() > 0.6
    assert np.all((~moving).mean(axis=0) > 0.1)
    for j in range(4):
        direction = np.sign(speed[moving[:, j], j])
        assert (np.diff(direction) != 0).sum() >= 8


def test_the_generator_shares_nothing_with_the_runtime() -> None:
    allowed = {"numpy", "pyarrow", "contacts", "finger_plant", "motion"} | set(sys.stdlib_module_names)
    for source in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                assert {alias.name.split(".")[0] for alias in node.names} <= allowed
            elif isinstance(node, ast.ImportFrom):
                assert (node.module or "").split(".")[0] in allowed


def drive(plant: Any, finger: dict[str, np.ndarray], joint: int, speed: float, seconds: float) -> np.ndarray:
    """Moves the motors as for one joint at constant speed; returns the joint torques (steps, 4)."""
    start = plant.angle.copy()
    torques = []
    for k in range(int(seconds / STEP)):
        angle = start + speed * k * STEP * np.eye(4)[joint]
        motors = finger["arms"] @ angle + 10.0 / finger["stiffness"]
        plant.advance(motors, np.zeros(4), STEP)
        torques.append(finger["arms"].T @ plant.tendon_force(motors))
    return np.array(torques)


def test_plant_friction_opposes_the_motion(modules: dict[str, ModuleType], finger: dict[str, np.ndarray]) -> None:
    for joint in range(4):
        levels = []
        for speed in (0.3, -0.3):
            plant = modules["finger_plant"].FingerPlant(finger["arms"], finger["stiffness"], np.random.default_rng(0))
            levels.append(drive(plant, finger, joint, speed, 0.8)[-1, joint])
        # the motors pull against friction: more torque forth than back
        assert levels[0] - levels[1] > 0.008


def test_plant_friction_grows_with_the_speed_only_a_little(
    modules: dict[str, ModuleType], finger: dict[str, np.ndarray]
) -> None:
    """Dry friction: ten times the speed is far from ten times the torque."""
    widths = []
    for speed, seconds in ((0.1, 1.5), (1.0, 0.15)):
        ends = []
        for direction in (1.0, -1.0):
            plant = modules["finger_plant"].FingerPlant(finger["arms"], finger["stiffness"], np.random.default_rng(0))
            ends.append(drive(plant, finger, 1, direction * speed, seconds)[-1, 1])
        widths.append(ends[0] - ends[1])
    assert 0.5 < widths[1] / widths[0] < 2.0


def test_plant_holds_a_load_with_its_tendons_and_friction(
    modules: dict[str, ModuleType], finger: dict[str, np.ndarray]
) -> None:
    """At rest the tendons' torque changes by the load, up to what friction takes of it."""
    plant = modules["finger_plant"].FingerPlant(finger["arms"], finger["stiffness"], np.random.default_rng(0))
    motors = finger["arms"] @ plant.angle + 10.0 / finger["stiffness"]
    for _ in range(500):
        plant.advance(motors, np.zeros(4), STEP)
    before = finger["arms"].T @ plant.tendon_force(motors)
    load = np.array([0.0, 0.1, 0.0, 0.0])
    for k in range(1000):
        plant.advance(motors, min(1.0, k / 200) * load, STEP)
    change = finger["arms"].T @ plant.tendon_force(motors) - before
    assert 0.03 < change[1] < 0.1
    assert np.abs(plant.velocity).max() < 1e-3


def test_load_of_a_push_is_minus_its_virtual_work(modules: dict[str, ModuleType]) -> None:
    """Against the gradient of the tip's position along the force, by central differences."""
    lengths = modules["contacts"].LINK_LENGTH

    def tip(angle: np.ndarray) -> np.ndarray:
        heading = np.cumsum(angle[1:])
        reach, drop = np.dot(lengths, np.cos(heading)), np.dot(lengths, np.sin(heading))
        return np.array([reach * np.cos(angle[0]), reach * np.sin(angle[0]), -drop])

    rng = np.random.default_rng(3)
    for _ in range(20):
        angle, force = rng.uniform(-0.3, 1.2, 4), rng.standard_normal(3)
        # the tip's axes in space: along, sideways, from pad to nail
        turn, pitch = angle[0], angle[1:].sum()
        ahead = np.array([np.cos(turn), np.sin(turn), 0.0])
        along = np.cos(pitch) * ahead + [0.0, 0.0, -np.sin(pitch)]
        sideways = np.array([-np.sin(turn), np.cos(turn), 0.0])
        on_pad = np.sin(pitch) * ahead + [0.0, 0.0, np.cos(pitch)]
        spatial = force @ np.array([along, sideways, on_pad])
        work = [(tip(angle + d) - tip(angle - d)) @ spatial / 2e-6 for d in 1e-6 * np.eye(4)]
        # differences of 1e-6 rad on 0.1 m: relative error about 1e-9
        assert modules["motion"].load_of_push(angle, force) == pytest.approx(-np.array(work), abs=1e-8)


@pytest.mark.slow
def test_the_description_explains_it_without_being_fitted(recording: dict[str, np.ndarray]) -> None:
    """The first 14 s through the oracle: the README's figures for the whole are 0.12 to 0.26 of the torque."""
    description = json.loads((EXAMPLES / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
    part = slice(0, 7000)
    inputs = {name: recording[name][part] for name in ("time", "tendon_force", "tendon_position")}
    outputs = oracle.run(description, inputs).outputs
    contact = recording["contact"][part] == 1

    left = np.sqrt(np.mean(outputs["compensated_torque"][~contact] ** 2, axis=0))
    torque = np.sqrt(np.mean(outputs["joint_torque"][~contact] ** 2, axis=0))
    assert np.all(left < 0.4 * torque)
    alarm = outputs["contact"].ravel().astype(bool)
    assert not alarm[~contact].any()
    assert alarm[contact].mean() > 0.7
    error = outputs["compensated_torque"] - recording["external_torque"][part]
    assert np.sqrt(np.mean(error[contact] ** 2, axis=0)).max() < 0.012
    assert not outputs["slack"].any()
