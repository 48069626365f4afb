"""How recordings and models look to a diagnosis: averaged over short blocks of time.

The estimator's model of a joint is y_k = T_k + b_k + e_k with b_k = b_{k−1} + Δb_k + w_k (runtime/include/
tendonfmu_estimation.h). With G_k = T_k + Σ Δb up to k, y − G is a slow bias plus noise. A diagnosis looks only at G and
at its derivatives by the numbers of the description.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Array, Numbers
from tendonfmu.model import moment_arms, native, number_of
from tendonfmu.recordings import FitRecording, delayed_torque
from tendonfmu.statistics import BlockSeries

SHORTEST_STEP = 0.01  # s; shortest block
MOST_BLOCKS = 20_000
_NEVER = 1e9  # N·m; a contact threshold that is never passed


@dataclass(frozen=True)
class Segment:
    """A stretch of a recording without a gap, cut into blocks with equally many samples."""

    recording: int  # its number, from 0
    part: slice  # its samples there
    first: int  # first block in the whole series, and number of blocks
    count: int
    samples: int  # samples of a block

    @property
    def blocks(self) -> slice:
        return slice(self.first, self.first + self.count)

    def mean(self, values: Array) -> Array:
        """Return block means [count, ...] of values [samples of the part, or as many as the blocks have, ...]."""
        whole = values[: self.count * self.samples]
        return np.asarray(whole.reshape(self.count, self.samples, *whole.shape[1:]).mean(axis=1))


@dataclass(frozen=True)
class Grid:
    """All segments, one after another; they are the estimator's recordings. `step` is the length of a block, s."""

    segments: tuple[Segment, ...]
    step: float

    @property
    def blocks(self) -> int:
        return sum(segment.count for segment in self.segments)


@dataclass(frozen=True)
class Series(BlockSeries):
    """Block means of all recordings, one after another; n joints, m tendons."""

    angle: Numbers  # rad [B, n]
    velocity: Numbers  # rad/s [B, n]
    acceleration: Numbers  # rad/s² [B, n]
    force: Numbers  # N [B, m]
    tendon_velocity: Numbers  # ẋ_ij, m/s [B, m, n]
    travel: Numbers  # travel since the joint last reversed, rad [B, n]


def make_grid(recordings: Sequence[FitRecording]) -> Grid:
    """Cut recordings into blocks of about 10 ms."""
    duration = sum(recording.duration for recording in recordings)
    step = max(SHORTEST_STEP, duration / MOST_BLOCKS)
    segments, first = [], 0
    for number, recording in enumerate(recordings):
        samples = max(1, round(step / float(np.median(np.diff(recording.time)))))
        for part in recording.parts:
            count = (part.stop - part.start) // samples
            if count and recording.train[part].any():
                segments.append(Segment(number, part, first, count, samples))
                first += count
    return Grid(tuple(segments), step)


def exact_model(
    data: Mapping[str, Any], recording: FitRecording, *, entry_load: bool | None = None, jumps: bool = True
) -> Numbers:
    """Return G of a description from a run of the core, N·m [N, n]; NaN outside of the parts."""
    given = data.get("bias") or {}
    joints = len(data["joints"])
    kept = {key: given[key] for key in ("forget_rate", "entry_load") if given.get(key) is not None}
    still = {**kept, "drift_variance": 0.0, "initial_variance": 0.0, "initial_torque": [0.0] * joints}
    if entry_load is not None:
        still["entry_load"] = entry_load
    alone = {**data, "bias": still, "contact": {"threshold": [_NEVER] * joints}, "sensor_fault": None}
    image, residual = native.image_from_json(json.dumps(alone)), np.full(recording.target.shape, np.nan)
    for part in recording.parts:
        arrays = recording.arrays(part)
        outputs = native.Instance(image, kinematics_source=recording.kinematics).run(arrays)
        residual[part] = outputs["friction_torque"] - delayed_torque(data, arrays, outputs["joint_torque"])
        if not jumps:
            residual[part] -= outputs["bias_torque"]
    return residual


def block_prediction(data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid) -> Numbers:
    """Return block means of `exact_model`, N·m [B, n]."""
    whole = {segment.recording: exact_model(data, recordings[segment.recording]) for segment in grid.segments}
    return np.concatenate([segment.mean(whole[segment.recording][segment.part]) for segment in grid.segments])


# --- the series -------------------------------------------------------------------------------------------------------


def make_series(data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, torque: Numbers) -> Series:
    """Average the signals over the blocks of a grid."""
    whole = [recordings[segment.recording] for segment in grid.segments]
    pieces = list(zip(grid.segments, whole, strict=True))
    threshold = _joint_threshold(data)

    def gathered(values: Sequence[Array]) -> Array:
        means = [segment.mean(value[segment.part]) for segment, value in zip(grid.segments, values, strict=True)]
        return np.concatenate(means)

    angle = gathered([recording.model.joint_angle for recording in whole])
    velocity = gathered([recording.model.joint_speed for recording in whole])
    arms = moment_arms(data)
    return Series(
        time=gathered([recording.time for recording in whole]),
        recording=np.concatenate([np.full(segment.count, segment.recording) for segment in grid.segments]),
        segment=np.concatenate([np.full(segment.count, k) for k, segment in enumerate(grid.segments)]),
        target=gathered([recording.target for recording in whole]) - torque,
        used=np.concatenate([segment.mean(recording.train[segment.part]) == 1.0 for segment, recording in pieces]),
        step=grid.step,
        angle=angle,
        velocity=velocity,
        acceleration=np.concatenate([_slope(velocity[segment.blocks], grid.step) for segment in grid.segments]),
        force=gathered([recording.recording.groups["tendon_force"] for recording in whole]),
        tendon_velocity=_tendon_velocity(arms, velocity),
        travel=np.concatenate(
            [
                _travel(recording.model.joint_angle, recording.model.joint_speed, threshold, segment)
                for segment, recording in pieces
            ]
        ),
    )


def _joint_threshold(data: Mapping[str, Any]) -> float:
    return number_of(data, "velocity_threshold.joint")


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
