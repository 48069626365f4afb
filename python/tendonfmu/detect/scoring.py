"""The score of a finger, or its FMU, on labelled recordings: runs, decisions, runs with other thresholds, report."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.detect.counting import GRACE, MERGED, SILENT, DetectionScore, Signals, pooled, score_detection
from tendonfmu.detect.free_motion import sensed_contact
from tendonfmu.detect.summary import (
    FACTORS,
    Definitions,
    FalseAlarm,
    Figures,
    Point,
    Roc,
    ScoredRecording,
    ScoreReport,
    roc,
    summarise,
)
from tendonfmu.errors import InputError
from tendonfmu.estimate import check_given_once
from tendonfmu.files import counted, finite
from tendonfmu.fmu import check_model, finger_of, outputs_of, run_fmu
from tendonfmu.model import Finger, FingerSource, finger_file, inputs_used, native, read_finger, watches_motors
from tendonfmu.options import ScoreOptions
from tendonfmu.recordings import GROUP_PER, LABEL, Recording, RecordingSource, gaps, listed_sources, read_recordings
from tendonfmu.statistics import intervals

Progress = Callable[[int, int], None]

USUAL = ScoreOptions()
FORMAT: Final = "tendonfmu-score-1"
BOUNDS = ("contact.threshold", "contact.bands")  # how their paths begin


@dataclass(frozen=True)
class Track:
    """A finger over a recording."""

    recording: Recording  # the recording
    label: Flags  # [N] label; False throughout if there is none
    outputs: Mapping[str, NDArray[Any]]  # outputs of `native.Instance.run`
    residual: Numbers  # [N, n] residual before the bias update, NaN where it is unknown (N·m)
    force: Numbers | None  # [N] sensed force (N), or None

    @property
    def alarm(self) -> Flags:
        """[N] whether the finger reports contact."""
        return np.asarray(self.outputs["contact"].ravel().astype(bool))

    @property
    def external(self) -> Numbers | None:
        """[N, n] torque of the reference sensor (N·m), or None."""
        return self.recording.groups.get("external_torque")

    def score(self) -> DetectionScore:
        """Score the recording with all its signals."""
        outputs = self.outputs
        signals = Signals(
            residual=self.residual,
            compensated=outputs["compensated_torque"],
            external=self.external,
            force=self.force,
            deviation=outputs.get("compensated_torque_std"),
        )
        return score_detection(self.recording.time, self.label, self.alarm, signals)

    def decisions(self) -> DetectionScore:
        """Score the decisions alone."""
        return score_detection(self.recording.time, self.label, self.alarm)


@dataclass(frozen=True)
class Scored:
    """A finished score."""

    finger: Finger  # what was scored; that of an FMU has its path
    options: ScoreOptions
    tracks: Sequence[Track]  # by recording
    scores: Sequence[DetectionScore]
    summaries: Sequence[Figures]
    summary: Figures  # of all recordings together
    roc: list[Point] | None  # points of the ROC; None for an FMU
    warnings: Sequence[str]  # sentences

    @property
    def no_roc(self) -> str | None:
        """Why there is no ROC."""
        if self.roc is not None:
            return None
        return "an FMU was scored: its thresholds are as packed; score FINGER.json for the ROC"


def score_recordings(
    model: FingerSource,
    recordings: RecordingSource | Sequence[RecordingSource],
    options: ScoreOptions = USUAL,
    progress: Progress | None = None,
) -> Scored:
    """Score a finger, or its FMU, on recordings."""
    sources = listed_sources(recordings)
    check_given_once(sources, [])
    finger, fmu = _read_model(model)
    column = LABEL if options.labels is None else options.labels
    read = _read(sources, column, options.force)
    if not read:
        raise InputError("no recording; expected at least one")
    read, warnings = _labelled(read, options.labels)
    warnings += _without_force(read, options.force)
    factors = FACTORS if fmu is None else ()
    done, total = 0, len(read) * (1 + len(factors))

    def count(runs: int) -> None:
        nonlocal done
        done += runs
        if progress is not None:
            progress(done, total)

    def score_at(factor: float) -> DetectionScore:
        score = _score_scaled(finger, tracks, options.kinematics, factor)
        count(len(tracks))
        return score

    tracks: list[Track] = []
    for recording in read:
        tracks.append(run_track(finger, recording, options.kinematics, options.force, fmu))
        warnings += _gaps(recording)
        count(1)
    scores = [track.score() for track in tracks]
    summary = summarise(pooled(scores), options.seed)
    return Scored(
        finger=finger,
        options=options,
        tracks=tracks,
        scores=scores,
        summaries=[summarise(score, options.seed) for score in scores],
        summary=summary,
        roc=roc(score_at) if fmu is None else None,
        warnings=[
            *warnings,
            *([] if summary.events else [f"no event in column {column}: false alarms only"]),
            *_opposed(summary, finger.joint_names),
        ],
    )


def _opposed(summary: Figures, joints: Sequence[str]) -> list[str]:
    """Warn if the estimated torque falls where that of the reference sensor rises."""
    slopes = summary.contact_torque_slope or []
    names = [name for name, slope in zip(joints, slopes, strict=False) if slope.ends[1] < 0.0]
    if not names:
        return []
    return [
        f"compensated_torque falls where external_torque rises at {', '.join(names)}: expected minus the torque on the "
        'finger, as the tendons have to hold it; write "sign": -1 into the map if the sensor gives the torque on it'
    ]


# --- recordings -------------------------------------------------------------------------------------------------------


def _read(sources: Sequence[RecordingSource], labels: str, force: str | None) -> list[Recording]:
    for source in sources:
        path = source if isinstance(source, str | os.PathLike) else getattr(source, "path", "DataFrame")
        for name in (labels, force):
            if name is not None and (name == "time" or name.partition("[")[0] in GROUP_PER):
                what = "a label, 0 or 1" if name == labels else "the sensed force in N"
                raise InputError(
                    f"{path}: column {name}: is a signal of the finger; expected a column that holds {what}"
                )
        if force is not None and force == labels:
            raise InputError(f"{path}: column {force}: both label and sensed force; expected two columns")
    read = read_recordings(sources, label=labels, others=() if force is None else (force,))
    for recording in read:
        if len(recording) < 2:
            raise InputError(f"{recording.path}: one sample; expected at least two")
    return read


def _labelled(read: Sequence[Recording], labels: str | None) -> tuple[list[Recording], list[str]]:
    """Return the recordings, labelled by their reference sensor where they have no label, and what was done."""
    without = [str(recording.path) for recording in read if recording.contact is None]
    if labels is not None and len(without) == len(read):
        raise InputError(f"{', '.join(without)}: no column {labels}; expected a label, 0 or 1, in at least one")
    labelled, sentences = list[Recording](), []
    for recording in read:
        sensed = None if recording.contact is not None else sensed_contact(recording)
        labelled.append(recording if sensed is None else replace(recording, contact=sensed[0]))
        if sensed is not None:
            beyond = ", ".join(f"{1e3 * each:.3g}" for each in sensed[1])
            means = f"contact is where external_torque is more than {beyond} mN·m off its median (by joint)"
        elif recording.contact is None:
            means = "the whole recording counts as free of contact"
        else:
            continue
        sentences.append(f"{recording.path}: no column {labels or LABEL}: {means}")
    return labelled, sentences


def _without_force(read: Sequence[Recording], force: str | None) -> list[str]:
    if force is None:
        return []
    without = [str(recording.path) for recording in read if force not in recording.others]
    if len(without) == len(read):
        raise InputError(f"{', '.join(without)}: no column {force}; expected the sensed force (N) in at least one")
    return [f"{path}: no column {force}: no sensed force" for path in without]


def _gaps(recording: Recording) -> list[str]:
    rows = gaps(recording.time)
    if not rows:
        return []
    first = rows[0]
    more = f", and {counted(len(rows) - 1, 'more gap')}" if len(rows) > 1 else ""
    return [
        f"{recording.path}: gap of {recording.time[first] - recording.time[first - 1]:.4g} s after row {first}"
        f"{more}: the finger runs over it like an FMU, and a gap is no free time"
    ]


# --- runs -------------------------------------------------------------------------------------------------------------


def _read_model(source: FingerSource) -> tuple[Finger, Path | None]:
    """Read a finger, or an FMU with the description it was made of. Raises InputError."""
    if not isinstance(source, str | os.PathLike):
        return read_finger(source), None
    model = finger_file(source)
    check_model(model)
    finger = finger_of(model)
    if finger is None:
        raise InputError(f"{model}: lacks resources/finger.json; expected an FMU of `tendonfmu build`")
    return finger, None if model.suffix.lower() == ".json" else model


def run_track(
    finger: Finger, recording: Recording, kinematics: int, force: str | None = None, fmu: Path | None = None
) -> Track:
    """Run a finger, or its FMU, over a recording; `force` is the column of the sensed force (N)."""
    recording.require(finger.joints, finger.tendons, inputs_used(kinematics, watches_motors(finger.data)))
    core = _run(finger, recording, kinematics)
    packed = fmu and outputs_of(run_fmu(fmu, recording, kinematics_source=kinematics))
    label = np.zeros(len(recording), dtype=bool) if recording.contact is None else recording.contact
    sensed = None if force is None else recording.others.get(force)
    residual = core["residual"].copy()  # no output of an FMU; 0 at the first sample
    residual[0] = np.nan
    return Track(recording, label, packed or core, residual, sensed)


def _run(
    finger: Finger, recording: Recording, kinematics: int, values: Mapping[str, float] | None = None
) -> dict[str, NDArray[Any]]:
    """Run a finger, with some other numbers by path."""
    instance = native.Instance(finger.image, kinematics)
    instance.set(values or {})
    with native.refusals_of(recording.path):
        return instance.run(recording.arrays())


# --- other thresholds -------------------------------------------------------------------------------------------------


def scaled_bounds(finger: Finger, factor: float) -> dict[str, float]:
    """Return every bound that decides on contact, by path, times a factor."""
    return {path: factor * each.start for path, each in finger.numbers.items() if path.startswith(BOUNDS)}


def _score_scaled(finger: Finger, tracks: Sequence[Track], kinematics: int, factor: float) -> DetectionScore:
    """Score all recordings again with scaled bounds, pooled, with only what the ROC shows."""
    values = scaled_bounds(finger, factor)
    runs = (replace(track, outputs=_run(finger, track.recording, kinematics, values)) for track in tracks)
    return pooled([run.decisions() for run in runs])


# --- the report -------------------------------------------------------------------------------------------------------


def build_report(scored: Scored) -> dict[str, Any]:
    """Return the JSON of a `ScoreReport`; numbers that are not finite become None."""
    labels = LABEL if scored.options.labels is None else scored.options.labels
    report = ScoreReport(
        **vars(scored.summary),
        format=FORMAT,
        finger=scored.finger.name,
        model=str(scored.finger.path),
        joints=scored.finger.joint_names,
        kinematics=scored.options.kinematics,
        labels=labels,
        definitions=Definitions(merged_s=MERGED, silent_s=SILENT, grace_s=GRACE),
        confidence=intervals.CONFIDENCE,
        seed=scored.options.seed,
        warnings=list(scored.warnings),
        roc=Roc(scored.roc, scored.no_roc),
        recordings=[_entry(*each) for each in zip(scored.tracks, scored.scores, scored.summaries, strict=True)],
    )
    return {"format": FORMAT, **finite(vars(report))}


def _entry(track: Track, score: DetectionScore, figures: Figures) -> ScoredRecording:
    time = track.recording.time
    return ScoredRecording(
        **vars(figures),
        path=str(track.recording.path),
        samples=len(time),
        duration_s=float(time[-1] - time[0]),
        labelled=track.recording.contact is not None,
        external_torque=track.external is not None,
        sensed_force=track.force is not None,
        mean_force=float(np.abs(track.recording.groups["tendon_force"]).mean()),
        event_list=score.events,
        false_alarm_list=[FalseAlarm(*alarm) for alarm in score.false_alarms],
    )
