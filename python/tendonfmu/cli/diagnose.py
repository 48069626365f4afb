"""The command `diagnose`: what is wrong with the model or the finger."""

from __future__ import annotations

import warnings
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.command import ExtendedFinger, FreeRecordings, Progress, command
from tendonfmu.cli.console import Bar, print_json, print_results, progress_bar, say_files, warn
from tendonfmu.cli.hand import show_outcome
from tendonfmu.errors import InputError
from tendonfmu.options import DiagnoseOptions


@command(DiagnoseOptions)
def diagnose(
    finger: ExtendedFinger,
    recordings: FreeRecordings,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder for page, report and model")],
    test: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="RECORDING",
            help="recordings to measure the gain on, not to fit; may be repeated [default: parts of RECORDING]",
        ),
    ] = None,
    reference: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="RECORDING",
            help="recordings of the same finger when healthy, to find what has changed since; best the same motion",
        ),
    ] = None,
    history: Annotated[
        bool,
        typer.Option(
            "--history",
            help="compare each recording, in order of time, with the reference [default: the first recording]",
        ),
    ] = False,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="dask cluster for --history or a hand [default: --jobs processes]"),
    ] = None,
    *,
    options: DiagnoseOptions,
    progress: Progress = None,
) -> None:
    """Show what the model gets wrong, name the cause, add it to the model and measure the gain.

    The given structure is fitted first: a cause is what no fit of it can
    explain. --test and --reference take several files at once after the
    recordings.

    With --reference a cause is what has changed since. The reference may have
    another motion, pretension or length, but the same motion shows most.
    Several recordings of now, in order of time, show how the change grows.

    Of a hand, every finger is diagnosed in DIR/FINGER, and DIR gets the page
    hand.html.

    DIR gets the page diagnosis.html, diagnosis.json, and the model with its
    causes, extended.json and extended.fmu. With --history it gets the page
    history.html and history.csv: a line per recording and cause, and how fast
    each cause grows.
    """
    from tendonfmu.hand import diagnose_hand, is_hand
    from tendonfmu.interface import DiagnosisWarning
    from tendonfmu.interface import diagnose as find
    from tendonfmu.report import REPORT, check_folder, diagnosis_text

    tests, before = test or [], reference or []
    if history and tests:
        raise InputError("--test: given with --history; expected recordings in order of time only")
    if is_hand(finger):
        groups = (recordings, tests, before)
        show_outcome(finger, partial(diagnose_hand, groups, output, options, scheduler, history), progress)
        return
    if history:
        _history(finger, recordings, before, output, scheduler, options, progress)
        return
    if scheduler is not None:
        raise InputError("--scheduler: given without --history; expected both or neither")
    check_folder(output, [finger, *recordings, *tests, *before])
    with Bar(progress) as bar:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DiagnosisWarning)  # printed below, one line each
            diagnosed = find(
                finger, recordings, test=tests, reference=before or None, progress=bar.phase, **vars(options)
            )
        bar("writing the files")
        written = diagnosed.write(output)
    print_results(
        diagnosis_text.tables(diagnosed.found),
        diagnosis_text.lines(diagnosed.found),
        left="may also be",
        warnings=diagnosed.warnings,
    )
    say_files(written)
    print_json((output / REPORT).read_text)


def _history(
    finger: Path,
    recordings: list[Path],
    reference: list[Path],
    output: Path,
    scheduler: str | None,
    options: DiagnoseOptions,
    progress: bool | None,
) -> None:
    """Run `diagnose --history`."""
    from contextlib import nullcontext

    from tendonfmu.diagnosis import Names, diagnose_history
    from tendonfmu.estimate import check_given_once
    from tendonfmu.files import check_output_folder
    from tendonfmu.model import read_finger
    from tendonfmu.report import headline, history_report, rows_of_lines, write_history
    from tendonfmu.tasks import workers_of

    check_given_once(recordings, reference, "the reference")
    check_output_folder(output)
    given = read_finger(finger)
    several = scheduler is not None or options.jobs > 1
    with (
        workers_of(scheduler, options.jobs) if several else nullcontext() as client,
        progress_bar("recordings", progress, total=2 * len(recordings)) as show,
    ):
        history = diagnose_history(
            given,
            recordings,
            reference,
            rows=output,
            client=client,
            kinematics=options.kinematics,
            least_gain=options.least_gain,
            seed=options.seed,
            progress=show,
        )
    names = Names(tuple(given.joint_names), tuple(given.tendon_names))
    written = write_history(history, names, output)
    headings = ("cause", "place", "reference", "last", "named in", "trend")
    rows = list(rows_of_lines(history, names))
    print_results([(history.finger, headings, rows)] if rows else (), [headline(history)], left="trend")
    for name, why in history.failed:
        warn(f"{name}: left out: {why}")
    say_files(written)
    print_json(lambda: history_report(history, written))
