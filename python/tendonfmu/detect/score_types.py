"""The report of a score as JSON has it, "tendonfmu-score-1"."""

from __future__ import annotations

from typing import Annotated, Literal, TypedDict

from tendonfmu.json_types import Count, Index, Kinematics, Number, Schema, Share, Size, Values

Pair = Annotated[list[float], Schema(minItems=2, maxItems=2)] | None


class Estimate(TypedDict):
    value: Number
    interval: Pair


Estimates = list[Estimate] | None


class Delays(TypedDict):
    lower_quartile: Estimate
    median: Estimate
    upper_quartile: Estimate
    ninety_percent: Estimate


class Overhang(TypedDict):
    """Free time in alarms that began in an event or its grace."""

    events: Count  # Number of events with overhang.
    seconds: Size  # s, total of all events.
    longest_s: Size
    per_event_s: Estimate  # s, mean over the events; events resampled.


class AtAlarm(TypedDict):
    """Medians over the found events; magnitudes."""

    force: Estimate | None  # N, sensed force.
    external_torque: Estimates  # N.m by joint, torque of the reference sensor.
    compensated_torque: Estimates  # N.m by joint.


class Figures(TypedDict):
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


class ScoredEvent(TypedDict):
    onset_s: float  # s; first labelled sample.
    end_s: float  # s; last labelled sample.
    found: bool
    silent_before: bool  # Whether there is no contact in the 0.2 s before the onset.
    alarm_s: Number  # s; first sample of the first alarm that begins in the event.
    delay_s: Number  # s; null unless found.
    at_release: bool  # Whether the alarm begins only as the load goes.
    largest_torque: Number  # N.m, largest torque of the reference sensor at any joint.
    joint: Index | None  # Joint that bears it.
    held: bool
    held_share: Number  # Share of the samples from the alarm to the end that are contact.
    overhang_s: Size
    force: Number  # N, sensed force at the alarm.
    external_torque: Values | None  # N.m by joint, at the alarm.
    compensated_torque: Values | None  # N.m by joint, at the alarm.


class FalseAlarm(TypedDict):
    begin_s: float
    end_s: float  # s; last sample of the alarm.


class ScoredRecording(Figures):
    path: str
    samples: Index
    duration_s: Size
    labelled: bool  # Whether the recording has the column of the label.
    external_torque: bool  # Whether the recording has a reference sensor.
    sensed_force: bool  # Whether the recording has the column of --force.
    mean_force: Size  # N; mean of all tendon forces over all samples.
    event_list: list[ScoredEvent]
    false_alarm_list: list[FalseAlarm]


class Point(TypedDict):
    factor: Annotated[float, Schema(exclusiveMinimum=0)]  # Factor on every bound that decides on contact.
    found: Count
    missed_in_alarm: Count
    found_share: Estimate
    false_alarms: Count
    false_alarms_per_hour: Estimate
    free_alarm_share: Share
    median_delay_s: Number


class Roc(TypedDict):
    points: Annotated[list[Point], Schema(minItems=1)] | None
    absent: str | None  # Why there are no points; null if there are.


class Definitions(TypedDict):
    merged_s: float  # s; labels, or alarms, closer than this are one.
    silent_s: float  # s before the onset in which a found event has no contact.
    grace_s: float  # s after an event in which no alarm is false and no time is free.


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
