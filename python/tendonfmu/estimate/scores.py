"""How far the residuals of a fit are from the white noise that its covariance assumes.

The covariance of a fit counts each sample as new information. A model error lasts for many samples, so the sum of the
likelihood's gradient over a block of time (its score) varies more than the information predicts. The scores of blocks
longer than the correlation of the residuals give the true covariance of the estimates, C (Σ s sᵀ) C, whatever the size
and the correlation of the residuals ("sandwich" with clusters in time: Liang and Zeger 1986, eq. 7).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.evaluation import Evaluation
from tendonfmu.recordings import BiasSettings, bias_settings, track

BLOCKS = 80  # approximate number: few enough to be long, many enough for a sum of squares
SHORTEST = 2.0  # s; several times the memory of the bias filter
FEWEST = 10  # blocks, which are shorter than SHORTEST if necessary
_SAMPLES, _SIZE = 8000, 15_000_000  # most samples in all; most samples times joints times unknowns
_LEAST = 8  # samples in a block


@dataclass(frozen=True)
class Scores:
    """Scores of blocks of time."""

    scores: Numbers
    block_time: float


def block_scores(
    estimator: Estimator,
    z: Numbers,
    data: Mapping[str, Any],
    training: Sequence[Evaluation],
    weights: Sequence[Numbers],
) -> Scores:
    """Compute the scores at the estimate z [u] of a fitted description, over the samples trained on."""
    seconds = sum(found.recording.duration for found in training)
    samples = sum(len(found.recording.time) for found in training)
    size = len(data["joints"]) * len(z)
    every = max(1, math.ceil(samples / min(_SAMPLES, max(_SIZE // size, _SAMPLES // 8))))
    length = min(max(seconds / BLOCKS, SHORTEST), seconds / FEWEST)
    settings = _settings(data, every)
    found = [
        _score(estimator, z, settings, evaluation, rows, own)
        for evaluation, own in zip(training, weights, strict=True)
        for rows in _blocks(evaluation, length, every)
    ]
    scores = np.array(found).reshape(len(found), len(z))
    return Scores(scores - scores.mean(axis=0) if len(found) else scores, length)


def _settings(data: Mapping[str, Any], every: int) -> BiasSettings:
    """Return the bias settings for every k-th sample: noise per sample is averaged, noise per time needs no change."""
    settings = replace(bias_settings(data), initial_torque=None)
    if settings.noise_time is not None:
        return settings
    root = math.sqrt(every)
    return replace(settings, noise=settings.noise / root, per_force=settings.per_force / root)


def _blocks(found: Evaluation, length: float, every: int) -> Iterator[NDArray[np.intp]]:
    """Yield the rows of each block that has enough samples to learn from."""
    recording = found.recording
    for part in recording.parts:
        rows = np.arange(part.start, part.stop, every)
        number = np.floor((recording.time[rows] - recording.time[part.start]) / length)
        for block in np.split(rows, np.flatnonzero(np.diff(number)) + 1):
            if recording.train[block].sum() >= _LEAST:
                yield block


def _score(
    estimator: Estimator,
    z: Numbers,
    settings: BiasSettings,
    found: Evaluation,
    rows: NDArray[np.intp],
    weights: Numbers,
) -> Numbers:
    """Compute [u] the score of one block. The bias filter is linear, so it takes y − T and its derivatives alike."""
    recording = found.recording
    time, learns = recording.time[rows], recording.train[rows]
    number = estimator.add_recording(sampled(found, rows, time), kinematics_source=3)
    torque, jump, by_torque, by_jump = estimator.jacobian(number, z, 0, len(rows))
    joints = torque.shape[1]
    remainder = np.hstack([recording.target[rows] - torque, -by_torque.reshape(len(rows), -1)])
    jumps = np.hstack([jump, by_jump.reshape(len(rows), -1)])
    mean_force = np.abs(recording.recording.groups["tendon_force"][rows]).mean(axis=1)
    left = track(settings, time, mean_force, remainder, jumps, learns, [slice(0, len(rows))])
    chosen = learns & ~np.isnan(left.residual).any(axis=1)
    residual = left.residual[chosen, :joints] / left.variance[chosen, None] * weights[rows][chosen]
    slopes = left.residual[chosen, joints:].reshape(-1, joints, len(z))
    return np.asarray(np.tensordot(residual, slopes, axes=((0, 1), (0, 1))))


def sampled(found: Evaluation, rows: NDArray[np.intp], time: Numbers) -> dict[str, Numbers]:
    """Return rows of a recording as a recording with measured angles and speeds; T needs no samples in between."""
    return {
        "time": np.ascontiguousarray(time),
        "tendon_force": np.ascontiguousarray(found.recording.recording.groups["tendon_force"][rows]),
        "joint_position": np.ascontiguousarray(found.model.joint_angle[rows]),
        "joint_velocity": np.ascontiguousarray(found.model.joint_speed[rows]),
    }
