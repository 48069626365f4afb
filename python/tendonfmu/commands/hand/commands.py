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
from tendonfmu.commands.hand import page as pages
from tendonfmu.commands.hand.description import Hand, HandPart, read_hand
from tendonfmu.commands.hand.recordings import run_hand as run_fingers
from tendonfmu.commands.hand.recordings import split_parts
from tendonfmu.commands.hand.ssp import build_hand_ssp
from tendonfmu.commands.score import ScoreWarning, score
from tendonfmu.errors import InputError
from tendonfmu.options import CalibrateOptions, DiagnoseOptions, RunOptions, ScoreOptions

RECORDINGS = "recordings"  # folder of the split recordings
FAULT = "tendonfmu-error.txt"  # in the folder of a finger: what a user sends after an internal error
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
    rerun: Path | None = None,
    progress: bool | None = None,
) -> None:
    """Run all fingers over a recording and write one table."""
    for name, given in (("--rerun", rerun), ("--report", report)):
        if given is not None:
            raise InputError(f"{model}: a hand, given with {name}; expected a finger, which it shows alone")
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

    def given(part: HandPart) -> tuple[Any, ...]:
        return [made[part.name] for made, _ in split], _settings(options, hand, part), figures

    fingers = _Fingers(hand, pages.SCORE, score_part, given, failed, progress)
    totals = {key: sum(each[key] for each in fingers.reports.values()) for key in ("events", "found", "false_alarms")}
    text = files.report_text({**fingers.head(), **totals, "fingers": fingers.reports, "failed": fingers.failed})
    files.write_text(output, text)
    fingers.print([])
    console.print_json(lambda: text)
    console.say(f"{output}: {files.counted(len(fingers.reports), 'finger')}")
    console.say_files(fingers.written)


def score_part(part: HandPart, samples: Sequence[Any], options: Mapping[str, Any], figures: Path | None) -> Row:
    """Score a finger."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScoreWarning)  # in the result
        result = score(part.finger, samples, **options)
    written = {} if figures is None else reporting.write_score_figures(result.scored, figures / part.name)
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
        before = {part.name: os.path.abspath(part.finger.path) for part in read_hand(previous).parts}
        if missing := [part.name for part in hand.parts if part.name not in before]:
            raise InputError(f"{previous}: no finger {missing[0]}; expected the fingers of {hand.path}")
    groups = {"Free motion": recordings, "Test": options.files("test"), "Pushes": options.files("pushes")}
    split, failed = _split(hand, groups, output, ("a test", "one with pushes"), (HAND, SSP, pages.PAGE))

    def given(part: HandPart) -> tuple[Any, ...]:
        return (
            split[part.name],
            before.get(part.name),
            _settings(options, hand, part),
            os.path.abspath(output / part.name),
        )

    fingers = _Fingers(
        hand, pages.CALIBRATION, calibrate_part, given, failed, progress, options.jobs, scheduler, output
    )
    made = {
        part.name: f"{part.name}/{calibration.FINGER}"
        if part.name in fingers.reports
        else os.path.relpath(part.finger.path, output)
        for part in hand.parts
    }
    files.write_text(output / HAND, hand.with_descriptions(made))
    build_hand_ssp(read_hand(output / HAND), output / SSP, recordings[0])
    written = {HAND: "the hand with the calibrated descriptions", SSP: "the FMUs of all fingers as one SSP package"}
    fingers.finish(groups, written)


def calibrate_part(
    part: HandPart, given: Sequence[Sequence[str]], previous: str | None, options: Mapping[str, Any], folder: str
) -> Row:
    """Calibrate a finger and write its folder. given: free motion, tests, pushes."""
    free, tests, pushes = given
    settings = CalibrateOptions(**options, test=tests, pushes=pushes, previous=previous)
    calibration.write_calibration(calibration.calibrate(part.finger, free, folder, settings), Path(folder))
    report = json.loads((Path(folder) / calibration.REPORT).read_text(encoding="utf-8"))
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

    def given(part: HandPart) -> tuple[Any, ...]:
        return split[part.name], _settings(options, hand, part), os.path.abspath(output / part.name)

    kind, function = (pages.HISTORY, follow_part) if history else (pages.DIAGNOSIS, diagnose_part)
    _Fingers(hand, kind, function, given, failed, progress, options.jobs, scheduler, output).finish(groups, {})


def diagnose_part(part: HandPart, given: Sequence[Sequence[str]], options: Mapping[str, Any], folder: str) -> Row:
    """Diagnose a finger and write its folder. given: recordings, tests, references."""
    now, tests, before = given
    found = diagnosis.diagnose(part.finger, now, tests, reference=before or None, **options)
    reporting.write_diagnosis(found, Path(folder))
    report = json.loads((Path(folder) / reporting.REPORT).read_text(encoding="utf-8"))
    return {"report": report, "warnings": report["warnings"], "row": pages.diagnosis_row(part, found)}


def follow_part(part: HandPart, given: Sequence[Sequence[str]], options: Mapping[str, Any], folder: str) -> Row:
    """Follow the changes of a finger and write its folder. given: recordings, no tests, references."""
    settings = {name: value for name, value in options.items() if name != "jobs"}
    found = diagnosis.diagnose_history(part.finger, given[0], given[2], rows=Path(folder), **settings)
    reporting.write_history(found, pages.names_of(part), Path(folder))
    report = files.finite(reporting.history_report(found))
    return {"report": report, "warnings": [], "row": pages.history_row(part, found)}


def _settings(options: CalibrateOptions | DiagnoseOptions | ScoreOptions, hand: Hand, part: HandPart) -> dict[str, Any]:
    """Return the options for a finger, with its share of the cores."""
    given = options.without(*OF_HAND) | {"kinematics": part.kinematics(options.kinematics)}
    return given | ({"jobs": max(1, given["jobs"] // len(hand.parts))} if "jobs" in given else {})


# --- all fingers ------------------------------------------------------------------------------------------------------


def _split(
    hand: Hand, groups: Groups, folder: Path, roles: tuple[str, str], names: Sequence[str]
) -> tuple[Split, dict[str, str]]:
    """Write the recordings of the fingers if results can be written. Return them, and why a finger has none."""
    first, second, third = groups.values()
    estimate.check_given_once(first, second, roles[0])
    estimate.check_given_once([*first, *second], third, roles[1])
    every = [*first, *second, *third]
    files.check_output_folder(folder, names, [*hand.files, *every])
    return split_files(hand, list(groups.values()), folder / RECORDINGS)


def split_files(hand: Hand, groups: Sequence[Sequence[Path]], folder: Path) -> tuple[Split, dict[str, str]]:
    """Write the recordings of the fingers, a folder for each. Return them by finger, and why a finger has none."""
    split, failed = Split(), dict[str, str]()
    read = [[(file.stem, *split_parts(hand, file)) for file in group] for group in groups]
    for _, _, reasons in itertools.chain(*read):
        failed = reasons | failed
    for part in (part.name for part in hand.parts if part.name not in failed):
        taken: set[str] = set()
        split[part] = []
        for group in read:
            split[part].append([])
            for stem, made, _ in group:
                names = itertools.chain([stem], (f"{stem}_{k}" for k in itertools.count(2)))
                name = next(name for name in names if name not in taken)
                taken.add(name)
                split[part][-1].append(_written(made[part], folder / part / f"{name}.parquet"))
    return split, failed


def _written(recording: recorded.Recording, target: Path) -> str:
    """Write a recording; a file that is the same keeps its time, by which finished work is known."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        made = Path(scratch) / target.name
        recording.write(made)
        if not (target.is_file() and filecmp.cmp(made, target, shallow=False)):
            with files.whole_file(target) as temporary:
                temporary.write_bytes(made.read_bytes())
    return os.path.abspath(target)


class _Fingers:
    """What comes out of a function that is called for every finger that has recordings, here or on workers.

    folder: that of the results, with one of each finger.
    """

    def __init__(
        self,
        hand: Hand,
        kind: pages.Kind,
        function: Callable[..., Row],
        given: Callable[[HandPart], tuple[Any, ...]],
        failed: Mapping[str, str],
        progress: bool | None,
        jobs: int = 1,
        scheduler: str | None = None,
        folder: Path | None = None,
    ) -> None:
        self._hand, self._kind, self._folder = hand, kind, folder
        waiting = [tasks.Job(part.name, (part, *given(part))) for part in hand.parts if part.name not in failed]
        several = scheduler is not None or jobs > 1
        with (
            tempfile.TemporaryDirectory() as scratch,
            tasks.workers_of(scheduler, min(jobs, len(hand.parts))) if several else nullcontext() as client,
            console.progress_bar("fingers", progress, total=len(hand.parts)) as show,
        ):
            tasks.run_jobs(function, waiting, Path(scratch), client, progress=show)
            done = {row["name"]: row for row in tasks.rows_of(waiting, Path(scratch))}
        done |= {name: {"name": name, "error": why, "fault": ""} for name, why in failed.items()}
        named = [row | {"error": f"{name}: {row['error']}" if row["error"] else ""} for name, row in done.items()]
        tasks.refuse_if_all_failed(named, f"{hand.path}: no finger could be done")
        self.failed = {name: self._reason(name, row) for name, row in done.items() if row["error"]}
        rows = [pages.PartRow(*row["row"])._replace(name=name) for name, row in done.items() if not row["error"]]
        rows = sorted(pages.stand_out(rows) if kind is pages.CALIBRATION else rows, key=lambda row: -row.badness)
        self.reports = {row.name: done[row.name]["report"] for row in rows}
        self.written = {file: what for row in done.values() for file, what in row.get("written", {}).items()}
        self._warnings = pages.shared_warnings({name: done[name]["warnings"] for name in self.reports})
        empty = ("–",) * len(kind.headings)
        self._rows = [*rows, *(pages.PartRow("failed", -1.0, "", empty, *each) for each in self.failed.items())]

    def _reason(self, name: str, row: Row) -> str:
        """Return why a finger failed. If tendonfmu is at fault, write what is to be sent."""
        file = Path(f"tendonfmu-error-{name}.txt") if self._folder is None else self._folder / name / FAULT
        if row["fault"]:
            file.parent.mkdir(parents=True, exist_ok=True)
            files.write_text(file, row["fault"])
        words = tasks.fault_words(row, file)
        return words if self._folder is None else words.replace(f"{self._folder.absolute()}{os.sep}", "")

    def head(self) -> dict[str, str]:
        """Return how the report begins."""
        return {"format": f"tendonfmu-hand-{self._kind.name}-1", "hand": self._hand.name}

    def print(self, lines: Sequence[str]) -> None:
        """Print the table, lines, warnings, and why a finger was left out."""
        headings = self._kind.headings
        table = (self._hand.name, ("finger", *headings), [(row.name, *row.cells) for row in self._rows])
        console.print_results([table], lines, left=headings[1], warnings=self._warnings)
        for name, reason in self.failed.items():
            console.warn(f"{name}: left out: {reason}")

    def finish(self, groups: Groups, made: Mapping[str, str]) -> None:
        """Write the page and print everything. made: files of the hand with their content in words."""
        assert self._folder is not None
        for name in self.reports:
            (self._folder / name / FAULT).unlink(missing_ok=True)
        own = {f"{name}/{self._kind.page}": f"the page of {name}" for name in self.reports}
        all_files = {**made, **own}
        pages.write_hand_page(
            self._hand,
            self._rows,
            self._kind,
            self._folder,
            recordings=groups,
            files=all_files,
            warnings=self._warnings,
        )
        written = {
            self._folder / name: what for name, what in ({pages.PAGE: "all fingers, for a browser"} | all_files).items()
        }
        verdict = pages.verdict(self._rows)
        self.print([verdict])
        console.say_files(written)
        report = {**self.head(), "verdict": verdict, "fingers": self.reports, "failed": self.failed}
        console.print_json(lambda: report | {"files": [str(file) for file in written]})
