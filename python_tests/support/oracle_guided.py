"""The oracle's run in which the caller says what the bias learns from: docs/reference/semantics/bias.md#guided-runs.

Part of the oracle (see oracle.py): naive, for tests alone, sharing no code with the runtime.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle import INPUTS, FingerOracle

Array = NDArray[Any]


class GuidedOracle(FingerOracle):
    """Of a description whose contact thresholds are out of reach."""

    def guide(self, begins: bool, learns: bool, known_torque: Array) -> None:
        """Say what the next sample is good for. begins: there was none to learn from yet."""
        self.begins, self.learns, self.known_torque = begins, learns, known_torque
        self.S = np.full(self.n, np.nan)

    def _gain(self, dt: float, noise: float, time: float, contact: bool) -> Array:
        if self.begins:
            self.P = np.full(self.n, noise if self.initial_variance is None else float(self.initial_variance))
            return np.zeros(self.n)
        scale = 1.0 if self.noise_time is None else float(self.noise_time) / dt
        predicted = self.P + self.drift_variance * dt
        self.S = predicted + noise * scale
        if self.learns:
            self.detector.unknown = np.zeros(self.n)
            return super()._gain(dt, noise, time, contact)
        self.P = predicted
        return np.zeros(self.n)


def run_guided(
    description: Mapping[str, Any], recording: Mapping[str, Array], source: int, learns: Array, known_torque: Array
) -> dict[str, Array]:
    """Runs a finger without contact detection; learns [N], known_torque [N, n] (N·m). With S as residual_variance."""
    finger = GuidedOracle(description, source)
    present = [name for name in INPUTS if recording.get(name) is not None]
    rows = []
    for k, time in enumerate(np.asarray(recording["time"], dtype=float)):
        begins = k > 0 and finger.initial_torque is None and not learns[:k].any()
        finger.guide(begins, bool(learns[k]), known_torque[k])
        values = finger.step(float(time), {name: recording[name][k] for name in present}).values
        rows.append(values | {"residual_variance": finger.S})
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}
