"""What has changed since the reference: the same finger, recorded when it was well and recorded now.

The model is fitted to the reference. Errors that it makes in both are not reported. A cause is a change of one of its
numbers, or a term that it lacks, in the new recordings only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy import stats

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.diagnosis.answer import Asked, Compared, answered, cause_of, not_taken, reported
from tendonfmu.diagnosis.base import Base
from tendonfmu.diagnosis.change_search import ChangeSearch, interval_of
from tendonfmu.diagnosis.contact_scan import event_gain, events_of, unusual, without_events
from tendonfmu.diagnosis.effects import Where
from tendonfmu.diagnosis.extension_fit import with_known
from tendonfmu.diagnosis.gain import Gain, measure_gain
from tendonfmu.diagnosis.names import names_in
from tendonfmu.diagnosis.result import (
    Cause,
    CausePlace,
    ChangedSize,
    Diagnosis,
    Event,
    Experiment,
    Invisible,
    SteadyLoad,
    Unexplained,
    by_gain,
    with_error,
)
from tendonfmu.diagnosis.samples import Samples, Series
from tendonfmu.diagnosis.selection import SIGNIFICANCE, Judged, confirmed, invisible_effects, names_needed
from tendonfmu.diagnosis.sizes import sized, with_sizes_by_recording
from tendonfmu.statistics import Interval, gain_interval, make_folds

# --- a steady load ----------------------------------------------------------------------------------------------------


BEYOND = 2.0  # times what the reference itself leaves about its level, or the distance between its recordings
OTHER_SIDE = 0.01  # largest share of stretches whose mean is on the other side


def steady_load(series: Series, left: Numbers, is_now: Flags, seed: int = 0) -> SteadyLoad | None:
    """Return the load at the joint where it is largest; None if no level moved beyond the reference's scatter."""
    loads = []
    for joint in range(left.shape[1]):
        then, now = (_Side.of(series, left[:, joint], series.used & side) for side in (~is_now, is_now))
        if min(len(then.means), len(now.means)) < 2:
            continue
        load = _at(joint, then, now, seed)
        if load is not None:
            loads.append(load)
    best = max(loads, key=lambda load: abs(load.size.change.value), default=None)
    return best and replace(best, p_value=min(1.0, best.p_value * left.shape[1]))


@dataclass(frozen=True)
class _Side:
    """The mean torque of one side."""

    level: float  # mean, N·m
    spread: float  # rms about the level, N·m
    apart: float  # largest distance of a recording's mean from the level, N·m
    means: Numbers  # by stretch of 2 s
    squares: Numbers
    counts: Numbers

    @staticmethod
    def of(series: Series, values: Numbers, used: Flags) -> _Side:
        rows = np.flatnonzero(used)
        if not len(rows):
            return _Side(0.0, 0.0, 0.0, np.zeros(0), np.zeros(0), np.zeros(0))
        own = values[rows]
        level = float(own.mean())
        by_recording = [float(own[series.recording[rows] == k].mean()) for k in np.unique(series.recording[rows])]
        folds = make_folds(replace(series, used=used))
        counts = np.bincount(folds.stretch, minlength=folds.stretches).astype(np.float64)
        sums = [np.bincount(folds.stretch, values[folds.rows] ** k, minlength=folds.stretches) for k in (1, 2)]
        return _Side(
            level,
            float(own.std()),
            max(abs(other - level) for other in by_recording),
            np.asarray(sums[0] / counts, dtype=np.float64),
            np.asarray(sums[1], dtype=np.float64),
            counts,
        )

    @property
    def error(self) -> float:
        """Standard error of the level."""
        return float(np.std(self.means, ddof=1) / np.sqrt(len(self.means)))

    def about(self, level: float) -> Numbers:
        """Return Σ (x − level)² by stretch [K]."""
        return np.asarray(self.squares - 2.0 * level * self.means * self.counts + level**2 * self.counts)


def _at(joint: int, then: _Side, now: _Side, seed: int) -> SteadyLoad | None:
    moved = now.level - then.level
    if abs(moved) <= BEYOND * max(then.spread, then.apart):
        return None
    if float(np.mean(np.sign(now.means - then.level) != np.sign(moved))) > OTHER_SIDE:
        return None
    gain = gain_interval(now.about(then.level), now.about(now.level), seed)
    if not gain.low > 0.0:  # NaN where too little is left to say
        return None
    error = float(np.hypot(then.error, now.error))
    levels = (with_error(then.level, then.error), with_error(now.level, now.error), with_error(moved, error))
    size = ChangedSize("torque", "N.m", *levels)
    p_value = float(stats.ttest_ind(then.means, now.means, equal_var=False).pvalue)
    return SteadyLoad(joint + 1, size, gain, p_value)


LEAST_UNKNOWN = 0.25  # of the rms: recordings of an unchanged finger differ by this much
LEVEL = 0.001  # significance level of this difference
SPREAD = 2.0  # standard deviations over the stretches of the reference: other motions have another error
FEWEST = 4  # least number of stretches on either side
REPEAT = "Repeat the motions of the reference exactly, at the same load and pretension."


def diagnose_change(asked: Asked, base: Base) -> Diagnosis:
    """Find what has changed since the reference."""
    return _Changes(asked, base).diagnosis()


def sizes_now(asked: Asked, base: Base, keys: Sequence[Where]) -> list[tuple[Where, ChangedSize]]:
    """Return how large these effects are in the new recordings, named or not."""
    return _Changes(asked, base).sizes(keys)


class _Changes:
    """Everything that is reported of a change."""

    def __init__(self, asked: Asked, base: Base) -> None:
        self._asked, self._given, self._base = asked, asked.given, base
        self._reference = list(base.samples.recordings)
        self._now, self._held, self._tests = (
            list(each) for each in (asked.given.whole, asked.given.training, asked.given.tests)
        )
        everything = [*self._reference, *self._now, *self._tests]
        samples = Samples.of(base.model.data, everything, asked.settings.threads)
        self._all = samples.as_rests_demand(base.model.data)

    def diagnosis(self) -> Diagnosis:
        """Return the diagnosis; its duration is still 0."""
        phases = self._asked.phases
        with phases.start("contact"):
            samples = self._without_events()
        with phases.start("changes") as step:
            self._search = self._searching(samples)
            self._search.run(step)
        with phases.start("gain on unseen data"):
            dropped = self._verified()
            return self._result(dropped)

    def sizes(self, keys: Sequence[Where]) -> list[tuple[Where, ChangedSize]]:
        """Return the sizes of effects at places in the new recordings, all of them free."""
        search = self._search = self._searching(self._without_events())
        search.free(keys)
        search.causes = [search.certain(k) for k in range(len(search.causes))]
        return [(change.where, sized(search, k)["changed"]) for k, change in enumerate(search.causes)]

    def _without_events(self) -> Samples:
        """Return the samples without contact and stalls."""
        names = {str(recording.path) for recording in self._all.recordings[len(self._reference) :]}
        events, out = events_of(self._base.model.data, self._all, self._asked.seed)
        self._events = tuple(event for event in events if event.recording in names)
        self._usual = tuple(event for event in events if event.recording not in names)
        return self._all.without(out)

    def _changed_events(self) -> Sequence[Event]:
        durations = [sum(recording.duration for recording in side) for side in (self._now, self._reference)]
        return unusual(self._events, self._usual, durations[0] / durations[1])

    def _searching(self, samples: Samples) -> ChangeSearch:
        first, last = len(self._reference), len(self._reference) + len(self._now)
        now, tests = range(first, last), range(last, len(samples.recordings))
        asked = self._asked
        return ChangeSearch(self._base.model.data, samples, self._base.least, now, tests, asked.least_gain, asked.seed)

    # --- verified on unseen data ---

    def _verified(self) -> list[Judged]:
        """Drop the changes that unseen data do not confirm, and return them."""
        search = self._search
        # blocks of tests [B]; without tests, the held-out parts of the new recordings are judged in turn
        unseen = search.test if self._given.tests else None

        def judge(changes: list[Judged]) -> tuple[list[Judged], list[int]]:
            if len(changes) < len(search.causes):
                search.keep(changes)
            grams = search.grams(unseen=unseen)
            after, stretch = grams.unseen_residual(), grams.counted_stretch
            without = [search.grams(k, unseen).unseen_residual() for k in range(len(search.causes))]
            gains = [interval_of(left, after, stretch) for left in without]
            judged = [replace(change, gain=gain) for change, gain in zip(search.causes, gains, strict=True)]
            needed = names_needed(judged)
            weak = [
                k
                for k, (cause, left) in enumerate(zip(judged, without, strict=True))
                if not cause.gain.low > 0.0
                or search.certain(k).p_value >= SIGNIFICANCE
                or not search.matters(
                    cause.gain.value, search.error * float(np.linalg.norm(left) / np.linalg.norm(after)), needed[k]
                )
            ]
            return judged, weak

        changes, dropped = confirmed(search.causes, judge)
        search.keep(by_gain(replace(search.certain(k), gain=change.gain) for k, change in enumerate(changes)))
        return dropped

    # --- the models ---

    def _learned(self) -> list[Judged]:
        """Return the changes as learned without the samples that they are judged on."""
        search = self._search
        held = np.zeros(len(search.series.time), dtype=bool)
        for segment in self._all.grid.segments:
            number = segment.recording - len(self._reference)
            if 0 <= number < len(self._held):
                held[segment.blocks] = segment.mean(self._held[number].held_out[segment.part]) > 0.0
        if not held.any() or not search.causes:
            return search.causes
        return search.moved_on(search.grams(unseen=held))

    def _written(self, changes: Sequence[Judged]) -> Data:
        """Return the reference model with changes, with what is known of its numbers."""
        return with_known(self._search.now_data(changes), self._given.whole, self._asked.settings)

    # --- what is reported ---

    def _result(self, dropped: Sequence[Judged]) -> Diagnosis:
        given, search = self._given, self._search
        learned = self._learned()
        models = [self._search.now_data(learned[:k]) for k in range(len(learned) + 1)]
        gain = self._measured(models)
        harmful = [k for k, (one, other) in enumerate(pairwise(gain.steps)) if other > one]
        if harmful:  # it helps together with what is wrong in both, but not alone
            k = harmful[-1]
            dropped = [*dropped, search.causes[k]]
            search.keep([*search.causes[:k], *search.causes[k + 1 :]])
            return self._result(dropped)
        compared = self._compared()
        causes = [
            reported(search.causes[k], own, **with_sizes_by_recording(search, k, sized(search, k)))
            for k, own in enumerate(compared)
        ]
        views, load = self._views(), self._load()
        return answered(
            self._asked,
            gain,
            (self._now_series(), *views),
            causes=causes,
            unexplained=self._unexplained(),
            warnings=self._warnings(),
            noise_floor=tuple(float(value) for value in np.minimum(self._floor(), gain.extended.test_rms)),
            floor_source="what remains on unseen stretches without the errors that both recordings share",
            **not_taken(
                [
                    cause_of(change, confusable_with=(), places=(CausePlace(*change.where.place, {}),))
                    for change in [*dropped, *search.refused]
                ],
                {},
                sum(recording.duration for recording in given.tests or self._held),
            ),
            invisible=self._invisible(),
            events=self._events,
            experiment=Experiment(self._next(causes)),
            detection=None,
            nominal_data=self._written(()),
            extended_data=self._written(search.causes),
            tested=search.tried,
            event_gain=event_gain(models[-1], given.whole, self._changed_events()),
            kind="change",
            load=load,
            repeated=len(search.repeats),
        )

    def _measured(self, models: Sequence[Data]) -> Gain:
        """Return the gains of a sequence of models as they run online."""
        now, tests = (
            [without_events(recording, self._events) for recording in recordings]
            for recordings in (self._given.training, self._given.tests)
        )
        asked = self._asked
        return measure_gain(
            models[0], models[-1], now, tests, between=models[1:-1], seed=asked.seed, threads=asked.settings.threads
        )

    def _compared(self) -> list[Compared]:
        """Return, for each change, what is left without it and with it."""
        search = self._search
        left = search.left()  # with all changes, without the background
        now, reference = search.informative & search.now, search.informative & ~search.now
        compared = []
        for k, change in enumerate(search.causes):
            added = search.column(k) @ change.magnitudes
            added = added - added[search.series.used].mean(axis=0)
            compared.append(Compared(search.series, left + added, left, added, now, reference))
        return compared

    def _now_series(self) -> Series:
        series = self._search.series
        return replace(series, used=series.used & self._search.now)

    def _views(self) -> tuple[Numbers, Numbers]:
        """Return what the reference model leaves of all recordings, without the changes and with them, N·m [B, n]."""
        search = self._search
        before = search.samples.residual(search.data)
        return before, search.samples.residual(search.now_data()) if search.causes else before

    def _warnings(self) -> list[str]:
        folds, judged = self._search.folds, self._search.judged
        now = int(judged.sum())
        warnings = []
        # a motion that the reference has exactly is compared with it sample by sample
        if now < 4 or (folds.folds - now < 4 and not self._search.repeats):
            warnings.append(
                "less than 16 s of the reference or of the new recordings can be compared (free of contact, similar "
                "loads), so only a large change can be certain; record a minute of the same motion for both"
            )
        return warnings

    def _unexplained(self) -> Unexplained:
        """Return whether the new recordings, with all changes, are explained worse than the reference is by itself."""
        search = self._search
        squares, rows = search.grams().left()
        is_now = search.stretches_now
        if is_now.sum() < FEWEST or (~is_now).sum() < FEWEST:
            return Unexplained(0.0, "", tuple(0.0 for _ in range(squares.shape[1])))
        level = np.log(np.maximum(squares / rows[:, None], 1e-300)) / 2.0  # of the rms
        p_values = stats.ttest_ind(level[is_now], level[~is_now], equal_var=False, alternative="greater").pvalue
        now, then = (np.sqrt(squares[side].sum(axis=0) / rows[side].sum()) for side in (is_now, ~is_now))
        worse = np.clip(1.0 - then / np.maximum(now, 1e-300), 0.0, 1.0)
        p_value = min(1.0, float(np.nanmin(p_values)) * len(worse))
        worst = int(np.argmax(worse * now))
        apart = float(level[is_now, worst].mean() - level[~is_now, worst].mean())
        beyond = apart > SPREAD * float(level[~is_now, worst].std())
        unknown = bool(worse[worst] >= LEAST_UNKNOWN and p_values[worst] * len(worse) < LEVEL and beyond)
        share = tuple(float(1.0 - (1.0 - share) ** 2) if unknown else 0.0 for share in worse)
        gain = Interval(0.0, 0.0, 0.0)
        if unknown:
            spread = float(np.sqrt(sum(np.var(level[s, worst], ddof=1) / s.sum() for s in (is_now, ~is_now))))
            ends = [1.0 - (1.0 - float(worse[worst])) * np.exp(sign * 1.96 * spread) for sign in (1.0, -1.0)]
            gain = Interval(float(worse[worst]), float(ends[0]), float(ends[1]))
        joint = names_in(search.data).joint(worst + 1)
        words = f"the model fits {joint} worse in the new recordings than in the reference; no known change explains it"
        whole = float(np.array(share) @ now**2 / max(float((now**2).sum()), 1e-300))
        return Unexplained(whole, words if unknown else "", share, p_value, unknown, gain)

    def _load(self) -> SteadyLoad | None:
        """Return what remains of a load both with and without the means of the changes."""
        search = self._search
        loads: list[SteadyLoad] = []
        for means in (False, True) if search.causes else (False,):
            load = steady_load(search.series, search.torque_left(means), search.now, self._asked.seed)
            if load is None:
                return None
            loads.append(load)
        return min(loads, key=lambda load: abs(load.size.change.value))

    def _floor(self) -> Numbers:
        """Return the rms of the new recordings, N·m [n]."""
        squares, rows = self._search.selection.grams.left()
        is_now = self._search.stretches_now
        return np.asarray(np.sqrt(squares[is_now].sum(axis=0) / max(float(rows[is_now].sum()), 1.0)))

    def _invisible(self) -> tuple[Invisible, ...]:
        return tuple(replace(hidden, experiment=REPEAT) for _, hidden in invisible_effects(self._search.selection))

    def _next(self, causes: Sequence[Cause]) -> str:
        search = self._search
        pulls = any(not tendon.get("bidirectional") for tendon in self._given.finger.data["tendons"])
        if any(cause.confusable_with for cause in causes) and pulls:
            return (
                f"{REPEAT} Then repeat them at half and at twice the pretension: effects that grow with the tendon "
                "force then differ from those that do not."
            )
        if not search.repeats and (causes or self._invisible()):
            return f"{REPEAT} Then their difference shows the change alone."
        return ""
