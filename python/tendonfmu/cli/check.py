"""The command `check`: whether a description is sound, and whether recordings belong to it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tendonfmu.cli.command import Progress, command
from tendonfmu.cli.console import NO, PRINTED, fail, print_json, progress_bar, show, warn
from tendonfmu.cli.hand import check_hand
from tendonfmu.errors import InputError

if TYPE_CHECKING:
    from tendonfmu.model import Finger


@command(reads=("file", "recordings"))
def check(
    file: Annotated[
        Path, typer.Argument(metavar="FINGER.json|HAND.json|RIG.json", help="finger description, hand or rig")
    ],
    recordings: Annotated[
        list[Path] | None, typer.Argument(metavar="[RECORDING]...", help="recordings of this finger, .csv or .parquet")
    ] = None,
    progress: Progress = None,
) -> None:
    """Validate a finger description, a hand or a rig and describe it. Exit status 1 if it is refused.

    With recordings: report whether they belong to the finger and, where they do
    not, what to write into the map of columns. Exit status 1 if one does not.
    """
    from tendonfmu.files import check_format
    from tendonfmu.hand import is_hand
    from tendonfmu.model import description_findings, read_finger
    from tendonfmu.recordings import check_report, refusal_report
    from tendonfmu.simulate import describe_rig, is_rig, require_plant

    if file.suffix in (".csv", ".parquet"):
        raise InputError(f"{file}: a recording; expected the description first: check FINGER.json {file.name}")
    for recording in recordings or []:
        check_format(recording)
    if is_hand(file):
        if not check_hand(file, recordings or [], progress):
            raise typer.Exit(NO)
        return
    rig = is_rig(file)
    if rig:
        require_plant()
        if recordings:
            raise InputError(f"{file}: is a rig; expected a finger description to check recordings against")
    try:
        finger = None if rig else read_finger(file)
        lines = describe_rig(file) if finger is None else finger.summary()
    except InputError as refused:
        if not file.is_file():  # bad input (2); an unsound description is the answer "no" (1)
            raise
        reason = str(refused)
        print_json(lambda: refusal_report(file, reason))
        fail(reason)
        raise typer.Exit(NO) from None
    for line in lines:
        show(line)
    findings = [] if finger is None else description_findings(finger)
    for finding in findings:
        warn(finding.line())
    checked = [] if finger is None else _check_recordings(finger, recordings or [], progress)
    print_json(lambda: check_report(file, "rig" if rig else "finger", lines, findings, checked))
    strangers = sum(not report["belongs"] for report in checked)
    if strangers:
        count = f"{strangers} of {len(checked)} recordings" if len(checked) > 1 else checked[0]["file"]
        problems = [problem for report in checked for problem in report["findings"]]
        first = next(problem["line"] for problem in problems if problem["severity"] == "error")
        what = first if PRINTED.quiet or PRINTED.json else "see above for what to change"
        fail(f"{count}: does not belong to {file} as it is; {what}")
        raise typer.Exit(NO)


def _check_recordings(finger: Finger, files: list[Path], progress: bool | None) -> list[dict[str, Any]]:
    """Print for each recording whether it belongs to the finger, and return the reports on them."""
    from tendonfmu.recordings import belongs, read_recording, recording_report

    reports, lines = [], []
    with progress_bar("recordings", progress if files else False, total=len(files)) as show_progress:
        for number, file in enumerate(files, start=1):
            recording = read_recording(file)
            findings = belongs(finger, [recording])
            reports.append(recording_report(recording, findings))
            lines += [reports[-1]["verdict"], *(f"{finding.severity}: {finding.line()}" for finding in findings)]
            show_progress(number)
    for line in lines:
        show(line)
    return reports
