"""What `check`, `run`, `score`, `calibrate` and `diagnose` do with a hand: the same with each finger, and one table.

The folder of the results has a folder for each finger. Workers read and write it: it has to be there for all of them
under the same path. A finger that fails does not stop the others.
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
from pathlib import Path
from typing import Any

import typer

from tendonfmu import calibration, diagnosis, estimate, files, model, tasks
from tendonfmu import recordings as recorded
from tendonfmu import report as reporting
from tendonfmu.commands import console
from tendonfmu.commands.check import show_whether_it_belongs
from tendonfmu.commands.command import is_hand
from tendonfmu.commands.detection import ScoreWarning, score
from tendonfmu.commands.hand import results as pages
from tendonfmu.commands.hand.description import Hand, HandPart, read_hand
from tendonfmu.commands.hand.recordings import run_hand as run_fingers
from tendonfmu.commands.hand.recordings import split_parts
from tendonfmu.commands.hand.results import build_hand_ssp
from tendonfmu.errors import InputError
from tendonfmu.options import CalibrateOptions, DiagnoseOptions, RunOptions, ScoreOptions

RECORDINGS = "recordings"  # folder of the split recordings
FAULT = "tendonfmu-error-{}.txt"  # what a user sends after an internal error of a finger
HAND, SSP = "hand.json", "hand.ssp"
OF_HAND = ("folder", "previous", "progress", "pushes", "reference", "test")  # options that no finger takes as they are

Row = dict[str, Any]
Split = dict[str, list[list[str]]]  # files with the recordings of each finger, a list for each role
Groups = Mapping[str, Sequence[Path]]  # role in words -> the hand's recordings


def check_hand(file: Path, recordings: Sequence[Path] | None = None, progress: bool | None = None) -> None:
    """Print what a hand is, and whether recordings belong to each of its fingers."""
    for recording in recordings or []:
        files.check_format(recording)
    head = {"format": "tendonfmu-hand-check-1", "hand": str(file)}
    try:
        hand = read_hand(file)
    except InputError as refused:
        reason = str(refused)
        console.print_json(lambda: {**head, "sound": False, "reason": reason})
        console.fail(reason)
        raise typer.Exit(console.NO) from None
    for line in hand.summary():
        console.show(line)
    split = [(str(recording), *split_parts(hand, recording)) for recording in recordings or []]
    reports = {}
    with console.progress_bar("fingers", progress if split else False, total=len(hand.parts)) as show_progress:
        for number, part in enumerate(hand.parts, start=1):
            # at a shared wrist a finger's tendons need not be in balance alone
            all_findings = model.description_findings(part.finger)
            findings = [finding for finding in all_findings if finding.kind != "moment_arms" or not part.shared]
            for finding in findings:
                console.warn(f"{part.name}: {finding.line()}")
            checked = [_checked(part, *of_file) for of_file in split]
            about = (part.finger.path, "finger", part.finger.summary())
            reports[part.name] = recorded.check_report(*about, findings, checked)
            show_progress(number)
    console.print_json(lambda: {**head, "sound": True, "summary": hand.summary(), "fingers": reports})
    wrong = {name: [each for each in report["recordings"] if not each["belongs"]] for name, report in reports.items()}
    if strangers := [name for name, of_part in wrong.items() if of_part]:
        first = next(each["line"] for each in wrong[strangers[0]][0]["findings"] if each["severity"] == "error")
        console.fail(f"{', '.join(strangers)}: recordings do not belong to {file} as it is; the first problem: {first}")
        raise typer.Exit(console.NO)


def _checked(part: HandPart, file: str, made: Mapping[str, Any], failed: Mapping[str, str]) -> dict[str, Any]:
    """Show whether a recording belongs to a finger, and return the report on it."""
    if part.name not in failed:
        return show_whether_it_belongs(part.finger, made[part.name])
    console.show(failed[part.name])
    return {"file": file, "belongs": False, "findings": [{"severity": "error", "line": failed[part.name]}]}


def run_hand(
    model: Path,
    recording: Path,
    output: Path,
    options: RunOptions,
    report: Path | None = None,
    progress: bool | None = None,
) -> None:
    """Run all fingers over a recording and write one table."""
    if report is not None:
        raise InputError(f"{model}: a hand, given with --report; expected a finger, which it shows alone")
    hand, name = read_hand(model), console.name_of(output)
    console.check_table(output, recording, *hand.files)
    result = run_fingers(hand, recording, kinematics=options.kinematics)
    console.write_table(output, result.columns())
    fingers = {}
    for part in hand.parts:
        of_part, source = result.results[part.name], part.kinematics(options.kinematics)
        console.say(f"{name}: {part.name}: {of_part.summary}")
        paths = (part.finger.path, recording)
        fingers[part.name] = reporting.run_report(
            *paths, of_part.columns(), part.finger, kinematics=source, output=name
        )
    console.print_json(lambda: {"format": "tendonfmu-hand-run-1", "hand": hand.name, "fingers": fingers})


# --- a command of the hand, and its function of a finger, which may run on a worker -----------------------------------


def score_hand(
    model: Path,
    recordings: Sequence[Path],
    output: Path,
    options: ScoreOptions,
    figures: Path | None = None,
    progress: bool | None = None,
) -> None:
    """Score contact detection of all fingers and write one report."""
    hand = read_hand(model)
    estimate.check_outputs(output, None, figures, [*hand.files, *recordings])
    others = [name for name in (options.labels, options.force) if name not in (None, recorded.LABEL)]
    split = [split_parts(hand, file, others) for file in recordings]
    failed = {name: why for _, of_file in split for name, why in of_file.items()}
    samples = {part.name: [made.get(part.name) for made, _ in split] for part in hand.parts}
    fingers = _Fingers(hand, pages.SCORE, score_part, samples, failed, options, figures, progress=progress)
    totals = {key: sum(each[key] for each in fingers.reports.values()) for key in ("events", "found", "false_alarms")}
    text = files.report_text({**fingers.head, **totals, "fingers": fingers.reports, "failed": fingers.failed})
    files.write_text(output, text)
    fingers.print([])
    console.print_json(lambda: text)
    console.say(f"{output}: {files.counted(len(fingers.reports), 'finger')}")
    console.say_files(fingers.written)


def score_part(part: HandPart, samples: Sequence[Any], options: Mapping[str, Any], folder: Path | None) -> Row:
    """Score a finger. folder: of its figures."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScoreWarning)  # in the result
        result = score(part.finger, samples, **options)
    written = {} if folder is None else reporting.write_score_figures(result.scored, folder)
    report = files.finite(dict(result.report))
    # a recording of a finger has the finger's name after it, which stands before the warning already
    sentences = [sentence.replace(f":{part.name}: ", ": ") for sentence in result.warnings]
    made = {str(file): what for file, what in written.items()}
    return {"report": report, "warnings": sentences, "row": pages.score_row(report), "written": made}


def calibrate_hand(
    finger: Path,
    recordings: Sequence[Path],
    output: Path,
    options: CalibrateOptions,
    scheduler: str | None = None,
    progress: bool | None = None,
) -> None:
    """Calibrate every finger."""
    hand, before = read_hand(finger), {}
    for previous in options.files("previous"):
        if not is_hand(previous):
            raise InputError(f"--from {previous}: no hand; expected hand.json of an earlier calibration of the hand")
        before = {part.name: {"previous": os.path.abspath(part.finger.path)} for part in read_hand(previous).parts}
        if missing := [part.name for part in hand.parts if part.name not in before]:
            raise InputError(f"{previous}: no finger {missing[0]}; expected the fingers of {hand.path}")
    groups = {"Free motion": recordings, "Test": options.files("test"), "Pushes": options.files("pushes")}
    split, failed = _split(hand, groups, output, ("a test", "one with pushes"), (HAND, SSP, pages.PAGE))
    run: dict[str, Any] = {"progress": progress, "scheduler": scheduler, "before": before}
    fingers = _Fingers(hand, pages.CALIBRATION, calibrate_part, split, failed, options, output, **run)
    made = {
        part.name: f"{part.name}/{calibration.FINGER}"
        if part.name in fingers.reports
        else os.path.relpath(part.finger.path, output)
        for part in hand.parts
    }
    files.write_text(output / HAND, hand.with_descriptions(made))
    build_hand_ssp(read_hand(output / HAND), output / SSP, recordings[0])
    written = {HAND: "the hand with the calibrated descriptions", SSP: "the FMUs of all fingers as one SSP package"}
    fingers.finish(output, groups, written)


def calibrate_part(part: HandPart, given: Sequence[Sequence[str]], options: Mapping[str, Any], folder: Path) -> Row:
    """Calibrate a finger and write its folder. given: free motion, tests, pushes."""
    free, tests, pushes = given
    settings = CalibrateOptions(**options, test=tests, pushes=pushes)
    calibration.write_calibration(calibration.calibrate(part.finger, free, folder, settings), folder)
    report = json.loads((folder / calibration.REPORT).read_text(encoding="utf-8"))
    return {"report": report, "warnings": report["warnings"], "row": pages.calibration_row(part, report)}


def diagnose_hand(
    finger: Path,
    recordings: Sequence[Path],
    output: Path,
    options: DiagnoseOptions,
    history: bool = False,
    scheduler: str | None = None,
    progress: bool | None = None,
) -> None:
    """Diagnose every finger, or follow its changes."""
    if history and options.test:
        raise InputError("--test: given with --history; expected recordings in order of time only")
    hand = read_hand(finger)
    groups = {"Recordings": recordings, "Tests": options.files("test"), "Reference": options.files("reference")}
    split, failed = _split(hand, groups, output, ("a test", "the reference"), (pages.PAGE,))
    kind, function = (pages.HISTORY, follow_part) if history else (pages.DIAGNOSIS, diagnose_part)
    run: dict[str, Any] = {"progress": progress, "scheduler": scheduler}
    _Fingers(hand, kind, function, split, failed, options, output, **run).finish(output, groups, {})


def diagnose_part(part: HandPart, given: Sequence[Sequence[str]], options: Mapping[str, Any], folder: Path) -> Row:
    """Diagnose a finger and write its folder. given: recordings, tests, references."""
    now, tests, before = given
    found = diagnosis.diagnose(part.finger, now, tests, reference=before or None, **options)
    reporting.write_diagnosis(found, folder)
    report = json.loads((folder / reporting.REPORT).read_text(encoding="utf-8"))
    return {"report": report, "warnings": report["warnings"], "row": pages.diagnosis_row(part, found)}


def follow_part(part: HandPart, given: Sequence[Sequence[str]], options: Mapping[str, Any], folder: Path) -> Row:
    """Follow the changes of a finger and write its folder. given: recordings, no tests, references."""
    settings = {name: value for name, value in options.items() if name != "jobs"}
    found = diagnosis.diagnose_history(part.finger, given[0], given[2], rows=folder, **settings)
    reporting.write_history(found, diagnosis.names_in(part.finger.data), folder)
    report = files.finite(reporting.history_report(found))
    return {"report": report, "warnings": [], "row": pages.history_row(part, found)}


# --- all fingers ------------------------------------------------------------------------------------------------------


def _split(
    hand: Hand, groups: Groups, folder: Path, roles: tuple[str, str], names: Sequence[str]
) -> tuple[Split, dict[str, str]]:
    """Write the recordings of the fingers if results can be written. Return them, and why a finger has none."""
    first, second, third = groups.values()
    estimate.check_given_once(first, second, roles[0])
    estimate.check_given_once([*first, *second], third, roles[1])
    files.check_output_folder(folder, names, [*hand.files, *first, *second, *third])
    return split_files(hand, list(groups.values()), folder / RECORDINGS)


def split_files(hand: Hand, groups: Sequence[Sequence[Path]], folder: Path) -> tuple[Split, dict[str, str]]:
    """Write the recordings of the fingers, a folder for each. Return them by finger, and why a finger has none."""
    split: Split = {part.name: [[] for _ in groups] for part in hand.parts}
    failed, taken = dict[str, str](), set[str]()
    for k, file in ((k, file) for k, group in enumerate(groups) for file in group):
        made, reasons = split_parts(hand, file)
        failed = reasons | failed
        names = itertools.chain([file.stem], (f"{file.stem}_{number}" for number in itertools.count(2)))
        name = next(name for name in names if name not in taken)
        taken.add(name)
        for part, recording in made.items():
            split[part][k].append(_written(recording, folder / part / f"{name}.parquet"))
    return split, failed


def _written(recording: recorded.Recording, target: Path) -> str:
    """Write a recording; a file that is the same keeps its time, by which finished work is known."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        made = Path(scratch) / target.name
        recording.write(made)
        if not (target.is_file() and filecmp.cmp(made, target, shallow=False)):
            files.write_bytes(target, made.read_bytes())
    return os.path.abspath(target)


class _Fingers:
    """What comes out of a function that is called for every finger that has recordings, here or on workers.

    folder: that of the results, with one of each finger. before: further options of each finger.
    """

    def __init__(
        self,
        hand: Hand,
        kind: pages.Kind,
        function: Callable[..., Row],
        split: Mapping[str, Sequence[Any]],
        failed: Mapping[str, str],
        options: CalibrateOptions | DiagnoseOptions | ScoreOptions,
        folder: Path | None,
        *,
        progress: bool | None,
        scheduler: str | None = None,
        before: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> None:
        self.head = {"format": f"tendonfmu-hand-{kind.name}-1", "hand": hand.name}
        self._hand, self._kind = hand, kind
        given, several = options.without(*OF_HAND), scheduler is not None or getattr(options, "jobs", 1) > 1
        workers = min(getattr(options, "jobs", 1), len(hand.parts))
        if "jobs" in given:  # the share of each
            given["jobs"] = max(1, given["jobs"] // len(hand.parts))

        def job(part: HandPart) -> tasks.Job:
            own = {**(before or {}).get(part.name, {}), "kinematics": part.kinematics(options.kinematics)}
            place = folder and (folder / part.name if kind is pages.SCORE else folder.absolute() / part.name)
            return tasks.Job(part.name, (part, split[part.name], given | own, place))

        waiting = [job(part) for part in hand.parts if part.name not in failed]
        with (
            tempfile.TemporaryDirectory() as scratch,
            tasks.workers_of(scheduler, workers) if several else nullcontext() as client,
            console.progress_bar("fingers", progress, total=len(hand.parts)) as show,
        ):
            tasks.run_jobs(function, waiting, Path(scratch), client, progress=show)
            done = {row["name"]: row for row in tasks.rows_of(waiting, Path(scratch))}
        done |= {name: {"name": name, "error": why, "fault": ""} for name, why in failed.items()}
        named = [row | {"error": f"{name}: {row['error']}" if row["error"] else ""} for name, row in done.items()]
        tasks.refuse_if_all_failed(named, f"{hand.path}: no finger could be done")
        place = Path() if kind is pages.SCORE or folder is None else folder
        self.failed = {name: _reason(name, row, place) for name, row in done.items() if row["error"]}
        rows = [pages.PartRow(*row["row"])._replace(name=name) for name, row in done.items() if not row["error"]]
        rows = sorted(pages.stand_out(rows) if kind is pages.CALIBRATION else rows, key=lambda row: -row.badness)
        self.reports = {row.name: done[row.name]["report"] for row in rows}
        self.written = {file: what for row in done.values() for file, what in row.get("written", {}).items()}
        self._warnings = pages.shared_warnings({name: done[name]["warnings"] for name in self.reports})
        empty = ("–",) * len(kind.headings)
        self._rows = [*rows, *(pages.PartRow("failed", -1.0, "", empty, *each) for each in self.failed.items())]

    def print(self, lines: Sequence[str]) -> None:
        """Print the table, lines, warnings, and why a finger was left out."""
        headings = self._kind.headings
        table = (self._hand.name, ("finger", *headings), [(row.name, *row.cells) for row in self._rows])
        console.print_results([table], lines, left=headings[1], warnings=self._warnings)
        for name, reason in self.failed.items():
            console.warn(f"{name}: left out: {reason}")

    def finish(self, folder: Path, groups: Groups, made: Mapping[str, str]) -> None:
        """Write the page and print everything. made: files of the hand with their content in words."""
        for name in self.reports:  # of an earlier call
            (folder / FAULT.format(name)).unlink(missing_ok=True)
        pages.write_hand_page(
            self._hand, self._rows, self._kind, folder, recordings=groups, files=made, warnings=self._warnings
        )
        own = {f"{name}/{self._kind.page}": f"the page of {name}" for name in self.reports}
        every = {pages.PAGE: "all fingers, for a browser", **made, **own}
        written = {folder / name: what for name, what in every.items()}
        verdict = pages.verdict(self._rows)
        self.print([verdict])
        console.say_files(written)
        report = {**self.head, "verdict": verdict, "fingers": self.reports, "failed": self.failed}
        console.print_json(lambda: report | {"files": [str(file) for file in written]})


def _reason(name: str, row: Row, folder: Path) -> str:
    """Return why a finger failed. If tendonfmu is at fault, write what is to be sent."""
    file = folder / FAULT.format(name)
    if row["fault"]:
        folder.mkdir(parents=True, exist_ok=True)
        files.write_text(file, row["fault"])
    return tasks.fault_words(row, file).replace(str(folder.absolute() / RECORDINGS), RECORDINGS)
