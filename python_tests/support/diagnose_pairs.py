"""Pairs of a finger description and recordings that do not belong together well, by seed.

Every pair has a main quirk, `QUIRKS` in turn, and some have more.
"""

from __future__ import annotations

import numpy as np

from diagnose_quirks import ALONE, QUIRKS, REMAKING
from odd_finger import Pair, finger, moved

COUNT = 330
SEVERAL = 0.35  # of the pairs have a further quirk


def make_pair(seed: int) -> Pair:
    """The pair of a seed, always the same."""
    rng = np.random.default_rng([seed, 20])
    names = list(QUIRKS)
    chosen = [names[seed % len(names)]]
    while rng.random() < SEVERAL and len(chosen) < 3:
        chosen.append(str(rng.choice([name for name in names if name not in (*chosen, *ALONE)])))
    joints = int(rng.choice([1, 2, 2, 3]))
    tendons = int(rng.choice([2 * joints, joints + 1]))
    description = finger(rng, joints, tendons)
    rate = float(rng.choice([100.0, 100.0, 200.0, 500.0]))
    recordings = [moved(rng, description, rng.uniform(6.0, 20.0) if rate < 500.0 else 8.0, rate)]
    tests = [moved(rng, description, rng.uniform(5.0, 10.0), rate)] if rng.random() < 0.5 else []
    pair = Pair(seed, description, recordings, tests)
    # what makes recordings anew comes first, what takes columns away last
    for name in sorted(chosen, key=lambda name: (name not in REMAKING, name in ALONE)):
        QUIRKS[name](rng, pair)
    pair.quirks = chosen
    return pair
