"""The command `simulate`: a recording of a simulated finger."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.console import print_json, progress_bar, say
from tendonfmu.cli.options import AsJson, Progress, Quiet
from tendonfmu.cli.standard_streams import check_table, name_of, reads, write_table
from tendonfmu.errors import InputError


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command()(simulate)


@reads("rig")
def simulate(
    rig: Annotated[Path, typer.Argument(metavar="RIG.json", help="rig of a simulated finger")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="REC.parquet", help="recording, .csv or .parquet")],
    truth: Annotated[
        Path | None, typer.Option(metavar="TRUTH.parquet", help="true signals to write, .csv or .parquet")
    ] = None,
    integrator: Annotated[str | None, typer.Option(metavar="cvode|fixed_step", help="[default: the rig's]")] = None,
    progress: Progress = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Simulate a finger and write the recording. The same rig gives the same numbers."""
    from tendonfmu.files import check_format, check_output
    from tendonfmu.simulate import INTEGRATORS, read_rig
    from tendonfmu.simulate import simulate as simulate_rig

    if integrator is not None and integrator not in INTEGRATORS:
        raise InputError(f"--integrator {integrator}: expected {' or '.join(INTEGRATORS)}")
    found = read_rig(rig)
    check_table(output, *found.files)
    if truth is not None:
        check_format(truth)
        check_output(truth, *found.files)
    if truth is not None and truth.resolve() == output.resolve():
        raise InputError(f"{truth}: the same file for recording and truth; expected two names")
    with progress_bar(progress) as bar:
        task = bar.add_task("samples", total=None)
        result = simulate_rig(
            found,
            truth=truth is not None,
            integrator=integrator,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    if truth is not None and result.truth is not None:
        write_table(truth, result.truth)
    write_table(output, result.recording)
    written = {"output": output} if truth is None else {"output": output, "truth": truth}
    print_json(lambda: result.report(found, written))
    for line in result.summary(found):
        say(f"{name_of(output)}: {line}")
