"""The commands `build`, `run` and `simulate`: an FMU, the model over a recording, a recording of a simulated finger."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.command import Model, Progress, Subject, command
from tendonfmu.cli.console import check_second_file, check_table, name_of, print_json, progress_bar, say, write_table
from tendonfmu.cli.hand import run_hand
from tendonfmu.errors import InputError
from tendonfmu.options import BuildOptions, RunOptions


@command(BuildOptions, reads=("file",))
def build(
    file: Subject,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FINGER.fmu", help="FMU, or C source, to write")],
    reference: Annotated[
        Path | None, typer.Option(metavar="REC", help="recording; the FMU carries its inputs and outputs for checks")
    ] = None,
    *,
    options: BuildOptions,
) -> None:
    """Pack a co-simulation FMU: the friction of a finger, or the simulated finger of a rig.

    Needs no compiler. The same input gives the same bytes.
    """
    from tendonfmu.fmu import c_array_report, fmu_report
    from tendonfmu.interface import build as build_fmu
    from tendonfmu.model import read_finger

    build_fmu(file, output, reference=reference, **vars(options))
    say(f"{output}: {output.stat().st_size / 1024:.0f} KiB")
    if options.c_array:
        print_json(lambda: c_array_report(file, read_finger(file), output))
    else:
        print_json(lambda: fmu_report(file, output))


@command(RunOptions, reads=("model", "recording"))
def run(
    model: Model,
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="recording, .csv or .parquet")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="OUT.csv", help="table: .csv, .parquet or .mcap; -: as CSV")
    ],
    report: Annotated[
        Path | None, typer.Option(metavar="PAGE.html|DIR", help="page of the run; in a folder run.html")
    ] = None,
    rerun: Annotated[
        Path | None, typer.Option(metavar="OUT.rrd", help="recording for the viewer Rerun: signals and moving drawing")
    ] = None,
    *,
    options: RunOptions,
    progress: Progress = None,
) -> None:
    """Run the model over a recording and write all outputs, one row per sample at the time of that sample.

    Of a hand, all fingers run: their outputs are in one table, as
    index.joint_torque[1].
    """
    from tendonfmu.fmu import check_model, finger_of
    from tendonfmu.hand import is_hand
    from tendonfmu.interface import run as run_finger
    from tendonfmu.recordings import read_recording
    from tendonfmu.report import run_report

    if is_hand(model):
        if rerun is not None:
            raise InputError(f"{model}: a hand; --rerun shows one finger, expected FINGER.json or FINGER.fmu")
        run_hand(model, recording, output, report, options)
        return
    check_model(model)
    check_table(output, model, recording)
    if report is not None:
        from tendonfmu.report import check_page, write_run_page

        check_page(report, model, recording)
        if report.resolve() == output.resolve():
            raise InputError(f"{report}: the same file for outputs and page; expected two names")
    if rerun is not None:
        from tendonfmu.report import check_rerun, write_rerun

        check_rerun(rerun, model, recording)
    samples = read_recording(recording)
    with progress_bar("samples", progress, total=len(samples)) as show:
        result = run_finger(model, samples, progress=show, **vars(options))
    table = result.columns()
    write_table(output, table)
    numbers = run_report(
        model, recording, table, finger_of(model), kinematics=options.kinematics, output=name_of(output)
    )
    say(f"{name_of(output)}: {result.summary}")
    if report is not None:
        say(f"{write_run_page(report, numbers, table, samples.contact)}: the run, to be read in a browser")
    if rerun is not None:
        write_rerun(rerun, result.outputs, samples, finger_of(model))
        say(f"{rerun}: the run, for the viewer Rerun")
    print_json(lambda: numbers)


@command(reads=("rig",))
def simulate(
    rig: Annotated[Path, typer.Argument(metavar="RIG.json", help="rig of a simulated finger")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="REC.parquet", help="recording, .csv or .parquet")],
    truth: Annotated[
        Path | None, typer.Option(metavar="TRUTH.parquet", help="true signals to write, .csv or .parquet")
    ] = None,
    progress: Progress = None,
) -> None:
    """Simulate a finger and write the recording. The same rig gives the same numbers."""
    from tendonfmu.files import check_format
    from tendonfmu.simulate import read_rig
    from tendonfmu.simulate import simulate as simulate_rig

    read = read_rig(rig)
    check_table(output, *read.files)
    if truth is not None:
        check_format(truth)
        check_second_file(truth, output, "recording and truth", *read.files)
    with progress_bar("samples", progress) as show:
        result = simulate_rig(read, truth=truth is not None, progress=show)
    if truth is not None and result.truth is not None:
        write_table(truth, result.truth)
    write_table(output, result.recording)
    written = {"output": output} if truth is None else {"output": output, "truth": truth}
    print_json(lambda: result.report(read, written))
    for line in result.summary(read):
        say(f"{name_of(output)}: {line}")
