"""How a description and recordings look as columns: what the description leaves, and what every effect would add."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tendonfmu.arrays import Array, Numbers
from tendonfmu.diagnosis.candidate_columns import CandidateColumns, candidate_columns
from tendonfmu.diagnosis.cause import Cause, Key
from tendonfmu.diagnosis.confirmation import Confirmation
from tendonfmu.diagnosis.effects import CANDIDATES, Candidate
from tendonfmu.diagnosis.extension_fit import FittedModel, number_columns
from tendonfmu.diagnosis.hypotheses import hypotheses
from tendonfmu.diagnosis.least_sizes import LeastSizes
from tendonfmu.diagnosis.samples import Samples, as_described
from tendonfmu.diagnosis.selection import Selection
from tendonfmu.diagnosis.series import Series
from tendonfmu.model import moment_arms
from tendonfmu.statistics import Folds, Grams, Products, make_folds, residual_of


@dataclass(frozen=True)
class View:
    """A description and what it may lack, on all recordings."""

    data: Mapping[str, Any]
    samples: Samples  # as they were measured
    predicted: Samples  # with the forces that the model predicts
    series: Series
    nominal: Array  # derivatives of the torque by the numbers that a fit of the description estimates [B, n, u]
    scale: Numbers  # expected magnitudes of these numbers [u]
    columns: CandidateColumns
    least: LeastSizes  # sizes that the sensors can show

    @cached_property
    def folds(self) -> Folds:
        return make_folds(self.series)

    @property
    def as_described(self) -> View:
        """The view with all torque at the moment arms without corrections, so that views can be compared."""
        series = replace(self.series, target=as_described(self.series.target, self.data))
        columns = replace(self.columns, values=as_described(self.columns.values, self.data))
        return replace(self, series=series, nominal=as_described(self.nominal, self.data), columns=columns)

    @property
    def lean(self) -> View:
        """The view without the columns of candidates, which take most of the memory."""
        return replace(self, columns=CandidateColumns(self.columns.values[:, :, :0].copy(), ()))

    @cached_property
    def grams(self) -> Grams:
        """Products of all columns."""
        products = Products(self.folds, self.nominal, self.columns.values, self.samples.splines)
        return Grams(products, self.series.target, self.scale)

    @cached_property
    def selection(self) -> Selection:
        return Selection(self.grams, self.candidates, self.least)

    @property
    def candidates(self) -> list[Cause]:
        """All effects that the description may lack."""
        reach = np.abs(self.series.angle[self.series.used]).max(axis=0, initial=0.0)
        return hypotheses(self.columns, moment_arms(self.data), reach)

    def beside(self, keys: Collection[Key]) -> Selection:
        """Return what is missing if these causes are present, each with all its shapes at that place."""
        whole = self.selection
        known = [cause for cause in whole.causes if cause.key in keys]
        return Selection(self.grams, whole.causes, self.least, known, whole.shares) if known else whole

    @cached_property
    def residual(self) -> Numbers:
        """Residual without the bias and all that refitting can explain, N·m [B, n]."""
        return residual_of(self.series, self.samples.splines, self.nominal)

    @cached_property
    def confirmation(self) -> Confirmation:
        return Confirmation(self.series, self.folds, self.samples.splines, self.nominal)

    def p_value(self, cause: Cause) -> float:
        """Return the probability of such a result by chance, corrected for all candidates that were tried."""
        mix = cause.direction.mix
        used = np.flatnonzero(mix.any(axis=1))
        columns = self.columns.values[:, :, used].astype(np.float64) @ mix[used]
        return self.confirmation.p_value(columns, len(self.columns.proposals))


def look(
    data: Mapping[str, Any],
    samples: Samples,
    least: LeastSizes,
    candidates: Sequence[Candidate] = CANDIDATES,
    model: FittedModel | None = None,
) -> View:
    """Compute the view of a fitted description on samples as they were measured.

    `model` has the derivatives by the description's numbers, if it was fitted to the same samples.
    """
    predicted = samples.at_predicted_forces(data) if candidates else samples
    nominal, scale = model.columns(samples) if model is not None else number_columns(data, predicted)
    columns = candidate_columns(data, predicted, candidates=candidates, worth=least.worth)
    return View(data, samples, predicted, samples.series(data), nominal, scale, columns, least)
