"""States that friction may have and nobody records: elastic until they slip, some of them leaking away.

A stop operator is s = clip(s′ + Δx, ±w), where x is a travel or a force and w its width; a leaky one forgets with a
time T first, s′·exp(−Δt/T). Friction that remembers is nearly a sum of such states (Prandtl and Ishlinskii), so a
learner that is linear in them finds it. How much it finds of states planted for a test says what its silence is worth.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from tendonfmu.arrays import Indices, Numbers
from tendonfmu.recordings import stopped

if TYPE_CHECKING:
    from tendonfmu.diagnosis.series import Series

WIDTHS = (0.01, 0.04, 0.15)  # of the range of the travel or force
TIMES = (np.inf, 1.0, 0.1)  # s, in which a state leaks away
PLANTED = 3  # states planted at each joint


def states_of(series: Series, starts: Indices) -> Iterator[tuple[str, Numbers]]:
    """Yield (part of the finger, its states of every width and time [B, k]), for each joint and tendon."""
    widths, times = np.array(list(product(WIDTHS, TIMES))).T
    drivers, count = list(_drivers(series)), len(widths)
    moved = np.repeat(np.stack([driver for _, driver, _ in drivers], axis=1), count, axis=1)
    states = stopped(moved, np.tile(widths, len(drivers)), np.tile(times, len(drivers)), series.step, starts)
    for k, (who, _, load) in enumerate(drivers):
        own = states[:, k * count : (k + 1) * count]
        yield who, own if load is None else own * load[:, None]


def planted(series: Series, starts: Indices, random: np.random.Generator) -> Numbers:
    """Return states of other widths and times than those of `states_of`, at random parts [B, PLANTED]."""
    drivers = list(_drivers(series))
    chosen = random.integers(len(drivers), size=PLANTED)
    widths = np.exp(random.uniform(np.log(WIDTHS[0]), np.log(WIDTHS[-1]), PLANTED))
    times = np.where(random.random(PLANTED) < 0.5, np.inf, np.exp(random.uniform(np.log(0.05), np.log(3.0), PLANTED)))
    states = stopped(np.stack([drivers[k][1] for k in chosen], axis=1), widths, times, series.step, starts)
    loads = [drivers[k][2] for k in chosen]
    return np.stack(
        [state if load is None else state * load for state, load in zip(states.T, loads, strict=True)], axis=1
    )


def _drivers(series: Series) -> Iterator[tuple[str, Numbers, Numbers | None]]:
    """Yield (name, travel or force [B] in ranges, tendon force that the state presses with [B] or None)."""
    for joint, angle in enumerate(series.angle.T):
        yield f"joint {joint + 1}", _in_ranges(angle), None
    level = np.maximum(np.abs(series.force).mean(axis=0), 1e-12)
    travel = np.cumsum(series.tendon_velocity[:, :, 0], axis=0) * series.step
    for tendon in range(series.force.shape[1]):
        load = series.force[:, tendon] / level[tendon]
        yield f"tendon {tendon + 1}", _in_ranges(travel[:, tendon]), load
        yield f"force of tendon {tendon + 1}", _in_ranges(series.force[:, tendon]), None


def _in_ranges(values: Numbers) -> Numbers:
    low, high = np.quantile(values, (0.02, 0.98))
    return np.asarray(values / max(float(high - low), 1e-12))
