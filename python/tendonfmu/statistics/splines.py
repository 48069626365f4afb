"""What no cause may be credited with: the slow bias, and all that refitting the nominal model can mend."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.interpolate import BSpline

from tendonfmu.statistics.blocks import BlockSeries

Numbers = NDArray[np.float64]
Array = NDArray[Any]
Splines = Any  # scipy.sparse.csr_array [B, s], which comes without types

KNOTS = 2.0  # s: what a bias does
TRENDS = (
    10.0  # s: of tests. What a bias does faster is noise that whitening sees: with knots of 2 s p-values are too small
)
_PIECE = 4096  # rows at a time
_LOST = 1e-9  # of a column's square, below which the projection left rounding only
_RANK = 1e-10  # of the largest power, columns scaled to length 1 before: derivatives are exact, rounding is far below


def bias_splines(series: BlockSeries, knots: float = KNOTS) -> Splines:
    """[B, s] cubic B-splines in time, of each stretch without a gap its own, knots about `knots` s apart."""
    blocks = []
    for number in np.unique(series.segment):
        time = series.time[series.segment == number]
        span = max(float(time[-1] - time[0]), series.step)
        pieces = max(1, round(span / knots))
        inner = np.linspace(time[0] - 1e-9, time[0] + span + 1e-9, pieces + 1)
        width = inner[1] - inner[0]
        outer = width * np.arange(1, 4)
        knot = np.concatenate([inner[0] - outer[::-1], inner, inner[-1] + outer])
        blocks.append(BSpline.design_matrix(time, knot, 3))
    return sparse.csr_array(sparse.block_diag(blocks, format="csr"))


def constant_bias(series: BlockSeries) -> Splines:
    """[B, s] a constant for every stretch without a gap."""
    return sparse.csr_array((series.segment[:, None] == np.unique(series.segment)).astype(np.float64))


class Span:
    """Takes what lies in the span of splines off other columns."""

    def __init__(self, splines: Splines) -> None:
        """splines: [R, s]."""
        alive = np.flatnonzero(np.asarray(abs(splines).sum(axis=0)).ravel() > 0)
        self._matrix = sparse.csr_array(splines[:, alive])
        gram = np.asarray((self._matrix.T @ self._matrix).todense())
        self._inverse = np.linalg.pinv(gram, rcond=_RANK, hermitian=True) if gram.size else gram

    def without(self, columns: Array) -> Numbers:
        """[R, d] less their part in the span; a column of which nothing but rounding is left becomes 0."""
        values = np.asarray(columns, dtype=np.float64)
        if not self._matrix.shape[1]:
            return values
        left = values - self._matrix @ (self._inverse @ (self._matrix.T @ values))
        gone = np.einsum("rc,rc->c", left, left) <= _LOST * np.einsum("rc,rc->c", values, values)
        left[:, gone] = 0.0
        return np.asarray(left)


def basis(columns: Array) -> Numbers:
    """[R, r] orthonormal basis of the span of columns [R, c]; directions that rounding decides are left out."""
    values = np.asarray(columns, dtype=np.float64)
    length = np.sqrt(np.einsum("rc,rc->c", values, values))
    values = values[:, length > 0] / length[length > 0]
    if not values.shape[1]:
        return np.zeros((len(values), 0))
    # by the Gram matrix: rows are many, columns few; below its precision nothing is kept anyway
    power, direction = np.linalg.eigh(values.T @ values)
    kept = power > _RANK * power[-1]
    found = values @ (direction[:, kept] / np.sqrt(power[kept]))
    return np.asarray(np.linalg.qr(found)[0])


def without(columns: Array, span: Numbers) -> Array:
    """Columns [R, ...] less what lies in an orthonormal span [R, r]; keeps the type of number."""
    own = span.astype(columns.dtype, copy=False)
    return np.asarray(columns - own @ (own.T @ columns))


def residual_of(series: BlockSeries, splines: Splines, nominal: Array) -> Numbers:
    """[B, n] N·m: target less bias and all that `nominal` [B, n, u] explains by least squares; unused rows as found."""
    used = series.used
    span = Span(splines[used])
    target = span.without(series.target[used])
    if nominal.shape[2]:
        own = np.asarray(nominal[used]).copy()
        for j in range(own.shape[1]):
            own[:, j] = span.without(own[:, j])
        target = target - _explained(own.reshape(-1, own.shape[2]), target.reshape(-1)).reshape(target.shape)
    found = series.target - np.mean(series.target[used], axis=0)
    found[used] = target
    return np.asarray(found)


def _explained(columns: Array, target: Numbers) -> Numbers:
    """[R] of a target [R] by least squares on columns [R, c], through their Gram matrix."""
    gram, score = np.zeros((columns.shape[1], columns.shape[1])), np.zeros(columns.shape[1])
    for begin in range(0, len(columns), _PIECE):
        part = np.asarray(columns[begin : begin + _PIECE], dtype=np.float64)
        gram += part.T @ part
        score += part.T @ target[begin : begin + _PIECE]
    length = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    inverse = np.linalg.pinv(gram / (length[:, None] * length), rcond=_RANK, hermitian=True)
    return np.asarray(columns @ (inverse @ (score / length) / length))
