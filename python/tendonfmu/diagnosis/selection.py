"""Which cause comes next: the one that lowers the error on unseen data most, if it is material and certain.

- Material: the rms on held-out folds falls by at least a given share.
- Certain: the gain is more than two standard errors over the stretches.
- A size below what the sensors resolve is no cause.
- Selection goes from coarse to fine: a single place is taken only if it is better than all places together.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.stats import ttest_1samp

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.candidate_columns import HERE, LARGEST_SECANT, SOMEWHERE, Candidate
from tendonfmu.diagnosis.effects import COMMON, Mechanism, Place, Term, Where, title_of
from tendonfmu.diagnosis.result import ABSORBED, NO_GAIN, Invisible, Sensor, with_error
from tendonfmu.model import extended_row, moment_arms
from tendonfmu.recordings import FitRecording, zero_phase
from tendonfmu.statistics import Grams, Interval, standard_error
from tendonfmu.tasks import Step

# --- what sensors can show --------------------------------------------------------------------------------------------
# Play must be several times the noise of the positions. A delay must be more than half a sample.


OF_NOISE = 4.0  # standard deviations of the position noise
OF_SAMPLE = 0.75  # samples: velocities are late by half a sample
NEVER_NEGATIVE = ("preload_friction", "load_friction")  # all their places together
NOISE_CUTOFF = 15.0  # Hz: faster motion of the positions is noise
BEFORE_FIT = 0.5  # of the least size: only the fit shows how large an effect is


@dataclass(frozen=True)
class LeastSizes:
    """What limits the sensors."""

    joint_noise: Numbers  # standard deviation of the noise of the joint positions, rad [n]
    tendon_noise: Numbers  # standard deviation of the noise of the tendon positions, m [m]
    step: float  # time between samples, s
    heaviest: Numbers  # largest weight, N·m [n]: a larger one only imitates other torque beside the cover's

    def least(self, where: Where) -> float:
        """Return the least size in the unit of the effect's number; 0 if none is known."""
        if where.effect == "time_delay":
            return OF_SAMPLE * self.step
        if where.effect == "backlash":
            if where.joint is not None:
                return OF_NOISE * float(self.joint_noise[where.joint - 1])
            if where.tendon is not None:
                return OF_NOISE * float(self.tendon_noise[where.tendon - 1])
        return 0.0

    def worth(self, mechanism: Mechanism, place: Place, shape: Mapping[str, float]) -> bool:
        """Return whether a step of this size can lead to a size that the sensors resolve."""
        least = self.least(Where(mechanism.name, *place))
        return least == 0.0 or LARGEST_SECANT * abs(float(next(iter(shape.values())))) >= least

    def shows(self, effect: str, place: Place, row: Mapping[str, Any] | None) -> bool:
        """Return whether a fitted play or delay, a row of `extensions`, is large enough, and no weight too large."""
        if row is not None and effect == "gravity" and place.joint is not None:
            return bool(max(abs(row.get(key, 0.0)) for key in ("sine", "cosine")) <= self.heaviest[place.joint - 1])
        number = {"backlash": "width", "time_delay": "delay"}.get(effect)
        if row is None or number is None:
            return True
        return bool(abs(row[number]) >= self.least(Where(effect, *place)))

    def resolved(self, candidate: Candidate, magnitudes: Sequence[float] | Numbers) -> bool:
        """Return whether a candidate with these magnitudes [d] is large enough."""
        least = self.least(candidate.where)
        return least == 0.0 or abs(float(magnitudes[0])) * candidate.step >= BEFORE_FIT * least

    def shows_all(self, effect: str, terms: Sequence[Term], data: Data) -> bool:
        """Return whether the sensors can show the sizes of a fitted effect; no friction is negative."""
        rows = [extended_row(data, effect, term.place) for term in terms]
        if effect in NEVER_NEGATIVE and sum(row["coulomb"] for row in rows if row) < 0.0:
            return False
        return all(self.shows(effect, term.place, extended_row(data, effect, term.place)) for term in terms)


def least_sizes(data: Mapping[str, Any], recordings: Sequence[FitRecording], step: float) -> LeastSizes:
    """Measure what recordings can show; `step` is the time between the samples that are estimated from, s."""
    joints: list[Numbers] = []
    tendons: list[Numbers] = []
    heaviest, arms = np.zeros(len(data["joints"])), moment_arms(data)
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]])
    for recording in recordings:
        groups = recording.recording.groups
        angle, force = recording.model.joint_angle, groups["tendon_force"]
        reached = groups["tendon_position"] - force / stiffness if "tendon_position" in groups else angle @ arms.T
        most, reach = (np.abs(each[recording.train]).max(axis=0, initial=0.0) for each in (force @ arms, angle))
        heaviest = np.maximum(heaviest, most / np.sin(np.clip(reach, 1e-9, np.pi / 2)))
        for part in recording.parts:
            rate = 1.0 / float(np.median(np.diff(recording.time[part])))
            for values, noise in ((angle[part], joints), (reached[part], tendons)):
                noise.append(noise_of(values, zero_phase(values, NOISE_CUTOFF, rate)))
    return LeastSizes(np.max(joints, axis=0), np.max(tendons, axis=0), step, heaviest)


def noise_of(raw: Numbers, smooth: Numbers) -> Numbers:
    """Return the noise [d] of positions [N, d]: the spread of what smoothing removes, at least that of quantisation."""
    left = raw - smooth
    spread = 1.4826 * np.median(np.abs(left - np.median(left, axis=0)), axis=0)
    steps = np.abs(np.diff(raw, axis=0))
    quantum = np.array([float(column[column > 0].min(initial=np.inf)) for column in steps.T])
    return np.maximum(spread, np.where(np.isfinite(quantum) & (quantum > 1e-12), quantum / np.sqrt(12.0), 0.0))


MOST_REFUSED = 4  # selected effects that the fit or the test did not confirm
SIGNIFICANCE = 0.01  # family-wise
CERTAIN = 2.0  # standard errors above 0
ALIKE = 1.64  # standard errors of the paired difference, within which two causes cannot be distinguished
SAME = 0.015  # of the error, about a quarter of what is material: a smaller difference does not count, however certain
FINER = 0.5  # standard errors by which a finer place must be better: both have as many numbers
NEAR = 0.1  # of what an effect removes: its derivatives do not distinguish places that are this close
SMALLEST_GAIN = 1e-6  # where every gain counts as material


@dataclass(frozen=True, eq=False)
class Judged(Candidate):
    """A candidate with its magnitudes, its error, and how certain it is."""

    magnitudes: Numbers = field(default_factory=lambda: np.zeros(0))  # [d]
    covariance: Numbers = field(default_factory=lambda: np.zeros((0, 0)))  # [d, d]
    unseen: Numbers = field(default_factory=lambda: np.zeros(0))  # Σ e² by stretch, (N·m)²
    gain: Interval = NO_GAIN  # 1 − rms with / rms without
    gain_unit: str = "N.m"  # of the rms
    p_value: float = 1.0  # family-wise
    alike: tuple[Judged, ...] = ()  # what the data cannot distinguish from it, best first
    sensors: tuple[Sensor, ...] = ()  # of `calibration`

    def scaled(self) -> tuple[Term, ...]:
        """Return its terms at its magnitudes."""
        return tuple(term.times(self.magnitudes.tolist()) for term in self.terms)


Judge = Callable[[list[Judged]], tuple[list[Judged], list[int]]]  # causes -> with gains on unseen data, the weak ones


class CauseSearch(ABC):
    """A search that adds one cause after the other until none is material and certain."""

    def __init__(self, most: int) -> None:
        """Begin without a cause; stop after `most` of them."""
        self.causes: list[Judged] = []
        self.refused: list[Judged] = []  # causes that were selected but not confirmed
        self._most = most

    def run(self, step: Step) -> None:
        """Take one cause after the other."""
        while len(self.causes) < self._most and len(self.refused) < MOST_REFUSED:
            step(len(self.causes))
            tried = self._try_next({refused.effect for refused in self.refused})
            if tried is None:
                break
            cause, is_taken = tried
            if not is_taken:
                self.refused.append(cause)

    @abstractmethod
    def _try_next(self, tried: set[str]) -> tuple[Judged, bool] | None:
        """Try the best effect that is not in `tried`; return it and whether it was taken, None if none is material."""


def confirmed(causes: Sequence[Judged], judge: Judge) -> tuple[list[Judged], list[Judged]]:
    """Drop the weakest cause until none is weak; return the others and the dropped ones, with their gains."""
    kept, dropped = list(causes), list[Judged]()
    while True:
        kept, weak = judge(kept)
        if not weak:
            return kept, dropped
        dropped.append(kept.pop(min(weak, key=lambda k: kept[k].gain.value)))


class Selection:
    """All candidate causes, judged with the same matrices."""

    def __init__(
        self,
        grams: Grams,
        candidates: Sequence[Candidate],
        least: LeastSizes,
        beside: Sequence[Candidate] = (),
        shares: Sequence[float] | None = None,
    ) -> None:
        """Judge all candidates; `shares` are those that survive refitting, if they are known."""
        # `beside` holds causes that are taken as present, so that no other effect is credited with what they explain.
        self.grams, self.candidates, self._beside = grams, list(candidates), beside
        self.shares = [grams.surviving(candidate.mix) for candidate in candidates] if shares is None else list(shares)
        self.base = grams.by_stretch(None, None)
        if beside:
            known = _joined(*beside)
            self.base = grams.by_stretch(known[0], grams.error(*known)[1])
        effects = {cause.effect for cause in beside}
        judged = []
        for candidate, share in zip(candidates, self.shares, strict=True):
            if share < ABSORBED or candidate.effect in effects:
                continue
            columns = _joined(*beside, candidate)
            magnitudes = grams.magnitudes(*columns)[-len(candidate.low) :]
            if least.resolved(candidate, magnitudes):
                error, by_fold = grams.error(*columns)
                if error <= (1.0 - candidate.least_gain) ** 2 * self.base.sum():
                    judged.append((error, candidate, magnitudes, by_fold))
        self._results = sorted(judged, key=lambda result: result[0])
        self._known: dict[int, Judged] = {}

    def regularised(self, candidate: Candidate, ridge: Numbers) -> Judged:
        """Return a candidate with magnitudes that are expected to be small, their covariance, and its error."""
        # ridge: [d], weights of the squared magnitudes; their usual sizes are in `ordinary`
        known = sum(len(cause.low) for cause in self._beside)
        columns = _joined(*self._beside, candidate)
        arguments = *columns, np.concatenate([np.zeros(known), ridge])
        _, by_fold = self.grams.error(*arguments)
        energy, scores = self.grams.scores(candidate.mix, by_fold[:, known:])
        inverse = np.linalg.inv(energy + np.diag(ridge))
        # scatter of the estimate, and by how much the prior knowledge pulls it away from a usual size
        covariance = inverse @ (scores.T @ scores + np.diag((ridge * candidate.ordinary) ** 2)) @ inverse
        magnitudes, unseen = self.grams.magnitudes(*arguments)[known:], self.grams.by_stretch(columns[0], by_fold)
        return Judged(**vars(candidate), magnitudes=magnitudes, covariance=covariance, unseen=unseen)

    def ranked(self, tried: Collection[str] = ()) -> list[Judged]:
        """Return the best place and shape of each effect that lowers the error, the best first."""
        best: dict[str, int] = {}
        for k, (error, candidate, _, _) in enumerate(self._results):
            if error < self.base.sum() and candidate.effect not in tried:
                best.setdefault(candidate.effect, k)
        return [self._judged(k) for k in best.values()]

    def _judged(self, number: int) -> Judged:
        if number not in self._known:
            _, candidate, magnitudes, by_fold = self._results[number]
            unseen = self.grams.by_stretch(_joined(*self._beside, candidate)[0], by_fold)
            self._known[number] = Judged(**vars(candidate), magnitudes=magnitudes, unseen=unseen)
        return self._known[number]

    def gain(self, cause: Judged, before: Numbers | None = None) -> tuple[float, float]:
        """Return 1 − rms with / rms without, and its standard error."""
        # `before` is Σ e² without the cause by stretch [stretches]; None for that of the model.
        return rms_gain(self.base if before is None else before, cause.unseen)

    def best(self, least_gain: float, tried: Collection[str] = ()) -> Judged | None:
        """Return the effect that lowers the error most, at the coarsest place that is as good."""
        # None if no effect is material and certain.
        ranked = self.ranked(tried)
        if not ranked:
            return None
        best = self.refined(ranked[0].effect)
        gain, error = self.gain(best)
        if gain < least_gain or gain <= CERTAIN * error:
            return None
        return replace(best, gain=with_error(gain, error), alike=self.alike(best, ranked))

    def alike(self, best: Judged, ranked: Sequence[Judged]) -> tuple[Judged, ...]:
        """Return the other effects that the data cannot distinguish from the best."""
        others = (cause for cause in ranked if cause.effect != best.effect)
        return tuple(cause for cause in others if is_alike(cause.unseen, best.unseen))

    def refined(self, effect: str) -> Judged:
        """Return the best place at the coarsest level, or a finer one if it is certainly better."""
        levels: dict[int, int] = {}
        for k, (_, candidate, _, _) in enumerate(self._results):
            if candidate.effect == effect:
                levels.setdefault(candidate.level, k)
        chosen, *others = [self._judged(levels[level]) for level in sorted(levels)]
        for finer in others:
            gain, error = self.gain(finer, chosen.unseen)
            if gain > FINER * error:
                chosen = finer
        return chosen

    def near(self, best: Judged) -> list[Judged]:
        """Return the effect at other places that are nearly as good, the best first: of its level, or one alone."""
        least = float(best.unseen.sum())
        most = least + NEAR * (float(self.base.sum()) - least)
        levels = (best.level, HERE) if best.level == SOMEWHERE else (best.level,)  # what is everywhere is simple, too
        near: dict[Where, int] = {}
        for k, (error, candidate, _, _) in enumerate(self._results):
            same = candidate.effect == best.effect and candidate.level in levels
            if same and candidate.where != best.where and error <= most:
                near.setdefault(candidate.where, k)
        return [self._judged(k) for k in near.values()]


def names_with(effect: str, named: Collection[str]) -> int:
    """Return how many names count if this one is added."""
    others = set(named) - set(COMMON)
    return 1 if effect in COMMON or effect in others else 1 + len(others)


def names_needed(causes: Sequence[Judged]) -> list[int]:
    """Return how many names count up to each cause, the largest gain first: it needs so many times the least gain."""
    order = sorted(range(len(causes)), key=lambda k: -causes[k].gain.value)
    named = [causes[k].effect for k in order]
    needed = {k: names_with(causes[k].effect, named[:place]) for place, k in enumerate(order)}
    return [needed[k] for k in range(len(causes))]


def is_alike(other: Numbers, best: Numbers) -> bool:
    """Return whether errors by stretch [K] cannot be distinguished from those of the best."""
    behind = other - best
    return bool(behind.sum() <= max(ALIKE * standard_error(behind), SAME * best.sum()))


def _joined(*candidates: Candidate) -> tuple[Numbers, Numbers, Numbers]:
    """Return the columns of several candidates together [c, d], and the bounds of all magnitudes [d]."""
    mix, low, high = (np.concatenate([getattr(one, name) for one in candidates], -1) for name in ("mix", "low", "high"))
    return mix, low, high


def step_p_value(before: Numbers, after: Numbers) -> float:
    """Return the p-value of a gain by stretch [K]: a one-sided t test."""
    return float(ttest_1samp(before - after, 0.0, alternative="greater").pvalue) if len(before) > 1 else 1.0


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


# --- what recordings cannot show -------------------------------------------------------------------------------------


def invisible_effects(
    selection: Selection, causes: Sequence[Judged] = (), known: Collection[Where] = (), least_gain: float | None = None
) -> list[tuple[Candidate, Invisible]]:
    """Return, for each place at which an effect is not visible, the shape that comes nearest."""
    # It is not visible if refitting absorbs it or, with a least gain, if one of ordinary size would not be a cause.
    names = [cause.effect for cause in causes]
    best: dict[Where, tuple[float, Candidate, Invisible]] = {}
    for candidate, share in zip(selection.candidates, selection.shares, strict=True):
        if candidate.level != HERE or candidate.where in known:
            continue
        nearness, gain, needed = share / ABSORBED, None, None  # from 1 on it is visible
        if least_gain is not None:
            gain = selection.grams.ordinary_gain(candidate.mix, candidate.ordinary)
            needed = least_gain * names_with(candidate.effect, names)
            nearness = min(nearness, gain / max(needed, SMALLEST_GAIN))
        if candidate.where not in best or nearness > best[candidate.where][0]:
            hidden = Invisible(candidate.where, title_of(candidate.effect), share, "", {}, gain, needed)
            best[candidate.where] = (nearness, candidate, hidden)
    ranked = sorted(best.values(), key=lambda entry: -entry[0])
    return [(candidate, hidden) for nearness, candidate, hidden in ranked if nearness < 1.0]
