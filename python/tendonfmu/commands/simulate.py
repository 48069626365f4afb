"""The command `simulate`: a recording of a simulated finger."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu import files, simulate
from tendonfmu.commands.command import Progress, command, output_option
from tendonfmu.commands.console import (
    check_second_file,
    check_table,
    name_of,
    print_json,
    progress_bar,
    say,
    write_table,
)


@command("simulate", reads=("rig",))
def simulate_files(
    rig: Annotated[Path, typer.Argument(metavar="RIG.json", help="rig of a simulated finger")],
    output: Annotated[Path, output_option("REC.parquet", "recording, .csv or .parquet")],
    truth: Annotated[
        Path | None, typer.Option(metavar="TRUTH.parquet", help="true signals to write, .csv or .parquet")
    ] = None,
    progress: Progress = None,
) -> None:
    """Simulate a finger and write the recording. The same rig gives the same numbers."""
    read = simulate.read_rig(rig)
    check_table(output, *read.files)
    if truth is not None:
        files.check_format(truth)
        check_second_file(truth, output, "recording and truth", *read.files)
    with progress_bar("samples", progress) as show:
        result = simulate.simulate(read, truth=truth is not None, progress=show)
    if truth is not None and result.truth is not None:
        write_table(truth, result.truth)
    write_table(output, result.recording)
    written = {"output": output} if truth is None else {"output": output, "truth": truth}
    print_json(lambda: result.report(read, written))
    for line in result.summary(read):
        say(f"{name_of(output)}: {line}")
