"""What a description lacks: base, events, and one cause after the other, with all numbers fitted again after each.

After each cause, everything is computed anew around the fitted description. The derivatives of a wrong model would
otherwise ask for small pieces that only correct the linearisation. The search ends when no candidate is material and
certain. The rules by which a round chooses a cause, in their order:

1. What was refused explains something, so no other effect is credited with that; corrections of the torque apart.
2. The effect that lowers the error most comes first, at the coarsest place that is as good (`Selection.best`).
3. All corrections of sensors together come before it if they are materially and certainly better (`is_better`).
4. Effects that columns cannot distinguish from it are fitted, too, and the best fit is taken: columns of a wrong model
   mislead. A correction of the torque may replace only another one: it resembles most effects (`_to_fit`).
5. Of fits that are alike, torque that depends on the angles comes first, since friction takes it up; else the one with
   fewest numbers.
6. The effect is fitted at the nearly best places, too, and the best is taken; in place of several of a joint or tendon
   one alone if it is better by more than what does not count.
7. A single sensor may be several, if their usual errors explain nearly as much (`beside_calibration`).
8. At last, friction by the force of several tendons at a joint is that by the force of all, if they gain little more.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.base import POSITION, Base, forgetful, refitted, remembering
from tendonfmu.diagnosis.candidate_columns import EVERYWHERE, Candidate, Proposal
from tendonfmu.diagnosis.contact_scan import events_of
from tendonfmu.diagnosis.delay import DELAY, SHOWN
from tendonfmu.diagnosis.effects import CALIBRATED, CALIBRATION, OF_LAW, Place, Term, Where, by_name
from tendonfmu.diagnosis.extension_fit import (
    REMEMBERING,
    FittedModel,
    extended_description,
    fit_extended,
    memory_of,
    possible,
)
from tendonfmu.diagnosis.result import ABSORBED, CausePlace, Event, Sensor, with_error
from tendonfmu.diagnosis.selection import (
    CERTAIN,
    SAME,
    SIGNIFICANCE,
    CauseSearch,
    Judged,
    Selection,
    is_alike,
    rms_gain,
    step_p_value,
)
from tendonfmu.diagnosis.view import View
from tendonfmu.estimate import SCALING
from tendonfmu.model import Finger, moment_arms
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
UNITS = {"force_gain": "1", "force_offset": "N", "moment_arm": "m", "time_delay": "s"}


@dataclass(frozen=True)
class _Part:
    """A correction that may be needed."""

    proposal: Proposal
    usual: float  # size in the unit of the magnitude
    unit: float  # what a magnitude of 1 is, in the unit of the number

    def term(self, magnitude: float) -> Term:
        """Return a term of that size; a fit leaves it as it is, except for a delay, which is not linear."""
        mechanism, place, shape = self.proposal.mechanism, self.proposal.place, self.proposal.variant.shape
        if mechanism.name == "time_delay":
            return Term(mechanism, place, {"delay": self.unit * magnitude}, (1.0,))
        return Term(mechanism, place, shape, (magnitude,), fixed=True)


def calibration(view: View, selection: Selection, tried: Collection[str], least_gain: float) -> Judged | None:
    """Return all corrections together, if they are material and certain; `tried` are effects that were refused."""
    if CALIBRATION in tried:
        return None
    parts = _parts(view, tried)
    best = _estimated(view, selection, parts)
    late = Where("time_delay")
    sizes = {} if best is None else dict(zip(parts, best.magnitudes.tolist(), strict=True))
    if late in sizes and abs(parts[late].unit * sizes[late]) < view.least.least(late):  # the sensors cannot show it
        del parts[late]
        best = _estimated(view, selection, parts)
    if best is None:
        return None
    gain, error = selection.gain(best)
    if gain < least_gain or gain <= CERTAIN * error:
        return None
    return replace(
        best,
        gain=with_error(gain, error),
        p_value=min(1.0, len(STRENGTHS) * step_p_value(selection.base, best.unseen)),
        terms=tuple(part.term(value) for part, value in zip(parts.values(), best.magnitudes.tolist(), strict=True)),
        sensors=_sensors(moment_arms(view.data), best, parts),
    )


def is_better(together: Judged, single: Judged | None, least_gain: float) -> bool:
    """Return whether all corrections together are materially and certainly better than the best single effect.

    A single sensor that explains nearly as much is named by itself.
    """
    if single is None:
        return True
    if single.effect in CALIBRATED and single.gain.value >= NEARLY * together.gain.value:
        return False
    gain, error = rms_gain(single.unseen, together.unseen)
    return gain >= least_gain and gain > CERTAIN * error


def beside_calibration(trial: Trial, together: Judged | None) -> Trial:
    """Say of a single sensor that is off that it may be several, if their usual errors explain nearly as much."""
    cause = trial.cause
    if together is None or cause.effect not in CALIBRATED or together.gain.value < NEARLY * cause.gain.value:
        return trial
    return replace(trial, cause=replace(cause, alike=(*cause.alike, together)))


def _parts(view: View, tried: Collection[str]) -> dict[Where, _Part]:
    """Return the corrections that the description lacks and that refitting leaves visible."""
    arms, count = moment_arms(view.data), view.columns.values.shape[2]
    parts: dict[Where, _Part] = {}
    for proposal in view.columns.proposals:
        name, place = proposal.mechanism.name, proposal.place
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
    return parts


def _estimated(view: View, selection: Selection, parts: dict[Where, _Part]) -> Judged | None:
    """Return the corrections with the strength of the prior knowledge that leaves least on unseen stretches."""
    if not parts:
        return None
    usual = np.array([part.usual for part in parts.values()])
    mix = np.zeros((view.columns.values.shape[2], len(parts)))
    mix[[part.proposal.columns.start for part in parts.values()], np.arange(len(parts))] = 1.0
    together = Candidate(Where(CALIBRATION), (), mix, -LARGEST * usual, LARGEST * usual, EVERYWHERE, usual)
    fits = [selection.regularised(together, view.grams.ridge(usual, strength)) for strength in STRENGTHS]
    plausible = [fit for fit in fits if np.mean((fit.magnitudes / usual) ** 2) <= PLAUSIBLE**2]
    return min(plausible, key=lambda fit: float(fit.unseen.sum()), default=None)


def _sensors(arms: Numbers, cause: Judged, parts: dict[Where, _Part]) -> tuple[Sensor, ...]:
    """Return each correction, and gain and arm of a tendon together where only these can be determined."""
    rows: list[tuple[Where, str, Numbers]] = []
    ways = dict(zip(parts, np.eye(len(parts)), strict=True))
    for where, part in parts.items():
        rows.append((where, UNITS[where.effect], alone := part.unit * ways[where]))
        gain = Where("force_gain", None, where.tendon)
        if where.effect == "moment_arm" and gain in ways and where.joint is not None and where.tendon is not None:
            both = alone / float(arms[where.tendon - 1, where.joint - 1]) + ways[gain]
            rows.append((Where(CALIBRATION, *where.place), "1", both))
    return tuple(
        Sensor(where, with_error(float(mix @ cause.magnitudes), float(np.sqrt(mix @ cause.covariance @ mix))), unit)
        for where, unit, mix in rows
    )


def calibrated(cause: Judged, places: Sequence[CausePlace], intervals: Mapping[str, Interval]) -> dict[str, Any]:
    """Return what is known of a calibration: its sensors, one place for all numbers there, intervals, and its size."""
    known, known_intervals = {sensor.where: sensor for sensor in cause.sensors}, dict(intervals)
    merged: dict[Place, dict[str, tuple[float, str]]] = {}
    for term, place in zip(cause.terms, places, strict=True):
        merged.setdefault(term.place, {}).update(place.parameters)
        ((value, unit),) = place.parameters.values()
        before = known.get(term.where, Sensor(term.where, Interval(value), unit)).correction
        moved = value - before.value  # a delay was fitted again
        now = Interval(value, before.low + moved, before.high + moved)
        known[term.where] = Sensor(term.where, now, unit)
        known_intervals |= dict.fromkeys(place.parameters, now)
    sensors = tuple(known.values())
    merged_places = tuple(CausePlace(*place, numbers) for place, numbers in merged.items())
    return {"sensors": sensors, "places": merged_places, "intervals": known_intervals, "size": _size(sensors)}


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
# Of the rms that a memory explains: another form of it explains so much more. What depends on the same motions and
# loads as friction, or scales the torque, resembles that.
FORM = 0.09
LIKE_A_LAW = {*OF_LAW, *SCALING}
OF_ONE, OF_ALL = "load_friction", "joint_load_friction"


@dataclass(frozen=True)
class Trial:
    """A cause and the model fitted with it; the model is None if there is none."""

    cause: Judged
    model: FittedModel | None
    error: Numbers  # Σ e² on unseen stretches, (N·m)² [K]


class ExtensionSearch(CauseSearch):
    """Adds cause after cause to a base, and keeps the model with all of them."""

    events: tuple[Event, ...] = ()  # contact and stalls, which the samples of the base lack
    of_memory = 0.0  # (N·m)² on unseen stretches that the memory explains

    def __init__(self, base: Base, least_gain: float) -> None:
        super().__init__(MOST_CAUSES + len(base.start))
        self.base, self.model, self._least_gain = base, base.model, least_gain
        self.first = base.look(base.nominal, ())  # what the nominal description lacks and leaves
        self.causes = [_of_start(terms) for terms in base.start]
        self._answered = {DELAY.name} if base.positions.delay is not None else set()  # by other evidence than torque

    def run(self, step: Step) -> None:
        self.view = self.base.look(self.model)
        plain = forgetful(self.model, self.base.samples, self.base.settings)
        self.of_memory = float(self.base.left_unseen(plain).sum() - self.view.selection.base.sum())
        super().run(step)
        for joint in range(1, len(self.base.nominal.data["joints"]) + 1):
            self._unite(joint)

    def _try_next(self, tried: set[str]) -> tuple[Judged, bool] | None:
        tried = tried | self._answered
        selection = self.view.beside({refused.where for refused in self.refused if refused.effect not in SCALING})
        best = selection.best(self._least_gain, tried)
        together = calibration(self.view, selection, tried, self._least_gain)
        if together is not None and is_better(together, best, self._least_gain):
            trial = self._tried(together)
        elif best is not None:
            trial = beside_calibration(self._best_fitted(selection, best), together)
        else:
            return None
        if trial.cause.p_value < SIGNIFICANCE and self._take(trial):
            return trial.cause, True
        # columns around a model without the cause promise more than the fit with it keeps
        kept = trial.cause.gain if trial.model is None else with_error(*rms_gain(self.view.selection.base, trial.error))
        return replace(trial.cause, gain=kept), False

    def _best_fitted(self, selection: Selection, best: Judged) -> Trial:
        """Fit the effect, its rivals and its places, and return the best trial."""
        rivals = [self._named(selection.refined(rival.effect), selection) for rival in _to_fit(best)]
        trials = self._certain_trials([self._named(best, selection)], rivals)
        chosen = _best_of(trials)
        same = [trial for trial in trials if trial.model is not None and is_alike(trial.error, chosen.error)]
        simplest = min(same, key=lambda trial: (len(trial.cause.low), float(trial.error.sum())), default=chosen)
        chosen = next((trial for trial in same if trial.cause.effect in POSITION), simplest)
        fitted = {trial.cause.effect for trial in trials}
        alike = [trial.cause for trial in same if trial is not chosen]
        alike += [rival for rival in best.alike if rival.effect not in fitted]
        if chosen.cause.mix is (there := selection.refined(chosen.cause.effect)).mix:
            near = [self._named(near, selection) for near in selection.near(there)[: MOST_FITTED - 1]]
            placed = _best_of([chosen, *self._certain_trials([], near)])
            counts = placed.cause.level == chosen.cause.level or chosen.error.sum() > (1.0 + SAME) * placed.error.sum()
            chosen = placed if counts else chosen
        return replace(chosen, cause=replace(chosen.cause, alike=tuple(alike)))

    def _certain_trials(self, first: Sequence[Judged], others: Sequence[Judged]) -> list[Trial]:
        """Fit the first causes, and the others that are no chance."""
        return [self._tried(cause) for cause in (*first, *(one for one in others if one.p_value < SIGNIFICANCE))]

    def _named(self, cause: Judged, selection: Selection) -> Judged:
        """Return a judged candidate with its terms at its magnitudes, gain and p-value."""
        gain, p_value = with_error(*selection.gain(cause)), self.view.p_value(cause.mix)
        return replace(cause, terms=cause.scaled(), gain=gain, p_value=p_value)

    def _tried(self, cause: Judged, beside: Sequence[Judged] | None = None) -> Trial:
        """Fit the description with a further cause, beside all others or some."""
        base = self.base
        everything = terms_of([*(self.causes if beside is None else beside), cause])
        terms = possible(base.nominal.data, everything)
        if len(terms) < len(everything):
            return Trial(cause, None, np.array([np.inf]))
        # predict with the cause: forces predicted without a delay are not late, so no fit would find a delay in them
        begin = extended_description(self.model.data, cause.terms)
        predicted = base.samples.at_predicted_forces(begin)
        model = fit_extended(base.nominal, terms, predicted, base.settings, self.model, rough=True)
        model = refitted(model, base.samples, base.settings, rough=True)
        shown = base.least.shows_all(cause.effect, cause.terms, model.data)
        if not shown or (cause.effect in SHOWN and base.positions.contradict(self.model.data, model.data)):
            return Trial(cause, None, np.array([np.inf]))
        return Trial(cause, model, base.left_unseen(model))

    def _take(self, trial: Trial) -> bool:
        """Keep a further cause if it lowers the error on unseen stretches materially and certainly."""
        before, after, model, cause = self.view.selection.base, trial.error, trial.model, trial.cause
        if model is None or not self.lowers(cause.effect, before, after):
            return False
        gain, error = rms_gain(before, after)
        p_value = cause.p_value if cause.p_value < SIGNIFICANCE else step_p_value(before, after)
        self.causes.append(replace(cause, gain=with_error(gain, error), p_value=p_value))
        self.model = self._settled(refitted(model, self.base.samples, self.base.settings), gain)
        self.view = self.view.lean  # frees memory for the next one
        self.view = self.base.look(self.model)
        return True

    def lowers(self, effect: str, before: Numbers, after: Numbers) -> bool:
        """Return whether Σ e² [K] falls materially, certainly, and by more than another form of the memory does."""
        gain, error = rms_gain(before, after)
        is_more = effect not in LIKE_A_LAW or (before - after).sum() >= FORM**2 * self.of_memory
        return bool(gain >= self._least_gain and gain > CERTAIN * error and is_more)

    def _settled(self, model: FittedModel, gain: float) -> FittedModel:
        """Return a model with its memory chosen anew, from several starts, if that is better beside a large cause."""
        base = self.base
        if gain < LARGE or not memory_of(model.data):
            return model
        described = Finger(base.settings.path, model.data)
        other, memory = remembering(described, base.nominal, base.samples, base.settings, base.model.fixed)
        explained = base.left_unseen(model).sum() - base.left_unseen(other).sum()
        if explained <= 0.0:
            return model
        self.of_memory += float(explained)
        self.causes = [cause for cause in self.causes if cause.effect not in REMEMBERING]
        self.causes += [_of_start(terms) for terms in memory]
        return other

    def _unite(self, joint: int) -> None:
        """Take friction by the force of all tendons for that of several at a joint, which would have to gain more."""
        base, single = self.base, [cause for cause in self.causes if cause.effect == OF_ONE]
        terms = [term for cause in single for term in cause.terms if term.place.joint == joint]
        others = [cause for cause in self.causes if not any(term in terms for term in cause.terms)]
        if len(terms) < 2 or len(terms_of(others)) + len(terms) < len(terms_of(self.causes)):
            return
        bare = fit_extended(base.nominal, terms_of(others), base.samples, base.settings, self.model, rough=True)
        selection = base.look(bare, [by_name(OF_ALL)]).selection
        united = [each for each in selection.ranked(set()) if each.where.joint == joint]
        if not united:
            return
        p_value = min(cause.p_value for cause in single)
        trial = self._tried(replace(united[0], terms=united[0].scaled(), p_value=p_value, alike=tuple(single)), others)
        if trial.model is not None and rms_gain(trial.error, self.view.selection.base)[0] < self._least_gain:
            self.causes = [*others, trial.cause]
            self.model = refitted(trial.model, base.samples, base.settings)
            self.view = base.look(self.model)

    @cached_property
    def small(self) -> list[Judged]:
        """What was refused, and the best place of every other effect that is certain but not material."""
        selection, known = self.view.selection, {refused.effect for refused in self.refused} | self._answered
        gains = [(cause, *selection.gain(cause)) for cause in selection.ranked(known)]
        named = [self._named(cause, selection) for cause, gain, error in gains if gain > CERTAIN * error]
        return [*self.refused, *(cause for cause in named if cause.p_value < SIGNIFICANCE)]


def _best_of(trials: Sequence[Trial]) -> Trial:
    return min(trials, key=lambda trial: float(trial.error.sum()))


def _to_fit(best: Judged) -> list[Judged]:
    """Return the effects that cannot be distinguished from the best one and may replace it."""
    scaling = best.effect in SCALING
    return [rival for rival in best.alike if scaling or rival.effect not in SCALING][: MOST_FITTED - 1]


def terms_of(causes: Sequence[Judged]) -> list[Term]:
    """Return the terms of all causes."""
    return [term for cause in causes for term in cause.terms]


def _of_start(terms: tuple[Term, ...]) -> Judged:
    """Return a cause of the base, at one place or several."""
    place = terms[0].place if len(terms) == 1 else Place()
    return Judged(Where(terms[0].mechanism.name, *place), terms)


# --- from recordings to causes ---------------------------------------------------------------------------------------


def search(base: Base, *, least_gain: float, seed: int, phases: Phases) -> ExtensionSearch:
    """Search for the causes that a description lacks."""
    with phases.start("contact"):
        whole = base.samples
        events, out = events_of(base.model.data, whole, seed)
        base = base.without(out) if out.any() else base
    with phases.start("causes", MOST_CAUSES) as step:
        searched = ExtensionSearch(base, least_gain)
        searched.run(step)
    # drop events that the causes explain
    left = events_of(searched.model.data, whole, seed)[0] if events else ()
    searched.events = tuple(
        event
        for event in events
        if any(one.recording == event.recording and one.start < event.end and event.start < one.end for one in left)
    )
    return searched
