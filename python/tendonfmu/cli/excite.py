"""The command `excite`: a motion to record, and what can be identified from it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.console import print_json, print_tables, progress_bar, say, warn
from tendonfmu.cli.diagnose import discriminate as next_experiment
from tendonfmu.cli.options import AsJson, Progress, Quiet, Report, Seed
from tendonfmu.cli.standard_streams import check_table, name_of, reads, write_table
from tendonfmu.errors import InputError
from tendonfmu.files import counted


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command()(excite)


@reads("finger")
def excite(
    context: typer.Context,
    finger: Annotated[Path, typer.Argument(metavar="FINGER.json|RIG.json", help="finger description, or rig")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="MOTION.csv", help="motion, .csv or .parquet")],
    duration: Annotated[
        float, typer.Option(min=1.0, max=1e5, metavar="SECONDS", help="per pretension, in all with --alternate")
    ] = 400.0,
    max_speed: Annotated[float, typer.Option(min=1e-3, max=100.0, metavar="RAD/S", help="limit for every joint")] = 1.0,
    range_: Annotated[
        list[str] | None,
        typer.Option(
            "--range", metavar="JOINT=LOW:HIGH", help="joint range in rad, by number or name; may be repeated"
        ),
    ] = None,
    pretension: Annotated[
        list[float] | None,
        typer.Option(min=1e-3, max=1e6, metavar="NEWTON", help="mean tendon force; may be repeated [default: 10]"),
    ] = None,
    alternate: Annotated[
        float | None, typer.Option(min=1.0, metavar="SECONDS", help="time between changes of the pretension")
    ] = None,
    vary_tension: Annotated[
        str | None,
        typer.Option(metavar="LOW:HIGH", help="in N; vary the tension of each tendon in turn, without a pretension"),
    ] = None,
    vary_every: Annotated[
        float, typer.Option(min=2.0, max=1e5, metavar="SECONDS", help="time between changes of the tensions")
    ] = 10.0,
    max_acceleration: Annotated[
        float, typer.Option(min=0.1, max=1e4, metavar="RAD/S²", help="limit for every joint")
    ] = 10.0,
    rate: Annotated[float, typer.Option(min=20.0, max=10000.0, metavar="HZ", help="rows per second")] = 100.0,
    seed: Seed = 0,
    report: Report = None,
    discriminate: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="write the next experiment of this diagnosis; only --rate applies"),
    ] = None,
    progress: Progress = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Plan a training motion; report what it excites and which parameters it cannot identify."""
    if discriminate is not None:
        next_experiment(context, finger, discriminate, output, rate)
        return
    import json
    import shlex

    from tendonfmu.excite import Plan
    from tendonfmu.excite import training_motion as exciting
    from tendonfmu.files import check_output, write_text
    from tendonfmu.report import excite_text
    from tendonfmu.simulate import description_files, is_rig

    inputs = description_files(finger) if is_rig(finger) else [finger]
    check_table(output, *inputs)
    if report is not None:
        check_output(report, *inputs)
    if report is not None and report.resolve() == output.resolve():
        raise InputError(f"{report}: the same file for motion and report; expected two names")
    subject = exciting.read_subject(finger)
    ranges = exciting.find_ranges(subject, range_ or [])
    for span in ranges:
        if span.guessed:
            warn(f"joint {span.name}: {span.source}; set it with --range {span.name}=LOW:HIGH")
    vary = exciting.find_variation(vary_tension, vary_every, pretension, alternate)
    levels = exciting.find_pretensions(subject, pretension or [])
    plan = Plan(exciting.as_array(ranges), max_speed, duration, levels, alternate, rate, seed, vary, max_acceleration)
    with progress_bar(progress) as bar:
        task = bar.add_task("judging the motion", total=None)
        result = exciting.excite(subject, ranges, plan, lambda done, all_: bar.update(task, completed=done, total=all_))
    write_table(output, result.motion.columns())
    text = json.dumps(exciting.report(result, shlex.join(["tendonfmu", *sys.argv[1:]])), indent=1) + "\n"
    if report is not None:
        write_text(report, text)
    print_json(lambda: text)
    print_tables(excite_text.tables(result), excite_text.lines(result), left="cannot be identified")
    say(f"{name_of(output)}: {counted(len(result.motion.time), 'row')}, {result.motion.time[-1]:g} s")
