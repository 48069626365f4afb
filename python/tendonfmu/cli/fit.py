"""The command `fit`: numbers of a description, estimated from free motion."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.command import FingerFile, FreeRecordings, Progress, Report, command
from tendonfmu.cli.console import INTERRUPTED, Bar, fail, print_json, print_results, say, say_files
from tendonfmu.files import counted
from tendonfmu.options import FitOptions


@command(
    FitOptions,
    reads=("finger", "recordings"),
    after={"report": "method", "ssv": "method", "figures": "method", "compare": "method"},
)
def fit(
    finger: FingerFile,
    recordings: FreeRecordings,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FITTED.json", help="description to write")],
    options: FitOptions,
    report: Report = None,
    ssv: Annotated[
        Path | None, typer.Option(metavar="FITTED.ssv", help="parameter set of SSP to write, for FMUs of the finger")
    ] = None,
    figures: Annotated[Path | None, typer.Option(metavar="DIR", help="folder for the page report.html")] = None,
    compare: Annotated[
        list[Path] | None, typer.Option(metavar="RECORDING", help="recording to judge, not to fit; may be repeated")
    ] = None,
    progress: Progress = None,
) -> None:
    """Estimate the numbers of a finger from recordings of free motion, with their uncertainty.

    PATTERN is a path of the description, such as
    tendons[*].edge_friction[2]*.viscous; * stands for anything. Ctrl-C saves
    the best estimate so far in FITTED.unfinished.json.
    """
    from tendonfmu.estimate import FitWarning, check_outputs, write_unfinished
    from tendonfmu.files import report_text, write_text
    from tendonfmu.fmu import check_parameter_set_path
    from tendonfmu.interface import FitInterrupted
    from tendonfmu.interface import fit as fit_finger
    from tendonfmu.report import fit_text

    earlier = [Path(file) for file in (options.previous, options.resume) if file is not None]
    inputs = [finger, *recordings, *(compare or []), *earlier]
    check_outputs(output, report, figures, inputs)
    if ssv is not None:
        check_parameter_set_path(ssv, *inputs)
    try:
        with Bar(progress) as bar, warnings.catch_warnings():
            warnings.simplefilter("ignore", FitWarning)  # printed below, one line each
            result = fit_finger(finger, recordings, compare=compare or [], progress=bar.fit, **vars(options))
    except FitInterrupted as stopped:
        left = write_unfinished(output, stopped.unfinished)
        fail(f"interrupted; the best estimate so far is in {left}; continue with --resume {left}")
        sys.exit(INTERRUPTED)
    fitting = result.estimator
    result.write(output)
    text = report_text(result.report)
    if report is not None:
        write_text(report, text)
    if ssv is not None:
        result.write(ssv)
    print_json(lambda: text)
    print_results(fit_text.tables(fitting), fit_text.lines(fitting), left="joint", warnings=result.warnings)
    say(f"{output}: {counted(len(fitting.parameters_), 'number')} estimated")
    if report is not None:
        say(f"{report}: all results, as JSON")
    if ssv is not None:
        say(f"{ssv}: parameter set for an FMU of the finger")
    if figures is not None:
        from tendonfmu.report import write_fit_page

        say_files(write_fit_page(fitting.picture(), figures))
