"""What a description lacks: base, events, and one cause after the other, with all numbers fitted again after each.

After each cause, everything is computed anew around the fitted description. The derivatives of a wrong model would
otherwise ask for small pieces that only correct the linearisation. The search ends when no candidate is material and
certain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.base import POSITION, Base, refitted, remembering
from tendonfmu.diagnosis.calibration import calibration, is_better
from tendonfmu.diagnosis.contact_scan import events_of
from tendonfmu.diagnosis.effects import CALIBRATED, Place, Term, Where
from tendonfmu.diagnosis.effects.memory import MEMORY, memory_of
from tendonfmu.diagnosis.extension_fit import FittedModel, extended_description, fit_extended, possible
from tendonfmu.diagnosis.result import Cause, Event, with_error
from tendonfmu.diagnosis.selection import (
    CERTAIN,
    SIGNIFICANCE,
    CauseSearch,
    Selection,
    is_alike,
    rms_gain,
    step_p_value,
)
from tendonfmu.diagnosis.view import View
from tendonfmu.estimate import SCALING
from tendonfmu.model import finger_from_data
from tendonfmu.tasks import Phases, Step

MOST_CAUSES = 8
LARGE = 0.1  # of the rms: the memory was fitted to what lacked such a cause
MOST_FITTED = 3  # effects that columns cannot distinguish
NEARLY = 0.8  # of the gain of a single sensor: prior knowledge always takes a part from several together


@dataclass(frozen=True)
class Trial:
    """A cause and the model fitted with it; the model is None if there is none."""

    cause: Cause
    model: FittedModel | None
    error: Numbers  # Σ e² on unseen stretches, (N·m)² [K]


class ExtensionSearch(CauseSearch):
    """Adds cause after cause to a base, and keeps the model with all of them."""

    def __init__(self, base: Base, least_gain: float) -> None:
        super().__init__(MOST_CAUSES + len(base.start))
        self.base, self.model, self._least_gain = base, base.model, least_gain
        self.first = base.look(base.nominal, ())
        self.causes = [_of_start(terms) for terms in base.start]

    def run(self, step: Step) -> None:
        self.view = self.base.look(self.model)
        super().run(step)

    def _try_next(self, tried: set[str]) -> tuple[Cause, bool] | None:
        # Refused effects explain something, so no other effect is credited with that. A correction of the torque
        # itself is excluded: it resembles whatever else is missing.
        selection = self.view.beside({refused.where for refused in self.refused if refused.effect not in SCALING})
        best = selection.best(self._least_gain, tried)
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
        # friction takes up torque of position, so of what cannot be distinguished that torque comes first
        chosen = next((trial for trial in same if trial.cause.effect in POSITION), chosen)
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

    def _named(self, cause: Cause, selection: Selection) -> Cause:
        """Return a judged candidate with its terms at its magnitudes, gain and p-value."""
        gain = with_error(*selection.gain(cause))
        return replace(cause, terms=cause.scaled(), gain=gain, p_value=self.view.p_value(cause))

    def _tried(self, cause: Cause) -> Trial:
        """Fit the description with a further cause."""
        base = self.base
        everything = terms_of([*self.causes, cause])
        terms = possible(base.nominal.data, everything)
        if len(terms) < len(everything):
            return Trial(cause, None, np.array([np.inf]))
        # predict with the cause: forces predicted without a delay are not late, so no fit would find a delay in them
        begin = extended_description(self.model.data, cause.terms)
        predicted = base.samples.at_predicted_forces(begin)
        model = fit_extended(base.nominal, terms, predicted, base.settings, self.model, rough=True)
        model = refitted(model, base.samples, base.settings, rough=True)
        if not base.least.shows_all(cause.effect, cause.terms, model.data):
            return Trial(cause, None, np.array([np.inf]))
        return Trial(cause, model, base.left_unseen(model))

    def _take(self, trial: Trial) -> bool:
        """Keep a further cause if it lowers the error on unseen stretches materially and certainly."""
        before, after, model, cause = self.view.selection.base, trial.error, trial.model, trial.cause
        gain, error = rms_gain(before, after) if model is not None else (0.0, 0.0)
        if model is None or gain < self._least_gain or gain <= CERTAIN * error:
            return False
        p_value = cause.p_value if cause.p_value < SIGNIFICANCE else step_p_value(before, after)
        self.causes.append(replace(cause, gain=with_error(gain, error), p_value=p_value))
        self.model = self._settled(refitted(model, self.base.samples, self.base.settings), gain)
        self.view = self.view.lean  # frees memory for the next one
        self.view = self.base.look(self.model)
        return True

    def _settled(self, model: FittedModel, gain: float) -> FittedModel:
        """Return a model with its memory chosen anew, from several starts, if that is better beside a large cause."""
        base = self.base
        if gain < LARGE or not memory_of(model.data):
            return model
        described = finger_from_data(model.data, base.settings.path)
        other, memory = remembering(described, base.nominal, base.samples, base.settings)
        if base.left_unseen(other).sum() >= base.left_unseen(model).sum():
            return model
        self.causes = [cause for cause in self.causes if cause.effect not in MEMORY]
        self.causes += [_of_start(terms) for terms in memory]
        return other

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
    # A correction of the torque itself may replace only another such correction: it resembles most effects.
    scaling = best.effect in SCALING
    return [rival for rival in best.alike if scaling or rival.effect not in SCALING][: MOST_FITTED - 1]


def terms_of(causes: Sequence[Cause]) -> list[Term]:
    """Return the terms of all causes."""
    return [term for cause in causes for term in cause.terms]


def _of_start(terms: tuple[Term, ...]) -> Cause:
    """Return a cause of the base, at one place or several."""
    candidate, place = terms[0].candidate, terms[0].place if len(terms) == 1 else Place()
    return Cause(Where(candidate.name, *place), candidate.title, candidate.explanation, terms=terms)


# --- from recordings to causes ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Search:
    """The result of a search."""

    base: Base  # its samples, without events
    extended: FittedModel
    first: View  # what the nominal and the extended description lack and leave
    last: View
    causes: tuple[Cause, ...]  # in the order in which they were found
    small: tuple[Cause, ...]  # effects that are certain but not material
    events: tuple[Event, ...]  # contact and stalls


def search(base: Base, *, least_gain: float, seed: int, phases: Phases) -> Search:
    """Search for the causes that a description lacks."""
    with phases.start("contact"):
        whole = base.samples
        events, out = events_of(base.model.data, whole, seed)
        base = base.without(out) if out.any() else base
    with phases.start("causes", MOST_CAUSES) as step:
        searched = ExtensionSearch(base, least_gain)
        searched.run(step)
    if events:
        # drop events that the causes explain
        left, _ = events_of(searched.model.data, whole, seed)
        events = tuple(event for event in events if any(_overlap(event, other) for other in left))
    return Search(
        base=base,
        extended=searched.model,
        first=searched.first,
        last=searched.view,
        causes=tuple(searched.causes),
        small=(*searched.refused, *searched.small()),
        events=events,
    )


def _overlap(one: Event, other: Event) -> bool:
    return one.recording == other.recording and one.start < other.end and other.start < one.end
