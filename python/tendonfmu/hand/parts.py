"""Calibrates, diagnoses or scores every part of a hand, here or on workers; one that fails does not stop the others.

Workers read and write the folder of the results, which has to be there for all of them under the same path.
"""

from __future__ import annotations

import filecmp
import itertools
import json
import os
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tendonfmu.calibration import REPORT as CALIBRATION
from tendonfmu.calibration import calibrate, write_calibration
from tendonfmu.diagnosis import History, Names, diagnose, diagnose_history
from tendonfmu.errors import InputError, InternalError
from tendonfmu.files import whole_file
from tendonfmu.hand.description import Hand, HandPart
from tendonfmu.hand.recordings import split_recording
from tendonfmu.interface import ScoreResult, ScoreWarning, score
from tendonfmu.options import CalibrateOptions, DiagnoseOptions, ScoreOptions
from tendonfmu.recordings import LABEL
from tendonfmu.report import REPORT as DIAGNOSIS
from tendonfmu.report import write_diagnosis, write_history
from tendonfmu.tasks import Job, rows_of, run_jobs

RECORDINGS = "recordings"  # folder of the split recordings
REFUSALS = ("InputError", "OutputError", "NothingLeftError")
Progress = Callable[[int, int], None]
Split = Mapping[str, list[str]]  # files with the recordings of each part, by its name


@dataclass(frozen=True)
class PartResult:
    """What became of a part."""

    part: HandPart
    report: Mapping[str, Any] | None  # as its own command writes it; None if it failed
    reason: str = ""  # why it failed
    history: History | None = None


def split_files(hand: Hand, groups: Sequence[Sequence[Path]], folder: Path) -> list[Split]:
    """Write the recordings of the parts into a folder; all files are checked before the first one is written."""
    for file in itertools.chain(*groups):
        split_recording(hand, file)
    taken: set[str] = set()
    return [_split(hand, files, folder / RECORDINGS, taken) for files in groups]


def _split(hand: Hand, files: Sequence[Path], folder: Path, taken: set[str]) -> Split:
    of_part: dict[str, list[str]] = {part.name: [] for part in hand.parts}
    for file in files:
        names = itertools.chain([file.stem], (f"{file.stem}_{k}" for k in itertools.count(2)))
        name = next(name for name in names if name not in taken)
        taken.add(name)
        for part, recording in split_recording(hand, file).items():
            target = folder / part / f"{name}.parquet"
            target.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory() as scratch:
                made = Path(scratch) / target.name
                recording.write(made)
                # a file that is the same keeps its time, by which finished work is known
                if not (target.is_file() and filecmp.cmp(made, target, shallow=False)):
                    with whole_file(target) as temporary:
                        temporary.write_bytes(made.read_bytes())
            of_part[part].append(os.path.abspath(target))
    return of_part


# --- calibrate and diagnose -------------------------------------------------------------------------------------------


def compute_parts(
    function: Callable[..., dict[str, Any]],
    hand: Hand,
    split: Sequence[Split],
    folder: Path,
    options: CalibrateOptions | DiagnoseOptions,
    client: Any,
    progress: Progress,
    previous: Hand | None = None,
) -> list[PartResult]:
    """Call `calibrate_part` or `diagnose_part` for every part, in a folder of its own."""
    before = {} if previous is None else {part.name: os.path.abspath(part.finger.path) for part in previous.parts}
    jobs = options.jobs if client is None else max(1, options.jobs // len(hand.parts))  # of each, if all run at once
    tasks = []
    for part in hand.parts:
        if previous is not None and part.name not in before:
            raise InputError(f"{previous.path}: no finger {part.name}; expected the fingers of {hand.path}")
        given = vars(options) | {"kinematics": hand.kinematics(part, options.kinematics), "jobs": jobs}
        files = [of_part[part.name] for of_part in split]
        own = os.path.abspath(folder / part.name)
        tasks.append(Job(part.name, (os.path.abspath(part.finger.path), files, before.get(part.name), given, own)))
    with tempfile.TemporaryDirectory() as rows:
        run_jobs(function, tasks, Path(rows), client, progress=progress)
        done = rows_of(tasks, Path(rows))
    return _some([_result(part, row, folder) for part, row in zip(hand.parts, done, strict=True)], hand)


def _result(part: HandPart, row: Mapping[str, Any], folder: Path) -> PartResult:
    """Read the report of a part. Raises InternalError if it failed for a fault of tendonfmu."""
    if not row["error"]:
        return PartResult(part, json.loads((folder / part.name / row["report"]).read_text(encoding="utf-8")))
    kind, _, reason = row["error"].partition(": ")
    if kind not in REFUSALS:
        raise InternalError(f"{part.name}: {row['error']}")
    return PartResult(part, None, reason.replace(f"{os.path.abspath(folder)}{os.sep}", ""))


def _some(results: list[PartResult], hand: Hand) -> list[PartResult]:
    """Refuse results of which every one failed."""
    if all(result.report is None for result in results):
        raise InputError(f"{hand.path}: no finger could be done; {results[0].part.name}: {results[0].reason}")
    return results


def calibrate_part(
    finger: str, files: Sequence[Sequence[str]], previous: str | None, options: Mapping[str, Any], folder: str
) -> dict[str, Any]:
    """Calibrate a finger and write its folder. files: free motion, tests, pushes."""
    free, tests, pushes = files
    calibration = calibrate(
        finger, free, folder, tests=tests, pushes=pushes, previous=previous, options=CalibrateOptions(**options)
    )
    write_calibration(calibration, Path(folder))
    return {"report": CALIBRATION}


def diagnose_part(
    finger: str, files: Sequence[Sequence[str]], previous: None, options: Mapping[str, Any], folder: str
) -> dict[str, Any]:
    """Diagnose a finger and write its folder. files: recordings, tests, references."""
    now, tests, reference = files
    write_diagnosis(diagnose(finger, now, tests, reference=reference or None, **options), Path(folder))
    return {"report": DIAGNOSIS}


def follow_parts(
    hand: Hand, split: Sequence[Split], folder: Path, options: DiagnoseOptions, client: Any, progress: Progress
) -> list[PartResult]:
    """Follow the changes of every part (`diagnose --history`). split: recordings, tests, references."""
    results = []
    for k, part in enumerate(hand.parts):
        given = vars(options) | {"kinematics": hand.kinematics(part, options.kinematics)}
        given.pop("jobs")
        now, _, reference = (of_part[part.name] for of_part in split)
        own = folder / part.name
        try:
            history = diagnose_history(part.finger, now, reference, rows=own, client=client, **given)
        except InputError as refused:
            results.append(PartResult(part, None, str(refused)))
        else:
            failed = history.failed[0][1] if history.failed and not history.recordings else ""
            results.append(PartResult(part, None if failed else {}, failed, history))
            if not failed:
                write_history(history, Names(tuple(part.finger.joint_names), tuple(part.finger.tendon_names)), own)
        progress(k + 1, len(hand.parts))
    return _some(results, hand)


# --- score ------------------------------------------------------------------------------------------------------------


def score_hand(
    hand: Hand, files: Sequence[Path], options: ScoreOptions, progress: Progress
) -> tuple[dict[str, ScoreResult], dict[str, str]]:
    """Score every part over recordings of the hand. Returns scores, and the reasons of parts that failed, by name."""
    others = [name for name in (options.labels, options.force) if name not in (None, LABEL)]
    split = [split_recording(hand, file, others) for file in files]
    scores, failed = {}, {}
    for k, part in enumerate(hand.parts):
        given = vars(options) | {"kinematics": hand.kinematics(part, options.kinematics)}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ScoreWarning)  # in the result
                scores[part.name] = score(part.finger, [recordings[part.name] for recordings in split], **given)
        except InputError as refused:
            failed[part.name] = str(refused)
        progress(k + 1, len(hand.parts))
    if not scores:
        raise InputError(f"{hand.path}: no finger could be done; {next(iter(failed.values()))}")
    return scores, failed
