"""How a score and a tuning read in terminal and notebook, from their reports, and what their figures show.

Torques and detection over time (fig. 8 of the paper), every event from its onset on, and other thresholds; false alarms
over the level of the bounds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu import drawing as draw
from tendonfmu.arrays import Numbers
from tendonfmu.detect import (
    GRACE,
    ContactTuning,
    DetectionScore,
    Estimate,
    Event,
    Figures,
    Point,
    Scored,
    Track,
    TuneReport,
    tune_report,
)
from tendonfmu.files import counted
from tendonfmu.recordings import flagged_stretches
from tendonfmu.report.kit import Table, write_figures

PAGE, TUNING_PAGE = "score.html", "tuning.html"
SHOWN = 20.0  # s of the recording, where most events are
JOINTS = 4  # drawn at most
BEFORE, AFTER, LONGEST = 0.3, 0.3, 2.5  # s; an event's row before the onset, after the end, and at most after onset
PRINTED = (0.5, 1.0, 2.0)  # factors on the thresholds that are printed
TICKS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # factors on the thresholds
_COLUMNS, _POINTS = 560, 5000
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
    onsets = np.array([event.onset_s for event in score.events])
    found = np.array([event.onset_s for event in score.events if event.found])
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
        rows = (time >= event.onset_s) & (time <= event.end_s + GRACE)
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
    length = np.array([event.end_s - event.onset_s for event, _ in events])
    delay = np.array([event.delay_s for event, _ in events], dtype=float)  # NaN for missed events
    end = min(float(length.max()) + AFTER, LONGEST)
    grid = np.linspace(-BEFORE, end, _COLUMNS)
    torque = 1e3 * np.array([_row(track, event.onset_s + grid) for event, track in events])
    count, summary = len(events), scored.summary
    groups = {
        "found": summary.found,
        "missed": summary.missed - summary.missed_in_alarm,
        "in an alarm before": summary.missed_in_alarm,
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
    title = f"{scored.finger.name}: {counted(count, 'event')}, {summary.found} found"
    late = [1e3 * each.number for each in (summary.delay_s.median, summary.delay_s.ninety_percent)]
    caption = f"Half of those found within {late[0]:.0f} ms, 90 % within {late[1]:.0f} ms." if summary.found else ""
    return draw.Sheet("score", "events", title, [shown], caption)


def _order(event: Event) -> tuple[int, float]:
    """Return a sort key: the group, and the place in it."""
    if event.delay_s is not None:
        return 0, event.delay_s
    return 1 if event.silent_before else 2, event.end_s - event.onset_s


def _row(track: Track, at: Numbers) -> Numbers:
    """Return the torque [t] N·m at the last sample before each time."""
    time = track.recording.time
    size = np.sqrt(np.sum(track.outputs["compensated_torque"] ** 2, axis=1))
    index = np.searchsorted(time, at + 1e-9, side="right") - 1
    inside = (index >= 0) & (at <= time[-1])
    return np.where(inside, size[np.maximum(index, 0)], math.nan)


# --- other thresholds -------------------------------------------------------------------------------------------------


def roc_sheet(scored: Scored, points: Sequence[Point]) -> draw.Sheet:
    """Show found events and alarms over the factor on the thresholds."""
    factors = np.array([point.factor for point in points])
    shares = [point.found_share for point in points]
    found, low, high = 100.0 * np.array([(each.number, *each.ends) for each in shares]).T
    in_alarm = 100.0 * np.array([point.free_alarm_share for point in points])
    masked = 100.0 * np.array([point.missed_in_alarm / scored.summary.events for point in points])
    shown = draw.panel(
        "Over the factor on all thresholds",
        "Share of the events that are found, and of the free time in alarm, over a factor on all thresholds",
        "factor on all thresholds",
        "share (%)",
        draw.band(factors, low, high, "95 % interval"),
        draw.curve(factors, found, "events found", draw.BLUE, 1.8),
        draw.curve(factors, in_alarm, "free time in alarm", draw.VERMILION, 1.8),
        draw.curve(factors, masked, "missed: in alarm before", draw.GREY, 1.4, "dash"),
        draw.dots(factors, found),
        draw.dots(factors, in_alarm, "", draw.VERMILION),
        draw.mark(1.0),
        size="wide",
        height=400,
        x_ticks=[(factor, f"{factor:g}") for factor in TICKS if factors.min() <= factor <= factors.max()],
        log_x=True,
        y_limits=(-3.0, 103.0),
    )
    events, minutes = counted(scored.summary.events, "event"), scored.summary.free_minutes
    return draw.Sheet("score", "roc", f"{scored.finger.name}: {events}, {minutes:.3g} min of free time", [shown])


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


# --- a score in words -------------------------------------------------------------------------------------------------


def score_tables(scored: Scored) -> Iterator[Table]:
    """List the tables to print: torque by joint, with 95 % intervals in brackets."""
    of = scored.summary
    columns = [
        ("free residual\nrms, mN·m", 1e3, _with_intervals(of.free_rms, of.free_rms_interval)),
        (
            "in contact: error\nrms, mN·m",
            1e3,
            _with_intervals(of.contact_torque_rms_error, of.contact_torque_rms_error_interval),
        ),
        ("correlation", 1.0, of.contact_torque_correlation),
        ("slope", 1.0, of.contact_torque_slope),
        ("within\n2 std, %", 100.0, of.contact_torque_within_two_std),
        ("at the alarm: median\n|external|, mN·m", 1e3, of.at_alarm.external_torque),
    ]
    shown = [(heading, [_estimate(each, factor) for each in values]) for heading, factor, values in columns if values]
    yield (
        f"{scored.finger.name}: torque, with 95 % intervals",
        ("joint", *(heading for heading, _ in shown)),
        list(zip(scored.finger.joint_names, *(cells for _, cells in shown), strict=True)),
    )


def _with_intervals(values: Sequence[float | None] | None, ends: Sequence[Any] | None) -> list[Estimate]:
    return [Estimate(*each) for each in zip(values or (), ends or (), strict=True)]


def score_lines(scored: Scored) -> Iterator[str]:
    """List the lines to print: false alarms, events, delays, other thresholds."""
    of = scored.summary
    if of.events:
        yield from _event_lines(of)
    after = of.false_alarms_after_events
    soon = f" ({after} of them within 2 s after an event)" if after else ""
    yield (
        f"false alarms: {of.false_alarms}{soon} in {of.free_minutes:.3g} min of free time, "
        f"{_estimate(of.false_alarms_per_minute)} per minute; "
        f"in alarm {_estimate(of.free_alarm_share, 100.0)} % of the free time"
    )
    shown = [point for point in scored.roc or [] if any(math.isclose(point.factor, factor) for factor in PRINTED)]
    if shown and of.free_minutes:
        factors = ", ".join(f"{point.factor:g}" for point in shown)
        some = ", ".join(f"{point.found}" for point in shown)
        rates = (point.false_alarms_per_hour.value or 0.0 for point in shown)
        per_hour = ", ".join(f"{rate:.0f}" if rate >= 100 else f"{rate:.3g}" for rate in rates)
        hit = f"{some} of {of.events} found; " if of.events else ""
        yield f"thresholds × {factors}: {hit}{per_hour} false alarms per hour"
    if scored.no_roc:
        yield f"no ROC: {scored.no_roc}"


def _event_lines(of: Figures) -> Iterator[str]:
    why = f", {of.missed_in_alarm} of them in an alarm that had begun before" if of.missed_in_alarm else ""
    late = f", {of.found_at_release} of them only as the load ends" if of.found_at_release else ""
    share = _estimate(of.found_share, 100.0)
    yield f"events: {of.found} of {of.events} found{late}, {share} %; {of.missed} missed{why}"
    if not of.found:
        return
    delay, over, force = of.delay_s, of.overhang, of.at_alarm.force
    lower, upper, ninety = (
        _number(each.value, 1e3) for each in (delay.lower_quartile, delay.upper_quartile, delay.ninety_percent)
    )
    yield f"delay: median {_estimate(delay.median, 1e3)} ms, quartiles {lower} and {upper}, 90 % within {ninety}"
    felt = "" if force is None else f"; force at the alarm: median {_estimate(force)} N"
    yield (
        f"held to their end: {of.held} of {of.found}; alarms that outlast an event: {over.events}, "
        f"{over.seconds:.3g} s in all, the longest {over.longest_s:.3g} s{felt}"
    )


def _estimate(estimate: Estimate, factor: float = 1.0) -> str:
    """Format an estimate with its interval, such as `12 (8.1 to 19)`."""
    value, ends = _number(estimate.value, factor), estimate.interval
    return value if ends is None else f"{value} ({_number(ends[0], factor)} to {_number(ends[1], factor)})"


def _number(value: float | None, factor: float) -> str:
    """Format with three digits, and at most two decimals where that is enough."""
    if value is None or math.isnan(value):
        return "-"
    scaled = factor * value
    if abs(scaled) >= 99.95:
        return f"{scaled:.0f}"
    return f"{scaled:.1f}" if abs(scaled) >= 9.995 else f"{scaled:.2f}"


# --- a tuning in words ------------------------------------------------------------------------------------------------


def tune_tables(report: TuneReport) -> Iterator[Table]:
    """List the tables to print: what is found, by joint, then results by pretension."""
    pushes, contact = report["pushes"], report["contact"]
    deviation = (contact["deviation"], contact["deviation_per_force"])
    by_joint = zip(report["joints"], pushes["torque"], *deviation, strict=True)
    yield (
        f"{report['finger']}: {report['method']}",
        (
            "joint",
            f"found within {1e3 * pushes['within_s']:.0f} ms,\n9 of 10: from mN·m",
            "deviation\nmN·m",
            "+ per N\nmN·m/N",
        ),
        [(joint, *("–" if value is None else f"{1e3 * value:.3g}" for value in each)) for joint, *each in by_joint],
    )
    yield (
        "free motion",
        ("mean force, N", "minutes", "residual rms\nmN·m"),
        [
            (
                f"{each['mean_force']:.3g}",
                f"{each['minutes']:.1f}",
                ", ".join(f"{1e3 * value:.3g}" for value in each["free_rms"]),
            )
            for each in report["pretensions"]
        ],
    )


def tune_lines(report: TuneReport) -> Iterator[str]:
    """List the lines to print: what was asked for and found, and the noise of bias and sensors."""
    yield report["sentence"]
    kept_out, bias, sensors = report["kept_out"], report["bias"], report["sensor_fault"]
    low, high = kept_out["interval"]
    if kept_out["alarms"]:
        where = ", ".join(f"{each['alarms']} in {each['path']}" for each in kept_out["recordings"] if each["alarms"])
        yield (
            f"kept out: {where}; the longest {kept_out['longest_s']:.3g} s, "
            f"{100 * kept_out['share_in_alarm']:.2g} % of the time in alarm"
        )
    yield f"with 95 % confidence between {low:.3g} and {high:.3g} false alarms an hour"
    forces = report["holds_for"]
    yield (
        f"learned at mean tendon forces of {forces['lowest_force']:.3g} to {forces['highest_force']:.3g} N; beyond "
        "them bounds are extrapolated"
    )
    yield (
        f"bias: noise {1e3 * bias['noise_std']:.3g} mN·m + {1e3 * bias['noise_std_per_force']:.3g} mN·m per N, "
        f"time constant {bias['time_constant']:.3g} s at {bias['mean_force']:.3g} N"
    )
    if sensors["keys"] is None:
        yield f"sensor faults are not watched: {sensors['left_out']}"
    else:
        yield (
            f"sensor faults: forces differ from those of their springs by up to {sensors['largest_difference']:.2g} N "
            f"in free motion, {sensors['keys']['spring_margin']:.3g} N are allowed"
        )
