"""The command that leads from free motion to a tuned FMU: `register` adds it to the program of `program.py`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.console import PhaseDisplay, print_tables, say
from tendonfmu.cli.options import (
    Confidence,
    FalseAlarms,
    FingerFile,
    FreeAtPretensions,
    Jobs,
    Kinematics,
    Progress,
    Seed,
)
from tendonfmu.cli.several_values import SeveralValues


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command(cls=SeveralValues)(calibrate)


def calibrate(
    finger: FingerFile,
    recordings: FreeAtPretensions,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder for page, finger and FMU")],
    test: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FREE",
            help="free motion that the errors are measured on; may be repeated, or several at once after the "
            "recordings \\[default: parts of the recordings]",
        ),
    ] = None,
    pushes: Annotated[
        list[Path] | None,
        typer.Option(metavar="LABELLED", help="with labelled contact: what is found is counted; as --test"),
    ] = None,
    previous: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="PREVIOUS.json",
            help="an earlier calibration's finger.json, or the report of a fit: its structure stays, its numbers are "
            "the prior; for little data",
        ),
    ] = None,
    false_alarms_per_hour: FalseAlarms = 6.0,
    confidence: Confidence = 0.9,
    kinematics: Kinematics = 1,
    seed: Seed = 0,
    jobs: Jobs = 1,
    progress: Progress = None,
) -> None:
    """From free motion to a tuned FMU: what the model lacks, all its numbers, and what decides on contact.

    DIR gets the page calibration.html, finger.json, finger.fmu, calibration.json and the diagnosis. A call that is
    repeated with the same files goes on where the one before ended.
    """
    from tendonfmu.calibrate import Options, check_folder, text, write_calibration
    from tendonfmu.calibrate import calibrate as run

    tests, labelled = test or [], pushes or []
    check_folder(output, [finger, *recordings, *tests, *labelled, *([] if previous is None else [previous])])
    options = Options(kinematics, false_alarms_per_hour, confidence, seed, jobs)
    with PhaseDisplay(progress) as display:
        found = run(
            finger,
            recordings,
            output,
            tests=tests,
            pushes=labelled,
            previous=previous,
            options=options,
            progress=display,
        )
        display.note("writing the files")
        written = write_calibration(found, output)
    for sentence in found.report["warnings"]:
        say(f"tendonfmu: warning: {sentence}")
    if found.report["steps"]["repeated"]:
        say(f"unchanged, not done again: {', '.join(found.report['steps']['repeated'])}")
    print_tables(text.tables(found.report), text.lines(found.report), left="model")
    for path, what in written.items():
        say(f"{path}: {what}")
