"""What a description lacks, as it is reported: the causes, what they gain, what is left and what to record next."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.answer import Asked, Compared, answered, not_taken, reported
from tendonfmu.diagnosis.base import Base, refitted
from tendonfmu.diagnosis.contact_scan import detection_gain, event_gain, events_of, without_events
from tendonfmu.diagnosis.effects import CALIBRATED, CALIBRATION, COMMON, OF_LAW, Term, Where
from tendonfmu.diagnosis.effects.places import law_of, thresholds
from tendonfmu.diagnosis.experiments.next_experiment import Experiments, Question, plan_experiments
from tendonfmu.diagnosis.extension_fit import (
    PRESLIDING,
    FittedModel,
    cause_parameters,
    fit_extended,
    intervals_of,
    with_known,
)
from tendonfmu.diagnosis.gain import Gain, Unseen, measure_gain
from tendonfmu.diagnosis.remainder import measure_remainder, remainder_map, unexplained_of
from tendonfmu.diagnosis.result import Cause, CausePlace, Diagnosis, Event, Invisible, Unexplained
from tendonfmu.diagnosis.samples import Samples, Span, as_described, span_of
from tendonfmu.diagnosis.search import Search, calibrated, search, terms_of
from tendonfmu.diagnosis.selection import SIGNIFICANCE, by_gain, confirmed, invisible_effects, names_with, step_p_value
from tendonfmu.diagnosis.sizes import size_of
from tendonfmu.estimate import SCALING
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import Interval

# --- gains on unseen data ---------------------------------------------------------------------------------------------


# Of the rms that a memory explains: another form of it explains so much more. What depends on the same motions and
# loads as friction, or scales the torque, resembles that.
FORM = 0.07
LIKE_A_LAW = {*OF_LAW, *SCALING} - {*COMMON}


@dataclass(frozen=True)
class Verified:
    """The causes that unseen data confirm."""

    causes: tuple[Cause, ...]  # in order of gain, the largest first; places of one effect are one cause
    without: tuple[FittedModel, ...]  # for each cause, the fit that lacks it
    dropped: tuple[Cause, ...]  # causes that unseen data do not confirm
    gain: Gain
    nominal_data: Data  # descriptions as they run online
    extended_data: Data


def verify(
    result: Search, training: Sequence[FitRecording], tests: Sequence[FitRecording], least_gain: float, seed: int
) -> Verified:
    """Measure the gain of each cause on unseen data and drop the weak ones."""
    bench = _Bench(result, training, tests, seed)

    def judge(causes: list[Cause]) -> tuple[list[Cause], list[int]]:
        fit, without = bench.fit(causes), bench.each_without(causes)
        gains = [bench.gain(model, fit) for model in without]
        needed, shares = _needed(causes, gains), bench.shares_of_memory(causes, fit, without)
        weak = [
            k
            for k, (cause, gain) in enumerate(zip(causes, gains, strict=True))
            if not (
                gain.low > 0.0
                and gain.value >= least_gain * needed[k]
                and (shares[k] >= FORM or cause.effect not in LIKE_A_LAW)
                and result.base.least.shows_all(cause.effect, cause.terms, fit.data)
            )
        ]
        judged = zip(causes, gains, without, strict=True)
        return [bench.with_gain(cause, gain, model, fit) for cause, gain, model in judged], weak

    causes, dropped = confirmed(merged(result.causes), judge)
    fit, nominal = bench.fit(causes), bench.written(bench.nominal)
    extended = bench.written(fit) if causes else nominal
    ranked = by_gain(bench.with_places(fit, causes))
    between = [bench.fit(ranked[: k + 1]).data for k in range(len(ranked) - 1)]
    return Verified(
        causes=tuple(ranked),
        without=tuple(bench.each_without(ranked)),
        dropped=tuple(dropped),
        gain=measure_gain(
            nominal, extended, training, tests, between=between, seed=seed, threads=result.base.settings.threads
        ),
        nominal_data=nominal,
        extended_data=extended,
    )


def _needed(causes: Sequence[Cause], gains: Sequence[Interval]) -> list[float]:
    """Return how many times the least gain each cause needs: the number of names up to it, the largest gain first."""
    needed, named = [1.0] * len(causes), list[str]()
    for k in sorted(range(len(causes)), key=lambda k: -gains[k].value):
        needed[k] = names_with(causes[k].effect, named)
        named.append(causes[k].effect)
    return needed


def merged(causes: Sequence[Cause]) -> list[Cause]:
    """Merge the places of one effect into one cause."""
    by_effect: dict[str, Cause] = {}
    calibrated = CALIBRATED if any(cause.effect == CALIBRATION for cause in causes) else ()
    # a single sensor that was found beside several belongs to them
    for cause in sorted(causes, key=lambda cause: cause.effect != CALIBRATION) if calibrated else causes:
        effect = CALIBRATION if cause.effect in calibrated else cause.effect
        known = by_effect.get(effect)
        if known is None:
            by_effect[effect] = cause
            continue
        joint = known.joint if known.joint == cause.joint else None
        tendon = known.tendon if known.tendon == cause.tendon else None
        by_effect[effect] = replace(
            known,
            where=Where(effect, joint, tendon),
            terms=(*known.terms, *cause.terms),
            p_value=min(known.p_value, cause.p_value),
            alike=(*known.alike, *cause.alike),
        )
    return [replace(cause, alike=_rivals(cause, by_effect)) for cause in by_effect.values()]


def _rivals(cause: Cause, named: Collection[str]) -> tuple[Cause, ...]:
    """Return the best rival of every effect that is not named itself."""
    rivals: dict[str, Cause] = {}
    for other in cause.alike:
        if other.effect not in named:
            rivals.setdefault(other.effect, other)
    return tuple(rivals.values())


class _Bench:
    """Fits of any set of causes, and what they leave of unseen data."""

    def __init__(
        self, result: Search, training: Sequence[FitRecording], tests: Sequence[FitRecording], seed: int
    ) -> None:
        base = result.base
        self._result, self._settings, self._seed = result, base.settings, seed
        self._full, self.nominal, self._samples = result.extended, base.nominal, base.samples
        if not tests:  # exclude the judged samples from the fits
            self._samples = Samples.of(self.nominal.data, training, self._settings.threads)
            self._samples = replace(self._samples, drift=self._samples.as_rests_demand(self.nominal.data).drift)
            self._full, self.nominal = (
                refitted(model, self._samples, self._settings) for model in (self._full, self.nominal)
            )
        self._training = training
        self._unseen = Unseen(self.nominal.data, training, tests, self._settings.threads)
        self._predicted = self._samples.at_predicted_forces(self._full.data)
        self._fits: dict[frozenset[int], FittedModel] = {frozenset(map(id, terms_of(result.causes))): self._full}
        self._order: dict[frozenset[int], list[Term]] = {next(iter(self._fits)): terms_of(result.causes)}

    def fit(self, causes: Sequence[Cause]) -> FittedModel:
        """Return the fit with some of the causes; it starts at that with all of them."""
        terms = terms_of(causes)
        key = frozenset(map(id, terms))
        if not terms:
            return self.nominal
        if key not in self._fits:
            order = self._order.setdefault(key, terms)
            self._fits[key] = fit_extended(self.nominal, order, self._predicted, self._settings, self._full, rough=True)
        return self._fits[key]

    def each_without(self, causes: Sequence[Cause]) -> list[FittedModel]:
        """Return, for each cause, the fit that lacks it."""
        return [self.fit([*causes[:k], *causes[k + 1 :]]) for k in range(len(causes))]

    def shares_of_memory(
        self, causes: Sequence[Cause], fit: FittedModel, without: Sequence[FittedModel]
    ) -> list[float]:
        """Return the rms that each cause explains over that which the memory of friction explains; inf without one."""
        after = float(self._unseen.squares(fit.data).sum())
        explained = [max(float(self._unseen.squares(model.data).sum()) - after, 0.0) for model in without]
        of_memory = sum(own for own, cause in zip(explained, causes, strict=True) if cause.effect == PRESLIDING)
        return [float(np.sqrt(own / of_memory)) if of_memory else np.inf for own in explained]

    def gain(self, without: FittedModel, model: FittedModel) -> Interval:
        return self._unseen.gain(without.data, model.data, self._seed)

    def with_gain(self, cause: Cause, gain: Interval, without: FittedModel, model: FittedModel) -> Cause:
        """Return a cause with its gain; one of the base has the p-value of that gain."""
        if cause.p_value < SIGNIFICANCE:
            return replace(cause, gain=gain)
        p_value = step_p_value(self._unseen.squares(without.data), self._unseen.squares(model.data))
        return replace(cause, gain=gain, p_value=p_value)

    def with_places(self, model: FittedModel, causes: Sequence[Cause]) -> list[Cause]:
        """Return the causes with the numbers of each of their places in a model that was fitted with all of them."""
        order = self._order.get(frozenset(id(term) for cause in causes for term in cause.terms), [])
        found = cause_parameters(self.nominal.data, order, model)
        numbers = {id(term): own for term, own in zip(order, found, strict=True)}
        intervals = intervals_of(model, self._predicted, self._settings) if order else {}
        return [
            replace(
                cause,
                intervals=intervals,
                places=tuple(CausePlace(*term.place, numbers[id(term)]) for term in cause.terms),
            )
            for cause in causes
        ]

    def written(self, model: FittedModel) -> Data:
        """Return a description with what is known of its numbers."""
        return with_known(model.data, self._training, self._settings)


MOST_RIVALS = 3  # rivals of a cause for which an experiment is planned


def diagnose_extension(asked: Asked, base: Base) -> Diagnosis:
    """Find what the description lacks."""
    searched = search(base, least_gain=asked.least_gain, seed=asked.seed, phases=asked.phases)
    return _Result(asked, searched).diagnosis()


class _Result:
    """Everything that is reported of a search."""

    def __init__(self, asked: Asked, searched: Search) -> None:
        self._asked, self._given, self._searched = asked, asked.given, searched
        self._series = searched.last.series

    def diagnosis(self) -> Diagnosis:
        """Return the diagnosis; its duration is still 0."""
        searched, given = self._searched, self._given
        with self._asked.phases.start("gain on unseen data"):
            verified = self._verified()
        with self._asked.phases.start("what is left"):
            left = self._left(verified.extended_data)
            before = searched.first.residual
            unexplained = self._unexplained(left)
        experiments, settling, invisible = self._experiments(verified)
        gain, everything = verified.gain, [*given.training, *given.tests]
        floor = np.array(gain.extended.test_rms) * np.sqrt(np.clip(1.0 - np.array(unexplained.by_joint), 0.0, 1.0))
        named = {cause.effect for cause in verified.causes}
        samples = searched.base.samples
        return answered(
            self._asked,
            gain,
            (self._series, before, left),
            causes=[self._cause(k, verified, left) for k in range(len(verified.causes))],
            unexplained=unexplained,
            warnings=self._warnings(),
            load_at_joints=samples.grid.means([recording.target for recording in samples.recordings]),
            noise_floor=tuple(float(value) for value in floor),
            floor_source="the part of the error on unseen stretches that nothing recorded predicts",
            **not_taken(
                [cause for cause in [*verified.dropped, *searched.small] if cause.effect not in named],
                settling,
                sum(recording.duration for recording in given.tests or given.training),
            ),
            invisible=invisible,
            events=self._events,
            experiment=experiments.best,
            detection=detection_gain(verified.nominal_data, verified.extended_data, everything) if named else None,
            nominal_data=verified.nominal_data,
            extended_data=verified.extended_data,
            tested=len({cause.where for cause in searched.last.selection.causes}),
            event_gain=event_gain(verified.extended_data, given.whole, searched.events),
        )

    def _warnings(self) -> list[str]:
        folds = self._searched.first.folds
        warnings = list(self._searched.extended.warnings)
        if not folds.enough:
            warnings.append("less than 8 s of motion: too short to name a cause; record a minute or more")
        elif folds.folds < 8:
            warnings.append(
                f"only {2 * folds.stretches} s of motion: a cause must be larger to be certain; record a minute or more"
            )
        return warnings

    # --- gain ---

    def _verified(self) -> Verified:
        searched, given, asked = self._searched, self._given, self._asked
        unseen = [self._events_in(recording) for recording in given.tests]
        tests = [without_events(recording, events) for recording, events in zip(given.tests, unseen, strict=True)]
        self._events = (*searched.events, *(event for events in unseen for event in events))
        training = [without_events(recording, searched.events) for recording in given.training]
        return verify(searched, training, tests, asked.least_gain, asked.seed)

    def _events_in(self, recording: FitRecording) -> Sequence[Event]:
        data = self._searched.extended.data
        return events_of(data, Samples.of(data, [recording], self._asked.settings.threads), self._asked.seed)[0]

    # --- causes ---

    def _left(self, data: Mapping[str, Any]) -> Numbers:
        """Return the residual of a model over all recordings that were estimated from, bias removed, N·m [B, n]."""
        return as_described(self._searched.base.samples.residual(data), data)

    def _cause(self, k: int, verified: Verified, after: Numbers) -> Cause:
        cause, before = verified.causes[k], self._left(verified.without[k].data)
        compared = Compared(self._series, before, after, before - after, self._series.used)
        if cause.effect == CALIBRATION:
            return reported(calibrated(cause), compared)
        size = size_of(cause.effect, cause.places, thresholds(verified.extended_data))
        return reported(replace(cause, size=size), compared)

    # --- what is left, and what to do next ---

    def _unexplained(self, left: Numbers) -> Unexplained:
        view, samples, used = self._searched.last, self._searched.base.samples, self._series.used
        measured = samples.grid.means([recording.target for recording in samples.recordings])
        # the residual itself must be in neither
        force, torque = samples.grid.forces(view.predicted.recordings), measured - left
        remainder = measure_remainder(
            view.series, left, samples.splines, force=force, torque=torque, seed=self._asked.seed
        )
        torques = np.sum((measured[used] - measured[used].mean(axis=0)) ** 2)
        result = unexplained_of(remainder, np.sum(left[used] ** 2, axis=0), self._asked.least_gain, float(torques))
        finger = self._given.finger
        parts = (view.series, left, remainder, finger.joint_names, finger.tendon_names)
        shown = remainder_map(*parts) if result.unknown else None
        return replace(result, map=shown)

    def _experiments(self, verified: Verified) -> tuple[Experiments, dict[Where, str], tuple[Invisible, ...]]:
        """Plan experiments for causes that cannot be distinguished or are uncertain, and for effects not visible."""
        rivals = [
            Question(cause.terms[0], rival)
            for cause in verified.causes
            for rival in [other.terms[0].ordinary for other in cause.alike[:MOST_RIVALS] if other.effect != CALIBRATION]
            if all(self._is_in_nominal(term) for term in (cause.terms[0], rival))
        ]
        known = [*verified.causes, *verified.dropped, *self._searched.small]
        unseen = invisible_effects(self._searched.last.selection, verified.causes, known, self._asked.least_gain)
        nearest: dict[str, Question] = {}
        for cause, hidden in unseen:
            if self._is_in_nominal(cause.terms[0]):
                nearest.setdefault(cause.effect, Question(cause.terms[0].ordinary, absorbed=hidden.absorbed))
        dropped = [cause for cause in verified.dropped if cause.terms and self._is_in_nominal(cause.terms[0])]
        questions = [*rivals, *nearest.values()]
        first = len(questions)
        questions += [Question(cause.terms[0]) for cause in dropped]
        noise = self._left(self._searched.extended.data)[self._series.used].std(axis=0)
        with self._asked.phases.start("next experiment", len(questions) or None) as step:
            planned = plan_experiments(
                self._searched.base.nominal.data,  # without the causes in question
                self._searched.base.samples.recordings,
                questions,
                noise=[float(value) for value in noise],
                seed=self._asked.seed,
                progress=lambda done, total: step(done),
            )
        number_of = {effect: len(rivals) + k for k, effect in enumerate(nearest)}
        shown = []
        for cause, hidden in unseen:
            number = number_of.get(cause.effect)
            if number is not None:
                hidden = replace(hidden, experiment=planned.sentence(number), motion=planned.motion(number))
            shown.append(hidden)
        settling = {cause.where: planned.sentence(first + k) for k, cause in enumerate(dropped)}
        return planned, settling, tuple(shown)

    @cached_property
    def _nominal_span(self) -> Span:
        return span_of(self._searched.base.nominal.data, self._searched.base.samples.recordings)

    def _is_in_nominal(self, term: Term) -> bool:
        """Return whether the nominal description has the place, and the law there that the effect belongs to."""
        nominal = self._searched.base.nominal.data
        if term.place not in term.candidate.places(nominal, self._searched.base.samples.recordings[0].kinematics):
            return False
        shapes = term.candidate.find_shapes(nominal, term.place, self._nominal_span)
        return any(law_of(shape) == law_of(term.shape) for shape in shapes)
