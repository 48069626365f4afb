"""How well a fitted finger explains a recording, and how far its residuals are from the white noise that a fit assumes.

The covariance of a fit counts each sample as new information. A model error lasts for many samples, so the sum of the
likelihood's gradient over a block of time (its score) varies more than the information predicts. The scores of blocks
longer than the correlation of the residuals give the true covariance of the estimates, C (Σ s sᵀ) C, whatever the size
and the correlation of the residuals ("sandwich" with clusters in time: Liang and Zeger 1986, eq. 7).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Data, Numbers
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.recordings import BiasSettings, FitRecording, Model, Residuals, bias_settings, model_alone, rms, track

BLOCKS = 80  # approximate number: few enough to be long, many enough for a sum of squares
SHORTEST = 2.0  # s; several times the memory of the bias filter
FEWEST = 10  # blocks, which are shorter than SHORTEST if necessary
_SAMPLES, _SIZE = 8000, 15_000_000  # most samples in all; most samples times joints times unknowns
_LEAST = 8  # samples in a block


@dataclass(frozen=True)
class Evaluation:
    """A recording under the fitted finger."""

    recording: FitRecording  # prepared recording
    model: Model  # T of the fitted finger
    fit: Residuals  # residuals with the fitted numbers and with those of the start
    start: Residuals
    bias_only: Residuals  # residuals with the same bias filter and no friction at all
    model_only: Numbers  # [N, n] y − T less a constant per part (N·m)


def model_over(data: Data, recording: FitRecording) -> Model:
    """Compute T of a description over the parts of a recording."""
    arrays = [recording.arrays(part) for part in recording.parts]
    return model_alone(data, arrays, recording.parts, len(recording.time), recording.kinematics)


def residuals(data: Data, recording: FitRecording, model: Model | None) -> Residuals:
    """Compute the residuals of a recording with the bias filter of a description."""
    mean_force = np.abs(recording.recording.groups["tendon_force"]).mean(axis=1)
    remainder = recording.target if model is None else recording.target - model.torque
    jump = None if model is None else model.jump
    settings = bias_settings(data)
    return track(settings, recording.time, mean_force, remainder, jump, recording.tracked, recording.parts)


def evaluate(start: Data, fitted: Data, recording: FitRecording) -> Evaluation:
    """Judge a fitted finger on a recording."""
    model = model_over(fitted, recording)
    rest = recording.target - model.torque
    for part in recording.parts:
        chosen = recording.train[part] if recording.train[part].any() else recording.tracked[part]
        if chosen.any():
            rest[part] -= rest[part][chosen].mean(axis=0)
    return Evaluation(
        recording=recording,
        model=model,
        fit=residuals(fitted, recording, model),
        start=residuals(start, recording, recording.model),
        bias_only=residuals(fitted, recording, None),
        model_only=rest,
    )


def residual_entry(evaluations: Sequence[Evaluation], which: str) -> dict[str, list[float]] | None:
    """Compute the rms [n] by joint over the samples of a flag ("train", "held_out" or "tracked"); None without any."""
    chosen = [np.asarray(getattr(evaluation.recording, which)) for evaluation in evaluations]
    if not any(flags.any() for flags in chosen):
        return None
    flags = np.concatenate(chosen) & ~np.isnan(
        np.concatenate([evaluation.fit.residual for evaluation in evaluations])
    ).any(axis=1)
    series = {
        "rms": [evaluation.fit.residual for evaluation in evaluations],
        "start_rms": [evaluation.start.residual for evaluation in evaluations],
        "bias_only_rms": [evaluation.bias_only.residual for evaluation in evaluations],
        "model_only_rms": [evaluation.model_only for evaluation in evaluations],
        "torque_rms": [evaluation.recording.target for evaluation in evaluations],
    }
    return {name: rms(np.concatenate(values), flags) for name, values in series.items()}


# --- scores of blocks of time -----------------------------------------------------------------------------------------


def block_scores(
    estimator: Estimator, z: Numbers, data: Data, training: Sequence[Evaluation], weights: Sequence[Numbers]
) -> tuple[Numbers, float]:
    """Compute the scores [blocks, u] at the estimate z [u], over the samples trained on, and the length of a block."""
    seconds = sum(evaluation.recording.duration for evaluation in training)
    samples = sum(len(evaluation.recording.time) for evaluation in training)
    size = len(data["joints"]) * len(z)
    every = max(1, math.ceil(samples / min(_SAMPLES, max(_SIZE // size, _SAMPLES // 8))))
    length = min(max(seconds / BLOCKS, SHORTEST), seconds / FEWEST)
    settings = _settings(data, every)
    blocks = [
        _score(estimator, z, settings, evaluation, rows, weight)
        for evaluation, weight in zip(training, weights, strict=True)
        for rows in _blocks(evaluation, length, every)
    ]
    scores = np.array(blocks).reshape(len(blocks), len(z))
    return scores - scores.mean(axis=0) if len(blocks) else scores, length


def _settings(data: Data, every: int) -> BiasSettings:
    """Return the bias settings for every k-th sample: noise per sample is averaged, noise per time needs no change."""
    settings = replace(bias_settings(data), initial_torque=None)
    if settings.noise_time is not None:
        return settings
    root = math.sqrt(every)
    return replace(settings, noise=settings.noise / root, per_force=settings.per_force / root)


def _blocks(evaluation: Evaluation, length: float, every: int) -> Iterator[NDArray[np.intp]]:
    """Yield the rows of each block that has enough samples to learn from."""
    recording = evaluation.recording
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
    evaluation: Evaluation,
    rows: NDArray[np.intp],
    weights: Numbers,
) -> Numbers:
    """Compute [u] the score of one block. The bias filter is linear, so it takes y − T and its derivatives alike."""
    recording = evaluation.recording
    time, learns = recording.time[rows], recording.train[rows]
    number = estimator.add_recording(sampled(evaluation, rows, time), kinematics_source=3)
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


def sampled(evaluation: Evaluation, rows: NDArray[np.intp], time: Numbers) -> dict[str, Numbers]:
    """Return rows of a recording as a recording with measured angles and speeds; T needs no samples in between."""
    return {
        "time": np.ascontiguousarray(time),
        "tendon_force": np.ascontiguousarray(evaluation.recording.recording.groups["tendon_force"][rows]),
        "joint_position": np.ascontiguousarray(evaluation.model.joint_angle[rows]),
        "joint_velocity": np.ascontiguousarray(evaluation.model.joint_speed[rows]),
    }
