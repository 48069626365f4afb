"""Numbers of a diagnosis as they are shown: torques in one unit, shares, p-values, and the parts of what is left."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonfmu.diagnosis import Diagnosis
from tendonfmu.report.fit_summary import rounded
from tendonfmu.statistics import Interval

NBSP = "\u00a0"
_FALLEN = math.exp(-1.0)  # a correlation that has fallen to this is over, as that of one time constant


def unit_of(found: Diagnosis) -> tuple[float, str]:
    """Return factor and name of the unit in which all torques of a diagnosis are shown."""
    rms = [*found.nominal.train_rms, *found.nominal.test_rms, *found.bias_only_rms]
    largest = max((value for value in rms if math.isfinite(value)), default=0.0)
    return (1e3, "mN·m") if largest < 2.0 else (1.0, "N·m")


def together(values: Sequence[float]) -> float:
    """Return the rms over all joints from the rms of each; NaN without joints."""
    known = [value for value in values if math.isfinite(value)]
    return math.sqrt(sum(value * value for value in known) / len(known)) if known else math.nan


def percent(share: float) -> str:
    """Format a share with two digits where that is enough: 31 %, 4.2 %, −0.3 %."""
    if not math.isfinite(share):
        return "–"
    value = 100 * share
    text = f"{value:.0f}" if abs(value) >= 9.95 else f"{value:.1f}"
    text = "0" if float(text) == 0 else text.replace("-", "−")
    return f"{text}{NBSP}%"


def percent_interval(found: Interval) -> str:
    """Format a share with its interval, such as "31 % (27 to 35 %)"."""
    if not (math.isfinite(found.low) and math.isfinite(found.high)):
        return percent(found.value)
    return f"{percent(found.value)} ({percent(found.low).removesuffix(f'{NBSP}%')} to {percent(found.high)})"


def probability(p_value: float) -> str:
    """Format a p-value, such as 0.008 or 3.4e-5; an upper bound where it is below what floating point resolves."""
    if not math.isfinite(p_value):
        return "–"
    if p_value < 1e-12:
        return "< 1e-12"
    mantissa, _, exponent = f"{p_value:.2g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa


def magnitude(value: float, unit: str) -> str:
    """Format a number of the description with its unit."""
    told = unit.replace(".", "·")
    return f"{value:.4g}".replace("-", "−") + ("" if unit in ("", "1") else f"{NBSP}{told}")


@dataclass(frozen=True)
class Left:
    """What is left on unseen data, in the unit of `unit_of`."""

    whole: float  # rms over all joints
    noise: float  # the part that nothing recorded predicts
    nameless: float  # the rest
    digits: int  # decimals shown
    memory: str  # how long what is left stays correlated, in words; empty for white noise, or where it is unknown

    def told(self, value: float) -> str:
        return f"{value:.{self.digits}f}"


def left_of(found: Diagnosis) -> Left | None:
    """Return what is left on unseen data; None where the noise floor is unknown."""
    factor, _ = unit_of(found)
    whole, noise = factor * together(found.extended.test_rms), factor * together(found.noise_floor)
    if not (math.isfinite(whole) and math.isfinite(noise)):
        return None
    digits = len(rounded(whole).partition(".")[2])
    whole, noise = round(whole, digits), round(min(noise, whole), digits)
    return Left(whole, noise, round(whole - noise, digits), digits, _memory(found))


def _memory(found: Diagnosis) -> str:
    """Say over which time what is left is correlated, at the joint where it is longest: until 1/e of it remains."""
    views = [view for view in found.views if view.kind == "autocorrelation"]
    times = [_time_to_fall(view.x, view.after) for view in views if view.after[0] > _FALLEN]
    if not times:
        return ""
    longest = max(times)
    return f"{1e3 * longest:.2g} ms" if longest < math.inf else f"{views[0].x[-1]:.2g} s or more"


def _time_to_fall(lag: NDArray[np.float64], correlation: NDArray[np.float64]) -> float:
    """Return the lag (s) at which a correlation above `_FALLEN` first meets it; infinite if it stays above."""
    below = np.flatnonzero(correlation <= _FALLEN)
    if not len(below):
        return math.inf
    pair = [below[0], below[0] - 1]  # the lower value first, as np.interp needs
    return float(np.interp(_FALLEN, correlation[pair], lag[pair]))
