"""What the simulation of a finger gets wrong, what causes it, and what correcting it gains.

::

    from tendonfmu.diagnosis import diagnose

    found = diagnose("finger.json", ["monday.parquet"], tests=["tuesday.parquet"])
    found.verdict, [cause.where for cause in found.causes], found.gain
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.cause_gains import Verified, verify
from tendonfmu.diagnosis.cause_search import residual_alone, series_of
from tendonfmu.diagnosis.changes.diagnosis import PHASES as CHANGE_PHASES
from tendonfmu.diagnosis.changes.diagnosis import find_changes
from tendonfmu.diagnosis.contact_gain import detection_gain
from tendonfmu.diagnosis.effects import Candidate
from tendonfmu.diagnosis.effects.friction_law_places import law_of, thresholds
from tendonfmu.diagnosis.event_gain import event_gain
from tendonfmu.diagnosis.evidence import evidence
from tendonfmu.diagnosis.experiments.next_experiment import Experiments, Question, plan_experiments
from tendonfmu.diagnosis.extension_fit import Accepted, FitSettings
from tendonfmu.diagnosis.given_case import GivenCase, change_case, given_case, require_motion
from tendonfmu.diagnosis.hypotheses import Hypothesis
from tendonfmu.diagnosis.named_cause import NamedCause
from tendonfmu.diagnosis.remainder import Remainder, measure_remainder
from tendonfmu.diagnosis.residual_views import residual_views, whiteness
from tendonfmu.diagnosis.result import Cause, Diagnosis, Event, FoundPlace, Invisible, Unexplained, Where
from tendonfmu.diagnosis.search import Search, events_of, search, without_events
from tendonfmu.diagnosis.series import make_grid
from tendonfmu.diagnosis.signal_choice import choose
from tendonfmu.diagnosis.size import size_of
from tendonfmu.diagnosis.span import Span, span_of
from tendonfmu.diagnosis.unexplained import unexplained_of
from tendonfmu.diagnosis.unseen_effects import unseen_effects
from tendonfmu.errors import own_fault
from tendonfmu.files import counted
from tendonfmu.model import FingerSource
from tendonfmu.recordings import (
    FitRecording,
    RecordingSource,
)
from tendonfmu.tasks import Phases, PhaseState

LEAST_GAIN = 0.03
MOST_RIVALS = 3  # rivals of a cause for which an experiment is planned
SIGNALS = "signals, delay and presliding"
PHASES = {
    SIGNALS: 20.0,
    "contact": 8.0,
    "causes": 30.0,
    "gain on unseen data": 20.0,
    "what is left": 10.0,
    "next experiment": 12.0,
}


def diagnose(
    finger: FingerSource,
    recordings: RecordingSource | Sequence[RecordingSource],
    tests: RecordingSource | Sequence[RecordingSource] = (),
    *,
    kinematics: int = 1,
    least_gain: float = LEAST_GAIN,
    seed: int = 0,
    jobs: int = 1,
    checked: bool = False,
    reference: RecordingSource | Sequence[RecordingSource] | None = None,
    progress: Callable[[PhaseState], None] | None = None,
) -> Diagnosis:
    """Find what a description lacks; with reference recordings, find what has changed since them."""
    begun = perf_counter()
    if reference is not None:
        phases = Phases(CHANGE_PHASES, progress or (lambda state: None))
        with threadpool_limits(limits=max(jobs, 1)):
            changed = change_case(finger, recordings, reference, tests, kinematics, least_gain, checked)
            with own_fault("diagnosis"):
                different = find_changes(changed, least_gain=least_gain, seed=seed, jobs=jobs, phases=phases)
                return replace(different, seconds=perf_counter() - begun)
    phases = Phases(PHASES, progress or (lambda state: None))
    with threadpool_limits(limits=max(jobs, 1)):
        case = given_case(finger, recordings, tests, kinematics, least_gain, checked)
        require_motion(case.whole)
        with phases.start(SIGNALS):
            chosen = choose(case.finger, case.whole, FitSettings(threads=jobs, path=case.finger.path))
        with own_fault("diagnosis"):  # all input has been checked and fitted once
            searched = search(case.finger, case.whole, chosen, least_gain=least_gain, seed=seed, phases=phases)
            result = _Result(case, searched, least_gain, seed, jobs, phases)
            return replace(result.diagnosis(), seconds=perf_counter() - begun)


# --- what is reported -------------------------------------------------------------------------------------------------


class _Result:
    """Everything that is reported of a search."""

    def __init__(
        self, case: GivenCase, searched: Search, least_gain: float, seed: int, jobs: int, phases: Phases
    ) -> None:
        self._case, self._searched, self._seed, self._phases = case, searched, seed, phases
        self._least_gain, self._settings = least_gain, FitSettings(threads=jobs, path=case.finger.path)
        self._series = searched.last.series

    def diagnosis(self) -> Diagnosis:
        """Return the diagnosis; its duration is still 0."""
        searched, case = self._searched, self._case
        with self._phases.start("gain on unseen data"):
            verified = self._verified()
        with self._phases.start("what is left"):
            left = self._left(verified.extended)
            before = searched.first.residual
            remainder = self._remainder(left)
            unexplained = self._unexplained(remainder, left, verified.extended)
        experiments, invisible = self._experiments(verified)
        gain = verified.gain
        share = np.array(unexplained.by_joint)
        everything = [*case.training, *case.tests]
        floor = np.array(gain.extended.test_rms) * np.sqrt(np.clip(1.0 - share, 0.0, 1.0))
        return Diagnosis(
            finger=case.finger.name,
            verdict=_verdict(bool(verified.causes), unexplained.unknown),
            recordings=tuple(str(recording.path) for recording in case.training),
            tests=tuple(str(recording.path) for recording in case.tests),
            held_out=gain.held_out,
            seconds=0.0,
            seed=self._seed,
            signals=searched.estimation.words,
            least_gain=self._least_gain,
            nominal=gain.nominal,
            extended=gain.extended,
            bias_only_rms=gain.bias_only_rms,
            noise_floor=tuple(float(value) for value in floor),
            floor_source="the part of the error on unseen stretches that nothing recorded predicts",
            gain=gain.value,
            steps=gain.steps,
            causes=tuple(self._cause(k, verified, left) for k in range(len(verified.causes))),
            too_small=tuple(
                _too_small(each)
                for each in [*verified.dropped, *searched.small]
                if each.effect not in {cause.effect for cause in verified.causes}
            ),
            invisible=invisible,
            events=self._events,
            unexplained=unexplained,
            experiment=experiments.best,
            views=residual_views(self._series, before, left, load=self._torque()),
            whiteness=whiteness(self._series, before, left),
            detection=detection_gain(verified.nominal_data, verified.extended_data, everything)
            if verified.causes
            else None,
            nominal_data=verified.nominal_data,
            extended_data=verified.extended_data,
            warnings=(*case.warnings, *self._warnings(verified, left)),
            tested=len({hypothesis.key for hypothesis in searched.last.selection.hypotheses}),
            event_gain=event_gain(verified.extended_data, case.whole, searched.events),
            smoothing=searched.estimation.signals,
            fits_sliding=verified.fits_sliding,
        )

    def _warnings(self, verified: Verified, left: Numbers) -> list[str]:
        folds = self._searched.first.folds
        warnings = list(self._searched.extended.warnings)
        if self._searched.only_sliding:
            warnings.append(self._stuck(verified, left))
        if not folds.enough:
            warnings.append("less than 8 s of motion: nothing can be held out, so no cause is named; record a minute")
        elif folds.folds < 8:
            warnings.append(
                f"only {counted(folds.stretches, 'stretch', 'stretches')} of 2 s: "
                f"{folds.folds} parts are held out in place of 8, so a cause "
                "has to be larger to be certain; record a minute"
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
            f"something is stuck in {100 * (1 - sliding / everything):.0f} % of the samples, in which "
            f"friction balances the load and misleads a fit: {fitted} where everything slides. There the error falls "
            f"from {before:.3g} to {after:.3g} mN·m rms (means of 10 ms, without the slow bias); the gain of all "
            "causes together counts all samples"
        )

    # --- gain ---

    def _verified(self) -> Verified:
        searched, case = self._searched, self._case
        tests = case.tests
        unseen = [self._events_in(recording) for recording in tests]
        tests = [without_events(recording, events) for recording, events in zip(tests, unseen, strict=True)]
        self._events = (*searched.events, *(event for events in unseen for event in events))
        training = [without_events(recording, searched.events) for recording in case.training]
        return verify(case.finger, searched, training, tests, self._least_gain, self._settings, self._seed)

    def _events_in(self, recording: FitRecording) -> Sequence[Event]:
        data = self._searched.estimation.online(self._searched.extended.data)
        return events_of(data, [recording], make_grid([recording]), self._seed)[0]

    # --- causes ---

    def _left(self, data: Mapping[str, Any]) -> Numbers:
        """Return the residual of a model over all recordings that were estimated from, bias removed, N·m [B, n]."""
        estimation = self._searched.estimation
        series = series_of(data, estimation.recordings, estimation.grid)
        return residual_alone(data, replace(series, used=self._series.used))

    def _cause(self, k: int, verified: Verified, after: Numbers) -> Cause:
        named, parameters = verified.causes[k], verified.parameters[k]
        everything = {path: value for own in parameters for path, value in own.items()}
        before = self._left(verified.without[k].data)
        candidate = named.accepted[0].candidate
        places = tuple(
            FoundPlace(term.place.joint, term.place.tendon, own)
            for term, own in zip(named.accepted, parameters, strict=True)
        )
        return Cause(
            where=Where(named.effect, named.joint, named.tendon),
            title=candidate.title,
            explanation=candidate.explanation,
            p_value=named.p_value,
            gain=verified.gains[k],
            confusable_with=_wheres(named.alike),
            parameters=everything,
            size=size_of(candidate.name, places, thresholds(verified.extended_data)),
            places=places,
            evidence=evidence([term.place for term in named.accepted], candidate, self._series, before, after),
        )

    # --- what is left, and what to do next ---

    def _remainder(self, residual: Numbers) -> Remainder:
        view = self._searched.last
        force = [
            segment.mean(view.predicted[segment.recording].recording.groups["tendon_force"][segment.part])
            for segment in self._searched.estimation.grid.segments
        ]
        return measure_remainder(view.series, residual, view.splines, force=np.concatenate(force), seed=self._seed)

    def _unexplained(self, remainder: Remainder, left: Numbers, extended: Mapping[str, Any]) -> Unexplained:
        searched = self._searched
        looked_at = np.sum(left[self._series.used] ** 2, axis=0)
        if not searched.only_sliding:
            return unexplained_of(remainder, looked_at, looked_at, self._least_gain)
        series = series_of(extended, searched.everything, searched.estimation.grid)
        everything = np.sum(residual_alone(extended, series)[series.used] ** 2, axis=0)
        return unexplained_of(remainder, looked_at, everything, self._least_gain)

    def _torque(self) -> Numbers:
        """Return the torque to be explained, N·m [B, n]."""
        estimation = self._searched.estimation
        return np.concatenate(
            [
                segment.mean(estimation.recordings[segment.recording].target[segment.part])
                for segment in estimation.grid.segments
            ]
        )

    def _experiments(self, verified: Verified) -> tuple[Experiments, tuple[Invisible, ...]]:
        """Plan experiments for causes that cannot be distinguished and for effects that are not visible."""
        nominal = self._searched.nominal.data
        rivals = [
            Question(cause.accepted[0], rival)
            for cause in verified.causes
            for rival in [_ordinary(other) for other in cause.alike[:MOST_RIVALS]]
            if all(self._is_in_nominal(term) for term in (cause.accepted[0], rival))
        ]
        known = [*verified.causes, *verified.dropped, *self._searched.small]
        unseen = unseen_effects(self._searched.last.selection, verified.causes, known, self._least_gain)
        nearest: dict[str, Hypothesis] = {}
        for hidden in unseen:
            if self._is_in_nominal(_ordinary(hidden.hypothesis)):
                nearest.setdefault(hidden.hypothesis.effect, hidden.hypothesis)
        asked = list(nearest)
        questions = [*rivals, *(Question(_ordinary(nearest[effect])) for effect in asked)]
        noise = self._left(self._searched.extended.data)[self._series.used].std(axis=0)
        with self._phases.start("next experiment", len(questions) or None) as step:
            planned = plan_experiments(
                nominal,  # without the causes in question
                self._searched.fitted_to,
                questions,
                noise=[float(value) for value in noise],
                seed=self._seed,
                progress=lambda done, total: step(done),
            )
        said = {
            effect: (planned.sentence(len(rivals) + k), planned.motion(len(rivals) + k))
            for k, effect in enumerate(asked)
        }
        return planned, tuple(
            Invisible(
                where_of(hidden.hypothesis),
                _candidate(hidden.hypothesis).title,
                hidden.share,
                *said.get(hidden.hypothesis.effect, ("", {})),
                ordinary_gain=hidden.gain,
                needed_gain=hidden.needed,
            )
            for hidden in unseen
        )

    @cached_property
    def _nominal_span(self) -> Span:
        return span_of(self._searched.nominal.data, self._searched.fitted_to)

    def _is_in_nominal(self, effect: Accepted) -> bool:
        """Return whether the nominal description has the place, and the law there that the effect belongs to."""
        nominal = self._searched.nominal.data
        if effect.place not in effect.candidate.places(nominal, self._searched.fitted_to[0].kinematics):
            return False
        shapes = effect.candidate.find_shapes(nominal, effect.place, self._nominal_span)
        return any(law_of(shape) == law_of(effect.shape) for shape in shapes)


def where_of(hypothesis: Hypothesis) -> Where:
    return Where(hypothesis.effect, hypothesis.joint, hypothesis.tendon)


def _wheres(hypotheses: Sequence[Hypothesis]) -> tuple[Where, ...]:
    return tuple(where_of(hypothesis) for hypothesis in hypotheses)


def _candidate(hypothesis: Hypothesis) -> Candidate:
    return hypothesis.members[0].proposal.candidate


def _ordinary(hypothesis: Hypothesis) -> Accepted:
    """Return an effect of ordinary size, at its first place."""
    member = hypothesis.members[0]
    return Accepted(member.proposal.candidate, member.proposal.place, dict(member.shape.shape))


def _too_small(named: NamedCause) -> Cause:
    """Return a cause that is certain but not material or not confirmed on unseen data."""
    candidate = named.accepted[0].candidate
    return Cause(
        where=Where(named.effect, named.joint, named.tendon),
        title=candidate.title,
        explanation=candidate.explanation,
        p_value=named.p_value,
        gain=named.interval,
        confusable_with=_wheres(named.alike),
        parameters={},
        size="",
        places=tuple(FoundPlace(term.place.joint, term.place.tendon, {}) for term in named.accepted),
    )


def _verdict(causes: bool, unknown: bool) -> str:
    if causes:
        return "partly explained" if unknown else "explained"
    return "unexplained" if unknown else "adequate"
