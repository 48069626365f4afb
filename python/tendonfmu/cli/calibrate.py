"""The command `calibrate`: from free motion to a tuned FMU."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.command import ExtendedFinger, FreeAtPretensions, Progress, command
from tendonfmu.cli.console import INTERRUPTED, Bar, fail, print_json, print_results, say, say_files
from tendonfmu.cli.hand import show_outcome
from tendonfmu.errors import InputError
from tendonfmu.options import CalibrateOptions


@command(CalibrateOptions)
def calibrate(
    finger: ExtendedFinger,
    recordings: FreeAtPretensions,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder for page, finger and FMU")],
    test: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FREE", help="free motion that only judges the result; may be repeated [default: parts of FREE]"
        ),
    ] = None,
    pushes: Annotated[
        list[Path] | None,
        typer.Option(metavar="LABELLED", help="recordings with labelled contact, to count what is found; as --test"),
    ] = None,
    previous: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="PREVIOUS.json",
            help="finger.json of an earlier calibration, or report of a fit, as the prior; for little data",
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="dask cluster for the fingers of a hand [default: --jobs processes]"),
    ] = None,
    *,
    options: CalibrateOptions,
    progress: Progress = None,
) -> None:
    """Make a tuned FMU from free motion: find missing effects, fit all numbers, tune contact detection.

    DIR gets the page calibration.html, finger.json, finger.fmu,
    calibration.json and the diagnosis. A repeated call with the same files
    continues where the previous one ended.

    Of a hand, every finger is calibrated in DIR/FINGER; DIR gets hand.html,
    hand.json and hand.ssp.

    --test and --pushes take several files at once after the recordings. With
    --from the structure of the earlier model stays and its numbers are the
    prior.
    """
    from tendonfmu.calibration import REPORT, check_folder, text, write_calibration
    from tendonfmu.calibration import calibrate as run
    from tendonfmu.hand import calibrate_hand, is_hand

    tests, labelled = test or [], pushes or []
    if is_hand(finger):
        groups = (recordings, tests, labelled)
        show_outcome(finger, partial(calibrate_hand, groups, output, options, scheduler, previous), progress)
        return
    if scheduler is not None:
        raise InputError("--scheduler: given with a finger; expected a hand, whose fingers it computes")
    check_folder(output, [finger, *recordings, *tests, *labelled, *([] if previous is None else [previous])])
    try:
        with Bar(progress) as bar:
            calibration = run(
                finger,
                recordings,
                output,
                tests=tests,
                pushes=labelled,
                previous=previous,
                options=options,
                progress=bar.phase,
            )
            bar("writing the files")
            written = write_calibration(calibration, output)
    except KeyboardInterrupt as stopped:
        if not stopped.args:  # while nothing was computed yet
            raise
        fail(f"interrupted; {stopped}")
        sys.exit(INTERRUPTED)
    report = calibration.report
    if report["steps"]["repeated"]:
        say(f"unchanged since the last call, not repeated: {', '.join(report['steps']['repeated'])}")
    print_results(text.tables(report), text.lines(report), left="model", warnings=report["warnings"])
    say_files(written)
    print_json((output / REPORT).read_text)
