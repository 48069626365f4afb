"""The commands about contact: `tune` chooses the thresholds, `score` measures how well they detect."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.command import Figures, FreeAtPretensions, Model, Progress, Report, command
from tendonfmu.cli.console import NO, fail, print_json, print_results, progress_bar, say, say_files
from tendonfmu.cli.hand import score_hand
from tendonfmu.files import counted
from tendonfmu.options import ScoreOptions, TuneOptions


@command(TuneOptions, reads=("finger", "recordings"), after={"report": "bias_time", "figures": "bias_time"})
def tune(
    finger: Annotated[Path, typer.Argument(metavar="FINGER.json", help="fitted finger description")],
    recordings: FreeAtPretensions,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="TUNED.json", help="description to write")],
    options: TuneOptions,
    report: Report = None,
    figures: Figures = None,
    progress: Progress = None,
) -> None:
    """Tune contact detection on free motion for a stated rate of false alarms.

    Sets noise and drift of the bias, the bounds of the detection and the
    standard deviation of the estimated torque. Reports the false alarms in
    motion that the bounds were not learned from: record at least three
    motions, at all pretensions that the finger will have.
    """
    from tendonfmu.detect import NotEnough, TuneWarning
    from tendonfmu.estimate import check_outputs
    from tendonfmu.files import report_text, write_text
    from tendonfmu.interface import tune as tune_finger
    from tendonfmu.report import detect_text, write_tune_figures

    check_outputs(output, report, figures, [finger, *recordings])
    try:
        with progress_bar("bounds", progress) as show, warnings.catch_warnings():
            warnings.simplefilter("ignore", TuneWarning)  # printed below, one line each
            result = tune_finger(finger, recordings, progress=show, **vars(options))
    except NotEnough as refused:
        fail(str(refused))
        raise typer.Exit(NO) from None
    tuning = result.tuning
    result.write(output)
    text = report_text(result.report)
    if report is not None:
        write_text(report, text)
    print_json(lambda: text)
    print_results(
        detect_text.tune_tables(tuning), detect_text.tune_lines(tuning), left="joint", warnings=result.warnings
    )
    say(f"{output}: {options.method}, tuned on {60 * tuning.hours_:.1f} min of free motion")
    if figures is not None:
        say_files(write_tune_figures(tuning, figures))


@command(ScoreOptions, reads=("model", "recordings"), after={"figures": "force"})
def score(
    model: Model,
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING", help="labelled or free, .csv or .parquet")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="SCORE.json", help="report to write")],
    options: ScoreOptions,
    figures: Figures = None,
    progress: Progress = None,
) -> None:
    """Measure contact detection against labels: events found and missed, false alarms, delay, torque, ROC.

    An event is a labelled contact; labels less than 100 ms apart are one event.
    It is found if an alarm begins in it and the 200 ms before it had no alarm.
    An alarm that begins neither in an event nor in the 100 ms after one is
    false. Every figure has its 95 % interval. Several recordings are pooled.
    """
    from tendonfmu.estimate import check_outputs
    from tendonfmu.files import report_text
    from tendonfmu.hand import is_hand
    from tendonfmu.interface import ScoreWarning
    from tendonfmu.interface import score as score_finger
    from tendonfmu.report import detect_text

    if is_hand(model):
        score_hand(model, recordings, output, figures, options, progress)
        return
    check_outputs(output, None, figures, [model, *recordings])
    with progress_bar("runs", progress) as show, warnings.catch_warnings():
        warnings.simplefilter("ignore", ScoreWarning)  # printed below, one line each
        result = score_finger(model, recordings, progress=show, **vars(options))
    result.write(output)
    text = report_text(result.report)
    print_json(lambda: text)
    print_results(
        detect_text.score_tables(result.scored),
        detect_text.score_lines(result.scored),
        left="",
        warnings=result.warnings,
    )
    say(f"{output}: {counted(result.events, 'event')}, {counted(result.false_alarms, 'false alarm')}")
    if figures is not None:
        from tendonfmu.report import write_score_figures

        say_files(write_score_figures(result.scored, figures))
