"""A one-joint finger with two tendons in a screen of numpy, recorded with any of its numbers changed, for tests.

It shares no code with the product: an imposed motion, dry friction, and the tendon forces that carry it all.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.files.tables import write_table
from tendonfmu.model.description import Finger
from tendonfmu.recordings.recording import Recording

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

RATE = 250.0  # Hz
ARMS = np.array([0.009, -0.0085])  # m
STIFFNESS = 4000.0  # N/m
SMOOTH = 0.01  # rad/s, of the sign of a velocity
FORCE_NOISE, POSITION_STEP = 0.02, 1e-6  # N, m


@dataclass(frozen=True)
class Worn:
    """dry: N·m in the joint. edge: share of each tendon's force that is lost before the joint. cover: N·m/rad. mass:
    N·m of a weight at right angles. hum: N·m of a torque sin(9 q), which no effect describes. load: N·m, all the time.
    """

    dry: float = 0.012
    edge: tuple[float, float] = (0.03, 0.03)
    cover: float = 0.03
    mass: float = 0.0
    hum: float = 0.0
    load: float = 0.0


WELL = Worn()


@dataclass(frozen=True)
class How:
    """motion, noise: seeds. pretension: N. rest: s at the begin without motion."""

    motion: int = 1
    noise: int = 1
    seconds: float = 24.0
    pretension: float = 20.0
    rest: float = 0.0


def record(worn: Worn = WELL, how: How | None = None, **other: Any) -> Columns:
    """Columns as docs/reference/recordings.md has them. other: of `How`."""
    how = replace(how or How(), **other)
    time = np.arange(round(how.seconds * RATE)) / RATE
    angle, speed = _motion(how, time)
    rng = np.random.default_rng([how.motion, 1])
    pull = how.pretension * (1 + 0.35 * np.sin(2 * np.pi * rng.uniform(0.09, 0.13) * time + rng.uniform(0, 6)))
    passed = ARMS * (1 - np.array(worn.edge) * np.tanh(speed[:, None] * np.sign(ARMS) / SMOOTH))
    carried = worn.dry * np.tanh(speed / SMOOTH) + worn.cover * angle + worn.mass * np.sin(angle + 0.4)
    carried = carried + worn.hum * np.sin(9.0 * angle) + worn.load
    missing = carried - passed.sum(axis=1) * pull
    force = pull[:, None] + passed * (missing / np.sum(passed**2, axis=1))[:, None]
    position = np.outer(angle, ARMS) + force / STIFFNESS
    noise = np.random.default_rng([how.noise, 2]).standard_normal(force.shape)
    columns = {"time": time}
    for i in range(2):
        columns[f"tendon_force[{i + 1}]"] = force[:, i] + FORCE_NOISE * noise[:, i]
        columns[f"tendon_position[{i + 1}]"] = np.round(position[:, i] / POSITION_STEP) * POSITION_STEP
    return columns | {"joint_position[1]": angle, "joint_velocity[1]": speed}


def _motion(how: How, time: Array) -> tuple[Array, Array]:
    """Angle and speed: four sines whose clock stands still during the rest."""
    rng = np.random.default_rng([how.motion, 0])
    frequency, phase = rng.uniform(0.15, 0.7, 4), rng.uniform(0, 2 * np.pi, 4)
    clock = np.maximum(time - how.rest, 0.0)
    turns = 2 * np.pi * np.outer(clock, frequency) + phase
    angle = 0.05 + 0.22 * np.sin(turns).sum(axis=1)
    speed = 0.22 * (2 * np.pi * frequency * np.cos(turns)).sum(axis=1)
    return angle, np.where(time < how.rest, 0.0, speed)


def described(**joint: Any) -> dict[str, Any]:
    """What a user has: rough numbers. joint: keys of the joint that are other; None: left out."""

    def law(size: float, velocity: float) -> dict[str, float]:
        return {"static": size, "coulomb": size, "stribeck_velocity": velocity, "viscous": 0.0}

    own = {"cover": {"stiffness": 0.02, "rest_angle": 0.0}, "friction": law(0.009, 0.1)} | joint
    return {
        "format": "tendonfmu-finger-1",
        "name": "worn finger",
        "joints": [{key: value for key, value in own.items() if value is not None}],
        "tendons": [
            {"stiffness": STIFFNESS, "moment_arms": [float(arm)], "edge_friction": [law(0.02, 0.001)]} for arm in ARMS
        ],
        "velocity_threshold": {"tendon": 1e-4, "joint": 0.01},
        "bias": {"drift_variance": 1e-6, "noise_std": 0.002, "forget_rate": 0.1},
        "contact": {"threshold": [0.05]},
    }


def finger(data: Mapping[str, Any] | None = None) -> Finger:
    return Finger(Path("finger.json"), data or described())


def recording(columns: Columns, name: str = "now.parquet") -> Recording:
    """The columns in memory."""
    force, position = (
        np.column_stack([columns[f"{group}[{i + 1}]"] for i in range(2)])
        for group in ("tendon_force", "tendon_position")
    )
    joints = {group: columns[f"{group}[1]"][:, None] for group in ("joint_position", "joint_velocity")}
    groups = {"tendon_force": force, "tendon_position": position, **joints}
    return Recording(Path(name), columns["time"], groups)


def write_files(folder: Path, data: Mapping[str, Any] | None = None, **recordings: Columns) -> dict[str, Path]:
    """finger.json and NAME.parquet of each recording, by name."""
    files = {"finger": folder / "finger.json"}
    files["finger"].write_text(json.dumps(data or described()), encoding="utf-8")
    for name, columns in recordings.items():
        files[name] = folder / f"{name}.parquet"
        write_table(files[name], dict(columns))
    return files
