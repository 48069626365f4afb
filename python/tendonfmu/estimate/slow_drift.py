"""What is not judged of a torque: one constant for each joint and stretch, or the slowest drift that rests demand.

A learning bias would follow everything slow, such as a missing cover or weight. A drift, of a sensor's zero or a
temperature, shows while all joints stand still: there neither friction nor position-dependent torque changes much.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy import sparse

from tendonfmu.arrays import Array, Flags, Indices, Numbers
from tendonfmu.statistics import Span, spline_basis

KNOTS = (60.0, 30.0, 15.0)  # s, of a drift; the slowest that is enough is used
SHORTEST = 0.3  # s, of a rest
FEWEST = 12  # rests, for a drift to show
CLEARLY = 2.0  # standard errors of the mean fall of the rests' squared errors


class SlowDrift:
    """The constant, or the splines, of each joint and stretch."""

    def __init__(self, time: Numbers, stretch: Indices, used: Flags, knots: float = np.inf) -> None:
        """Make the basis. time: [B] (s); stretch: [B]; used: [B]; knots: s, inf for constants."""
        self.knots, self.used = knots, used
        self.basis = sparse.csr_array(sparse.block_diag(_bases(time, stretch, knots), format="csr"))  # [B, s]
        self._span = Span(self.basis[used])

    def without(self, values: Array) -> Numbers:
        """Return the used rows of values [B, n, ...] without their constant or drift, [R, n, ...]."""
        rows = values[self.used]
        return self._span.without(rows.reshape(len(rows), -1)).reshape(rows.shape) if rows.size else rows


def _bases(time: Numbers, stretch: Indices, knots: float) -> list[Numbers]:
    pieces = [time[stretch == number] for number in np.unique(stretch)]
    return [_basis(piece, piece, knots) for piece in pieces]


def _basis(time: Numbers, stretch: Numbers, knots: float) -> Numbers:
    """Return [K, s] a constant or splines at times [K] of a stretch with the times [B] (s)."""
    span = float(stretch[-1] - stretch[0])
    if span < knots:
        return np.ones((len(time), 1))
    inside = np.clip(time, stretch[0], stretch[-1])
    first = np.concatenate([stretch[:1], inside])
    return np.asarray(spline_basis(first, span, knots).todense())[1:]


def slowest_drift(residual: Numbers, time: Numbers, stretch: Indices, used: Flags, still: Flags) -> SlowDrift:
    """Return the slowest drift that the rests demand.

    residual: [B, n] (N·m); time: [B] (s); stretch, used: [B]; still: [B] whether all joints stand still.
    """
    rests = _rests(time, stretch, still)
    best = np.inf
    if len(rests) >= FEWEST:
        scale = np.maximum(residual[used].std(axis=0), 1e-12)
        means = np.array([residual[rest].mean(axis=0) for rest in rests]) / scale
        centres = np.array([time[rest].mean() for rest in rests])
        number = np.array([stretch[rest.start] for rest in rests])
        error = _left_out(means, centres, number, time, stretch, np.inf)
        for knots in KNOTS:
            other = _left_out(means, centres, number, time, stretch, knots)
            fall = error - other
            if fall.mean() > CLEARLY * fall.std(ddof=1) / np.sqrt(len(fall)):
                best, error = knots, other
    return SlowDrift(time, stretch, used, best)


def _rests(time: Numbers, stretch: Indices, still: Flags) -> list[slice]:
    bounds = np.flatnonzero(
        np.diff(still, prepend=False, append=False) | np.append(np.diff(stretch, prepend=0) != 0, False)
    )
    runs = [slice(int(a), int(b)) for a, b in pairwise(bounds) if still[a]]
    return [run for run in runs if time[run.stop - 1] - time[run.start] >= SHORTEST]


def _left_out(
    means: Numbers, centres: Numbers, number: Indices, time: Numbers, stretch: Indices, knots: float
) -> Numbers:
    """Return [r] the squared error of each rest's mean [r, n], predicted from the others of its stretch."""
    errors = np.zeros(len(means))
    for own in np.unique(number):
        rows = number == own
        basis = _basis(centres[rows], time[stretch == own], knots)
        hat = basis @ np.linalg.pinv(basis, rcond=1e-8)
        free = np.maximum(1.0 - np.diag(hat), 1e-3)
        errors[rows] = np.sum(((means[rows] - hat @ means[rows]) / free[:, None]) ** 2, axis=1)
    return errors
