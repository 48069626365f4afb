"""What torque of a recording a finger leaves unexplained: residuals before the bias update, and how random they are.

T of eq. (10) and the jumps Δb of fig. 5 come from the C core. The bias filter of fig. 5 runs here, without contact
detection, over the samples that it may learn from.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.model import native, number_of, without_detection

LAGS = 20  # of the Ljung-Box test; even, so that the chi-square tail is a finite sum
CONFIDENCE = 0.95
_BLOCK, _SMALL = 64, 1e-30


@dataclass(frozen=True)
class Model:
    """A finger without its bias filter over a recording; NaN (False) outside the parts."""

    torque: Numbers  # T of eq
    jump: Numbers  # δb [N, n] (N·m)
    joint_angle: Numbers  # angles (rad) and speeds (rad/s) as used [N, n]
    joint_speed: Numbers
    slack: Flags  # slack tendons [N, m]


def model_alone(
    data: Mapping[str, Any], arrays: Sequence[Mapping[str, Numbers]], parts: Sequence[slice], samples: int, source: int
) -> Model:
    """Run a finger without its bias filter over the parts of a recording."""
    joints, tendons = len(data["joints"]), len(data["tendons"])
    probe = native.Instance.from_description(without_detection(data, "forget_rate", "entry_load"), source)
    start = probe.save_state()
    torque, jump, angle, speed = (np.full((samples, joints), np.nan) for _ in range(4))
    slack = np.zeros((samples, tendons), dtype=bool)
    for part, given in zip(parts, arrays, strict=True):
        probe.restore_state(start)
        outputs = probe.run(given)
        bias = outputs["bias_torque"]
        torque[part] = outputs["friction_torque"] - bias - delayed_torque(data, given, outputs["joint_torque"])
        jump[part] = np.diff(bias, axis=0, prepend=bias[:1])
        angle[part], speed[part] = outputs["joint_angle"], outputs["joint_speed"]
        slack[part] = outputs["slack"]
    return Model(torque, jump, angle, speed, slack)


def delayed_torque(data: Mapping[str, Any], arrays: Mapping[str, Numbers], torque: Numbers) -> Numbers | float:
    """Return τ of the forces in use less τ of the measured forces."""
    # torque: [N, n] (N·m); returns [N, n] (N·m). 0 unless a `time_delay` below 0 delays the forces
    rows = data.get("extensions") or []
    if not any(row["effect"] == "time_delay" and row["delay"] < 0 for row in rows):
        return 0.0
    arms = np.array([tendon["moment_arms"] for tendon in data["tendons"]], dtype=float)
    return np.asarray(torque - arrays["tendon_force"] @ arms)


# --- the bias filter --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Residuals:
    """What the bias filter leaves; NaN outside the parts."""

    residual: Numbers  # r before the bias update [N, n] (N·m)
    variance: Numbers  # S of the residual [N] ((N·m)²)
    bias: Numbers  # b before the update [N, n] (N·m)

    @property
    def standardised(self) -> Numbers:
        """Standardised residuals r/√S [N, n]."""
        return np.asarray(self.residual / np.sqrt(self.variance)[:, None])


@dataclass(frozen=True)
class BiasSettings:
    """Settings of the bias filter."""

    drift: float  # `drift_variance`
    noise: float  # `noise_std` (N·m)
    per_force: float  # `noise_std_per_force` (N·m/N)
    noise_time: float | None  # `noise_time` (s), or None
    initial_variance: float | None  # `initial_variance` ((N·m)²), or None
    initial_torque: Numbers | None  # `initial_torque` [n] (N·m), or None


def bias_settings(data: Mapping[str, Any]) -> BiasSettings:
    """Return the bias settings of a description."""
    given = data.get("bias") or {}
    optional = {
        key: None if given.get(key) is None else float(given[key]) for key in ("noise_time", "initial_variance")
    }
    torque = given.get("initial_torque")
    return BiasSettings(
        drift=number_of(data, "bias.drift_variance"),
        noise=number_of(data, "bias.noise_std"),
        per_force=number_of(data, "bias.noise_std_per_force"),
        **optional,
        initial_torque=None if torque is None else np.array(torque, dtype=float),
    )


def track(
    settings: BiasSettings,
    time: Numbers,
    mean_force: Numbers,
    remainder: Numbers,
    jump: Numbers | None,
    learns: Flags,
    parts: Sequence[slice],
) -> Residuals:
    """Run the bias filter over y − T."""
    # time: [N] (s); mean_force: [N] (N); remainder: [N, n] (N·m); jump: [N, n] (N·m); learns: [N]
    residual, bias = np.full_like(remainder, np.nan), np.full_like(remainder, np.nan)
    variance = np.full(len(time), np.nan)
    for whole in parts:
        # the first sample that may be learned from starts the bias, unless the description says where it starts
        late = 0 if settings.initial_torque is not None else int(np.argmax(learns[whole]))
        if settings.initial_torque is None and not learns[whole].any():
            continue
        part = slice(whole.start + late, whole.stop)
        gain, variance[part] = _gains(settings, time[part], mean_force[part], learns[part])
        moved = np.zeros_like(remainder[part]) if jump is None else jump[part]
        first = remainder[part][0] if settings.initial_torque is None else settings.initial_torque
        bias[part] = _filter(remainder[part], moved, gain, first)
        residual[part] = remainder[part] - bias[part]
        residual[part.start] = np.nan
    return Residuals(residual, variance, bias)


def _gains(settings: BiasSettings, time: Numbers, mean_force: Numbers, learns: Flags) -> tuple[Numbers, Numbers]:
    """Return K [N], 0 where nothing is learned, and S [N] (NaN for the first sample)."""
    step = np.diff(time, prepend=time[0])
    spread = (settings.noise + settings.per_force * mean_force) ** 2
    known = float(spread[0]) if settings.initial_variance is None else settings.initial_variance
    if settings.noise_time is not None:
        spread = spread * settings.noise_time / np.maximum(step, 1e-300)
    gains, total = [0.0], np.full(len(time), np.nan)
    rows = zip((settings.drift * step).tolist()[1:], spread.tolist()[1:], learns.tolist()[1:], strict=True)
    for k, (drift, noise, learn) in enumerate(rows, start=1):
        known += drift
        total[k] = known + noise
        gain = known / (known + noise) if learn and known + noise > 0 else 0.0
        known *= 1 - gain
        gains.append(gain)
    return np.array(gains), total


def _filter(remainder: Numbers, jump: Numbers, gain: Numbers, first: Numbers) -> Numbers:
    """Return b before each update [N, n] (N·m)."""
    # s_k = (1 − K_k)(s_k−1 + Δb_k) + K_k (y − T)_k, b_k = s_k−1 + Δb_k, s_0 = first.
    # Computed in blocks as s = A (s_before + Σ c/A), with A the running product of 1 − K. This is exact except for
    # rounding while A is far from underflow. Where A is too small, because the filter learns fast, the block is
    # computed step by step.
    after = np.empty_like(remainder)
    keep = 1 - gain[:, None]
    forced = keep * jump + gain[:, None] * remainder
    after[0] = state = first
    for begin in range(1, len(remainder), _BLOCK):
        rows = slice(begin, begin + _BLOCK)
        product = np.cumprod(keep[rows], axis=0)
        if product[-1, 0] > _SMALL:
            after[rows] = product * (state + np.cumsum(forced[rows] / product, axis=0))
        else:
            for k in range(*rows.indices(len(remainder))):
                after[k] = state = keep[k] * state + forced[k]
        state = after[rows][-1]
    before = np.empty_like(after)
    before[0], before[1:] = first, after[:-1] + jump[1:]
    return before


# --- what is random in them -------------------------------------------------------------------------------------------


def rms(values: Numbers, chosen: Flags) -> list[float]:
    """Return the root mean square of the chosen rows."""
    # values: [N, n]; chosen: [N]; returns [n]
    picked = values[chosen]
    picked = picked[~np.isnan(picked).any(axis=1)]
    if not len(picked):
        return [math.nan] * values.shape[1]
    return [float(value) for value in np.sqrt(np.mean(picked**2, axis=0))]


def consistency(standardised: Sequence[Numbers], share: float = 1.0) -> dict[str, Any]:
    """Return the NIS, the mean of the squared standardised innovations, and its chi-square interval."""
    # The quantiles of χ²_k follow Wilson and Hilferty (1931). From 30 innovations on they are within 1e-3 of the
    # interval's width.
    # standardised: [N, n]; returns [low, high]
    values = np.concatenate([part[~np.isnan(part)] for part in standardised])
    if not len(values):
        return {"mean": math.nan, "interval": [math.nan, math.nan], "consistent": False}
    mean = float(np.mean(values**2))
    count = max(share * len(values), 1.0)
    low, high = (_mean_chi_square(count, p) for p in ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2))
    return {"mean": mean, "interval": [low, high], "consistent": bool(low <= mean <= high)}


def _mean_chi_square(count: float, probability: float) -> float:
    """Return the quantile of χ²_count/count."""
    part = 2 / (9 * count)
    return float((1 - part + NormalDist().inv_cdf(probability) * math.sqrt(part)) ** 3)


def whiteness(standardised: Sequence[Numbers]) -> dict[str, list[float]]:
    """Return how far the standardised residuals of each joint are from white noise."""
    # standardised: [N, n]; returns [n] [n]
    joints = standardised[0].shape[1]
    lag_one, p_value = [], []
    for j in range(joints):
        series = [part[:, j] for part in standardised]
        power = sum(float(np.nansum(part**2)) for part in series)
        count = sum(int(np.sum(~np.isnan(part))) for part in series)
        if count <= LAGS + 1 or not power:
            lag_one.append(math.nan)
            p_value.append(math.nan)
            continue
        correlations = [_lagged(series, lag) / power for lag in range(1, LAGS + 1)]
        statistic = count * (count + 2) * sum(r * r / (count - lag) for lag, r in enumerate(correlations, start=1))
        lag_one.append(correlations[0])
        p_value.append(chi_square_tail(statistic, LAGS))
    return {"lag_one": lag_one, "ljung_box_p": p_value}


def _lagged(series: Sequence[Numbers], lag: int) -> float:
    return sum(float(np.nansum(part[lag:] * part[:-lag])) for part in series if len(part) > lag)


def chi_square_tail(value: float, degrees: int) -> float:
    """Return P(χ²_degrees > value) for an even number of degrees: exp(−x) Σ x^i/i!, x = value/2 (exact)."""
    half = value / 2
    return float(sum(_poisson_terms(half, degrees // 2)))


def _poisson_terms(rate: float, count: int) -> Iterator[float]:
    for k in range(count):
        log = -rate + (k * math.log(rate) if rate > 0 else 0.0 if k == 0 else -math.inf) - math.lgamma(k + 1)
        yield math.exp(log) if log > -745 else 0.0
