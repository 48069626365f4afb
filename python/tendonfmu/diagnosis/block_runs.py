"""What the core predicts over whole recordings: block means of G of a description."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.model import moment_arms, native
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import SampleBlocks

_NEVER = 1e9  # N·m; a contact threshold that is never passed
_STRETCH = 4000  # samples of a run at a time, so that its outputs stay in the processor's cache


def block_prediction(data: Mapping[str, Any], recordings: Sequence[FitRecording], blocks: SampleBlocks) -> Numbers:
    """Return block means of G of a description, less the torque of forces used beyond the measured ones, N·m [B, n]."""
    sums = np.zeros((blocks.count, len(data["joints"])))
    finger, arms = native.Instance(native.image_from_json(json.dumps(_learning_nothing(data)))), moment_arms(data)
    for recording, block in zip(recordings, blocks.of, strict=True):
        for part in recording.parts:
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


def _learning_nothing(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the description with a bias that only jumps and with contact detection out of reach."""
    kept = {key: value for key, value in (data.get("bias") or {}).items() if key in ("forget_rate", "entry_load")}
    joints = len(data["joints"])
    still = {**kept, "drift_variance": 0.0, "initial_variance": 0.0, "initial_torque": [0.0] * joints}
    return {**data, "bias": still, "contact": {"threshold": [_NEVER] * joints}, "sensor_fault": None}


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
