"""Calibrates, diagnoses or scores every part of a hand, here or on workers; one that fails does not stop the others.

The folder of the results has a folder for each part, and what all of them share. Workers read and write it: it has to
be there for all of them under the same path.
"""

from __future__ import annotations

import filecmp
import itertools
import json
import os
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tendonfmu import calibration, diagnosis, tasks
from tendonfmu import report as reporting
from tendonfmu.commands.command import is_hand
from tendonfmu.commands.hand.description import Hand, HandPart, read_hand, with_descriptions
from tendonfmu.commands.hand.page import (
    CALIBRATION,
    DIAGNOSIS,
    HISTORY,
    PAGE,
    Kind,
    PartResult,
    PartRow,
    names_of,
    shared_warnings,
    verdict,
    write_hand_page,
)
from tendonfmu.commands.hand.recordings import split_parts
from tendonfmu.commands.hand.ssp import build_hand_ssp
from tendonfmu.commands.score import ScoreResult, ScoreWarning, score
from tendonfmu.errors import InputError
from tendonfmu.estimate import check_given_once
from tendonfmu.files import check_output_folder, whole_file, write_text
from tendonfmu.options import CalibrateOptions, DiagnoseOptions, ScoreOptions
from tendonfmu.recordings import LABEL
from tendonfmu.tasks import Job, Row

RECORDINGS = "recordings"  # folder of the split recordings
FAULT = "tendonfmu-error.txt"  # in the folder of a part: what a user sends after an internal error
Progress = Callable[[int, int], None]
Split = Mapping[str, list[str]]  # files with the recordings of each part, by its name
HAND, SSP = "hand.json", "hand.ssp"
Groups = Sequence[Sequence[Path]]  # files of three roles


@dataclass(frozen=True)
class HandOutcome:
    """What was found out about a hand, for the terminal."""

    rows: list[PartRow]
    headings: tuple[str, ...]
    verdict: str
    warnings: list[str]
    written: Mapping[Path, str]  # files with their content in words
    report: Mapping[str, Any]


def calibrate_hand(
    free: Sequence[Path],
    folder: Path,
    options: CalibrateOptions,
    scheduler: str | None,
    hand: Hand,
    progress: Progress,
) -> HandOutcome:
    """Calibrate every finger. `options.previous`: hand.json of an earlier calibration."""
    previous, groups = (
        next(iter(options.files("previous")), None),
        (free, options.files("test"), options.files("pushes")),
    )
    if previous is not None and not is_hand(previous):
        raise InputError(f"--from {previous}: no hand; expected hand.json of an earlier calibration of the hand")
    earlier = None if previous is None else read_hand(previous)
    _check(hand, groups, folder, ("a test", "one with pushes"), (HAND, SSP, PAGE))
    split = split_files(hand, groups, folder)
    with _workers(scheduler, options.jobs, hand) as client:
        results = compute_parts(calibrate_part, hand, split, folder, options, client, progress, earlier)
    descriptions = {
        result.part.name: f"{result.part.name}/{calibration.FINGER}"
        if result.report
        else os.path.relpath(result.part.finger.path, folder)
        for result in results
    }
    write_text(folder / HAND, with_descriptions(hand, descriptions))
    build_hand_ssp(read_hand(folder / HAND), folder / SSP, groups[0][0])
    files = {HAND: "the hand with the calibrated descriptions", SSP: "the FMUs of all fingers as one SSP package"}
    roles = dict(zip(("Free motion", "Test", "Pushes"), groups, strict=True))
    return _finished(hand, results, CALIBRATION, folder, roles, files)


def diagnose_hand(
    recordings: Sequence[Path],
    folder: Path,
    options: DiagnoseOptions,
    scheduler: str | None,
    history: bool,
    hand: Hand,
    progress: Progress,
) -> HandOutcome:
    """Diagnose every finger."""
    groups = (recordings, options.files("test"), options.files("reference"))
    _check(hand, groups, folder, ("a test", "the reference"), (PAGE,))
    split = split_files(hand, groups, folder)
    with _workers(scheduler, options.jobs, hand) as client:
        if history:
            results = follow_parts(hand, split, folder, options, client, progress)
        else:
            results = compute_parts(diagnose_part, hand, split, folder, options, client, progress)
    roles = dict(zip(("Recordings", "Tests", "Reference"), groups, strict=True))
    return _finished(hand, results, HISTORY if history else DIAGNOSIS, folder, roles, {})


def _workers(scheduler: str | None, jobs: int, hand: Hand) -> Any:
    """Connect to workers; compute here if one core is enough."""
    several = scheduler is not None or jobs > 1
    return tasks.workers_of(scheduler, min(jobs, len(hand.parts))) if several else nullcontext()


def _check(hand: Hand, groups: Groups, folder: Path, roles: tuple[str, str], names: Sequence[str]) -> None:
    """Check that results can be written, and that no recording is given twice."""
    first, second, third = groups
    check_given_once(first, second, roles[0])
    check_given_once([*first, *second], third, roles[1])
    check_output_folder(folder, names, [*hand.files, *first, *second, *third])


def _finished(
    hand: Hand,
    results: Sequence[PartResult],
    kind: Kind,
    folder: Path,
    roles: Mapping[str, Sequence[Path]],
    files: Mapping[str, str],
) -> HandOutcome:
    """Write the page and put everything together."""
    rows = kind.rows(hand, results)
    warnings = shared_warnings({result.part.name: (result.report or {}).get("warnings", ()) for result in results})
    own = {f"{row.name}/{row.page}": f"the page of {row.name}" for row in rows if row.page}
    write_hand_page(hand, rows, kind, folder, recordings=roles, files={**files, **own}, warnings=warnings)
    written = {folder / name: what for name, what in {PAGE: "all fingers, for a browser", **files, **own}.items()}
    of = {result.part.name: result for result in results}
    reports = {row.name: of[row.name] for row in rows if not row.reason}
    report = {
        "format": kind.format,
        "hand": hand.name,
        "verdict": verdict(rows),
        "fingers": {
            name: result.report if result.history is None else reporting.history_report(result.history)
            for name, result in reports.items()
        },
        "failed": {row.name: row.reason for row in rows if row.reason},
        "files": [str(file) for file in written],
    }
    return HandOutcome(rows, kind.headings, verdict(rows), warnings, written, report)


# --- recordings -------------------------------------------------------------------------------------------------------


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
    waiting = []
    for part in hand.parts:
        if previous is not None and part.name not in before:
            raise InputError(f"{previous.path}: no finger {part.name}; expected the fingers of {hand.path}")
        given = _settings(options, hand, part) | {"jobs": jobs}
        files = [of_part[part.name] for of_part in split[0]]
        own = os.path.abspath(folder / part.name)
        waiting.append(Job(part.name, (os.path.abspath(part.finger.path), files, before.get(part.name), given, own)))
    waiting = [job for job in waiting if job.name not in split[1]]
    with tempfile.TemporaryDirectory() as rows:
        tasks.run_jobs(function, waiting, Path(rows), client, progress=progress)
        done = {row["name"]: row for row in tasks.rows_of(waiting, Path(rows))} | _rows_of_split(split[1])
    _refuse_if_all_failed(hand, done)
    return [_result(part, done[part.name], folder) for part in hand.parts]


def _settings(options: CalibrateOptions | DiagnoseOptions | ScoreOptions, hand: Hand, part: HandPart) -> dict[str, Any]:
    """Return the options for a part."""
    others = ("folder", "previous", "progress", "pushes", "reference", "test")  # of the whole hand
    return options.without(*others) | {"kinematics": hand.kinematics(part, options.kinematics)}


def _each_part(
    hand: Hand, failed: Mapping[str, str], compute: Callable[[HandPart], Any], progress: Progress
) -> tuple[dict[str, Any], dict[str, Row]]:
    """Call a function here for each part that has recordings. Return the results, and the rows of failed parts."""
    results, rows = {}, _rows_of_split(failed)
    for k, part in enumerate(hand.parts):
        try:
            if part.name not in rows:
                results[part.name] = compute(part)
        except Exception as wrong:  # the others continue; the row reports the error
            rows[part.name] = tasks.failed_row(part.name, wrong)
        progress(k + 1, len(hand.parts))
    if not results:
        _refuse_if_all_failed(hand, rows)
    return results, rows


def _rows_of_split(failed: Mapping[str, str]) -> dict[str, Row]:
    """Return the rows of parts that have no recordings."""
    return {name: {"name": name, "error": reason, "fault": ""} for name, reason in failed.items()}


def _refuse_if_all_failed(hand: Hand, rows: Mapping[str, Row]) -> None:
    """Raise an error of one of the parts, with its name, if all failed."""
    named = [row | {"error": f"{name}: {row['error']}"} if row["error"] else row for name, row in rows.items()]
    tasks.refuse_if_all_failed(named, f"{hand.path}: no finger could be done")


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
    return tasks.fault_words(row, report)


def calibrate_part(
    finger: str, files: Sequence[Sequence[str]], previous: str | None, options: Mapping[str, Any], folder: str
) -> dict[str, Any]:
    """Calibrate a finger and write its folder. files: free motion, tests, pushes."""
    free, tests, pushes = files
    given = CalibrateOptions(**options, test=tests, pushes=pushes, previous=previous)
    calibrated = calibration.calibrate(finger, free, folder, given)
    calibration.write_calibration(calibrated, Path(folder))
    return {"report": calibration.REPORT}


def diagnose_part(
    finger: str, files: Sequence[Sequence[str]], previous: None, options: Mapping[str, Any], folder: str
) -> dict[str, Any]:
    """Diagnose a finger and write its folder. files: recordings, tests, references."""
    now, tests, reference = files
    reporting.write_diagnosis(
        diagnosis.diagnose(finger, now, tests, reference=reference or None, **options), Path(folder)
    )
    return {"report": reporting.REPORT}


def follow_parts(
    hand: Hand,
    split: tuple[Sequence[Split], Mapping[str, str]],
    folder: Path,
    options: DiagnoseOptions,
    client: Any,
    progress: Progress,
) -> list[PartResult]:
    """Follow the changes of every part (`diagnose --history`). split: of recordings, tests, references."""

    def follow(part: HandPart) -> diagnosis.History:
        given, own = _settings(options, hand, part), folder / part.name
        given.pop("jobs")
        now, _, reference = (of_part[part.name] for of_part in split[0])
        history = diagnosis.diagnose_history(part.finger, now, reference, rows=own, client=client, **given)
        reporting.write_history(history, names_of(part), own)
        return history

    histories, failed = _each_part(hand, split[1], follow, progress)
    rows = {part.name: failed.get(part.name, {"name": part.name, "error": ""}) for part in hand.parts}
    return [replace(_result(part, rows[part.name], folder), history=histories.get(part.name)) for part in hand.parts]


# --- score ------------------------------------------------------------------------------------------------------------


def score_hand(
    hand: Hand, files: Sequence[Path], options: ScoreOptions, progress: Progress
) -> tuple[dict[str, ScoreResult], dict[str, str]]:
    """Score every part over recordings of the hand. Returns scores, and the reasons of parts that failed, by name."""
    others = [name for name in (options.labels, options.force) if name not in (None, LABEL)]
    split = [split_parts(hand, file, others) for file in files]

    def compute(part: HandPart) -> ScoreResult:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ScoreWarning)  # in the result
            given = [recordings[part.name] for recordings, _ in split]
            return score(part.finger, given, **_settings(options, hand, part))

    scores, rows = _each_part(
        hand, {name: why for _, failed in split for name, why in failed.items()}, compute, progress
    )
    return scores, {name: _reason(row, Path(f"tendonfmu-error-{name}.txt")) for name, row in rows.items()}
