"""The least size that the sensors can show of an effect: what is smaller is no cause.

Play and the distance of presliding have to be several times the noise of the positions; a delay has to be more than
half a sample, and more than the lag that filtering leaves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.diagnose.effects import Candidate, Place
from tendonfmu.diagnose.hypotheses import LARGEST_SECANT, Hypothesis

Numbers = NDArray[np.float64]

OF_NOISE = 4.0  # standard deviations of the position's noise
OF_SAMPLE = 0.75  # sample: velocities are late by half of one
BEFORE_FIT = 0.5  # of the least size: how large an effect is only the fit tells


@dataclass(frozen=True)
class LeastSizes:
    """joint_noise: [n] rad, tendon_noise: [m] m, standard deviation. step: s between samples. lag: s of filters."""

    joint_noise: Numbers
    tendon_noise: Numbers
    step: float
    lag: float

    def least(self, effect: str, joint: int | None, tendon: int | None) -> float:
        """In the unit of the effect's number; 0 where nothing is known of it."""
        if effect == "time_delay":
            return OF_SAMPLE * self.step + self.lag
        if effect in ("backlash", "presliding"):
            if joint is not None:
                return OF_NOISE * float(self.joint_noise[joint - 1])
            if tendon is not None:
                return OF_NOISE * float(self.tendon_noise[tendon - 1])
        return 0.0

    def worth(self, candidate: Candidate, place: Place, shape: Mapping[str, float]) -> bool:
        """Whether a step of this size can lead to a resolved one: a column is good for LARGEST_SECANT times it."""
        least = self.least(candidate.name, place.joint, place.tendon)
        return least == 0.0 or LARGEST_SECANT * abs(float(next(iter(shape.values())))) >= least

    def shows(self, effect: str, place: Place, row: Mapping[str, Any] | None) -> bool:
        """Whether a fitted play or delay, a row of `extensions`, is large enough."""
        number = {"backlash": "width", "time_delay": "delay"}.get(effect)
        return row is None or number is None or abs(row[number]) >= self.least(effect, place.joint, place.tendon)

    def resolved(self, hypothesis: Hypothesis, magnitudes: Sequence[float] | Numbers) -> bool:
        """Whether a hypothesis with these magnitudes [d] is large enough."""
        if hypothesis.effect == "presliding":  # its size is the distance that was tried, not the magnitude
            return True
        least = self.least(hypothesis.effect, hypothesis.joint, hypothesis.tendon)
        return least == 0.0 or _size(hypothesis, magnitudes) >= BEFORE_FIT * least


def _size(hypothesis: Hypothesis, magnitudes: Sequence[float] | Numbers) -> float:
    """Of its first number, at its first place."""
    if not hypothesis.members:  # a number that the description has
        return abs(float(magnitudes[0]))
    member = hypothesis.members[0]
    shape: Mapping[str, float] = member.shape.shape
    step = abs(float(next(iter(shape.values())))) if member.shape.secant and shape else 1.0
    return abs(float(magnitudes[0])) * step


def noise_of(raw: Numbers, smooth: Numbers) -> Numbers:
    """[d] standard deviation of what smoothing takes off positions [N, d], robust; at least what quantisation makes."""
    left = raw - smooth
    spread = 1.4826 * np.median(np.abs(left - np.median(left, axis=0)), axis=0)
    steps = np.abs(np.diff(raw, axis=0))
    quantum = np.array([float(column[column > 0].min(initial=np.inf)) for column in steps.T])
    return np.maximum(spread, np.where(np.isfinite(quantum) & (quantum > 1e-12), quantum / np.sqrt(12.0), 0.0))
