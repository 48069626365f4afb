"""What a description lacks, as it is reported: the causes, what they gain, what is left and what to record next."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.answer import Asked, Compared, answered, cause_of, not_taken, reported
from tendonfmu.diagnosis.base import Base, forgetful, refitted, remembering
from tendonfmu.diagnosis.contact_scan import detection_gain, event_gain, events_of, reached, without_events
from tendonfmu.diagnosis.delay import DELAY
from tendonfmu.diagnosis.effects import CALIBRATED, CALIBRATION, Place, Term, Where
from tendonfmu.diagnosis.effects.places import law_of
from tendonfmu.diagnosis.extension_fit import (
    CORDS,
    PRESLIDING,
    RELAXATION,
    FittedModel,
    MemoryTerm,
    cause_parameters,
    fit_extended,
    intervals_of,
    memory_of,
    with_known,
    with_part,
)
from tendonfmu.diagnosis.gain import Gain, Unseen, measure_gain
from tendonfmu.diagnosis.names import size_of
from tendonfmu.diagnosis.next_experiment import Experiments, Question, plan_experiments
from tendonfmu.diagnosis.remainder import measure_remainder, remainder_map, unexplained_of
from tendonfmu.diagnosis.result import Cause, CausePlace, Diagnosis, Invisible, Unexplained, by_gain, with_error
from tendonfmu.diagnosis.samples import Samples, Span, as_described, span_of
from tendonfmu.diagnosis.search import FORM, LIKE_A_LAW, ExtensionSearch, calibrated, search, terms_of
from tendonfmu.diagnosis.selection import SIGNIFICANCE, Judged, confirmed, invisible_effects, names_needed, step_p_value
from tendonfmu.estimate import encoder_advice
from tendonfmu.model import extended_row
from tendonfmu.recordings import FitRecording, on_encoders
from tendonfmu.statistics import Interval

# --- gains on unseen data ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Verified:
    """The causes that unseen data confirm."""

    causes: tuple[Judged, ...]  # in order of gain, the largest first; places of one effect are one cause
    places: tuple[tuple[CausePlace, ...], ...]  # of each cause
    intervals: Mapping[str, Interval]  # of the numbers of the extended model, by path
    without: tuple[FittedModel, ...]  # for each cause, the fit that lacks it
    dropped: tuple[Judged, ...]  # causes that unseen data do not confirm
    gain: Gain
    nominal_data: Data  # descriptions as they run online
    extended_data: Data


def merged(causes: Sequence[Judged]) -> list[Judged]:
    """Merge the places of one effect into one cause."""
    by_effect: dict[str, Judged] = {}
    several = max((cause.gain.value for cause in causes if cause.effect == CALIBRATION), default=np.inf)
    # a single sensor that was found beside several belongs to them, unless it explains more than they do
    for cause in sorted(causes, key=lambda cause: cause.effect != CALIBRATION) if several < np.inf else causes:
        belongs = cause.effect in CALIBRATED and cause.gain.value <= several < np.inf
        effect = CALIBRATION if belongs else cause.effect
        known = by_effect.setdefault(effect, cause)
        if known is not cause:
            both = zip(known.where.place, cause.where.place, strict=True)
            by_effect[effect] = replace(
                known,
                where=Where(effect, *(one if one == other else None for one, other in both)),
                terms=(*known.terms, *cause.terms),
                p_value=min(known.p_value, cause.p_value),
                alike=(*known.alike, *cause.alike),
            )
    return [replace(cause, alike=_rivals(cause, by_effect)) for cause in by_effect.values()]


def _rivals(cause: Judged, named: Collection[str]) -> tuple[Judged, ...]:
    """Return the best rival of every effect that is not named itself."""
    rivals: dict[str, Judged] = {}
    for other in cause.alike:
        if other.effect not in named:
            rivals.setdefault(other.effect, other)
    return tuple(rivals.values())


def remembered(causes: Sequence[Judged], part: Judged) -> list[Judged] | None:
    """Return the causes with a part of the memory in presliding, whose name it shares; None if it is none of these."""
    whole = next((cause for cause in causes if cause.effect == PRESLIDING), None)
    if whole is None or part.effect not in (RELAXATION, CORDS):
        return None
    joined = replace(whole, terms=(with_part(whole.terms[0], part.terms[0]),))
    return [joined if cause is whole else cause for cause in causes if cause is not part]


def one_memory(causes: Sequence[Judged]) -> list[Judged]:
    """Return the causes with all parts of a memory as one: a form is chosen because it imitates friction best.

    What else looks like the whole is a part alone, and what looks like cords that stretch is another form of the whole.
    """
    one = list(causes)
    for part in causes:
        one = remembered(one, part) or one
    return [replace(each, alike=(*each.alike, *_other_memory(each))) for each in one]


def _other_memory(cause: Judged) -> Iterator[Judged]:
    names = [PRESLIDING] if cause.effect == CORDS else []
    if cause.effect == PRESLIDING and isinstance(cause.terms[0], MemoryTerm):
        rows = cause.terms[0].rows
        names += [RELAXATION] if any("relaxation_time" in row for row in rows) else []
        names += [CORDS] if any(row["effect"] == CORDS for row in rows) else []
    return (Judged(Where(name), cause.terms) for name in names)


class _Bench:
    """Fits of any set of causes, and what they leave of unseen data."""

    def __init__(
        self, found: ExtensionSearch, training: Sequence[FitRecording], tests: Sequence[FitRecording], seed: int
    ) -> None:
        base = found.base
        self._found, self._settings, self._seed, self._data = found, base.settings, seed, (training, tests)
        self._full, self.nominal, self._samples = found.model, base.nominal, base.samples
        if not tests:  # exclude the judged samples from the fits
            self._samples = Samples.of(self.nominal.data, training, self._settings.threads)
            self._samples = replace(self._samples, drift=self._samples.as_rests_demand(self.nominal.data).drift)
            self._full, self.nominal = (
                refitted(model, self._samples, self._settings) for model in (self._full, self.nominal)
            )
        self._judged = [(each, each.tracked) for each in tests] or [(each, each.held_out) for each in training]
        self._unseen = Unseen(self.nominal.data, training, tests, self._settings.threads)
        self._predicted = self._samples.at_predicted_forces(self._full.data)
        self._fits: dict[frozenset[int], FittedModel] = {frozenset(map(id, terms_of(found.causes))): self._full}
        self._order: dict[frozenset[int], list[Term]] = {next(iter(self._fits)): terms_of(found.causes)}

    def judged(self, least_gain: float, causes: list[Judged]) -> tuple[list[Judged], list[int]]:
        """Return causes with their gains, and which of them are weak.

        A part of the memory that is material but not certain stays in presliding: without it, that may be neither.
        """
        fit, without = self.fit(causes), self.each_without(causes)
        judged = [self.with_gain(cause, model, fit) for cause, model in zip(causes, without, strict=True)]
        needed, shares = names_needed(judged), self.shares_of_memory(fit, without)
        weak = [
            k
            for k, cause in enumerate(judged)
            if not (
                cause.gain.low > 0.0
                and cause.gain.value >= least_gain * needed[k]
                and (shares[k] >= FORM or cause.effect not in LIKE_A_LAW or self._is_of_positions(cause))
                and self._found.base.least.shows_all(cause.effect, cause.terms, fit.data)
            )
        ]
        for part in (judged[k] for k in weak if judged[k].gain.value >= least_gain):
            if joined := remembered(judged, part):
                return self.judged(least_gain, joined)
        return judged, weak

    def verified(self, least_gain: float) -> Verified:
        """Measure the gain of each cause on unseen data and drop the weak ones."""
        judge = partial(self.judged, least_gain)
        kept, dropped = confirmed(merged(self._found.causes), judge)
        causes = one_memory(kept)
        if len(causes) < len(kept):
            causes, weak = confirmed(causes, judge)
            dropped += weak
        if any(cause.effect == PRESLIDING for cause in causes):
            dropped = [cause for cause in dropped if cause.effect not in (RELAXATION, CORDS)]
        ranked, fit, nominal = by_gain(causes), self.fit(causes), self.written(self.nominal)
        places, intervals = self.numbers(fit, causes)
        between = [self.fit(ranked[: k + 1]).data for k in range(len(ranked) - 1)]
        extended = self.written(fit) if causes else nominal
        return Verified(
            causes=tuple(ranked),
            places=tuple(tuple(places[id(term)] for term in cause.terms) for cause in ranked),
            intervals=intervals,
            without=tuple(self.each_without(ranked)),
            dropped=tuple(dropped),
            gain=measure_gain(
                nominal, extended, *self._data, between=between, seed=self._seed, threads=self._settings.threads
            ),
            nominal_data=nominal,
            extended_data=extended,
        )

    def fit(self, causes: Sequence[Judged]) -> FittedModel:
        """Return the fit with some of the causes; it starts at that with all of them."""
        terms = terms_of(causes)
        key = frozenset(map(id, terms))
        if not terms:
            return self.nominal
        if key not in self._fits:
            order = self._order.setdefault(key, terms)
            self._fits[key] = fit_extended(self.nominal, order, self._predicted, self._settings, self._full, rough=True)
        return self._fits[key]

    def each_without(self, causes: Sequence[Judged]) -> list[FittedModel]:
        """Return, for each cause, the fit that lacks it."""
        return [self.fit([*causes[:k], *causes[k + 1 :]]) for k in range(len(causes))]

    @cached_property
    def of_memory(self) -> float:
        """Σ e² on unseen data that the memory of friction explains beside all causes, (N·m)²."""
        plain = forgetful(self._full, self._samples, self._settings)
        return float(np.subtract(*(self._unseen.squares(model.data).sum() for model in (plain, self._full))))

    def shares_of_memory(self, fit: FittedModel, without: Sequence[FittedModel]) -> list[float]:
        """Return the rms that each cause explains over that which the memory explains; inf without one."""
        after = float(self._unseen.squares(fit.data).sum())
        explained = [max(float(self._unseen.squares(model.data).sum()) - after, 0.0) for model in without]
        return [float(np.sqrt(own / self.of_memory)) if self.of_memory > 0.0 else np.inf for own in explained]

    def _is_of_positions(self, cause: Judged) -> bool:
        """Return whether a cause is a delay that positions show."""
        return cause.effect == DELAY.name and self._found.base.positions.delay is not None

    def with_gain(self, cause: Judged, without: FittedModel, model: FittedModel) -> Judged:
        """Return a cause with its gain; one of the base has the p-value of that gain."""
        cause = replace(cause, gain=self._unseen.gain(without.data, model.data, self._seed))
        if self._is_of_positions(cause):
            late = (extended_row(model.data, DELAY.name, Place()) or {}).get("delay", 0.0)
            shown = self._found.base.positions.gain(self._judged, late, self._seed)
            cause = replace(cause, gain=shown, gain_unit="m") if shown.value > cause.gain.value else cause
        if cause.p_value < SIGNIFICANCE:
            return cause
        squares = [self._unseen.squares(each.data) for each in (without, model)]
        return replace(cause, p_value=step_p_value(*squares))

    def numbers(
        self, model: FittedModel, causes: Sequence[Judged]
    ) -> tuple[dict[int, CausePlace], Mapping[str, Interval]]:
        """Return the numbers of each term, by its identity, in a model with all causes, and intervals by path."""
        order = self._order.get(frozenset(map(id, terms_of(causes))), [])
        found = zip(order, cause_parameters(self.nominal.data, order, model), strict=True)
        places = {id(term): CausePlace(*term.place, numbers) for term, numbers in found}
        intervals = intervals_of(model, self._predicted, self._settings) if order else {}
        late = [term for term in order if term.mechanism is DELAY and self._found.base.positions.delay is not None]
        for path, (value, _) in (each for term in late for each in places[id(term)].parameters.items()):
            intervals[path] = with_error(value, self._found.base.positions.error)
        return places, intervals

    def written(self, model: FittedModel) -> Data:
        """Return a description with what is known of its numbers."""
        return with_known(model.data, self._data[0], self._settings)


MOST_RIVALS = 3  # rivals of a cause for which an experiment is planned


class Lacks:
    """What the description lacks, and everything that is reported of it."""

    def __init__(self, asked: Asked, base: Base) -> None:
        self._asked, self._given = asked, asked.given
        self._searched = search(base, least_gain=asked.least_gain, seed=asked.seed, phases=asked.phases)
        self._series = self._searched.view.series

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
            warnings=[*self._warnings(), *self._encoder_advice(gain.extended.test_rms)],
            load_at_joints=samples.grid.means([recording.target for recording in samples.recordings]),
            noise_floor=tuple(float(value) for value in floor),
            floor_source="the part of the error on unseen stretches that nothing recorded predicts",
            **not_taken(
                [
                    cause_of(cause, places=tuple(CausePlace(*term.place, {}) for term in cause.terms))
                    for cause in [*verified.dropped, *searched.small]
                    if cause.effect not in named
                ],
                settling,
                sum(recording.duration for recording in given.tests or given.training),
            ),
            invisible=invisible,
            events=self._events,
            experiment=experiments.best,
            detection=detection_gain(verified.nominal_data, verified.extended_data, everything) if named else None,
            nominal_data=verified.nominal_data,
            extended_data=verified.extended_data,
            tested=len({candidate.where for candidate in searched.view.selection.candidates}),
            event_gain=event_gain(verified.extended_data, given.whole, searched.events),
        )

    def _warnings(self) -> list[str]:
        folds = self._searched.first.folds
        warnings = list(self._searched.model.warnings)
        if not folds.enough:
            warnings.append("less than 8 s of motion: too short to name a cause; record a minute or more")
        elif folds.folds < 8:
            warnings.append(
                f"only {2 * folds.stretches} s of motion: a cause must be larger to be certain; record a minute or more"
            )
        return warnings

    def _encoder_advice(self, left: Sequence[float]) -> list[str]:
        """Return a sentence if joint encoders leave far less of unseen motion; left: rms with tendon positions [n]."""
        given, base, model = self._given, self._searched.base, self._searched.model
        measured = on_encoders(base.nominal.data, [*given.training, *given.tests])
        if not (measured and memory_of(model.data)):
            return []
        training, tests = measured[: len(given.training)], measured[len(given.training) :]
        samples = Samples.of(model.data, training, base.settings.threads).as_rests_demand(model.data)
        # another form of the memory may show in quieter angles
        described = given.finger.with_data(model.data)
        fitted, _ = remembering(described, base.nominal, samples, base.settings, model.fixed)
        by_encoders = Unseen(base.nominal.data, training, tests, base.settings.threads).rms(fitted.data)
        return encoder_advice(np.array(by_encoders), np.array(left))

    # --- gain ---

    def _verified(self) -> Verified:
        searched, given, asked = self._searched, self._given, self._asked
        data, threads = searched.model.data, asked.settings.threads
        each = [Samples.of(data, [recording], threads) for recording in given.tests]
        usual = reached(searched.base.samples.series(data))
        unseen = [events_of(data, samples, asked.seed, usual)[0] for samples in each]
        tests = [without_events(recording, events) for recording, events in zip(given.tests, unseen, strict=True)]
        self._events = (*searched.events, *(event for events in unseen for event in events))
        training = [without_events(recording, searched.events) for recording in given.training]
        return _Bench(searched, training, tests, asked.seed).verified(asked.least_gain)

    # --- causes ---

    def _left(self, data: Mapping[str, Any]) -> Numbers:
        """Return the residual of a model over all recordings that were estimated from, bias removed, N·m [B, n]."""
        return as_described(self._searched.base.samples.residual(data), data)

    def _cause(self, k: int, verified: Verified, after: Numbers) -> Cause:
        cause, places, before = verified.causes[k], verified.places[k], self._left(verified.without[k].data)
        compared = Compared(self._series, before, after, before - after, self._series.used)
        if cause.effect == CALIBRATION:
            return reported(cause, compared, **calibrated(cause, places, verified.intervals))
        size = size_of(cause.effect, places, verified.extended_data)
        return reported(cause, compared, places=places, intervals=verified.intervals, size=size)

    # --- what is left, and what to do next ---

    def _unexplained(self, left: Numbers) -> Unexplained:
        view, samples, used = self._searched.view, self._searched.base.samples, self._series.used
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
        found = self._searched
        pairs = [
            (cause.terms[0], other.terms[0].ordinary)
            for cause in verified.causes
            for other in [rival for rival in cause.alike[:MOST_RIVALS] if rival.effect != CALIBRATION]
        ]
        rivals = [Question(*pair) for pair in pairs if all(self._is_in_nominal(term) for term in pair)]
        known = {term.where for term in terms_of([*verified.causes, *verified.dropped, *found.small])}
        unseen = invisible_effects(found.view.selection, verified.causes, known, self._asked.least_gain)
        nearest: dict[str, Question] = {}
        for candidate, hidden in unseen:
            if self._is_in_nominal(candidate.terms[0]):
                nearest.setdefault(candidate.effect, Question(candidate.terms[0].ordinary, absorbed=hidden.absorbed))
        dropped = [cause for cause in verified.dropped if cause.terms and self._is_in_nominal(cause.terms[0])]
        questions = [*rivals, *nearest.values(), *(Question(cause.terms[0]) for cause in dropped)]
        noise = self._left(found.model.data)[self._series.used].std(axis=0)
        with self._asked.phases.start("next experiment", len(questions) or None) as step:
            planned = plan_experiments(
                found.base.nominal.data,  # without the causes in question
                found.base.samples.recordings,
                questions,
                noise=[float(value) for value in noise],
                seed=self._asked.seed,
                progress=lambda done, total: step(done),
            )
        number_of = {effect: number for number, effect in enumerate(nearest, start=len(rivals))}
        shown = [
            replace(hidden, experiment=planned.sentence(number), motion=planned.motion(number))
            if (number := number_of.get(hidden.where.effect)) is not None
            else hidden
            for _, hidden in unseen
        ]
        settling = {
            cause.where: planned.sentence(k) for k, cause in enumerate(dropped, start=len(rivals) + len(nearest))
        }
        return planned, settling, tuple(shown)

    @cached_property
    def _nominal_span(self) -> Span:
        return span_of(self._searched.base.nominal.data, self._searched.base.samples.recordings)

    def _is_in_nominal(self, term: Term) -> bool:
        """Return whether the nominal description has the place, and the law there that the effect belongs to."""
        nominal = self._searched.base.nominal.data
        if term.place not in term.mechanism.places(nominal, self._searched.base.samples.recordings[0].kinematics):
            return False
        shapes = term.mechanism.find_shapes(nominal, term.place, self._nominal_span)
        return any(law_of(shape) == law_of(term.shape) for shape in shapes)
