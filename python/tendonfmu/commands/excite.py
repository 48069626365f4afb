"""The command `excite`: a motion to record, and what can be identified from it."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tendonfmu import diagnosis, estimate, excite, files, simulate
from tendonfmu.commands import console
from tendonfmu.commands.command import Progress, Report, command, output_option
from tendonfmu.errors import InputError
from tendonfmu.options import ExciteOptions

if TYPE_CHECKING:
    from tendonfmu.estimate import EffectCoverage, Verdict
    from tendonfmu.excite import ExciteResult
    from tendonfmu.report import Row, Table

KEYS = ("static", "coulomb", "stribeck_velocity", "viscous")
NEVER = ("side", "working_point", "slow")  # causes that another motion removes


@command("excite", ExciteOptions, reads=("finger",))
def excite_files(
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
        _discriminate(finger, discriminate, output, options, report, inputs)
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
    console.print_results(tables(result), lines(result), left="cannot be identified")
    console.say(
        f"{console.name_of(output)}: {files.counted(len(result.motion.time), 'row')}, {result.motion.time[-1]:g} s"
    )


def _discriminate(
    finger: Path, folder: Path, output: Path, options: ExciteOptions, report: Path | None, inputs: list[Path]
) -> None:
    """Write the motion that a diagnosis asked for."""
    usual = vars(ExciteOptions(rate=options.rate))
    given = [name.rstrip("_") for name, value in vars(options).items() if value != usual[name]]
    for name in [*given, *(["report"] if report else [])]:
        option = f"--{name.replace('_', '-')}"
        raise InputError(f"{option}: given with --discriminate {folder}; expected no other option but --rate")
    console.check_table(output, *inputs)
    subject = excite.read_subject(finger)
    motion = diagnosis.discriminating_motion(folder, subject.finger.data, limits=subject.limits, rate=options.rate)
    columns = motion.columns()
    console.write_table(output, columns)
    console.print_results((), motion.lines(), left="")
    console.print_json(lambda: motion.report(output))
    console.say(f"{console.name_of(output)}: {files.counted(len(columns['time']), 'row')}, {columns['time'][-1]:g} s")


# --- what a motion excites, in words ----------------------------------------------------------------------------------


def tables(result: ExciteResult) -> Iterator[Table]:
    """List the tables to print: joints, friction effects, kinds of numbers."""
    motion = result.motion
    yield (
        f"{result.subject.finger.name}: {motion.time[-1]:g} s of motion, {_load(result)}",
        ("joint", "range, rad", "fastest, rad/s", "strokes", "reversals", "slow reversals", "rests", "resting, s"),
        [
            (
                span.name,
                f"{cover.lowest:.3g} to {cover.highest:.3g}",
                f"{cover.fastest:.2f}",
                *map(str, (cover.strokes, cover.reversals, cover.slow_reversals, cover.rests)),
                f"{cover.resting:.1f}",
            )
            for span, cover in zip(result.ranges, result.joints, strict=True)
        ],
    )
    yield (
        "friction effects: time of sliding in each direction, and below v_min",
        ("effect", "positive, s", "negative, s", "below v_min, s", "cannot be identified"),
        [_effect_row(cover, result.judgement.verdicts) for cover in result.effects],
    )
    yield (
        f"numbers with a standard error of at most {estimate.identifiability.LIMIT:.0%}",
        ("kind", "numbers", "identified", "if all else were known"),
        [
            (f"{kind}.{key}", *map(str, counts))
            for (kind, key), counts in sorted(estimate.counts_by_kind(result.judgement.verdicts).items())
        ],
    )


def _load(result: ExciteResult) -> str:
    plan = result.plan
    if plan.vary is None:
        return f"pretension {', '.join(f'{level:g}' for level in plan.pretensions)} N"
    return f"tensions of {plan.vary.lowest:g} to {plan.vary.highest:g} N, changed every {plan.vary.every:g} s"


def _effect_row(cover: EffectCoverage, verdicts: list[Verdict]) -> Row:
    own = [v for v in verdicts if v.number.effect is not None and v.number.effect.path == cover.effect.path]
    missing = []
    for key in KEYS:
        of_key = [v for v in own if v.number.key == key]
        lost = [v for v in of_key if not v.identifiable]
        if lost:
            missing.append(key if len(lost) == len(of_key) else f"{key} ({len(lost)} of {len(of_key)})")
    times = cover.times
    return (
        cover.effect.path,
        *(f"{seconds:.1f}" for seconds in (times.positive, times.negative, times.stuck)),
        ", ".join(missing) or "-",
    )


def lines(result: ExciteResult) -> Iterator[str]:
    """List the lines to print: a summary, the assumptions, and which numbers another motion would identify."""
    judgement, noise = result.judgement, result.noise
    verdicts = judgement.verdicts
    known = sum(verdict.identifiable for verdict in verdicts)
    yield (
        f"{known} of {files.counted(len(verdicts), 'number')} can be identified one by one, "
        f"{files.counted(judgement.directions, 'independent combination')} of them; "
        "each joint's bias is tracked as well"
    )
    for cause, count in estimate.identifiability.causes(verdicts).items():
        yield f"  {count} not identified: {estimate.identifiability.CAUSES[cause]}"
    tendons, joints = len(result.subject.finger.tendon_names), len(result.ranges)
    if result.plan.vary is None and "combination" in estimate.identifiability.causes(verdicts) and tendons > joints + 1:
        yield "  --vary-tension LOW:HIGH loads the tendons in turn and identifies more of those combinations"
    yield (
        f"assumed: white noise of {noise.std:g} N·m + {noise.per_force:g} N·m per N in each {1e3 * noise.time:g} ms, "
        f"bias a random walk of {noise.drift:g} (N·m)²/s"
    )
    for verdict in verdicts:
        if verdict.cause in NEVER:
            yield f"  {verdict.number.path}: {verdict.reason}"
    for i, seconds in enumerate(result.slack, start=1):
        if seconds > 0:
            name = result.subject.finger.tendon_names[i - 1]
            higher = "--pretension" if result.plan.vary is None else "lowest tension of --vary-tension"
            yield f"  {name} would go slack for {seconds:.1f} s: a higher {higher} keeps it taut"
