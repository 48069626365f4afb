"""How a search gets from recordings to the causes that a description lacks: signals, starting point, cause after cause.

After each cause, all numbers of the extended description are fitted again and everything is computed anew around it.
The derivatives of a wrong model would otherwise ask for small pieces that only correct the linearisation. The search
ends when no candidate is material and certain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.diagnosis.cause_search import View, bias_of, look, predicted_of, residual_alone, series_of
from tendonfmu.diagnosis.cause_selection import CERTAIN, Judged, Pick, Selection, is_alike, rms_gain
from tendonfmu.diagnosis.contact_scan import left_out, scan_events
from tendonfmu.diagnosis.effects import CANDIDATES, Candidate, Place
from tendonfmu.diagnosis.effects.presliding import is_spring
from tendonfmu.diagnosis.extension_fit import (
    Accepted,
    FittedModel,
    extended_description,
    fit_extended,
    possible,
)
from tendonfmu.diagnosis.hypotheses import SCALING, Hypothesis
from tendonfmu.diagnosis.named_cause import NamedCause, accepted_of, is_shown
from tendonfmu.diagnosis.nominal_fit import fitted
from tendonfmu.diagnosis.online_error import OnlineError
from tendonfmu.diagnosis.result import Event
from tendonfmu.diagnosis.series import Grid
from tendonfmu.diagnosis.signal_choice import Estimation
from tendonfmu.diagnosis.sliding import RUNS, settled, sliding_alone
from tendonfmu.diagnosis.span import span_of
from tendonfmu.diagnosis.starting_point import presliding_everywhere
from tendonfmu.model import Finger
from tendonfmu.recordings import FitRecording
from tendonfmu.tasks import Phases, Step

MOST_CAUSES = 8
SIGNIFICANCE = 0.01  # family-wise
MOST_FITTED = 3  # effects that columns cannot distinguish
WIDESPREAD = {"presliding"}  # in every finger, and different from place to place
MOST_REFUSED = 4  # selected effects that the fit or the test did not confirm


@dataclass(frozen=True)
class Search:
    """The result of a search."""

    estimation: Estimation  # signals and recordings
    nominal: FittedModel  # fitted descriptions with the settings for estimation
    extended: FittedModel
    first: View  # what each of them lacks and leaves
    last: View
    causes: tuple[NamedCause, ...]  # in the order in which they were found
    models: tuple[FittedModel, ...]  # the nominal model, then the model after each cause [causes + 1]
    small: tuple[NamedCause, ...]  # effects that are certain but not material
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
    own, clean = _without_blocks(chosen, out)
    with phases.start("causes", MOST_CAUSES) as step:
        searched = _searched(given, own, clean, measured, out, least_gain, step)
    rounds, only_sliding = searched.rounds, searched.clean is not clean
    models = [own.nominal, *rounds.models[1:]]
    if events:
        # drop events that the causes explain
        left, _ = events_of(models[-1].data, chosen.recordings, chosen.grid, seed)
        events = tuple(event for event in events if any(_overlap(event, other) for other in left))
    return Search(
        estimation=searched.chosen,
        nominal=models[0],
        extended=models[-1],
        first=rounds.first,
        last=rounds.view,
        causes=tuple(rounds.causes),
        models=tuple(models),
        small=(*rounds.refused, *rounds.small()),
        events=events,
        out=out,
        fitted_to=searched.clean,
        everything=clean,
        only_sliding=only_sliding,
    )


@dataclass(frozen=True)
class _Searched:
    """A search that has ended, and the recordings that it was in."""

    rounds: _Rounds
    chosen: Estimation
    clean: Sequence[FitRecording]

    @property
    def model(self) -> FittedModel:
        return self.rounds.models[-1]


def _searched(
    given: Finger,
    chosen: Estimation,
    clean: Sequence[FitRecording],
    measured: Sequence[FitRecording],
    out: Flags,
    least_gain: float,
    step: Step,
) -> _Searched:
    """Search in all samples, and without those in which something is stuck if these may mislead; return the better."""
    online = OnlineError(chosen.online(chosen.nominal.data), measured)
    rounds = _Rounds(chosen, out, online, least_gain)
    rounds.run(step)
    whole = _Searched(rounds, chosen, clean)
    alone = sliding_alone(given, measured, chosen, whole.model)
    if alone is None:
        return whole
    own, predicted = _without_blocks(alone.estimation, out)
    rounds = _Rounds(own, out, OnlineError(own.online(own.nominal.data), alone.measured), least_gain)
    rounds.run(step)
    sliding = _Searched(rounds, own, predicted)

    def error(data: Mapping[str, Any]) -> float:
        return online.square(chosen.online(data))

    is_better = alone.is_better(sliding.model, whole.model)
    runs = is_better and error(settled(sliding.model.data, error)) < RUNS**2 * error(whole.model.data)
    return sliding if runs else whole


def _without_blocks(chosen: Estimation, out: Flags) -> tuple[Estimation, list[FitRecording]]:
    """Return an estimation without some blocks [B], and its recordings with the nominal model's forces."""
    nominal = chosen.nominal
    own = [without_blocks(recording, k, chosen.grid, out) for k, recording in enumerate(chosen.recordings)]
    clean = predicted_of(nominal.data, own, chosen.grid, series_of(nominal.data, own, chosen.grid, out))
    nominal = fitted(nominal.data, clean, chosen.settings, given=nominal.given)
    return replace(chosen, nominal=nominal, recordings=own), clean


def _overlap(one: Event, other: Event) -> bool:
    return one.recording == other.recording and one.start < other.end and other.start < one.end


def events_of(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, seed: int
) -> tuple[tuple[Event, ...], Flags]:
    """Find the stretches that no friction explains in the residual of a model."""
    # returns blocks that lie in an event [B]
    series = series_of(data, recordings, grid)
    names = [str(recording.path) for recording in recordings]
    events = scan_events(series, residual_alone(data, series), bias_of(data, series), names, seed=seed)
    return events, left_out(series, events, names)


def without_events(recording: FitRecording, events: Sequence[Event]) -> FitRecording:
    """Return the recording without the samples that lie in its events."""
    inside = np.zeros(len(recording.time), dtype=bool)
    for event in events:
        if event.recording == str(recording.path):
            inside |= (recording.time >= event.start) & (recording.time <= event.end)
    return replace(recording, train=recording.train & ~inside, held_out=recording.held_out & ~inside)


def without_blocks(recording: FitRecording, number: int, grid: Grid, out: Flags) -> FitRecording:
    """Return a recording that does not train on the samples of some blocks."""
    # out: [B]
    train = recording.train.copy()
    for segment in grid.segments:
        if segment.recording == number:
            begin = segment.part.start
            rows = np.flatnonzero(np.repeat(out[segment.blocks], segment.samples))
            train[begin + rows] = False
    return replace(recording, train=train)


@dataclass(frozen=True)
class _Trial:
    """A cause and the model fitted with it; the model is None if there is none."""

    cause: NamedCause
    model: FittedModel | None
    error: Numbers


class _Rounds:
    """Adds cause after cause; keeps models and views after each."""

    def __init__(
        self,
        chosen: Estimation,
        out: Flags,
        online: OnlineError,
        least_gain: float,
    ) -> None:
        self.causes: list[NamedCause] = []
        self.refused: list[NamedCause] = []
        self.models = [chosen.nominal]
        self._chosen, self._out, self._online = chosen, out, online
        self._least_gain, self._settings = least_gain, chosen.settings
        # before the start is fitted, only the residual of the nominal model is needed
        self.view = self.first = self._look(chosen.nominal, () if chosen.start.causes else CANDIDATES)

    def run(self, step: Step) -> None:
        for accepted in self._chosen.start.causes:
            self._take(self._tried(_together(accepted)), ())
        if not self.view.columns.proposals:
            self.view = self._look(self.models[-1])
        self._search(step)
        if self._tries_presliding():
            self._search(step)

    def _search(self, step: Step) -> None:
        while len(self.causes) < MOST_CAUSES and len(self.refused) < MOST_REFUSED:
            step(len(self.causes))
            # Refused effects explain something, so no other effect is credited with that. A correction of the torque
            # itself is excluded: it lowers any error by shrinking the torque.
            known = {refused.key for refused in self.refused if refused.effect not in SCALING}
            tried = {refused.effect for refused in self.refused}
            selection = self.view.beside(known)
            picked = selection.best(self._least_gain, tried)
            if picked is None:
                break
            trial = self._best_fitted(selection, picked)
            if trial.cause.p_value >= SIGNIFICANCE or not self._take(trial):
                self.refused.append(trial.cause)

    def _best_fitted(self, selection: Selection, picked: Pick) -> _Trial:
        """Fit the effects that the columns cannot distinguish and take the best: columns of a wrong model mislead."""
        own = self._named(picked.judged, selection)
        rivals = [self._named(selection.refined(judged.effect), selection) for judged in _to_fit(picked)]
        trials = [self._tried(cause) for cause in (own, *(rival for rival in rivals if rival.p_value < SIGNIFICANCE))]
        best = min(trials, key=lambda trial: float(trial.error.sum()))
        same = [trial for trial in trials if trial.model is not None and is_alike(trial.error, best.error)]
        # an effect that is already present explains the data without a new name
        widespread = WIDESPREAD & {cause.effect for cause in self.causes}
        best = next((trial for trial in same if trial.cause.effect in widespread), best)
        fitted_effects = {trial.cause.effect for trial in trials}
        alike = [trial.cause.hypothesis for trial in same if trial is not best and trial.cause.hypothesis is not None]
        alike += [other for other in picked.alike if other.effect not in fitted_effects]
        best = self._at_best_place(best, selection)
        return replace(best, cause=replace(best.cause, alike=tuple(alike)))

    def _at_best_place(self, trial: _Trial, selection: Selection) -> _Trial:
        """Fit the effect at the nearly best places, too, and take the best."""
        judged = selection.refined(trial.cause.effect)
        if trial.cause.hypothesis is not judged.hypothesis:
            return trial
        others = [self._named(near, selection) for near in selection.near(judged)[: MOST_FITTED - 1]]
        trials = [trial, *(self._tried(other) for other in others if other.p_value < SIGNIFICANCE)]
        return min(trials, key=lambda trial: float(trial.error.sum()))

    def _tries_presliding(self) -> bool:
        """Try presliding with a short distance if none was taken; return whether it was taken."""
        chosen = self._chosen
        if any(cause.effect == "presliding" for cause in [*self.causes, *self.refused]):
            return False
        span = span_of(self.models[-1].data, chosen.recordings)
        tried = presliding_everywhere(self.models[-1].data, chosen.recordings[0].kinematics, span)
        return bool(tried) and self._take(self._tried(_together(tried[0])))

    def _named(self, judged: Judged, selection: Selection) -> NamedCause:
        own = judged.hypothesis
        accepted = accepted_of(own, judged.magnitudes)
        gain, error = selection.gain(judged)
        p_value = self.view.p_value(own)
        return NamedCause(own.effect, own.joint, own.tendon, accepted, gain, error, p_value, (), own)

    def _tried(self, cause: NamedCause) -> _Trial:
        """Fit the description with a further cause."""
        everything = [term for known in [*self.causes, cause] for term in known.accepted]
        accepted = possible(self.models[0].data, everything)
        if len(accepted) < len(everything):
            return _Trial(cause, None, np.array([np.inf]))
        own = self._chosen.recordings
        # predict with the cause: forces predicted without a delay are not late, so no fit would find a delay in them
        begin = extended_description(self.models[-1].data, cause.accepted)
        clean = predicted_of(begin, own, self._chosen.grid, series_of(begin, own, self._chosen.grid, self._out))
        model = fit_extended(self.models[0], accepted, clean, self._settings)
        # fit again with the forces predicted with the cause
        clean = predicted_of(
            model.data, own, self._chosen.grid, series_of(model.data, own, self._chosen.grid, self._out)
        )
        model = fitted(model.data, clean, self._settings, given=self.models[0].given)
        if not self._resolved(cause, model):
            return _Trial(cause, None, np.array([np.inf]))
        return _Trial(cause, model, self._look(model, ()).selection.base)

    def _take(self, trial: _Trial, candidates: Sequence[Candidate] = CANDIDATES) -> bool:
        """Keep a further cause if it lowers the error on unseen stretches materially and certainly."""
        before, after, model, cause = self.view.selection.base, trial.error, trial.model, trial.cause
        gain, error = rms_gain(before, after) if model is not None else (0.0, 0.0)
        if model is None or gain < self._least_gain or gain <= CERTAIN * error or not self._runs_better(model):
            return False
        if cause.p_value >= SIGNIFICANCE:  # a cause of the start has no column in the view before
            cause = replace(cause, p_value=_step_p_value(before, after))
        self.causes.append(replace(cause, gain=gain, error=error))
        self.models.append(model)
        self.view = self._look(model, candidates)
        return True

    def _runs_better(self, model: FittedModel) -> bool:
        """Return whether the model runs better online than the last one."""
        before, after = (self._chosen.online(fitted.data) for fitted in (self.models[-1], model))
        left, after_error = (self._online.by_stretch(online).sum() for online in (before, after))
        return bool(after_error < left and self._online.square(after) < self._online.square(before))

    def _resolved(self, cause: NamedCause, model: FittedModel) -> bool:
        """Return whether the sensors can show a play or delay of the fitted size, and presliding is no spring."""
        if cause.effect == "presliding" and is_spring(model.data, span_of(model.data, self._chosen.recordings)):
            return False
        return is_shown(cause, model.data, self._chosen.least)

    def _look(self, model: FittedModel, candidates: Sequence[Candidate] = CANDIDATES) -> View:
        chosen = self._chosen
        return look(model.data, chosen.recordings, chosen.grid, chosen.least, self._out, candidates=candidates)

    def small(self) -> list[NamedCause]:
        """Return the best place of every effect that is certain but not material."""
        small = []
        known = {refused.effect for refused in self.refused}
        for judged in self.view.selection.ranked():
            gain, error = self.view.selection.gain(judged)
            if (
                judged.hypothesis.effect not in known
                and gain > CERTAIN * error
                and (p_value := self.view.p_value(judged.hypothesis)) < SIGNIFICANCE
            ):
                small.append(_small(judged, gain, error, p_value))
        return small


def _to_fit(picked: Pick) -> list[Hypothesis]:
    """Return the effects that cannot be distinguished from a pick and may replace it."""
    # A correction of the torque itself may replace only another such correction, because it lowers any error.
    scaling = picked.hypothesis.effect in SCALING
    return [other for other in picked.alike if scaling or other.effect not in SCALING][: MOST_FITTED - 1]


def _together(places: tuple[Accepted, ...]) -> NamedCause:
    """Return a cause of the start, at one place or everywhere."""
    place = places[0].place if len(places) == 1 else Place()
    return NamedCause(places[0].candidate.name, place.joint, place.tendon, places, 0.0, 0.0, 1.0, ())


def _small(judged: Judged, gain: float, error: float, p_value: float) -> NamedCause:
    own = judged.hypothesis
    return NamedCause(own.effect, own.joint, own.tendon, accepted_of(own, judged.magnitudes), gain, error, p_value, ())


def _step_p_value(before: Numbers, after: Numbers) -> float:
    """Return the p-value of a gain by stretch [K]: a one-sided t test."""
    from scipy.stats import ttest_1samp

    return float(ttest_1samp(before - after, 0.0, alternative="greater").pvalue) if len(before) > 1 else 1.0
