"""The recordings that the tests of the fit use: the small finger of fit_cases, whose truth is known."""

from __future__ import annotations

import copy
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from fit_cases import small_finger
from fit_data import make_recording, wavy_forces, wavy_motion
from tendonfmu.files.tables import write_table
from tendonfmu.recordings.recording import Recording

Description = dict[str, Any]


@lru_cache
def _made(seed: int, duration: float, rate: float, still: int | None, asymmetric: bool) -> Recording:
    motion = wavy_motion(seed, duration, rate, 2)
    if still is not None:
        motion["joint_position"][:, still] = 0.1
        motion["joint_velocity"][:, still] = 0.0
    truth = asymmetric_finger() if asymmetric else small_finger()
    made = make_recording(truth, motion, wavy_forces(seed, motion["time"], 4), seed)
    groups = dict(made.recording)
    return Recording(Path(f"made_{seed}.parquet"), groups.pop("time"), groups)


def made_recording(
    seed: int = 1,
    duration: float = 20.0,
    rate: float = 200.0,
    still: int | None = None,
    asymmetric: bool = False,
    keep: tuple[str, ...] = ("tendon_force", "tendon_position", "joint_position", "joint_velocity", "external_torque"),
) -> Recording:
    """Made by the model itself, explained exactly; arrays may be changed. still: a joint, from 0, that never moves."""
    made = _made(seed, duration, rate, still, asymmetric)
    return Recording(made.path, made.time.copy(), {name: made.groups[name].copy() for name in keep})


def asymmetric_finger() -> Description:
    """The small finger with a base joint whose negative side has twice the viscous friction.

    (A difference of Coulomb friction is a constant, which the bias takes.)
    """
    found = copy.deepcopy(small_finger())
    found["joints"][0]["friction"] = _two_sides(found["joints"][0]["friction"])
    return found


def _two_sides(law: dict[str, float]) -> dict[str, Any]:
    rough = {"static": 1.0, "coulomb": 1.0, "stribeck_velocity": 1.0, "viscous": 2.0}
    return {"positive": dict(law), "negative": {key: value * rough[key] for key, value in law.items()}}


def moved_start(seed: int = 3, most: float = 0.2) -> Description:
    """The small finger with every friction number up to a share off, the same for all tendons."""
    rng = np.random.default_rng(seed)
    found = copy.deepcopy(small_finger())
    factors = rng.uniform(1 - most, 1 + most, (8, 4))
    for joint, (kind, row) in zip(found["joints"], (("friction", 0), ("load_friction", 1)), strict=True):
        _scale(joint[kind], factors[row])
    for tendon in found["tendons"]:
        _scale(tendon["pulley_friction"][0], factors[2])
        _scale(tendon["edge_friction"][0], factors[3])
        for k, law in enumerate(tendon["edge_friction"][1]["laws"]):
            _scale(law, factors[4 + k])
    return found


def _scale(law: dict[str, float], factors: Any) -> None:
    drop = (law["static"] - law["coulomb"]) * factors[0]
    law["coulomb"] *= factors[1]
    law["static"] = law["coulomb"] + drop
    law["stribeck_velocity"] *= factors[2]
    if "viscous" in law:
        law["viscous"] *= factors[3]


def write_recording(recording: Recording, path: Path) -> Path:
    """As a file, a column per element."""
    columns = {"time": recording.time}
    for name, values in recording.groups.items():
        columns |= {f"{name}[{k}]": column for k, column in enumerate(values.T, start=1)}
    if recording.contact is not None:
        columns["contact"] = recording.contact
    write_table(path, columns)
    return path
