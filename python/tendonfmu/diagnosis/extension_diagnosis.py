"""What a description lacks, as it is reported: the causes, what they gain, what is left and what to record next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.answer import Asked, answered, not_taken, reported
from tendonfmu.diagnosis.base import Base
from tendonfmu.diagnosis.calibration import calibrated
from tendonfmu.diagnosis.cause import Cause, Key
from tendonfmu.diagnosis.cause_gains import Verified, verify
from tendonfmu.diagnosis.contact_gain import detection_gain
from tendonfmu.diagnosis.contact_scan import event_gain, events_of, without_events
from tendonfmu.diagnosis.effects import CALIBRATION, Term
from tendonfmu.diagnosis.effects.places import law_of, thresholds
from tendonfmu.diagnosis.experiments.next_experiment import Experiments, Question, plan_experiments
from tendonfmu.diagnosis.pictures import Compared
from tendonfmu.diagnosis.remainder import measure_remainder, unexplained_of
from tendonfmu.diagnosis.remainder_map import remainder_map
from tendonfmu.diagnosis.result import Diagnosis, Event, Invisible, Unexplained
from tendonfmu.diagnosis.samples import Samples, as_described
from tendonfmu.diagnosis.search import Search, search
from tendonfmu.diagnosis.selection import invisible_effects
from tendonfmu.diagnosis.sizes import size_of
from tendonfmu.diagnosis.span import Span, span_of
from tendonfmu.recordings import FitRecording

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
            tested=len({cause.key for cause in searched.last.selection.causes}),
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

    def _experiments(self, verified: Verified) -> tuple[Experiments, dict[Key, str], tuple[Invisible, ...]]:
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
        settling = {cause.key: planned.sentence(first + k) for k, cause in enumerate(dropped)}
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
