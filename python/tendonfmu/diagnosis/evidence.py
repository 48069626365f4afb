"""How the residual looks over a cause's own coordinate, with and without the cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.effects.candidate import Candidate, Place
from tendonfmu.diagnosis.result import Evidence
from tendonfmu.diagnosis.series import Series

BINS = 24
SHOWN = 4.0  # ratio of the bins' squared means without and with the cause, for a picture that shows it
FEWEST = 10  # blocks in a bin


def evidence(
    places: Sequence[Place], candidate: Candidate, series: Series, before: Numbers, after: Numbers
) -> tuple[Evidence, ...]:
    """Return a picture of the residual at the joint where the cause changes most."""
    change = np.sum((before - after)[series.used] ** 2, axis=0)
    joint = int(np.argmax(change))
    pair = (before[:, joint], after[:, joint])
    own = _binned(*coordinate_of(_nearest(places, joint), candidate.coordinate, series, joint), series, pair, joint)
    if own and shown(own[0]):
        return own
    added = (f"torque of this cause at joint {joint + 1}", "N·m", (before - after)[:, joint])
    return _binned(*added, series, pair, joint) or own


def _nearest(places: Sequence[Place], joint: int) -> Place:
    """Return the place at that joint if there is one, else the first place."""
    return next((place for place in places if place.joint == joint + 1), places[0])


def shown(evidence: Evidence) -> bool:
    """Return whether the cause removes most of the bins' mean residual."""
    return float(np.sum(evidence.before**2)) >= SHOWN * float(np.sum(evidence.after**2))


def _binned(
    label: str, unit: str, values: Numbers, series: Series, pair: tuple[Numbers, Numbers], joint: int
) -> tuple[Evidence, ...]:
    """Average over bins of equal count; return nothing if there are too few blocks."""
    kept = series.used & np.isfinite(values)
    bins = min(BINS, int(kept.sum()) // FEWEST)
    if bins < 2:
        return ()
    order = np.flatnonzero(kept)[np.argsort(values[kept], kind="stable")]
    parts = np.array_split(order, bins)
    before, after = (np.array([torque[rows].mean() for rows in parts]) for torque in pair)
    before_std, after_std = (standard_errors(torque, parts, series) for torque in pair)
    coordinate = np.array([values[rows].mean() for rows in parts])
    return (Evidence(joint + 1, label, unit, coordinate, before, after, before_std, after_std),)


def standard_errors(values: Numbers, parts: list[NDArray[np.int64]], series: Series) -> Numbers:
    """Return the standard errors of the bins' means."""
    second = np.floor(series.time).astype(np.int64) + 1_000_000 * series.recording
    errors = []
    for rows in parts:
        _, member = np.unique(second[rows], return_inverse=True)
        sums = np.bincount(member, weights=values[rows] - values[rows].mean())
        errors.append(np.sqrt(np.sum(sums**2)) / len(rows))
    return np.array(errors)


def coordinate_of(place: Place, kind: str, series: Series, joint: int) -> tuple[str, str, Numbers]:
    """Return label, unit and values [B] of the coordinate."""
    own = joint if place.joint is None else place.joint - 1
    tendon = None if place.tendon is None else place.tendon - 1
    if kind == "velocity" and tendon is not None:
        return f"velocity of tendon {tendon + 1}", "m/s", series.tendon_velocity[:, tendon, own]
    if kind in ("force", "load"):
        if tendon is None:
            return "mean tendon force", "N", np.abs(series.force).mean(axis=1)
        return f"force of tendon {tendon + 1}", "N", series.force[:, tendon]
    of_joint: Mapping[str, tuple[str, str, Numbers]] = {
        "velocity": ("velocity", "rad/s", series.velocity),
        "angle": ("angle", "rad", series.angle),
        "travel": ("travel since the last reversal", "rad", _signed_travel(series)),
        "acceleration": ("acceleration", "rad/s²", series.acceleration),
    }
    if kind in of_joint:
        label, unit, values = of_joint[kind]
        return f"{label} of joint {own + 1}", unit, values[:, own]
    return "time", "s", series.time


def _signed_travel(series: Series) -> Numbers:
    """Return the travel since the last reversal with the sign of the motion [B, n], rad."""
    return np.asarray(series.travel * np.sign(series.velocity))
