"""What is different now: the changes to the reference model that lower the error on new recordings.

All recordings are explained together. They share the model's numbers, the effects that it lacks in both, and a
background of the motion (`background.py`). A hypothesis is free in the new recordings only. It is a number that the
description has, or a term that it lacks. The error is that on held-out parts of the new recordings.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import stats

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.diagnosis.candidate_columns import candidate_columns
from tendonfmu.diagnosis.cause_search import bias_of, blocks_of, nominal_scale, predicted_of, residual_alone, series_of
from tendonfmu.diagnosis.cause_selection import CERTAIN, Judged, Selection, is_alike, names_with
from tendonfmu.diagnosis.changes.background import background_columns
from tendonfmu.diagnosis.changes.gain import gain_of
from tendonfmu.diagnosis.changes.numbers import changed, number_hypotheses, numbers_of
from tendonfmu.diagnosis.changes.repeated_motion import find_repeats, less_reference, outside
from tendonfmu.diagnosis.extension_fit import Accepted, extended_description
from tendonfmu.diagnosis.hypotheses import Hypothesis, Key, hypotheses
from tendonfmu.diagnosis.least_sizes import LeastSizes
from tendonfmu.diagnosis.named_cause import accepted_of
from tendonfmu.diagnosis.search import SIGNIFICANCE
from tendonfmu.diagnosis.series import Grid, Series, block_prediction, exact_model
from tendonfmu.model import moment_arms
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import Folds, Grams, Products, make_folds
from tendonfmu.tasks import Step

MOST_CHANGES = 4
MOST_REFUSED = 4
STEPS = 3  # of Newton's method, with the derivatives of the reference


@dataclass(frozen=True)
class Change:
    """A change that was found."""

    hypothesis: Hypothesis  # what and where
    magnitudes: Numbers  # [d] and [d, d]
    covariance: Numbers
    gain: float  # 1 − rms with / rms without on held-out parts of the new recordings, and its standard error
    error: float
    p_value: float  # family-wise
    alike: tuple[Hypothesis, ...] = ()  # what the data cannot distinguish from it, best first


@dataclass(frozen=True)
class Sides:
    """Which blocks belong to which recordings."""

    now: Flags  # blocks of the new recordings [B]
    test: Flags  # those of them that are not learned from [B]


class ChangeSearch:
    """A search that adds one change after the other."""

    def __init__(
        self,
        data: Data,
        recordings: Sequence[FitRecording],
        grid: Grid,
        least: LeastSizes,
        now: Sequence[int],
        tests: Sequence[int] = (),
        left_out: Flags | None = None,
        seed: int = 0,
    ) -> None:
        """Prepare all columns."""
        # left_out: [B]
        self.data, self._recordings, self._grid, self._least = data, recordings, grid, least
        self.series = series_of(data, recordings, grid, left_out)
        self.sides = Sides(np.isin(self.series.recording, [*now, *tests]), np.isin(self.series.recording, tests))
        self._new = {*now, *tests}
        self.changes: list[Change] = []
        self._splines = bias_of(data, self.series)
        residual = residual_alone(data, self.series)
        predicted = predicted_of(data, recordings, grid, self.series)
        self._columns = candidate_columns(data, predicted, blocks_of(grid, recordings), worth=least.worth)
        force = np.concatenate(
            [
                segment.mean(predicted[segment.recording].recording.groups["tendon_force"][segment.part])
                for segment in grid.segments
            ]
        )
        then = sorted(set(np.unique(self.series.recording).tolist()) - self._new)
        self._repeats = find_repeats(self.series, force, then, sorted(self._new))
        shift = self._level_shift() @ np.linalg.pinv(moment_arms(data))
        background, scale = background_columns(data, self.series, force - shift, self._columns, residual, seed)
        shared = np.concatenate([self._columns.nominal, background], axis=2)
        self._shared = less_reference(shared, self.series, self._repeats)
        self._target = less_reference(self.series.target, self.series, self._repeats)
        self._scale = np.concatenate([nominal_scale(data), scale])
        self.numbers = numbers_of(data)
        both = np.concatenate([self._columns.values, self._columns.nominal], axis=2)
        self._values = both * self.sides.now[:, None, None]
        self._informative = replace(self.series, used=self.series.used & ~outside(self.series, self._repeats))
        learned = replace(self._informative, used=self._informative.used & ~self.sides.test)
        self.folds, self.judged = folds_of_sides(learned, self.sides.now)
        self.hypotheses = self._hypotheses()
        self._known: dict[bytes, tuple[Products, Flags]] = {}
        self.tried = len({hypothesis.key for hypothesis in self.hypotheses})
        self.refused: list[Change] = []
        self._selection: Selection | None = None
        self._whole = self.error

    def _hypotheses(self) -> list[Hypothesis]:
        count, own = self._columns.values.shape[2], len(self.numbers)
        reach = np.abs(self.series.angle[self.series.used]).max(axis=0, initial=0.0)
        missing = [
            replace(hypothesis, mix=np.concatenate([hypothesis.mix, np.zeros((own, hypothesis.mix.shape[1]))]))
            for hypothesis in hypotheses(self._columns, moment_arms(self.data), reach)
        ]
        present = number_hypotheses(self.numbers, count + own, count)
        return sorted([*missing, *present], key=lambda judged: judged.level)

    def _level_shift(self) -> Numbers:
        """Return by how much the mean residual of each recording differs from that of the reference, N·m [B, n]."""
        left, series = self.torque_left(), self.series
        then = left[series.used & ~self.sides.now].mean(axis=0)
        shift = np.zeros_like(left)
        for number in np.unique(series.recording):
            rows = series.recording == number
            own = left[rows & series.used]
            shift[rows] = own.mean(axis=0) - then if len(own) else 0.0
        return shift

    # --- rounds ---

    def run(self, least_gain: float, step: Step = lambda done: None) -> None:
        """Take one change after the other until none is material and certain."""
        while len(self.changes) < MOST_CHANGES and len(self.refused) < MOST_REFUSED:
            step(len(self.changes))
            named = [change.hypothesis.effect for change in self.changes]
            judged = self._best({change.hypothesis.effect for change in self.refused})
            if judged is None or self.selection.gain(judged)[0] < least_gain:
                break
            change, certain = self._judged(judged)
            enough = self.matters(change.gain, self.error, judged.hypothesis.effect, named, least_gain)
            if certain and enough:
                self._take(change)
            else:
                self.refused.append(change)

    def _best(self, tried: Collection[str]) -> Judged | None:
        """Return the hypothesis that lowers the error most, at the coarsest place that is as good."""
        ranked = [judged for judged in self.selection.ranked() if judged.hypothesis.effect not in tried]
        if not ranked:
            return None
        judged = self.selection.refined(ranked[0].hypothesis.effect)
        if judged.hypothesis.members:  # a number that the description has takes precedence over a term that it lacks
            present = (judged for judged in ranked if not judged.hypothesis.members)
            same = next((other for other in present if is_alike(other.by_stretch, judged.by_stretch)), None)
            judged = judged if same is None else self.selection.refined(same.hypothesis.effect)
        return self._at_best_place(judged) if len(self.new_recordings) > 1 else judged

    def _at_best_place(self, judged: Judged) -> Judged:
        """Return, of places that are nearly as good, the one with the smallest error."""
        # The size is free in each new recording here, because a growing change differs from one recording to the next.
        options = [judged, *self.selection.near(judged)]
        if len(options) == 1:
            return judged
        products, counted = self._products(None)
        chosen = products.chosen(self._together(self.changes), None)
        u = chosen.nominal_count
        recording = self.series.recording[chosen.folds.rows]
        masks = [(recording == number)[:, None, None] for number in self.new_recordings]
        parts, places, at = [], [], 0
        for option in options:
            column = chosen.table[:, :, u:] @ option.hypothesis.mix.astype(np.float32)
            own = np.concatenate([column * mask for mask in masks], axis=2)
            parts.append(own)
            places.append(slice(at, at + own.shape[2]))
            at += own.shape[2]
        every = chosen.with_own(np.concatenate(parts, axis=2))
        grams = Grams(every, self._target_now(), self._scales(self.changes), counted)
        errors = []
        for option, place in zip(options, places, strict=True):
            mix = np.eye(at)[:, place]
            low, high = (np.tile(end, len(masks)) for end in (option.hypothesis.low, option.hypothesis.high))
            errors.append(grams.error(mix, low, high)[0])
        return options[int(np.argmin(errors))]

    def _judged(self, judged: Judged) -> tuple[Change, bool]:
        """Return the change and whether it is certain: a gain of more than two standard errors and a small p-value."""
        grams, own = self.selection.grams, judged.hypothesis
        _, by_fold = grams.error(own.mix, own.low, own.high)
        gain, error = gain_of(grams.unseen_residual(), grams.unseen_residual(own.mix, by_fold), grams.counted_stretch)
        p_value, covariance = self.certainty_of(grams, own.mix, judged.magnitudes, by_fold)
        others = [judged for judged in self.selection.ranked() if judged.hypothesis.effect != own.effect]
        alike = tuple(other.hypothesis for other in others if is_alike(other.by_stretch, judged.by_stretch))
        change = Change(own, judged.magnitudes, covariance, gain, error, p_value, alike)
        return change, gain > CERTAIN * error and p_value < SIGNIFICANCE

    @property
    def error(self) -> float:
        """Root of Σ e² on held-out parts of the new recordings, with the changes so far, N·m."""
        return float(np.sqrt(self.selection.base.sum()))

    def matters(self, gain: float, before: float, effect: str, named: Sequence[str], least_gain: float) -> bool:
        """Return whether a change gains enough."""
        # It must also remove enough of the whole difference, so that small remnants of a large change are not named.
        return gain >= least_gain * names_with(effect, named) and gain * before >= least_gain * self._whole

    def _take(self, change: Change) -> None:
        self.changes.append(change)
        self._settle()

    def _settle(self) -> None:
        for _ in range(STEPS):
            self.changes = self.moved_on(self.grams())
        self._selection = None

    def free(self, keys: Sequence[Key]) -> None:
        """Free these effects at these places in the new recordings, whether they are certain or not."""
        for key in keys:
            grams = self.selection.grams
            own = [hypothesis for hypothesis in self.hypotheses if hypothesis.key == key]
            if own:
                best = min(own, key=lambda hypothesis: grams.error(hypothesis.mix, hypothesis.low, hypothesis.high)[0])
                nothing = np.zeros(best.mix.shape[1])
                self.changes.append(Change(best, nothing, np.diag(nothing), 0.0, np.inf, 1.0))
                self._settle()

    def certain(self, number: int) -> Change:
        """Return a change with the covariance and p-value that it has together with all others."""
        change, grams = self.changes[number], self.grams(number)
        own = change.hypothesis
        mix = own.mix[own.mix.any(axis=1)]  # only its own columns are candidates
        _, by_fold = grams.error(mix, own.low, own.high)
        magnitudes = grams.magnitudes(mix, own.low, own.high)
        p_value, covariance = self.certainty_of(grams, mix, magnitudes, by_fold)
        return replace(change, covariance=covariance, p_value=p_value)

    def moved_on(self, grams: Grams) -> list[Change]:
        """Return the changes with updated magnitudes, from a solution in which their columns are shared."""
        sizes = [len(change.magnitudes) for change in self.changes]
        steps = np.split(grams.refitted[-sum(sizes) :], np.cumsum(sizes)[:-1]) if sizes else []
        return [
            replace(change, magnitudes=np.clip(change.magnitudes + own, change.hypothesis.low, change.hypothesis.high))
            for change, own in zip(self.changes, steps, strict=True)
        ]

    def keep(self, changes: Sequence[Change]) -> None:
        """Continue with these changes only."""
        self.changes = list(changes)
        self.changes = self.moved_on(self.grams())
        self._selection = None

    # --- looking ---

    @property
    def selection(self) -> Selection:
        """Everything else that may have changed, given the changes so far."""
        if self._selection is None:
            self._selection = self._look()
        return self._selection

    def _look(self) -> Selection:
        known = {change.hypothesis.effect for change in self.changes}
        left = [hypothesis for hypothesis in self.hypotheses if hypothesis.effect not in known]
        products, judged = self._products(None)
        chosen = products.chosen(self._together(self.changes), None)
        return Selection(Grams(chosen, self._target_now(), self._scales(self.changes), judged), left, self._least)

    @property
    def new_recordings(self) -> list[int]:
        """Numbers of the new recordings that are learned from."""
        learned = self.sides.now & ~self.sides.test
        return [int(number) for number in np.unique(self.series.recording[learned])]

    def left(self) -> Numbers:
        """Return what is left with all changes and without what both share, N·m [B, n]; 0 where nothing is used."""
        grams = self.selection.grams
        left = np.zeros_like(self.series.target)
        left[grams.folds.rows] = grams.residual()
        return left

    def grams(self, without: int | None = None, unseen: Flags | None = None) -> Grams:
        """Return the products with the changes' own columns among the shared ones."""
        kept = [change for k, change in enumerate(self.changes) if k != without]
        used = np.zeros(0, dtype=np.intp)
        target = self._target_now()
        if without is not None:
            alone = self.changes[without]
            used = np.flatnonzero(alone.hypothesis.mix.any(axis=1))
            target = target + self._values @ self._mixed(alone)
        products, judged = self._products(unseen)
        return Grams(products.chosen(self._together(kept), used), target, self._scales(kept), judged)

    def grams_of_recording(self, number: int, only: int) -> Grams:
        """Return the products with one change in one new recording as the only candidate."""
        change = self.changes[number]
        column = (self._values @ self._mixed(change))[:, :, None]
        of = {
            new_recording: column * (self.series.recording == new_recording)[:, None, None]
            for new_recording in self.new_recordings
        }
        kept = [change for k, change in enumerate(self.changes) if k != number]
        shared = [self._values @ self._together(kept), *(of[recording] for recording in of if recording != only)]
        nominal = np.concatenate([self._shared, *shared], axis=2)
        products = Products(self.folds, nominal, of[only], self._splines)
        scale = np.concatenate([self._scales(kept), np.full(len(of) - 1, np.nan)])
        return Grams(products, self._target_now() + column[:, :, 0], scale, self.judged)

    def _target_now(self) -> Numbers:
        return self._target - self.moved() if self.changes else self._target

    def _together(self, changes: Sequence[Change]) -> Numbers:
        """Return all columns of the changes [c, k]."""
        empty = np.zeros((self._values.shape[2], 0))
        return np.concatenate([empty, *(change.hypothesis.mix for change in changes)], axis=1)

    def _scales(self, changes: Sequence[Change]) -> Numbers:
        """Return the scales of the shared columns; columns of changes are free."""
        free = sum(change.hypothesis.mix.shape[1] for change in changes)
        return np.concatenate([self._scale, np.full(free, np.nan)])

    def _products(self, unseen: Flags | None) -> tuple[Products, Flags]:
        """Return the products, computed once for every way of judging."""
        key = b"" if unseen is None else unseen.tobytes()
        if key not in self._known:
            folds, judged = (self.folds, self.judged) if unseen is None else folds_of_unseen(self._informative, unseen)
            self._known[key] = (Products(folds, self._shared, self._values, self._splines), judged)
        return self._known[key]

    def accepted(self, changes: Sequence[Change]) -> list[Accepted]:
        """Return the terms that changes add to the description of now."""
        return [part for change in changes for part in accepted_of(change.hypothesis, change.magnitudes)]

    def added(self, changes: Sequence[Change]) -> Numbers:
        """Return what changes add to the numbers that the description has [u]."""
        first = self._columns.values.shape[2]
        parts = [np.zeros(len(self.numbers)), *(self._mixed(change)[first:] for change in changes)]
        return np.asarray(np.sum(parts, axis=0))

    @staticmethod
    def _mixed(change: Change) -> Numbers:
        return np.asarray(change.hypothesis.mix @ change.magnitudes)

    def now_data(self, changes: Sequence[Change] | None = None) -> dict[str, Any]:
        """Return the description of now, derived from that of the reference."""
        taken = self.changes if changes is None else changes
        return dict(extended_description(changed(self.data, self.added(taken)), self.accepted(taken)))

    def moved(self) -> Numbers:
        """Return what the changes add to the model's torque, N·m [B, n]; 0 in the reference."""
        moved = np.zeros_like(self.series.target)
        segments = tuple(segment for segment in self._grid.segments if segment.recording in self._new)
        rows = np.concatenate([np.arange(segment.blocks.start, segment.blocks.stop) for segment in segments])
        part = replace(self._grid, segments=segments)
        after, before = (block_prediction(data, self._recordings, part) for data in (self.now_data(), self.data))
        moved[rows] = after - before
        return moved

    @property
    def informative(self) -> Flags:
        """Blocks that something is learned from [B]."""
        return self._informative.used

    @property
    def repeated(self) -> int:
        """Number of new recordings that repeat a motion of the reference exactly."""
        return len(self._repeats)

    def torque_left(self, means: bool = False) -> Numbers:
        """Return measured less modelled torque, including the bias but without its own jumps, N·m [B, n]."""
        whole = [recording.target - exact_model(self.data, recording, jumps=False) for recording in self._recordings]
        left = np.concatenate([segment.mean(whole[segment.recording][segment.part]) for segment in self._grid.segments])
        if self.changes:
            moved = self.moved()
            mean = 0.0 if means else moved[self.series.used & self.sides.now].mean(axis=0)
            left -= np.where(self.sides.now[:, None], moved - mean, 0.0)
        return np.asarray(left)

    @property
    def stretches_now(self) -> Flags:
        """Whether each stretch belongs to the new recordings [stretches]."""
        flags = np.zeros(self.folds.stretches, dtype=bool)
        flags[self.folds.stretch[self.judged[self.folds.fold]]] = True
        return flags

    def column(self, number: int) -> Numbers:
        """Return the columns of a change, also in the reference [B, n, d]."""
        both = np.concatenate([self._columns.values, self._columns.nominal], axis=2)
        return np.asarray(both @ self.changes[number].hypothesis.mix)

    # --- certainty ---

    def certainty_of(self, grams: Grams, mix: Numbers, magnitudes: Numbers, by_fold: Numbers) -> tuple[float, Numbers]:
        """Return the p-value of there being no change, corrected for all that was tried, and the covariance [d, d]."""
        energy, scores = grams.scores(mix, by_fold)
        inverse = np.linalg.pinv(energy, hermitian=True)
        score = energy @ magnitudes
        spreads = [values.T @ values for values in (scores, _in_twos(scores))]
        squares = [float(score @ np.linalg.pinv(spread, hermitian=True) @ score) for spread in spreads]
        least = int(np.argmin(squares))
        stretches, size = scores.shape
        dof = stretches - 1 - size
        p = float(stats.f.sf(squares[least] * dof / (size * (stretches - 1)), size, dof)) if dof > 0 else 1.0
        return min(1.0, p * self.tried), np.asarray(inverse @ spreads[least] @ inverse)


def _in_twos(values: Numbers) -> Numbers:
    """Return sums of neighbours [K / 2, d]."""
    even = len(values) // 2 * 2
    return np.concatenate([values[:even].reshape(-1, 2, values.shape[1]).sum(axis=1), values[even:]])


def folds_of_sides(series: Series, is_now: Flags) -> tuple[Folds, Flags]:
    """Return parts of the new recordings, then of the reference, and which of them are of the new ones [f]."""
    now, then = (make_folds(replace(series, used=series.used & side)) for side in (is_now, ~is_now))
    return _joined(now, then), np.arange(now.folds + then.folds) < now.folds


def folds_of_unseen(series: Series, unseen: Flags) -> tuple[Folds, Flags]:
    """Return unseen blocks as one part and all others as the other, and that only the first is judged [2]."""
    both = [make_folds(replace(series, used=series.used & side)) for side in (unseen, ~unseen)]
    one, other = (replace(folds, fold=np.zeros_like(folds.fold), folds=1) for folds in both)
    return _joined(one, other), np.array([True, False])


def _joined(one: Folds, other: Folds) -> Folds:
    return Folds(
        rows=np.concatenate([one.rows, other.rows]),
        run=np.concatenate([one.run, other.run + 1 + one.run.max(initial=-1)]),
        stretch=np.concatenate([one.stretch, other.stretch + one.stretches]),
        fold=np.concatenate([one.fold, other.fold + one.folds]),
        stretches=one.stretches + other.stretches,
        folds=one.folds + other.folds,
    )
