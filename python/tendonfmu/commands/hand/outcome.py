"""Calibrates or diagnoses a hand into a folder: a folder for each finger, and what all of them share."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tendonfmu.calibration import FINGER
from tendonfmu.commands.command import is_hand
from tendonfmu.commands.hand.description import Hand, read_hand, with_descriptions
from tendonfmu.commands.hand.page import PAGE, verdict, write_hand_page
from tendonfmu.commands.hand.parts import (
    PartResult,
    Progress,
    calibrate_part,
    compute_parts,
    diagnose_part,
    follow_parts,
    split_files,
)
from tendonfmu.commands.hand.report import CALIBRATION, DIAGNOSIS, HISTORY, Kind, PartRow, shared_warnings
from tendonfmu.commands.hand.ssp import build_hand_ssp
from tendonfmu.errors import InputError
from tendonfmu.estimate import check_given_once
from tendonfmu.files import check_output_folder, write_text
from tendonfmu.options import CalibrateOptions, DiagnoseOptions
from tendonfmu.report import history_report
from tendonfmu.tasks import workers_of

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
        result.part.name: f"{result.part.name}/{FINGER}"
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
    return workers_of(scheduler, min(jobs, len(hand.parts))) if several else nullcontext()


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
            name: result.report if result.history is None else history_report(result.history)
            for name, result in reports.items()
        },
        "failed": {row.name: row.reason for row in rows if row.reason},
        "files": [str(file) for file in written],
    }
    return HandOutcome(rows, kind.headings, verdict(rows), warnings, written, report)
