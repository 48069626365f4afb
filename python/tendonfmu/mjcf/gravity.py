"""The weight of a finger's links as rows `gravity` of a description, fitted to what MuJoCo computes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.mjcf.compiled_model import CompiledModel, Joint

NONE = 1e-9  # N·m


def holding_torques(model: CompiledModel, joints: Sequence[Joint], angles: Numbers) -> Numbers:
    """Return the torques that hold the links' weight."""
    # angles: [K, n] (rad); returns [K, n] (N·m)
    rows = []
    for each in angles:
        model.place(joints, each)
        rows.append(model.holding_torque(joints))
    return np.array(rows)


def gravity_rows(angles: Numbers, torques: Numbers, axes: Numbers | None) -> tuple[list[dict[str, Any]], float]:
    """Fit rows `gravity` to torques."""
    # angles: [K, n] (rad); torques: [K, n] (N·m); axes: [n, 3]; returns largest torque that the rows miss (N·m)
    n = angles.shape[1]
    columns = []
    for last in range(n):
        weight = np.array([1.0 if axes is None else float(axes[k] @ axes[last]) for k in range(last + 1)])
        theta = angles[:, : last + 1] @ weight
        for shape in (np.sin(theta), np.cos(theta)):
            column = np.zeros_like(torques)
            column[:, : last + 1] = shape[:, None] * weight
            columns.append(column.ravel())
    matrix = np.array(columns).T
    numbers = np.linalg.lstsq(matrix, torques.ravel(), rcond=None)[0]
    missed = float(np.abs(torques.ravel() - matrix @ numbers).max())
    rows = []
    for j, pair in enumerate(numbers.reshape(n, 2)):
        felt = {name: round(float(x), 12) for name, x in zip(("sine", "cosine"), pair, strict=True) if abs(x) > NONE}
        if felt:
            rows.append({"effect": "gravity", "joint": j + 1, **felt})
    return rows, missed
