"""How recordings and models look to a diagnosis: averaged over short blocks of time.

G_k = T_k + Σ Δb up to k is a model's torque with all jumps of fig. 5. A diagnosis looks only at what it leaves, y − G.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.model import moment_arms, native, number_of, without_learning
from tendonfmu.recordings import FitRecording, Grid, Segment, delayed_torque
from tendonfmu.statistics import BlockSeries


@dataclass(frozen=True)
class Series(BlockSeries):
    """Block means of all recordings, one after another; n joints, m tendons."""

    angle: Numbers  # rad [B, n]
    velocity: Numbers  # rad/s [B, n]
    acceleration: Numbers  # rad/s² [B, n]
    force: Numbers  # N [B, m]
    tendon_velocity: Numbers  # ẋ_ij, m/s [B, m, n]
    travel: Numbers  # travel since the joint last reversed, rad [B, n]


def _image(data: Mapping[str, Any]) -> Any:
    """Return the image of a description with a bias that only jumps and without contact detection."""
    bare = without_learning(data)
    return native.image_from_json(json.dumps({**bare, "bias": {**bare["bias"], "forget_rate": 0.0}}))


def exact_model(data: Mapping[str, Any], recording: FitRecording, *, jumps: bool = True) -> Numbers:
    """Return G of a description from a run of the core, N·m [N, n]; NaN outside of the parts."""
    image, residual = _image(data), np.full(recording.target.shape, np.nan)
    for part in recording.parts:
        arrays = recording.arrays(part)
        outputs = native.Instance(image, kinematics_source=recording.kinematics).run(arrays)
        residual[part] = outputs["friction_torque"] - delayed_torque(data, arrays, outputs["joint_torque"])
        if not jumps:
            residual[part] -= outputs["bias_torque"]
    return residual


# --- the series -------------------------------------------------------------------------------------------------------


def make_series(data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, left: Numbers) -> Series:
    """Average the signals over the blocks of a grid; `left` is what a description leaves of the torque [B, n], N·m."""
    whole = [recordings[segment.recording] for segment in grid.segments]
    pieces = list(zip(grid.segments, whole, strict=True))
    threshold, arms = number_of(data, "velocity_threshold.joint"), moment_arms(data)
    velocity = grid.means([recording.model.joint_speed for recording in recordings])
    return Series(
        time=grid.means([recording.time for recording in recordings]),
        recording=np.concatenate([np.full(segment.count, segment.recording) for segment in grid.segments]),
        segment=np.concatenate([np.full(segment.count, k) for k, segment in enumerate(grid.segments)]),
        target=left,
        used=np.concatenate([segment.mean(recording.train[segment.part]) == 1.0 for segment, recording in pieces]),
        step=grid.step,
        angle=grid.means([recording.model.joint_angle for recording in recordings]),
        velocity=velocity,
        acceleration=np.concatenate([_slope(velocity[segment.blocks], grid.step) for segment in grid.segments]),
        force=grid.forces(recordings),
        tendon_velocity=_tendon_velocity(arms, velocity),
        travel=np.concatenate(
            [
                _travel(recording.model.joint_angle, recording.model.joint_speed, threshold, segment)
                for segment, recording in pieces
            ]
        ),
    )


def _slope(values: Numbers, step: float) -> Numbers:
    return np.gradient(values, step, axis=0) if len(values) > 1 else np.zeros_like(values)


def _tendon_velocity(arms: Numbers, velocity: Numbers) -> Numbers:
    """Return ẋ_ij = Σ_{j'≥j} r_ij' q̇_j' (eq. 5), m/s [B, m, n], for moment arms [m, n]."""
    products = velocity[:, None, :] * arms[None]
    return np.asarray(np.cumsum(products[:, :, ::-1], axis=2)[:, :, ::-1])


def _travel(angle: Numbers, speed: Numbers, threshold: float, segment: Segment) -> Numbers:
    """Return the travel since each joint last reversed, rad [count, n]; speeds below the threshold do not count."""
    angle, speed = angle[segment.part], speed[segment.part]
    travel = np.empty_like(angle)
    for j in range(angle.shape[1]):
        moving = np.abs(speed[:, j]) > threshold
        last = np.maximum.accumulate(np.where(moving, np.arange(len(angle)), 0))
        side = np.sign(speed[last, j])
        turned = np.flatnonzero(np.diff(side, prepend=side[0]))
        start = np.zeros(len(angle), dtype=np.int64)
        start[turned] = turned
        travel[:, j] = np.abs(angle[:, j] - angle[np.maximum.accumulate(start), j])
    return segment.mean(travel)
