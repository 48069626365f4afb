"""How much each cause gains on unseen data; causes that gain nothing there are dropped."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.base import refitted
from tendonfmu.diagnosis.cause import Cause, CausePlace, Where
from tendonfmu.diagnosis.effects import CALIBRATED, CALIBRATION, COMMON, OF_LAW, Term
from tendonfmu.diagnosis.effects.memory import PRESLIDING
from tendonfmu.diagnosis.extension_fit import FittedModel, cause_parameters, fit_extended, intervals_of, with_known
from tendonfmu.diagnosis.gain import Gain, Unseen, measure_gain
from tendonfmu.diagnosis.samples import Samples
from tendonfmu.diagnosis.search import Search, terms_of
from tendonfmu.diagnosis.selection import SIGNIFICANCE, by_gain, confirmed, names_with, step_p_value
from tendonfmu.estimate import SCALING
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import Interval

# Of the rms that a memory explains: another form of it explains so much more. What depends on the same motions and
# loads as friction, or scales the torque, resembles that.
FORM = 0.07
LIKE_A_LAW = {*OF_LAW, *SCALING} - {*COMMON}


@dataclass(frozen=True)
class Verified:
    """The causes that unseen data confirm."""

    causes: tuple[Cause, ...]  # in order of gain, the largest first; places of one effect are one cause
    without: tuple[FittedModel, ...]  # for each cause, the fit that lacks it
    dropped: tuple[Cause, ...]  # causes that unseen data do not confirm
    gain: Gain
    nominal_data: Data  # descriptions as they run online
    extended_data: Data


def verify(
    result: Search, training: Sequence[FitRecording], tests: Sequence[FitRecording], least_gain: float, seed: int
) -> Verified:
    """Measure the gain of each cause on unseen data and drop the weak ones."""
    bench = _Bench(result, training, tests, seed)

    def judge(causes: list[Cause]) -> tuple[list[Cause], list[int]]:
        fit, without = bench.fit(causes), bench.each_without(causes)
        gains = [bench.gain(model, fit) for model in without]
        needed, shares = _needed(causes, gains), bench.shares_of_memory(causes, fit, without)
        weak = [
            k
            for k, (cause, gain) in enumerate(zip(causes, gains, strict=True))
            if not (
                gain.low > 0.0
                and gain.value >= least_gain * needed[k]
                and (shares[k] >= FORM or cause.effect not in LIKE_A_LAW)
                and result.base.least.shows_all(cause.effect, cause.terms, fit.data)
            )
        ]
        judged = zip(causes, gains, without, strict=True)
        return [bench.with_gain(cause, gain, model, fit) for cause, gain, model in judged], weak

    causes, dropped = confirmed(merged(result.causes), judge)
    fit, nominal = bench.fit(causes), bench.written(bench.nominal)
    extended = bench.written(fit) if causes else nominal
    ranked = by_gain(bench.with_places(fit, causes))
    between = [bench.fit(ranked[: k + 1]).data for k in range(len(ranked) - 1)]
    return Verified(
        causes=tuple(ranked),
        without=tuple(bench.each_without(ranked)),
        dropped=tuple(dropped),
        gain=measure_gain(
            nominal, extended, training, tests, between=between, seed=seed, threads=result.base.settings.threads
        ),
        nominal_data=nominal,
        extended_data=extended,
    )


def _needed(causes: Sequence[Cause], gains: Sequence[Interval]) -> list[float]:
    """Return how many times the least gain each cause needs: the number of names up to it, the largest gain first."""
    needed, named = [1.0] * len(causes), list[str]()
    for k in sorted(range(len(causes)), key=lambda k: -gains[k].value):
        needed[k] = names_with(causes[k].effect, named)
        named.append(causes[k].effect)
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
    """Fits of any set of causes, and what they leave of unseen data."""

    def __init__(
        self, result: Search, training: Sequence[FitRecording], tests: Sequence[FitRecording], seed: int
    ) -> None:
        base = result.base
        self._result, self._settings, self._seed = result, base.settings, seed
        self._full, self.nominal, self._samples = result.extended, base.nominal, base.samples
        if not tests:  # exclude the judged samples from the fits
            self._samples = Samples.of(self.nominal.data, training, self._settings.threads)
            self._samples = replace(self._samples, drift=self._samples.as_rests_demand(self.nominal.data).drift)
            self._full, self.nominal = (
                refitted(model, self._samples, self._settings) for model in (self._full, self.nominal)
            )
        self._training = training
        self._unseen = Unseen(self.nominal.data, training, tests, self._settings.threads)
        self._predicted = self._samples.at_predicted_forces(self._full.data)
        self._fits: dict[frozenset[int], FittedModel] = {frozenset(map(id, terms_of(result.causes))): self._full}
        self._order: dict[frozenset[int], list[Term]] = {next(iter(self._fits)): terms_of(result.causes)}

    def fit(self, causes: Sequence[Cause]) -> FittedModel:
        """Return the fit with some of the causes; it starts at that with all of them."""
        terms = terms_of(causes)
        key = frozenset(map(id, terms))
        if not terms:
            return self.nominal
        if key not in self._fits:
            order = self._order.setdefault(key, terms)
            self._fits[key] = fit_extended(self.nominal, order, self._predicted, self._settings, self._full, rough=True)
        return self._fits[key]

    def each_without(self, causes: Sequence[Cause]) -> list[FittedModel]:
        """Return, for each cause, the fit that lacks it."""
        return [self.fit([*causes[:k], *causes[k + 1 :]]) for k in range(len(causes))]

    def shares_of_memory(
        self, causes: Sequence[Cause], fit: FittedModel, without: Sequence[FittedModel]
    ) -> list[float]:
        """Return the rms that each cause explains over that which the memory of friction explains; inf without one."""
        after = float(self._unseen.squares(fit.data).sum())
        explained = [max(float(self._unseen.squares(model.data).sum()) - after, 0.0) for model in without]
        of_memory = sum(own for own, cause in zip(explained, causes, strict=True) if cause.effect == PRESLIDING)
        return [float(np.sqrt(own / of_memory)) if of_memory else np.inf for own in explained]

    def gain(self, without: FittedModel, model: FittedModel) -> Interval:
        return self._unseen.gain(without.data, model.data, self._seed)

    def with_gain(self, cause: Cause, gain: Interval, without: FittedModel, model: FittedModel) -> Cause:
        """Return a cause with its gain; one of the base has the p-value of that gain."""
        if cause.p_value < SIGNIFICANCE:
            return replace(cause, gain=gain)
        p_value = step_p_value(self._unseen.squares(without.data), self._unseen.squares(model.data))
        return replace(cause, gain=gain, p_value=p_value)

    def with_places(self, model: FittedModel, causes: Sequence[Cause]) -> list[Cause]:
        """Return the causes with the numbers of each of their places in a model that was fitted with all of them."""
        order = self._order.get(frozenset(id(term) for cause in causes for term in cause.terms), [])
        found = cause_parameters(self.nominal.data, order, model)
        numbers = {id(term): own for term, own in zip(order, found, strict=True)}
        intervals = intervals_of(model, self._predicted, self._settings) if order else {}
        return [
            replace(
                cause,
                intervals=intervals,
                places=tuple(
                    CausePlace(term.place.joint, term.place.tendon, numbers[id(term)]) for term in cause.terms
                ),
            )
            for cause in causes
        ]

    def written(self, model: FittedModel) -> Data:
        """Return a description with what is known of its numbers."""
        return with_known(model.data, self._training, self._settings)
