"""Which cause it is: gains on held-out blocks, sets that the data cannot tell apart, several causes at once.

A trial's magnitudes are estimated without a block of time and judged on it, block after block; of a place's choices of
non-linear numbers the one that is best without the block counts. Two causes are told apart by their paired gains
(Vuong, 1989).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.diagnosis_series import Trial
from tendonfmu.significance import DRAWS, Prepared, Problem, Tested, prepare, tested_trials

Numbers = NDArray[np.float64]
Array = NDArray[Any]
Place = tuple[str, int | None, int | None]

SIGNIFICANCE = 0.01
CERTAIN = 1.0  # standard errors above 0 that an accepted cause's gain has to be
ALIKE = 1.64  # standard errors of the paired gain within which two causes are not told apart
MOST_CAUSES = 8
_SHAPES = 1e-2  # share of the energy of a place's columns below which a direction is left out


@dataclass(frozen=True)
class Found:
    """A cause. p_value: family-wise. gain: twice the log likelihood that it adds on held-out blocks; error: of it.

    alike: the best trial of every other place that the data cannot tell from it, best first. magnitudes: [d] estimates.
    """

    trial: Trial
    p_value: float
    gain: float
    error: float
    alike: tuple[Trial, ...]
    magnitudes: Numbers


@dataclass(frozen=True)
class Judged:
    """All places with the causes `kept` in the nuisance. gains: place → [K] on held-out blocks. best: place → its trial
    (number). p_values: place → family-wise p. magnitudes: place → estimates of its trial's, from all blocks."""

    gains: dict[Place, Numbers]
    best: dict[Place, int]
    p_values: dict[Place, float]
    tested: Tested
    magnitudes: dict[Place, Numbers]


def held_out_gains(score: Numbers, gram: Numbers, signs: Sequence[int]) -> tuple[Numbers, Numbers]:
    """Gain [K] on each block of estimates made without it, and what they gain where they are made [K].

    score: [K, d], gram: [K, d, d]. signs: [d] expected, 0 either.
    """
    rest, energy = score.sum(axis=0) - score, gram.sum(axis=0) - gram
    estimate = _estimates(energy, rest)
    if any(signs):
        estimate = _one_sided(energy, rest, estimate, np.array(signs))
    own = 2 * np.einsum("kd,kd->k", estimate, score) - np.einsum("kd,kde,ke->k", estimate, gram, estimate)
    trained = 2 * np.einsum("kd,kd->k", estimate, rest) - np.einsum("kd,kde,ke->k", estimate, energy, estimate)
    return own, trained


def _estimates(energy: Numbers, score: Numbers) -> Numbers:
    """[K, d] of energy [K, d, d] and score [K, d]; directions without energy are left at 0."""
    length = np.sqrt(np.maximum(np.einsum("kdd->kd", energy), 1e-300))
    scaled = energy / (length[:, :, None] * length[:, None, :])
    inverse = np.linalg.pinv(scaled, rcond=1e-9, hermitian=True)
    return np.asarray(np.einsum("kde,ke->kd", inverse, score / length) / length)


def _one_sided(energy: Numbers, score: Numbers, estimate: Numbers, signs: Array) -> Numbers:
    """Magnitudes of the wrong sign are taken out, one at a time, the worst first."""
    for _ in range(estimate.shape[1]):
        reach = signs * estimate * np.sqrt(np.maximum(np.einsum("kdd->kd", energy), 0.0))
        wrong = reach.min(axis=1) < 0
        if not wrong.any():
            break
        worst = reach.argmin(axis=1)
        rows = np.flatnonzero(wrong)
        energy, score = energy.copy(), score.copy()
        energy[rows, worst[rows], :] = 0.0
        energy[rows, :, worst[rows]] = 0.0
        score[rows, worst[rows]] = 0.0
        estimate = _estimates(energy, score)
    return estimate


def judge(prepared: Prepared, trials: Sequence[Trial], eligible: Sequence[bool], seed: int) -> Judged:
    """Tests every trial and measures every place's gain."""
    tested = tested_trials(prepared, trials, eligible, seed, DRAWS)
    by_place: dict[Place, list[int]] = {}
    for k, trial in enumerate(trials):
        if eligible[k] and tested.p_values[k] < 1.0:
            by_place.setdefault(trial.place, []).append(k)
    gains, best, p_values, magnitudes = {}, {}, {}, {}
    for place, members in by_place.items():
        pairs = [held_out_gains(prepared.score(trials[k]), prepared.gram(trials[k]), trials[k].signs) for k in members]
        own, trained = (np.array([pair[which] for pair in pairs]) for which in (0, 1))
        gains[place] = own[trained.argmax(axis=0), np.arange(own.shape[1])]
        best[place] = members[int(np.argmax(trained.sum(axis=1)))]
        p_values[place] = float(min(tested.p_values[k] for k in members))
        chosen = trials[best[place]]
        energy, score = (values.sum(axis=0)[None] for values in (prepared.gram(chosen), prepared.score(chosen)))
        magnitudes[place] = _estimates(energy, score)[0]
    return Judged(gains, best, p_values, tested, magnitudes)


def spread(gains: Numbers) -> float:
    """Standard error of the sum of block gains [K]."""
    return float(np.sqrt(len(gains)) * np.std(gains, ddof=1)) if len(gains) > 1 else np.inf


def leading(judged: Judged) -> Place | None:
    """The place of the largest gain among those that are significant, or None."""
    sure = [
        place
        for place, p_value in judged.p_values.items()
        if p_value < SIGNIFICANCE and judged.gains[place].sum() > CERTAIN * spread(judged.gains[place])
    ]
    return max(sure, key=lambda place: float(judged.gains[place].sum()), default=None)


def alike(judged: Judged, place: Place) -> list[Place]:
    """Significant places whose gain is not told from that of `place`, best first."""
    own = judged.gains[place]
    found = []
    for other, gains in judged.gains.items():
        if other == place or judged.p_values[other] >= SIGNIFICANCE:
            continue
        ahead = own - gains
        if ahead.sum() <= ALIKE * spread(ahead):
            found.append(other)
    return sorted(found, key=lambda other: -float(judged.gains[other].sum()))


# --- several causes ---------------------------------------------------------------------------------------------------


class Selection:
    """Forward selection with backward dropping and exchange; all is tested again after each change."""

    def __init__(self, problem: Problem, eligible: Sequence[bool], seed: int = 0) -> None:
        self.problem, self.eligible, self.seed = problem, list(eligible), seed
        self.trials = problem.bank.trials
        self._known: dict[frozenset[Place], Judged] = {}

    def given(self, kept: Sequence[Place]) -> Judged:
        """Everything judged with the causes `kept` in the nuisance."""
        key = frozenset(kept)
        if key not in self._known:
            columns = [self._shapes(place) for place in sorted(key, key=str)]
            prepared = prepare(self.problem, np.concatenate(columns, axis=2) if columns else None)
            open_ = [ok and trial.place not in key for ok, trial in zip(self.eligible, self.trials, strict=True)]
            self._known[key] = judge(prepared, self.trials, open_, self.seed)
        return self._known[key]

    def _shapes(self, place: Place) -> Numbers:
        """[B, n, a] columns of a place for all its choices of non-linear numbers, reduced to what matters."""
        members = [trial for trial in self.trials if trial.place == place]
        numbers = [k for trial in members for k in range(trial.first, trial.first + trial.count)]
        values = self.problem.bank.columns.values[:, :, numbers].astype(np.float64)
        if len(members) == 1:
            return values
        flat = values.reshape(-1, len(numbers))
        flat = flat / np.maximum(np.sqrt(np.einsum("rc,rc->c", flat, flat)), 1e-300)
        power, direction = np.linalg.eigh(flat.T @ flat)
        return np.asarray((flat @ direction[:, power > _SHAPES * power[-1]]).reshape(*values.shape[:2], -1))

    def run(self) -> list[Found]:
        """All causes, the largest gain first; empty where nothing is missing."""
        kept: list[Place] = []
        seen: set[frozenset[Place]] = set()
        while len(kept) < MOST_CAUSES:
            more = leading(self.given(kept))
            if more is None:
                break
            kept = self._revised([*kept, more])
            if frozenset(kept) in seen:
                break
            seen.add(frozenset(kept))
        found = [self.found(place, others) for place, others in _each(kept) if place in self.given(others).gains]
        return sorted(found, key=lambda each: -each.gain)

    def _revised(self, kept: list[Place]) -> list[Place]:
        """Each cause again with the others kept: dropped where not significant, exchanged where another is better."""
        for _ in range(2 * len(kept)):
            if len(kept) < 2:
                break
            changed = False
            for place in list(kept):
                others = [other for other in kept if other != place]
                better = leading(self.given(others))
                if better == place:
                    continue
                kept = others if better is None else [*others, better]
                changed = True
                break
            if not changed:
                break
        return kept

    def found(self, place: Place, others: Sequence[Place]) -> Found:
        judged = self.given(others)
        gains = judged.gains[place]
        trial = self.trials[judged.best[place]]
        return Found(
            trial=trial,
            p_value=judged.p_values[place],
            gain=float(gains.sum()),
            error=spread(gains),
            alike=tuple(self.trials[judged.best[other]] for other in alike(judged, place)),
            magnitudes=judged.magnitudes[place],
        )


def _each(kept: Sequence[Place]) -> list[tuple[Place, list[Place]]]:
    """Each place with the others."""
    return [(place, [other for other in kept if other != place]) for place in kept]


def null_p_value(judged: Judged) -> float:
    """Least family-wise p of all places."""
    return min(judged.p_values.values(), default=1.0)
