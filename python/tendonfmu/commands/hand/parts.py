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
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tendonfmu.calibration import REPORT as CALIBRATION
from tendonfmu.calibration import calibrate, write_calibration
from tendonfmu.commands.hand.description import Hand, HandPart
from tendonfmu.commands.hand.recordings import split_parts
from tendonfmu.commands.score import ScoreResult, ScoreWarning, score
from tendonfmu.diagnosis import History, Names, diagnose, diagnose_history
from tendonfmu.errors import InputError
from tendonfmu.files import whole_file, write_text
from tendonfmu.options import CalibrateOptions, DiagnoseOptions, ScoreOptions
from tendonfmu.recordings import LABEL
from tendonfmu.report import REPORT as DIAGNOSIS
from tendonfmu.report import write_diagnosis, write_history
from tendonfmu.tasks import Job, Row, failed_row, fault_words, refuse_if_all_failed, rows_of, run_jobs

RECORDINGS = "recordings"  # folder of the split recordings
FAULT = "tendonfmu-error.txt"  # in the folder of a part: what a user sends after an internal error
Progress = Callable[[int, int], None]
Split = Mapping[str, list[str]]  # files with the recordings of each part, by its name


@dataclass(frozen=True)
class PartResult:
    """What became of a part."""

    part: HandPart
    report: Mapping[str, Any] | None  # as its own command writes it; None if it failed
    reason: str = ""  # why it failed
    history: History | None = None


def split_files(hand: Hand, groups: Sequence[Sequence[Path]], folder: Path) -> tuple[list[Split], dict[str, str]]:
    """Write the recordings of the parts, if all files can be read. Return them, and why a part has none."""
    failed: dict[str, str] = {}
    for file in itertools.chain(*groups):
        failed = split_parts(hand, file)[1] | failed
    taken: set[str] = set()
    return [_split(hand, files, folder / RECORDINGS, taken, failed) for files in groups], failed


def _split(hand: Hand, files: Sequence[Path], folder: Path, taken: set[str], failed: Mapping[str, str]) -> Split:
    of_part: dict[str, list[str]] = {part.name: [] for part in hand.parts}
    for file in files:
        names = itertools.chain([file.stem], (f"{file.stem}_{k}" for k in itertools.count(2)))
        name = next(name for name in names if name not in taken)
        taken.add(name)
        recordings = split_parts(hand, file)[0]
        for part in recordings.keys() - failed.keys():
            target = folder / part / f"{name}.parquet"
            target.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory() as scratch:
                made = Path(scratch) / target.name
                recordings[part].write(made)
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
    split: tuple[Sequence[Split], Mapping[str, str]],
    folder: Path,
    options: CalibrateOptions | DiagnoseOptions,
    client: Any,
    progress: Progress,
    previous: Hand | None = None,
) -> list[PartResult]:
    """Call `calibrate_part` or `diagnose_part` for every part, in a folder of its own. split: of `split_files`."""
    before = {} if previous is None else {part.name: os.path.abspath(part.finger.path) for part in previous.parts}
    jobs = options.jobs if client is None else max(1, options.jobs // len(hand.parts))  # of each, if all run at once
    tasks = []
    for part in hand.parts:
        if previous is not None and part.name not in before:
            raise InputError(f"{previous.path}: no finger {part.name}; expected the fingers of {hand.path}")
        given = _settings(options, hand, part) | {"jobs": jobs}
        files = [of_part[part.name] for of_part in split[0]]
        own = os.path.abspath(folder / part.name)
        tasks.append(Job(part.name, (os.path.abspath(part.finger.path), files, before.get(part.name), given, own)))
    tasks = [task for task in tasks if task.name not in split[1]]
    with tempfile.TemporaryDirectory() as rows:
        run_jobs(function, tasks, Path(rows), client, progress=progress)
        done = {row["name"]: row for row in rows_of(tasks, Path(rows))} | _rows_of_split(split[1])
    refuse_if_all_failed(_named(done.values()), f"{hand.path}: no finger could be done")
    return [_result(part, done[part.name], folder) for part in hand.parts]


def _settings(options: CalibrateOptions | DiagnoseOptions | ScoreOptions, hand: Hand, part: HandPart) -> dict[str, Any]:
    """Return the options for a part."""
    others = ("folder", "previous", "progress", "pushes", "reference", "test")  # of the whole hand
    return options.without(*others) | {"kinematics": hand.kinematics(part, options.kinematics)}


def _rows_of_split(failed: Mapping[str, str]) -> dict[str, Row]:
    """Return the rows of parts that have no recordings."""
    return {name: {"name": name, "error": reason, "fault": ""} for name, reason in failed.items()}


def _named(rows: Iterable[Row]) -> list[Row]:
    """Return rows whose errors begin with the name of the part."""
    return [row | {"error": f"{row['name']}: {row['error']}"} if row["error"] else row for row in rows]


def _result(part: HandPart, row: Row, folder: Path) -> PartResult:
    """Read the report of a part, or say why it has none."""
    (folder / part.name / FAULT).unlink(missing_ok=True)
    if row["error"]:
        return PartResult(
            part, None, _reason(row, folder / part.name / FAULT).replace(f"{folder.absolute()}{os.sep}", "")
        )
    report = (folder / part.name / row["report"]).read_text(encoding="utf-8") if "report" in row else "{}"
    return PartResult(part, json.loads(report))


def _reason(row: Row, report: Path) -> str:
    """Return why a part failed. If tendonfmu is at fault, write what is to be sent."""
    if row["fault"]:
        report.parent.mkdir(parents=True, exist_ok=True)
        write_text(report, row["fault"])
    return fault_words(row, report)


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
    hand: Hand,
    split: tuple[Sequence[Split], Mapping[str, str]],
    folder: Path,
    options: DiagnoseOptions,
    client: Any,
    progress: Progress,
) -> list[PartResult]:
    """Follow the changes of every part (`diagnose --history`). split: of recordings, tests, references."""
    rows, histories = _rows_of_split(split[1]), dict[str, History]()
    for k, part in enumerate(hand.parts):
        given = _settings(options, hand, part)
        given.pop("jobs")
        now, _, reference = (of_part[part.name] for of_part in split[0])
        own = folder / part.name
        try:
            if part.name not in rows:
                history = diagnose_history(part.finger, now, reference, rows=own, client=client, **given)
                write_history(history, Names(tuple(part.finger.joint_names), tuple(part.finger.tendon_names)), own)
                histories[part.name], rows[part.name] = history, {"name": part.name, "error": ""}
        except Exception as failed:  # the others continue; the row reports the error
            rows[part.name] = failed_row(part.name, failed)
        progress(k + 1, len(hand.parts))
    refuse_if_all_failed(_named(rows.values()), f"{hand.path}: no finger could be done")
    return [replace(_result(part, rows[part.name], folder), history=histories.get(part.name)) for part in hand.parts]


# --- score ------------------------------------------------------------------------------------------------------------


def score_hand(
    hand: Hand, files: Sequence[Path], options: ScoreOptions, progress: Progress
) -> tuple[dict[str, ScoreResult], dict[str, str]]:
    """Score every part over recordings of the hand. Returns scores, and the reasons of parts that failed, by name."""
    others = [name for name in (options.labels, options.force) if name not in (None, LABEL)]
    split = [split_parts(hand, file, others) for file in files]
    scores, rows = {}, _rows_of_split({name: why for _, failed in split for name, why in failed.items()})
    for k, part in enumerate(hand.parts):
        given = _settings(options, hand, part)
        try:
            if part.name not in rows:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", ScoreWarning)  # in the result
                    scores[part.name] = score(part.finger, [recordings[part.name] for recordings, _ in split], **given)
        except Exception as failed:  # the others continue
            rows[part.name] = failed_row(part.name, failed)
        progress(k + 1, len(hand.parts))
    if not scores:
        refuse_if_all_failed(_named(rows.values()), f"{hand.path}: no finger could be done")
    return scores, {name: _reason(row, Path(f"tendonfmu-error-{name}.txt")) for name, row in rows.items()}
