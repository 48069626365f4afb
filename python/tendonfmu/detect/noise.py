"""The noise in free motion: that of the bias filter, and the error of the estimated external torque."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq, nnls

from tendonfmu.arrays import Array, Data, Flags, Indices, Numbers
from tendonfmu.detect.free_motion import FreePart
from tendonfmu.detect.learning import CELL
from tendonfmu.errors import InputError
from tendonfmu.model import Finger, number_of

# --- pretensions ------------------------------------------------------------------------------------------------------


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


_LEAST = 0.02  # of the residual's spread: least standard deviation at the recorded forces
_TINY = 1e-30


@dataclass(frozen=True)
class Residuals:
    """The residual of all free motion while nothing is in contact, about one sample of 10 ms."""

    residual: Numbers  # [c, n] (N·m)
    std: Numbers  # [c, n] standard deviation of the bias (N·m)
    force: Numbers  # [c] mean tendon force (N)
    group: Indices  # [c] pretension
    hours: Numbers  # [c] (h)

    @property
    def mean_force(self) -> float:
        """Mean tendon force over the time (N)."""
        return float(self.force @ self.hours / self.hours.sum())

    def of_pretensions(self, values: Numbers) -> Numbers:
        """Return the mean of values [c] or [c, n] by pretension."""
        return np.array([values[self.group == g].mean(axis=0) for g in range(self.group.max() + 1)])

    def rms(self) -> Numbers:
        """Return the rms of the residual by pretension [p, n] (N·m)."""
        return np.asarray(np.sqrt(self.of_pretensions(self.residual**2)))


def residuals_of(parts: Sequence[FreePart], outputs: Sequence[dict[str, Array]]) -> Residuals:
    """Collect the residuals of the counted samples of runs."""
    columns: list[list[Numbers]] = [[], [], [], [], [], []]
    for owner, (part, run) in enumerate(zip(parts, outputs, strict=True)):
        rows = np.flatnonzero(part.counted)
        every = max(1, round(CELL / float(np.median(np.diff(part.time)))))
        rows, hours = rows[::every], np.add.reduceat(part.seconds[rows], np.arange(0, len(rows), every)) / 3600.0
        found = (run["residual"][rows], run["compensated_torque_std"][rows], part.mean_force[rows], hours)
        for column, values in zip(columns, (*found, part.time[rows], np.full(len(rows), float(owner))), strict=True):
            column.append(values)
    residual, std, force, hours, time, owners = map(np.concatenate, columns)
    return Residuals(residual, std, force, pretension_of(force, time, owners.astype(np.int64)), hours)


def line_over_force(force: Numbers, value: Numbers) -> tuple[float, float]:
    """Fit a, b ≥ 0 with a + b·f ≈ value by least relative squares; b = 0 if the force hardly changes."""
    if force.max() < 1.1 * force.min():
        return float(value.mean()), 0.0
    value = np.maximum(value, _TINY)
    (base, slope), _ = nnls(np.column_stack([np.ones_like(force), force]) / value[:, None], np.ones_like(force))
    return float(base), float(slope)


# --- the bias ---------------------------------------------------------------------------------------------------------


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
    hours = [part.hours for part in parts]
    noise = base + per_force * float(np.average([part.mean_force.mean() for part in parts], weights=hours))
    if not drift > 0 or not noise > 0:
        what = "drift_variance" if not drift > 0 else "noise_std"
        raise InputError(f"{finger.path}: bias.{what} = 0: no time constant to keep; expected --bias-time in s")
    return time_constant(drift, noise, noise_time(finger.data, parts))


def noise_time(data: Data, parts: Sequence[FreePart]) -> float:
    """Return bias.noise_time (s), or the median step if the noise counts per sample."""
    given: float | None = (data.get("bias") or {}).get("noise_time")
    return float(np.median([np.median(np.diff(part.time)) for part in parts])) if given is None else given


def bias_noise(residuals: Residuals, of_bias: float, time: float) -> BiasNoise:
    """Estimate the noise from the spread of the residuals over the mean force, and the drift for a time constant."""
    # of_bias: bias.noise_time (s)
    square = residuals.of_pretensions(np.mean(residuals.residual**2, axis=1))
    base, per_force = line_over_force(residuals.of_pretensions(residuals.force), np.sqrt(square))
    drift = drift_variance(max(base + per_force * residuals.mean_force, 1e-12), of_bias, time)
    return BiasNoise(base, per_force, drift, time, residuals.mean_force)


# --- the estimate's standard deviation --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Deviation:
    """Standard deviation of compensated_torque beside that of the bias, as a line over the mean force, by joint [n]."""

    base: Numbers
    per_force: Numbers
    too_wide: Flags  # whether that of the bias alone exceeds the residuals


def deviation(residuals: Residuals) -> Deviation:
    """Choose the deviation for which r²/std² is 1 on average (docs/reference/semantics/outputs.md#outputs)."""
    force, rms = residuals.of_pretensions(residuals.force), residuals.rms()
    joints = rms.shape[1]
    base, per_force, too_wide = np.zeros(joints), np.zeros(joints), np.zeros(joints, dtype=bool)
    for j in range(joints):
        square, known = residuals.residual[:, j] ** 2, np.maximum(residuals.std[:, j] ** 2, _TINY)
        spread = np.maximum(rms[:, j], 1e-9)
        line, per = line_over_force(force, spread)
        line = max(line, _LEAST * float(spread.min()) - per * float(force.min()))
        shape = line + per * residuals.force

        def surplus(scale: float, square: Numbers = square, known: Numbers = known, shape: Numbers = shape) -> float:
            return float(np.mean(square / (known + (scale * shape) ** 2))) - 1.0

        too_wide[j] = surplus(0.0) <= 0
        # at this scale the mean is 1 even if the bias has no variance
        most = float(np.sqrt(np.mean(square / shape**2)))
        scale = 0.0 if too_wide[j] else brentq(surplus, 0.0, most * (1.0 + 1e-9), xtol=1e-6 * most)
        base[j], per_force[j] = scale * line, scale * per
    return Deviation(base, per_force, too_wide)
