"""The report of a score, "tendonfmu-score-1", as JSON (docs/reference/commands/score.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tendonfmu.detect.counting import GRACE, MERGED, SILENT, DetectionScore, Event
from tendonfmu.detect.score_types import (
    Estimate,
    Estimates,
    Figures,
    Pair,
    Point,
    ScoredEvent,
    ScoredRecording,
    ScoreReport,
)
from tendonfmu.detect.scoring import Scored, Track
from tendonfmu.detect.summary import RocPoint, Summary
from tendonfmu.files import finite
from tendonfmu.json_types import Values
from tendonfmu.recordings import LABEL
from tendonfmu.statistics import Interval, intervals

FORMAT: Final = "tendonfmu-score-1"
# of pushes: times the rms of the joint's residual, at the joint with the largest ratio
SIZES = (1.5, 3.0, 6.0, math.inf)


def build_report(scored: Scored) -> ScoreReport:
    """Build the report of a finished score; numbers that are not finite become None."""
    report: ScoreReport = {
        "format": FORMAT,
        "finger": scored.finger.name,
        "model": str(scored.finger.path),
        "joints": scored.finger.joint_names,
        "kinematics": scored.options.kinematics,
        "labels": LABEL if scored.options.labels is None else scored.options.labels,
        "definitions": {"merged_s": MERGED, "silent_s": SILENT, "grace_s": GRACE},
        "confidence": intervals.CONFIDENCE,
        "seed": scored.options.seed,
        "warnings": list(scored.warnings),
        **_summary(scored.summary),
        "roc": {
            "points": None if scored.roc is None else [_point(point) for point in scored.roc],
            "absent": scored.no_roc,
        },
        "recordings": [_recording(*each) for each in zip(scored.tracks, scored.scores, scored.summaries, strict=True)],
    }
    return finite(report)


# --- parts ------------------------------------------------------------------------------------------------------------


def _summary(summary: Summary) -> Figures:
    contact = summary.contact
    return {
        "events": summary.events,
        "found": summary.found,
        "missed": summary.events - summary.found,
        "missed_in_alarm": summary.masked,
        "found_at_release": summary.released,
        "found_share": _estimate(summary.found_share),
        "false_alarms": summary.false_alarms,
        "false_alarms_after_events": summary.alarms_after_events,
        "false_alarms_interval": _interval(summary.false_alarm_count),
        "false_alarms_per_minute": _estimate(summary.false_alarms_per_minute),
        "free_minutes": summary.free_minutes,
        "free_alarm_share": _estimate(summary.free_alarm_share),
        "median_delay_s": summary.delay["median"].value,
        "delay_s": {
            "lower_quartile": _estimate(summary.delay["lower_quartile"]),
            "median": _estimate(summary.delay["median"]),
            "upper_quartile": _estimate(summary.delay["upper_quartile"]),
            "ninety_percent": _estimate(summary.delay["ninety_percent"]),
        },
        "held": summary.held,
        "held_share": _estimate(summary.held_share),
        "overhang": {
            "events": summary.overhang_events,
            "seconds": summary.overhang_seconds,
            "longest_s": summary.longest_overhang,
            "per_event_s": _estimate(summary.overhang),
        },
        "at_alarm": {
            "force": None if summary.force_at_alarm is None else _estimate(summary.force_at_alarm),
            "external_torque": _estimates(summary.external_at_alarm),
            "compensated_torque": _estimates(summary.compensated_at_alarm),
        },
        "free_rms": [each.value for each in summary.free_rms],
        "free_rms_interval": [_interval(each) for each in summary.free_rms],
        "contact_torque_rms_error": None if contact is None else [each.value for each in contact.rms],
        "contact_torque_rms_error_interval": None if contact is None else [_interval(each) for each in contact.rms],
        "contact_torque_correlation": None if contact is None else _estimates(contact.correlation),
        "contact_torque_slope": None if contact is None else _estimates(contact.slope),
        "contact_torque_within_two_std": None if contact is None else _estimates(contact.within),
    }


def _recording(track: Track, score: DetectionScore, summary: Summary) -> ScoredRecording:
    time = track.recording.time
    return {
        "path": str(track.recording.path),
        "samples": len(time),
        "duration_s": float(time[-1] - time[0]),
        "labelled": track.recording.contact is not None,
        "external_torque": track.external is not None,
        "sensed_force": track.force is not None,
        "mean_force": float(np.abs(track.recording.groups["tendon_force"]).mean()),
        **_summary(summary),
        "event_list": [_event(event) for event in score.events],
        "false_alarm_list": [{"begin_s": begin, "end_s": end} for begin, end in score.false_alarms],
    }


def _event(event: Event) -> ScoredEvent:
    return {
        "onset_s": event.onset,
        "end_s": event.end,
        "found": event.found,
        "silent_before": event.silent,
        "alarm_s": event.alarm,
        "delay_s": event.delay,
        "at_release": event.found and event.released,
        "largest_torque": event.largest,
        "joint": None if event.joint is None else event.joint + 1,
        "held": event.held,
        "held_share": event.held_share,
        "overhang_s": event.overhang,
        "force": event.force,
        "external_torque": _numbers(event.external),
        "compensated_torque": _numbers(event.compensated),
    }


def _point(point: RocPoint) -> Point:
    return {
        "factor": point.factor,
        "found": point.found,
        "missed_in_alarm": point.masked,
        "found_share": _estimate(point.found_share),
        "false_alarms": point.false_alarms,
        "false_alarms_per_hour": _estimate(point.false_alarms_per_hour),
        "free_alarm_share": point.free_alarm_share,
        "median_delay_s": point.median_delay,
    }


def _estimate(estimate: Interval) -> Estimate:
    return {"value": estimate.value, "interval": _interval(estimate)}


def _estimates(estimates: Sequence[Interval] | None) -> Estimates:
    return None if estimates is None else [_estimate(each) for each in estimates]


def _interval(estimate: Interval) -> Pair:
    return None if math.isnan(estimate.low) or math.isnan(estimate.high) else [estimate.low, estimate.high]


def _numbers(values: NDArray[np.float64] | None) -> Values | None:
    return None if values is None else [*values.tolist()]


def by_size(scored: Scored, left: Sequence[float]) -> list[dict[str, Any]] | None:
    """Count the pushes, and those found, by the torque of a reference sensor over the residual of free motion."""
    # left: [n] rms of the residual (N·m)
    sizes, hits = [], []
    scale = np.maximum(np.array(left), 1e-12)
    for track, score in zip(scored.tracks, scored.scores, strict=True):
        if track.external is None:
            return None
        for event in score.events:
            touched = (track.recording.time >= event.onset) & (track.recording.time <= event.end)
            sizes.append(float((np.abs(track.external[touched]) / scale).max()))
            hits.append(event.found)
    low, rows = 0.0, []
    for high in SIZES:
        inside = [hit for size, hit in zip(sizes, hits, strict=True) if low <= size < high]
        if inside:
            share = intervals.share(sum(inside), len(inside))
            rows.append(
                {
                    "from": low,
                    "below": None if math.isinf(high) else high,
                    "events": len(inside),
                    "found": sum(inside),
                    "share": share.value,
                    "interval": [share.low, share.high],
                }
            )
        low = high
    return rows
