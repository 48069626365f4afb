"""How many independent samples the residuals of a fit are worth.

A likelihood that counts each sample as new is right for white residuals. What a model misses lasts for many samples, so
N of them tell as much as N/τ, τ = 1 + 2 Σ ρ_k their integrated autocorrelation time (Sokal 1997, sect. 2). The sum ends
with the first ρ_k that chance explains: white residuals have τ = 1 exactly, and noise at far lags adds nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]

CHANCE = 3.0  # standard deviations of ρ_k of white noise (1/√pairs): beyond it one of 740 white series is at a lag
FEWEST = 20  # pairs of a lag; fewer say nothing of it


def correlation_time(values: Numbers) -> float:
    """τ of a series in samples, at least 1.

    values: [N] standardised residuals about 0, NaN where not used: pairs across those do not count.
    """
    known = ~np.isnan(values)
    count = int(known.sum())
    filled = np.where(known, values, 0.0)
    power = float(filled @ filled)
    if count < FEWEST or power == 0.0:
        return 1.0
    pairs = np.round(_autocovariance(known.astype(np.float64)))
    reach = int(np.argmax(pairs < FEWEST)) or len(pairs)
    found = _autocovariance(filled)[1:reach] / pairs[1:reach] / (power / count)
    ended = found <= CHANCE / np.sqrt(pairs[1:reach])
    last = int(np.argmax(ended)) if ended.any() else len(found)
    return min(1.0 + 2.0 * float(found[:last].sum()), float(count))


def _autocovariance(values: Numbers) -> Numbers:
    """[N] Σ values_i·values_(i+k) for k = 0 .. N − 1."""
    size = 1 << (2 * len(values) - 1).bit_length()
    spectrum = np.fft.rfft(values, size)
    return np.asarray(np.fft.irfft(np.abs(spectrum) ** 2, size)[: len(values)])


def sample_weights(standardised: Numbers) -> Numbers:
    """[n] by joint 1/τ: the share of a sample that each sample of a stretch counts for.

    standardised: [N, n] of one stretch without a gap, NaN where not used.
    """
    return np.array([1.0 / correlation_time(column) for column in standardised.T])


def effective_samples(standardised: Sequence[Numbers], weights: Sequence[Numbers]) -> tuple[Numbers, Numbers]:
    """[n] samples by joint, and how many independent ones they are worth.

    standardised: [N, n] of each recording, NaN where not used. weights: [N, n] of each.
    """
    used = [~np.isnan(each) for each in standardised]
    count = sum(flags.sum(axis=0) for flags in used)
    worth = sum((flags * each).sum(axis=0) for flags, each in zip(used, weights, strict=True))
    return np.asarray(count, dtype=np.float64), np.asarray(worth, dtype=np.float64)
