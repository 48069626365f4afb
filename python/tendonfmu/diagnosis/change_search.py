"""What is different now: the changes to the reference model that lower the error on new recordings.

All recordings are explained together. They share the model's numbers, the effects that it lacks in both, and a
background of the motion (`reference.py`). A candidate is free in the new recordings only. It is a number that the
description has, or a term that it lacks. The error is that on held-out parts of the new recordings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from tendonfmu.arrays import Array, Data, Flags, Numbers
from tendonfmu.diagnosis.candidate_columns import Candidate, number_hypotheses, numbers_of, with_numbers
from tendonfmu.diagnosis.effects import Term, Where
from tendonfmu.diagnosis.extension_fit import extended_description
from tendonfmu.diagnosis.reference import (
    background_columns,
    find_repeats,
    folds_of_sides,
    folds_of_unseen,
    less_reference,
    outside,
)
from tendonfmu.diagnosis.result import with_error
from tendonfmu.diagnosis.samples import Samples, exact_model
from tendonfmu.diagnosis.selection import (
    CERTAIN,
    SIGNIFICANCE,
    CauseSearch,
    Judged,
    LeastSizes,
    Selection,
    is_alike,
    names_with,
)
from tendonfmu.diagnosis.view import look
from tendonfmu.model import moment_arms
from tendonfmu.statistics import Grams, Interval, Products

MOST_CHANGES = 4
AS_MUCH = 0.98  # of what the best takes off: what is linearised tells no smaller difference
STEPS = 3  # of Newton's method, with the derivatives of the reference


class ChangeSearch(CauseSearch):
    """Adds one change after the other; all of them are free in the new recordings only."""

    def __init__(
        self,
        data: Data,
        samples: Samples,
        least: LeastSizes,
        new: Sequence[int],
        tests: Sequence[int],
        least_gain: float,
        seed: int,
    ) -> None:
        """Prepare all columns; `samples` are those of the reference, then of the `new` recordings and the `tests`."""
        super().__init__(MOST_CHANGES)
        self._least_gain, self.data, self.samples = least_gain, data, samples
        view = self._view = look(data, samples, least)
        series = self.series = view.series
        # blocks of the new recordings, and those of them that are not learned from [B]
        self.now, self.test = np.isin(series.recording, [*new, *tests]), np.isin(series.recording, tests)
        self.new_recordings = [int(number) for number in np.unique(series.recording[self.now & ~self.test])]
        force = samples.grid.forces(view.predicted.recordings)
        then, now = (np.unique(series.recording[side]).tolist() for side in (~self.now, self.now))
        self.repeats = find_repeats(series, force, then, now)
        shift = self._level_shift() @ np.linalg.pinv(moment_arms(data))
        residual = samples.residual(data)
        background, scale = background_columns(data, series, force - shift, view.columns, residual, seed)
        shared = np.concatenate([view.nominal, background], axis=2)
        self._shared = less_reference(shared, series, self.repeats)
        self._target = less_reference(series.target, series, self.repeats)
        self._scale = np.concatenate([view.scale, scale])
        self.numbers = numbers_of(data)
        self._values = self._both() * self.now[:, None, None]
        # without blocks that nothing is learned from
        self._informative = replace(series, used=series.used & ~outside(series, self.repeats))
        learned = replace(self._informative, used=self._informative.used & ~self.test)
        self.folds, self.judged = folds_of_sides(learned, self.now)
        self.candidates = self._candidates()
        self._known: dict[bytes, tuple[Products, Flags]] = {}
        self.tried = len({candidate.where for candidate in self.candidates})
        self._selection: Selection | None = None
        self._whole = self.error

    def _candidates(self) -> list[Candidate]:
        count, own = self._view.columns.values.shape[2], len(self.numbers)
        missing = [replace(each, mix=np.pad(each.mix, ((0, own), (0, 0)))) for each in self._view.candidates]
        present = number_hypotheses(self.numbers, count + own, count)
        return sorted([*missing, *present], key=lambda candidate: candidate.level)

    def _both(self) -> Array:
        """Return the columns of what the description lacks, then those of its own numbers [B, n, c + u]."""
        return np.concatenate([self._view.columns.values, self._view.nominal], axis=2)

    def _level_shift(self) -> Numbers:
        """Return by how much the mean residual of each recording differs from that of the reference, N·m [B, n]."""
        left, series = self.torque_left(), self.series
        then, shift = left[series.used & ~self.now].mean(axis=0), np.zeros_like(left)
        for number in np.unique(series.recording[series.used]):
            rows = series.recording == number
            shift[rows] = left[rows & series.used].mean(axis=0) - then
        return shift

    # --- rounds ---

    def _try_next(self, tried: set[str]) -> tuple[Judged, bool] | None:
        best = self._best(tried)
        if best is None or self.selection.gain(best)[0] < self._least_gain:
            return None
        change, certain = self._named(best)
        names = names_with(change.effect, [cause.effect for cause in self.causes])
        if not certain or not self.matters(change.gain.value, self.error, names):
            return change, False
        self.causes.append(change)
        self._settle()
        return change, True

    def _best(self, tried: set[str]) -> Judged | None:
        """Return the candidate that lowers the error most, at the coarsest place that is as good."""
        ranked = self.selection.ranked(tried)
        if not ranked:
            return None
        best = self.selection.refined(ranked[0].effect)
        if best.terms:  # a number that the description has takes precedence over a term that it lacks
            present = next((cause for cause in ranked if not cause.terms), None)
            if present is not None and self._explains_as_much(present, best):
                best = self.selection.refined(present.effect)
        return self._at_best_place(best) if len(self.new_recordings) > 1 else best

    def _explains_as_much(self, cause: Judged, best: Judged) -> bool:
        least = AS_MUCH * (self.selection.base - best.unseen).sum()
        return is_alike(cause.unseen, best.unseen) or (self.selection.base - cause.unseen).sum() >= least

    def _at_best_place(self, best: Judged) -> Judged:
        """Return, of places that are nearly as good, the one with the smallest error."""
        # The size is free in each new recording here, because a growing change differs from one recording to the next.
        options = [best, *self.selection.near(best)]
        if len(options) == 1:
            return best
        products, counted = self._products(None)
        chosen = products.chosen(self._together(self.causes), None)
        recording = self.series.recording[chosen.folds.rows]
        masks = [(recording == number)[:, None, None] for number in self.new_recordings]
        candidates = chosen.table[:, :, chosen.nominal_count :]
        columns = [candidates @ option.mix.astype(np.float32) for option in options]
        own = [np.concatenate([column * mask for mask in masks], axis=2) for column in columns]
        every = chosen.with_own(np.concatenate(own, axis=2))
        grams = Grams(every, self._target_now(), self._scales(self.causes), counted)
        ways = np.split(np.eye(every.count), np.cumsum([part.shape[2] for part in own])[:-1], axis=1)
        errors = [
            grams.error(way, *(np.tile(end, len(masks)) for end in (option.low, option.high)))[0]
            for option, way in zip(options, ways, strict=True)
        ]
        return options[int(np.argmin(errors))]

    def _named(self, cause: Judged) -> tuple[Judged, bool]:
        """Return the change and whether it is certain: a gain of more than two standard errors and a small p-value."""
        grams = self.selection.grams
        _, by_fold = grams.error(cause.mix, cause.low, cause.high)
        gain, error = gain_of(grams.unseen_residual(), grams.unseen_residual(cause.mix, by_fold), grams.counted_stretch)
        p_value, covariance = self.certainty_of(grams, cause.mix)
        alike = self.selection.alike(cause, self.selection.ranked())
        change = replace(cause, covariance=covariance, gain=with_error(gain, error), p_value=p_value, alike=alike)
        return change, gain > CERTAIN * error and p_value < SIGNIFICANCE

    @property
    def error(self) -> float:
        """Root of Σ e² on held-out parts of the new recordings, with the changes so far, N·m."""
        return float(np.sqrt(self.selection.base.sum()))

    def matters(self, gain: float, before: float, names: int) -> bool:
        """Return whether a change gains enough; `names` is how many names count with it."""
        # It must also remove enough of the whole difference, so that small remnants of a large change are not named.
        return gain >= self._least_gain * names and gain * before >= self._least_gain * self._whole

    def _settle(self) -> None:
        for _ in range(STEPS):
            self.causes = self.moved_on(self.grams())
        self._selection = None

    def free(self, keys: Sequence[Where]) -> None:
        """Free these effects at these places in the new recordings, whether they are certain or not."""
        for key in keys:
            grams = self.selection.grams
            own = [candidate for candidate in self.candidates if candidate.where == key]
            if own:
                best = min(own, key=lambda candidate: grams.error(candidate.mix, candidate.low, candidate.high)[0])
                self.causes.append(Judged(**vars(best), magnitudes=np.zeros(best.mix.shape[1])))
                self._settle()

    def certain(self, number: int) -> Judged:
        """Return a change with the covariance and p-value that it has together with all others."""
        change, grams = self.causes[number], self.grams(number)
        mix = change.mix[change.mix.any(axis=1)]  # only its own columns are candidates
        p_value, covariance = self.certainty_of(grams, mix)
        return replace(change, covariance=covariance, p_value=p_value)

    def moved_on(self, grams: Grams) -> list[Judged]:
        """Return the changes with updated magnitudes, from a solution in which their columns are shared."""
        sizes = [len(change.magnitudes) for change in self.causes]
        steps = np.split(grams.refitted[-sum(sizes) :], np.cumsum(sizes)[:-1]) if sizes else []
        return [
            replace(change, magnitudes=np.clip(change.magnitudes + own, change.low, change.high))
            for change, own in zip(self.causes, steps, strict=True)
        ]

    def keep(self, changes: Sequence[Judged]) -> None:
        """Continue with these changes only."""
        self.causes = list(changes)
        self.causes = self.moved_on(self.grams())
        self._selection = None

    # --- looking ---

    @property
    def selection(self) -> Selection:
        """Everything else that may have changed, given the changes so far."""
        if self._selection is None:
            known = {change.effect for change in self.causes}
            left = [candidate for candidate in self.candidates if candidate.effect not in known]
            products, judged = self._products(None)
            chosen = products.chosen(self._together(self.causes), None)
            grams = Grams(chosen, self._target_now(), self._scales(self.causes), judged)
            self._selection = Selection(grams, left, self._view.least)
        return self._selection

    def left(self) -> Numbers:
        """Return what is left with all changes and without what both share, N·m [B, n]; 0 where nothing is used."""
        grams = self.selection.grams
        left = np.zeros_like(self.series.target)
        left[grams.folds.rows] = grams.residual()
        return left

    def grams(self, without: int | None = None, unseen: Flags | None = None) -> Grams:
        """Return the products with the changes' own columns among the shared ones."""
        kept = [change for k, change in enumerate(self.causes) if k != without]
        used = np.zeros(0, dtype=np.intp)
        target = self._target_now()
        if without is not None:
            alone = self.causes[without]
            used = np.flatnonzero(alone.mix.any(axis=1))
            target = target + self._values @ (alone.mix @ alone.magnitudes)
        products, judged = self._products(unseen)
        return Grams(products.chosen(self._together(kept), used), target, self._scales(kept), judged)

    def shares_by_recording(self, number: int) -> list[tuple[float, float]]:
        """Return (value, standard error) for each new recording: which share of a change is in it, 1 for all of it."""
        change, mix, shares = self.causes[number], np.eye(1), []
        column = (self._values @ (change.mix @ change.magnitudes))[:, :, None]
        of = {each: column * (self.series.recording == each)[:, None, None] for each in self.new_recordings}
        kept = [other for k, other in enumerate(self.causes) if k != number]
        target, scale = self._target_now() + column[:, :, 0], np.full(len(of) - 1, np.nan)
        for recording, own in of.items():
            others = [self._values @ self._together(kept), *(of[other] for other in of if other != recording)]
            nominal = np.concatenate([self._shared, *others], axis=2)
            products = Products(self.folds, nominal, own, self.samples.splines)
            grams = Grams(products, target, np.concatenate([self._scales(kept), scale]), self.judged)
            share = grams.magnitudes(mix, *_share_bounds(change))
            _, covariance = self.certainty_of(grams, mix)
            shares.append((float(share[0]), float(np.sqrt(max(covariance[0, 0], 0.0)))))
        return shares

    def _target_now(self) -> Numbers:
        return self._target - self.moved() if self.causes else self._target

    def _together(self, changes: Sequence[Judged]) -> Numbers:
        """Return all columns of the changes [c, k]."""
        empty = np.zeros((self._values.shape[2], 0))
        return np.concatenate([empty, *(change.mix for change in changes)], axis=1)

    def _scales(self, changes: Sequence[Judged]) -> Numbers:
        """Return the scales of the shared columns; columns of changes are free."""
        free = sum(change.mix.shape[1] for change in changes)
        return np.concatenate([self._scale, np.full(free, np.nan)])

    def _products(self, unseen: Flags | None) -> tuple[Products, Flags]:
        """Return the products, computed once for every way of judging."""
        key = b"" if unseen is None else unseen.tobytes()
        if key not in self._known:
            folds, judged = (self.folds, self.judged) if unseen is None else folds_of_unseen(self._informative, unseen)
            self._known[key] = (Products(folds, self._shared, self._values, self.samples.splines), judged)
        return self._known[key]

    def terms(self, changes: Sequence[Judged]) -> list[Term]:
        """Return the terms that changes add to the description of now."""
        return [term for change in changes for term in change.scaled()]

    def added(self, changes: Sequence[Judged]) -> Numbers:
        """Return what changes add to the numbers that the description has [u]."""
        first = self._view.columns.values.shape[2]
        parts = [np.zeros(len(self.numbers)), *((change.mix @ change.magnitudes)[first:] for change in changes)]
        return np.asarray(np.sum(parts, axis=0))

    def now_data(self, changes: Sequence[Judged] | None = None) -> dict[str, Any]:
        """Return the description of now, derived from that of the reference."""
        taken = self.causes if changes is None else changes
        return dict(extended_description(with_numbers(self.data, self.added(taken)), self.terms(taken)))

    def moved(self) -> Numbers:
        """Return what the changes add to the model's torque, N·m [B, n]; 0 in the reference."""
        moved = self.samples.left(self.data) - self.samples.left(self.now_data())
        return np.where(self.now[:, None], moved, 0.0)

    @property
    def informative(self) -> Flags:
        """Blocks that something is learned from [B]."""
        return self._informative.used

    def torque_left(self, means: bool = False) -> Numbers:
        """Return measured less modelled torque, including the bias but without its own jumps, N·m [B, n]."""
        recordings = self.samples.recordings
        whole = [recording.target - exact_model(self.data, recording, jumps=False) for recording in recordings]
        left = self.samples.grid.means(whole)
        if self.causes:
            moved = self.moved()
            mean = 0.0 if means else moved[self.series.used & self.now].mean(axis=0)
            left -= np.where(self.now[:, None], moved - mean, 0.0)
        return np.asarray(left)

    @property
    def stretches_now(self) -> Flags:
        """Whether each stretch belongs to the new recordings [stretches]."""
        flags = np.zeros(self.folds.stretches, dtype=bool)
        flags[self.folds.stretch[self.judged[self.folds.fold]]] = True
        return flags

    def column(self, number: int) -> Numbers:
        """Return the columns of a change, also in the reference [B, n, d]."""
        return np.asarray(self._both() @ self.causes[number].mix)

    # --- certainty ---

    def certainty_of(self, grams: Grams, mix: Numbers) -> tuple[float, Numbers]:
        """Return the p-value of there being no change, corrected for all that was tried, and the covariance [d, d]."""
        # Without bounds: what a size at its bound leaves of a large change is no noise against which the change counts.
        free = np.full(mix.shape[1], np.inf)
        energy, scores = grams.scores(mix, grams.error(mix, -free, free)[1])
        inverse = np.linalg.pinv(energy, hermitian=True)
        score = energy @ grams.magnitudes(mix, -free, free)
        spreads = [values.T @ values for values in (scores, _in_twos(scores))]
        squares = [float(score @ np.linalg.pinv(spread, hermitian=True) @ score) for spread in spreads]
        least = int(np.argmin(squares))
        stretches, size = scores.shape
        dof = stretches - 1 - size
        p = float(stats.f.sf(squares[least] * dof / (size * (stretches - 1)), size, dof)) if dof > 0 else 1.0
        return min(1.0, p * self.tried), np.asarray(inverse @ spreads[least] @ inverse)


def _share_bounds(change: Judged) -> tuple[Numbers, Numbers]:
    """Return the bounds of the share [1] within which all magnitudes are within theirs."""
    moved = change.magnitudes != 0.0
    size = change.magnitudes[moved]
    ends = np.sort(np.stack([change.low[moved] / size, change.high[moved] / size]), axis=0)
    return np.array([ends[0].max(initial=-np.inf)]), np.array([ends[1].min(initial=np.inf)])


def _in_twos(values: Numbers) -> Numbers:
    """Return sums of neighbours [K / 2, d]."""
    even = len(values) // 2 * 2
    return np.concatenate([values[:even].reshape(-1, 2, values.shape[1]).sum(axis=1), values[even:]])


# --- gains ------------------------------------------------------------------------------------------------------------


def gain_of(before: Numbers, after: Numbers, stretch: NDArray[np.int64]) -> tuple[float, float]:
    """Return 1 − rms after / rms before, and its standard error, with the motion taken as given."""
    # The difference that a change makes varies along a motion, but it is known. What is uncertain is the noise on top
    # of it. So the error is that of the product of difference and noise, by stretches. With only a few cycles of a
    # motion, the spread of gains from stretch to stretch would measure how uneven the motion is.
    whole, left = float(np.sum(before**2)), float(np.sum(after**2))
    if whole <= 0.0 or left <= 0.0:
        return 0.0, np.inf
    cross = np.bincount(stretch - stretch.min(), np.sum(after * (before - after), axis=1))
    cross = cross[np.unique(stretch - stretch.min())]
    pairs = cross[: len(cross) // 2 * 2].reshape(-1, 2).sum(axis=1)
    variance = 4.0 * max(float(cross @ cross), float(pairs @ pairs))
    ratio = np.sqrt(left / whole)
    # delta method for left / whole: whole = left + 2 cross + difference², of which only cross is uncertain
    return float(1.0 - ratio), float(np.sqrt(variance) * ratio / (2.0 * whole))


def interval_of(before: Numbers, after: Numbers, stretch: NDArray[np.int64]) -> Interval:
    """Return the gain with its 95 % interval: Student's t with as many degrees of freedom as stretches less one."""
    gain, error = gain_of(before, after, stretch)
    count = len(np.unique(stretch))
    half = float(stats.t.ppf(0.975, max(count - 1, 1))) * error
    return Interval(gain, gain - half, gain + half)
