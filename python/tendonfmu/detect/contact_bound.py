"""The residual of a finger over a recording, and the bound that it exceeds in contact (semantics/detection.md)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Data, Numbers
from tendonfmu.model import Finger, native, number_of
from tendonfmu.recordings import Recording

_BLOCK = 8192  # samples at once: the parts of friction are m + 3 numbers for each joint


def residual_and_bound(finger: Finger, recording: Recording, kinematics: int) -> tuple[Numbers, Numbers]:
    """Run a finger, and return r and threshold + threshold_per_force·f̄ + c_H·H + c_J·J + L·u (both [N, n], N·m)."""
    instance = native.Instance(finger.image, kinematics)
    uncertain = finger.data["contact"].get("uncertainty") is not None
    residuals, bounds = [], []
    for begin in range(0, len(recording), _BLOCK):
        arrays = {name: values[begin : begin + _BLOCK] for name, values in recording.arrays().items()}
        outputs = instance.run(arrays, parts=uncertain)
        residuals.append(outputs["residual"])
        bounds.append(_bound(finger.data, arrays["tendon_force"], outputs))
    return np.concatenate(residuals), np.concatenate(bounds)


def _bound(data: Data, force: Numbers, outputs: Mapping[str, NDArray[Any]]) -> Numbers:
    """Return the bound of a block [N, n] (N·m), without what `bias.start_share` adds."""
    contact = data["contact"]
    mean_force = np.abs(force).mean(axis=1)
    bound = contact["threshold"] + mean_force[:, None] * np.asarray(contact.get("threshold_per_force") or 0.0)
    if contact.get("friction_bound") is not None:
        bound = bound + number_of(data, "contact.friction_bound.stuck_share") * outputs["stuck_friction"]
        bound = bound + number_of(data, "contact.friction_bound.jump_share") * outputs["friction_jump"]
    if contact.get("uncertainty") is not None:
        level = number_of(data, "contact.uncertainty_level")
        bound = bound + level * _uncertainty(contact["uncertainty"], outputs)
    return np.asarray(bound)


def _uncertainty(directions: list[Any], outputs: Mapping[str, NDArray[Any]]) -> Numbers:
    """Return u [N, n] (N·m): the root of the sum of squares over the directions of each joint."""
    parts = outputs["friction_parts"]  # [N, n, m + 3]
    width = parts.shape[2]
    errors = [parts[:, j] @ np.reshape(np.asarray(rows, float), (-1, width)).T for j, rows in enumerate(directions)]
    return np.column_stack([np.sqrt(np.sum(error**2, axis=1)) for error in errors])
