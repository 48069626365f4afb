"""What a counted score means: shares, rates, delays and errors with 95 % intervals, and the ROC over thresholds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.detect.counting import ContactSums, DetectionScore, Event, FreeBlocks
from tendonfmu.statistics import Interval, intervals

QUARTILES = {"lower_quartile": 0.25, "median": 0.5, "upper_quartile": 0.75, "ninety_percent": 0.9}
FACTORS = tuple(2.0 ** (k / 4) for k in range(-8, 13))  # on the thresholds: 0.25 to 8, with 1, those of the description


@dataclass(frozen=True)
class ContactError:
    """Errors of the compensated torque against the reference during events, by joint [n]; `rms` in N·m."""

    rms: list[Interval]
    correlation: list[Interval]
    slope: list[Interval]
    within: list[Interval] | None


@dataclass(frozen=True)
class Summary:
    """Figures of a recording, or of several pooled."""

    events: int  # number of labelled contacts, and of those found
    found: int
    masked: int  # number of events that had contact before their onset
    released: int  # number of found events whose alarm begins only as the load goes
    held: int  # number of found events whose alarm lasts to their end
    false_alarms: int  # number of false alarms, its interval, and their rate (1/min)
    alarms_after_events: int  # those of them that begin soon after an event
    free_minutes: float  # free time (min), and the share of it in alarm
    found_share: Interval  # shares of the events, and of the found events
    held_share: Interval
    false_alarm_count: Interval
    false_alarms_per_minute: Interval
    delay: dict[str, Interval]  # quantiles of the delay (s) by name of `QUARTILES`
    force_at_alarm: Interval | None  # median force at the alarm of the found events (N); None if unknown
    # [n] median magnitudes of the torques at the alarm (N·m); None if unknown
    compensated_at_alarm: list[Interval] | None
    external_at_alarm: list[Interval] | None
    # alarms that outlast their event: number of events, times in all and at most (s), and mean per event (s)
    overhang_events: int
    overhang_seconds: float
    longest_overhang: float
    overhang: Interval
    free_alarm_share: Interval
    free_rms: list[Interval]  # [n] rms of the residual in free time (N·m)
    contact: ContactError | None  # errors of the estimated torque; None without a reference sensor or without an event


def summarise(score: DetectionScore, seed: int = 0) -> Summary:
    """Compute the figures of a score with their intervals; `seed` is that of the resampling."""
    found = [event for event in score.events if event.found]
    alarms, minutes = len(score.false_alarms), score.free_seconds / 60.0
    overhang = np.array([event.overhang for event in score.events], dtype=float)
    held = sum(event.held for event in found)
    return Summary(
        events=len(score.events),
        found=len(found),
        masked=sum(not event.silent for event in score.events),
        released=sum(event.released for event in found),
        held=held,
        false_alarms=alarms,
        alarms_after_events=score.alarms_after_events,
        free_minutes=minutes,
        found_share=intervals.share(len(found), len(score.events)),
        held_share=intervals.share(held, len(found)),
        false_alarm_count=intervals.rate(alarms, 1.0),
        false_alarms_per_minute=intervals.rate(alarms, minutes),
        delay={name: intervals.quantile(score.delays, part, seed) for name, part in QUARTILES.items()},
        force_at_alarm=_force(found, seed),
        compensated_at_alarm=_torques([event.compensated for event in found], seed),
        external_at_alarm=_torques([event.external for event in found], seed),
        overhang_events=int((overhang > 0).sum()),
        overhang_seconds=float(overhang.sum()),
        longest_overhang=float(overhang.max(initial=0.0)),
        overhang=_mean(overhang, seed),
        free_alarm_share=_alarm_share(score.free, seed),
        free_rms=_free_rms(score.free, seed),
        contact=_contact_error(score.contact, seed),
    )


def _force(events: Sequence[Event], seed: int) -> Interval | None:
    known = np.array([event.force for event in events if not math.isnan(event.force)], dtype=float)
    return intervals.quantile(known, 0.5, seed) if len(known) else None


def _torques(values: Sequence[Numbers | None], seed: int) -> list[Interval] | None:
    """Compute the median magnitude of each joint."""
    known = [np.abs(value) for value in values if value is not None]
    return [intervals.quantile(column, 0.5, seed) for column in np.array(known).T] if known else None


def _mean(values: Numbers, seed: int) -> Interval:
    """Compute a mean. If all values are 0, resampling sees nothing else, so there is no interval."""
    if not values.any():
        return Interval(0.0 if len(values) else math.nan)
    return intervals.of_sums(np.column_stack([np.ones(len(values)), values]), _ratio, seed)[0]


def _alarm_share(free: FreeBlocks, seed: int) -> Interval:
    """Compute the share of the free time in alarm."""
    if not free.seconds.sum():
        return Interval(math.nan)
    if not free.alarm_seconds.any():
        return Interval(0.0, 0.0, intervals.share(0, len(free.seconds)).high)
    return intervals.of_sums(np.column_stack([free.seconds, free.alarm_seconds]), _ratio, seed)[0]


def _free_rms(free: FreeBlocks, seed: int) -> list[Interval]:
    if not free.samples.sum():
        return [Interval(math.nan)] * free.squares.shape[1]
    return intervals.of_sums(np.column_stack([free.samples, free.squares]), _root_mean, seed)


def _ratio(sums: Numbers) -> Numbers:
    return np.asarray(sums[:, 1:] / sums[:, :1])


def _root_mean(sums: Numbers) -> Numbers:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.sqrt(sums[:, 1:] / sums[:, :1]))


def _contact_error(sums: ContactSums | None, seed: int) -> ContactError | None:
    if sums is None or not len(sums.samples):
        return None
    moments = np.hstack([sums.samples[:, None], sums.x, sums.y, sums.xx, sums.yy, sums.xy])
    known = ~np.isnan(sums.within).any(axis=1)
    within = np.column_stack([sums.samples, sums.within])[known]
    return ContactError(
        rms=intervals.of_sums(np.column_stack([sums.samples, sums.errors]), _root_mean, seed),
        correlation=intervals.of_sums(moments, lambda drawn: _regression(drawn)[0], seed),
        slope=intervals.of_sums(moments, lambda drawn: _regression(drawn)[1], seed),
        within=intervals.of_sums(within, _ratio, seed) if len(within) else None,
    )


def _regression(sums: Numbers) -> tuple[Numbers, Numbers]:
    """Compute correlation and slope of y on x, [r, n] each; NaN where x (or y) does not vary."""
    count = sums[:, :1]
    with np.errstate(invalid="ignore", divide="ignore"):
        x, y, xx, yy, xy = (part / count for part in np.split(sums[:, 1:], 5, axis=1))
        spread_x, spread_y, both = _varied(xx - x * x, xx), _varied(yy - y * y, yy), xy - x * y
        return both / np.sqrt(spread_x * spread_y), both / spread_x


def _varied(variance: Numbers, power: Numbers) -> Numbers:
    """Replace a variance that is only rounding by NaN."""
    return np.where(variance > 1e-12 * power, variance, np.nan)


# --- ROC --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class RocPoint:
    """One point of the ROC."""

    factor: float  # factor on all thresholds
    events: int  # number of labelled contacts, of those found, and of those that had contact before
    found: int
    masked: int
    false_alarms: int  # number of false alarms, and their rate (1/h)
    found_share: Interval  # share of the events that is found
    false_alarms_per_hour: Interval
    free_alarm_share: float  # share of the free time in alarm
    median_delay: float  # median delay (s); NaN if none is found


def roc(score_at: Callable[[float], DetectionScore], factors: Sequence[float] = FACTORS) -> list[RocPoint]:
    """Compute the ROC over factors on the thresholds."""
    # The finger runs again for each factor, since contact freezes its bias.
    # Few false alarms are no success if the free time is in alarm: an alarm that never ends counts once.
    points = []
    for factor in factors:
        score = score_at(factor)
        points.append(
            RocPoint(
                factor=factor,
                events=len(score.events),
                found=score.found,
                masked=sum(not event.silent for event in score.events),
                false_alarms=len(score.false_alarms),
                found_share=intervals.share(score.found, len(score.events)),
                false_alarms_per_hour=intervals.rate(len(score.false_alarms), score.free_seconds / 3600.0),
                free_alarm_share=score.free_alarm_share,
                median_delay=float(np.median(score.delays)) if score.found else math.nan,
            )
        )
    return points
