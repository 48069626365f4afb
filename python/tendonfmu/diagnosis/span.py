"""What range the recordings of a diagnosis cover; the grids of the candidates' non-linear numbers follow from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.model import moment_arms
from tendonfmu.recordings import FitRecording

_OUTER = 0.01  # share of samples outside of each end of a range, so that single outliers do not stretch it
_FAST = 0.95  # quantile that counts as fast
_LOOKED_AT = 50_000  # samples that are looked at, about


@dataclass(frozen=True)
class Span:
    """Ranges of the signals over all samples that are used."""

    angle: Numbers  # 1 % and 99 % quantiles, rad [n, 2]
    speed: Numbers  # 95 % quantile of |q̇|, rad/s [n]
    tendon_speed: Numbers  # 95 % quantile of |ẋ_ij|, m/s [m, n]
    position: Numbers  # 1 % and 99 % quantiles of the joint-side tendon position x1 = R q, m [m, 2]
    force: Numbers  # 1 % and 99 % quantiles, N [m, 2]
    torque: Numbers  # standard deviation of the torque to be explained, N·m [n]
    duration: float  # length of the longest part without a gap, s
    step: float  # median time between samples, s


def span_of(data: Mapping[str, Any], recordings: Sequence[FitRecording]) -> Span:
    """Measure the span of recordings that were prepared for a valid description."""
    arms = moment_arms(data)
    every = max(1, sum(len(recording.time) for recording in recordings) // _LOOKED_AT)
    rows = [np.flatnonzero(recording.train)[::every] for recording in recordings]
    angle, speed, force, torque = (
        np.concatenate(signals)
        for signals in zip(
            *(_signals(recording, row) for recording, row in zip(recordings, rows, strict=True)), strict=True
        )
    )
    sliding = np.cumsum((speed[:, None, :] * arms)[:, :, ::-1], axis=2)[:, :, ::-1]
    steps = np.concatenate([np.diff(recording.time[part]) for recording in recordings for part in recording.parts])
    return Span(
        angle=_range(angle),
        speed=np.quantile(np.abs(speed), _FAST, axis=0),
        tendon_speed=np.quantile(np.abs(sliding), _FAST, axis=0),
        position=_range(angle @ arms.T),
        force=_range(force),
        torque=np.std(torque, axis=0),
        duration=max(
            float(recording.time[part][-1] - recording.time[part][0])
            for recording in recordings
            for part in recording.parts
        ),
        step=float(np.median(steps)),
    )


def _signals(recording: FitRecording, rows: NDArray[np.intp]) -> tuple[Numbers, ...]:
    model, force = recording.model, recording.recording.groups["tendon_force"]
    return tuple(values[rows] for values in (model.joint_angle, model.joint_speed, force, recording.target))


def _range(values: Numbers) -> Numbers:
    """Return 1 % and 99 % quantiles [k, 2] of values [N, k]."""
    return np.asarray(np.quantile(values, [_OUTER, 1 - _OUTER], axis=0).T)
