"""How noisy the joint positions of a recording are.

The noise is the difference of a sample from the smooth curve through its neighbours. A cubic through the two samples
before and the two after, at their true times, predicts each sample. The rest is noise if the motion is slow compared
with four samples. The median over many short blocks is used, so impacts and stick-slip have no effect. Quantisation
counts as well: a signal in steps of width d has at least the standard deviation d/√12 of its rounding, even at rest.

The noise is assumed to be white: a sensor with its own low-pass filter appears quieter than it is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

from tendonfmu.arrays import Data, Indices, Numbers
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
    """Estimate the standard deviation [n] (rad) of the noise of the joint angles in one sample.

    kinematics 1: angles from tendon positions and forces; 2, 3: measured ones. A `FitRecording` has its own.
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
        raise InputError(f"recording of {counted(len(time), 'sample')}: expected at least {FEWEST} to estimate noise")
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
        given = f"recording of {counted(len(left), 'sample')} without a gap"
        raise InputError(f"{given}: expected at least {FEWEST - 2 * reach}")
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


# --- smooth signals ---------------------------------------------------------------------------------------------------


ORDER = 2  # of the Butterworth filter, run both ways (Gustafsson, 1996)


def zero_phase(values: Numbers, cutoff: float, rate: float) -> Numbers:
    """Low-pass signals forwards and backwards."""
    # values: [N, ...]; cutoff, rate: (Hz); returns [N, ...], without phase lag
    sections = butter(ORDER, min(cutoff, 0.45 * rate), fs=rate, output="sos")
    return np.asarray(sosfiltfilt(sections, values, axis=0, padlen=min(len(values) - 1, int(3 * rate / cutoff))))


# --- stop operators ---------------------------------------------------------------------------------------------------


def stopped(drivers: Numbers, widths: Numbers, times: Numbers, step: float, starts: Indices) -> Numbers:
    """Return stop operators of drivers [B, k] with widths [k] and times [k] (s), as shares of their widths [B, k]."""
    kept = np.exp(-step / times)
    moves = np.diff(drivers, axis=0, prepend=drivers[:1]) / widths
    states = np.zeros_like(drivers)
    for first, end in pairwise(starts):
        state = np.zeros(drivers.shape[1])
        for k in range(first + 1, end):
            state = np.clip(kept * state + moves[k], -1.0, 1.0)
            states[k] = state
    return states


# --- best joint angles ------------------------------------------------------------------------------------------------
# Both are weighted by the inverse of their variance. An encoder's is that of its noise. Angles from tendon positions
# have another error beside noise: what springs and cords stretch beyond the description. It is what the two differ by
# beyond their noise.


ALL = 0.99  # a share above counts as all
CHANCE = 4.0  # standard errors of a covariance of white noise


@dataclass(frozen=True)
class BestAngles:
    """Recordings with the angles known best, and where these come from."""

    recordings: list[FitRecording]
    encoders: Numbers  # [n] weight of the encoders in them, 0 to 1, mean over the recordings

    @property
    def source(self) -> str:
        """In words."""
        if (self.encoders > ALL).all():
            return "joint encoders"
        return "tendon positions" if (self.encoders < 1.0 - ALL).all() else "joint encoders and tendon positions"


def best_angles(data: Data, recordings: Sequence[FitRecording]) -> BestAngles:
    """Return recordings whose runs use the best angles; those with only one kind of angle stay as they are."""
    chosen, weights = [], []
    for recording in recordings:
        best, weight = _best(data, recording)
        chosen.append(best)
        weights.append(weight)
    return BestAngles(chosen, np.mean(weights, axis=0))


def on_encoders(data: Data, recordings: Sequence[FitRecording]) -> list[FitRecording]:
    """Return recordings whose runs take the joint encoders, if all can, none does, and they know the angles better."""
    can = all(each.kinematics == 1 and "joint_position" in each.recording.groups for each in recordings)
    if not (can and recordings and best_angles(data, recordings).encoders.mean() > 0.5):
        return []
    return [replace(recording, kinematics=2) for recording in recordings]


def _best(data: Data, recording: FitRecording) -> tuple[FitRecording, Numbers]:
    groups = recording.recording.groups
    joints = len(data["joints"])
    if recording.kinematics == 3 or "joint_position" not in groups or "tendon_position" not in groups:
        return recording, np.full(joints, float(recording.kinematics != 1))
    compliance = np.array([1.0 / tendon["stiffness"] for tendon in data["tendons"]])
    by_tendons = (groups["tendon_position"] - groups["tendon_force"] * compliance) @ np.linalg.pinv(moment_arms(data)).T
    by_encoders = groups["joint_position"]
    apart = by_tendons - by_encoders
    apart = apart - apart[recording.train].mean(axis=0)
    noise = [joint_position_noise(data, recording.recording, source) ** 2 for source in (1, 2)]
    error = noise[0] + _lasting(apart[recording.train])
    weight = error / (error + noise[1])
    weight = np.where(weight > ALL, 1.0, np.where(weight < 1.0 - ALL, 0.0, weight))
    return with_angles(recording, by_encoders + (1.0 - weight) * apart), weight


def _lasting(values: Numbers) -> Numbers:
    """Return [n] the variance of values [N, n] beside white noise: the covariance of neighbours, if it is certain."""
    covariance = np.mean(values[1:] * values[:-1], axis=0)
    return np.where(covariance > CHANCE * values.var(axis=0) / np.sqrt(len(values)), covariance, 0.0)


def with_angles(recording: FitRecording, angle: Numbers) -> FitRecording:
    """Return a recording whose runs take these joint angles [N, n] (rad)."""
    return replace(recording.with_groups(joint_position=angle), kinematics=2)
