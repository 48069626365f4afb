"""What the simulation of a finger gets wrong, what causes it, and what is gained by mending it.

from tendonfmu.diagnosis import diagnose

found = diagnose("finger.json", ["monday.parquet"], tests=["tuesday.parquet"])
found.verdict, [cause.where for cause in found.causes], found.gain
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from tendonfmu.cause_search import LEAST_SHARE, View, bias_of, series_of
from tendonfmu.contact_gain import detection_gain
from tendonfmu.description import FingerDescription, read_finger
from tendonfmu.diagnosis_evidence import evidence
from tendonfmu.diagnosis_result import Cause, Diagnosis, Invisible, Unexplained, Where
from tendonfmu.diagnosis_search import (
    NamedCause,
    Search,
    candidate_of,
    search,
    without_events,
)
from tendonfmu.diagnosis_series import Series, Trial, make_grid
from tendonfmu.diagnosis_size import size_of
from tendonfmu.errors import InputError
from tendonfmu.extension_fit import Accepted, FitSettings, fit_extended
from tendonfmu.fit_recordings import FitRecording, Held, prepare, require_noise
from tendonfmu.gain import Gain, measure_gain
from tendonfmu.next_experiment import Experiments, Question, plan_experiments
from tendonfmu.noise_floor import noise_floor
from tendonfmu.nominal_fit import fitted
from tendonfmu.recording import Recording, read_recording
from tendonfmu.remainder import Remainder, measure_remainder
from tendonfmu.residual_views import residual_views, whiteness
from tendonfmu.significance import Problem, residual_of

Numbers = NDArray[np.float64]
Finger = FingerDescription | str | os.PathLike[str]
Source = Recording | str | os.PathLike[str]
Phase = Callable[[str, int, int | None], None]

HELD = Held(0.2, 10.0)  # of the recordings, for the gain, where no others are given
MOST_RIVALS = 3  # of a cause, that an experiment is looked for


def diagnose(
    finger: Finger,
    recordings: Sequence[Source],
    tests: Sequence[Source] = (),
    *,
    kinematics: int = 1,
    seed: int = 0,
    jobs: int = 1,
    progress: Phase | None = None,
) -> Diagnosis:
    """Finds what a description lacks (contract section 7).

    finger: description, or its file. recordings: of contact-free motion; samples labelled contact are left out. tests:
    recordings that the gain is measured on; without them every fifth stretch of 10 s of `recordings`, that the numbers
    are then not fitted to, though the choice of causes has seen it. kinematics: source, 1 to 3. jobs: threads of the
    fits. progress: called with what is being done, how much of it is done, and of how much (None: unknown).
    Raises InputError.
    """
    begun = perf_counter()
    phase = progress or (lambda what, done, total: None)
    with threadpool_limits(limits=max(jobs, 1)):
        case = _case(finger, recordings, tests, kinematics)
        found = search(case.finger.data, case.whole, seed, phase, jobs)
        unseen, events = without_events(found.extended.data, case.tests, seed)
        found = replace(found, events=(*found.events, *events))
        result = _Result(replace(case, tests=unseen), found, seed, jobs, phase)
        return replace(result.diagnosis(), seconds=perf_counter() - begun)


def problem_of(finger: Finger, recordings: Sequence[Source], *, kinematics: int = 1, seed: int = 0) -> Problem:
    """What `naming.Selection` is given first: the residual of the nominal fit and the columns of all candidates."""
    case = _case(finger, recordings, (), kinematics)
    return search(case.finger.data, case.whole, seed, lambda what, done, total: None, 1, most_rounds=0).first.problem


# --- what is given ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Case:
    """training: with held-out stretches where there are no tests. whole: with none. tests: recordings to judge on."""

    finger: FingerDescription
    training: list[FitRecording]
    tests: list[FitRecording]

    @property
    def whole(self) -> list[FitRecording]:
        nothing = [np.zeros_like(each.held_out) for each in self.training]
        return [
            replace(each, train=each.train | each.held_out, held_out=none)
            for each, none in zip(self.training, nothing, strict=True)
        ]

    @property
    def warnings(self) -> tuple[str, ...]:
        return tuple(f"{each.path.name}: {text}" for each in [*self.training, *self.tests] for text in each.warnings)


def _case(finger: Finger, recordings: Sequence[Source], tests: Sequence[Source], kinematics: int) -> _Case:
    if not recordings:
        raise InputError("no recording; expected at least one")
    if kinematics not in (1, 2, 3):
        raise InputError(f"kinematics = {kinematics!r}: expected 1, 2 or 3")
    given = finger if isinstance(finger, FingerDescription) else read_finger(Path(finger))
    held = Held() if tests else HELD
    training = [prepare(given, _read(each), kinematics, held) for each in recordings]
    unseen = [prepare(given, _read(each), kinematics, Held()) for each in tests]
    require_noise(given, training)
    return _Case(given, training, unseen)


def _read(source: Source) -> Recording:
    return source if isinstance(source, Recording) else read_recording(source)


# --- what is told -----------------------------------------------------------------------------------------------------


class _Result:
    """Everything that is reported of a search."""

    def __init__(self, case: _Case, found: Search, seed: int, jobs: int, phase: Phase) -> None:
        self._case, self._found, self._seed, self._phase = case, found, seed, phase
        self._settings = FitSettings(threads=jobs)
        self._series: Series = found.last.series

    def diagnosis(self) -> Diagnosis:
        """Without the time it took."""
        found, case = self._found, self._case
        self._phase("measuring the gain", 0, None)
        gain, left = self._gain()
        self._phase("looking for what is left", 0, None)
        before = self._remainder(found.first.residual, found.first)
        after = before if not found.causes else self._remainder(found.last.residual, found.last)
        floor = noise_floor(found.last.series, found.last.residual)
        experiments, invisible = self._experiments()
        torque = self._torque()
        everything = [*case.training, *case.tests]
        return Diagnosis(
            finger=case.finger.name,
            verdict=_verdict(bool(found.causes), after.unknown),
            recordings=tuple(str(each.path) for each in case.training),
            tests=tuple(str(each.path) for each in case.tests),
            held_out=gain.held_out,
            seconds=0.0,
            seed=self._seed,
            nominal=gain.nominal,
            extended=gain.extended,
            bias_only_rms=gain.bias_only_rms,
            noise_floor=tuple(floor.rms),
            floor_source=floor.source,
            ceiling=tuple(before.share),
            gain=gain.value,
            causes=tuple(sorted(self._causes(gain, left), key=lambda cause: -cause.gain.value)),
            invisible=invisible,
            events=found.events,
            unexplained=_unexplained(after, found.last.residual, found.last.series),
            experiment=experiments.best,
            views=residual_views(self._series, found.first.residual, found.last.residual, load=torque),
            whiteness=whiteness(self._series, found.first.residual, found.last.residual),
            detection=detection_gain(found.nominal.data, found.extended.data, everything) if found.causes else None,
            nominal_data=found.nominal.data,
            extended_data=found.extended.data,
            warnings=(*case.warnings, *found.extended.warnings),
            tested=len({trial.place for trial in found.first.problem.bank.trials}),
        )

    # --- gain ---

    def _gain(self) -> tuple[Gain, list[Numbers]]:
        """The gain, and for each cause the residual [B, n] of the model that lacks it alone."""
        case, found = self._case, self._found
        training = [
            replace(each, train=each.train & own.train, held_out=each.held_out & own.train)
            for each, own in zip(case.training, found.fitted_to, strict=True)
        ]
        fit_to = [replace(own, train=each.train) for own, each in zip(found.fitted_to, training, strict=True)]
        nominal, data = found.nominal, case.finger.data
        if not case.tests:
            nominal = fitted(nominal.data, fit_to, self._settings, given=data)
        if not found.causes:
            return measure_gain(nominal.data, nominal.data, training, case.tests, seed=self._seed), []
        accepted = [cause.accepted for cause in found.causes]
        fit = fit_extended(nominal, accepted, fit_to, self._settings, compare=True)
        gain = measure_gain(
            nominal.data,
            fit.model.data,
            training,
            case.tests,
            without=[model.data for model in fit.without],
            alone=[model.data for model in fit.alone],
            seed=self._seed,
        )
        return gain, self._left_without([model.data for model in fit.without])

    def _left_without(self, models: Sequence[Mapping[str, Any]]) -> list[Numbers]:
        """[B, n] each: residual of models over all recordings, bias taken off."""
        grid, found = make_grid(self._case.whole), []
        for data in models:
            series = replace(series_of(data, self._case.whole, grid), used=self._series.used)
            found.append(residual_of(series, bias_of(data, series), np.zeros((*series.target.shape, 0))))
        return found

    def _causes(self, gain: Gain, left: Sequence[Numbers]) -> list[Cause]:
        after = self._left_without([self._found.extended.data])[0] if left else np.zeros(0)
        return [self._cause(cause, k, gain, left[k], after) for k, cause in enumerate(self._found.causes)]

    def _cause(self, cause: NamedCause, k: int, gain: Gain, before: Numbers, after: Numbers) -> Cause:
        candidate, found = cause.accepted.candidate, cause.found
        used, parameters = self._series.used, self._found.parameters[k]
        lost, kept = (float(np.sum(values[used] ** 2)) for values in (before, after))
        return Cause(
            where=where_of(found.trial),
            title=candidate.title,
            explanation=candidate.explanation,
            p_value=found.p_value,
            gain=gain.causes[k],
            share=max(0.0, 1.0 - kept / lost) if lost > 0 else 0.0,
            confusable_with=tuple(where_of(trial) for trial in found.alike),
            parameters=parameters,
            size=size_of(candidate.name, parameters),
            evidence=evidence(cause.accepted, self._series, before, after),
            first_gain=gain.alone[k],
        )

    # --- what is left, and what to do next ---

    def _remainder(self, residual: Numbers, view: View) -> Remainder:
        nominal = np.asarray(view.problem.nominal, dtype=np.float64)
        nuisance = [np.hstack([view.bias, nominal[:, j]]) for j in range(nominal.shape[1])]
        force = [
            segment.mean(view.predicted[segment.recording].recording.groups["tendon_force"][segment.part])
            for segment in make_grid(view.recordings).segments
        ]
        return measure_remainder(view.series, residual, nuisance, force=np.concatenate(force), seed=self._seed)

    def _torque(self) -> Numbers:
        """[B, n] N·m: what is to be explained."""
        grid = make_grid(self._case.whole)
        return np.concatenate(
            [segment.mean(self._case.whole[segment.recording].target[segment.part]) for segment in grid.segments]
        )

    def _experiments(self) -> tuple[Experiments, tuple[Invisible, ...]]:
        """For confusion sets, and for what is not visible: one question for each effect, at the place that comes
        nearest to being visible."""
        nominal, source = self._found.nominal.data, self._found.fitted_to[0].kinematics
        rivals = [
            Question(cause.accepted, rival)
            for cause in self._found.causes
            for rival in map(_ordinary, cause.found.alike[:MOST_RIVALS])
            if all(each.place in each.candidate.places(nominal, source) for each in (cause.accepted, rival))
        ]  # not about a law that another cause has brought
        unseen = self._unseen()
        nearest: dict[str, Trial] = {}
        for trial, _ in unseen:
            nearest.setdefault(trial.effect, trial)
        questions = [*rivals, *(Question(_ordinary(trial)) for trial in nearest.values())]
        self._phase("choosing the next experiment", 0, None)
        planned = plan_experiments(
            nominal,  # that has no cause that is in question
            self._found.fitted_to,
            questions,
            noise=[float(value) for value in self._found.last.residual[self._series.used].std(axis=0)],
            seed=self._seed,
            progress=lambda done, total: self._phase("choosing the next experiment", done, total),
        )
        said = {
            effect: (planned.sentence(len(rivals) + k), planned.motion(len(rivals) + k))
            for k, effect in enumerate(nearest)
        }
        return planned, tuple(
            Invisible(where_of(trial), candidate_of(trial)[0].title, share, *said[trial.effect])
            for trial, share in unseen
        )

    def _unseen(self) -> list[tuple[Trial, float]]:
        """Of each place that is not visible the shape that comes nearest, with its share; the nearest places first."""
        view = self._found.first
        best: dict[tuple[str, int | None, int | None], tuple[Trial, float]] = {}
        for trial, share in zip(view.problem.bank.trials, view.shares, strict=True):
            if trial.place not in best or share > best[trial.place][1]:
                best[trial.place] = (trial, float(share))
        hidden = [pair for pair in best.values() if pair[1] < LEAST_SHARE]
        return sorted(hidden, key=lambda pair: -pair[1])


def where_of(trial: Trial) -> Where:
    return Where(trial.effect, trial.joint, trial.tendon)


def _ordinary(trial: Trial) -> Accepted:
    """An effect of ordinary size."""
    candidate, place = candidate_of(trial)
    return Accepted(candidate, place, dict(trial.shape))


def _verdict(causes: bool, unknown: bool) -> str:
    if causes:
        return "partly explained" if unknown else "explained"
    return "unexplained" if unknown else "adequate"


def _unexplained(left: Remainder, residual: Numbers, series: Series) -> Unexplained:
    """Of the variance that is left: what unseen blocks of it show to be no noise."""
    variance = np.mean(residual[series.used] ** 2, axis=0)
    shares = np.maximum(np.array(left.share), 0.0)
    whole = float(variance.sum())
    share = float(shares @ variance) / whole if whole > 0 and left.unknown else 0.0
    return Unexplained(share, left.description, tuple(float(value) for value in shares), left.p_value, left.unknown)
