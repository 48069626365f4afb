"""How noisy the joint positions of a recording are.

The noise is the difference of a sample from the smooth curve through its neighbours. A cubic through the two samples
before and the two after, at their true times, predicts each sample. The rest is noise if the motion is slow compared
with four samples. The median over many short blocks is used, so impacts and stick-slip have no effect. Quantisation
counts as well: a signal in steps of width d has at least the standard deviation d/√12 of its rounding, even at rest.

The noise is assumed to be white: a sensor with its own low-pass filter appears quieter than it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.files import counted
from tendonfmu.model import moment_arms
from tendonfmu.recordings.faults import value_step
from tendonfmu.recordings.prepared import FitRecording
from tendonfmu.recordings.recording import Recording

NEIGHBOURS = (-2, -1, 1, 2)  # samples of the cubic
BLOCK = 40  # samples
FEWEST = 60  # samples; fewer give no useful estimate
GAP = 3.0  # times the median step; no cubic spans a longer step
LEAST = 1e-6  # rad: no sensor of a joint resolves less


def joint_position_noise(data: Mapping[str, Any], recording: Recording | FitRecording, kinematics: int = 1) -> Numbers:
    """Estimate the standard deviation of the noise of the joint angles in one sample.

    Parameters
    ----------
    data
        A valid finger description.
    recording
        The recording. A `FitRecording` has its own kinematics.
    kinematics
        1: angles from tendon positions and forces. 2, 3: measured joint positions.

    Returns
    -------
    Numbers
        [n] (rad), at least 1e-6.

    Raises
    ------
    InputError
        The recording has no such columns, or fewer than 60 samples without a gap.
    """
    if isinstance(recording, FitRecording):
        kinematics = recording.kinematics
        recording = recording.recording
    joints, tendons = len(data["joints"]), len(data["tendons"])
    if kinematics != 1:
        recording.require(joints, tendons, ("joint_position",))
        angles = recording.groups["joint_position"]
        floor = _rounding(angles)
    else:
        recording.require(joints, tendons, ("tendon_force", "tendon_position"))
        force, position = recording.groups["tendon_force"], recording.groups["tendon_position"]
        compliance = np.array([1.0 / tendon["stiffness"] for tendon in data["tendons"]])
        routing = np.linalg.pinv(moment_arms(data))  # R⁺, [n, m]
        angles = (position - force * compliance) @ routing.T
        floor = np.sqrt(routing**2 @ (_rounding(position) ** 2 + (_rounding(force) * compliance) ** 2))
    return np.asarray(np.maximum(np.maximum(white_noise(recording.time, angles), floor), LEAST))


def white_noise(time: Numbers, values: Numbers) -> Numbers:
    """Estimate the standard deviation of each column around the smooth curve through its neighbours."""
    # time: [N] (s); values: [N, c]; returns [c], in the unit of the values
    reach = max(NEIGHBOURS)
    if len(time) < FEWEST:
        raise InputError(
            f"recording of {counted(len(time), 'sample')}: expected at least {FEWEST} to estimate noise from"
        )
    at = np.arange(reach, len(time) - reach)
    distance = np.stack([time[at + offset] - time[at] for offset in NEIGHBOURS])  # [4, K]
    weights = np.stack([_lagrange(distance, k) for k in range(len(NEIGHBOURS))])
    left = values[at].astype(float)
    for weight, offset in zip(weights, NEIGHBOURS, strict=True):
        left = left - weight[:, None] * values[at + offset]
    left /= np.sqrt(1.0 + (weights**2).sum(axis=0))[:, None]
    steps = np.diff(time)
    whole = np.lib.stride_tricks.sliding_window_view(steps, 2 * reach).max(axis=1) <= GAP * np.median(steps)
    left = left[whole]
    if len(left) < FEWEST - 2 * reach:
        raise InputError(
            f"recording of {counted(len(left), 'sample')} without a gap: expected at least {FEWEST - 2 * reach}"
        )
    size = min(BLOCK, len(left))
    blocks = left[: len(left) // size * size].reshape(-1, size, left.shape[1])
    return np.array([_of_blocks(column) for column in (blocks**2).mean(axis=1).T])


def _lagrange(distance: Numbers, k: int) -> Numbers:
    """Return the weight [K] of neighbour k in the cubic's value at distance 0."""
    weight = np.ones(distance.shape[1])
    for other in range(len(distance)):
        if other != k:
            weight *= distance[other] / (distance[other] - distance[k])
    return weight


def _of_blocks(variance: Numbers) -> float:
    """Return the noise from the variances of blocks. Blocks of a quantised signal without any change are left out."""
    changing = variance[variance > 0.0]
    return float(np.sqrt(np.median(changing))) if len(changing) else 0.0


def _rounding(values: Numbers) -> Numbers:
    """Return the standard deviation [c] of the rounding of columns whose values come in equal steps, else 0."""
    return np.asarray(np.array([value_step(column) for column in values.T]) / np.sqrt(12.0))
