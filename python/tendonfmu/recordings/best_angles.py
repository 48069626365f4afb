"""The joint angles of a recording as they are known best: from joint encoders, from tendon positions, or from both.

Both are weighted by the inverse of their variance. An encoder's is that of its noise. Angles from tendon positions have
another error beside noise: what springs and cords stretch beyond the description. It is what the two differ by beyond
their noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.model import moment_arms
from tendonfmu.recordings.prepared import FitRecording
from tendonfmu.recordings.signal_noise import joint_position_noise

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
    groups = {**recording.recording.groups, "joint_position": angle}
    return replace(recording, recording=replace(recording.recording, groups=groups), kinematics=2)
