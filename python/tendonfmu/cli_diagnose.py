"""The command about causes: `register` adds it to the program of `cli.py`, whose `excite` calls `discriminate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.console import PhaseDisplay, print_tables, say
from tendonfmu.errors import InputError
from tendonfmu.several_values import SeveralValues


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command(cls=SeveralValues)(diagnose)


def diagnose(
    finger: Annotated[Path, typer.Argument(metavar="FINGER.json", help="finger description, its structure as given")],
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING", help="free motion, .csv or .parquet")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder for page, report and model")],
    test: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="RECORDING",
            help="not trained on: the gain is measured here; may be repeated, or several at once after the recordings "
            "\\[default: parts of the recordings]",
        ),
    ] = None,
    kinematics: Annotated[
        int,
        typer.Option(
            min=1, max=3, help="1: tendon positions, 2: measured joint positions, 3: joint positions and velocities"
        ),
    ] = 1,
    least_gain: Annotated[
        float,
        typer.Option(min=0.0, max=0.5, metavar="SHARE", help="by which a cause has to lower the rms on unseen data"),
    ] = 0.03,
    seed: Annotated[int, typer.Option(min=0, max=2**53, help="of all that is drawn at random")] = 0,
    jobs: Annotated[int, typer.Option(min=1, max=64, help="processor cores to use; the result is the same")] = 1,
    progress: Annotated[
        bool | None, typer.Option("--progress/--no-progress", help="progress bar; by default on a terminal")
    ] = None,
) -> None:
    """Show what the model gets wrong, name the cause, extend the model by it and measure the gain.

    The given structure is fitted first: a cause is what that cannot mend. DIR gets the page diagnosis.html,
    diagnosis.json, figures, and the model with its causes, extended.json and extended.fmu.
    """
    from tendonfmu.diagnosis import diagnose as find
    from tendonfmu.diagnosis_files import check_folder, write_diagnosis
    from tendonfmu.diagnosis_text import lines, tables
    from tendonfmu.fit_files import check_given_once

    if not 0.0 <= least_gain <= 0.5:  # NaN passes the range
        raise InputError(f"--least-gain {least_gain:g}: expected 0 to 0.5")
    tests = test or []
    check_folder(output, [finger, *recordings, *tests])
    check_given_once(recordings, tests, "a test")
    with PhaseDisplay(progress) as display:
        found = find(
            finger,
            recordings,
            tests,
            kinematics=kinematics,
            least_gain=least_gain,
            seed=seed,
            jobs=jobs,
            progress=display,
        )
        display.note("writing the files")
        written = write_diagnosis(found, output)
    for sentence in found.warnings:
        say(f"tendonfmu: warning: {sentence}")
    print_tables(tables(found), lines(found), left="may also be")
    for path, what in written.items():
        say(f"{path}: {what}")


def discriminate(context: typer.Context, finger: Path, folder: Path, output: Path, rate: float) -> None:
    """`tendonfmu excite FINGER --discriminate DIR -o MOTION`: the motion that a diagnosis asked for."""
    from tendonfmu.discrimination import discriminating_motion
    from tendonfmu.excite import read_subject
    from tendonfmu.rig import description_files, is_rig
    from tendonfmu.tables import check_format, write_table
    from tendonfmu.whole_file import check_output

    own = {"finger", "output", "rate", "discriminate"}
    for each in context.command.params:
        source = context.get_parameter_source(str(each.name))
        if each.name not in own and source is not None and source.name == "COMMANDLINE":
            raise InputError(f"{each.opts[0]}: with --discriminate {folder}; expected no option but --rate beside it")
    check_format(output)
    check_output(output, *(description_files(finger) if is_rig(finger) else [finger]))
    subject = read_subject(finger)
    found = discriminating_motion(folder, subject.finger.data, limits=subject.limits, rate=rate)
    columns = found.columns()
    write_table(output, columns)
    print_tables((), found.lines(), left="")
    say(f"{output}: {len(columns['time'])} rows, {columns['time'][-1]:g} s")
