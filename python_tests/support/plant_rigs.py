"""Small hand-made rigs of the simulated finger and how the tests run them. Shared by test_plant_*.py."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonfmu.simulate import plant as binding

Array = NDArray[Any]
Table = dict[str, Any]

needs_plant = pytest.mark.skipif(not binding.HAS_PLANT, reason=f"SIMULATED FINGER NOT TESTED: {binding.PLANT_MISSING}")

ARM, STIFFNESS = 0.01, 8000.0  # m, N/m: of the rigs below unless they say otherwise
ANTAGONISTS = [[ARM], [-ARM]]
TWO_JOINTS = [[ARM, ARM], [-ARM, ARM], [ARM, -ARM], [-ARM, -ARM]]  # every column sums to 0: equal tensions hold it
CALM = {"damping": 20.0}  # N·s/m in the tendons: settles the springs, leaves friction_torque alone


def dry(level: float, static: float | None = None, stribeck: float = 1.0, viscous: float = 0.0) -> Table:
    """A symmetric law; without `static` it has no Stribeck effect, so ĝ = 1."""
    return {
        "static": level if static is None else static,
        "coulomb": level,
        "stribeck_velocity": stribeck,
        "viscous": viscous,
    }


def still(posture: Sequence[float]) -> Table:
    """Joint knots of a motion that stays where it is."""
    return {"joints": [{"time": [0.0], "position": [q], "velocity": [0.0], "acceleration": [0.0]} for q in posture]}


def strokes(legs: Sequence[Sequence[float]], first: Sequence[float], soft: float = 0.1) -> Table:
    """Constant joint velocities one after the other, with soft changes between.

    legs: rows of [duration, velocity of joint 1, ...]; each leg holds its velocities exactly for its duration, and
    changes over to the next (and from and to rest) within `soft` s.
    """
    velocities = np.array([leg[1:] for leg in legs], dtype=float)
    durations = [leg[0] for leg in legs]
    joints = []
    for j, start in enumerate(first):
        time, position, velocity = [0.0], [float(start)], [0.0]
        for duration, speed in zip([*durations, 0.0], [*velocities[:, j], 0.0], strict=True):
            position.append(position[-1] + soft * (velocity[-1] + speed) / 2.0)
            time.append(time[-1] + soft)
            velocity.append(speed)
            if duration > 0.0:
                time.append(time[-1] + duration)
                position.append(position[-1] + duration * speed)
                velocity.append(speed)
        joints.append({"time": time, "position": position, "velocity": velocity, "acceleration": [0.0] * len(time)})
    return {"joints": joints}


def small_rig(
    arms: Sequence[Sequence[float]] = ANTAGONISTS,
    motion: Table | None = None,
    pretension: float = 10.0,
    joints: Sequence[Mapping[str, Any]] | None = None,
    tendons: Sequence[Mapping[str, Any]] | None = None,
    links: Sequence[Mapping[str, Any]] | None = None,
    **other: Any,
) -> Table:
    """An expanded rig of planar links (axis y, 40 mm long along x) without friction, gravity or stops.

    joints, tendons, links: what to add to the finger's joints, its tendons, and the links. other: keys of `physics`, or
    of the rig itself: pushes, sensors, settle, integration, seed, recording.
    """
    m, n = len(arms), len(arms[0])
    link = {"axis": [0.0, 1.0, 0.0], "mass": 0.01, "centre_of_mass": [0.02, 0.0, 0.0], "inertia": [1e-6, 2e-6, 2e-6]}
    offsets = [{"offset": [0.04 if j else 0.0, 0.0, 0.0]} for j in range(n)]
    extra_links, extra_joints = list(links or [{}] * n), list(joints or [{}] * n)
    extra_tendons = list(tendons or [{}] * m)
    own = ("pushes", "sensors", "settle", "integration", "seed", "recording")
    physics: Table = {
        "gravity": [0.0, 0.0, 0.0],
        "links": [link | offsets[j] | dict(extra_links[j]) for j in range(n)],
        "tip": [0.04, 0.0, 0.0],
    } | {key: value for key, value in other.items() if key not in own}
    rig: Table = {
        "format": "tendonfmu-rig-1",
        "name": "small",
        "version": 1,
        "finger": {
            "format": "tendonfmu-finger-1",
            "name": "small",
            "joints": [{"name": f"joint_{j + 1}"} | dict(extra_joints[j]) for j in range(n)],
            "tendons": [
                {"name": f"tendon_{i + 1}", "stiffness": STIFFNESS, "moment_arms": list(arms[i])}
                | dict(extra_tendons[i])
                for i in range(m)
            ],
            "contact": {"threshold": [0.05] * n},
        },
        "physics": physics,
        "motion": {"pretension": {"time": [0.0], "value": [pretension]}} | (motion or still([0.0] * n)),
        "pushes": [],
        "settle": 1.0,
        "integration": {"relative_tolerance": 1e-8},
        "recording": {"duration": 1.0},
    }
    return rig | {key: value for key, value in other.items() if key in own}


def calm(rig: Table) -> Table:
    """The rig with damped tendons."""
    given = rig["physics"].get("tendons", [{}] * len(rig["finger"]["tendons"]))
    rig["physics"]["tendons"] = [CALM | dict(each) for each in given]
    return rig


def make(rig: Mapping[str, Any], **settings: Any) -> binding.Plant:
    """The plant of a rig, initialised."""
    plant = binding.Plant(json.dumps(rig))
    if settings:
        plant.configure(**settings)
    plant.initialise()
    return plant


def run(rig: Mapping[str, Any], time: Array, **settings: Any) -> dict[str, Array]:
    """All signals at the times."""
    return make(rig, **settings).run(np.asarray(time, dtype=float))


def grid(duration: float, step: float) -> Array:
    return np.asarray(np.arange(round(duration / step) + 1) * step)


def balance(energy: Array) -> Array:
    """kinetic + potential + friction + damping − motor − push: constant."""
    kinetic, potential, motor, friction, damping, push = energy.T
    return np.asarray(kinetic + potential + friction + damping - motor - push)
