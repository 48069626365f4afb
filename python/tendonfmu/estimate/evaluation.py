"""How well a fitted finger explains a recording, and how far its residuals are from the white noise that a fit assumes.

The covariance of a fit counts each sample as new information. A model error lasts for many samples, so the sum of the
likelihood's gradient over a block of time (its score) varies more than the information predicts. The scores of blocks
longer than the correlation of the residuals give the true covariance of the estimates, C (Σ s sᵀ) C, whatever the size
and the correlation of the residuals ("sandwich" with clusters in time: Liang and Zeger 1986, eq. 7).
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Data, Numbers
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.structure import Structure
from tendonfmu.model import native, number_of, without_friction
from tendonfmu.recordings import FitRecording, Model, rms

BLOCKS = 80  # approximate number: few enough to be long, many enough for a sum of squares
SHORTEST = 2.0  # s; several times the memory of the bias filter
FEWEST = 10  # blocks, which are shorter than SHORTEST if necessary
_SAMPLES, _SIZE = 8000, 15_000_000  # most samples in all; most samples times joints times unknowns
_LEAST = 8  # samples in a block


@dataclass(frozen=True)
class Evaluation:
    """A recording under the fitted finger."""

    recording: FitRecording  # prepared recording
    model: Model  # of the fitted finger, and of that of the start
    start: Model
    bias_only: Model  # with the same bias filter and no friction at all
    model_only: Numbers  # [N, n] y − T less a constant per part (N·m)


def evaluate(start: Data, fitted: Data, recording: FitRecording) -> Evaluation:
    """Judge a fitted finger on a recording."""
    model = recording.run(fitted)
    rest = recording.target - model.torque
    for part in recording.parts:
        chosen = recording.train[part] if recording.train[part].any() else recording.tracked[part]
        if chosen.any():
            rest[part] -= rest[part][chosen].mean(axis=0)
    return Evaluation(
        recording=recording,
        model=model,
        start=recording.run(start),
        bias_only=recording.run(without_friction(fitted)),
        model_only=rest,
    )


def residual_entry(evaluations: Sequence[Evaluation], which: str) -> dict[str, list[float]] | None:
    """Compute the rms [n] by joint over the samples of a flag ("train", "held_out" or "tracked"); None without any."""
    chosen = [np.asarray(getattr(evaluation.recording, which)) for evaluation in evaluations]
    if not any(flags.any() for flags in chosen):
        return None
    flags = np.concatenate(chosen) & ~np.isnan(
        np.concatenate([evaluation.model.residual for evaluation in evaluations])
    ).any(axis=1)
    series = {
        "rms": [evaluation.model.residual for evaluation in evaluations],
        "start_rms": [evaluation.start.residual for evaluation in evaluations],
        "bias_only_rms": [evaluation.bias_only.residual for evaluation in evaluations],
        "model_only_rms": [evaluation.model_only for evaluation in evaluations],
        "torque_rms": [evaluation.recording.target for evaluation in evaluations],
    }
    return {name: rms(np.concatenate(values), flags) for name, values in series.items()}


# --- scores of blocks of time -----------------------------------------------------------------------------------------


def block_scores(
    structure: Structure, z: Numbers, data: Data, training: Sequence[Evaluation], weights: Sequence[Numbers]
) -> tuple[Numbers, float]:
    """Compute the scores [blocks, u] at the estimate z [u], over the samples trained on, and the length of a block."""
    seconds = sum(evaluation.recording.duration for evaluation in training)
    samples = sum(len(evaluation.recording.time) for evaluation in training)
    size = len(data["joints"]) * len(z)
    every = max(1, math.ceil(samples / min(_SAMPLES, max(_SIZE // size, _SAMPLES // 8))))
    length = min(max(seconds / BLOCKS, SHORTEST), seconds / FEWEST)
    block_of = _Block(structure, every)
    blocks = [
        block_of.score(z, evaluation, rows, weight)
        for evaluation, weight in zip(training, weights, strict=True)
        for rows in _blocks(evaluation, length, every)
    ]
    scores = np.array(blocks).reshape(len(blocks), len(z))
    return scores - scores.mean(axis=0) if len(blocks) else scores, length


class _Block:
    """The estimation over one block of every k-th sample, in which the bias starts anew."""

    def __init__(self, structure: Structure, every: int) -> None:
        start, initial = structure.start.data, "bias.initial_torque["
        bias = {**(start.get("bias") or {}), "initial_torque": None}
        if bias.get("noise_time") is None:  # noise per sample is averaged, noise per time needs no change
            for key in ("noise_std", "noise_std_per_force"):
                bias[key] = number_of(start, f"bias.{key}") / math.sqrt(every)
        self._image = native.image_from_json(json.dumps({**start, "bias": bias}))
        kept = [not path.startswith(initial) for path in structure.index]
        self._group, self._scale = structure.group[kept], structure.scale[kept]
        whole = Estimator(structure.start.image, structure.group, structure.scale)
        self._lasts = np.array([not unknown.path.startswith(initial) for unknown in whole.unknowns], dtype=bool)

    def score(self, z: Numbers, evaluation: Evaluation, rows: NDArray[np.intp], weights: Numbers) -> Numbers:
        """Compute [u] the gradient of the block's cost; 0 by `bias.initial_torque`."""
        recording, estimator = evaluation.recording, Estimator(self._image, self._group, self._scale)
        external = None if recording.external is None else recording.external[rows]
        given = sampled(evaluation, rows, recording.time[rows])
        estimator.add_recording(given, 3, external, recording.train[rows])
        estimator.set_weights(0, weights[rows[0]])
        gradient = np.zeros(len(z))
        gradient[self._lasts] = estimator.evaluate(z[self._lasts], threads=1)[1]
        return gradient


def _blocks(evaluation: Evaluation, length: float, every: int) -> Iterator[NDArray[np.intp]]:
    """Yield the rows of each block that has enough samples to learn from."""
    recording = evaluation.recording
    for part in recording.parts:
        rows = np.arange(part.start, part.stop, every)
        number = np.floor((recording.time[rows] - recording.time[part.start]) / length)
        for block in np.split(rows, np.flatnonzero(np.diff(number)) + 1):
            if recording.train[block].sum() >= _LEAST:
                yield block


def sampled(evaluation: Evaluation, rows: NDArray[np.intp], time: Numbers) -> dict[str, Numbers]:
    """Return rows of a recording as a recording with measured angles and speeds; T needs no samples in between."""
    return {
        "time": np.ascontiguousarray(time),
        "tendon_force": np.ascontiguousarray(evaluation.recording.recording.groups["tendon_force"][rows]),
        "joint_position": np.ascontiguousarray(evaluation.model.joint_angle[rows]),
        "joint_velocity": np.ascontiguousarray(evaluation.model.joint_speed[rows]),
    }
