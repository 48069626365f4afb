"""Which cause comes next: the one that lowers the error on unseen data most, if it is material and certain.

- Material: the rms on held-out folds falls by at least a given share.
- Certain: the gain is more than two standard errors over the stretches.
- A size below what the sensors resolve is no cause.
- Selection goes from coarse to fine: a single place is taken only if it is better than all places together.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.hypotheses import Hypothesis, Key
from tendonfmu.diagnosis.least_sizes import LeastSizes
from tendonfmu.diagnosis.result import ABSORBED
from tendonfmu.statistics import Grams, standard_error

CERTAIN = 2.0  # standard errors above 0
ALIKE = 1.64  # standard errors of the paired difference, within which two causes cannot be distinguished
SAME = 0.015  # of the error, about a quarter of what is material: a smaller difference does not count, however certain
COMMON = {"presliding", "time_delay"}  # presliding is in every finger, a delay in every way of recording
FINER = 0.5  # standard errors by which a finer place must be better: both have as many numbers
NEAR = 0.1  # of what an effect removes: its derivatives do not distinguish places that are this close


@dataclass(frozen=True)
class Judged:
    """A hypothesis on unseen data."""

    hypothesis: Hypothesis
    error: float  # Σ e², (N·m)²
    by_stretch: Numbers  # the same by stretch [stretches]
    magnitudes: Numbers  # learned from all data [d]


@dataclass(frozen=True)
class Pick:
    """A selected cause."""

    judged: Judged
    gain: float  # 1 − rms with / rms without, on unseen data, and its standard error
    error: float
    # the best hypothesis of every other effect that the data cannot distinguish from it, best first
    alike: tuple[Hypothesis, ...]

    @property
    def hypothesis(self) -> Hypothesis:
        return self.judged.hypothesis


class Selection:
    """All hypotheses, judged with the same matrices."""

    def __init__(
        self, grams: Grams, hypotheses: Sequence[Hypothesis], least: LeastSizes, beside: Sequence[Hypothesis] = ()
    ) -> None:
        """Judge all hypotheses."""
        # `beside` holds hypotheses that are taken as present, so that no other effect is credited with what they
        # explain.
        self.grams = grams
        self._beside = _Beside(beside)
        self.shares = [grams.surviving(hypothesis.mix) for hypothesis in hypotheses]
        self.hypotheses = list(hypotheses)
        self.base = grams.by_stretch(*self._beside.judged(grams)) if beside else grams.by_stretch(None, None)
        effects = {hypothesis.effect for hypothesis in beside}
        judged = []
        for hypothesis, share in zip(hypotheses, self.shares, strict=True):
            if share < ABSORBED or hypothesis.effect in effects:
                continue
            columns = self._beside.with_(hypothesis)
            magnitudes = grams.magnitudes(*columns)[len(self._beside.low) :]
            if least.resolved(hypothesis, magnitudes):
                error, by_fold = grams.error(*columns)
                if error <= (1.0 - hypothesis.least_gain) ** 2 * self.base.sum():
                    judged.append((error, hypothesis, magnitudes, by_fold))
        self._results = sorted(judged, key=lambda result: result[0])
        self._known: dict[int, Judged] = {}

    def ranked(self) -> list[Judged]:
        """Return the best hypothesis of each effect that lowers the error, the best first."""
        seen: dict[str, int] = {}
        for k, (error, hypothesis, _, _) in enumerate(self._results):
            if error < self.base.sum():
                seen.setdefault(hypothesis.effect, k)
        return [self._judged(k) for k in seen.values()]

    def _judged(self, number: int) -> Judged:
        if number not in self._known:
            error, hypothesis, magnitudes, by_fold = self._results[number]
            mix, _, _ = self._beside.with_(hypothesis)
            self._known[number] = Judged(hypothesis, error, self.grams.by_stretch(mix, by_fold), magnitudes)
        return self._known[number]

    def gain(self, judged: Judged, before: Numbers | None = None) -> tuple[float, float]:
        """Return 1 − rms with / rms without, and its standard error."""
        # `before` is Σ e² without the hypothesis by stretch [stretches]; None for that of the model.
        whole = self.base if before is None else before
        return rms_gain(whole, judged.by_stretch)

    def best(self, least_gain: float, tried: Collection[str] = ()) -> Pick | None:
        """Return the effect that lowers the error most, at the coarsest place that is as good."""
        # None if no effect is material and certain.
        ranked = [judged for judged in self.ranked() if judged.hypothesis.effect not in tried]
        if not ranked:
            return None
        judged = self.refined(ranked[0].hypothesis.effect)
        gain, error = self.gain(judged)
        if gain < least_gain or gain <= CERTAIN * error:
            return None
        others = [other for other in ranked if other.hypothesis.effect != judged.hypothesis.effect]
        alike = [other.hypothesis for other in others if is_alike(other.by_stretch, judged.by_stretch)]
        return Pick(judged, gain, error, tuple(alike))

    def refined(self, effect: str) -> Judged:
        """Return the best place at the coarsest level, or a finer one if it is certainly better."""
        levels: dict[int, int] = {}
        for k, (_, hypothesis, _, _) in enumerate(self._results):
            if hypothesis.effect == effect:
                levels.setdefault(hypothesis.level, k)
        places = [self._judged(levels[level]) for level in sorted(levels)]
        chosen = places[0]
        for judged in places[1:]:
            gain, error = self.gain(judged, chosen.by_stretch)
            if gain > FINER * error:
                chosen = judged
        return chosen

    def near(self, judged: Judged) -> list[Judged]:
        """Return the same effect at other places of the same level that are nearly as good, the best first."""
        own = judged.hypothesis
        most = judged.error + NEAR * (float(self.base.sum()) - judged.error)
        seen: dict[Key, int] = {}
        for k, (error, other, _, _) in enumerate(self._results):
            if (other.effect, other.level) == (own.effect, own.level) and other.key != own.key and error <= most:
                seen.setdefault(other.key, k)
        return [self._judged(k) for k in seen.values()]


def names_with(effect: str, named: Collection[str]) -> int:
    """Return how many names count if this one is added."""
    others = set(named) - COMMON
    return 1 if effect in COMMON or effect in others else 1 + len(others)


def is_alike(other: Numbers, best: Numbers) -> bool:
    """Return whether errors by stretch [K] cannot be distinguished from those of the best."""
    behind = other - best
    return bool(behind.sum() <= max(ALIKE * standard_error(behind), SAME * best.sum()))


class _Beside:
    """Columns of hypotheses that are always present."""

    def __init__(self, hypotheses: Sequence[Hypothesis]) -> None:
        self._mixes = [hypothesis.mix for hypothesis in hypotheses]
        self.low = np.concatenate([np.zeros(0), *(hypothesis.low for hypothesis in hypotheses)])
        self._high = np.concatenate([np.zeros(0), *(hypothesis.high for hypothesis in hypotheses)])

    def judged(self, grams: Grams) -> tuple[Numbers, Numbers]:
        """Return the mix of all columns [c, d], and their magnitudes without each fold [f, d]."""
        mix = np.concatenate(self._mixes, axis=1)
        return mix, grams.error(mix, self.low, self._high)[1]

    def with_(self, hypothesis: Hypothesis) -> tuple[Numbers, Numbers, Numbers]:
        """Return mix and bounds of all, the hypothesis last."""
        return (
            np.concatenate([*self._mixes, hypothesis.mix], axis=1),
            np.concatenate([self.low, hypothesis.low]),
            np.concatenate([self._high, hypothesis.high]),
        )


def rms_gain(before: Numbers, after: Numbers) -> tuple[float, float]:
    """Return 1 − rms after / rms before from Σ e² by stretch [K], and its standard error."""
    whole, left = float(before.sum()), float(after.sum())
    if whole <= 0.0:
        return 0.0, np.inf
    ratio = np.sqrt(left / whole)
    if ratio <= 0.0:
        return 1.0, 0.0
    spread = standard_error(after - left / whole * before)
    return 1.0 - ratio, float(spread / (2.0 * ratio * whole))
