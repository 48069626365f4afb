"""The command `excite`: a motion to record, and what can be identified from it."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from tendonfmu import diagnosis, excite, files, simulate
from tendonfmu import report as reporting
from tendonfmu.commands import console
from tendonfmu.commands.command import Progress, Report, command, output_option
from tendonfmu.errors import InputError
from tendonfmu.options import ExciteOptions


@command("excite", ExciteOptions, reads=("finger",))
def excite_files(
    context: typer.Context,
    finger: Annotated[Path, typer.Argument(metavar="FINGER.json|RIG.json", help="finger description, or rig")],
    output: Annotated[Path, output_option("MOTION.csv", "motion, .csv or .parquet")],
    options: ExciteOptions,
    report: Report = None,
    discriminate: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="write the next experiment of this diagnosis; only --rate applies"),
    ] = None,
    progress: Progress = None,
) -> None:
    """Plan a training motion; report what it excites and which parameters it cannot identify."""
    inputs = simulate.description_files(finger) if simulate.is_rig(finger) else [finger]
    if discriminate is not None:
        _discriminate(context, finger, discriminate, output, options.rate, inputs)
        return
    console.check_table(output, *inputs)
    console.check_second_file(report, output, "motion and report", *inputs)
    subject = excite.training_motion.read_subject(finger)
    ranges = excite.training_motion.find_ranges(subject, options.range_)
    for span in ranges:
        if span.guessed:
            console.warn(f"joint {span.name}: {span.source}; set it with --range {span.name}=LOW:HIGH")
    plan = excite.training_motion.plan_for(subject, ranges, options)
    with console.progress_bar("judging the motion", progress) as show:
        result = excite.training_motion.excite(subject, ranges, plan, show)
    console.write_table(output, result.motion.columns())
    text = json.dumps(excite.training_motion.report(result, shlex.join(["tendonfmu", *sys.argv[1:]])), indent=1) + "\n"
    if report is not None:
        files.write_text(report, text)
    console.print_json(lambda: text)
    console.print_results(
        reporting.excite_text.tables(result), reporting.excite_text.lines(result), left="cannot be identified"
    )
    console.say(
        f"{console.name_of(output)}: {files.counted(len(result.motion.time), 'row')}, {result.motion.time[-1]:g} s"
    )


def _discriminate(
    context: typer.Context, finger: Path, folder: Path, output: Path, rate: float, inputs: list[Path]
) -> None:
    """Write the motion that a diagnosis asked for."""
    allowed = {"finger", "output", "rate", "discriminate", "progress", "as_json", "quiet"}
    for parameter in context.command.params:
        source = context.get_parameter_source(str(parameter.name))
        if parameter.name not in allowed and source is not None and source.name == "COMMANDLINE":
            raise InputError(
                f"{parameter.opts[0]}: given with --discriminate {folder}; expected no other option but --rate"
            )
    console.check_table(output, *inputs)
    subject = excite.read_subject(finger)
    motion = diagnosis.discriminating_motion(folder, subject.finger.data, limits=subject.limits, rate=rate)
    columns = motion.columns()
    console.write_table(output, columns)
    console.print_results((), motion.lines(), left="")
    console.print_json(lambda: motion.report(output))
    console.say(f"{console.name_of(output)}: {files.counted(len(columns['time']), 'row')}, {columns['time'][-1]:g} s")
