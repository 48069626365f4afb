"""How time series are cut into blocks: their averages, and the folds whose blocks are held out together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.interpolate import BSpline

from tendonfmu.arrays import Array, Indices, Numbers

STRETCH = 2.0  # s; longer than the correlation of a bias between the splines' knots
MOST_FOLDS = 8
FEWEST_STRETCHES = 4  # two halves of two; with fewer there is no held-out error


@dataclass(frozen=True)
class BlockSeries:
    """Block means of recordings, one after another: B blocks of n series each."""

    time: Numbers  # centre of each block [B] (s)
    recording: NDArray[np.int64]  # recording of each block [B], from 0
    segment: NDArray[np.int64]  # stretch without a gap of each block [B], from 0
    target: Numbers  # what has to be explained [B, n]
    used: NDArray[np.bool_]  # whether all samples of the block may be learned from [B]
    step: float  # length of a block (s)


@dataclass(frozen=True)
class Folds:
    """Folds and stretches of the blocks of a series."""

    rows: Indices  # blocks of the series that are used [R], in runs without a gap
    run: Indices  # of each row [R], from 0
    stretch: Indices
    fold: Indices
    stretches: int  # their numbers
    folds: int

    @property
    def enough(self) -> bool:
        """Whether there are enough stretches for a meaningful held-out error."""
        return self.stretches >= FEWEST_STRETCHES


def make_folds(series: BlockSeries) -> Folds:
    """Make stretches of about 2 s without gaps, and up to 8 contiguous folds of equally many stretches."""
    rows = np.flatnonzero(series.used)
    length = max(1, round(STRETCH / series.step))
    new = (np.diff(rows, prepend=-2) > 1) | (np.diff(series.segment[rows], prepend=-1) != 0)
    run = np.cumsum(new) - 1
    stretch = np.zeros(len(rows), dtype=np.int64)
    count = 0
    for number in range(int(run[-1]) + 1 if len(run) else 0):
        members = np.flatnonzero(run == number)
        pieces = max(1, round(len(members) / length))
        stretch[members] = count + np.arange(len(members)) * pieces // len(members)
        count += pieces
    folds = max(1, min(MOST_FOLDS, count // 2))
    return Folds(rows, run, stretch, stretch * folds // max(count, 1), count, folds)


# --- splines ----------------------------------------------------------------------------------------------------------


Splines = Any  # scipy.sparse.csr_array [B, s], which comes without types

KNOTS = 2.0  # s; the splines follow a bias at this pace
_PIECE = 4096  # rows at a time
_LOST = 1e-9  # of a column's square; if the projection leaves less, it is rounding only
_RANK = 1e-10  # of the largest power of columns of length 1; derivatives are exact, rounding is far below


def spline_basis(time: Numbers, span: float, knots: float = KNOTS) -> Splines:
    """Make cubic splines of one stretch without a gap, from its first sample on."""
    # time: [B] (s); span, knots: (s); returns [B, s]
    inner = np.linspace(time[0] - 1e-9, time[0] + span + 1e-9, max(1, round(span / knots)) + 1)
    outer = (inner[1] - inner[0]) * np.arange(1, 4)
    return BSpline.design_matrix(time, np.concatenate([inner[0] - outer[::-1], inner, inner[-1] + outer]), 3)


class Span:
    """Removes the span of splines from other columns."""

    def __init__(self, splines: Splines) -> None:
        """Invert the Gram matrix of the splines."""
        alive = np.flatnonzero(np.asarray(abs(splines).sum(axis=0)).ravel() > 0)
        self._matrix = sparse.csr_array(splines[:, alive])
        gram = np.asarray((self._matrix.T @ self._matrix).todense())
        self._inverse = np.linalg.pinv(gram, rcond=_RANK, hermitian=True) if gram.size else gram

    def without(self, columns: Array) -> Numbers:
        """Return columns without their part in the span."""
        # columns: [R, d]; returns [R, d]. A column of which only rounding is left becomes 0
        values = np.asarray(columns, dtype=np.float64)
        if not self._matrix.shape[1]:
            return values
        left = values - self._matrix @ (self._inverse @ (self._matrix.T @ values))
        gone = np.einsum("rc,rc->c", left, left) <= _LOST * np.einsum("rc,rc->c", values, values)
        left[:, gone] = 0.0
        return np.asarray(left)


def basis(columns: Array) -> Numbers:
    """Return an orthonormal basis of the span of columns."""
    # columns: [R, c]; returns [R, r]. Directions that depend on rounding are left out
    values = np.asarray(columns, dtype=np.float64)
    length = np.sqrt(np.einsum("rc,rc->c", values, values))
    values = values[:, length > 0] / length[length > 0]
    if not values.shape[1]:
        return np.zeros((len(values), 0))
    # by the Gram matrix, since there are many rows and few columns; its lower precision does no harm
    power, direction = np.linalg.eigh(values.T @ values)
    kept = power > _RANK * power[-1]
    directions = values @ (direction[:, kept] / np.sqrt(power[kept]))
    return np.asarray(np.linalg.qr(directions)[0])


def without(columns: Array, span: Numbers) -> Array:
    """Return columns without their part in an orthonormal span."""
    # columns: [R, ...]; span: [R, r]; returns [R, ...], with the columns' type of number
    same_type = span.astype(columns.dtype, copy=False)
    return np.asarray(columns - same_type @ (same_type.T @ columns))


def residual_of(series: BlockSeries, splines: Splines, nominal: Array) -> Numbers:
    """Return the target without bias and without what the nominal columns explain by least squares."""
    # splines: [B, s]; nominal: [B, n, u]; returns [B, n] (N·m). Unused rows keep the target less its mean
    used = series.used
    span = Span(splines[used])
    target = span.without(series.target[used])
    if nominal.shape[2]:
        columns = np.asarray(nominal[used]).copy()
        for j in range(columns.shape[1]):
            columns[:, j] = span.without(columns[:, j])
        target = target - _explained(columns.reshape(-1, columns.shape[2]), target.reshape(-1)).reshape(target.shape)
    residual = series.target - np.mean(series.target[used], axis=0)
    residual[used] = target
    return np.asarray(residual)


def _explained(columns: Array, target: Numbers) -> Numbers:
    """Return what columns [R, c] explain of a target [R] by least squares, through their Gram matrix."""
    gram, score = np.zeros((columns.shape[1], columns.shape[1])), np.zeros(columns.shape[1])
    for begin in range(0, len(columns), _PIECE):
        part = np.asarray(columns[begin : begin + _PIECE], dtype=np.float64)
        gram += part.T @ part
        score += part.T @ target[begin : begin + _PIECE]
    length = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    inverse = np.linalg.pinv(gram / (length[:, None] * length), rcond=_RANK, hermitian=True)
    return np.asarray(columns @ (inverse @ (score / length) / length))
