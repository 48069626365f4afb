"""Which stretches of free motion have the same pretension."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from tendonfmu.arrays import Indices, Numbers

WINDOW = 10.0  # s over which a mean force is computed
SAME = 1.2  # largest factor between neighbouring mean forces of one pretension
WIDEST = 1.6  # largest factor across a pretension; wider ones are divided
_FAR = 10**9  # windows between owners


def pretension_of(force: Numbers, time: Numbers, owner: Indices) -> Indices:
    """Return [c] the pretension of each force, in rising order: similar means over a `WINDOW` of an owner are one."""
    # force: (N); time: (s); owner: recording, or part of one
    _, inverse = np.unique(np.floor(time / WINDOW).astype(np.int64) + _FAR * owner, return_inverse=True)
    mean = np.maximum(np.bincount(inverse, force) / np.bincount(inverse), 1e-9)
    ordered = np.sort(mean)
    bounds = [ordered[0], *ordered[1:][ordered[1:] > SAME * ordered[:-1]], np.inf]
    edges: list[float] = []
    for low, above in pairwise(bounds):
        high = float(ordered[ordered < above].max())
        cuts = max(1, math.ceil(math.log(high / low) / math.log(WIDEST) - 1e-9))
        edges += [float(low * (high / low) ** (k / cuts)) for k in range(cuts)]
    label = np.searchsorted(np.array(edges[1:]), mean, side="right")
    _, label = np.unique(label, return_inverse=True)  # drops pretensions without a window
    return np.asarray(label[inverse], dtype=np.int64)
