"""Which internal tensions a training motion has: balanced patterns (Rᵀ f = 0), one after the other.

Each tendon is tight in some patterns and loose in others. With one constant pattern a fit sees only the sum of a flexor
and its extensor, or of two tendons that slide together. The tensions of a finger of m tendons and n joints can change
in m − n ways without turning a joint, so changing patterns let a fit distinguish more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.files import counted
from tendonfmu.model import moment_arms, pretension_vector
from tendonfmu.statistics import quintic

CHANGE = 1.5  # s; from one pattern to the next, while the joints move on
SHORTEST = 2.0  # s; of a pattern, its change included
_SWEEPS = 5000
_CLOSE = 1e-6  # of the highest tension; the remaining error is removed by shrinking towards the even pattern
_STREAM = 0x7E17  # of random numbers; joints have 0 to 15


@dataclass(frozen=True)
class Variation:
    """How the tensions change."""

    lowest: float  # limits (N) of every tendon that only pulls
    highest: float
    every: float = 10.0  # duration of a pattern (s)


def internal_tensions(data: Mapping[str, Any], variation: Variation, time: Numbers, seed: int) -> Numbers:
    """Return tensions [N, m] (N) at `time` [N] (s). Raise InputError if the finger has none within the limits."""
    count = max(2, math.ceil(float(time[-1]) / variation.every))
    random = np.random.default_rng([seed, _STREAM])
    tight = np.arange(count) % 2 == 0
    drawn = np.column_stack([random.permutation(tight) for _ in data["tendons"]])
    patterns = _Patterns(data, variation)
    values = np.array([patterns.nearest(row) for row in drawn])
    return np.column_stack([_series(values[:, i], variation.every, time) for i in range(values.shape[1])])


def _series(values: Numbers, every: float, time: Numbers) -> Numbers:
    """Return one tendon's tension [N]: constant, but changing for `CHANGE` at the beginning of each later pattern."""
    begin = every * np.arange(1, len(values))
    knots = np.zeros((2 * len(begin) + 1, 4))
    knots[1::2, 0], knots[2::2, 0] = begin, begin + CHANGE
    knots[0, 1], knots[1::2, 1], knots[2::2, 1] = values[0], values[:-1], values[1:]
    tension, _, _ = quintic.evaluate(knots, time)
    return tension


class _Patterns:
    """The balanced tensions of a finger within limits."""

    def __init__(self, data: Mapping[str, Any], variation: Variation) -> None:
        arms = moment_arms(data)
        if np.linalg.matrix_rank(arms) == len(arms):
            raise InputError(
                f"--vary-tension {variation.lowest:g}:{variation.highest:g}: {counted(len(arms), 'tendon')} at "
                f"{counted(arms.shape[1], 'joint')} hold no tension; expected more tendons than joints"
            )
        pulls = np.array([not tendon.get("bidirectional") for tendon in data["tendons"]])
        self._project = np.eye(len(arms)) - arms @ np.linalg.pinv(arms)
        self._high = np.full(len(arms), variation.highest)
        self._low = np.where(pulls, variation.lowest, -variation.highest)
        self._even = self._even_pattern(pretension_vector(data), pulls, variation)

    def _even_pattern(self, shares: Numbers, pulls: NDArray[np.bool_], variation: Variation) -> Numbers:
        """Return the pretension in the middle of those within the limits."""
        low, high = variation.lowest, variation.highest
        least = low / float(shares[pulls].min()) if pulls.any() else 0.0
        most = high / float(np.abs(shares).max()) if shares.any() else 0.0
        if least > most:
            raise InputError(
                f"--vary-tension {low:g}:{high:g}: no balanced pretension lies within; expected HIGH at least "
                f"{least * high / (most * low):.3g} times LOW for these moment arms"
            )
        return 0.5 * (least + most) * shares

    def nearest(self, tight: NDArray[np.bool_]) -> Numbers:
        """Return the balanced tensions [m] nearest to the highest where `tight` [m], and to the lowest elsewhere."""
        # The result is shrunk towards the even pattern by the remaining error, so that the limits hold.
        found, correction = self._project @ np.where(tight, self._high, self._low), np.zeros(len(tight))
        for _ in range(_SWEEPS):
            within = np.clip(found + correction, self._low, self._high)
            correction += found - within
            found = self._project @ within
            if np.abs(found - within).max() < _CLOSE * self._high[0]:
                break
        way = found - self._even
        room = np.where(way > 0, self._high - self._even, self._even - self._low)
        return self._even + way * min(1.0, float(np.min(room / np.maximum(np.abs(way), 1e-12))))
