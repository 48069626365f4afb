"""What the figures of a score show, computed for `score_plots.py`.

Torques and detection over time (fig. 8 of the paper), every event from its onset on, the ROC, and the delays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.detect import GRACE, DetectionScore, Event, RocPoint, Scored, Track
from tendonfmu.files import counted
from tendonfmu.recordings import flagged_stretches
from tendonfmu.report.figure_data import Interval
from tendonfmu.statistics import intervals as statistics_intervals

SHOWN = 20.0  # s of the recording, where most events are
JOINTS = 4  # drawn at most
BEFORE, AFTER, LONGEST = 0.3, 0.3, 2.5  # s; an event's row before the onset, after the end, and at most after onset
TAIL = 2.0  # times the delay of 90 %; later events are counted, not drawn
NAMED = (0.25, 0.5, 1.0, 2.0, 4.0)  # factors written beside their points
_COLUMNS, _POINTS = 560, 5000


@dataclass(frozen=True)
class JointTorques:
    """Torques of one joint."""

    name: str  # its name
    measured: Numbers  #
    compensated: Numbers
    external: Numbers | None


@dataclass(frozen=True)
class ContactFigure:
    """Torques and detection over time."""

    title: str  # heading
    time: Numbers
    joints: list[JointTorques]  # torques of the joints drawn
    force: Numbers | None
    labelled: list[Interval]
    found: list[Interval]  # alarm during an event that is found, or missed
    masked: list[Interval]
    outside: list[Interval]


@dataclass(frozen=True)
class EventFigure:
    """Every event as a row, found ones in order of delay, then missed ones, last those that began in an alarm."""

    title: str  # heading
    begin: float  # time drawn, from the onset
    end: float
    torque: Numbers
    most: float
    groups: list[tuple[str, int]]  # (what, how many rows)
    delay: Numbers  # the delay is NaN for missed events
    length: Numbers


@dataclass(frozen=True)
class RocFigure:
    """Found events against false alarms, over factors on the thresholds."""

    title: str  # heading
    factors: Numbers
    found: Numbers  # share of the events, with its 95 % interval
    found_low: Numbers
    found_high: Numbers
    rate: Numbers  # false alarms
    rate_low: Numbers
    rate_high: Numbers
    in_alarm: Numbers
    masked: Numbers
    own: int  # index of the description's own thresholds
    named: list[int]  # indices of points whose factor is written beside them
    least: float


@dataclass(frozen=True)
class DelayFigure:
    """How soon events are found."""

    title: str  # heading
    delays: Numbers
    share: Numbers  # share of all events found within that time, with its 95 % interval
    low: Numbers
    high: Numbers
    median: float  # delays within which 50 % and 90 % are found
    ninety: float
    end: float
    later: int  # how many delays are beyond `end`
    bins: int  # bins of the histogram


def contact_figure(scored: Scored) -> ContactFigure:
    """Show the `SHOWN` seconds with most events, or with most false alarms if there is no event."""
    counts = [_busiest(track, score) for track, score in zip(scored.tracks, scored.scores, strict=True)]
    most = max(range(len(counts)), key=lambda k: counts[k][:2])
    begin = counts[most][2]
    track, score = scored.tracks[most], scored.scores[most]
    time = track.recording.time
    shown = (time >= begin) & (time <= begin + SHOWN)
    rows, alarm = np.flatnonzero(shown), track.alarm
    found, masked = _by_event(track, score)
    rows = rows[:: max(1, len(rows) // _POINTS)]
    torque, left = track.outputs["joint_torque"], track.outputs["compensated_torque"]
    names = scored.subject.finger.joint_names
    joints = [
        JointTorques(
            names[j], torque[rows, j], left[rows, j], None if track.external is None else track.external[rows, j]
        )
        for j in _strongest(track)
    ]
    return ContactFigure(
        title=f"{scored.subject.finger.name}: {track.recording.path.name}",
        time=time[rows],
        joints=joints,
        force=None if track.force is None else np.abs(track.force[rows]),
        labelled=flagged_stretches(time, track.label & shown),
        found=flagged_stretches(time, alarm & found & shown),
        masked=flagged_stretches(time, alarm & masked & ~found & shown),
        outside=flagged_stretches(time, alarm & ~masked & ~found & shown),
    )


def _busiest(track: Track, score: DetectionScore) -> tuple[int, int, float]:
    """Find the earliest window of `SHOWN` seconds with most events: (events, those found, begin in s)."""
    time = track.recording.time
    onsets = np.array([event.onset for event in score.events])
    found = np.array([event.onset for event in score.events if event.found])
    alarms = np.array([begin for begin, _ in score.false_alarms])
    last = max(float(time[-1]) - SHOWN, float(time[0]))
    begins = np.clip([float(time[0]), *((onsets if len(onsets) else alarms) - 1.0)], time[0], last)

    def within(starts: Numbers, begin: float) -> int:
        return int(((starts >= begin) & (starts <= begin + SHOWN)).sum())

    return max(
        ((within(onsets, begin), within(found if len(onsets) else alarms, begin), float(begin)) for begin in begins),
        key=lambda window: (window[0], window[1], -window[2]),
    )


def _by_event(track: Track, score: DetectionScore) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Flag the samples [N] of found events, from the alarm to the end and its grace, and those of all other events."""
    time = track.recording.time
    found, others = np.zeros(len(time), dtype=bool), np.zeros(len(time), dtype=bool)
    for event in score.events:
        rows = (time >= event.onset) & (time <= event.end + GRACE)
        (found if event.found else others)[rows] = True
    return found, others


def _strongest(track: Track) -> list[int]:
    """Choose the joints with most torque in contact (or ever), in their order."""
    torque = track.outputs["compensated_torque"] if track.external is None else track.external
    rows = track.label if track.label.any() else np.ones(len(torque), dtype=bool)
    power = np.sum(torque[rows] ** 2, axis=0)
    return sorted(int(j) for j in np.argsort(-power, kind="stable")[:JOINTS])


# --- events -----------------------------------------------------------------------------------------------------------


def event_figure(scored: Scored) -> EventFigure:
    """Show every event of every recording."""
    rows: list[tuple[Event, Track]] = [
        (event, track) for track, score in zip(scored.tracks, scored.scores, strict=True) for event in score.events
    ]
    rows.sort(key=lambda row: _order(row[0]))
    length = np.array([event.end - event.onset for event, _ in rows])
    end = min(float(length.max()) + AFTER, LONGEST)
    grid = np.linspace(-BEFORE, end, _COLUMNS)
    torque = np.array([_row(track, event.onset + grid) for event, track in rows])
    found = scored.summary
    groups = {
        "found": found.found,
        "missed": found.events - found.found - found.masked,
        "missed, in\nan alarm before": found.masked,
    }
    return EventFigure(
        title=f"{scored.subject.finger.name}: {counted(len(rows), 'event')}",
        begin=-BEFORE,
        end=end,
        torque=torque,
        most=float(np.nanquantile(torque, 0.99)),
        groups=[(name, count) for name, count in groups.items() if count],
        delay=np.array([event.delay for event, _ in rows]),
        length=length,
    )


def _order(event: Event) -> tuple[int, float]:
    """Return a sort key: the group, and the place in it."""
    return (0, event.delay) if event.found else (1 if event.silent else 2, event.end - event.onset)


def _row(track: Track, at: Numbers) -> Numbers:
    """Return the torque [t] N·m at the last sample before each time."""
    time = track.recording.time
    size = np.sqrt(np.sum(track.outputs["compensated_torque"] ** 2, axis=1))
    index = np.searchsorted(time, at + 1e-9, side="right") - 1
    inside = (index >= 0) & (at <= time[-1])
    return np.where(inside, size[np.maximum(index, 0)], math.nan)


# --- ROC and delays ---------------------------------------------------------------------------------------------------


def roc_figure(scored: Scored, points: Sequence[RocPoint]) -> RocFigure:
    shares, rates = [point.found_share for point in points], [point.false_alarms_per_hour for point in points]
    events, minutes = counted(scored.summary.events, "event"), scored.summary.free_minutes
    return RocFigure(
        title=f"{scored.subject.finger.name}: {events}, {minutes:.3g} min of free time",
        factors=np.array([point.factor for point in points]),
        found=np.array([each.value for each in shares]),
        found_low=np.array([each.low for each in shares]),
        found_high=np.array([each.high for each in shares]),
        rate=np.array([each.value for each in rates]),
        rate_low=np.array([each.low for each in rates]),
        rate_high=np.array([each.high for each in rates]),
        in_alarm=np.array([point.free_alarm_share for point in points]),
        masked=np.array([point.masked / point.events for point in points]),
        own=int(np.argmin([abs(math.log(point.factor)) for point in points])),
        named=_named(points),
        least=60.0 / minutes,
    )


def _named(points: Sequence[RocPoint]) -> list[int]:
    """Choose the points of `NAMED` factors, one of those in the same place."""
    places: dict[tuple[int, int], int] = {}
    for k, point in enumerate(points):
        if any(math.isclose(point.factor, each) for each in NAMED):
            places[(point.found, point.false_alarms)] = k
    return list(places.values())


def delay_figure(scored: Scored) -> DelayFigure:
    delays = np.sort([event.delay for score in scored.scores for event in score.events if event.found])
    total, known = scored.summary.events, scored.summary.delay
    end = float(delays[-1])
    if end > TAIL * known["ninety_percent"].value > 0:
        end = TAIL * known["ninety_percent"].value
    within = [statistics_intervals.share(k, total) for k in range(1, len(delays) + 1)]
    return DelayFigure(
        title=f"{scored.subject.finger.name}: {len(delays)} of {counted(total, 'event')} found",
        delays=delays,
        share=np.array([each.value for each in within]),
        low=np.array([each.low for each in within]),
        high=np.array([each.high for each in within]),
        median=known["median"].value,
        ninety=known["ninety_percent"].value,
        end=end,
        later=int((delays > end).sum()),
        bins=int(np.clip(len(delays) // 2, 12, 40)),
    )
