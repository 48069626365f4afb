"""Which tendon forces a column may use: forces without the noise that they share with the target.

The joint torque to be explained is computed from the measured forces, and so is every column that contains a force. So
the part of the torque that no model explains is in both. A column that carries it would fit the noise and appear as a
cause of every recording. Columns are therefore computed at the forces that the model itself predicts. These are the
measured forces less the unexplained torque, which is spread over the tendons as the smallest forces that produce it
(errors in variables; instrument).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.series import Grid, Series, exact_model
from tendonfmu.model import moment_arms
from tendonfmu.recordings import FitRecording

MOST_SHIFT = 10.0  # times the largest measured force


def predicted_forces(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, series: Series, residual: Numbers
) -> list[FitRecording]:
    """Return the recordings with predicted forces, and with tendon positions that keep the joint angles as measured."""
    arms = moment_arms(data)
    spread = np.linalg.pinv(arms)
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]])
    pulls = np.array([not tendon.get("bidirectional") for tendon in data["tendons"]])
    moved = []
    for number, recording in enumerate(recordings):
        groups = dict(recording.recording.groups)
        force = groups["tendon_force"]
        most = MOST_SHIFT * np.abs(force).max(initial=0.0)  # a model that explains nothing predicts no forces either
        shift = np.clip(_unexplained(data, recording, number, grid, series, residual) @ spread, -most, most)
        predicted = np.where(pulls & (force > 0), np.maximum(force - shift, 0.0), force - shift)
        groups["tendon_force"] = predicted
        if "tendon_position" in groups:
            # a description with a delay pairs the present position with the force `delay` s later
            change = _shifted(recording, (predicted - force) / stiffness, _delay(data))
            groups["tendon_position"] = groups["tendon_position"] + change
        moved.append(replace(recording, recording=replace(recording.recording, groups=groups)))
    return moved


def _delay(data: Mapping[str, Any]) -> float:
    """Return by how many seconds forces come later than positions, according to the description."""
    rows = data.get("extensions") or []
    return float(sum(row["delay"] for row in rows if row["effect"] == "time_delay"))


def _shifted(recording: FitRecording, values: Numbers, delay: float) -> Numbers:
    """Return the values [N, m] of `delay` s later, within each part."""
    if not delay:
        return values
    shifted: Numbers = values.copy()
    for part in recording.parts:
        time = recording.time[part]
        for i in range(values.shape[1]):
            shifted[part, i] = np.interp(time + delay, time, values[part, i])
    return shifted


def _unexplained(
    data: Mapping[str, Any], recording: FitRecording, number: int, grid: Grid, series: Series, residual: Numbers
) -> Numbers:
    """Return the unexplained torque at every sample [N, n], N·m; 0 at samples that are not trained on."""
    model = exact_model(data, recording)
    unexplained = np.zeros_like(recording.target)
    for segment in grid.segments:
        if segment.recording != number:
            continue
        part, blocks = segment.part, segment.blocks
        left = recording.target[part] - model[part]
        slow = series.target[blocks] - residual[blocks]
        time = recording.time[part]
        for j in range(left.shape[1]):
            unexplained[part, j] = left[:, j] - np.interp(time, series.time[blocks], slow[:, j])
    return np.where(recording.train[:, None], unexplained, 0.0)
