"""Which oscillations at a steady frequency a residual has: vibration, mains, a motor's cogging.

A periodogram of noise is exponentially distributed around its smooth spectrum, and the largest of its values has a
known distribution (Fisher 1929). Here the background is local, so that coloured noise is not mistaken for a line.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.special import gammainccinv
from scipy.stats import gamma

from tendonfmu.arrays import Numbers
from tendonfmu.statistics.whitening import Whitener

if TYPE_CHECKING:
    from tendonfmu.statistics.blocks import BlockSeries


LOWEST = 0.5  # Hz; slower oscillations belong to the bias
BACKGROUND = 121  # bins of the smooth spectrum on either side
MOST_LINES = 5


@dataclass(frozen=True)
class Line:
    """An oscillation at a steady frequency."""

    frequency: float  # Hz
    amplitude: float  # largest of the recordings (N·m)
    p_value: float  # over all frequencies
    share: float  # share of the variance


def find_lines(
    series: BlockSeries, residual: Numbers, filters: Whitener | None, *, level: float, least: float = 0.0
) -> tuple[tuple[Line, ...], Numbers]:
    """Find lines with at least a share of the variance in the residual of a joint, whitened by filters if given."""
    # residual: [B] (N·m); returns their sum [B] (N·m), 0 in unused blocks
    used = series.used & np.isfinite(residual)
    left = np.where(used, residual, 0.0)
    total, lines = np.zeros(len(residual)), []
    variance = float(np.sum(left**2))
    for _ in range(MOST_LINES):
        valid = used if filters is None else filters.valid
        flat = np.where(valid, left if filters is None else filters.apply(left[:, None])[:, 0], 0.0)
        peak = _strongest(series, flat, valid)
        if peak is None or peak[1] > level:
            break
        wave, amplitude = _fitted(series, left, used, peak[0])
        share = float(np.sum(left**2) - np.sum((left - wave) ** 2)) / max(variance, 1e-300)
        if share < least:
            break
        lines.append(Line(peak[0], amplitude, peak[1], share))
        left = left - wave
        total += wave
    return tuple(lines), total


def _strongest(series: BlockSeries, flat: Numbers, used: NDArray[np.bool_]) -> tuple[float, float] | None:
    """Return frequency (Hz) and family-wise p-value of the highest point of the periodogram over its background."""
    recordings = np.unique(series.recording)
    places = [np.flatnonzero(series.recording == number) for number in recordings]
    slots = [np.round((series.time[rows] - series.time[rows[0]]) / series.step).astype(int) for rows in places]
    length = 2 * (max(int(slot[-1]) for slot in slots) + 1)
    power, waves = np.zeros(length // 2 + 1), 0
    for rows, slot in zip(places, slots, strict=True):
        seen = int(used[rows].sum())
        if seen * series.step < 5.0 / LOWEST:
            continue
        signal = np.zeros(length)
        signal[slot] = flat[rows]
        power += np.abs(np.fft.rfft(signal)) ** 2 / max(float(np.sum(flat[rows] ** 2)), 1e-300)
        waves += 1
    frequency = np.fft.rfftfreq(length, series.step)
    # Blocks are further apart than they are long where the samples are.
    apart = max(series.step, float(np.median(np.concatenate([np.diff(series.time[rows]) for rows in places]))))
    allowed = (frequency >= LOWEST) & (frequency <= 0.45 / apart)
    if not waves or allowed.sum() < 4 * BACKGROUND:
        return None
    ratio = power / _background(power) * gammainccinv(waves, 0.5)
    peak = int(np.argmax(np.where(allowed, ratio, 0.0)))
    tests = 1.5 * float(allowed.sum())  # the grid is twice as fine as independent points
    p_value = float(-np.expm1(tests * np.log1p(-min(gamma.sf(ratio[peak], waves), 1.0 - 1e-12))))
    return float(frequency[peak]), p_value


def _background(power: Numbers) -> Numbers:
    """Return the greater of the spectrum's medians to the left and right of each point, so that an edge is no line."""
    size = BACKGROUND
    middle = median_filter(power, size=size, mode="nearest")
    gap = 4  # bins of the line itself
    shift = size // 2 + gap
    left = np.concatenate([np.full(shift, middle[0]), middle[:-shift]])
    right = np.concatenate([middle[shift:], np.full(shift, middle[-1])])
    return np.asarray(np.maximum(np.maximum(left, right), 1e-300))


def _fitted(series: BlockSeries, left: Numbers, used: NDArray[np.bool_], near: float) -> tuple[Numbers, float]:
    """Return the least-squares wave of each recording at the frequency, and the greatest amplitude."""
    wave, amplitude = np.zeros(len(left)), 0.0
    for number in np.unique(series.recording):
        rows = (series.recording == number) & used
        if not rows.any():
            continue
        phase = 2.0 * np.pi * near * (series.time[rows] - series.time[rows][0])
        basis = np.stack([np.cos(phase), np.sin(phase), np.ones_like(phase)], axis=1)
        weights = np.linalg.lstsq(basis, left[rows], rcond=None)[0]
        wave[rows] = basis[:, :2] @ weights[:2]
        amplitude = max(amplitude, float(np.hypot(weights[0], weights[1])))
    return wave, amplitude
