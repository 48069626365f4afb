"""What has changed since the reference: the same finger, recorded when it was well and recorded now.

The model is fitted to the reference. Errors that it makes in both are not reported. A cause is a change of one of its
numbers, or a term that it lacks, in the new recordings only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import stats

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.answer import Asked, Compared, answered, cause_of, not_taken, reported
from tendonfmu.diagnosis.base import Base
from tendonfmu.diagnosis.candidate_columns import with_numbers
from tendonfmu.diagnosis.change_search import ChangeSearch, interval_of
from tendonfmu.diagnosis.contact_scan import event_gain, events_of, unusual, without_events
from tendonfmu.diagnosis.effects import Place, Where
from tendonfmu.diagnosis.effects.mechanism import data_number
from tendonfmu.diagnosis.effects.words import NBSP, quantity
from tendonfmu.diagnosis.extension_fit import added_paths, with_known
from tendonfmu.diagnosis.gain import Gain, measure_gain
from tendonfmu.diagnosis.names import names_in, size_of
from tendonfmu.diagnosis.reference import steady_load
from tendonfmu.diagnosis.result import (
    Cause,
    CausePlace,
    ChangedSize,
    Diagnosis,
    Experiment,
    Invisible,
    SteadyLoad,
    Unexplained,
    by_gain,
    with_error,
)
from tendonfmu.diagnosis.samples import Samples
from tendonfmu.diagnosis.selection import SIGNIFICANCE, Judged, confirmed, invisible_effects, names_needed
from tendonfmu.model import finger_of
from tendonfmu.statistics import Interval

LEAST_UNKNOWN = 0.25  # of the rms: recordings of an unchanged finger differ by this much
LEVEL = 0.001  # significance level of this difference
SPREAD = 2.0  # standard deviations over the stretches of the reference: other motions have another error
FEWEST = 4  # least number of stretches on either side
LEAST_OF_NOW = 0.05  # of the present value: a change from a smaller number is not reported as a share of it
# numbers that say of which form a term is, not how large it is
_FORM = ("stribeck_velocity", "beyond", "turns", "time_constant", "reaction", "rest_angle", "quadratic", "displacement")
REPEAT = "Repeat the motions of the reference exactly, at the same load and pretension."


class Changes:
    """What has changed since the reference, and everything that is reported of it."""

    def __init__(self, asked: Asked, base: Base) -> None:
        self._asked, self._given, self._base = asked, asked.given, base
        self._reference = base.samples.recordings
        everything = [*self._reference, *self._given.whole, *self._given.tests]
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
        """Return how large these effects are in the new recordings, named or not, all of them free."""
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

    def _searching(self, samples: Samples) -> ChangeSearch:
        first = len(self._reference)
        last, asked = first + len(self._given.training), self._asked
        new, tests = range(first, last), range(last, len(samples.recordings))
        return ChangeSearch(self._base.model.data, samples, self._base.least, new, tests, asked.least_gain, asked.seed)

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
        held, training = np.zeros(len(search.series.time), dtype=bool), self._given.training
        for segment in self._all.grid.segments:
            number = segment.recording - len(self._reference)
            if 0 <= number < len(training):
                held[segment.blocks] = segment.mean(training[number].held_out[segment.part]) > 0.0
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
        series, load, before = search.series, self._load(), search.samples.residual(search.data)
        after = search.samples.residual(search.now_data()) if search.causes else before
        durations = [sum(recording.duration for recording in side) for side in (given.training, self._reference)]
        events = unusual(self._events, self._usual, durations[0] / durations[1])
        return answered(
            self._asked,
            gain,
            (replace(series, used=series.used & search.now), before, after),
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
                sum(recording.duration for recording in given.tests or given.training),
            ),
            invisible=self._invisible(),
            events=self._events,
            experiment=Experiment(self._next(causes)),
            detection=None,
            nominal_data=self._written(()),
            extended_data=self._written(search.causes),
            tested=search.tried,
            event_gain=event_gain(models[-1], given.whole, events),
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

    def _warnings(self) -> list[str]:
        folds, judged = self._search.folds, self._search.judged
        now = int(judged.sum())
        # a motion that the reference has exactly is compared with it sample by sample
        if now >= 4 and (folds.folds - now >= 4 or self._search.repeats):
            return []
        return [
            "less than 16 s of the reference or of the new recordings can be compared (free of contact, similar "
            "loads), so only a large change can be certain; record a minute of the same motion for both"
        ]

    def _unexplained(self) -> Unexplained:
        """Return whether the new recordings, with all changes, are explained worse than the reference is by itself."""
        search = self._search
        squares, rows = search.grams().left()
        is_now = search.stretches_now
        if is_now.sum() < FEWEST or (~is_now).sum() < FEWEST:
            return Unexplained(0.0, "", (0.0,) * squares.shape[1])
        level = np.log(np.maximum(squares / rows[:, None], 1e-300)) / 2.0  # of the rms
        p_values = stats.ttest_ind(level[is_now], level[~is_now], equal_var=False, alternative="greater").pvalue
        now, then = (np.sqrt(squares[side].sum(axis=0) / rows[side].sum()) for side in (is_now, ~is_now))
        worse = np.clip(1.0 - then / np.maximum(now, 1e-300), 0.0, 1.0)
        p_value, worst = min(1.0, float(np.nanmin(p_values)) * len(worse)), int(np.argmax(worse * now))
        apart = float(level[is_now, worst].mean() - level[~is_now, worst].mean())
        beyond = apart > SPREAD * float(level[~is_now, worst].std())
        if not (worse[worst] >= LEAST_UNKNOWN and p_values[worst] * len(worse) < LEVEL and beyond):
            return Unexplained(0.0, "", (0.0,) * len(worse), p_value)
        share = 1.0 - (1.0 - worse) ** 2
        spread = float(np.sqrt(sum(np.var(level[s, worst], ddof=1) / s.sum() for s in (is_now, ~is_now))))
        ends = [1.0 - (1.0 - float(worse[worst])) * np.exp(sign * 1.96 * spread) for sign in (1.0, -1.0)]
        joint = names_in(search.data).joint(worst + 1)
        return Unexplained(
            share=float(share @ now**2 / max(float((now**2).sum()), 1e-300)),
            description=f"the model fits {joint} worse in the new recordings than in the reference; no known change "
            "explains it",
            by_joint=tuple(share.tolist()),
            p_value=p_value,
            unknown=True,
            gain=Interval(float(worse[worst]), float(ends[0]), float(ends[1])),
        )

    def _load(self) -> SteadyLoad | None:
        """Return what remains of a load both with and without the means of the changes."""
        search, seed = self._search, self._asked.seed
        ways = (False, True) if search.causes else (False,)
        loads = [steady_load(search.series, search.torque_left(means), search.now, seed) for means in ways]
        known = [load for load in loads if load is not None]
        return min(known, key=lambda load: abs(load.size.change.value)) if len(known) == len(ways) else None

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


# --- how large a change is --------------------------------------------------------------------------------------------


def sized(search: ChangeSearch, number: int) -> dict[str, Any]:
    """Return the size of one of the changes, as fields of `Cause`, estimated together with all others."""
    changes = search.causes
    now = search.now_data()
    units = {path: number.unit for path, number in finger_of(now).numbers.items()}
    if changes[number].terms:
        return _new_term(search, number, now, units)
    then = search.now_data([change for k, change in enumerate(changes) if k != number])
    return _other_number(search, changes[number], then, now, units)


def _relative_error(change: Judged) -> float:
    """Return the standard error of the whole change over its size, along the direction in which it was found."""
    value = float(np.linalg.norm(change.magnitudes))
    direction = change.magnitudes / max(value, 1e-300)
    return math.sqrt(max(float(direction @ change.covariance @ direction), 0.0)) / max(value, 1e-300)


def _new_term(search: ChangeSearch, number: int, now: Data, units: Mapping[str, str]) -> dict[str, Any]:
    """Return the size of a term that the description lacks."""
    changes, change = search.causes, search.causes[number]
    first, terms = len(search.terms(changes[:number])), change.scaled()
    paths = added_paths(with_numbers(search.data, search.added(changes)), search.terms(changes))[first:]
    places = tuple(
        CausePlace(*term.place, {path: (data_number(now, path), units[path]) for path in added if path in units})
        for term, added in zip(terms, paths, strict=False)
    )
    main = _main([path for place in places for path in place.parameters], now)
    unit = units.get(main[0], "1") if main else "1"
    value = math.hypot(*(data_number(now, path) for path in main)) if len(main) > 1 else data_number(now, main[0])
    error = abs(value) * _relative_error(change)
    size, intervals = with_error(value, error), {path: with_error(data_number(now, path), error) for path in main}
    name = "amplitude" if len(main) > 1 else main[0].rsplit(".", 1)[-1]
    words = f"{size_of(change.effect, places, now)}, beyond what the reference has"
    changed = ChangedSize(name, unit, Interval(0.0, 0.0, 0.0), size, size)
    return {"places": places, "changed": changed, "size": words, "intervals": intervals}


def _main(paths: Sequence[str], now: Data) -> list[str]:
    """Return the paths that say how large the term is."""
    waves = [path for path in paths if path.rsplit(".", 1)[-1] in ("sine", "cosine")]
    if waves:
        return waves[:2]
    sizes = [path for path in paths if path.rsplit(".", 1)[-1] not in _FORM] or list(paths)
    return [max(sizes, key=lambda path: abs(data_number(now, path)))]


def _other_number(
    search: ChangeSearch, change: Judged, then: Data, now: Data, units: Mapping[str, str]
) -> dict[str, Any]:
    """Return the size of a number that the description has; `then` is the description of now without this change."""
    by_place: dict[Place, dict[str, tuple[float, str]]] = {}
    for k in np.flatnonzero(change.mix[-len(search.numbers) :].any(axis=1)):
        number = search.numbers[k]
        by_place.setdefault(number.place, {})[number.path] = (data_number(now, number.path), units[number.path])
    places = tuple(CausePlace(*place, numbers) for place, numbers in by_place.items())
    paths = [path for place in places for path in place.parameters]
    main = max(paths, key=lambda path: abs(data_number(now, path) - data_number(then, path)))
    before, after = data_number(then, main), data_number(now, main)
    name, unit, apart = main.rsplit(".", 1)[-1], units[main], change.effect == "asymmetric_friction"
    if apart:
        before, after = _difference(then, main), _difference(now, main)
        name = f"{name}, positive minus negative direction"
    error = abs(after - before) * _relative_error(change)
    more = ""
    if before and abs(before) >= LEAST_OF_NOW * abs(after) and not apart:
        more = f"{100 * ((after - before) / before):+.0f}{NBSP}%: ".replace("-", "−")
    where = f", at the largest of {len(places)} places" if len(places) > 1 else ""
    words = f"{more}{quantity(before, unit)} then, {quantity(after, unit)} now{where}"
    changed = ChangedSize(
        name, unit, with_error(before, 0.0), with_error(after, error), with_error(after - before, error)
    )
    intervals = {main: with_error(data_number(now, main), error)}
    return {"places": places, "changed": changed, "size": words, "intervals": intervals}


def _difference(data: Data, path: str) -> float:
    """Return the difference between the two sides of a law in a number, positive minus negative direction."""
    sign, sides = (1.0, (".positive.", ".negative.")) if ".positive." in path else (-1.0, (".negative.", ".positive."))
    return sign * (data_number(data, path) - data_number(data, path.replace(*sides)))


def with_sizes_by_recording(search: ChangeSearch, number: int, known: dict[str, Any]) -> dict[str, Any]:
    """Add the size in each of several new recordings, in their order."""
    size: ChangedSize = known["changed"]
    if len(search.new_recordings) < 2:
        return known
    moved = size.change.value
    by = [
        with_error(size.reference.value + moved * share, abs(moved) * error)
        for share, error in search.shares_by_recording(number)
    ]
    return known | {"changed": replace(size, by=tuple(by))}
