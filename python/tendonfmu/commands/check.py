"""The command `check`: whether a description is sound, and whether recordings belong to it."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tendonfmu import files, model, simulate
from tendonfmu import recordings as recorded
from tendonfmu.commands.command import Progress, command
from tendonfmu.commands.console import NO, PRINTED, fail, print_json, progress_bar, show, warn
from tendonfmu.errors import InputError
from tendonfmu.options import RecordingSources

if TYPE_CHECKING:
    from tendonfmu.model import Finding, Finger, FingerSource
    from tendonfmu.recordings import Recording


@dataclass(frozen=True, eq=False, repr=False)
class CheckResult:
    """What is wrong, or probably is, with a finger and its recordings.

    Attributes
    ----------
    finger
        The finger.
    findings
        Each with `severity` ("error" or "warning"), `kind`, `path`, `columns`, `seen`, `probably`, `write`, `line()`.
    """

    finger: Finger
    findings: tuple[Finding, ...]

    @property
    def belongs(self) -> bool:
        """Whether nothing is an error."""
        return all(finding.severity != "error" for finding in self.findings)

    def __repr__(self) -> str:
        lines = [f"{finding.severity}: {finding.line()}" for finding in self.findings] or ["no problem found"]
        return "\n".join([*self.finger.summary(), *lines])

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"


def check(finger: FingerSource, recordings: RecordingSources = ()) -> CheckResult:
    """Check a description, and whether recordings belong to it.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it.
    recordings
        Recordings, DataFrames or files. One alone needs no list.

    Returns
    -------
    CheckResult
        What was found.

    Raises
    ------
    InputError
        The description is refused, or a recording cannot be read.
    """
    read = model.read_finger(finger)
    found = recorded.belongs(read, recorded.read_recordings(recorded.listed_sources(recordings)))
    return CheckResult(read, (*model.description_findings(read), *found))


@command("check", reads=("file", "recordings"))
def check_files(
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
    if file.suffix in (".csv", ".parquet"):
        raise InputError(f"{file}: a recording; expected the description first: check FINGER.json {file.name}")
    for recording in recordings or []:
        files.check_format(recording)
    rig = simulate.is_rig(file)
    if rig:
        simulate.require_plant()
        if recordings:
            raise InputError(f"{file}: is a rig; expected a finger description to check recordings against")
    try:
        finger = None if rig else model.read_finger(file)
        lines = simulate.describe_rig(file) if finger is None else finger.summary()
    except InputError as refused:
        if not file.is_file():  # bad input (2); an unsound description is the answer "no" (1)
            raise
        reason = str(refused)
        print_json(lambda: recorded.refusal_report(file, reason))
        fail(reason)
        raise typer.Exit(NO) from None
    for line in lines:
        show(line)
    findings = [] if finger is None else model.description_findings(finger)
    for finding in findings:
        warn(finding.line())
    checked = [] if finger is None else _check_recordings(finger, recordings or [], progress)
    print_json(lambda: recorded.check_report(file, "rig" if rig else "finger", lines, findings, checked))
    strangers = sum(not report["belongs"] for report in checked)
    if strangers:
        count = f"{strangers} of {len(checked)} recordings" if len(checked) > 1 else checked[0]["file"]
        problems = [problem for report in checked for problem in report["findings"]]
        first = next(problem["line"] for problem in problems if problem["severity"] == "error")
        what = first if PRINTED.quiet or PRINTED.json else "see above for what to change"
        fail(f"{count}: does not belong to {file} as it is; {what}")
        raise typer.Exit(NO)


def _check_recordings(finger: Finger, paths: list[Path], progress: bool | None) -> list[dict[str, Any]]:
    """Print for each recording whether it belongs to the finger, and return the reports on them."""
    read = []
    with progress_bar("recordings", progress if paths else False, total=len(paths)) as show_progress:
        for number, file in enumerate(paths, start=1):
            read.append(recorded.read_recording(file))
            show_progress(number)
    return [show_whether_it_belongs(finger, recording) for recording in read]


def show_whether_it_belongs(finger: Finger, recording: Recording) -> dict[str, Any]:
    """Print whether a recording belongs to a finger, and return the report on it."""
    findings = recorded.belongs(finger, [recording])
    report = recorded.recording_report(recording, findings)
    for line in (report["verdict"], *(f"{finding.severity}: {finding.line()}" for finding in findings)):
        show(line)
    return report
