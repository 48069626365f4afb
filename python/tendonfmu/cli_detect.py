"""The commands about contact: `register` adds each to the program of `cli.py`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.console import print_tables, progress_bar, say

Kinematics = Annotated[
    int,
    typer.Option(
        min=1, max=3, help="1: tendon positions, 2: measured joint positions, 3: joint positions and velocities"
    ),
]


def register(app: typer.Typer) -> None:
    """Adds the commands, in the order of the help page."""
    app.command()(score)


def score(
    model: Annotated[Path, typer.Argument(metavar="FINGER.json|FINGER.fmu", help="description, or FMU of one")],
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING", help="labelled or free, .csv or .parquet")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="SCORE.json", help="report to write")],
    labels: Annotated[
        str | None, typer.Option(metavar="COLUMN", help="1 in contact, else 0 \\[default: contact, where it is there]")
    ] = None,
    force: Annotated[
        str | None, typer.Option(metavar="COLUMN", help="sensed force in N: told at each alarm, and drawn")
    ] = None,
    figures: Annotated[Path | None, typer.Option(metavar="DIR", help="folder for figures")] = None,
    kinematics: Kinematics = 1,
    seed: Annotated[int, typer.Option(min=0, max=2**53, help="of the intervals' resampling")] = 0,
    progress: Annotated[
        bool | None, typer.Option("--progress/--no-progress", help="progress bar; by default on a terminal")
    ] = None,
) -> None:
    """Measure contact detection against labels: events found and missed, false alarms, delay, torque; a ROC.

    An event is a labelled contact; labels closer than 100 ms are one.
    It is found if an alarm begins in it and the 200 ms before it were silent.
    An alarm that begins in no event, nor in the 100 ms after one, is false.
    Everything has its 95 % interval; several recordings are pooled.
    """
    from tendonfmu.fit_files import write_text
    from tendonfmu.score_report import build_report, report_text
    from tendonfmu.score_text import lines, tables
    from tendonfmu.scoring import check_outputs, score_recordings

    check_outputs(output, figures, [model, *recordings])
    with progress_bar(progress) as bar:
        task = bar.add_task("runs", total=None)
        scored = score_recordings(
            model,
            recordings,
            labels=labels,
            force=force,
            kinematics=kinematics,
            seed=seed,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    for sentence in scored.warnings:
        say(f"tendonfmu: warning: {sentence}")
    write_text(output, report_text(build_report(scored)))
    print_tables(tables(scored), lines(scored), left="")
    say(f"{output}: {scored.summary.events} events, {scored.summary.false_alarms} false alarms")
    if figures is not None:
        from tendonfmu.score_figures import write_figures

        for path, what in write_figures(scored, figures).items():
            say(f"{path}: {what}")
