"""The residual over a cause's own coordinate, with and without the cause."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from tendonfmu.diagnosis_result import Evidence
from tendonfmu.diagnosis_series import Series
from tendonfmu.extension_fit import Accepted

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]

BINS = 24
_FEWEST = 10  # blocks of a bin


def evidence(cause: Accepted, series: Series, before: Numbers, after: Numbers) -> tuple[Evidence, ...]:
    """Of the joint where the cause changes most: over the effect's own coordinate, and over the torque that it adds.

    before, after: [B, n] N·m residual without and with the cause. The second is an added-variable plot: without the
    cause the residual follows its torque with slope 1, with it nothing of that is left.
    """
    change = np.sum((before - after)[series.used] ** 2, axis=0)
    joint = int(np.argmax(change))
    own = (f"torque of this cause at joint {joint + 1}", "N·m", (before - after)[:, joint])
    return tuple(
        found
        for label, unit, values in (_coordinate(cause, series, joint), own)
        for found in _binned(label, unit, values, series, (before[:, joint], after[:, joint]), joint)
    )


def _binned(
    label: str, unit: str, values: Numbers, series: Series, pair: tuple[Numbers, Numbers], joint: int
) -> tuple[Evidence, ...]:
    """Over bins of equal count; nothing where there are too few blocks. values: [B]. pair: [B] without and with."""
    kept = series.used & np.isfinite(values)
    bins = min(BINS, int(kept.sum()) // _FEWEST)
    if bins < 2:
        return ()
    order = np.flatnonzero(kept)[np.argsort(values[kept], kind="stable")]
    parts = np.array_split(order, bins)
    before, after = (np.array([each[rows].mean() for rows in parts]) for each in pair)
    before_std, after_std = (_standard_errors(each, parts, series) for each in pair)
    coordinate = np.array([values[rows].mean() for rows in parts])
    return (Evidence(joint + 1, label, unit, coordinate, before, after, before_std, after_std),)


def _standard_errors(values: Numbers, parts: list[NDArray[np.int64]], series: Series) -> Numbers:
    """Of the means; neighbouring blocks of time are not independent, so whole seconds count as one."""
    second = np.floor(series.time).astype(np.int64) + 1_000_000 * series.recording
    found = []
    for rows in parts:
        _, member = np.unique(second[rows], return_inverse=True)
        sums = np.bincount(member, weights=values[rows] - values[rows].mean())
        found.append(np.sqrt(np.sum(sums**2)) / len(rows))
    return np.array(found)


def _coordinate(cause: Accepted, series: Series, joint: int) -> tuple[str, str, Numbers]:
    """Label, unit, [B] values."""
    own = joint if cause.place.joint is None else cause.place.joint - 1
    tendon = None if cause.place.tendon is None else cause.place.tendon - 1
    kind = cause.candidate.coordinate
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
    """[B, n] rad, in the direction of motion."""
    return np.asarray(series.travel * np.sign(series.velocity))
