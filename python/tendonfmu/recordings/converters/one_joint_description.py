"""Which description fits a one-joint machine with measured drive torque, with starting numbers from its own log.

A straight line explains the torque: torque − known load = coulomb·sgn(v) + viscous·v + inertia·a + offset, by least
squares over the samples in motion. `tendonfmu fit` starts from these numbers. With a known load there is no row
`inertia`: a known load already contains the torque that accelerates the machine.
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
SLOWEST = 1e-3  # of the largest speed; below, the joint counts as at rest
THRESHOLD = 5.0  # times the residual of the straight line (rms); `tendonfmu tune` finds better thresholds
LEAST_SHARE = 1e-3  # of the torque's rms; starting value of a magnitude for which least squares gives less


def describe_joint(log: ConvertedLog) -> dict[str, Any]:
    """Make the finger description of the machine in a log.

    Parameters
    ----------
    log
        A converted log whose map has the key `joint`.

    Returns
    -------
    dict
        A finger description, as in the JSON file.

    Raises
    ------
    InputError
        The map has no `joint`, or the joint does not move.
    """
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
        # one offset for a recording: a bias that learns would follow the friction that is to be estimated
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
    """Return the text of a description's file.

    Parameters
    ----------
    description
        A finger description.

    Returns
    -------
    str
        JSON with a line end.
    """
    return json.dumps(description, indent=1) + "\n"


def slowest_motion(velocity: Series, angle: Series, cutoff: float) -> float:
    """Return the speed (rad/s) below which the joint is at rest.

    It is the velocity that one step of the encoder causes, and at least a thousandth of the largest speed.
    """
    step = 2 * np.pi * cutoff * value_step(angle)
    return float(f"{max(step, value_step(velocity), SLOWEST * np.abs(velocity).max()):.3g}")


def starting_numbers(columns: dict[str, Series], slowest: float) -> dict[str, float]:
    """Return the numbers of the straight line.

    These are coulomb (N.m), viscous (N.m.s/rad), inertia (kg.m2), offset (N.m) and missed (N.m, rms of the residual).
    """
    velocity = columns["joint_velocity[1]"]
    known = columns.get("external_torque[1]")
    torque = columns["tendon_force[1]"] - (0.0 if known is None else known)
    acceleration = np.gradient(velocity, columns["time"])
    moving = np.abs(velocity) > slowest
    regressors = [np.sign(velocity), velocity, np.ones_like(velocity)] + ([acceleration] if known is None else [])
    matrix = np.column_stack(regressors)[moving]
    # normalised columns: for a motion at one speed, where two columns are equal, this gives the smallest numbers
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
