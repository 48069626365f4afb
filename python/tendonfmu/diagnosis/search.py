"""What a description lacks: base, events, and one cause after the other, with all numbers fitted again after each.

After each cause, everything is computed anew around the fitted description. The derivatives of a wrong model would
otherwise ask for small pieces that only correct the linearisation. The search ends when no candidate is material and
certain.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.base import POSITION, Base, refitted, remembering
from tendonfmu.diagnosis.candidate_columns import Proposal
from tendonfmu.diagnosis.contact_scan import events_of
from tendonfmu.diagnosis.effects import BY_NAME, CALIBRATED, CALIBRATION, Place, Term, Where
from tendonfmu.diagnosis.extension_fit import (
    REMEMBERING,
    FittedModel,
    extended_description,
    fit_extended,
    memory_of,
    possible,
)
from tendonfmu.diagnosis.result import ABSORBED, EVERYWHERE, Cause, CausePlace, Direction, Event, Sensor, with_error
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
from tendonfmu.model import finger_from_data, moment_arms
from tendonfmu.statistics import Interval
from tendonfmu.tasks import Phases, Step

# --- corrections of sensors together ----------------------------------------------------------------------------------
# Each alone removes little of the error. Together they are a ridge regression: every correction is expected to be as
# large as a bench usually has it, and how strongly this counts is chosen by the error on unseen stretches. They are one
# cause, named if it is certainly better than the best single effect, so that one sensor that is off has its own name.


STRENGTHS = (0.03, 0.1, 0.3, 1.0, 3.0)  # of the prior knowledge; 1 takes the usual sizes at their word
# Root mean square of all corrections, in usual sizes. Larger ones imitate something else that is missing.
PLAUSIBLE = 1.5
LARGEST = 5.0  # times the usual size
_SHOWN = 3  # sensors named in the size
# Standard deviations on a bench that was set up with ordinary care; of a moment arm as a share of the described one.
USUAL = {"force_gain": 0.03, "force_offset": 0.3, "moment_arm": 0.03, "time_delay": 0.002}


@dataclass(frozen=True)
class _Part:
    """A correction that may be needed."""

    proposal: Proposal
    usual: float  # size in the unit of the magnitude
    unit: float  # what a magnitude of 1 is, in the unit of the number


def calibration(view: View, selection: Selection, tried: Collection[str], least_gain: float) -> Cause | None:
    """Return all corrections together, if they are material and certain; `tried` are effects that were refused."""
    if CALIBRATION in tried:
        return None
    parts = _parts(view, tried)
    best = _estimated(view, selection, parts)
    if best is not None and not _late_enough(view, best, parts):
        parts = [part for part in parts if part.proposal.candidate.name != "time_delay"]
        best = _estimated(view, selection, parts)
    if best is None:
        return None
    gain, error = selection.gain(best)
    if gain < least_gain or gain <= CERTAIN * error:
        return None
    p_value = min(1.0, len(STRENGTHS) * step_p_value(selection.base, best.unseen))
    terms = tuple(_term(part, value) for part, value in zip(parts, best.magnitudes.tolist(), strict=True))
    return replace(
        best, gain=with_error(gain, error), p_value=p_value, terms=terms, sensors=_sensors(view, best, parts)
    )


def is_better(together: Cause, single: Cause | None, least_gain: float) -> bool:
    """Return whether all corrections together are materially and certainly better than the best single effect."""
    if single is None:
        return True
    gain, error = rms_gain(single.unseen, together.unseen)
    return gain >= least_gain and gain > CERTAIN * error


def _parts(view: View, tried: Collection[str]) -> list[_Part]:
    """Return the corrections that the description lacks and that refitting leaves visible."""
    arms, count = moment_arms(view.data), view.columns.values.shape[2]
    parts: dict[Where, _Part] = {}
    for proposal in view.columns.proposals:
        name, place = proposal.candidate.name, proposal.place
        if name not in CALIBRATED or name in tried:
            continue
        usual, unit = USUAL[name], 1.0
        if name == "moment_arm" and place.joint is not None and place.tendon is not None:
            usual *= abs(float(arms[place.tendon - 1, place.joint - 1]))
        if name == "time_delay":
            unit = float(proposal.variant.shape["delay"])
            usual /= abs(unit)
        mix = np.zeros((count, 1))
        mix[proposal.columns] = 1.0
        if usual > 0.0 and unit > 0.0 and view.grams.surviving(mix) >= ABSORBED:
            parts.setdefault(Where(name, *place), _Part(proposal, usual, unit))
    return list(parts.values())


def _estimated(view: View, selection: Selection, parts: Sequence[_Part]) -> Cause | None:
    """Return the corrections with the strength of the prior knowledge that leaves least on unseen stretches."""
    if not parts:
        return None
    usual = np.array([part.usual for part in parts])
    mix = np.zeros((view.columns.values.shape[2], len(parts)))
    mix[[part.proposal.columns.start for part in parts], np.arange(len(parts))] = 1.0
    row = BY_NAME[CALIBRATION]
    direction = Direction(mix, -LARGEST * usual, LARGEST * usual, EVERYWHERE, usual)
    cause = Cause(Where(CALIBRATION), row.title, row.explanation, direction=direction)
    fits = [selection.regularised(cause, view.grams.ridge(usual, strength)) for strength in STRENGTHS]
    plausible = [fit for fit in fits if np.mean((fit.magnitudes / usual) ** 2) <= PLAUSIBLE**2]
    return min(plausible, key=lambda fit: float(fit.unseen.sum()), default=None)


def _late_enough(view: View, cause: Cause, parts: Sequence[_Part]) -> bool:
    """Return whether the sensors can show the delay."""
    return all(
        abs(part.unit * magnitude) >= view.least.least(Where("time_delay"))
        for part, magnitude in zip(parts, cause.magnitudes.tolist(), strict=True)
        if part.proposal.candidate.name == "time_delay"
    )


def _term(part: _Part, magnitude: float) -> Term:
    """Return a term of that size; a fit leaves it as it is, except for a delay, which is not linear."""
    proposal = part.proposal
    if proposal.candidate.name == "time_delay":
        return Term(proposal.candidate, proposal.place, {"delay": part.unit * magnitude}, (1.0,))
    return Term(proposal.candidate, proposal.place, proposal.variant.shape, (magnitude,), fixed=True)


# --- by how much each is off ------------------------------------------------------------------------------------------


def _sensors(view: View, cause: Cause, parts: Sequence[_Part]) -> tuple[Sensor, ...]:
    """Return each correction, and gain and arm of a tendon together where only these can be determined."""
    arms = moment_arms(view.data)
    index = {(part.proposal.candidate.name, part.proposal.place): k for k, part in enumerate(parts)}
    rows: list[tuple[Where, str, Numbers]] = []
    for (name, place), k in index.items():
        unit = {"force_gain": "1", "force_offset": "N", "moment_arm": "m", "time_delay": "s"}[name]
        alone = np.zeros(len(parts))
        alone[k] = parts[k].unit
        rows.append((Where(name, *place), unit, alone))
        gain = index.get(("force_gain", Place(tendon=place.tendon)))
        if name == "moment_arm" and gain is not None and place.joint is not None and place.tendon is not None:
            both = alone / float(arms[place.tendon - 1, place.joint - 1])
            both[gain] = 1.0
            rows.append((Where(CALIBRATION, *place), "1", both))
    return tuple(
        Sensor(where, with_error(float(mix @ cause.magnitudes), float(np.sqrt(mix @ cause.covariance @ mix))), unit)
        for where, unit, mix in rows
    )


def calibrated(cause: Cause) -> Cause:
    """Return a calibration of the fitted model: its sensors, one place for all numbers there, and its size."""
    known, intervals = {sensor.where: sensor for sensor in cause.sensors}, dict(cause.intervals)
    merged: dict[tuple[int | None, int | None], dict[str, tuple[float, str]]] = {}
    for term, place in zip(cause.terms, cause.places, strict=True):
        merged.setdefault((place.joint, place.tendon), {}).update(place.parameters)
        ((value, unit),) = place.parameters.values()
        where = term.where
        before = known.get(where, Sensor(where, Interval(value), unit)).correction
        moved = value - before.value  # a delay was fitted again
        known[where] = Sensor(where, Interval(value, before.low + moved, before.high + moved), unit)
        intervals |= dict.fromkeys(place.parameters, known[where].correction)
    sensors = tuple(known.values())
    places = tuple(CausePlace(*place, numbers) for place, numbers in merged.items())
    return replace(cause, sensors=sensors, places=places, intervals=intervals, size=_size(sensors))


def _size(sensors: Sequence[Sensor]) -> str:
    """Name the sensors that are most certainly off."""
    certain = sorted((s for s in sensors if s.is_off), key=_distance)
    shown = [" ".join(s.words) for s in (certain or sensors)[:_SHOWN]]
    more = len(certain) - len(shown)
    return "; ".join(shown) + (f"; {more} more" if more > 0 else "")


def _distance(sensor: Sensor) -> float:
    """Return how far 0 is from the interval, negative, in halves of the interval."""
    size = sensor.correction
    return -abs(size.value) / max(size.high - size.low, 1e-300) if np.isfinite(size.high) else 0.0


# --- one cause after the other ----------------------------------------------------------------------------------------

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
        self.causes = [cause for cause in self.causes if cause.effect not in REMEMBERING]
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
