"""The part of a residual that no model can explain: what differs between two passes of the same motion.

Where the motion repeats, two passes differ by two draws of the noise: their difference over √2 is the floor. Where it
does not, the white part of the residual is taken: what remains after its own past is used, a lower bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tendonfmu.remainder_features import run_starts
from tendonfmu.whitening import whitener

if TYPE_CHECKING:
    from tendonfmu.diagnosis_series import Series

Numbers = NDArray[np.float64]

REPEATS = "repeats of the motion"
WHITE = "white part of the residual"
SHORTEST = 1.0  # s of a cycle
LEAST = 3.0  # s of motion that must repeat
ALIKE = 0.03  # rms difference of the motions over √2, of their standard deviation
WINDOW = 1.0  # s: repeated motion is looked for in pieces of this length


@dataclass(frozen=True)
class NoiseFloor:
    """rms: [n] N·m. source: REPEATS or WHITE. repeats: pairs of passes used. seconds: of motion that was repeated."""

    rms: tuple[float, ...]
    source: str
    repeats: int
    seconds: float


def noise_floor(series: Series, residual: Numbers) -> NoiseFloor:
    """residual: [B, n] N·m without its slow bias (projected off the bias splines)."""
    motion = _motion(series)
    square, count, pairs = np.zeros(residual.shape[1]), 0, 0
    for later, earlier in _passes(series, motion):
        difference = residual[later] - residual[earlier]
        square += np.sum(difference**2, axis=0) / 2.0
        count += len(later)
        pairs += 1
    seconds = count * series.step
    if seconds >= LEAST:
        return NoiseFloor(tuple(np.sqrt(square / count).tolist()), REPEATS, pairs, seconds)
    return NoiseFloor(tuple(whitener(series, residual).scale.tolist()), WHITE, 0, 0.0)


def _motion(series: Series) -> Numbers:
    """[B, k] all that must repeat, of unit variance: angles, velocities, tendon forces, those that change."""
    table = np.concatenate([series.angle, series.velocity, series.force], axis=1)
    spread = table.std(axis=0)
    moving = spread > 1e-9 * np.maximum(1.0, np.abs(table).max(axis=0))
    return np.asarray((table - table.mean(axis=0))[:, moving] / spread[moving])


def _passes(series: Series, motion: Numbers) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Rows of two passes of the same motion, later and earlier, for the best lag of every pair of segments."""
    starts = run_starts(series.segment)
    found = []
    parts = list(pairwise(starts.tolist()))
    for number, one in enumerate(parts):
        for two in parts[number:]:
            for lag in _lags(motion[slice(*one)], motion[slice(*two)], one == two, series.step):
                rows = _alike(series, motion, one, two, lag)
                if len(rows[0]):
                    found.append(rows)
    return found


def _lags(one: Numbers, two: Numbers, same: bool, step: float) -> list[int]:
    """Shifts of the second against the first, in blocks, at which the motions agree best: up to three."""
    if not one.shape[1]:
        return []
    length = len(one) + len(two)
    size = 1 << (length - 1).bit_length()
    ahead, behind = np.fft.rfft(one, size, axis=0), np.fft.rfft(two, size, axis=0)
    product = np.fft.irfft(np.sum(behind * ahead.conj(), axis=1), size)
    shifts = np.arange(-(len(one) - 1), len(two))
    overlap = np.minimum(len(one), len(two) - shifts) - np.maximum(0, -shifts)
    power = _overlapping_power(one, two, shifts)
    likeness = 2.0 * product[shifts % size] / np.maximum(power, 1e-12)
    allowed = overlap * step >= LEAST
    if same:
        allowed &= shifts * step >= SHORTEST
    lags: list[int] = []
    for _ in range(3):
        masked = np.where(allowed, likeness, -1.0)
        best = int(np.argmax(masked))
        if masked[best] < 0.5:
            break
        lags.append(int(shifts[best]))
        allowed &= np.abs(shifts - shifts[best]) * step >= SHORTEST
    return lags


def _overlapping_power(one: Numbers, two: Numbers, shifts: NDArray[np.int64]) -> Numbers:
    """Σ one² + two² over the overlap at each shift (row k of one lies on row k + shift of two)."""
    first = np.concatenate([[0.0], np.cumsum(np.sum(one**2, axis=1))])
    second = np.concatenate([[0.0], np.cumsum(np.sum(two**2, axis=1))])
    begin, end = np.maximum(0, -shifts), np.minimum(len(one), len(two) - shifts)
    return np.asarray(first[end] - first[begin] + second[end + shifts] - second[begin + shifts])


def _alike(
    series: Series, motion: Numbers, one: tuple[int, int], two: tuple[int, int], lag: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows where the shifted motions agree all through a window, the hand moves and both are used."""
    begin, end = max(0, -lag), min(one[1] - one[0], two[1] - two[0] - lag)
    earlier = np.arange(begin, end) + one[0]
    later = earlier - one[0] + lag + two[0]
    width = max(1, round(WINDOW / series.step))
    pieces = (end - begin) // width
    earlier, later = earlier[: pieces * width], later[: pieces * width]
    both = series.used[earlier] & series.used[later]
    apart = np.mean((motion[later] - motion[earlier]) ** 2, axis=1) / 2.0
    by_piece = np.sqrt(apart.reshape(pieces, width).mean(axis=1))
    moved = motion[earlier].reshape(pieces, width, -1).std(axis=1).max(axis=1, initial=0.0)
    good = np.repeat((by_piece <= ALIKE) & (moved > 0.1), width) & both
    return later[good], earlier[good]
