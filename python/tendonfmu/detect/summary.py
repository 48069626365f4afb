"""What a counted score means: shares, rates, delays and errors with 95 % intervals, and the ROC over thresholds.

The classes are those of the report, "tendonfmu-score-1", as JSON has it (docs/reference/commands/score.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.detect.counting import ContactSums, DetectionScore, Event, FreeBlocks
from tendonfmu.json_types import Count, Index, Kinematics, Number, Schema, Share, Size, Values
from tendonfmu.statistics import Interval, intervals

QUARTILES = {"lower_quartile": 0.25, "median": 0.5, "upper_quartile": 0.75, "ninety_percent": 0.9}
FACTORS = tuple(2.0 ** (k / 4) for k in range(-8, 13))  # on the thresholds: 0.25 to 8, with 1, those of the description

Pair = Annotated[list[float], Schema(minItems=2, maxItems=2)] | None


@dataclass(frozen=True)
class Estimate:
    value: Number
    interval: Pair = None

    @classmethod
    def of(cls, found: Interval) -> Estimate:
        known = not (math.isnan(found.low) or math.isnan(found.high))
        return cls(found.value, [found.low, found.high] if known else None)

    @property
    def number(self) -> float:
        """The value; NaN where it is unknown."""
        return math.nan if self.value is None else self.value

    @property
    def ends(self) -> tuple[float, float]:
        """Ends of the interval; NaN where there is none."""
        return (math.nan, math.nan) if self.interval is None else (self.interval[0], self.interval[1])


Estimates = list[Estimate] | None


@dataclass(frozen=True)
class Delays:
    lower_quartile: Estimate
    median: Estimate
    upper_quartile: Estimate
    ninety_percent: Estimate


@dataclass(frozen=True)
class Overhang:
    """Free time in alarms that began in an event or its grace."""

    events: Count  # Number of events with overhang.
    seconds: Size  # s, total of all events.
    longest_s: Size
    per_event_s: Estimate  # s, mean over the events; events resampled.


@dataclass(frozen=True)
class AtAlarm:
    """Medians over the found events; magnitudes."""

    force: Estimate | None  # N, sensed force.
    external_torque: Estimates  # N.m by joint, torque of the reference sensor.
    compensated_torque: Estimates  # N.m by joint.


@dataclass(frozen=True)
class Figures:
    events: Count  # Labelled contacts.
    found: Count  # Events in which an alarm begins, without contact before the onset.
    missed: Count
    missed_in_alarm: Count  # Events missed because of contact in the 0.2 s before the onset.
    # Found events whose alarm begins only as the load goes: after the reference torque has fallen below half of its
    # largest for good, or in the last fifth of the event.
    found_at_release: Count
    found_share: Estimate  # Share of the events that are found; exact binomial interval.
    false_alarms: Count  # Alarms that begin outside of events and their grace.
    # False alarms that begin less than 2 s after the end of an event; they are among false_alarms.
    false_alarms_after_events: Count
    false_alarms_interval: Pair  # Interval of the expected number of false alarms; exact Poisson.
    false_alarms_per_minute: Estimate  # False alarms per minute of free time; exact Poisson interval.
    free_minutes: Size  # min; time outside of events and their grace.
    # Share of the free time in alarm, by false alarms and overhang. Interval: blocks of 2 s resampled.
    free_alarm_share: Estimate
    median_delay_s: Number  # s; median over the found events of the first sample of the alarm minus the onset.
    delay_s: Delays
    held: Count  # Found events whose alarm lasts until less than 0.1 s before their end.
    held_share: Estimate  # Share of the found events that are held; exact binomial interval.
    overhang: Overhang
    at_alarm: AtAlarm
    free_rms: Values  # N.m by joint; rms of the residual before the bias update in free time.
    free_rms_interval: list[Pair]  # Intervals of free_rms; blocks of 2 s resampled.
    # N.m by joint; rms of compensated minus external torque during events. null without external_torque or without an
    # event.
    contact_torque_rms_error: Values | None
    contact_torque_rms_error_interval: list[Pair] | None  # Intervals of contact_torque_rms_error; events resampled.
    contact_torque_correlation: Estimates  # By joint, correlation of compensated and external torque during events.
    # By joint, slope of the regression of the compensated on the external torque, with an offset.
    contact_torque_slope: Estimates
    # By joint, share of the samples of events whose error is at most twice the output compensated_torque_std. null
    # without this output.
    contact_torque_within_two_std: Estimates


@dataclass(frozen=True)
class FalseAlarm:
    begin_s: float
    end_s: float  # s; last sample of the alarm.


@dataclass(frozen=True)
class ScoredRecording(Figures):
    path: str
    samples: Index
    duration_s: Size
    labelled: bool  # Whether the recording has the column of the label.
    external_torque: bool  # Whether the recording has a reference sensor.
    sensed_force: bool  # Whether the recording has the column of --force.
    mean_force: Size  # N; mean of all tendon forces over all samples.
    event_list: list[Event]
    false_alarm_list: list[FalseAlarm]


@dataclass(frozen=True)
class Point:
    factor: Annotated[float, Schema(exclusiveMinimum=0)]  # Factor on every bound that decides on contact.
    found: Count
    missed_in_alarm: Count
    found_share: Estimate
    false_alarms: Count
    false_alarms_per_hour: Estimate
    free_alarm_share: Share
    median_delay_s: Number


@dataclass(frozen=True)
class Roc:
    points: Annotated[list[Point], Schema(minItems=1)] | None
    absent: str | None  # Why there are no points; null if there are.


@dataclass(frozen=True)
class Definitions:
    merged_s: float  # s; labels, or alarms, closer than this are one.
    silent_s: float  # s before the onset in which a found event has no contact.
    grace_s: float  # s after an event in which no alarm is false and no time is free.


@dataclass(frozen=True)
class ScoreReport(Figures):
    """Report of `tendonfmu score`. SI units; null stands for an unknown value.

    Every interval is a 95 % confidence interval.
    """

    format: Literal["tendonfmu-score-1"]
    finger: str  # Name of the finger.
    model: str  # The file that was scored.
    # Names of the joints, base first; all lists by joint have this order.
    joints: Annotated[list[str], Schema(minItems=1)]
    kinematics: Kinematics
    labels: str  # Column of the label.
    definitions: Definitions
    confidence: Annotated[float, Schema(const=0.95)]
    seed: Count  # Seed of the resampling.
    warnings: list[str]
    roc: Roc
    recordings: Annotated[list[ScoredRecording], Schema(minItems=1)]


def summarise(score: DetectionScore, seed: int = 0) -> Figures:
    """Compute the figures of a score with their intervals; `seed` is that of the resampling."""
    found = [event for event in score.events if event.found]
    alarms, minutes, contact = len(score.false_alarms), score.free_seconds / 60.0, score.contact
    held, rms = sum(event.held for event in found), _free_rms(score.free, seed)
    delays = {name: Estimate.of(intervals.quantile(score.delays, part, seed)) for name, part in QUARTILES.items()}
    contact = None if contact is None or not len(contact.samples) else contact
    errors = None if contact is None else _of_sums([contact.samples, contact.errors], _root_mean, seed)
    return Figures(
        events=len(score.events),
        found=len(found),
        missed=len(score.events) - len(found),
        missed_in_alarm=sum(not event.silent_before for event in score.events),
        found_at_release=sum(event.at_release for event in found),
        found_share=Estimate.of(intervals.share(len(found), len(score.events))),
        false_alarms=alarms,
        false_alarms_after_events=score.alarms_after_events,
        false_alarms_interval=Estimate.of(intervals.rate(alarms, 1.0)).interval,
        false_alarms_per_minute=Estimate.of(intervals.rate(alarms, minutes)),
        free_minutes=minutes,
        free_alarm_share=Estimate.of(_alarm_share(score.free, seed)),
        median_delay_s=delays["median"].value,
        delay_s=Delays(**delays),
        held=held,
        held_share=Estimate.of(intervals.share(held, len(found))),
        overhang=_overhang(np.array([event.overhang_s for event in score.events], dtype=float), seed),
        at_alarm=AtAlarm(
            force=_force(found, seed),
            external_torque=_torques([event.external_torque for event in found], seed),
            compensated_torque=_torques([event.compensated_torque for event in found], seed),
        ),
        free_rms=[each.value for each in rms],
        free_rms_interval=[each.interval for each in rms],
        contact_torque_rms_error=None if errors is None else [each.value for each in errors],
        contact_torque_rms_error_interval=None if errors is None else [each.interval for each in errors],
        contact_torque_correlation=None if contact is None else _by_regression(contact, 0, seed),
        contact_torque_slope=None if contact is None else _by_regression(contact, 1, seed),
        contact_torque_within_two_std=None if contact is None else _within(contact, seed),
    )


def _of_sums(sums: Sequence[Numbers], statistic: Callable[[Numbers], Numbers], seed: int) -> list[Estimate]:
    return [Estimate.of(each) for each in intervals.of_sums(np.column_stack(sums), statistic, seed)]


def _overhang(seconds: Numbers, seed: int) -> Overhang:
    return Overhang(
        events=int((seconds > 0).sum()),
        seconds=float(seconds.sum()),
        longest_s=float(seconds.max(initial=0.0)),
        per_event_s=_mean(seconds, seed),
    )


def _force(events: Sequence[Event], seed: int) -> Estimate | None:
    known = np.array([event.force for event in events if event.force is not None])
    return Estimate.of(intervals.quantile(known, 0.5, seed)) if len(known) else None


def _torques(values: Sequence[Values | None], seed: int) -> Estimates:
    """Compute the median magnitude of each joint."""
    known = [np.abs(np.array(value, dtype=float)) for value in values if value is not None]
    return [Estimate.of(intervals.quantile(each, 0.5, seed)) for each in np.array(known).T] if known else None


def _mean(values: Numbers, seed: int) -> Estimate:
    """Compute a mean. If all values are 0, resampling sees nothing else, so there is no interval."""
    if not values.any():
        return Estimate(0.0 if len(values) else math.nan)
    return _of_sums([np.ones(len(values)), values], _ratio, seed)[0]


def _alarm_share(free: FreeBlocks, seed: int) -> Interval:
    """Compute the share of the free time in alarm."""
    if not free.seconds.sum():
        return Interval(math.nan)
    if not free.alarm_seconds.any():
        return Interval(0.0, 0.0, intervals.share(0, len(free.seconds)).high)
    return intervals.of_sums(np.column_stack([free.seconds, free.alarm_seconds]), _ratio, seed)[0]


def _free_rms(free: FreeBlocks, seed: int) -> list[Estimate]:
    if not free.samples.sum():
        return [Estimate(math.nan)] * free.squares.shape[1]
    return _of_sums([free.samples, free.squares], _root_mean, seed)


def _ratio(sums: Numbers) -> Numbers:
    return np.asarray(sums[:, 1:] / sums[:, :1])


def _root_mean(sums: Numbers) -> Numbers:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.sqrt(sums[:, 1:] / sums[:, :1]))


def _by_regression(sums: ContactSums, which: int, seed: int) -> list[Estimate]:
    """Compute the correlation (0) or the slope (1) of the compensated torque and that of the reference, by joint."""
    moments = [sums.samples, sums.x, sums.y, sums.xx, sums.yy, sums.xy]
    return _of_sums(moments, lambda drawn: _regression(drawn)[which], seed)


def _within(sums: ContactSums, seed: int) -> Estimates:
    known = ~np.isnan(sums.within).any(axis=1)
    return _of_sums([sums.samples[known], sums.within[known]], _ratio, seed) if known.any() else None


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


def roc(score_at: Callable[[float], DetectionScore], factors: Sequence[float] = FACTORS) -> list[Point]:
    """Compute the ROC over factors on the thresholds."""
    # The finger runs again for each factor, since contact freezes its bias.
    # Few false alarms are no success if the free time is in alarm: an alarm that never ends counts once.
    points = []
    for factor in factors:
        score = score_at(factor)
        alarms = len(score.false_alarms)
        points.append(
            Point(
                factor=factor,
                found=score.found,
                missed_in_alarm=sum(not event.silent_before for event in score.events),
                found_share=Estimate.of(intervals.share(score.found, len(score.events))),
                false_alarms=alarms,
                false_alarms_per_hour=Estimate.of(intervals.rate(alarms, score.free_seconds / 3600.0)),
                free_alarm_share=score.free_alarm_share,
                median_delay_s=float(np.median(score.delays)) if score.found else math.nan,
            )
        )
    return points
