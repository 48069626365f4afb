"""The results of a calibration's steps, as its JSON report holds them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Flags, Indices, Numbers
from tendonfmu.detect import ContactTuning, Scored, pretension_of, sample_seconds, stretches, tune_report
from tendonfmu.diagnosis import Diagnosis, Event
from tendonfmu.fmu import run_model
from tendonfmu.model import Finger
from tendonfmu.recordings import FitRecording, Held, Recording, at_rows, flagged_stretches, held_out_blocks, rms
from tendonfmu.report import MotionShown, capital, names_of, percent_interval
from tendonfmu.statistics import intervals

# --- on motion that nothing was chosen on -----------------------------------------------------------------------------
# The *error* of a calibration is the rms of `compensated_torque`, less a known `external_torque`: what the delivered
# FMU feels although nothing touches the finger. Its bias learns as slowly as it was tuned, and stops in contact.


SHOWN = 20.0  # s


def without_held_out(recording: Recording, held: Held) -> Recording:
    """Cut the held-out blocks out of a recording: what is left of it has gaps there."""
    return at_rows(recording, ~held_out_blocks(recording, held))


@dataclass(frozen=True)
class Judged:
    """Recordings, with the samples [N] that no number, structure or threshold was chosen on."""

    recordings: Sequence[FitRecording]
    held_out: bool  # whether these are held-out blocks of the recordings; else all of them

    def masks(self) -> list[Flags]:
        """Return the judged samples [N] of each recording."""
        return [each.held_out if self.held_out else each.tracked for each in self.recordings]

    def minutes(self, chosen: Sequence[Flags]) -> float:
        """Return the time of the chosen samples [N] of each recording (min)."""
        seconds = (sample_seconds(each.time)[own] for each, own in zip(self.recordings, chosen, strict=True))
        return sum(float(own.sum()) for own in seconds) / 60.0


class Delivered:
    """A finger that has run over all judged recordings."""

    def __init__(self, finger: Finger, judged: Judged) -> None:
        self._judged = judged
        self.torque: list[Numbers] = []  # of the tendons, less a known load, N·m [N, n] of each recording
        self.left: list[Numbers] = []  # of it, less friction and bias
        self.contact: list[Flags] = []  # [N]
        for each in judged.recordings:
            outputs = run_model(finger, each.recording, kinematics_source=each.kinematics)
            known = 0.0 if each.external is None else each.external
            self.torque.append(outputs["joint_torque"] - known)
            self.left.append(outputs["compensated_torque"] - known)
            self.contact.append(outputs["contact"].ravel().astype(bool))

    def errors(self, chosen: Sequence[Flags] | None = None) -> list[float]:
        """Return [n] the rms of what is left at the chosen samples [N] of each recording, or at all judged ones."""
        return rms(np.concatenate(self.left), np.concatenate(chosen or self._judged.masks()))

    def alarms(self) -> dict[str, Any]:
        """Count the contacts that begin in judged motion; the rate with its 95 % interval (1/h)."""
        count = 0
        for each, contact, mask in zip(self._judged.recordings, self.contact, self._judged.masks(), strict=True):
            count += int(mask[stretches(each.time, contact)[:, 0]].sum())
        minutes = self._judged.minutes(self._judged.masks())
        rate = intervals.rate(count, minutes / 60.0)
        return {"alarms": count, "minutes": minutes, "interval": [rate.low, rate.high]}


def compared(before: Delivered, after: Delivered, judged: Judged, name: str) -> dict[str, Any]:
    """Report the errors of the model before, which has a name, and of the calibrated one, also by pretension."""
    return {
        "held_out": judged.held_out,
        "minutes": judged.minutes(judged.masks()),
        name: before.errors(),
        "calibrated": after.errors(),
        "pretensions": [
            {
                "mean_force": force,
                "minutes": judged.minutes(chosen),
                name: before.errors(chosen),
                "calibrated": after.errors(chosen),
            }
            for force, chosen in _by_pretension(judged)
        ],
    }


def _by_pretension(judged: Judged) -> list[tuple[float, list[Flags]]]:
    """Return the mean force (N) of each pretension, rising, and its judged samples [N] of each recording."""
    masks = judged.masks()
    force = [np.abs(each.recording.groups["tendon_force"]).mean(axis=1) for each in judged.recordings]
    times = [each.time - each.time[0] for each in judged.recordings]
    chosen = np.concatenate(masks)
    all_force = np.concatenate(force)
    if not chosen.any():
        return []
    owners = np.repeat(np.arange(len(times)), [len(time) for time in times])
    label: Indices = np.full(len(chosen), -1)
    label[chosen] = pretension_of(all_force[chosen], np.concatenate(times)[chosen], owners[chosen])
    ends = np.cumsum([len(mask) for mask in masks])[:-1]
    return [
        (float(all_force[label == group].mean()), np.split(label == group, ends)) for group in range(label.max() + 1)
    ]


def typical_motion(before: Delivered, after: Delivered, judged: Judged) -> MotionShown:
    """Return a judged stretch whose error with the second model is the median."""
    listed: list[tuple[float, float, int, Flags]] = []
    for k, (each, mask) in enumerate(zip(judged.recordings, judged.masks(), strict=True)):
        time = each.time
        for first, end in flagged_stretches(time, mask if mask.any() else each.tracked):
            for begin in np.arange(first, end, SHOWN):
                rows = (time >= begin) & (time <= min(end, begin + SHOWN))
                listed.append((min(end - begin, SHOWN), float(np.mean(after.left[k][rows] ** 2)), k, rows))
    least = 0.5 * max(length for length, *_ in listed)
    long = sorted((stretch for stretch in listed if stretch[0] >= least), key=lambda stretch: stretch[1])
    _, _, k, rows = long[len(long) // 2]
    own = judged.recordings[k]
    return MotionShown(own.path.name, own.time[rows], after.torque[k][rows], before.left[k][rows], after.left[k][rows])


# --- the report -------------------------------------------------------------------------------------------------------

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
# of pushes: times the rms of the joint's residual, at the joint with the largest ratio
SIZES = (1.5, 3.0, 6.0, math.inf)
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
                "gain": percent_interval(cause.gain) + " in tendon positions" * (cause.gain_unit == "m"),
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
        (event.delay_s, event, track)
        for track, score in zip(scored.tracks, scored.scores, strict=True)
        for event in score.events
        if event.delay_s is not None
    ]
    if not found:
        return None
    _, event, track = sorted(found, key=lambda each: each[0])[len(found) // 2]
    time, felt = track.recording.time, track.outputs["compensated_torque"]
    during = (time >= event.onset_s) & (time <= event.end_s)
    j = int(np.argmax(np.abs(felt[during] if track.external is None else track.external[during]).max(axis=0)))
    rows = np.flatnonzero((time >= event.onset_s - BEFORE) & (time <= event.end_s + AFTER))
    rows = rows[:: max(1, len(rows) // POINTS)]
    return {
        "recording": track.recording.path.name,
        "onset": event.onset_s,
        "joint": scored.finger.joint_names[j],
        "end": event.end_s - event.onset_s,
        "delay": event.delay_s,
        "time": (time[rows] - event.onset_s).tolist(),
        "felt": felt[rows, j].tolist(),
        "sensor": None if track.external is None else track.external[rows, j].tolist(),
    }


def by_size(scored: Scored, left: Sequence[float]) -> list[dict[str, Any]] | None:
    """Count the pushes, and those found, by the torque of a reference sensor over the residual of free motion."""
    # left: [n] rms of the residual (N·m)
    sizes, hits = [], []
    scale = np.maximum(np.array(left), 1e-12)
    for track, score in zip(scored.tracks, scored.scores, strict=True):
        if track.external is None:
            return None
        for event in score.events:
            touched = (track.recording.time >= event.onset_s) & (track.recording.time <= event.end_s)
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
    report: Mapping[str, Any] = tune_report.build_report(tuning)
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
            f"{tuned['more_minutes']:.0f} min more of free motion: bounds that keep to "
            f"{tuned['false_alarms_per_hour']:g} false alarms an hour are an extrapolation so far"
        )
    if len(tuned["pretensions"]) == 1:
        found.append("the same motion at another pretension: the growth with the force is not known yet")
    if lacks["next_experiment"]:
        found.append(lacks["next_experiment"])
    return found
