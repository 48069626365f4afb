"""How a description and recordings look as columns: what the description leaves, and what every effect would add."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from tendonfmu.arrays import Array, Indices, Numbers
from tendonfmu.diagnosis.candidate_columns import Candidate, CandidateColumns, candidate_columns, hypotheses
from tendonfmu.diagnosis.effects import MECHANISMS, Mechanism, Where
from tendonfmu.diagnosis.extension_fit import FittedModel, number_columns
from tendonfmu.diagnosis.samples import Samples, Series, as_described
from tendonfmu.diagnosis.selection import LeastSizes, Selection
from tendonfmu.model import moment_arms
from tendonfmu.statistics import (
    Folds,
    Grams,
    Products,
    Splines,
    Whitener,
    basis,
    make_folds,
    residual_of,
    whitener,
    without,
)

# --- whether a cause could be chance ----------------------------------------------------------------------------------
# Scores of stretches of 2 s count as independent, whatever the noise does within one (Liang and Zeger, 1986). What the
# splines of the bias removed from a stretch's residual is restored (CR2: Bell and McCaffrey, 2002). Without this, slow
# columns, which splines nearly follow, would be confirmed by chance several times too often.
#
# In the whitened residual, slow noise does not hide a small effect. In the plain residual, the high-frequency error
# that every model of a real machine leaves does not hide it. Either test may confirm; the p-value accounts for both and
# for everything that was tried (Bonferroni).


Columns = NDArray[np.float32] | Numbers

_RANK = 1e-9  # of the largest power: resolution of columns in single precision
_PIECE, _CHUNK = 4096, 64  # rows, columns at a time
_MOST_LEVERAGE = 0.999  # of a direction in a stretch: beyond, there is nothing left to restore


class Confirmation:
    """The residual of a description, and what refitting it can explain."""

    def __init__(self, series: Series, folds: Folds, splines: Splines, nominal: Columns) -> None:
        """Prepare both tests. splines: [B, s]; nominal: [B, n, u]."""
        joints = series.target.shape[1]
        white = whitener(series, residual_of(series, splines, nominal))
        plain = Whitener(np.zeros((0, joints)), np.ones(joints), series.used)
        self._tests = [
            _ClusterTest(series, folds, splines, nominal, plain),
            _ClusterTest(series, folds, splines, nominal, white),
        ]

    def p_value(self, columns: Columns, tried: int) -> float:
        """Return the p-value of columns [B, n, d] together; `tried` is the number of such sets that were tried."""
        return min(1.0, len(self._tests) * tried * min(test.p_value(columns) for test in self._tests))


class _ClusterTest:
    """Wald's test of a regression; the covariance comes from stretches of time."""

    def __init__(self, series: Series, folds: Folds, splines: Splines, nominal: Columns, filters: Whitener) -> None:
        joints = series.target.shape[1]
        self._filters, self._rows = filters, np.flatnonzero(filters.valid)
        stretch = np.full(len(series.time), -1, dtype=np.int64)
        stretch[folds.rows] = folds.stretch
        own = np.unique(stretch[self._rows], return_inverse=True)[1]
        self._stretch = np.repeat(own, joints)
        self._rows_of_stretches = [np.flatnonzero(own == number) for number in range(own.max(initial=-1) + 1)]
        bias = filters.apply(np.repeat(splines.toarray()[:, None, :], joints, axis=1))[self._rows]
        self._spans = [basis(bias[:, j]) for j in range(joints)]
        self._nominal = self._flat(nominal)
        gram = _product(self._nominal, self._nominal)
        length = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
        self._inverse = np.linalg.pinv(gram / (length[:, None] * length), rcond=_RANK, hermitian=True)
        self._inverse /= length[:, None] * length
        self._target = self._left(self._flat(series.target[:, :, None]))[:, 0]

    def _flat(self, values: Columns) -> Columns:
        """Return values filtered and without the bias [R·n, d]."""
        filtered = np.empty((len(self._rows), *values.shape[1:]), dtype=values.dtype)
        for begin in range(0, values.shape[2], _CHUNK):
            chunk = slice(begin, begin + _CHUNK)
            filtered[:, :, chunk] = self._filters.apply(values[:, :, chunk])[self._rows]
        for j, span in enumerate(self._spans):
            filtered[:, j] = without(filtered[:, j], span)
        return np.asarray(filtered.reshape(filtered.shape[0] * filtered.shape[1], values.shape[2]))

    def _left(self, values: Columns) -> Numbers:
        """Return values without what refitting the nominal numbers can explain [R·n, d]."""
        return np.asarray(values - self._nominal @ (self._inverse @ _product(self._nominal, values)), dtype=np.float64)

    @cached_property
    def _given_back(self) -> list[tuple[Indices, int, Numbers, Numbers]]:
        """Directions that the splines weaken, for each stretch and joint."""
        directions_of = []
        for rows in self._rows_of_stretches:
            for j, span in enumerate(self._spans):
                directions, share, _ = np.linalg.svd(span[rows], full_matrices=False)
                kept = share**2 > 1e-6
                leverage = np.minimum(share[kept] ** 2, _MOST_LEVERAGE)
                directions_of.append((rows, j, directions[:, kept], 1.0 / np.sqrt(1.0 - leverage) - 1.0))
        return directions_of

    def _unshrunk(self, left: Numbers) -> Numbers:
        """Return a residual with what the splines removed by stretch restored [R·n]."""
        restored = left.reshape(-1, len(self._spans)).copy()
        for rows, j, directions, strength in self._given_back:
            restored[rows, j] += directions @ (strength * (directions.T @ restored[rows, j]))
        return np.asarray(restored.reshape(-1))

    def p_value(self, columns: Columns) -> float:
        values = self._left(self._flat(columns))
        length = np.sqrt(np.einsum("rd,rd->d", values, values))
        values = values[:, length > 0] / length[length > 0]
        power, turned = np.linalg.eigh(values.T @ values) if values.shape[1] else (np.zeros(0), np.zeros((0, 0)))
        kept = power > 1e-9 * power.max(initial=0.0)
        if not kept.any():
            return 1.0
        values = values @ (turned[:, kept] / np.sqrt(power[kept]))
        estimate = values.T @ self._target
        products = values * self._unshrunk(self._target - values @ estimate)[:, None]
        scores = np.stack([np.bincount(self._stretch, products[:, k]) for k in range(values.shape[1])], axis=1)
        count, size = scores.shape
        if count - size < 2:
            return 1.0
        spread = scores.T @ scores * count / (count - 1)
        spread += 1e-9 * np.trace(spread) * np.eye(size)
        statistic = float(estimate @ np.linalg.solve(spread, estimate))
        return float(fdtrc(size, count - size, statistic * (count - size) / (size * (count - 1))))


def _product(one: Columns, other: Columns) -> Numbers:
    """Return the product in double precision [d, e], piece by piece: copies of many columns would not fit in memory."""
    product = np.zeros((one.shape[1], other.shape[1]))
    for begin in range(0, len(one), _PIECE):
        part = slice(begin, begin + _PIECE)
        product += one[part].astype(np.float64).T @ other[part].astype(np.float64)
    return product


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
    def candidates(self) -> list[Candidate]:
        """All effects that the description may lack."""
        reach = np.abs(self.series.angle[self.series.used]).max(axis=0, initial=0.0)
        return hypotheses(self.columns, moment_arms(self.data), reach, self.least.heaviest)

    def beside(self, keys: Collection[Where]) -> Selection:
        """Return what is missing if these causes are present, each with all its shapes at that place."""
        whole = self.selection
        known = [candidate for candidate in whole.candidates if candidate.where in keys]
        return Selection(self.grams, whole.candidates, self.least, known, whole.shares) if known else whole

    @cached_property
    def residual(self) -> Numbers:
        """Residual without the bias and all that refitting can explain, N·m [B, n]."""
        return residual_of(self.series, self.samples.splines, self.nominal)

    @cached_property
    def confirmation(self) -> Confirmation:
        return Confirmation(self.series, self.folds, self.samples.splines, self.nominal)

    def p_value(self, mix: Numbers) -> float:
        """Return the probability of such a result by chance, corrected for all candidates that were tried."""
        used = np.flatnonzero(mix.any(axis=1))
        columns = self.columns.values[:, :, used].astype(np.float64) @ mix[used]
        return self.confirmation.p_value(columns, len(self.columns.proposals))


def look(
    data: Mapping[str, Any],
    samples: Samples,
    least: LeastSizes,
    mechanisms: Sequence[Mechanism] = MECHANISMS,
    model: FittedModel | None = None,
) -> View:
    """Compute the view of a fitted description on samples as they were measured.

    `model` has the derivatives by the description's numbers, if it was fitted to the same samples.
    """
    predicted = samples.at_predicted_forces(data) if mechanisms else samples
    nominal, scale = model.columns(samples) if model is not None else number_columns(data, predicted)
    columns = candidate_columns(data, predicted, mechanisms=mechanisms, worth=least.worth)
    return View(data, samples, predicted, samples.series(data), nominal, scale, columns, least)
