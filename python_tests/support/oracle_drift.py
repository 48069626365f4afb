"""The oracle's slow contact: contact.drift of docs/reference/semantics.md#contact-detector and #bias-tracker.

Part of the oracle (see oracle.py): naive, for tests alone, sharing no code with the runtime.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_finger import given

Array = NDArray[Any]


OF_LATE = 0.1  # of T_q


class DriftWatch:
    """o, p, s and c [n]. `begin` at the first sample, then `take` once a sample and `follow` with each update."""

    def __init__(self, drift: Mapping[str, Any], n: int, branches: Counter[str]) -> None:
        self.branches = branches
        self.quick_time, self.slow_time = (
            float(given(drift, "quick_time", 0.3)),
            float(given(drift, "slow_time", 10.0)),
        )
        self.threshold = np.array(drift["threshold"], dtype=float)
        self.per_force = np.array(given(drift, "threshold_per_force", [0.0] * n), dtype=float)
        self.late, self.quick, self.slow, self.learned, self.drift = (np.zeros(n) for _ in range(5))
        self.start = math.nan

    def _share(self, constant: float, time: float, dt: float) -> float:
        return 1.0 - math.exp(-dt / min(constant, time - self.start))

    def take(self, r: Array, time: float, dt: float) -> None:
        """Before contact is decided."""
        left = r + self.learned
        self.quick = self.quick + self._share(self.quick_time, time, dt) * (left - self.quick)
        self.late = self.late + self._share(self.quick_time * OF_LATE, time, dt) * (left - self.late)
        mean, now = self.quick - self.slow, self.late - self.slow
        self.drift = np.where(mean * now > 0.0, np.sign(mean) * np.minimum(np.abs(mean), np.abs(now)), 0.0)

    def follow(self, r: Array, K: Array, own: Array, contact: bool, time: float, dt: float) -> None:
        """K: the gain; own: that without V. What V has the bias learn is no drift."""
        of_start = (K - own) * r
        self.late = self.late - self._share(self.quick_time * OF_LATE, time, dt) * of_start
        self.quick = self.quick - self._share(self.quick_time, time, dt) * of_start
        if contact:
            self.slow = self.quick.copy()
            self.branches["drift_begins_anew"] += 1
        else:
            self.slow = self.slow + self._share(self.slow_time, time, dt) * (r - of_start + self.learned - self.slow)
        self.learned = self.learned + own * r

    def forget(self, unwatched: Array) -> None:
        """Joints whose sensors fail."""
        self.late, self.quick, self.slow, self.learned = (
            np.where(unwatched, 0.0, row) for row in (self.late, self.quick, self.slow, self.learned)
        )

    def bound(self, j: int, mean_force: float) -> float:
        return float(self.threshold[j] + self.per_force[j] * mean_force)
