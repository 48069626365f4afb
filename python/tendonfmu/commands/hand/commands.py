"""What `check`, `run`, `score`, `calibrate` and `diagnose` do with a hand in place of a finger."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from tendonfmu import estimate, files, model
from tendonfmu import recordings as recorded
from tendonfmu import report as reporting
from tendonfmu.commands import console
from tendonfmu.commands import hand as hands
from tendonfmu.commands.command import of_hand
from tendonfmu.errors import InputError

if TYPE_CHECKING:
    from tendonfmu.commands.hand import Hand, HandOutcome, PartRow
    from tendonfmu.options import CalibrateOptions, DiagnoseOptions, RunOptions, ScoreOptions


@of_hand("check")
def check_hand(file: Path, recordings: Sequence[Path] | None = None, progress: bool | None = None) -> None:
    """Print what a hand is, and whether recordings belong to each of its fingers."""
    recordings = recordings or []
    for recording in recordings:
        files.check_format(recording)
    head = {"format": "tendonfmu-hand-check-1", "hand": str(file)}
    try:
        hand = hands.read_hand(file)
    except InputError as refused:
        reason = str(refused)
        console.print_json(lambda: {**head, "sound": False, "reason": reason})
        console.fail(reason)
        raise typer.Exit(console.NO) from None
    for line in hand.summary():
        console.show(line)
    findings = {
        part.name: [
            finding
            for finding in model.description_findings(part.finger)
            # at a shared wrist a finger's tendons need not be in balance alone
            if finding.kind != "moment_arms" or not hand.shared_joints(part)
        ]
        for part in hand.parts
    }
    for name, found in findings.items():
        for finding in found:
            console.warn(f"{name}: {finding.line()}")
    checked: dict[str, list[dict[str, Any]]] = {part.name: [] for part in hand.parts}
    lines = []
    with console.progress_bar("recordings", progress if recordings else False, total=len(recordings)) as show_progress:
        for number, recording in enumerate(recordings, start=1):
            split, failed = hands.split_parts(hand, recording)
            for part in hand.parts:
                if part.name in failed:
                    reason = failed[part.name]
                    error = {"severity": "error", "line": reason}
                    checked[part.name].append({"file": str(recording), "belongs": False, "findings": [error]})
                    lines.append(reason)
                    continue
                seen = recorded.belongs(part.finger, [split[part.name]])
                checked[part.name].append(recorded.recording_report(split[part.name], seen))
                lines += [checked[part.name][-1]["verdict"], *(f"{each.severity}: {each.line()}" for each in seen)]
            show_progress(number)
    for line in lines:
        console.show(line)
    reports = {}
    for part in hand.parts:
        about = (part.finger.path, "finger", part.finger.summary())
        reports[part.name] = recorded.check_report(*about, findings[part.name], checked[part.name])
    console.print_json(lambda: {**head, "sound": True, "summary": hand.summary(), "fingers": reports})
    strangers = [name for name, of_part in checked.items() if not all(report["belongs"] for report in of_part)]
    if strangers:
        problems = [each for name in strangers for report in checked[name] for each in report["findings"]]
        first = next(each["line"] for each in problems if each["severity"] == "error")
        console.fail(f"{', '.join(strangers)}: recordings do not belong to {file} as it is; the first problem: {first}")
        raise typer.Exit(console.NO)


@of_hand("run")
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
    hand = hands.read_hand(model)
    console.check_table(output, recording, *hand.files)
    result = hands.run_hand(hand, recording, kinematics=options.kinematics)
    console.write_table(output, result.columns())
    for name, of_part in result.results.items():
        console.say(f"{console.name_of(output)}: {name}: {of_part.summary}")

    def numbers() -> dict[str, Any]:
        fingers = {}
        for part in hand.parts:
            columns, source = result.results[part.name].columns(), hand.kinematics(part, options.kinematics)
            paths = (part.finger.path, recording)
            fingers[part.name] = reporting.run_report(
                *paths, columns, part.finger, kinematics=source, output=console.name_of(output)
            )
        return {"format": "tendonfmu-hand-run-1", "hand": hand.name, "fingers": fingers}

    console.print_json(numbers)


@of_hand("score")
def score_hand(
    model: Path,
    recordings: Sequence[Path],
    output: Path,
    options: ScoreOptions,
    figures: Path | None = None,
    progress: bool | None = None,
) -> None:
    """Score contact detection of all fingers and write one report."""
    hand = hands.read_hand(model)
    estimate.check_outputs(output, None, figures, [*hand.files, *recordings])
    with console.progress_bar("fingers", progress, total=len(hand.parts)) as show_progress:
        scores, failed = hands.score_hand(hand, recordings, options, show_progress)
    rows = hands.score_rows(scores, failed)
    totals = {key: sum(getattr(score, key) for score in scores.values()) for key in ("events", "found", "false_alarms")}
    reports = {row.name: scores[row.name].report for row in rows if row.name in scores}
    report = {"format": "tendonfmu-hand-score-1", "hand": hand.name, **totals, "fingers": reports, "failed": failed}
    text = files.report_text(files.finite(report))
    files.write_text(output, text)
    console.print_json(lambda: text)
    # a recording of a finger has the finger's name after it, which stands before the warning already
    sentences = {name: [text.replace(f":{name}: ", ": ") for text in score.warnings] for name, score in scores.items()}
    _print_rows(hand.name, hands.SCORE_HEADINGS, rows, [], hands.shared_warnings(sentences))
    console.say(f"{output}: {files.counted(len(scores), 'finger')}")
    if figures is not None:
        for name, score in scores.items():
            console.say_files(reporting.write_score_figures(score.scored, figures / name))


@of_hand("calibrate")
def calibrate_hand(
    finger: Path,
    recordings: Sequence[Path],
    output: Path,
    options: CalibrateOptions,
    scheduler: str | None = None,
    progress: bool | None = None,
) -> None:
    """Calibrate every finger."""
    _show_outcome(finger, partial(hands.calibrate_hand, recordings, output, options, scheduler), progress)


@of_hand("diagnose")
def diagnose_hand(
    finger: Path,
    recordings: Sequence[Path],
    output: Path,
    options: DiagnoseOptions,
    history: bool = False,
    scheduler: str | None = None,
    progress: bool | None = None,
) -> None:
    """Diagnose every finger."""
    if history and options.test:
        raise InputError("--test: given with --history; expected recordings in order of time only")
    _show_outcome(finger, partial(hands.diagnose_hand, recordings, output, options, scheduler, history), progress)


def _show_outcome(file: Path, compute: Callable[[Hand, Any], HandOutcome], progress: bool | None) -> None:
    """Print what comes out of all fingers. compute: takes the hand and the function of progress."""
    hand = hands.read_hand(file)
    with console.progress_bar("fingers", progress, total=len(hand.parts)) as show_progress:
        outcome = compute(hand, show_progress)
    _print_rows(hand.name, outcome.headings, outcome.rows, [outcome.verdict], outcome.warnings)
    console.say_files(outcome.written)
    console.print_json(lambda: outcome.report)


def _print_rows(
    name: str, headings: Sequence[str], rows: Sequence[PartRow], lines: Sequence[str], warnings: Sequence[str]
) -> None:
    table = (name, ("finger", *headings), [(row.name, *row.cells) for row in rows])
    console.print_results([table], lines, left=headings[1], warnings=warnings)
    for row in rows:
        if row.reason:
            console.warn(f"{row.name}: left out: {row.reason}")
