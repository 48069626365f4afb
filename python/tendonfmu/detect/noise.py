"""The noise in free motion: that of the bias filter, and the error of the estimated external torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, nnls

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.detect.alarm_level import Cells, rows_of
from tendonfmu.detect.bounds import Bound
from tendonfmu.detect.free_motion import FreePart, FreeRun
from tendonfmu.errors import InputError
from tendonfmu.model import Finger, number_of

BINS = 8  # of mean force, divided among the pretensions
_LEAST = 0.02  # of the residual's spread: least standard deviation at the recorded forces
_TINY = 1e-30


@dataclass(frozen=True)
class BiasNoise:
    """Noise of the bias: keys of the description in their units, and the time constant (s) at `force` (N)."""

    noise_std: float
    noise_std_per_force: float
    drift_variance: float
    time_constant: float
    force: float

    def keys(self) -> dict[str, float]:
        """Return the keys of the description."""
        names = ("drift_variance", "noise_std", "noise_std_per_force")
        return {name: float(f"{getattr(self, name):.6g}") for name in names}


def time_constant(drift: float, noise: float, noise_time: float) -> float:
    """Compute the time in which the bias follows a step to 1 − 1/e (s)."""
    # A filter of variance P that takes samples of variance σ²·T0/dt a step dt apart obeys dP/dt = q − P²/(σ²·T0). In
    # the steady state P = (q·σ²·T0)^½. The bias follows with the rate K/dt = P/(σ²·T0), so τ = σ·(T0/q)^½.
    return noise * float(np.sqrt(noise_time / drift))


def drift_variance(noise: float, noise_time: float, time: float) -> float:
    """Compute the drift ((N·m)²/s) with a given `time_constant` (s): noise²·noise_time/time²."""
    return noise**2 * noise_time / time**2


def wanted_time(finger: Finger, parts: Sequence[FreePart], bias_time: float | None) -> float:
    """Return the time constant of the bias (s): as asked for, else that of the description at the mean force."""
    if bias_time is not None:
        return bias_time
    drift, base, per_force = (
        number_of(finger.data, f"bias.{key}") for key in ("drift_variance", "noise_std", "noise_std_per_force")
    )
    noise = base + per_force * mean_force(parts)
    if not drift > 0 or not noise > 0:
        what = "drift_variance" if not drift > 0 else "noise_std"
        raise InputError(f"{finger.path}: bias.{what} = 0: no time constant to keep; expected --bias-time in s")
    return time_constant(drift, noise, noise_time(finger.data, parts))


def noise_time(data: Data, parts: Sequence[FreePart]) -> float:
    """Return bias.noise_time (s), or the median step if the noise counts per sample."""
    given: float | None = (data.get("bias") or {}).get("noise_time")
    return float(np.median([np.median(np.diff(part.time)) for part in parts])) if given is None else given


def mean_force(parts: Sequence[FreePart]) -> float:
    """Compute the mean force over the counted time (N)."""
    total = sum(part.hours for part in parts)
    return sum(float((part.mean_force * part.seconds)[part.counted].sum()) / 3600.0 for part in parts) / total


def bias_noise(data: Data, runs: Sequence[FreeRun], cells: Cells, time: float) -> BiasNoise:
    """Estimate the noise from the spread of the residuals over the mean force, and the drift for a time constant."""
    parts = [run.part for run in runs]
    square = cells.mean(rows_of([run.residual for run in runs], cells) ** 2).mean(axis=1)
    force, spread = _binned(cells, square)
    base, per_force = _line(force, np.sqrt(np.maximum(spread, _TINY)))
    at = mean_force(parts)
    drift = drift_variance(base + per_force * at, noise_time(data, parts), time)
    return BiasNoise(base, per_force, drift, time, at)


def _binned(cells: Cells, values: Numbers) -> tuple[Numbers, Numbers]:
    """Return mean force [b] and mean value [b] of about `BINS` bins of similar mean force, none across pretensions."""
    forces, means = [], []
    each = max(1, BINS // cells.groups)
    for g in range(cells.groups):
        rows = np.flatnonzero(cells.group == g)
        ordered = rows[np.argsort(cells.force[rows], kind="stable")]
        for part in np.array_split(ordered, min(each, len(ordered))):
            forces.append(float(cells.force[part].mean()))
            means.append(float(values[part].mean()))
    return np.array(forces), np.array(means)


def _line(force: Numbers, value: Numbers) -> tuple[float, float]:
    """Fit a, b ≥ 0 with a + b·f ≈ value by least relative squares; b = 0 if the force hardly changes."""
    if force.max() < 1.1 * force.min():
        return float(value.mean()), 0.0
    columns = np.column_stack([np.ones_like(force), force]) / value[:, None]
    (base, slope), _ = nnls(columns, np.ones_like(force))
    return float(base), float(slope)


# --- the estimate's standard deviation --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Deviation:
    """Standard deviation of compensated_torque beside the parts that are known otherwise."""

    base: Numbers
    per_force: Numbers
    square: Numbers
    too_wide: Flags


def deviation(runs: Sequence[FreeRun], cells: Cells, bound: Bound) -> Deviation:
    """Choose the deviation for which r²/std² is 1 on average (docs/reference/semantics/outputs.md#outputs)."""
    left = cells.mean(rows_of([run.residual for run in runs], cells) ** 2)
    other = cells.mean(rows_of([run.known for run in runs], cells) ** 2)
    for share, name in ((bound.stuck_share, "stuck"), (bound.jump_share, "jump")):
        if share:
            part = rows_of([getattr(run, name) for run in runs], cells)
            other = other + share**2 / 3.0 * cells.mean(part**2)
    everywhere = np.ones(len(cells.fold), dtype=bool)
    base, per_force, too_wide = _calibrated(left, other, cells, everywhere)
    square = np.full((cells.groups, left.shape[1]), np.nan)
    ratio = np.empty_like(left)
    for fold in (0, 1):
        learned, held = cells.fold != fold, cells.fold == fold
        a, b, _ = _calibrated(left, other, cells, learned if learned.any() else everywhere)
        ratio[held] = left[held] / (other[held] + (a + b * cells.force[held, None]) ** 2)
    for g in range(cells.groups):
        square[g] = ratio[cells.group == g].mean(axis=0)
    return Deviation(base, per_force, square, too_wide)


def _calibrated(left: Numbers, other: Numbers, cells: Cells, rows: Flags) -> tuple[Numbers, Numbers, Flags]:
    """Find base and per_force [n] for which left/(other + (base + per_force·f)²) is 1 on average."""
    joints = left.shape[1]
    base, per_force, too_wide = np.zeros(joints), np.zeros(joints), np.zeros(joints, dtype=bool)
    group, force = cells.group[rows], cells.force[rows]
    present = np.unique(group)
    at = np.array([force[group == g].mean() for g in present])
    for j in range(joints):
        square, known = left[rows, j], np.maximum(other[rows, j], _TINY)
        spread = np.array([np.sqrt(square[group == g].mean()) for g in present])
        line, per = _line(at, np.maximum(spread, 1e-9))
        shape = (max(line, _LEAST * float(spread.min()) - per * float(force.min())), per)

        def surplus(scale: float, square: Numbers = square, known: Numbers = known, shape: Any = shape) -> float:
            return float(np.mean(square / (known + (scale * (shape[0] + shape[1] * force)) ** 2))) - 1.0

        too_wide[j] = surplus(0.0) <= 0
        # at this scale the mean is 1 even if all other parts are 0
        most = float(np.sqrt(np.mean(square / (shape[0] + shape[1] * force) ** 2)))
        scale = 0.0 if too_wide[j] else brentq(surplus, 0.0, most * (1.0 + 1e-9), xtol=1e-6 * most)
        base[j], per_force[j] = scale * shape[0], scale * shape[1]
    return base, per_force, too_wide
