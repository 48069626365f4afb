"""The score of a finger, or its FMU, on labelled recordings: runs, decisions, and runs with other thresholds."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.detect.counting import DetectionScore, Signals, pooled, score_detection
from tendonfmu.detect.free_motion import sensed_contact
from tendonfmu.detect.summary import FACTORS, RocPoint, Summary, roc, summarise
from tendonfmu.errors import InputError
from tendonfmu.estimate import check_given_once
from tendonfmu.files import counted
from tendonfmu.fmu import check_model, outputs_of, run_fmu
from tendonfmu.model import Finger, FingerSource, finger_file, inputs_used, native, read_finger, watches_motors
from tendonfmu.options import ScoreOptions
from tendonfmu.recordings import GROUP_PER, LABEL, Recording, RecordingSource, gaps, listed_sources, read_recordings

Progress = Callable[[int, int], None]

USUAL = ScoreOptions()
THRESHOLDS = ("threshold", "threshold_per_force")


@dataclass(frozen=True)
class Subject:
    """What is scored."""

    path: Path  # file as given, or the name of a finger in memory
    finger: Finger  # its description
    packed: bool  # whether the file is an FMU; then the FMU runs


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

    subject: Subject  # what was scored
    options: ScoreOptions
    tracks: Sequence[Track]  # by recording
    scores: Sequence[DetectionScore]
    summaries: Sequence[Summary]
    summary: Summary  # summary of all recordings together
    roc: Sequence[RocPoint] | None  # points of the ROC; None for an FMU
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
    subject = read_subject(model)
    column = LABEL if options.labels is None else options.labels
    read = _read(sources, column, options.force)
    if not read:
        raise InputError("no recording; expected at least one")
    read, warnings = _labelled(read, options.labels)
    warnings += _without_force(read, options.force)
    factors = () if subject.packed else FACTORS
    done, total = 0, len(read) * (1 + len(factors))

    def count(runs: int) -> None:
        nonlocal done
        done += runs
        if progress is not None:
            progress(done, total)

    def score_at(factor: float) -> DetectionScore:
        score = score_scaled(subject, tracks, options.kinematics, factor)
        count(len(tracks))
        return score

    tracks: list[Track] = []
    for recording in read:
        tracks.append(run_track(subject, recording, options.kinematics, options.force))
        warnings += _gaps(recording)
        count(1)
    scores = [track.score() for track in tracks]
    summary = summarise(pooled(scores), options.seed)
    return Scored(
        subject=subject,
        options=options,
        tracks=tracks,
        scores=scores,
        summaries=[summarise(score, options.seed) for score in scores],
        summary=summary,
        roc=None if subject.packed else roc(score_at),
        warnings=[
            *warnings,
            *([] if summary.events else [f"no event in column {column}: false alarms only"]),
            *_opposed(summary, subject.finger.joint_names),
        ],
    )


def _opposed(summary: Summary, joints: Sequence[str]) -> list[str]:
    """Warn if the estimated torque falls where that of the reference sensor rises."""
    slopes = [] if summary.contact is None else summary.contact.slope
    names = [name for name, slope in zip(joints, slopes, strict=False) if slope.high < 0.0]
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


def read_subject(source: FingerSource) -> Subject:
    """Read a finger, or an FMU with the description it was made of. Raises InputError."""
    if not isinstance(source, str | os.PathLike):
        finger = read_finger(source)
        return Subject(finger.path, finger, packed=False)
    model = finger_file(source)
    check_model(model)
    if model.suffix.lower() == ".json":
        return Subject(model, read_finger(model), packed=False)
    try:
        with zipfile.ZipFile(model) as archive:
            text = archive.read("resources/finger.json")
    except (OSError, zipfile.BadZipFile):
        raise InputError(f"{model}: not an FMU; expected FINGER.json or FINGER.fmu") from None
    except KeyError:
        raise InputError(f"{model}: lacks resources/finger.json; expected an FMU of `tendonfmu build`") from None
    try:
        native.image_from_json(text)
        return Subject(model, Finger(model, json.loads(text)), packed=True)
    except ValueError as refused:
        raise InputError(f"{model}: resources/finger.json: {refused}") from None


def run_track(subject: Subject, recording: Recording, kinematics: int, force: str | None) -> Track:
    """Run the subject over a recording."""
    # force: (N)
    data = subject.finger.data
    joints, tendons = len(data["joints"]), len(data["tendons"])
    recording.require(joints, tendons, inputs_used(kinematics, watches_motors(data)))
    core = _run(subject.finger.image, recording, kinematics)
    packed = subject.packed and outputs_of(run_fmu(subject.path, recording, kinematics_source=kinematics))
    label = np.zeros(len(recording), dtype=bool) if recording.contact is None else recording.contact
    sensed = None if force is None else recording.others.get(force)
    residual = core["residual"].copy()  # no output of an FMU; 0 at the first sample
    residual[0] = np.nan
    return Track(recording, label, packed or core, residual, sensed)


def _run(image: bytes, recording: Recording, kinematics: int) -> dict[str, NDArray[Any]]:
    try:
        return native.Instance(image, kinematics).run(recording.arrays())
    except native.NativeError as refused:
        raise InputError(f"{recording.path}: {refused}") from None


# --- other thresholds -------------------------------------------------------------------------------------------------


def scaled_detection(data: Data, factor: float) -> dict[str, Any]:
    """Return the description with every bound that decides on contact times a factor."""
    contact = {**data["contact"], **_scaled(data["contact"], THRESHOLDS, factor)}
    if contact.get("bands") is not None:
        contact["bands"] = [_scaled(band, tuple(band), factor) for band in contact["bands"]]
    return {**data, "contact": contact}


def _scaled(part: Mapping[str, Any], keys: Sequence[str], factor: float) -> dict[str, Any]:
    return {key: [factor * each for each in part[key]] for key in keys if part.get(key) is not None}


def score_scaled(subject: Subject, tracks: Sequence[Track], kinematics: int, factor: float) -> DetectionScore:
    """Score all recordings again with scaled detection, pooled, with only what the ROC shows."""
    image = native.image_from_json(json.dumps(scaled_detection(subject.finger.data, factor)))
    runs = (replace(track, outputs=_run(image, track.recording, kinematics)) for track in tracks)
    return pooled([run.decisions() for run in runs])
