"""What a description lacks, as it is reported: the causes, what they gain, what is left and what to record next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.answer import Asked, answered, not_taken, reported
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
from tendonfmu.diagnosis.search import Search, search
from tendonfmu.diagnosis.selection import invisible_effects
from tendonfmu.diagnosis.signal_choice import Estimation
from tendonfmu.diagnosis.sizes import size_of
from tendonfmu.diagnosis.span import Span, span_of
from tendonfmu.diagnosis.view import residual_alone, series_of
from tendonfmu.recordings import FitRecording, make_grid

MOST_RIVALS = 3  # rivals of a cause for which an experiment is planned


def diagnose_extension(asked: Asked, chosen: Estimation) -> Diagnosis:
    """Find what the description lacks."""
    given = asked.given
    searched = search(
        given.finger, given.whole, chosen, least_gain=asked.least_gain, seed=asked.seed, phases=asked.phases
    )
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
            left = self._left(verified.extended)
            before = searched.first.residual
            unexplained = self._unexplained(left, verified.extended)
        experiments, settling, invisible = self._experiments(verified)
        gain, everything = verified.gain, [*given.training, *given.tests]
        floor = np.array(gain.extended.test_rms) * np.sqrt(np.clip(1.0 - np.array(unexplained.by_joint), 0.0, 1.0))
        named = {cause.effect for cause in verified.causes}
        targets = [recording.target for recording in searched.estimation.recordings]
        return answered(
            self._asked,
            searched.estimation,
            gain,
            (self._series, before, left),
            causes=[self._cause(k, verified, left) for k in range(len(verified.causes))],
            unexplained=unexplained,
            warnings=self._warnings(verified, left),
            load_at_joints=searched.estimation.grid.means(targets),
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
            fits_sliding=verified.fits_sliding,
        )

    def _warnings(self, verified: Verified, left: Numbers) -> list[str]:
        folds = self._searched.first.folds
        warnings = list(self._searched.extended.warnings)
        if self._searched.only_sliding:
            warnings.append(self._stuck(verified, left))
        if not folds.enough:
            warnings.append("less than 8 s of motion: too short to name a cause; record a minute or more")
        elif folds.folds < 8:
            warnings.append(
                f"only {2 * folds.stretches} s of motion: a cause must be larger to be certain; record a minute or more"
            )
        return warnings

    def _stuck(self, verified: Verified, left: Numbers) -> str:
        """Say what was done about stuck samples, and what the causes gain in the others."""
        searched, used = self._searched, self._series.used
        sliding, everything = (
            sum(int(recording.train.sum()) for recording in seen) for seen in (searched.fitted_to, searched.everything)
        )
        fitted = (
            "numbers are fitted, and causes and their gains judged," if verified.fits_sliding else "causes are judged"
        )
        before, after = (
            1e3 * float(np.sqrt(np.mean(residual[used] ** 2))) for residual in (self._left(searched.nominal.data), left)
        )
        return (
            f"a joint or tendon sticks in {100 * (1 - sliding / everything):.0f} % of the samples, where "
            f"friction takes any value that balances the load: {fitted} only where everything slides. There the error "
            f"falls from {before:.3g} to {after:.3g} mN·m rms (means of 10 ms, without the slow bias); the gain of all "
            "causes together counts all samples"
        )

    # --- gain ---

    def _verified(self) -> Verified:
        searched, given, asked = self._searched, self._given, self._asked
        unseen = [self._events_in(recording) for recording in given.tests]
        tests = [without_events(recording, events) for recording, events in zip(given.tests, unseen, strict=True)]
        self._events = (*searched.events, *(event for events in unseen for event in events))
        training = [without_events(recording, searched.events) for recording in given.training]
        return verify(given.finger, searched, training, tests, asked.least_gain, asked.settings, asked.seed)

    def _events_in(self, recording: FitRecording) -> Sequence[Event]:
        data = self._searched.estimation.online(self._searched.extended.data)
        return events_of(data, [recording], make_grid([recording]), self._asked.seed)[0]

    # --- causes ---

    def _left(self, data: Mapping[str, Any]) -> Numbers:
        """Return the residual of a model over all recordings that were estimated from, bias removed, N·m [B, n]."""
        return residual_alone(data, replace(self._searched.estimation.series(data), used=self._series.used))

    def _cause(self, k: int, verified: Verified, after: Numbers) -> Cause:
        cause, before = verified.causes[k], self._left(verified.without[k].data)
        compared = Compared(self._series, before, after, before - after, self._series.used)
        if cause.effect == CALIBRATION:
            return reported(calibrated(cause), compared)
        size = size_of(cause.effect, cause.places, thresholds(verified.extended_data))
        return reported(replace(cause, size=size), compared)

    # --- what is left, and what to do next ---

    def _unexplained(self, left: Numbers, extended: Mapping[str, Any]) -> Unexplained:
        searched, view = self._searched, self._searched.last
        grid, used = searched.estimation.grid, self._series.used
        measured = grid.means([recording.target for recording in searched.estimation.recordings])
        force, torque = grid.forces(view.predicted), measured - left  # the residual itself must be in neither
        remainder = measure_remainder(
            view.series, left, view.splines, force=force, torque=torque, seed=self._asked.seed
        )
        looked_at = everything = np.sum(left[used] ** 2, axis=0)
        if searched.only_sliding:
            series = series_of(extended, searched.everything, grid)
            everything = np.sum(residual_alone(extended, series)[series.used] ** 2, axis=0)
        torques = np.sum((measured[used] - measured[used].mean(axis=0)) ** 2)
        result = unexplained_of(remainder, looked_at, everything, self._asked.least_gain, float(torques))
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
                self._searched.nominal.data,  # without the causes in question
                self._searched.fitted_to,
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
        return span_of(self._searched.nominal.data, self._searched.fitted_to)

    def _is_in_nominal(self, term: Term) -> bool:
        """Return whether the nominal description has the place, and the law there that the effect belongs to."""
        nominal = self._searched.nominal.data
        if term.place not in term.candidate.places(nominal, self._searched.fitted_to[0].kinematics):
            return False
        shapes = term.candidate.find_shapes(nominal, term.place, self._nominal_span)
        return any(law_of(shape) == law_of(term.shape) for shape in shapes)
