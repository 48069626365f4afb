"""How detected contact compares with labelled contact: found, missed and false alarms, and delays.

All of the product counts this way: the commands `score` and `tune`, the demo and the campaigns of bench/. This module
counts only; `summary.py` computes shares, rates and intervals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.json_types import Index, Number, Size, Values
from tendonfmu.recordings import gaps

Spans = NDArray[np.int64]

MERGED = 0.1  # s; labelled stretches, or alarms, closer than this are one
LEAD = 0.02  # s before the onset in which an alarm is the event's: who labels, labels from some force on
SILENT = 0.2  # s before that in which a found event must have no sample of contact
GRACE = 0.1  # s after an event in which an alarm is not false and time is not free
AFTER = 2.0  # s after an event in which the hand may still feel what the touch did to its friction
BLOCK = 2.0  # s of free time; longer than the correlation of residuals and alarms in free motion
RELEASED = 0.5  # of an event's largest reference torque: once it has fallen below for good, the load goes
LATE = 0.8  # of an event's length, after which its load goes if there is no reference
_EQUAL = 1e-9  # s; the times of a CSV are rounded to decimals


@dataclass(frozen=True)
class Signals:
    """Further signals of each sample; None if unknown."""

    residual: Numbers | None = None
    compensated: Numbers | None = None
    external: Numbers | None = None
    force: Numbers | None = None
    deviation: Numbers | None = None


@dataclass(frozen=True)
class Event:
    """A labelled contact."""

    onset_s: float  # s; first labelled sample.
    end_s: float  # s; last labelled sample.
    found: bool  # Whether the alarm begins in the event after silence.
    silent_before: bool  # Whether there is no contact in the 0.2 s before the onset.
    alarm_s: Number = None  # s; first sample of the first alarm that begins in the event.
    delay_s: Number = None  # s; null unless found.
    at_release: bool = False  # Whether the alarm begins only as the load goes.
    largest_torque: Number = None  # N.m, largest torque of the reference sensor at any joint.
    joint: Index | None = None  # Joint that bears it.
    held: bool = False  # Whether the alarm lasts until less than 0.1 s before the end.
    held_share: Number = None  # Share of the samples from the alarm to the end that are contact.
    overhang_s: Size = 0.0  # s; free time in alarms that began in the event or its grace.
    force: Number = None  # N, sensed force at the alarm.
    external_torque: Values | None = None  # N.m by joint, at the alarm.
    compensated_torque: Values | None = None  # N.m by joint, at the alarm.


@dataclass(frozen=True)
class FreeBlocks:
    """Sums over [b] blocks of about `BLOCK` seconds of free time."""

    seconds: Numbers
    alarm_seconds: Numbers
    samples: Numbers
    squares: Numbers


@dataclass(frozen=True)
class ContactSums:
    """Sums over the samples of [e] events with a reference sensor; x: reference, y: compensated torque (N·m)."""

    samples: Numbers
    errors: Numbers
    x: Numbers
    y: Numbers
    xx: Numbers
    yy: Numbers
    xy: Numbers
    within: Numbers


@dataclass(frozen=True)
class DetectionScore:
    """Score of one recording, or of several pooled."""

    events: list[Event]  # labelled contacts
    false_alarms: list[tuple[float, float]]  # (begin, end) of each, its first and last sample (s)
    free: FreeBlocks  # sums over the free time
    contact: ContactSums | None  # sums over the events; None without a reference sensor
    alarms_after_events: int = 0  # false alarms that begin less than `AFTER` after the end of an event

    @property
    def found(self) -> int:
        """Number of found events."""
        return sum(event.found for event in self.events)

    @property
    def missed(self) -> int:
        """Number of missed events."""
        return len(self.events) - self.found

    @property
    def free_seconds(self) -> float:
        """Free time (s)."""
        return float(self.free.seconds.sum())

    @property
    def free_alarm_share(self) -> float:
        """Share of the free time in alarm, by false alarms and overhang; 0 without free time."""
        return float(self.free.alarm_seconds.sum()) / self.free_seconds if self.free_seconds else 0.0

    @property
    def delays(self) -> Numbers:
        """[found] delays (s)."""
        return np.array([event.delay_s for event in self.events if event.delay_s is not None], dtype=float)


def score_detection(time: Numbers, label: Flags, alarm: Flags, signals: Signals | None = None) -> DetectionScore:
    """Score one recording. time: [N] (s); label, alarm: [N]."""
    time = np.asarray(time, dtype=float)
    label, alarm = (np.asarray(flags).ravel().astype(bool) for flags in (label, alarm))
    given = signals or Signals()
    spans, alarms = stretches(time, label), stretches(time, alarm)
    free = _free(time, spans)
    seconds = sample_seconds(time)
    hanging = np.concatenate([[0.0], np.cumsum(seconds * (free & alarm))])
    starts = alarms[:, 0]
    events = [_event(time, alarm, alarms, span, hanging, given) for span in spans]
    early = np.array([_ahead(time, first, LEAD) <= at < first for at in starts for first, _ in spans], dtype=bool)
    false = alarms[free[starts] & ~early.reshape(len(starts), len(spans)).any(axis=1)]
    return DetectionScore(
        events=events,
        false_alarms=[(float(time[begin]), float(time[end])) for begin, end in false],
        free=_free_blocks(seconds, free, alarm, given.residual),
        contact=_contact_sums(spans, given),
        alarms_after_events=sum(any(0.0 < time[at] - event.end_s < AFTER for event in events) for at in false[:, 0]),
    )


def stretches(time: Numbers, flags: Flags) -> Spans:
    """Return [k, 2] first and last sample of each stretch of set flags; stretches closer than `MERGED` are one."""
    edges = np.diff(np.concatenate([[0], np.asarray(flags).astype(np.int8), [0]]))
    first, last = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0) - 1
    apart = time[first[1:]] - time[last[:-1]] >= MERGED - _EQUAL
    one = np.ones(min(len(first), 1), dtype=bool)
    return np.column_stack([first[np.concatenate([one, apart])], last[np.concatenate([apart, one])]])


def sample_seconds(time: Numbers) -> Numbers:
    """Compute [N] the time of each sample until the next one (s); the median step at a gap and at the end."""
    if len(time) < 2:
        return np.zeros(len(time))
    step = np.diff(time)
    usual = float(np.median(step))
    seconds = np.append(step, usual)
    seconds[[k - 1 for k in gaps(time)]] = usual
    return seconds


def _free(time: Numbers, spans: Spans) -> Flags:
    """Return [N] the samples outside every [onset, end + GRACE]."""
    free = np.ones(len(time), dtype=bool)
    for first, last in spans:
        free[first : np.searchsorted(time, time[last] + GRACE + _EQUAL)] = False
    return free


def _ahead(time: Numbers, first: int, seconds: float) -> int:
    """Return the first sample at most so many seconds before sample `first`."""
    return int(np.searchsorted(time, time[first] - seconds - _EQUAL))


def _event(time: Numbers, alarm: Flags, alarms: Spans, span: Spans, hanging: Numbers, given: Signals) -> Event:
    """Build an event. `hanging` is [N + 1] the free time in alarm before each sample (s)."""
    first, last = int(span[0]), int(span[1])
    before, lead = (_ahead(time, first, seconds) for seconds in (LEAD + SILENT, LEAD))
    grace = int(np.searchsorted(time, time[last] + GRACE + _EQUAL))
    begun = alarms[(alarms[:, 0] >= lead) & (alarms[:, 0] < grace)]
    silent, inside = not alarm[before:lead].any(), begun[begun[:, 0] <= last]
    event = Event(
        onset_s=float(time[first]),
        end_s=float(time[last]),
        found=silent and len(inside) > 0,
        silent_before=silent,
        overhang_s=float(sum(hanging[end + 1] - hanging[max(begin, first)] for begin, end in begun)),
        **_load(first, last, given.external),
    )
    if not len(inside):
        return event
    begin, end = int(inside[0, 0]), int(inside[0, 1])
    return replace(
        event,
        alarm_s=float(time[begin]),
        delay_s=float(time[begin] - time[first]) if silent else None,
        at_release=silent and bool(time[begin] > _lasts(time, first, last, given.external)),
        held=bool(time[last] - time[end] < MERGED - _EQUAL),
        held_share=float(alarm[begin : last + 1].mean()),
        force=None if given.force is None else float(given.force[begin]),
        external_torque=None if given.external is None else given.external[begin].tolist(),
        compensated_torque=None if given.compensated is None else given.compensated[begin].tolist(),
    )


def _load(first: int, last: int, external: Numbers | None) -> dict[str, Any]:
    """Return the largest torque of the reference sensor in an event, and the joint that bears it."""
    if external is None:
        return {}
    size = np.abs(external[first : last + 1]).max(axis=0)
    return {"largest_torque": float(size.max()), "joint": int(size.argmax()) + 1}


def _lasts(time: Numbers, first: int, last: int, external: Numbers | None) -> float:
    """Return the time up to which an event's load lasts: at `RELEASED` of its largest, or of its length (s)."""
    if external is None:
        return float(time[last] - (1.0 - LATE) * (time[last] - time[first]))
    size = np.abs(external[first : last + 1]).max(axis=1)
    return float(time[first + np.flatnonzero(size >= RELEASED * size.max())[-1]])


def _free_blocks(seconds: Numbers, free: Flags, alarm: Flags, residual: Numbers | None) -> FreeBlocks:
    left = np.zeros((len(free), 0)) if residual is None else residual
    known = free & ~np.isnan(left).any(axis=1) if left.shape[1] else np.zeros_like(free)
    passed = np.cumsum(seconds * free)
    count = max(1, round(float(passed[-1]) / BLOCK)) if len(passed) else 1
    length = float(passed[-1]) / count if len(passed) and passed[-1] > 0 else 1.0
    block = np.minimum((np.maximum(passed - 0.5 * seconds, 0.0) / length).astype(int), count - 1)

    def summed(values: Numbers) -> Numbers:
        return np.asarray(np.bincount(block[free], weights=values[free], minlength=count), dtype=float)

    squares = np.where(known[:, None], left, 0.0) ** 2
    return FreeBlocks(
        seconds=summed(seconds),
        alarm_seconds=summed(seconds * alarm),
        samples=summed(known.astype(float)),
        squares=np.column_stack([summed(squares[:, j]) for j in range(left.shape[1])] or [np.zeros((count, 0))]),
    )


def _contact_sums(spans: Spans, given: Signals) -> ContactSums | None:
    x, y = given.external, given.compensated
    if x is None or y is None:
        return None
    within = (
        np.full_like(x, math.nan) if given.deviation is None else (np.abs(y - x) <= 2 * given.deviation).astype(float)
    )
    columns = ((y - x) ** 2, x, y, x * x, y * y, x * y, within)
    sums = [
        np.array([values[first : last + 1].sum(axis=0) for first, last in spans]).reshape(len(spans), x.shape[1])
        for values in columns
    ]
    return ContactSums(np.array([last + 1.0 - first for first, last in spans], dtype=float), *sums)


def pooled(scores: Sequence[DetectionScore]) -> DetectionScore:
    """Pool the scores of several recordings."""
    contacts = [score.contact for score in scores if score.contact is not None]
    return DetectionScore(
        events=[event for score in scores for event in score.events],
        false_alarms=[alarm for score in scores for alarm in score.false_alarms],
        free=FreeBlocks(*_joined([score.free for score in scores])),
        contact=ContactSums(*_joined(contacts)) if contacts else None,
        alarms_after_events=sum(score.alarms_after_events for score in scores),
    )


def _joined(parts: Sequence[FreeBlocks] | Sequence[ContactSums]) -> list[Numbers]:
    """Concatenate every array of the parts."""
    return [np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])]
