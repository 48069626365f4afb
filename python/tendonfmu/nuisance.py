"""What no cause may be credited with: the slow bias, and all that refitting the nominal model can mend."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from tendonfmu.diagnosis_series import Series

Numbers = NDArray[np.float64]
Array = NDArray[Any]

KNOTS = 2.0  # s: what a bias does
TRENDS = (
    10.0  # s: of tests. What a bias does faster is noise that whitening sees: with knots of 2 s p-values are too small
)
_PIECE = 4096  # rows at a time
_RANK = 1e-10  # of the largest power, columns scaled to length 1 before: derivatives are exact, rounding is far below


def bias_splines(series: Series, knots: float = KNOTS) -> Numbers:
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
        blocks.append(BSpline.design_matrix(time, knot, 3).toarray())
    found = np.zeros((len(series.time), sum(block.shape[1] for block in blocks)))
    row = column = 0
    for block in blocks:
        found[row : row + len(block), column : column + block.shape[1]] = block
        row, column = row + len(block), column + block.shape[1]
    return found


def constant_bias(series: Series) -> Numbers:
    """[B, s] a constant for every stretch without a gap."""
    return np.asarray(series.segment[:, None] == np.unique(series.segment), dtype=np.float64)


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


def residual_of(series: Series, splines: Numbers, nominal: Array) -> Numbers:
    """[B, n] N·m: target less bias and all that `nominal` [B, n, u] explains by least squares; unused rows as found."""
    used = series.used
    span = basis(splines[used])
    target = without(series.target[used], span)
    if nominal.shape[2]:
        own = np.asarray(nominal[used]).copy()
        for j in range(own.shape[1]):
            own[:, j] = without(own[:, j], span)
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
