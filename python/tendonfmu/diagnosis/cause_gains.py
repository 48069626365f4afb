"""How much each cause gains on unseen data; causes that gain nothing there are dropped."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.cause import Cause, CausePlace, Where
from tendonfmu.diagnosis.effects import CALIBRATED, CALIBRATION, OF_LAW, Term
from tendonfmu.diagnosis.extension_fit import (
    FitSettings,
    FittedModel,
    cause_parameters,
    fit_extended,
    fit_numbers,
    with_known,
)
from tendonfmu.diagnosis.gain import Gain, OnlineError, measure_gain, squared_residual
from tendonfmu.diagnosis.search import Search, terms_of
from tendonfmu.diagnosis.selection import by_gain, confirmed, names_with
from tendonfmu.diagnosis.signal_choice import estimation_recordings
from tendonfmu.diagnosis.sliding import settled, without_stuck
from tendonfmu.estimate import get_number
from tendonfmu.model import Finger
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import Interval, gain_interval

# Times the least gain where the form of any friction law is a part of what is left: where everything slides, and for
# effects that depend on what a law depends on, if how friction builds up was found, too.
STRICTER = 5.0


@dataclass(frozen=True)
class Verified:
    """The causes that unseen data confirm."""

    causes: tuple[Cause, ...]  # in order of gain, the largest first; places of one effect are one cause
    without: tuple[FittedModel, ...]  # for each cause, the fit that lacks it
    dropped: tuple[Cause, ...]  # causes that unseen data do not confirm
    gain: Gain
    nominal_data: Data  # descriptions as they run online
    extended_data: Data
    extended: Data  # extended description with the settings for estimation
    fits_sliding: bool  # whether its numbers were fitted only where everything slides


def verify(
    given: Finger,
    result: Search,
    training: Sequence[FitRecording],
    tests: Sequence[FitRecording],
    least_gain: float,
    settings: FitSettings,
    seed: int,
) -> Verified:
    """Measure the gain of each cause on unseen data and drop the weak ones."""
    bench = _Bench(given, result, training, tests, settings, seed)

    def judge(causes: list[Cause]) -> tuple[list[Cause], list[int]]:
        fit, without = bench.fit(causes), bench.each_without(causes)
        gains = bench.gains(fit, without)
        needed = _needed(causes, gains, result.only_sliding)
        weak = [
            k
            for k, (cause, gain) in enumerate(zip(causes, gains, strict=True))
            if not (
                gain.low > 0.0
                and gain.value >= least_gain * needed[k]
                and bench.runs_better(fit, without[k])
                and result.estimation.least.shows_all(cause.effect, cause.terms, fit.data)
            )
        ]
        if not weak and causes and not bench.is_sound(causes):
            weak = list(range(len(causes)))  # each corrects what another one spoils
        return [replace(cause, gain=gain) for cause, gain in zip(causes, gains, strict=True)], weak

    causes, dropped = confirmed(merged(result.causes), judge)
    fit, nominal = bench.result(causes), bench.written(bench.nominal)
    extended = bench.written(fit) if causes else nominal
    ranked = by_gain(bench.with_places(fit, causes))
    between = [bench.online(bench.result(ranked[: k + 1])) for k in range(len(ranked) - 1)]
    return Verified(
        causes=tuple(ranked),
        without=tuple(bench.each_without(ranked)),
        dropped=tuple(dropped),
        gain=measure_gain(nominal, extended, training, tests, between=between, seed=seed),
        nominal_data=nominal,
        extended_data=extended,
        extended=fit.data,
        fits_sliding=bench.fits_sliding,
    )


def _needed(causes: Sequence[Cause], gains: Sequence[Interval], only_sliding: bool) -> list[float]:
    """Return how many times the least gain each cause needs.

    That is the number of names up to and including it, the largest gain first, or more beside the form of a law.
    """
    needed, named = [1.0] * len(causes), list[str]()
    builds_up = any(cause.effect == "presliding" for cause in causes)
    for k in sorted(range(len(causes)), key=lambda k: -gains[k].value):
        effect = causes[k].effect
        factor = STRICTER if only_sliding else 1.0
        needed[k] = factor * names_with(effect, named)
        if builds_up and effect in OF_LAW:
            needed[k] = max(needed[k], STRICTER)
        named.append(effect)
    return needed


def merged(causes: Sequence[Cause]) -> list[Cause]:
    """Merge the places of one effect into one cause."""
    by_effect: dict[str, Cause] = {}
    calibrated = CALIBRATED if any(cause.effect == CALIBRATION for cause in causes) else ()
    # a single sensor that was found beside several belongs to them
    for cause in sorted(causes, key=lambda cause: cause.effect != CALIBRATION) if calibrated else causes:
        effect = CALIBRATION if cause.effect in calibrated else cause.effect
        known = by_effect.get(effect)
        if known is None:
            by_effect[effect] = cause
            continue
        joint = known.joint if known.joint == cause.joint else None
        tendon = known.tendon if known.tendon == cause.tendon else None
        by_effect[effect] = replace(
            known,
            where=Where(effect, joint, tendon),
            terms=(*known.terms, *cause.terms),
            p_value=min(known.p_value, cause.p_value),
            alike=(*known.alike, *cause.alike),
        )
    return [replace(cause, alike=_rivals(cause, by_effect)) for cause in by_effect.values()]


def _rivals(cause: Cause, named: Collection[str]) -> tuple[Cause, ...]:
    """Return the best rival of every effect that is not named itself."""
    rivals: dict[str, Cause] = {}
    for other in cause.alike:
        if other.effect not in named:
            rivals.setdefault(other.effect, other)
    return tuple(rivals.values())


class _Bench:
    """Fits of any set of causes, and their residuals on unseen data."""

    def __init__(
        self,
        given: Finger,
        result: Search,
        training: Sequence[FitRecording],
        tests: Sequence[FitRecording],
        settings: FitSettings,
        seed: int,
    ) -> None:
        self._given, self._result, self._settings, self._seed = given, result, settings, seed
        self._training, self._tests = training, tests
        self._fits: dict[tuple[frozenset[int], bool], FittedModel] = {}
        self._order: dict[frozenset[int], list[Term]] = {}  # of the terms in a fitted description
        self._errors: dict[int, tuple[FittedModel, Numbers]] = {}
        self._settled_fits: dict[int, FittedModel] = {}
        self._signals = result.estimation.signals
        self.nominal, self._fit_to, self._everything = result.nominal, list(result.fitted_to), list(result.everything)
        if tests:  # the search has fitted to the same samples
            for count, model in enumerate(result.models):
                known = [term for cause in result.causes[:count] for term in cause.terms]
                self._fits[frozenset(map(id, known)), result.only_sliding] = model
                self._order[frozenset(map(id, known))] = known
        else:
            self._hold_out()
        self.fits_sliding = result.only_sliding

    def _hold_out(self) -> None:
        """Exclude the judged samples from the fits."""
        finger = replace(self._given, data=self._signals.description(self._given.data))
        own = estimation_recordings(finger, self._training, self._signals)
        self._fit_to, self._everything = (
            [replace(clean, train=clean.train & recording.train) for clean, recording in zip(seen, own, strict=True)]
            for seen in (self._fit_to, self._everything)
        )
        self.nominal = fit_numbers(self.nominal.data, self._everything, self._settings, given=self.nominal.given)

    def fit(self, causes: Sequence[Cause]) -> FittedModel:
        """Return the fit that causes are judged by."""
        return self._settled(causes, self._result.only_sliding)

    def result(self, causes: Sequence[Cause]) -> FittedModel:
        """Return the fit that becomes the extended model."""
        return self._settled(causes, self.fits_sliding)

    def _settled(self, causes: Sequence[Cause], sliding: bool) -> FittedModel:
        """Return a fit that runs over stuck samples, too: of those that slide it learns no distance of presliding."""
        model = self._fit(causes, sliding)
        if not sliding:
            return model
        key = id(model)
        if key not in self._settled_fits:
            data = settled(model.data, self._trained)
            self._settled_fits[key] = replace(
                model, data=data, values={path: get_number(data, path) for path in model.values}
            )
        return self._settled_fits[key]

    def _trained(self, data: Data) -> float:
        """Return Σ r² over all samples that are fitted to, (N·m)²."""
        return squared_residual(self._result.estimation.online(data), self._training)

    def is_sound(self, causes: Sequence[Cause]) -> bool:
        """Return whether all causes together run better than the nominal model."""
        fit = self.result(causes)
        if self.runs_better(fit, self.nominal) and self.holds(fit):
            return True
        if not self.fits_sliding:
            return False
        self.fits_sliding = False
        return self.holds(self.result(causes))

    def _fit(self, causes: Sequence[Cause], sliding: bool) -> FittedModel:
        terms = terms_of(causes)
        key = frozenset(map(id, terms)), sliding
        if key not in self._fits:
            fit_to = self._fit_to if sliding else self._everything
            if terms and self._result.causes:
                fit_to = [
                    replace(clean, train=recording.train)
                    for clean, recording in zip(self._predicted, fit_to, strict=True)
                ]
            order = self._order.setdefault(key[0], terms)
            self._fits[key] = fit_extended(self.nominal, order, fit_to, self._settings)
        return self._fits[key]

    def with_places(self, model: FittedModel, causes: Sequence[Cause]) -> list[Cause]:
        """Return the causes with the numbers of each of their places in a model that was fitted with all of them."""
        order = self._order.get(frozenset(id(term) for cause in causes for term in cause.terms), [])
        found = cause_parameters(self.nominal.data, order, model)
        numbers = {id(term): own for term, own in zip(order, found, strict=True)}
        return [
            replace(
                cause,
                places=tuple(
                    CausePlace(term.place.joint, term.place.tendon, numbers[id(term)]) for term in cause.terms
                ),
            )
            for cause in causes
        ]

    @cached_property
    def _predicted(self) -> list[FitRecording]:
        """Return the recordings with the forces that the model of all causes predicts."""
        return self._result.estimation.predicted(self._result.extended.data, self._result.out)

    def each_without(self, causes: Sequence[Cause]) -> list[FittedModel]:
        """Return, for each cause, the fit that lacks it."""
        return [self.fit([*causes[:k], *causes[k + 1 :]]) for k in range(len(causes))]

    def gains(self, model: FittedModel, without: Sequence[FittedModel]) -> list[Interval]:
        after = self._error(model)
        return [gain_interval(self._error(model), after, self._seed) for model in without]

    def runs_better(self, model: FittedModel, without: FittedModel) -> bool:
        """Return whether the first model leaves less of r."""
        return self._unseen.square(self.online(model)) < self._unseen.square(self.online(without))

    def holds(self, model: FittedModel) -> bool:
        """Return whether the model leaves no more of r than the nominal one where neither was fitted."""
        if self._tests and not self._result.only_sliding:
            return True  # `runs_better` has judged the same samples
        judged = self._tests or self._training
        flags = [recording.train if self._tests else recording.held_out for recording in judged]
        with_causes, nominal = (
            squared_residual(self.online(fitted), judged, flags) for fitted in (model, self.nominal)
        )
        return with_causes <= nominal

    def _error(self, model: FittedModel) -> Numbers:
        """Return Σ e² by stretch on unseen data [K]."""
        if id(model) not in self._errors:
            if self._tests:
                error = self._unseen.by_stretch(self.online(model))
            else:
                error = self._result.estimation.look(model.data, self._result.out, ()).selection.base
            self._errors[id(model)] = (model, error)
        return self._errors[id(model)][1]

    @cached_property
    def _unseen(self) -> OnlineError:
        """Return the errors of models that run online; of the training recordings, all free motion counts."""
        judged = self._tests or [
            replace(recording, train=recording.train | recording.held_out) for recording in self._training
        ]
        if self._result.only_sliding:
            judged = without_stuck(self._given, judged, self._signals)
        return OnlineError(self.online(self.nominal), judged)

    def online(self, model: FittedModel) -> dict[str, Any]:
        return self._result.estimation.online(model.data)

    def written(self, model: FittedModel) -> dict[str, Any]:
        """Return the same with what is known of its numbers."""
        return self._result.estimation.online(with_known(model.data, self._everything, self._settings))
