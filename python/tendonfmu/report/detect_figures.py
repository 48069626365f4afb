"""What the figures of a score and of a tuning show, ready to be drawn.

Torques and detection over time (fig. 8 of the paper), every event from its onset on, the ROC, and the delays; false
alarms over the level of the bounds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonfmu import drawing as draw
from tendonfmu.arrays import Numbers
from tendonfmu.detect import GRACE, ContactTuning, DetectionScore, Event, RocPoint, Scored, Track, tune_report
from tendonfmu.files import counted
from tendonfmu.recordings import flagged_stretches
from tendonfmu.report.numbers import with_ends
from tendonfmu.report.page import write_figures
from tendonfmu.statistics import intervals as statistics_intervals

PAGE, TUNING_PAGE = "score.html", "tuning.html"
SHOWN = 20.0  # s of the recording, where most events are
JOINTS = 4  # drawn at most
BEFORE, AFTER, LONGEST = 0.3, 0.3, 2.5  # s; an event's row before the onset, after the end, and at most after onset
TAIL = 2.0  # times the delay of 90 %; later events are counted, not drawn
NAMED = (0.25, 0.5, 1.0, 2.0, 4.0)  # factors written beside their points
_COLUMNS, _POINTS = 560, 5000
_INTERVAL = "#B4BBC4"
_HEAT = ("#FFFFFF", "#BBD9EE", draw.SKY, draw.BLUE, "#08306B")


def write_score_figures(scored: Scored, folder: Path) -> dict[Path, str]:
    """Write the page with the figures of a score."""
    page = folder / PAGE
    write_figures(page, "contact detection", scored.finger.name, score_sheets(scored))
    return {page: "torques and detection over time, every event, thresholds and delays"}


def score_sheets(scored: Scored) -> Iterator[draw.Sheet]:
    """Make all figures that the recordings allow."""
    yield contact_sheet(scored)
    if scored.summary.events:
        yield event_sheet(scored)
    if scored.roc and scored.summary.events and scored.summary.free_minutes:
        yield roc_sheet(scored, scored.roc)
    if scored.summary.found:
        yield delay_sheet(scored)


# --- over time --------------------------------------------------------------------------------------------------------


def contact_sheet(scored: Scored) -> draw.Sheet:
    """Show the `SHOWN` seconds with most events, or with most false alarms if there is no event."""
    counts = [_busiest(track, score) for track, score in zip(scored.tracks, scored.scores, strict=True)]
    most = max(range(len(counts)), key=lambda k: counts[k][:2])
    track, begin = scored.tracks[most], counts[most][2]
    time = track.recording.time
    shown = (time >= begin) & (time <= begin + SHOWN)
    rows = np.flatnonzero(shown)
    rows = rows[:: max(1, len(rows) // _POINTS)]
    names, joints = scored.finger.joint_names, _strongest(track)
    labelled = flagged_stretches(time, track.label & shown)
    limits = float(time[rows[0]]), float(time[rows[-1]])

    def over_time(title: str, unit: str, *curves: draw.Trace) -> draw.Panel:
        alt, label = f"{title} over time", draw.stripes(labelled, "", draw.SAND, 0.3)
        return draw.panel(title, alt, "time (s)", unit, *curves, label, size="wide", x_limits=limits, zoom="time")

    def by_joint(torque: Numbers) -> list[draw.Trace]:
        return [
            draw.curve(time[rows], 1e3 * torque[rows, j], names[j], draw.COLOURS[k], 1.1) for k, j in enumerate(joints)
        ]

    sensor: list[draw.Trace] = []
    if track.external is not None:
        sensor = [
            draw.curve(time[rows], 1e3 * track.external[rows, j], "reference sensor", draw.COLOURS[k], 1.6, "dash", 0.7)
            | {"key": ("dashed", draw.DARK, 1.0)}
            for k, j in enumerate(joints)
        ]
    compensated = by_joint(track.outputs["compensated_torque"])
    panels = [
        over_time("Joint torque", "torque (mN·m)", *by_joint(track.outputs["joint_torque"])),
        over_time("Compensated: estimate of the external torque", "torque (mN·m)", *sensor, *compensated),
    ]
    if track.force is not None:
        force = draw.curve(time[rows], np.abs(track.force[rows]), "", draw.DARK, 1.0)
        panels.append(over_time("Sensed force", "force (N)", force))
    panels.append(
        draw.panel(
            "Detection",
            "When contact is labelled, and when it is detected",
            "time (s)",
            "",
            *_detection(track, scored.scores[most], shown, labelled),
            size="wide",
            height=150,
            rows=("label", "alarm"),
            x_limits=limits,
            zoom="time",
        )
    )
    return draw.Sheet("score", "contacts", f"{scored.finger.name}: {track.recording.path.name}", panels)


def _detection(
    track: Track, score: DetectionScore, shown: NDArray[np.bool_], labelled: list[tuple[float, float]]
) -> Iterator[draw.Trace]:
    """Draw labels and alarms, those that have a stretch."""
    time, alarm = track.recording.time, track.alarm & shown
    found, others = _by_event(track, score)
    for row, meaning, colour, spans in (
        (0, "contact, as labelled", draw.SAND, labelled),
        (1, "alarm, event found", draw.BLUE, flagged_stretches(time, alarm & found)),
        (1, "alarm, event missed", draw.GREY, flagged_stretches(time, alarm & others & ~found)),
        (1, "alarm without contact", draw.VERMILION, flagged_stretches(time, alarm & ~others & ~found)),
    ):
        if spans:
            yield draw.lane(spans, row, meaning, colour)


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


def event_sheet(scored: Scored) -> draw.Sheet:
    """Show every event as a row: found ones in order of delay, then missed ones, last those that began in an alarm."""
    events: list[tuple[Event, Track]] = [
        (event, track) for track, score in zip(scored.tracks, scored.scores, strict=True) for event in score.events
    ]
    events.sort(key=lambda row: _order(row[0]))
    length = np.array([event.end - event.onset for event, _ in events])
    delay = np.array([event.delay for event, _ in events])  # NaN for missed events
    end = min(float(length.max()) + AFTER, LONGEST)
    grid = np.linspace(-BEFORE, end, _COLUMNS)
    torque = 1e3 * np.array([_row(track, event.onset + grid) for event, track in events])
    count, summary = len(events), scored.summary
    groups = {
        "found": summary.found,
        "missed": summary.events - summary.found - summary.masked,
        "in an alarm before": summary.masked,
    }
    borders = np.cumsum([0, *groups.values()])
    middles = 0.5 * (borders[:-1] + borders[1:]) - 0.5
    rows, inside, half = np.arange(float(count)), length < end, 0.36
    most = float(np.nanquantile(torque, 0.99))
    ends, onset, top = np.array([-BEFORE, end]), "onset, and end of the event", np.array([-0.5, count - 0.5])
    shown = draw.panel(
        "Compensated torque, all joints",
        f"Compensated torque of {counted(count, 'event')} from their onset on, and the first alarm of each",
        "time from the onset (s)",
        "",
        draw.heat(torque, grid, rows, _HEAT, (0.0, most), "mN·m"),
        draw.bars(delay, rows - half, rows + half, "first alarm", draw.VERMILION, 2.6),
        draw.bars(length[inside], rows[inside] - half, rows[inside] + half, onset, draw.DARK, 1.6),
        draw.curve(np.zeros(2), top, onset, draw.DARK, 1.6),
        *(
            draw.curve(ends, np.full(2, each - 0.5), "", draw.GREY, 1.1, "dash")
            for each in np.unique(borders)
            if 0 < each < count
        ),
        note=f"white: 0, dark blue: {most:.3g} mN·m and more",
        size="wide",
        height=int(min(max(280, 150 + 30 * count), 900)),
        y_ticks=[
            (float(middle), f"{number} {name}")
            for middle, (name, number) in zip(middles, groups.items(), strict=True)
            if number
        ],
        x_limits=(-BEFORE, end),
        y_limits=(count - 0.5, -0.5),
    )
    return draw.Sheet("score", "events", f"{scored.finger.name}: {counted(count, 'event')}", [shown])


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


def roc_sheet(scored: Scored, points: Sequence[RocPoint]) -> draw.Sheet:
    """Show found events against false alarms, and both over the factor on the thresholds."""
    events, minutes = counted(scored.summary.events, "event"), scored.summary.free_minutes
    factors = np.array([point.factor for point in points])
    found, found_low, found_high = with_ends((point.found_share for point in points), 100.0)
    rate, rate_low, rate_high = with_ends(point.false_alarms_per_hour for point in points)
    in_alarm = 100.0 * np.array([point.free_alarm_share for point in points])
    own = [int(np.argmin(np.abs(np.log(factors))))]
    named, least = _named(points), 60.0 / minutes  # one alarm in all free time, 1/h
    against = draw.panel(
        "Events found, over false alarms",
        "Share of the events that are found over the rate of false alarms, at several factors on all thresholds",
        "false alarms per hour of free time",
        "events found (%)",
        draw.bars(rate, found_low, found_high, "", _INTERVAL),
        draw.bars(found, rate_low, rate_high, "", _INTERVAL, lying=True),
        draw.curve(rate, found, "", draw.SKY, 1.5),
        draw.dots(rate, found),
        draw.dots(rate[named], found[named], texts=[f"×{factors[k]:g}" for k in named]),
        draw.dots(rate[own], found[own], "the description's thresholds", draw.VERMILION),
        size="medium",
        height=400,
        near_x=least,
        x_limits=(-0.15 * least, 2.0 * max(float(rate_high.max()), least)),
        y_limits=(-3.0, 103.0),
    )
    masked = 100.0 * np.array([point.masked / point.events for point in points])
    over = draw.panel(
        "Over the factor on all thresholds",
        "Share of the events that are found, and of the free time in alarm, over a factor on all thresholds",
        "factor on all thresholds",
        "share (%)",
        draw.band(factors, found_low, found_high, "95 % interval"),
        draw.curve(factors, found, "events found", draw.BLUE, 1.8),
        draw.curve(factors, in_alarm, "free time in alarm", draw.VERMILION, 1.8),
        draw.curve(factors, masked, "missed: in alarm before", draw.GREY, 1.4, "dash"),
        draw.dots(factors, found),
        draw.dots(factors, in_alarm, "", draw.VERMILION),
        draw.mark(1.0),
        size="medium",
        height=400,
        x_ticks=[(factor, f"{factor:g}") for factor in (*NAMED, 8.0) if factors.min() <= factor <= factors.max()],
        log_x=True,
        y_limits=(-3.0, 103.0),
    )
    title = f"{scored.finger.name}: {events}, {minutes:.3g} min of free time"
    return draw.Sheet("score", "roc", title, [against, over])


def _named(points: Sequence[RocPoint]) -> list[int]:
    """Choose the points of `NAMED` factors, one of those in the same place."""
    places: dict[tuple[int, int], int] = {}
    for k, point in enumerate(points):
        if any(math.isclose(point.factor, factor) for factor in NAMED):
            places[(point.found, point.false_alarms)] = k
    return list(places.values())


def delay_sheet(scored: Scored) -> draw.Sheet:
    """Show the share of all events found within a time, with its interval."""
    delays = np.sort([event.delay for score in scored.scores for event in score.events if event.found])
    total, delay = scored.summary.events, scored.summary.delay
    median, ninety = delay["median"].value, delay["ninety_percent"].value
    end = float(delays[-1])
    if end > TAIL * ninety > 0:
        end = TAIL * ninety
    later, ms = int((delays > end).sum()), 1e3 * delays
    share, low, high = with_ends((statistics_intervals.share(k, total) for k in range(1, len(delays) + 1)), 100.0)
    top = min(100.0, 1.3 * float(high.max()))
    marks = ((median, f"median {1e3 * median:.0f} ms", ""), (ninety, f"90 % within {1e3 * ninety:.0f} ms", "dash"))
    shown = draw.panel(
        "Found so far",
        f"Share of all events found within a time: half within {1e3 * median:.0f} ms",
        "delay from the onset (ms)",
        "share of events (%)",
        draw.band(np.repeat(ms, 2)[1:], np.repeat(low, 2)[:-1], np.repeat(high, 2)[:-1], "95 % interval"),
        draw.curve(*_stairs(ms, share), "found so far", draw.BLUE, 1.8),
        *(
            draw.curve(np.full(2, 1e3 * at), np.array([0.0, top]), name, draw.VERMILION, 1.3, dash)
            for at, name, dash in marks
        ),
        note=f"{later} later, up to {ms[-1]:.0f} ms →" if later else "",
        size="wide",
        height=330,
        x_limits=(0.0, 1.03e3 * max(end, 1e-3)),
        y_limits=(0.0, top),
    )
    title = f"{scored.finger.name}: {len(delays)} of {counted(total, 'event')} found"
    return draw.Sheet("score", "delays", title, [shown])


def _stairs(x: Numbers, y: Numbers) -> tuple[Numbers, Numbers]:
    """Return the line that rises to y at each x, from 0 on."""
    return np.concatenate([[0.0], np.repeat(x, 2)]), np.concatenate([[0.0], [0.0], np.repeat(y, 2)[:-1]])


# --- tuning -----------------------------------------------------------------------------------------------------------


def write_tune_figures(tuning: ContactTuning, folder: Path) -> dict[Path, str]:
    """Write the page with the figure of a tuning."""
    page = folder / TUNING_PAGE
    write_figures(page, "tuning of contact detection", tuning.description_.name, [tail_sheet(tuning)])
    return {page: "false alarms in motion that was kept out, over the level of the bounds"}


def tail_sheet(tuning: ContactTuning) -> draw.Sheet:
    """Show false alarms per hour over the factor on the bounds, in motion that was kept out."""
    report = tune_report.build_report(tuning)
    tail = sorted(report["tail"], key=lambda point: point["factor"])
    factors = np.array([point["factor"] for point in tail])
    rates, intervals = np.array([point["per_hour"] for point in tail]), np.array([point["interval"] for point in tail])
    found, asked = report["kept_out"]["per_hour"], report["false_alarms_per_hour"]
    limits = float(min(factors[0], 0.9)), float(max(factors[-1], 1.1))
    shown = draw.panel(
        "False alarms",
        "False alarms per hour over a factor on the chosen bounds, in motion that was kept out",
        "factor on the chosen bounds",
        "false alarms per hour",
        draw.band(factors, intervals[:, 0], intervals[:, 1], "95 % interval"),
        draw.curve(factors, rates, "kept out", draw.BLUE, 1.8),
        draw.curve(
            np.array(limits), np.full(2, asked), f"asked for: {asked:.3g} per hour", draw.VERMILION, 1.3, "dash"
        ),
        draw.dots(np.ones(1), np.array([found]), f"found: {found:.3g} per hour", draw.DARK),
        draw.mark(1.0),
        size="wide",
        height=480,
        log_x=True,
        near_y=60.0 / report["minutes"],
        x_limits=limits,
        y_limits=(0.0, 1.1 * float(max(intervals.max(), found))),
    )
    title = f"{report['finger']}: {report['minutes']:.0f} min of free motion, {report['method']}"
    return draw.Sheet("tune", "tail", title, [shown])
