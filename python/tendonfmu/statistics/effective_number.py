"""How many independent samples the residuals of a fit are worth.

A likelihood that counts each sample as new is correct for white residuals. Model errors last for many samples, so N of
them are worth N/τ independent ones. τ = 1 + 2 Σ ρ_k is their integrated autocorrelation time (Sokal 1997, sect. 2). The
sum ends before the first ρ_k that chance explains: white residuals have τ = 1 exactly, and noise at far lags adds
nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tendonfmu.arrays import Numbers

CHANCE = 3.0  # standard deviations of ρ_k of white noise (1/√pairs); at a lag, one of 740 white series exceeds it
FEWEST = 20  # pairs of a lag; lags with fewer are not used


def correlation_time(values: Numbers) -> float:
    """Return τ of a series in samples, at least 1."""
    known = ~np.isnan(values)
    count = int(known.sum())
    filled = np.where(known, values, 0.0)
    power = float(filled @ filled)
    if count < FEWEST or power == 0.0:
        return 1.0
    pairs = np.round(_autocovariance(known.astype(np.float64)))
    reach = int(np.argmax(pairs < FEWEST)) or len(pairs)
    correlations = _autocovariance(filled)[1:reach] / pairs[1:reach] / (power / count)
    ended = correlations <= CHANCE / np.sqrt(pairs[1:reach])
    last = int(np.argmax(ended)) if ended.any() else len(correlations)
    return min(1.0 + 2.0 * float(correlations[:last].sum()), float(count))


def _autocovariance(values: Numbers) -> Numbers:
    """Return Σ values_i·values_(i+k) for k = 0 .. N − 1 [N]."""
    size = 1 << (2 * len(values) - 1).bit_length()
    spectrum = np.fft.rfft(values, size)
    return np.asarray(np.fft.irfft(np.abs(spectrum) ** 2, size)[: len(values)])


def sample_weights(standardised: Numbers) -> Numbers:
    """Return the share of an independent sample that each sample of a stretch counts for."""
    # standardised: [N, n]; returns 1/τ of each joint [n]
    return np.array([1.0 / correlation_time(column) for column in standardised.T])


def effective_samples(standardised: Sequence[Numbers], weights: Sequence[Numbers]) -> tuple[Numbers, Numbers]:
    """Count samples, and the independent samples that they are worth."""
    # standardised: [N, n]; weights: [N, n]; returns samples of each joint [n], independent samples of each joint [n]
    used = [~np.isnan(residuals) for residuals in standardised]
    count = sum(flags.sum(axis=0) for flags in used)
    worth = sum((flags * weight).sum(axis=0) for flags, weight in zip(used, weights, strict=True))
    return np.asarray(count, dtype=np.float64), np.asarray(worth, dtype=np.float64)
