"""The command `fit`: numbers of a description, estimated from free motion."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.console import (
    INTERRUPTED,
    fail,
    fit_bar,
    print_json,
    print_tables,
    progress_bar,
    say,
    say_files,
    warn,
)
from tendonfmu.cli.options import AsJson, FingerFile, FreeRecordings, Kinematics, Progress, Quiet, Report
from tendonfmu.cli.standard_streams import reads
from tendonfmu.files import counted


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command()(fit)


@reads("finger", "recordings")
def fit(
    finger: FingerFile,
    recordings: FreeRecordings,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FITTED.json", help="description to write")],
    method: Annotated[str, typer.Option(metavar="batch|ekf", help="maximum likelihood or Kalman filter")] = "batch",
    report: Report = None,
    ssv: Annotated[
        Path | None, typer.Option(metavar="FITTED.ssv", help="parameter set of SSP to write, for FMUs of the finger")
    ] = None,
    figures: Annotated[Path | None, typer.Option(metavar="DIR", help="folder for figures and report.html")] = None,
    compare: Annotated[
        list[Path] | None, typer.Option(metavar="RECORDING", help="recording to judge, not to fit; may be repeated")
    ] = None,
    holdout: Annotated[
        float, typer.Option(min=0.0, max=0.9, metavar="SHARE", help="share of the time not used in the fit")
    ] = 0.0,
    holdout_block: Annotated[float, typer.Option(min=1.0, metavar="SECONDS", help="longest block left out")] = 10.0,
    kinematics: Kinematics = 1,
    only: Annotated[
        list[str] | None, typer.Option(metavar="PATTERN", help="estimate only these numbers; may be repeated")
    ] = None,
    fix: Annotated[
        list[str] | None, typer.Option(metavar="PATTERN", help="keep these numbers fixed; may be repeated")
    ] = None,
    share: Annotated[
        list[str] | None,
        typer.Option(metavar="tendons|pulleys|PATTERN", help="laws that share one set of values; may be repeated"),
    ] = None,
    asymmetric: Annotated[
        bool | None, typer.Option("--asymmetric/--symmetric", help="fit the two sides of a law apart, or as one")
    ] = None,
    prior: Annotated[
        float, typer.Option(min=1e-6, max=1e6, metavar="RATIO", help="prior: standard deviation / expected magnitude")
    ] = 1.0,
    scale: Annotated[
        list[str] | None, typer.Option(metavar="PATTERN=VALUE", help="expected magnitude, instead of the description's")
    ] = None,
    previous: Annotated[
        Path | None,
        typer.Option("--from", metavar="PREVIOUS.json", help="report or description of an earlier fit, as the prior"),
    ] = None,
    change: Annotated[
        float,
        typer.Option(
            min=1e-6, max=10.0, metavar="SHARE", help="with --from: expected relative change of the numbers since"
        ),
    ] = 0.02,
    effective_samples: Annotated[
        bool | None,
        typer.Option(help="count correlated residuals as fewer samples [default: with --from]"),
    ] = None,
    passes: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="most passes over the data [default: 60; ekf: 2]")
    ] = None,
    tolerance: Annotated[
        float, typer.Option(min=1e-9, max=0.5, metavar="SIZE", help="batch: last step, in standard errors")
    ] = 0.3,
    drift: Annotated[
        float, typer.Option(min=0.0, max=1.0, metavar="RATE", help="ekf: relative variance of the numbers per s")
    ] = 0.0,
    uncertainty: Annotated[
        bool,
        typer.Option("--uncertainty/--no-uncertainty", help="write the uncertainty of the friction, for detection"),
    ] = True,
    resume: Annotated[
        Path | None, typer.Option(metavar="FITTED.unfinished.json", help="continue an interrupted fit")
    ] = None,
    progress: Progress = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Estimate the numbers of a finger from recordings of free motion, with their uncertainty.

    PATTERN is a path of the description, such as
    tendons[*].edge_friction[2]*.viscous; * stands for anything. Ctrl-C saves
    the best estimate so far in FITTED.unfinished.json.
    """
    from tendonfmu.estimate import FitWarning, check_outputs, fit_report, write_unfinished
    from tendonfmu.files import write_text
    from tendonfmu.fmu import check_parameter_set_path
    from tendonfmu.interface import FitInterrupted
    from tendonfmu.interface import fit as fit_finger
    from tendonfmu.report import fit_text

    inputs = [finger, *recordings, *(compare or []), *(each for each in (previous, resume) if each is not None)]
    check_outputs(output, report, figures, inputs)
    if ssv is not None:
        check_parameter_set_path(ssv, *inputs)
    with progress_bar(progress) as bar:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", FitWarning)  # printed below, one line each
                found = fit_finger(
                    finger,
                    recordings,
                    method=method,
                    compare=compare or [],
                    holdout=holdout,
                    holdout_block=holdout_block,
                    kinematics=kinematics,
                    only=only or [],
                    fix=fix or [],
                    share=share or [],
                    asymmetric=asymmetric,
                    prior=prior,
                    scale=scale or [],
                    previous=previous,
                    change=change,
                    effective_samples=effective_samples,
                    passes=passes,
                    tolerance=tolerance,
                    drift=drift,
                    uncertainty=uncertainty,
                    resume=resume,
                    progress=fit_bar(bar),
                )
        except FitInterrupted as stopped:
            bar.stop()
            left = write_unfinished(output, stopped.unfinished)
            fail(f"interrupted; the best estimate so far is in {left}; continue with --resume {left}")
            sys.exit(INTERRUPTED)
    fitting = found.estimator
    for sentence in found.warnings:
        warn(sentence)
    found.write(output)
    text = fit_report.report_text(found.report)
    if report is not None:
        write_text(report, text)
    if ssv is not None:
        found.write(ssv)
    print_json(lambda: text)
    print_tables(fit_text.tables(fitting), fit_text.lines(fitting), left="joint")
    say(f"{output}: {counted(len(fitting.parameters_), 'number')} estimated")
    if report is not None:
        say(f"{report}: all results, as JSON")
    if ssv is not None:
        say(f"{ssv}: parameter set for an FMU of the finger")
    if figures is not None:
        from tendonfmu.report import write_fit_page

        say_files(write_fit_page(fitting.picture(), figures))
