"""How correlated noise is whitened, and how many independent samples it is worth.

Noise is whitened by an autoregressive model for each joint. The model looks back over windows that grow with their
distance (heterogeneous autoregression: Corsi, 2009). So a few numbers describe both the short memory of coloured noise
and the long memory of a bias that changes faster than its splines. Schwarz's criterion chooses the number of windows.
Filtering target and columns alike turns least squares into generalised least squares (Cochrane and Orcutt, 1949).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.special import gammainccinv
from scipy.stats import gamma

from tendonfmu.arrays import Array, Flags, Numbers
from tendonfmu.statistics.blocks import BlockSeries

if TYPE_CHECKING:
    from tendonfmu.statistics.blocks import BlockSeries

# the mean of these blocks, first to last before the present one, is a regressor
WINDOWS = ((1, 1), (2, 2), (3, 3), (4, 4), (5, 8), (9, 16), (17, 32), (33, 64), (65, 128))
_ROOM = 20  # rows for each coefficient, at least
CHANCE = 3.0  # standard deviations of ρ_k of white noise (1/√pairs); at a lag, one of 740 white series exceeds it
FEWEST = 20  # pairs of a lag; lags with fewer are not used
# Noise is forgotten within LASTING. What lasts longer is an error of the model, which counts as new with every stroke;
# what returns LATER, with strokes that are alike, counts as new every second cycle (docs/evidence/fit.md).
LASTING, LATER = 0.1, 1.0  # s
RETURN = 4.0  # strokes


@dataclass(frozen=True)
class Whitener:
    """The filter of each joint."""

    coefficients: Numbers  # of the means over the first p windows [p, n]
    scale: Numbers  # standard deviation of what they leave [n] (N·m)
    valid: Flags  # rows whose windows are used and in the same stretch [B]

    def apply(self, values: Array) -> Array:
        """Filter values, and scale them to the noise."""
        # values: [B, n, ...]; returns [B, n, ...] in units of the noise. Rows that are not valid are 0
        shape = (1, values.shape[1], *[1] * (values.ndim - 2))
        filtered = np.array(values, dtype=np.float64)
        before = _sums(filtered)
        for (first, last), weights in zip(WINDOWS, self.coefficients, strict=False):
            filtered[last:] -= weights.reshape(shape) * _mean(before, first, last)
        filtered /= self.scale.reshape(shape)
        filtered[~self.valid] = 0.0
        return filtered.astype(values.dtype, copy=False)


def _sums(values: Numbers) -> Numbers:
    """Return the sums of all rows before [B + 1, ...]."""
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])


def _mean(before: Numbers, first: int, last: int) -> Numbers:
    """Return the mean over rows k − last .. k − first, for k from `last` on [B − last, ...]."""
    rows = len(before) - 1
    return np.asarray((before[last - first + 1 : rows - first + 1] - before[: rows - last]) / (last - first + 1))


def valid_rows(series: BlockSeries, reach: int) -> Flags:
    """Return the used rows [B] that have `reach` used rows before them in the same stretch without a gap."""
    run = np.ones(len(series.time), dtype=bool)
    run[1:] = series.used[1:] & series.used[:-1] & (series.segment[1:] == series.segment[:-1])
    run[0] = False
    last_break = np.maximum.accumulate(np.where(run, 0, np.arange(len(run))))
    return np.asarray(series.used & (np.arange(len(run)) - last_break >= reach))


def whitener(series: BlockSeries, residual: Numbers) -> Whitener:
    """Estimate the filter of each joint. residual: [B, n] (N·m)."""
    most = _most_windows(series)
    valid = valid_rows(series, _reach(most))
    fits = [_autoregression(residual[:, j], valid, most) for j in range(residual.shape[1])]
    count = max(len(fit) for fit in fits)
    coefficients = np.zeros((count, residual.shape[1]))
    for j, fit in enumerate(fits):
        coefficients[: len(fit), j] = fit
    plain = Whitener(coefficients, np.ones(residual.shape[1]), valid_rows(series, _reach(count)))
    left = plain.apply(residual)[plain.valid]
    scale = np.sqrt(np.mean(left**2, axis=0))
    tiny = 1e-12 * max(float(np.abs(residual).max(initial=0.0)), 1e-12)
    return Whitener(coefficients, np.maximum(scale, tiny), plain.valid)


def _reach(windows: int) -> int:
    return WINDOWS[windows - 1][1] if windows else 0


def _most_windows(series: BlockSeries) -> int:
    """Return the largest number of windows that keeps nine of ten used rows and gives each coefficient enough rows."""
    used = int(series.used.sum())
    for count in range(len(WINDOWS), 0, -1):
        rows = int(valid_rows(series, _reach(count)).sum())
        if rows >= 0.9 * used and rows >= _ROOM * count:
            return count
    return 0


def _autoregression(values: Numbers, valid: Flags, most: int) -> Numbers:
    """Return coefficients [p] by least squares, p = 0..most with the least BIC. All orders use the same rows."""
    rows = np.flatnonzero(valid)
    target = values[rows]
    before = _sums(values)
    past = np.zeros((len(rows), most))
    for k, (first, last) in enumerate(WINDOWS[:most]):
        past[:, k] = _mean(before, first, last)[rows - last]
    best, chosen = np.inf, np.zeros(0)
    power = float(target @ target)
    for order in range(most + 1):
        columns = past[:, :order]
        fit = np.linalg.lstsq(columns.T @ columns, columns.T @ target, rcond=1e-12)[0]
        left = max(power - float(fit @ (columns.T @ target)), 1e-300)
        score = len(rows) * np.log(left) + order * np.log(max(len(rows), 2))
        if score < best:
            best, chosen = score, fit
    return np.asarray(chosen)


# --- how many independent samples -------------------------------------------------------------------------------------
#
# A likelihood that counts each sample as new is correct for white residuals. Model errors last for many samples, so N
# of them are worth N/τ independent ones. τ = 1 + 2 Σ ρ_k is their integrated autocorrelation time (Sokal 1997,
# sect. 2). The sum ends before the first ρ_k that chance explains: white residuals have τ = 1 exactly, and noise at far
# lags adds nothing.


def _correlation(values: Numbers) -> tuple[float, Numbers, float]:
    """Return τ in samples, ρ_k for k = 1 .. [K], and the size of a ρ_k that chance makes of noise with this τ."""
    known = ~np.isnan(values)
    count = int(known.sum())
    filled = np.where(known, values, 0.0)
    power = float(filled @ filled)
    if count < FEWEST or power == 0.0:
        return 1.0, np.zeros(0), 1.0
    pairs = np.round(_autocovariance(known.astype(np.float64)))
    reach = int(np.argmax(pairs < FEWEST)) or len(pairs)
    correlations = _autocovariance(filled)[1:reach] / pairs[1:reach] / (power / count)
    ended = correlations <= CHANCE / np.sqrt(pairs[1:reach])
    last = int(np.argmax(ended)) if ended.any() else len(correlations)
    time = min(1.0 + 2.0 * float(correlations[:last].sum()), float(count))
    return time, correlations, float(np.sqrt(time / count))


def _shares(correlations: Numbers, chance: float, step: float) -> tuple[float, float]:
    """Return the shares of the variance that last for longer than noise does, and that return with later strokes."""
    first, later = (max(round(time / step), 1) for time in (LASTING, LATER))
    if len(correlations) < first:
        return 0.0, 0.0
    lasting = float(correlations[first - 1])
    returning = float(np.abs(correlations[later - 1 : len(correlations) // 2]).max(initial=0.0))
    return min(lasting, 1.0) * (lasting > chance), min(returning, 1.0) * (returning > 4.0 * chance)


def _autocovariance(values: Numbers) -> Numbers:
    """Return Σ values_i·values_(i+k) for k = 0 .. N − 1 [N]."""
    size = 1 << (2 * len(values) - 1).bit_length()
    spectrum = np.fft.rfft(values, size)
    return np.asarray(np.fft.irfft(np.abs(spectrum) ** 2, size)[: len(values)])


def sample_weights(standardised: Numbers, step: float, stroke: float) -> Numbers:
    """Return the share of an independent sample that each sample of a stretch counts for."""
    # standardised: [N, n]; step, stroke: time of a sample and of a stroke (s); returns 1/τ of each joint [n]
    weights = []
    for column in standardised.T:
        time, correlations, chance = _correlation(column)
        if time > 1.0:
            lasting, returning = _shares(correlations, chance, step)
            share, new = (returning, RETURN * stroke) if returning > lasting else (lasting, stroke)
            new = min(max(new / step, time), float(np.sum(~np.isnan(column))))
            time = max(time, (1.0 - share) * time + share * new)
        weights.append(1.0 / time)
    return np.array(weights)


def effective_samples(standardised: Sequence[Numbers], weights: Sequence[Numbers]) -> tuple[Numbers, Numbers]:
    """Count samples, and the independent samples that they are worth."""
    # standardised: [N, n]; weights: [N, n]; returns samples of each joint [n], independent samples of each joint [n]
    used = [~np.isnan(residuals) for residuals in standardised]
    count = sum(flags.sum(axis=0) for flags in used)
    worth = sum((flags * weight).sum(axis=0) for flags, weight in zip(used, weights, strict=True))
    return np.asarray(count, dtype=np.float64), np.asarray(worth, dtype=np.float64)


# --- steady oscillations ----------------------------------------------------------------------------------------------
# A periodogram of noise is exponentially distributed around its smooth spectrum, and the largest of its values has a
# known distribution (Fisher 1929). Here the background is local, so that coloured noise is not mistaken for a line.


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
