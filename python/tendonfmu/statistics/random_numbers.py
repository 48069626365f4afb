"""Which random numbers stay the same in all versions: streams of PCG64, whose raw numbers numpy does not change."""

from __future__ import annotations

import math

import numpy as np

LARGEST_SEED = 2**53


class Draws:
    """A separate stream of random numbers for every (seed, names)."""

    def __init__(self, seed: int, *stream: int) -> None:
        self._generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, *stream])))

    def share(self) -> float:
        """Draw a number."""
        return float(self._generator.random())

    def between(self, low: float, high: float) -> float:
        """Draw a number between bounds."""
        return low + (high - low) * self.share()

    def sign(self) -> float:
        """Draw a sign."""
        return 1.0 if self.share() < 0.5 else -1.0

    def direction(self) -> list[float]:
        """Draw a direction (Marsaglia, Ann. Math. Statist. 43(2), 1972)."""
        # returns unit vector [3], uniform on the sphere
        while True:
            x, y = self.between(-1.0, 1.0), self.between(-1.0, 1.0)
            square = x * x + y * y
            if square < 1.0:
                root = 2.0 * math.sqrt(1.0 - square)
                return [x * root, y * root, 1.0 - 2.0 * square]
