"""The command `run`: the model over a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.console import print_json, progress_bar, say
from tendonfmu.cli.options import AsJson, Kinematics, Model, Progress, Quiet
from tendonfmu.cli.standard_streams import check_table, name_of, reads, write_table
from tendonfmu.errors import InputError


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command()(run)


@reads("model", "recording")
def run(
    model: Model,
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="recording, .csv or .parquet")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="OUT.csv", help="table: .csv, .parquet or .mcap; -: as CSV")
    ],
    report: Annotated[
        Path | None, typer.Option(metavar="PAGE.html|DIR", help="page of the run; in a folder run.html")
    ] = None,
    kinematics: Kinematics = 1,
    progress: Progress = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Run the model over a recording and write all outputs, one row per sample at the time of that sample."""
    from tendonfmu.fmu import check_model, finger_of
    from tendonfmu.interface import run as run_finger
    from tendonfmu.recordings import read_recording
    from tendonfmu.report import check_page, run_report, write_run_page

    check_model(model)
    check_table(output, model, recording)
    if report is not None:
        check_page(report, model, recording)
        if report.resolve() == output.resolve():
            raise InputError(f"{report}: the same file for outputs and page; expected two names")
    samples = read_recording(recording)
    with progress_bar(progress) as bar:
        task = bar.add_task("samples", total=len(samples))
        found = run_finger(
            model, samples, kinematics=kinematics, progress=lambda done: bar.update(task, completed=done)
        )
    table = found.columns()
    write_table(output, table)
    numbers = run_report(model, recording, table, finger_of(model), kinematics=kinematics, output=name_of(output))
    say(f"{name_of(output)}: {found.summary}")
    if report is not None:
        say(f"{write_run_page(report, numbers, table, samples.contact)}: the run, to be read in a browser")
    print_json(lambda: numbers)
