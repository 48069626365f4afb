"""The results of a calibration's steps, as its JSON report holds them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.detect import ContactTuning, Scored, tune_report
from tendonfmu.diagnosis import Diagnosis, Event
from tendonfmu.recordings import FitRecording
from tendonfmu.report import capital, gain_text, names_of

MOST_SAID = 2  # stretches that are named one by one
BEFORE, AFTER, POINTS = 0.5, 1.0, 1000  # s around a push that is shown, and samples of it at most
OF_TUNING = (
    "method",
    "false_alarms_per_hour",
    "minutes",
    "more_minutes",
    "kept_out",
    "pushes",
    "pretensions",
    "sensor_fault",
    "sentence",
)
OF_SCORE = (
    "events",
    "found",
    "found_at_release",
    "free_alarm_share",
    "false_alarms",
    "false_alarms_after_events",
    "free_minutes",
    "median_delay_s",
    "found_share",
    "free_rms",
    "overhang",
)
OF_PUSH = ("onset_s", "end_s", "largest_torque", "joint", "found", "at_release", "silent_before", "delay_s")


def structure_of(found: Diagnosis) -> dict[str, Any]:
    """Report what the description lacked, with both models."""
    names = names_of(found)
    return {
        "verdict": found.verdict,
        "causes": [
            {
                "title": capital(cause.title),
                "place": capital(names.places(cause)),
                "size": cause.size,
                "gain": gain_text(found, cause),
                "explanation": cause.explanation,
            }
            for cause in found.causes
        ],
        "recordings": [Path(each).name for each in found.recordings],
        "tests": [Path(each).name for each in found.tests],
        "unexplained": found.unexplained.description,
        "next_experiment": found.experiment.sentence if found.experiment.motion else "",
        "nominal": found.nominal_data,
        "extended": found.extended_data,
        "warnings": list(found.warnings),
    }


def typical_push(scored: Scored) -> dict[str, Any] | None:
    """Return the found push with the median delay, as `PushShown` takes it; None if none is found."""
    found = [
        (event.delay, event, track)
        for track, score in zip(scored.tracks, scored.scores, strict=True)
        for event in score.events
        if event.found
    ]
    if not found:
        return None
    _, event, track = sorted(found, key=lambda each: each[0])[len(found) // 2]
    time, felt = track.recording.time, track.outputs["compensated_torque"]
    during = (time >= event.onset) & (time <= event.end)
    j = int(np.argmax(np.abs(felt[during] if track.external is None else track.external[during]).max(axis=0)))
    rows = np.flatnonzero((time >= event.onset - BEFORE) & (time <= event.end + AFTER))
    rows = rows[:: max(1, len(rows) // POINTS)]
    return {
        "recording": track.recording.path.name,
        "onset": event.onset,
        "joint": scored.subject.finger.joint_names[j],
        "end": event.end - event.onset,
        "delay": event.delay,
        "time": (time[rows] - event.onset).tolist(),
        "felt": felt[rows, j].tolist(),
        "sensor": None if track.external is None else track.external[rows, j].tolist(),
    }


def left_out(events: Sequence[Event]) -> list[str]:
    """Say which stretches a fit left out: each, or of many how many and the longest."""
    said = [f"{event.recording}: {event.start:.2f} to {event.end:.2f} s: {event.description}" for event in events]
    if len(said) <= MOST_SAID:
        return [f"{each}; left out of the fit" for each in said]
    longest = max(range(len(said)), key=lambda k: events[k].end - events[k].start)
    whole = sum(event.end - event.start for event in events)
    return [f"{len(said)} stretches, {whole:.2g} s in all, are left out of the fit; the longest: {said[longest]}"]


def tuning_of(tuning: ContactTuning) -> dict[str, Any]:
    """Report the tuned bounds and their alarms."""
    report = tune_report.build_report(tuning)
    return {
        "finger": tuning.description_.data,
        "warnings": report["warnings"],
        **{key: report[key] for key in OF_TUNING},
    }


def recording_of(each: FitRecording) -> dict[str, Any]:
    """Report a recording: file, length (min) and mean tendon force (N)."""
    return {"path": str(each.path), "minutes": each.duration / 60.0, "mean_force": each.mean_force}


def record_next(lacks: Mapping[str, Any], tuned: Mapping[str, Any]) -> list[str]:
    """List what to record, the most useful first."""
    found = []
    if tuned["more_minutes"]:
        found.append(
            f"{tuned['more_minutes']:.0f} min more of free motion: it then shows whether "
            f"{tuned['false_alarms_per_hour']:g} false alarms an hour are kept"
        )
    if len(tuned["pretensions"]) == 1:
        found.append("the same motion at another pretension: the growth with the force is not known yet")
    if lacks["next_experiment"]:
        found.append(lacks["next_experiment"])
    return found
