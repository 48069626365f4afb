"""The score of a finger on labelled recordings: what the command `tendonfmu score` computes."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from tendonfmu.detect.counting import DetectionScore, pooled
from tendonfmu.detect.run import Subject, Track, read_subject, run_track, score_scaled
from tendonfmu.detect.score_report import Scored
from tendonfmu.detect.summary import FACTORS, RocPoint, roc, summarise
from tendonfmu.errors import InputError
from tendonfmu.estimate import check_given_once
from tendonfmu.files import check_output, check_output_folder, counted
from tendonfmu.model import FingerSource
from tendonfmu.recordings import GROUP_PER, LABEL, Recording, RecordingSource, gaps, listed_sources, read_recordings

Progress = Callable[[int, int], None]

NO_ROC_OF_FMU = "an FMU was scored: its thresholds are as packed; score FINGER.json for the ROC"


def check_outputs(output: Path, figures: Path | None, inputs: Sequence[Path]) -> None:
    """Check that the results can be written, before a long computation."""
    if output.suffix.lower() != ".json":
        raise InputError(f"{output}: expected a name that ends in .json")
    check_output(output, *inputs)
    if figures is not None:
        check_output_folder(figures)


def score_recordings(
    model: FingerSource,
    recordings: RecordingSource | Sequence[RecordingSource],
    *,
    labels: str | None = None,
    force: str | None = None,
    kinematics: int = 1,
    seed: int = 0,
    progress: Progress | None = None,
) -> Scored:
    """Score a finger, or its FMU, on recordings."""
    # force: (N)
    sources = listed_sources(recordings)
    check_given_once(sources, [])
    subject = read_subject(model)
    column = LABEL if labels is None else labels
    read = _read(sources, column, force)
    if not read:
        raise InputError("no recording; expected at least one")
    warnings = [*_unlabelled(read, labels), *_without_force(read, force)]
    total = len(read) + (0 if subject.packed else len(FACTORS) * len(read))
    tracks: list[Track] = []
    for recording in read:
        tracks.append(run_track(subject, recording, kinematics, force))
        warnings += _gaps(recording)
        if progress is not None:
            progress(len(tracks), total)
    scores = [track.score() for track in tracks]
    summary = summarise(pooled(scores), seed)
    no_roc = NO_ROC_OF_FMU if subject.packed else None
    return Scored(
        subject=subject,
        kinematics=kinematics,
        labels=column,
        seed=seed,
        tracks=tracks,
        scores=scores,
        summaries=[summarise(score, seed) for score in scores],
        summary=summary,
        roc=None if no_roc else _roc(subject, tracks, kinematics, progress),
        no_roc=no_roc,
        warnings=[*warnings, *([] if summary.events else [f"no event in column {column}: false alarms only"])],
    )


def _roc(subject: Subject, tracks: Sequence[Track], kinematics: int, progress: Progress | None) -> list[RocPoint]:
    done = len(tracks)
    total = len(tracks) * (1 + len(FACTORS))

    def score_at(factor: float) -> DetectionScore:
        nonlocal done
        found = score_scaled(subject, tracks, kinematics, factor)
        done += len(tracks)
        if progress is not None:
            progress(done, total)
        return found

    return roc(score_at)


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


def _unlabelled(read: Sequence[Recording], labels: str | None) -> list[str]:
    """Report the recordings without a label. Raises InputError if a named column is in none."""
    without = [str(recording.path) for recording in read if recording.contact is None]
    if labels is not None and len(without) == len(read):
        raise InputError(f"{', '.join(without)}: no column {labels}; expected a label, 0 or 1, in at least one")
    return [f"{path}: no column {labels or LABEL}: the whole recording counts as free of contact" for path in without]


def _without_force(read: Sequence[Recording], force: str | None) -> list[str]:
    if force is None:
        return []
    without = [str(recording.path) for recording in read if force not in recording.others]
    if len(without) == len(read):
        raise InputError(f"{', '.join(without)}: no column {force}; expected the sensed force (N) in at least one")
    return [f"{path}: no column {force}: no sensed force" for path in without]


def _gaps(recording: Recording) -> list[str]:
    found = gaps(recording.time)
    if not found:
        return []
    first = found[0]
    more = f", and {counted(len(found) - 1, 'more gap')}" if len(found) > 1 else ""
    return [
        f"{recording.path}: gap of {recording.time[first] - recording.time[first - 1]:.4g} s after row {first}"
        f"{more}: the finger runs over it like an FMU, and a gap is no free time"
    ]
