"""Hands of numpy for tests: two or more fingers, a wrist that they share, and recordings with the truth beside them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.files.tables import write_table
from worn_finger import WELL, Worn, described, record

Array = NDArray[np.float64]
Columns = dict[str, Array]
FINGERS = ("index", "ring")
RATE = 200.0  # Hz


# --- fingers of one joint that wear -----------------------------------------------------------------------------------


def worn_columns(noise: int, worse: str = "", seconds: float = 16.0, more: float = 1.6) -> Columns:
    """A recording of `FINGERS`, each with a motion of its own; the joint of `worse` rubs more."""
    columns: Columns = {}
    for k, name in enumerate(FINGERS, start=1):
        worn = Worn(dry=more * WELL.dry) if name == worse else WELL
        signals = dict(record(worn, motion=k, noise=10 * noise + k, seconds=seconds))
        columns["time"] = signals.pop("time")
        columns |= {f"{name}_{column}": values for column, values in signals.items()}
    return columns


def write_worn_hand(folder: Path, **recordings: Columns) -> dict[str, Path]:
    """hand.json, the descriptions, and NAME.parquet of each recording, by name."""
    for name in FINGERS:
        (folder / f"{name}.json").write_text(json.dumps(described() | {"name": name}))
    fingers = [{"name": name, "description": f"{name}.json", "columns": f"{name}_"} for name in FINGERS]
    files = {"hand": write_hand(folder, fingers)}
    for name, columns in recordings.items():
        files[name] = folder / f"{name}.parquet"
        write_table(files[name], columns)
    return files


def write_hand(folder: Path, fingers: list[dict[str, Any]], **other: Any) -> Path:
    file = folder / "hand.json"
    file.write_text(json.dumps({"format": "tendonfmu-hand-1", "name": "right_hand", "fingers": fingers, **other}))
    return file


# --- fingers of two joints behind a wrist -----------------------------------------------------------------------------

OWN_ARMS = np.array([[0.010, 0.0], [-0.010, 0.0], [0.008, 0.007], [-0.008, -0.007]])  # m
WRIST_ARMS = np.array([[0.02], [-0.02]])  # m, of the wrist's own tendons


def finger_data(name: str, arms: Array, joints: list[str], stiffness: float = 4000.0) -> dict[str, Any]:
    law = {"static": 0.025, "coulomb": 0.02, "stribeck_velocity": 0.002, "viscous": 0.0}
    return {
        "format": "tendonfmu-finger-1",
        "name": name,
        "joints": [{"name": joint} for joint in joints],
        "tendons": [
            {"stiffness": stiffness, "moment_arms": row.tolist(), "edge_friction": [law] * len(joints), "zero": 0.001}
            for row in arms
        ],
        "contact": {"threshold": [10.0] * len(joints)},
    }


def motion(seed: int, joints: int, time: Array) -> Array:
    rng = np.random.default_rng(seed)
    frequency, phase = rng.uniform(0.15, 0.6, (joints, 3)), rng.uniform(0, 6, (joints, 3))
    return np.asarray(0.2 + 0.2 * np.sin(2 * np.pi * frequency * time[:, None, None] + phase).sum(axis=2))


def readings(data: Mapping[str, Any], angle: Array, force: Array, prefix: str) -> Columns:
    """x0 = zero + R q + f0/k, and f0."""
    arms = np.array([row["moment_arms"] for row in data["tendons"]])
    position = 0.001 + angle @ arms.T + force / data["tendons"][0]["stiffness"]
    columns = {f"{prefix}tendon_force[{i + 1}]": force[:, i] for i in range(force.shape[1])}
    return columns | {f"{prefix}tendon_position[{i + 1}]": position[:, i] for i in range(force.shape[1])}


def write_wrist_hand(folder: Path, wrist: str) -> tuple[Path, Path, dict[str, Array]]:
    """hand.json, a recording, and the true angles by finger. wrist: "measured", "tendons" or "" for none."""
    time = np.arange(600) / RATE
    shared = motion(99, 1, time)
    columns, truth, fingers = {"time": time}, {}, []
    for k, name in enumerate(FINGERS):
        passing = np.random.default_rng(k).uniform(-0.012, 0.012, (4, 1))
        arms = np.hstack([passing, OWN_ARMS]) if wrist else OWN_ARMS
        angle = motion(k, 2, time)
        truth[name] = np.hstack([shared, angle]) if wrist else angle
        data = finger_data(name, arms, [*(["flexion"] if wrist else []), "mcp", "pip"])
        (folder / f"{name}.json").write_text(json.dumps(data))
        force = 15 + 5 * np.sin(0.7 * time[:, None] + np.arange(4))
        columns |= readings(data, truth[name], force, f"{name}.")
        fingers.append({"name": name, "description": f"{name}.json"})
    other: dict[str, Any] = {}
    if wrist == "measured":
        columns["wrist.joint_position[1]"] = shared[:, 0]
        other["wrist"] = {"joints": ["flexion"]}
    elif wrist:
        data = finger_data("wrist", WRIST_ARMS, ["flexion"], stiffness=9000.0)
        (folder / "wrist.json").write_text(json.dumps(data))
        columns |= readings(data, shared, 30 + np.sin(time[:, None] + np.arange(2)), "wrist.")
        other["wrist"] = {"description": "wrist.json"}
    hand = write_hand(folder, fingers, **other)
    recording = folder / "recording.parquet"
    write_table(recording, columns)
    return hand, recording, truth
