"""Which cause comes next: the one that lowers the error on unseen data most, if it is material and certain.

- Material: the rms on held-out folds falls by at least a given share.
- Certain: the gain is more than two standard errors over the stretches.
- A size below what the sensors resolve is no cause.
- Selection goes from coarse to fine: a single place is taken only if it is better than all places together.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import ttest_1samp

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.candidate_columns import LARGEST_SECANT
from tendonfmu.diagnosis.effects import COMMON, Candidate, Place, Term, Where
from tendonfmu.diagnosis.result import ABSORBED, HERE, Cause, Direction, Invisible, with_error
from tendonfmu.model import extended_row, moment_arms
from tendonfmu.recordings import FitRecording, zero_phase
from tendonfmu.statistics import Grams, standard_error
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

    def worth(self, candidate: Candidate, place: Place, shape: Mapping[str, float]) -> bool:
        """Return whether a step of this size can lead to a size that the sensors resolve."""
        least = self.least(Where(candidate.name, *place))
        return least == 0.0 or LARGEST_SECANT * abs(float(next(iter(shape.values())))) >= least

    def shows(self, effect: str, place: Place, row: Mapping[str, Any] | None) -> bool:
        """Return whether a fitted play or delay, a row of `extensions`, is large enough."""
        number = {"backlash": "width", "time_delay": "delay"}.get(effect)
        if row is None or number is None:
            return True
        return bool(abs(row[number]) >= self.least(Where(effect, *place)))

    def resolved(self, cause: Cause, magnitudes: Sequence[float] | Numbers) -> bool:
        """Return whether a candidate with these magnitudes [d] is large enough."""
        least = self.least(cause.where)
        return least == 0.0 or abs(float(magnitudes[0])) * cause.direction.step >= BEFORE_FIT * least

    def shows_all(self, effect: str, terms: Sequence[Term], data: Data) -> bool:
        """Return whether the sensors can show the sizes of a fitted effect; no friction is negative."""
        rows = [extended_row(data, effect, term.place) for term in terms]
        if effect in NEVER_NEGATIVE and sum(row["coulomb"] for row in rows if row) < 0.0:
            return False
        return all(self.shows(effect, term.place, extended_row(data, effect, term.place)) for term in terms)


def least_sizes(data: Mapping[str, Any], recordings: Sequence[FitRecording], step: float) -> LeastSizes:
    """Measure the sensor noise of recordings; `step` is the time between the samples that are estimated from, s."""
    joints: list[Numbers] = []
    tendons: list[Numbers] = []
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]])
    for recording in recordings:
        groups = recording.recording.groups
        angle, force = recording.model.joint_angle, groups["tendon_force"]
        reached = (
            groups["tendon_position"] - force / stiffness
            if "tendon_position" in groups
            else angle @ moment_arms(data).T
        )
        for part in recording.parts:
            rate = 1.0 / float(np.median(np.diff(recording.time[part])))
            for values, noise in ((angle[part], joints), (reached[part], tendons)):
                noise.append(noise_of(values, zero_phase(values, NOISE_CUTOFF, rate)))
    return LeastSizes(np.max(joints, axis=0), np.max(tendons, axis=0), step)


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
Judge = Callable[[list[Cause]], tuple[list[Cause], list[int]]]  # causes -> with gains on unseen data, the weak ones
SMALLEST_GAIN = 1e-6  # where every gain counts as material


class CauseSearch(ABC):
    """A search that adds one cause after the other until none is material and certain."""

    def __init__(self, most: int) -> None:
        """Begin without a cause; stop after `most` of them."""
        self.causes: list[Cause] = []
        self.refused: list[Cause] = []  # causes that were selected but not confirmed
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
    def _try_next(self, tried: set[str]) -> tuple[Cause, bool] | None:
        """Try the best effect that is not in `tried`; return it and whether it was taken, None if none is material."""


def confirmed(causes: Sequence[Cause], judge: Judge) -> tuple[list[Cause], list[Cause]]:
    """Drop the weakest cause until none is weak; return the others and the dropped ones, with their gains."""
    kept, dropped = list(causes), list[Cause]()
    while True:
        kept, weak = judge(kept)
        if not weak:
            return kept, dropped
        dropped.append(kept.pop(min(weak, key=lambda k: kept[k].gain.value)))


def by_gain(causes: Sequence[Cause]) -> list[Cause]:
    """Return the causes, the largest gain first."""
    return sorted(causes, key=lambda cause: -cause.gain.value)


class Selection:
    """All candidate causes, judged with the same matrices."""

    def __init__(
        self,
        grams: Grams,
        causes: Sequence[Cause],
        least: LeastSizes,
        beside: Sequence[Cause] = (),
        shares: Sequence[float] | None = None,
    ) -> None:
        """Judge all candidates; `shares` are those that survive refitting, if they are known."""
        # `beside` holds causes that are taken as present, so that no other effect is credited with what they explain.
        self.grams, self.causes = grams, list(causes)
        self.shares = [grams.surviving(cause.direction.mix) for cause in causes] if shares is None else list(shares)
        self._beside = [cause.direction for cause in beside]
        self.base = grams.by_stretch(None, None)
        if beside:
            known = _joined(*self._beside)
            self.base = grams.by_stretch(known.mix, grams.error(known.mix, known.low, known.high)[1])
        effects = {cause.effect for cause in beside}
        judged = []
        for cause, share in zip(causes, self.shares, strict=True):
            if share < ABSORBED or cause.effect in effects:
                continue
            both = _joined(*self._beside, cause.direction)
            columns = both.mix, both.low, both.high
            magnitudes = grams.magnitudes(*columns)[-len(cause.direction.low) :]
            if least.resolved(cause, magnitudes):
                error, by_fold = grams.error(*columns)
                if error <= (1.0 - cause.direction.least_gain) ** 2 * self.base.sum():
                    judged.append((error, cause, magnitudes, by_fold))
        self._results = sorted(judged, key=lambda result: result[0])
        self._known: dict[int, Cause] = {}

    def regularised(self, cause: Cause, ridge: Numbers) -> Cause:
        """Return a candidate with magnitudes that are expected to be small, their covariance, and its error."""
        # ridge: [d], weights of the squared magnitudes; their usual sizes are in `ordinary`
        own, known = cause.direction, sum(len(beside.low) for beside in self._beside)
        both = _joined(*self._beside, own)
        arguments = both.mix, both.low, both.high, np.concatenate([np.zeros(known), ridge])
        magnitudes = self.grams.magnitudes(*arguments)[known:]
        _, by_fold = self.grams.error(*arguments)
        energy, scores = self.grams.scores(own.mix, by_fold[:, known:])
        inverse = np.linalg.inv(energy + np.diag(ridge))
        # scatter of the estimate, and by how much the prior knowledge pulls it away from a usual size
        covariance = inverse @ (scores.T @ scores + np.diag((ridge * own.ordinary) ** 2)) @ inverse
        unseen = self.grams.by_stretch(both.mix, by_fold)
        return replace(cause, magnitudes=magnitudes, covariance=covariance, unseen=unseen)

    def ranked(self) -> list[Cause]:
        """Return the best place and shape of each effect that lowers the error, the best first."""
        best: dict[str, int] = {}
        for k, (error, cause, _, _) in enumerate(self._results):
            if error < self.base.sum():
                best.setdefault(cause.effect, k)
        return [self._judged(k) for k in best.values()]

    def _judged(self, number: int) -> Cause:
        if number not in self._known:
            _, cause, magnitudes, by_fold = self._results[number]
            unseen = self.grams.by_stretch(_joined(*self._beside, cause.direction).mix, by_fold)
            self._known[number] = replace(cause, magnitudes=magnitudes, unseen=unseen)
        return self._known[number]

    def gain(self, cause: Cause, before: Numbers | None = None) -> tuple[float, float]:
        """Return 1 − rms with / rms without, and its standard error."""
        # `before` is Σ e² without the cause by stretch [stretches]; None for that of the model.
        return rms_gain(self.base if before is None else before, cause.unseen)

    def best(self, least_gain: float, tried: Collection[str] = ()) -> Cause | None:
        """Return the effect that lowers the error most, at the coarsest place that is as good."""
        # None if no effect is material and certain.
        ranked = [cause for cause in self.ranked() if cause.effect not in tried]
        if not ranked:
            return None
        best = self.refined(ranked[0].effect)
        gain, error = self.gain(best)
        if gain < least_gain or gain <= CERTAIN * error:
            return None
        return replace(best, gain=with_error(gain, error), alike=self.alike(best, ranked))

    def alike(self, best: Cause, ranked: Sequence[Cause]) -> tuple[Cause, ...]:
        """Return the other effects that the data cannot distinguish from the best."""
        others = (cause for cause in ranked if cause.effect != best.effect)
        return tuple(cause for cause in others if is_alike(cause.unseen, best.unseen))

    def refined(self, effect: str) -> Cause:
        """Return the best place at the coarsest level, or a finer one if it is certainly better."""
        levels: dict[int, int] = {}
        for k, (_, cause, _, _) in enumerate(self._results):
            if cause.effect == effect:
                levels.setdefault(cause.direction.level, k)
        places = [self._judged(levels[level]) for level in sorted(levels)]
        chosen = places[0]
        for finer in places[1:]:
            gain, error = self.gain(finer, chosen.unseen)
            if gain > FINER * error:
                chosen = finer
        return chosen

    def near(self, best: Cause) -> list[Cause]:
        """Return the same effect at other places of the same level that are nearly as good, the best first."""
        least = float(best.unseen.sum())
        most = least + NEAR * (float(self.base.sum()) - least)
        near: dict[Where, int] = {}
        for k, (error, cause, _, _) in enumerate(self._results):
            same = (cause.effect, cause.direction.level) == (best.effect, best.direction.level)
            if same and cause.where != best.where and error <= most:
                near.setdefault(cause.where, k)
        return [self._judged(k) for k in near.values()]


def names_with(effect: str, named: Collection[str]) -> int:
    """Return how many names count if this one is added."""
    others = set(named) - set(COMMON)
    return 1 if effect in COMMON or effect in others else 1 + len(others)


def is_alike(other: Numbers, best: Numbers) -> bool:
    """Return whether errors by stretch [K] cannot be distinguished from those of the best."""
    behind = other - best
    return bool(behind.sum() <= max(ALIKE * standard_error(behind), SAME * best.sum()))


def _joined(*directions: Direction) -> Direction:
    """Return the direction of several causes together."""
    return Direction(
        np.concatenate([direction.mix for direction in directions], axis=1),
        np.concatenate([direction.low for direction in directions]),
        np.concatenate([direction.high for direction in directions]),
    )


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
    selection: Selection, causes: Sequence[Cause], known: Sequence[Cause], least_gain: float
) -> list[tuple[Cause, Invisible]]:
    """Return, for each place at which an effect of ordinary size would not become a cause, its best shape."""
    places = {term.where for cause in known for term in cause.terms}
    names = [cause.effect for cause in causes]
    best: dict[Where, tuple[float, Cause, Invisible]] = {}
    for cause, share in zip(selection.causes, selection.shares, strict=True):
        if cause.direction.level != HERE or cause.where in places:
            continue
        gain = selection.grams.ordinary_gain(cause.direction.mix, cause.direction.ordinary)
        needed = least_gain * names_with(cause.effect, names)
        nearness = min(share / ABSORBED, gain / max(needed, SMALLEST_GAIN))  # from 1 on it is visible
        if cause.where not in best or nearness > best[cause.where][0]:
            hidden = Invisible(cause.where, cause.title, share, "", ordinary_gain=gain, needed_gain=needed)
            best[cause.where] = (nearness, cause, hidden)
    ranked = sorted(best.values(), key=lambda entry: -entry[0])
    return [(cause, hidden) for nearness, cause, hidden in ranked if nearness < 1.0]


def absorbed_effects(selection: Selection, experiment: str) -> list[Invisible]:
    """Return, for each effect and place that refitting and background absorb, the shape that comes nearest."""
    best: dict[Where, Invisible] = {}
    for cause, share in zip(selection.causes, selection.shares, strict=True):
        if cause.direction.level == HERE and (cause.where not in best or share > best[cause.where].surviving_share):
            best[cause.where] = Invisible(cause.where, cause.title, share, experiment)
    ranked = sorted(best.values(), key=lambda hidden: -hidden.surviving_share)
    return [hidden for hidden in ranked if hidden.absorbed]
