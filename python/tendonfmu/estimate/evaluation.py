"""How well a fitted finger explains a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.model import without_friction
from tendonfmu.recordings import FitRecording, Model, rms


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
    """Compute the rms [n] by joint over the samples of a flag ("train" or "held_out"); None without any."""
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
