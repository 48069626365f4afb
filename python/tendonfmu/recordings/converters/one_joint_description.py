"""The description of a one-joint machine whose drive torque is measured, with numbers that its own log gives.

A straight line explains the torque: torque − known load = coulomb·sgn(v) + viscous·v + inertia·a + offset, by least
squares over the samples in motion. `tendonfmu fit` begins there. With a known load there is no row `inertia`: who
knows the load has taken off what accelerates the machine as well.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.one_joint import CUTOFF
from tendonfmu.recordings.converters.table import ConvertedLog
from tendonfmu.recordings.signal_noise import value_step

Series = NDArray[np.float64]

STIFFNESS = 1e9  # N/m: the drive is rigid, q = x0
SLOWEST = 1e-3  # of the largest speed: below, the joint counts as at rest
THRESHOLD = 5.0  # times what the start misses (rms); `tendonfmu tune` finds better ones
LEAST_SHARE = 1e-3  # of the torque's rms: a start of a magnitude that least squares makes negative


def describe_joint(log: ConvertedLog) -> dict[str, Any]:
    """A finger description (JSON) of the machine in a log. Raises InputError where the map has no `joint`."""
    joint = log.map.joint
    if joint is None:
        raise InputError(
            f'{log.map.path}: joint: missing; expected "joint" instead of "columns" where --finger is to be written'
        )
    columns = log.columns
    velocity = columns["joint_velocity[1]"]
    cutoff = log.velocity_cutoff or CUTOFF
    slowest = slowest_motion(velocity, columns["joint_position[1]"], cutoff)
    start = starting_numbers(columns, slowest)
    law = {
        "static": start["coulomb"],
        "coulomb": start["coulomb"],
        "stribeck_velocity": float(f"{np.abs(velocity).max() / 10:.3g}"),
        "viscous": start["viscous"],
    }
    known = "external_torque[1]" in columns
    inertia = {"effect": "inertia", "joint": 1, "inertia": start["inertia"]}
    return {
        "format": "tendonfmu-finger-1",
        "name": joint.name,
        "joints": [{"name": joint.name, "friction": law}],
        "tendons": [{"name": "drive", "bidirectional": True, "stiffness": STIFFNESS, "moment_arms": [1.0]}],
        "velocity_threshold": {"tendon": slowest, "joint": slowest},
        "velocity_filter_cutoff": cutoff,
        # one offset for a recording: a bias that learns would follow what is to be found
        "bias": {
            "drift_variance": 0.0,
            "noise_std": start["missed"],
            "initial_variance": 0.0,
            "forget_rate": 0.0,
            "initial_torque": [start["offset"]],
        },
        "contact": {"threshold": [float(f"{THRESHOLD * start['missed']:.4g}")]},
        "extensions": [] if known else [inertia],
    }


def description_text(description: dict[str, Any]) -> str:
    """As it is written to a file."""
    return json.dumps(description, indent=1) + "\n"


def slowest_motion(velocity: Series, angle: Series, cutoff: float) -> float:
    """rad/s below which the joint is at rest: what one step of the encoder makes of a velocity, and no less than a
    thousandth of the largest speed.
    """
    step = 2 * np.pi * cutoff * value_step(angle)
    return float(f"{max(step, value_step(velocity), SLOWEST * np.abs(velocity).max()):.3g}")


def starting_numbers(columns: dict[str, Series], slowest: float) -> dict[str, float]:
    """coulomb (N.m), viscous (N.m.s/rad), inertia (kg.m2), offset (N.m), missed (N.m, rms of what the line leaves)."""
    velocity = columns["joint_velocity[1]"]
    known = columns.get("external_torque[1]")
    torque = columns["tendon_force[1]"] - (0.0 if known is None else known)
    acceleration = np.gradient(velocity, columns["time"])
    moving = np.abs(velocity) > slowest
    regressors = [np.sign(velocity), velocity, np.ones_like(velocity)] + ([acceleration] if known is None else [])
    matrix = np.column_stack(regressors)[moving]
    # columns of one size, so that a motion at one speed (two of them alike) gives the smallest numbers, not any
    sizes = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
    found = np.linalg.lstsq(matrix / sizes, torque[moving], rcond=1e-9)[0] / sizes
    missed = float(np.sqrt(np.mean((torque[moving] - matrix @ found) ** 2)))
    least = LEAST_SHARE * float(np.sqrt(np.mean(torque**2)))
    speed = float(np.sqrt(np.mean(velocity[moving] ** 2)))
    numbers = {
        "coulomb": max(float(found[0]), least),
        "viscous": max(float(found[1]), least / speed),
        "inertia": float(found[3]) if known is None else 0.0,
        "offset": float(found[2]),
        "missed": max(missed, least),
    }
    return {name: float(f"{value:.6g}") for name, value in numbers.items()}
