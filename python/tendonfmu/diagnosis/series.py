"""How recordings and models look to a diagnosis: averaged over short blocks of time.

The estimator's model of a joint is y_k = T_k + b_k + e_k with b_k = b_{k−1} + Δb_k + w_k (runtime/include/
tendonfmu_estimation.h). With G_k = T_k + Σ Δb up to k, y − G is a slow bias plus noise. A diagnosis looks only at G and
at its derivatives by the numbers of the description.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.model import moment_arms, native, number_of, without_learning
from tendonfmu.recordings import FitRecording, Grid, Segment, delayed_torque
from tendonfmu.statistics import BlockSeries, SampleBlocks

_STRETCH = 4000  # samples of a run at a time, so that its outputs stay in the processor's cache


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
    return native.image_from_json(json.dumps(without_learning(data, "forget_rate", "entry_load")))


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


def block_prediction(data: Mapping[str, Any], recordings: Sequence[FitRecording], blocks: SampleBlocks) -> Numbers:
    """Return block means of G of a description, less the torque of forces used beyond the measured ones, N·m [B, n]."""
    sums = np.zeros((blocks.count, len(data["joints"])))
    finger, arms = native.Instance(_image(data)), moment_arms(data)
    for recording, block in zip(recordings, blocks.of, strict=True):
        for part in recording.parts:
            if (block[part] < 0).all():
                continue
            finger.reset()
            finger.set_kinematics_source(recording.kinematics)
            for begin in range(part.start, part.stop, _STRETCH):
                rows = slice(begin, min(begin + _STRETCH, part.stop))
                arrays = recording.arrays(rows)
                # τ − T_eff; T_eff is T with all jumps so far if the bias learns nothing
                whole = arrays["tendon_force"] @ arms - finger.run(arrays)["compensated_torque"]
                _add_up(sums, block[rows], whole)
    return np.asarray(sums / np.maximum(blocks.sizes(), 1)[:, None])


def _add_up(sums: Numbers, block: NDArray[np.int64], values: Numbers) -> None:
    inside = block >= 0
    if inside.any():
        first, own = int(block[inside][0]), block[inside]
        for j in range(sums.shape[1]):
            totals = np.bincount(own - first, weights=values[inside, j])
            sums[first : first + len(totals), j] += totals


def block_late_forces(
    data: Mapping[str, Any],
    recordings: Sequence[FitRecording],
    blocks: SampleBlocks,
    delay: float,
    prediction: Numbers,
) -> Numbers:
    """Return the change of y − G [B, n] (N·m) if forces are measured `delay` s later than they act."""
    late = [_with_late_forces(recording, delay) for recording in recordings]
    moved = _block_torque(data, late, blocks) - _block_torque(data, recordings, blocks)
    return np.asarray(moved - (block_prediction(data, late, blocks) - prediction))


def _with_late_forces(recording: FitRecording, delay: float) -> FitRecording:
    groups = dict(recording.recording.groups)
    force = groups["tendon_force"].copy()
    for part in recording.parts:
        time = recording.time[part]
        for i in range(force.shape[1]):
            force[part, i] = np.interp(time - delay, time, groups["tendon_force"][part, i])
    groups["tendon_force"] = force
    return replace(recording, recording=replace(recording.recording, groups=groups))


def _block_torque(data: Mapping[str, Any], recordings: Sequence[FitRecording], blocks: SampleBlocks) -> Numbers:
    """Return block means of τ = Rᵀ f [B, n], N·m."""
    arms = moment_arms(data)
    sums = np.zeros((blocks.count, arms.shape[1]))
    for recording, block in zip(recordings, blocks.of, strict=True):
        _add_up(sums, block, recording.recording.groups["tendon_force"] @ arms)
    return np.asarray(sums / np.maximum(blocks.sizes(), 1)[:, None])


# --- the series -------------------------------------------------------------------------------------------------------


def make_series(data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, torque: Numbers) -> Series:
    """Average the signals over the blocks of a grid."""
    whole = [recordings[segment.recording] for segment in grid.segments]
    pieces = list(zip(grid.segments, whole, strict=True))
    threshold, arms = number_of(data, "velocity_threshold.joint"), moment_arms(data)
    velocity = grid.means([recording.model.joint_speed for recording in recordings])
    return Series(
        time=grid.means([recording.time for recording in recordings]),
        recording=np.concatenate([np.full(segment.count, segment.recording) for segment in grid.segments]),
        segment=np.concatenate([np.full(segment.count, k) for k, segment in enumerate(grid.segments)]),
        target=grid.means([recording.target for recording in recordings]) - torque,
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
