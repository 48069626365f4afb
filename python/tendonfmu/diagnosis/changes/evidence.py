"""How a change shows: what the reference model leaves, in the reference and now, over the effect's own coordinate.

The picture also has what is left now with the change in the model.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.changes.search import ChangeSearch
from tendonfmu.diagnosis.effects import Place
from tendonfmu.diagnosis.evidence import BINS, FEWEST, coordinate_of, shown, standard_errors
from tendonfmu.diagnosis.result import Evidence


def change_evidence(search: ChangeSearch, number: int, coordinate: str) -> tuple[Evidence, ...]:
    """Return the picture at the joint where the change shows most."""
    change = search.changes[number]
    left = search.left()  # with all changes, without the background
    added = search.column(number) @ change.magnitudes
    added = added - added[search.series.used].mean(axis=0)
    now = search.informative & search.sides.now
    joint = int(np.argmax(np.sum(added[now] ** 2, axis=0)))
    place = _place(search, number, joint)
    own = _binned(search, coordinate_of(place, coordinate, search.series, joint), left, added, joint)
    if own and shown(own[0]):
        return own
    torque = (f"torque of this change at joint {joint + 1}", "N·m", added[:, joint])
    return _binned(search, torque, left, added, joint) or own


def _binned(
    search: ChangeSearch, over: tuple[str, str, Numbers], left: Numbers, added: Numbers, joint: int
) -> tuple[Evidence, ...]:
    label, unit, values = over
    now = search.informative & search.sides.now
    then = search.informative & ~search.sides.now
    kept = now & np.isfinite(values)
    bins = min(BINS, int(kept.sum()) // FEWEST)
    if bins < 2:
        return ()
    edges = np.quantile(values[kept], np.linspace(0.0, 1.0, bins + 1))
    low, high = edges[0], edges[-1]
    edges[0], edges[-1] = -np.inf, np.inf
    member = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, bins - 1)
    parts = [np.flatnonzero(kept & (member == k)) for k in range(bins)]
    parts = [part for part in parts if len(part)]
    inside = then & (values >= low) & (values <= high)
    theirs = [np.flatnonzero(inside & (member == member[part[0]])) for part in parts]
    before, after = (left + added)[:, joint], left[:, joint]
    means = [_means(torque, parts, search) for torque in (before, after)]
    return (
        Evidence(
            joint + 1,
            label,
            unit,
            np.array([values[rows].mean() for rows in parts]),
            means[0][0],
            means[1][0],
            means[0][1],
            means[1][1],
            *_means(after, theirs, search),
        ),
    )


def _place(search: ChangeSearch, number: int, joint: int) -> Place:
    own = search.changes[number].hypothesis
    return Place(own.joint or joint + 1, own.tendon)


def _means(values: Numbers, parts: list[NDArray[np.int64]], search: ChangeSearch) -> tuple[Numbers, Numbers]:
    """Return means and their standard errors [K]; NaN for bins with fewer than FEWEST blocks."""
    enough = [rows if len(rows) >= FEWEST else rows[:0] for rows in parts]
    means = np.array([values[rows].mean() if len(rows) else np.nan for rows in enough])
    errors = standard_errors(values, [rows for rows in enough if len(rows)], replace(search.series))
    spread = np.full(len(parts), np.nan)
    spread[[k for k, rows in enumerate(enough) if len(rows)]] = errors
    return means, spread
