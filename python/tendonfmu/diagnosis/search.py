"""What a description lacks: signals, events, and one cause after the other, with all numbers fitted again after each.

After each cause, everything is computed anew around the fitted description. The derivatives of a wrong model would
otherwise ask for small pieces that only correct the linearisation. The search ends when no candidate is material and
certain. Where stuck samples mislead it, it is made without them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.diagnosis.calibration import calibration, is_better
from tendonfmu.diagnosis.cause import Cause, Where, with_error
from tendonfmu.diagnosis.contact_scan import events_of, without_blocks, without_events
from tendonfmu.diagnosis.effects import CALIBRATED, CANDIDATES, RUBBING, SCALING, Candidate, Place, Term
from tendonfmu.diagnosis.effects.shapes import is_spring
from tendonfmu.diagnosis.extension_fit import FittedModel, extended_description, fit_extended, fit_numbers, possible
from tendonfmu.diagnosis.gain import OnlineError
from tendonfmu.diagnosis.result import Event
from tendonfmu.diagnosis.selection import (
    CERTAIN,
    SIGNIFICANCE,
    CauseSearch,
    Selection,
    is_alike,
    rms_gain,
    step_p_value,
)
from tendonfmu.diagnosis.signal_choice import Estimation, presliding_everywhere, presliding_of_joints
from tendonfmu.diagnosis.sliding import RUNS, WORSE, Sliding, settled, sliding_alone
from tendonfmu.diagnosis.span import span_of
from tendonfmu.diagnosis.view import View
from tendonfmu.model import Finger
from tendonfmu.recordings import FitRecording
from tendonfmu.tasks import Phases, Step

MOST_CAUSES = 8
MOST_FITTED = 3  # effects that columns cannot distinguish
NEARLY = 0.8  # of the gain of a single sensor: prior knowledge always takes a part from several together
WIDESPREAD = {"presliding"}  # in every finger, and different from place to place


@dataclass(frozen=True)
class Trial:
    """A cause and the model fitted with it; the model is None if there is none."""

    cause: Cause
    model: FittedModel | None
    error: Numbers  # Σ e² on unseen stretches, (N·m)² [K]


class ExtensionSearch(CauseSearch):
    """Adds cause after cause; keeps models and views after each."""

    def __init__(self, given: Estimation, measured: Sequence[FitRecording], out: Flags, least_gain: float) -> None:
        """Leave the blocks in `out` [B] out of an estimation; `measured` are its recordings as they were measured."""
        super().__init__(MOST_CAUSES)
        chosen, self.fitted_to = _without_blocks(given, out)
        self.chosen, self._out, self._least_gain, self._settings = chosen, out, least_gain, chosen.settings
        self.online = OnlineError(chosen.online(chosen.nominal.data), measured)
        self.models = [chosen.nominal]
        # before the start is fitted, only the residual of the nominal model is needed
        self.view = self._look(chosen.nominal, () if chosen.start.causes else CANDIDATES)
        self.first = self.view.lean

    def run(self, step: Step) -> None:
        begun = self.chosen.start.causes
        for terms in begun:
            self._take(self._tried(_of_start(terms), self.chosen.model.data if len(begun) == 1 else None), ())
        if not self.view.columns.proposals:
            self.view = self._look(self.models[-1])
        super().run(step)
        if self._tries_presliding():
            super().run(step)

    def _try_next(self, tried: set[str]) -> tuple[Cause, bool] | None:
        # Refused effects explain something, so no other effect is credited with that. A correction of the torque
        # itself is excluded: it lowers any error by shrinking the torque.
        selection = self.view.beside({refused.key for refused in self.refused if refused.effect not in SCALING})
        best = selection.best(self._least_gain, tried)
        at_joints = presliding_of_joints(self.models[-1].data)
        # what every finger has comes first: friction that builds up too early in joints looks like other friction
        if best is not None and at_joints and _effects(best) & {*RUBBING, *WIDESPREAD}:
            trial = self._tried(_of_start(at_joints))
            if self._take(trial):
                return trial.cause, True
        together = calibration(self.view, selection, tried, self._least_gain)
        if together is not None and is_better(together, best, self._least_gain):
            trial = self._tried(together)
        elif best is not None:
            trial = beside_calibration(self._best_fitted(selection, best), together)
        else:
            return None
        return trial.cause, trial.cause.p_value < SIGNIFICANCE and self._take(trial)

    def _best_fitted(self, selection: Selection, best: Cause) -> Trial:
        """Fit the effects that the columns cannot distinguish and take the best: columns of a wrong model mislead."""
        rivals = [self._named(selection.refined(rival.effect), selection) for rival in _to_fit(best)]
        named = [self._named(best, selection), *(rival for rival in rivals if rival.p_value < SIGNIFICANCE)]
        trials = [self._tried(cause) for cause in named]
        chosen = min(trials, key=lambda trial: float(trial.error.sum()))
        same = [trial for trial in trials if trial.model is not None and is_alike(trial.error, chosen.error)]
        # an effect that is already present explains the data without a new name
        widespread = WIDESPREAD & {cause.effect for cause in self.causes}
        chosen = next((trial for trial in same if trial.cause.effect in widespread), chosen)
        fitted = {trial.cause.effect for trial in trials}
        alike = [trial.cause for trial in same if trial is not chosen]
        alike += [rival for rival in best.alike if rival.effect not in fitted]
        chosen = self._at_best_place(chosen, selection)
        return replace(chosen, cause=replace(chosen.cause, alike=tuple(alike)))

    def _at_best_place(self, trial: Trial, selection: Selection) -> Trial:
        """Fit the effect at the nearly best places, too, and take the best."""
        best = selection.refined(trial.cause.effect)
        if trial.cause.direction is not best.direction:
            return trial
        others = [self._named(near, selection) for near in selection.near(best)[: MOST_FITTED - 1]]
        trials = [trial, *(self._tried(other) for other in others if other.p_value < SIGNIFICANCE)]
        return min(trials, key=lambda trial: float(trial.error.sum()))

    def _tries_presliding(self) -> bool:
        """Try presliding with a short distance if none was taken; return whether it was taken."""
        chosen = self.chosen
        if any(cause.effect == "presliding" for cause in [*self.causes, *self.refused]):
            return False
        span = span_of(self.models[-1].data, chosen.recordings)
        tried = presliding_everywhere(self.models[-1].data, chosen.recordings[0].kinematics, span)
        return bool(tried) and self._take(self._tried(_of_start(tried[0])))

    def _named(self, cause: Cause, selection: Selection) -> Cause:
        """Return a judged candidate with its terms at its magnitudes, gain and p-value."""
        gain = with_error(*selection.gain(cause))
        return replace(cause, terms=cause.scaled(), gain=gain, p_value=self.view.p_value(cause))

    def _tried(self, cause: Cause, fitted: Data | None = None) -> Trial:
        """Fit the description with a further cause; `fitted` is one that was fitted with it."""
        everything = terms_of([*self.causes, cause])
        terms = possible(self.models[0].data, everything)
        if len(terms) < len(everything):
            return Trial(cause, None, np.array([np.inf]))
        # predict with the cause: forces predicted without a delay are not late, so no fit would find a delay in them
        begin = fitted or extended_description(self.models[-1].data, cause.terms)
        model = fit_extended(self.models[0], terms, self.chosen.predicted(begin, self._out), self._settings, begin)
        # fit again with the forces predicted with the cause
        clean = self.chosen.predicted(model.data, self._out)
        model = fit_numbers(model.data, clean, self._settings, given=self.models[0].given, fixed=model.fixed)
        if not self._resolved(cause, model):
            return Trial(cause, None, np.array([np.inf]))
        return Trial(cause, model, self._look(model, ()).selection.base)

    def _take(self, trial: Trial, candidates: Sequence[Candidate] = CANDIDATES) -> bool:
        """Keep a further cause if it lowers the error on unseen stretches materially and certainly."""
        before, after, model, cause = self.view.selection.base, trial.error, trial.model, trial.cause
        gain, error = rms_gain(before, after) if model is not None else (0.0, 0.0)
        if model is None or gain < self._least_gain or gain <= CERTAIN * error or not self._runs_better(model):
            return False
        # a cause of the start has no column in the view before
        p_value = cause.p_value if cause.p_value < SIGNIFICANCE else step_p_value(before, after)
        self.causes.append(replace(cause, gain=with_error(gain, error), p_value=p_value))
        self.models.append(model)
        self.view = self.view.lean  # frees memory for the next one
        self.view = self._look(model, candidates)
        return True

    def _runs_better(self, model: FittedModel) -> bool:
        """Return whether the model runs better online than the last one."""
        before, after = (self.chosen.online(fitted.data) for fitted in (self.models[-1], model))
        return (
            self.online.square(after) < self.online.square(before)
            and self.online.by_stretch(after).sum() < self.online.by_stretch(before).sum()
        )

    def _resolved(self, cause: Cause, model: FittedModel) -> bool:
        """Return whether the sensors can show a play or delay of the fitted size, and presliding is no spring."""
        if cause.effect == "presliding" and is_spring(model.data, span_of(model.data, self.chosen.recordings)):
            return False
        return self.chosen.least.shows_all(cause.effect, cause.terms, model.data)

    def run_alone(self, alone: Sliding, step: Step) -> ExtensionSearch:
        """Search only where everything slides."""
        sliding = ExtensionSearch(alone.estimation, alone.measured, self._out, self._least_gain)
        sliding.run(step)
        return sliding

    def fitted_with(self, terms: Sequence[Term], recordings: Sequence[FitRecording] = ()) -> FittedModel:
        """Fit the nominal model with some terms to these recordings, or to those of this search."""
        return fit_extended(self.models[0], terms, recordings or self.fitted_to, self._settings)

    def is_better_alone(self, alone: Sliding, model: FittedModel, terms: Sequence[Term]) -> bool:
        """Return whether a model's terms leave much less where everything slides if they are fitted to that alone."""
        worse = alone.worse_where_stuck(model) > WORSE
        return worse and alone.is_better(self.fitted_with(terms, alone.recordings), model)

    def is_misled(self, alone: Sliding, sliding: ExtensionSearch, model: FittedModel) -> bool:
        """Return whether a search in sliding samples leaves much less there than a model of all, but no more of all."""

        def error(data: Data) -> float:
            return self.online.square(self.chosen.online(data))

        own = sliding.models[-1]
        return alone.is_better(own, model) and error(settled(own.data, error)) < RUNS**2 * error(model.data)

    def _look(self, model: FittedModel, candidates: Sequence[Candidate] = CANDIDATES) -> View:
        return self.chosen.look(model.data, self._out, candidates)

    def small(self) -> list[Cause]:
        """Return the best place of every effect that is certain but not material."""
        small, selection = [], self.view.selection
        known = {refused.effect for refused in self.refused}
        for cause in selection.ranked():
            gain, error = selection.gain(cause)
            if cause.effect not in known and gain > CERTAIN * error:
                named = self._named(cause, selection)
                small += [named] if named.p_value < SIGNIFICANCE else []
        return small


def beside_calibration(trial: Trial, together: Cause | None) -> Trial:
    """Say of a single sensor that is off that it may be several, if their usual errors explain nearly as much."""
    cause = trial.cause
    if together is None or cause.effect not in CALIBRATED or together.gain.value < NEARLY * cause.gain.value:
        return trial
    return replace(trial, cause=replace(cause, alike=(*cause.alike, together)))


def _to_fit(best: Cause) -> list[Cause]:
    """Return the effects that cannot be distinguished from the best one and may replace it."""
    # A correction of the torque itself may replace only another such correction, because it lowers any error.
    scaling = best.effect in SCALING
    return [rival for rival in best.alike if scaling or rival.effect not in SCALING][: MOST_FITTED - 1]


def _effects(best: Cause) -> set[str]:
    """Return the effect of a cause and those that may replace it."""
    return {best.effect, *(rival.effect for rival in _to_fit(best))}


def terms_of(causes: Sequence[Cause]) -> list[Term]:
    """Return the terms of all causes."""
    return [term for cause in causes for term in cause.terms]


def _of_start(terms: tuple[Term, ...]) -> Cause:
    """Return a cause of the start, at one place or everywhere."""
    candidate, place = terms[0].candidate, terms[0].place if len(terms) == 1 else Place()
    where = Where(candidate.name, place.joint, place.tendon)
    return Cause(where, candidate.title, candidate.explanation, terms=terms)


# --- from recordings to causes ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Search:
    """The result of a search."""

    estimation: Estimation  # signals and recordings
    nominal: FittedModel  # fitted descriptions with the settings for estimation
    extended: FittedModel
    first: View  # what each of them lacks and leaves
    last: View
    causes: tuple[Cause, ...]  # in the order in which they were found
    models: tuple[FittedModel, ...]  # the nominal model, then the model after each cause [causes + 1]
    small: tuple[Cause, ...]  # effects that are certain but not material
    events: tuple[Event, ...]  # contact and stalls
    out: Flags  # blocks that lie in events [B]
    fitted_to: Sequence[FitRecording]  # recordings with the forces that the model predicts, without events
    everything: Sequence[FitRecording]  # the same with the samples in which something is stuck
    only_sliding: bool  # whether these are left out, because they would mislead (`sliding.py`)


def search(
    given: Finger,
    recordings: Sequence[FitRecording],
    chosen: Estimation,
    *,
    least_gain: float,
    seed: int,
    phases: Phases,
) -> Search:
    """Search for the causes that a description lacks."""
    with phases.start("contact"):
        events, out = events_of(chosen.model.data, chosen.recordings, chosen.grid, seed)
    measured = [without_events(recording, events) for recording in recordings]
    with phases.start("causes", MOST_CAUSES) as step:
        whole = ExtensionSearch(chosen, measured, out, least_gain)
        best = _searched(whole, sliding_alone(given, measured, chosen), step)
    models = [whole.models[0], *best.models[1:]]
    if events:
        # drop events that the causes explain
        left, _ = events_of(models[-1].data, chosen.recordings, chosen.grid, seed)
        events = tuple(event for event in events if any(_overlap(event, other) for other in left))
    return Search(
        estimation=best.chosen,
        nominal=models[0],
        extended=models[-1],
        first=best.first,
        last=best.view,
        causes=tuple(best.causes),
        models=tuple(models),
        small=(*best.refused, *best.small()),
        events=events,
        out=out,
        fitted_to=best.fitted_to,
        everything=whole.fitted_to,
        only_sliding=best is not whole,
    )


def _searched(whole: ExtensionSearch, alone: Sliding | None, step: Step) -> ExtensionSearch:
    """Search in all samples, or only where everything slides if stuck samples mislead."""
    if alone is None:
        whole.run(step)
        return whole
    model = whole.chosen.model
    early = whole.is_better_alone(alone, model, whole.chosen.start.terms)
    if not early:
        whole.run(step)
        model = whole.models[-1]
        if alone.worse_where_stuck(model) <= WORSE:
            return whole
    sliding = whole.run_alone(alone, step)
    if whole.is_misled(alone, sliding, whole.fitted_with(terms_of(sliding.causes)) if early else model):
        return sliding
    if early:
        whole.run(step)
    return whole


def _without_blocks(given: Estimation, out: Flags) -> tuple[Estimation, list[FitRecording]]:
    """Return an estimation without some blocks [B], and its recordings with the nominal model's forces."""
    nominal = given.nominal
    recordings = [without_blocks(recording, k, given.grid, out) for k, recording in enumerate(given.recordings)]
    chosen = replace(given, recordings=recordings)
    clean = chosen.predicted(nominal.data, out)
    return replace(chosen, nominal=fit_numbers(nominal.data, clean, given.settings, given=nominal.given)), clean


def _overlap(one: Event, other: Event) -> bool:
    return one.recording == other.recording and one.start < other.end and other.start < one.end
