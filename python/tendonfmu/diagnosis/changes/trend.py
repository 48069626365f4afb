"""How large a change is in each of the new recordings: since when it is there, and how fast it grows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.changes.search import Change, ChangeSearch
from tendonfmu.diagnosis.result import ChangedSize
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import Interval


def sizes_by_recording(
    search: ChangeSearch, number: int, size: ChangedSize, recordings: Sequence[FitRecording]
) -> tuple[Interval, ...]:
    """Return the size of a change in each of the new recordings, in their order and in its unit."""
    if len(recordings) < 2:
        return ()
    change = search.changes[number]
    return tuple(_in_unit(share, change, size) for share in shares_by_recording(search, number))


def shares_by_recording(search: ChangeSearch, number: int) -> list[tuple[float, float]]:
    """Return (value, standard error) for each new recording: which share of the change is in it, 1 for all of it."""
    shares = []
    low, high = _bounds(search.changes[number])
    for recording in search.new_recordings:
        grams = search.grams_of_recording(number, recording)
        mix = np.eye(1)
        _, by_fold = grams.error(mix, low, high)
        share = grams.magnitudes(mix, low, high)
        _, covariance = search.certainty_of(grams, mix, share, by_fold)
        shares.append((float(share[0]), float(np.sqrt(max(covariance[0, 0], 0.0)))))
    return shares


def _bounds(change: Change) -> tuple[Numbers, Numbers]:
    """Return the bounds of the share [1] within which all magnitudes are within theirs."""
    moved = change.magnitudes != 0.0
    size, own = change.magnitudes[moved], change.hypothesis
    ends = np.sort(np.stack([own.low[moved] / size, own.high[moved] / size]), axis=0)
    return np.array([ends[0].max(initial=-np.inf)]), np.array([ends[1].min(initial=np.inf)])


def _in_unit(share: tuple[float, float], change: Change, size: ChangedSize) -> Interval:
    value, error = size.change.value * share[0], abs(size.change.value) * share[1]
    whole = size.reference.value + value
    return Interval(whole, whole - 1.96 * error, whole + 1.96 * error)


def slope(times: Numbers, sizes: Sequence[Interval]) -> Interval:
    """Return the change per unit of time, by weighted least squares."""
    value = np.array([size.value for size in sizes])
    error = np.maximum(np.array([(size.high - size.low) / 3.92 for size in sizes]), 1e-300)
    weight = 1.0 / error**2
    centre = float(weight @ times / weight.sum())
    power = float(weight @ (times - centre) ** 2)
    if power <= 0.0:
        return Interval(0.0, -np.inf, np.inf)
    rise = float(weight @ ((times - centre) * value) / power)
    level = float(weight @ value / weight.sum())
    left = value - level - rise * (times - centre)
    scatter = float(weight @ left**2) / max(len(times) - 2, 1)
    half = 1.96 * float(np.sqrt(max(scatter, 1.0) / power))
    return Interval(rise, rise - half, rise + half)
