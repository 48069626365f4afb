"""The command `diagnose`: what is wrong with the model or the finger.

`register` adds it to the program; `excite` of `program.py` calls `discriminate`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.console import PhaseDisplay, print_json, print_tables, progress_bar, say, say_files, warn
from tendonfmu.cli.options import (
    AsJson,
    ExtendedFinger,
    FreeRecordings,
    Jobs,
    Kinematics,
    LeastGain,
    Progress,
    Quiet,
    Seed,
)
from tendonfmu.cli.several_values import SeveralValues
from tendonfmu.cli.standard_streams import check_table, name_of, write_table
from tendonfmu.errors import InputError
from tendonfmu.files import counted


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command(cls=SeveralValues)(diagnose)


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
        typer.Option(metavar="ADDRESS", help="dask cluster for --history [default: --jobs processes]"),
    ] = None,
    kinematics: Kinematics = 1,
    least_gain: LeastGain = 0.03,
    seed: Seed = 0,
    jobs: Jobs = 1,
    progress: Progress = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Show what the model gets wrong, name the cause, add it to the model and measure the gain.

    The given structure is fitted first: a cause is what no fit of it can
    explain. --test and --reference take several files at once after the
    recordings.

    With --reference a cause is what has changed since. The reference may have
    another motion, pretension or length, but the same motion shows most.
    Several recordings of now, in order of time, show how the change grows.

    DIR gets the page diagnosis.html, diagnosis.json, figures, and the model
    with its causes, extended.json and extended.fmu. With --history it gets the
    page history.html, history.csv and history.png: a line per recording and
    cause, and how fast each cause grows.
    """
    import warnings

    from tendonfmu.interface import DiagnosisWarning
    from tendonfmu.interface import diagnose as find
    from tendonfmu.report import REPORT, check_folder, diagnosis_text

    if not 0.0 <= least_gain <= 0.5:  # typer's range lets NaN pass
        raise InputError(f"--least-gain {least_gain:g}: expected 0 to 0.5")
    tests, before = test or [], reference or []
    if history:
        if tests:
            raise InputError("--test: given with --history; expected recordings in order of time only")
        _history(finger, recordings, before, output, scheduler, kinematics, least_gain, seed, jobs, progress)
        return
    if scheduler is not None:
        raise InputError("--scheduler: given without --history; expected both or neither")
    check_folder(output, [finger, *recordings, *tests, *before])
    with PhaseDisplay(progress) as display:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DiagnosisWarning)  # printed below, one line each
            diagnosed = find(
                finger,
                recordings,
                test=tests,
                reference=before or None,
                kinematics=kinematics,
                least_gain=least_gain,
                seed=seed,
                jobs=jobs,
                progress=display,
            )
        display.note("writing the files")
        written = diagnosed.write(output)
    found = diagnosed.found
    for sentence in diagnosed.warnings:
        warn(sentence)
    print_tables(diagnosis_text.tables(found), diagnosis_text.lines(found), left="may also be")
    say_files(written)
    print_json((output / REPORT).read_text)


def _history(
    finger: Path,
    recordings: list[Path],
    reference: list[Path],
    output: Path,
    scheduler: str | None,
    kinematics: int,
    least_gain: float,
    seed: int,
    jobs: int,
    progress: bool | None,
) -> None:
    """Run `diagnose --history`."""
    from contextlib import nullcontext

    from tendonfmu.diagnosis import diagnose_history
    from tendonfmu.estimate import check_given_once
    from tendonfmu.files import check_output_folder
    from tendonfmu.model import read_finger
    from tendonfmu.report import Names, history_report, history_text, write_history
    from tendonfmu.tasks import workers_of

    check_given_once(recordings, reference, "the reference")
    check_output_folder(output)
    given = read_finger(finger)
    several = scheduler is not None or jobs > 1
    with workers_of(scheduler, jobs) if several else nullcontext() as client, progress_bar(progress) as bar:
        task = bar.add_task("recordings", total=2 * len(recordings))
        found = diagnose_history(
            given,
            recordings,
            reference,
            rows=output,
            client=client,
            kinematics=kinematics,
            least_gain=least_gain,
            seed=seed,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    names = Names(tuple(given.joint_names), tuple(given.tendon_names))
    written = write_history(found, names, output)
    headings = ("cause", "place", "reference", "last", "named in", "trend")
    rows = list(history_text.rows_of_lines(found, names))
    print_tables([(found.finger, headings, rows)] if rows else (), [history_text.headline(found)], left="trend")
    for name, why in found.failed:
        warn(f"{name}: left out: {why}")
    say_files(written)
    print_json(lambda: history_report(found, written))


def discriminate(context: typer.Context, finger: Path, folder: Path, output: Path, rate: float) -> None:
    """Write the motion that a diagnosis asked for: `tendonfmu excite FINGER --discriminate DIR -o MOTION`."""
    from tendonfmu.diagnosis import discriminating_motion
    from tendonfmu.excite import read_subject
    from tendonfmu.simulate import description_files, is_rig

    own = {"finger", "output", "rate", "discriminate", "progress", "as_json", "quiet"}
    for each in context.command.params:
        source = context.get_parameter_source(str(each.name))
        if each.name not in own and source is not None and source.name == "COMMANDLINE":
            raise InputError(f"{each.opts[0]}: given with --discriminate {folder}; expected no other option but --rate")
    check_table(output, *(description_files(finger) if is_rig(finger) else [finger]))
    subject = read_subject(finger)
    found = discriminating_motion(folder, subject.finger.data, limits=subject.limits, rate=rate)
    columns = found.columns()
    write_table(output, columns)
    print_tables((), found.lines(), left="")
    print_json(lambda: found.report(output))
    say(f"{name_of(output)}: {counted(len(columns['time']), 'row')}, {columns['time'][-1]:g} s")
