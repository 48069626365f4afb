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
_DEAD = 0.02  # of the range: smaller turns are noise, not reversals


@dataclass(frozen=True)
class Span:
    """Ranges of the signals over all samples that are used."""

    angle: Numbers  # 1 % and 99 % quantiles, rad [n, 2]
    speed: Numbers  # 95 % quantile of |q̇|, rad/s [n]
    tendon_speed: Numbers  # 95 % quantile of |ẋ_ij|, m/s [m, n]
    position: Numbers  # 1 % and 99 % quantiles of the joint-side tendon position x1 = R q, m [m, 2]
    travel: Numbers  # median distance of a joint between reversals, rad [n]
    tendon_travel: Numbers  # median distance of a tendon between reversals, m [m]
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
    angles = [recording.model.joint_angle[part] for recording in recordings for part in recording.parts]
    return Span(
        angle=_range(angle),
        speed=np.quantile(np.abs(speed), _FAST, axis=0),
        tendon_speed=np.quantile(np.abs(sliding), _FAST, axis=0),
        position=_range(angle @ arms.T),
        travel=_travels(angles),
        tendon_travel=_travels([angle @ arms.T for angle in angles]),
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


def _travels(paths: Sequence[Numbers]) -> Numbers:
    """Return the median distance between reversals [k] of paths [N, k]; the range of the path if it has no reversal."""
    count = paths[0].shape[1]
    travels = np.zeros(count)
    for k in range(count):
        values = [path[:, k] for path in paths]
        whole = float(np.ptp(np.concatenate(values)))
        turns = [np.abs(np.diff(_turning_points(value, _DEAD * whole))) for value in values]
        distances = np.concatenate(turns)
        travels[k] = float(np.median(distances)) if len(distances) else whole
    return travels


def _turning_points(path: Numbers, dead: float) -> Numbers:
    """Return the positions at the start, at the end and at reversals of more than `dead`."""
    if dead <= 0:
        return path[:1]
    thinned = path[:: max(1, len(path) // 20_000)]
    # Within a stretch that only rises or only falls, its end alone counts.
    rising = np.diff(thinned) > 0
    thinned = thinned[np.r_[True, rising[1:] != rising[:-1], True]] if len(thinned) > 2 else thinned
    points, extreme, direction = [float(thinned[0])], float(thinned[0]), 0
    for value in thinned.tolist():
        if (direction >= 0 and value > extreme) or (direction <= 0 and value < extreme):
            if direction == 0 and abs(value - points[0]) > dead:
                direction = 1 if value > points[0] else -1
            if direction:
                extreme = value
        elif direction and abs(value - extreme) > dead:
            points.append(extreme)
            extreme, direction = value, -direction
    return np.array([*points, extreme])
