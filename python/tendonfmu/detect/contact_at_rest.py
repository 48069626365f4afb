"""The rule for contact at rest, learned from the rests in free motion (docs/reference/semantics/rest.md).

The positions show how far a standing motor moves. The runtime decides what a rest is, and shows how much the torques
change at rest. Bounds are fitted to some of the rests, and scaled until the other rests keep the rate.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import lfilter

from tendonfmu.arrays import Array, Data, Numbers, rounded
from tendonfmu.detect.alarm_level import allowed_alarms, rate_limit
from tendonfmu.detect.free_motion import FreePart, runs_of
from tendonfmu.files import counted
from tendonfmu.model import DEFAULTS, NEVER, number_of

SETTLE_TIME = DEFAULTS["contact.rest.settle_time"]  # s
INNOVATION_TIME = 0.5  # s; a touch rises within this time, creep hardly changes
LEAST_REST = 0.5  # s; shorter rests are brief stops and are not used
LEFT_OUT = "contact.rest is left out: "  # followed by the reason
LEAST_MINUTES, LEAST_RESTS = 2.0, 20  # in all; with fewer no bound can be tested on other rests
STANDING_SHARE = 0.05  # quantile over all windows: the span of positions of standing motors
TRAVEL_SPANS = 2.0  # spans of standing motors; two, because the position of reference is noisy as well
SLOWEST = 0.5  # of velocity_threshold.tendon: a faster motor moves, and its span is not noise
NOISE_LEVEL = 5.0  # σ: 100,000 independent averages per hour and joint exceed it once in 17 hours
FOLDS = 5
BEYOND = 1.2  # margin over the largest change if no alarm is allowed: the next hour may have a larger one
_DIGITS = 4  # of a written bound
_ROUNDS, _RAISE = 12, 1.1  # most steps, and the factor of each, until the running finger keeps the rate


@dataclass(frozen=True)
class RestRule:
    """The rule for contact at rest, and its evidence."""

    keys: Mapping[str, Any]
    rests: int
    hours: float
    held_out: int
    alarms: int
    limit: float


@dataclass(frozen=True)
class Rest:
    """One rest."""

    time: Numbers
    change: Numbers
    sudden: Numbers
    noise: Numbers


@dataclass(frozen=True)
class Bounds:
    """Bounds of a rest, [n] each (N·m): contact.rest.threshold, creep in the first second, and innovation.threshold."""

    threshold: Numbers
    creep: Numbers
    sudden: Numbers

    def scaled(self, factor: float) -> Bounds:
        """Return the bounds times a factor."""
        return Bounds(factor * self.threshold, factor * self.creep, factor * self.sudden)

    def keys(self, travel: float) -> dict[str, Any]:
        """Return `contact.rest` with these bounds and a travel (m)."""
        return {
            "travel": travel,
            "settle_time": SETTLE_TIME,
            "threshold": rounded(self.threshold, _DIGITS),
            "creep": rounded(self.creep, _DIGITS),
            "innovation": {"time": INNOVATION_TIME, "threshold": rounded(self.sudden, _DIGITS)},
        }


def learn_rest(
    data: Data, parts: Sequence[FreePart], rate: float, confidence: float
) -> tuple[RestRule | None, list[str]]:
    """Learn the rule for a rate of false alarms per hour of rest."""
    if not all("tendon_position" in part.arrays for part in parts):
        return None, [f"{LEFT_OUT}there are no tendon positions"]
    travel = standing_travel(data, parts)
    if travel is None:
        return None, [f"{LEFT_OUT}the motors never stand for {SETTLE_TIME:g} s"]
    joints = len(data["joints"])
    never = {"travel": travel, "settle_time": SETTLE_TIME, "threshold": [NEVER] * joints}
    rests = find_rests(data, parts, never)
    hours = sum(float(rest.time[-1]) for rest in rests) / 3600.0
    if 60.0 * hours < LEAST_MINUTES or len(rests) < LEAST_RESTS:
        return None, [
            f"{LEFT_OUT}{counted(len(rests), 'rest')} of {60.0 * hours:.2g} min in all; expected at least "
            f"{LEAST_RESTS} of more than {LEAST_REST:g} s and {LEAST_MINUTES:g} min in all"
        ]
    allowed = max(0, allowed_alarms(hours, rate, confidence))
    factor, held_out = level(rests, allowed)
    bounds = fit_bounds(rests).scaled(factor)
    for _ in range(_ROUNDS):
        alarms = count_alarms(data, parts, bounds.keys(travel))
        if alarms <= allowed:
            break
        bounds = bounds.scaled(_RAISE)
    limit = rate_limit(max(alarms, held_out), hours, confidence)
    rule = RestRule(bounds.keys(travel), len(rests), hours, held_out, alarms, limit)
    sentences = []
    if limit > rate:
        sentences.append(
            f"contact.rest: {counted(len(rests), 'rest')} of {60.0 * hours:.3g} min: at most {limit:.3g} false alarms "
            f"per hour of rest are supported at confidence {confidence:g}, not {rate:g}"
        )
    return rule, sentences


# --- motors -----------------------------------------------------------------------------------------------------------


def standing_travel(data: Data, parts: Sequence[FreePart]) -> float | None:
    """Return the travel (m) that a standing motor stays within; None if no motor ever stands."""
    spans, resolution = [], np.inf
    for part in parts:
        position = part.arrays["tendon_position"]
        moved = np.abs(np.diff(position, axis=0))
        resolution = min(resolution, float(moved[moved > 0].min(initial=np.inf)))
        width = int(np.searchsorted(part.time, part.time[0] + SETTLE_TIME))
        whole = len(position) // max(width, 1) * width
        if width and whole:
            spans.append(np.ptp(position[:whole].reshape(-1, width, position.shape[1]), axis=1).max(axis=1))
    if not spans or not np.isfinite(resolution):
        return None
    span = float(np.quantile(np.concatenate(spans), STANDING_SHARE))
    slowest = SLOWEST * number_of(data, "velocity_threshold.tendon") * SETTLE_TIME
    if span > max(slowest, resolution):
        return None
    return float(f"{TRAVEL_SPANS * max(span, resolution):.3g}")


# --- torques ----------------------------------------------------------------------------------------------------------


def find_rests(data: Data, parts: Sequence[FreePart], rule: Data) -> list[Rest]:
    """Find the rests of more than LEAST_REST in all parts, as the runtime defines them."""
    rests = []
    for part, outputs in _runs(data, parts, rule):
        change = outputs["contact_change"]
        standing = (change != 0.0).any(axis=1) & part.counted
        edges = np.flatnonzero(np.diff(np.concatenate([[0], standing.astype(int), [0]])))
        for begin, end in edges.reshape(-1, 2):
            time = part.time[begin:end] - part.time[begin]
            if time[-1] >= LEAST_REST:
                inside = change[begin:end]
                rests.append(Rest(time, np.abs(inside), np.abs(_innovation(time, inside)), _noise(time, inside)))
    return rests


def _innovation(time: Numbers, change: Numbers) -> Numbers:
    """Compute [K, n] y of a rest without contact: c less m, which follows it."""
    share = -np.expm1(-float(np.median(np.diff(time))) / INNOVATION_TIME)
    followed = lfilter([share], [1.0, share - 1.0], change, axis=0)
    return np.asarray(change - np.vstack([np.zeros((1, change.shape[1])), followed[:-1]]))


def _noise(time: Numbers, change: Numbers) -> Numbers:
    """Estimate [n] σ of c without creep: from second differences over 0.1 s, by their median."""
    lag = max(1, int(np.searchsorted(time, 0.1)))
    if len(time) <= 2 * lag:
        return np.zeros(change.shape[1])
    bend = change[2 * lag :] - 2.0 * change[lag:-lag] + change[: -2 * lag]
    # 0.6745 σ is the median of |x|; three independent averages with weights 1, −2, 1
    return np.asarray(np.median(np.abs(bend), axis=0) / (0.6745 * np.sqrt(6.0)))


def fit_bounds(rests: Sequence[Rest]) -> Bounds:
    """Fit the smallest bounds that no change of these rests exceeds, apart from noise."""
    noise = NOISE_LEVEL * np.sqrt(2.0) * np.median([rest.noise for rest in rests], axis=0)
    early = np.max([rest.change[rest.time <= SETTLE_TIME].max(axis=0) for rest in rests], axis=0)
    threshold = _above_zero(np.maximum(noise, early))
    creep = np.zeros_like(threshold)
    for rest in rests:
        late = rest.time > SETTLE_TIME
        slope = (rest.change[late] - threshold) / np.sqrt(rest.time[late])[:, None]
        creep = np.maximum(creep, slope.max(axis=0, initial=0.0))
    sudden = _above_zero(np.maximum(noise, np.max([rest.sudden.max(axis=0) for rest in rests], axis=0)))
    return Bounds(threshold, creep, sudden)


def _above_zero(values: Numbers) -> Numbers:
    """Return [n] values above 0, as the keys require, also at joints that feel nothing."""
    return np.asarray(np.maximum(values, 1e-9 + 1e-3 * values.max()))


def excess(rest: Rest, bounds: Bounds) -> float:
    """Compute the largest ratio of a change to its bound."""
    bound = bounds.threshold + bounds.creep * np.sqrt(rest.time)[:, None]
    return float(max((rest.change / bound).max(), (rest.sudden / bounds.sudden).max()))


def level(rests: Sequence[Rest], allowed: int) -> tuple[float, int]:
    """Return the factor, at least 1, on bounds fitted to all rests, and its alarms in rests held out in turn."""
    held = np.zeros(len(rests))
    for fold in range(FOLDS):
        bounds = fit_bounds([rest for k, rest in enumerate(rests) if k % FOLDS != fold])
        held[fold::FOLDS] = [excess(rest, bounds) for rest in rests[fold::FOLDS]]
    largest = np.sort(held)[::-1]
    factor = max(1.0, float(largest[allowed]) if allowed < len(held) else 0.0)
    if not allowed:
        factor *= BEYOND
    return factor, int((held > factor).sum())


def count_alarms(data: Data, parts: Sequence[FreePart], rule: Data) -> int:
    """Count the starts of `contact_at_rest` of the finger with this rule, in counted time."""
    count = 0
    for part, outputs in _runs(data, parts, rule):
        alarm = outputs["contact_at_rest"].ravel().astype(int)
        begins = np.diff(alarm, prepend=0) > 0
        count += int((begins & part.counted).sum())
    return count


def _runs(data: Data, parts: Sequence[FreePart], rule: Data) -> Iterator[tuple[FreePart, dict[str, Array]]]:
    return runs_of({**data, "contact": {**data["contact"], "rest": dict(rule)}}, parts)
