"""The command `check`: whether a description is sound, and whether recordings belong to it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tendonfmu.cli.console import say, show
from tendonfmu.cli.options import Subject
from tendonfmu.errors import InputError

if TYPE_CHECKING:
    from tendonfmu.model import FingerDescription


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command()(check)


def check(
    file: Subject,
    recordings: Annotated[
        list[Path] | None, typer.Argument(metavar="[RECORDING]...", help="recordings of this finger, .csv or .parquet")
    ] = None,
) -> None:
    """Validate a finger description or a rig and describe it. Exit status 1 if it is refused.

    With recordings: report whether they belong to the finger and, where they do
    not, what to write into the map of columns. Exit status 1 if one does not.
    """
    from tendonfmu.files import check_format
    from tendonfmu.model import description_findings, read_finger
    from tendonfmu.simulate import describe_rig, is_rig, require_plant

    for recording in recordings or []:
        check_format(recording)
    rig = is_rig(file)
    if rig:
        require_plant()
        if recordings:
            raise InputError(f"{file}: is a rig; expected a finger description to check recordings against")
    try:
        finger = None if rig else read_finger(file)
        lines = describe_rig(file) if finger is None else finger.summary()
    except InputError as refused:
        # An unsound description is the answer "no" (1); a file that cannot be read is bad input (2).
        say(f"tendonfmu: {refused}")
        raise typer.Exit(1 if file.is_file() else 2) from None
    for line in lines:
        show(line)
    if finger is not None:
        for finding in description_findings(finger):
            say(f"tendonfmu: warning: {finding.line()}")
        _check_recordings(finger, recordings or [])


def _check_recordings(finger: FingerDescription, files: list[Path]) -> None:
    """Print for each recording whether it belongs to the finger. Exit status 1 if one does not."""
    from tendonfmu.recordings import belongs, read_recording, verdict

    strangers = 0
    for file in files:
        recording = read_recording(file)
        findings = belongs(finger, [recording])
        show(verdict(recording, findings))
        for finding in findings:
            show(f"{finding.severity}: {finding.line()}")
        strangers += any(finding.severity == "error" for finding in findings)
    if strangers:
        count = f"{strangers} of {len(files)} recordings" if len(files) > 1 else str(files[0])
        say(f"tendonfmu: {count}: does not belong to {finger.path} as it is; see above for what to change")
        raise typer.Exit(1)
