"""The commands about contact: `tune` chooses the thresholds, `score` measures how well they detect."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.console import NO, fail, print_json, print_tables, progress_bar, say, say_files, warn
from tendonfmu.cli.options import (
    AsJson,
    Confidence,
    FalseAlarms,
    Figures,
    FreeAtPretensions,
    Kinematics,
    Model,
    Progress,
    Quiet,
    Report,
    Seed,
)
from tendonfmu.cli.standard_streams import reads
from tendonfmu.files import counted


def register(app: typer.Typer) -> None:
    """Add the commands to the program, in the order of the help page."""
    app.command()(tune)
    app.command()(score)


@reads("finger", "recordings")
def tune(
    finger: Annotated[Path, typer.Argument(metavar="FINGER.json", help="fitted finger description")],
    recordings: FreeAtPretensions,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="TUNED.json", help="description to write")],
    false_alarms_per_hour: FalseAlarms = 6.0,
    confidence: Confidence = 0.9,
    method: Annotated[
        str, typer.Option(metavar="innovation|cusum|threshold", help="contact.method; threshold is that of the paper")
    ] = "innovation",
    bias_time: Annotated[
        float | None,
        typer.Option(min=1e-3, max=1e4, metavar="SECONDS", help="time constant of the bias [default: unchanged]"),
    ] = None,
    release_time: Annotated[
        float,
        typer.Option(min=0.0, metavar="SECONDS", help="time in contact until the bias is tracked again; inf: never"),
    ] = 2.0,
    report: Report = None,
    figures: Figures = None,
    kinematics: Kinematics = 1,
    strict: Annotated[
        bool, typer.Option("--strict", help="write no file and exit with 1 if FREE is too short for RATE")
    ] = False,
    progress: Progress = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Tune contact detection on free motion for a stated rate of false alarms.

    Sets noise and drift of the bias, the bounds of the detection and the
    standard deviation of the estimated torque.

    With too little free motion for the rate, it tunes for the rate that the
    motion suffices for, and reports that rate and how much more motion is
    needed. With --strict it exits with 1 and writes no file.
    """
    import warnings

    from tendonfmu.detect import NotEnough, TuneWarning, tune_report
    from tendonfmu.estimate import check_outputs
    from tendonfmu.files import write_text
    from tendonfmu.interface import tune as tune_finger
    from tendonfmu.report import tune_text, write_tune_figures

    check_outputs(output, report, figures, [finger, *recordings])
    with progress_bar(progress) as bar:
        task = bar.add_task("bounds", total=None)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", TuneWarning)  # printed below, one line each
                found = tune_finger(
                    finger,
                    recordings,
                    false_alarms_per_hour=false_alarms_per_hour,
                    confidence=confidence,
                    method=method,
                    bias_time=bias_time,
                    release_time=release_time,
                    kinematics=kinematics,
                    strict=strict,
                    progress=lambda done, total: bar.update(task, completed=done, total=total),
                )
        except NotEnough as refused:
            fail(str(refused))
            raise typer.Exit(NO) from None
    tuning = found.tuning
    for sentence in found.warnings:
        warn(sentence)
    found.write(output)
    text = tune_report.report_text(found.report)
    if report is not None:
        write_text(report, text)
    print_json(lambda: text)
    print_tables(tune_text.tables(tuning), tune_text.lines(tuning), left="joint")
    say(f"{output}: {tuning.method}, tuned on {60 * tuning.hours_:.1f} min of free motion")
    if figures is not None:
        say_files(write_tune_figures(tuning, figures))


@reads("model", "recordings")
def score(
    model: Model,
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING", help="labelled or free, .csv or .parquet")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="SCORE.json", help="report to write")],
    labels: Annotated[
        str | None, typer.Option(metavar="COLUMN", help="1 in contact, else 0 [default: contact, if present]")
    ] = None,
    force: Annotated[
        str | None, typer.Option(metavar="COLUMN", help="sensed force in N, reported at each alarm and drawn")
    ] = None,
    figures: Figures = None,
    kinematics: Kinematics = 1,
    seed: Seed = 0,
    progress: Progress = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Measure contact detection against labels: events found and missed, false alarms, delay, torque, ROC.

    An event is a labelled contact; labels less than 100 ms apart are one event.
    It is found if an alarm begins in it and the 200 ms before it had no alarm.
    An alarm that begins neither in an event nor in the 100 ms after one is
    false. Every figure has its 95 % interval. Several recordings are pooled.
    """
    import warnings

    from tendonfmu.detect import check_outputs, score_report
    from tendonfmu.interface import ScoreWarning
    from tendonfmu.interface import score as score_finger
    from tendonfmu.report import score_text

    check_outputs(output, figures, [model, *recordings])
    with progress_bar(progress) as bar:
        task = bar.add_task("runs", total=None)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ScoreWarning)  # printed below, one line each
            result = score_finger(
                model,
                recordings,
                labels=labels,
                force=force,
                kinematics=kinematics,
                seed=seed,
                progress=lambda done, total: bar.update(task, completed=done, total=total),
            )
    scored = result.scored
    for sentence in result.warnings:
        warn(sentence)
    result.write(output)
    text = score_report.report_text(result.report)
    print_json(lambda: text)
    print_tables(score_text.tables(scored), score_text.lines(scored), left="")
    say(f"{output}: {counted(result.events, 'event')}, {counted(result.false_alarms, 'false alarm')}")
    if figures is not None:
        from tendonfmu.report import write_score_figures

        say_files(write_score_figures(scored, figures))
