"""Where the points of a finger's routing drawing are while its joints turn.

A positive angle turns the links behind the joint upwards, to the side of the tendons with positive moment arms. The
finger bends evenly around a joint, so that no tendon breaks there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tendonfmu.model.routing_geometry import FLAT_BEFORE, FingerDrawing

_STEP = 0.05  # of the middle line, along which its direction is summed up


class BentDrawing:
    """A drawing at joint angles [f, n] (rad)."""

    def __init__(self, drawing: FingerDrawing, angles: NDArray[np.float64]) -> None:
        hinges = np.array([joint.x for joint in drawing.joints])
        self._x = np.arange(drawing.left, drawing.right + _STEP, _STEP)
        turned = np.clip((self._x[:, None] - hinges) / (2.0 * FLAT_BEFORE) + 0.5, 0.0, 1.0)  # [g, n] share of the angle
        self._direction = angles @ turned.T  # [f, g]
        middle = 0.5 * (self._direction[:, 1:] + self._direction[:, :-1])
        steps = _STEP * np.stack([np.cos(middle), np.sin(middle)], axis=-1)
        start = np.broadcast_to([drawing.left, 0.0], (len(angles), 1, 2))
        self._middle_line = np.cumsum(np.concatenate([start, steps], axis=1), axis=1)  # [f, g, 2]

    def at(self, points: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return where points [k, 2] of the straight finger are, [f, k, 2]."""
        place = np.clip((points[:, 0] - self._x[0]) / _STEP, 0.0, len(self._x) - 1.001)
        low, part = place.astype(int), place % 1.0
        direction = (1.0 - part) * self._direction[:, low] + part * self._direction[:, low + 1]
        part = part[:, None]
        foot = (1.0 - part) * self._middle_line[:, low] + part * self._middle_line[:, low + 1]
        beside = np.stack([-np.sin(direction), np.cos(direction)], axis=-1) * points[:, 1:]
        return np.asarray(foot + beside, dtype=np.float32)
