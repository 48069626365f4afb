"""How well a fitted finger explains a recording, compared with the bias alone and the model alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.recordings import FitRecording, Model, Residuals, bias_settings, model_alone, rms, track


@dataclass(frozen=True)
class Evaluation:
    """A recording under the fitted finger."""

    recording: FitRecording  # prepared recording
    model: Model  # T of the fitted finger
    fit: Residuals  # residuals with the fitted numbers and with those of the start
    start: Residuals
    bias_only: Residuals  # residuals with the same bias filter and no friction at all
    model_only: Numbers  # [N, n] y − T less a constant per part (N·m)


def model_over(data: Mapping[str, Any], recording: FitRecording) -> Model:
    """Compute T of a description over the parts of a recording."""
    arrays = [recording.arrays(part) for part in recording.parts]
    return model_alone(data, arrays, recording.parts, len(recording.time), recording.kinematics)


def residuals(data: Mapping[str, Any], recording: FitRecording, model: Model | None) -> Residuals:
    """Compute the residuals of a recording with the bias filter of a description."""
    mean_force = np.abs(recording.recording.groups["tendon_force"]).mean(axis=1)
    remainder = recording.target if model is None else recording.target - model.torque
    jump = None if model is None else model.jump
    settings = bias_settings(data)
    return track(settings, recording.time, mean_force, remainder, jump, recording.tracked, recording.parts)


def evaluate(start: Mapping[str, Any], fitted: Mapping[str, Any], recording: FitRecording) -> Evaluation:
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


def residual_entry(found: Sequence[Evaluation], which: str) -> dict[str, list[float]] | None:
    """Compute the rms [n] by joint over the samples of a flag ("train", "held_out" or "tracked"); None without any."""
    chosen = [np.asarray(getattr(each.recording, which)) for each in found]
    if not any(flags.any() for flags in chosen):
        return None
    flags = np.concatenate(chosen) & ~np.isnan(np.concatenate([each.fit.residual for each in found])).any(axis=1)
    series = {
        "rms": [each.fit.residual for each in found],
        "start_rms": [each.start.residual for each in found],
        "bias_only_rms": [each.bias_only.residual for each in found],
        "model_only_rms": [each.model_only for each in found],
        "torque_rms": [each.recording.target for each in found],
    }
    return {name: rms(np.concatenate(values), flags) for name, values in series.items()}
