"""What `check`, `run`, `score`, `calibrate` and `diagnose` do with a hand in place of a finger."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tendonfmu.cli import console
from tendonfmu.cli.console import fail, name_of, print_json, print_results, progress_bar, say, say_files, show, warn
from tendonfmu.errors import InputError
from tendonfmu.options import RunOptions, ScoreOptions

if TYPE_CHECKING:
    from tendonfmu.hand import Hand, HandOutcome, PartRow

Progress = Callable[..., None]


def check_hand(file: Path, recordings: Sequence[Path], progress: bool | None) -> bool:
    """Print what a hand is, and whether recordings belong to each of its fingers. Return whether all of it is sound."""
    from tendonfmu.hand import read_hand, split_parts
    from tendonfmu.model import description_findings
    from tendonfmu.recordings import belongs, check_report, recording_report

    head = {"format": "tendonfmu-hand-check-1", "hand": str(file)}
    try:
        hand = read_hand(file)
    except InputError as refused:
        reason = str(refused)
        print_json(lambda: {**head, "sound": False, "reason": reason})
        fail(reason)
        return False
    for line in hand.summary():
        show(line)
    findings = {
        part.name: [
            finding
            for finding in description_findings(part.finger)
            # at a shared wrist a finger's tendons need not be in balance alone
            if finding.kind != "moment_arms" or not hand.shared_joints(part)
        ]
        for part in hand.parts
    }
    for name, found in findings.items():
        for finding in found:
            warn(f"{name}: {finding.line()}")
    checked: dict[str, list[dict[str, Any]]] = {part.name: [] for part in hand.parts}
    lines = []
    with progress_bar("recordings", progress if recordings else False, total=len(recordings)) as show_progress:
        for number, recording in enumerate(recordings, start=1):
            split, failed = split_parts(hand, recording)
            for part in hand.parts:
                if part.name in failed:
                    reason = failed[part.name]
                    error = {"severity": "error", "line": reason}
                    checked[part.name].append({"file": str(recording), "belongs": False, "findings": [error]})
                    lines.append(reason)
                    continue
                seen = belongs(part.finger, [split[part.name]])
                checked[part.name].append(recording_report(split[part.name], seen))
                lines += [checked[part.name][-1]["verdict"], *(f"{each.severity}: {each.line()}" for each in seen)]
            show_progress(number)
    for line in lines:
        show(line)
    reports = {}
    for part in hand.parts:
        about = (part.finger.path, "finger", part.finger.summary())
        reports[part.name] = check_report(*about, findings[part.name], checked[part.name])
    print_json(lambda: {**head, "sound": True, "summary": hand.summary(), "fingers": reports})
    strangers = [name for name, of_part in checked.items() if not all(report["belongs"] for report in of_part)]
    if strangers:
        problems = [each for name in strangers for report in checked[name] for each in report["findings"]]
        first = next(each["line"] for each in problems if each["severity"] == "error")
        fail(f"{', '.join(strangers)}: recordings do not belong to {file} as it is; the first problem: {first}")
    return not strangers


def run_hand(file: Path, recording: Path, output: Path, report: Path | None, options: RunOptions) -> None:
    """Run all fingers over a recording and write one table."""
    from tendonfmu.hand import read_hand
    from tendonfmu.hand import run_hand as run
    from tendonfmu.report import run_report

    if report is not None:
        raise InputError(f"{file}: a hand, given with --report; expected a finger, since the page is of one finger")
    hand = read_hand(file)
    console.check_table(output, recording, *hand.files)
    result = run(hand, recording, kinematics=options.kinematics)
    console.write_table(output, result.columns())
    for name, of_part in result.results.items():
        say(f"{name_of(output)}: {name}: {of_part.summary}")

    def numbers() -> dict[str, Any]:
        fingers = {}
        for part in hand.parts:
            columns, source = result.results[part.name].columns(), hand.kinematics(part, options.kinematics)
            paths = (part.finger.path, recording)
            fingers[part.name] = run_report(*paths, columns, part.finger, kinematics=source, output=name_of(output))
        return {"format": "tendonfmu-hand-run-1", "hand": hand.name, "fingers": fingers}

    print_json(numbers)


def score_hand(
    file: Path,
    recordings: Sequence[Path],
    output: Path,
    figures: Path | None,
    options: ScoreOptions,
    progress: bool | None,
) -> None:
    """Score contact detection of all fingers and write one report."""
    from tendonfmu.estimate import check_outputs
    from tendonfmu.files import counted, finite, report_text, write_text
    from tendonfmu.hand import SCORE_HEADINGS, read_hand, score_rows, shared_warnings
    from tendonfmu.hand import score_hand as run

    hand = read_hand(file)
    check_outputs(output, None, figures, [*hand.files, *recordings])
    with progress_bar("fingers", progress, total=len(hand.parts)) as show_progress:
        scores, failed = run(hand, recordings, options, show_progress)
    rows = score_rows(scores, failed)
    totals = {key: sum(getattr(score, key) for score in scores.values()) for key in ("events", "found", "false_alarms")}
    reports = {row.name: scores[row.name].report for row in rows if row.name in scores}
    report = {"format": "tendonfmu-hand-score-1", "hand": hand.name, **totals, "fingers": reports, "failed": failed}
    text = report_text(finite(report))
    write_text(output, text)
    print_json(lambda: text)
    # a recording of a finger has the finger's name after it, which stands before the warning already
    sentences = {name: [text.replace(f":{name}: ", ": ") for text in score.warnings] for name, score in scores.items()}
    _print_rows(hand.name, SCORE_HEADINGS, rows, [], shared_warnings(sentences))
    say(f"{output}: {counted(len(scores), 'finger')}")
    if figures is not None:
        from tendonfmu.report import write_score_figures

        for name, score in scores.items():
            say_files(write_score_figures(score.scored, figures / name))


def show_outcome(file: Path, compute: Callable[[Hand, Progress], HandOutcome], progress: bool | None) -> None:
    """Calibrate or diagnose a hand, and print what comes out. compute: takes the hand and the function of progress."""
    from tendonfmu.hand import read_hand

    hand = read_hand(file)
    with progress_bar("fingers", progress, total=len(hand.parts)) as show_progress:
        outcome = compute(hand, show_progress)
    _print_rows(hand.name, outcome.headings, outcome.rows, [outcome.verdict], outcome.warnings)
    say_files(outcome.written)
    print_json(lambda: outcome.report)


def _print_rows(
    name: str, headings: Sequence[str], rows: Sequence[PartRow], lines: Sequence[str], warnings: Sequence[str]
) -> None:
    table = (name, ("finger", *headings), [(row.name, *row.cells) for row in rows])
    print_results([table], lines, left=headings[1], warnings=warnings)
    for row in rows:
        if row.reason:
            warn(f"{row.name}: left out: {row.reason}")
