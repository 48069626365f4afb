"""The command `convert`: a third-party recording as a recording of tendonfmu."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tendonfmu.cli.console import say
from tendonfmu.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

TABLE = "table"  # the format whose columns a map describes


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command()(convert)


def convert(
    source: Annotated[str, typer.Argument(metavar="FORMAT", help="davinci, emps or table")],
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="third-party recording; for table any log in CSV or Parquet")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="REC.csv", help="recording, .csv or .parquet")],
    radius: Annotated[
        float | None,
        typer.Option(
            min=1e-6, max=1.0, help="m; davinci: radius of the pulley with the recorded torque \\[default: 0.005]"
        ),
    ] = None,
    pretension: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=1e6,
            help="N; davinci: pretension of the loop, records the closing cable only \\[default: 0, net force]",
        ),
    ] = None,
    mass: Annotated[
        float | None,
        typer.Option(
            min=0.0, max=1e6, help="kg; emps: moved mass, whose inertial force is known load \\[default: 95.1089]"
        ),
    ] = None,
    decimation: Annotated[
        int | None, typer.Option(min=1, max=1000, help="emps: keep one in so many samples, smoothed \\[default: 10]")
    ] = None,
    map_: Annotated[
        Path | None,
        typer.Option("--map", metavar="MAP.json", help="table: name, unit and sign of each column"),
    ] = None,
    finger: Annotated[
        Path | None,
        typer.Option(metavar="FINGER.json", help="table: description of the one-joint machine to write"),
    ] = None,
) -> None:
    """Convert a third-party recording into a recording of tendonfmu."""
    given = {"radius": radius, "pretension": pretension, "mass": mass, "decimation": decimation}
    options = {name: value for name, value in given.items() if value is not None}
    if source == TABLE:
        _convert_table(file, output, options, map_, finger)
        return
    for name, value in (("map", map_), ("finger", finger)):
        if value is not None:
            raise InputError(f"convert {source}: --{name}: not an option of this format; expected convert {TABLE}")
    from tendonfmu.files import check_format, check_output, write_table
    from tendonfmu.recordings import convert_file

    check_format(output)
    check_output(output, file)
    table = convert_file(source, file, options)
    write_table(output, table)
    _say_written(output, table["time"])


def _convert_table(
    file: Path, output: Path, options: Mapping[str, float], map_file: Path | None, finger: Path | None
) -> None:
    """Convert a log by its map, and write the description of a one-joint machine."""
    from tendonfmu.files import check_format, check_output, whole_file, write_table
    from tendonfmu.recordings import convert_table, describe_joint, description_text

    for name in options:
        raise InputError(f"convert {TABLE}: --{name}: not an option of this format; expected --map or --finger")
    if map_file is None:
        raise InputError(f"convert {TABLE}: --map: missing; expected a map of columns (JSON)")
    check_format(output)
    outputs = [output] if finger is None else [output, finger]
    for each in outputs:
        check_output(each, file, map_file)
    if finger is not None and finger.resolve() == output.resolve():
        raise InputError(f"{finger}: the same file for recording and description; expected two names")
    log = convert_table(file, map_file)
    description = None if finger is None else description_text(describe_joint(log))
    write_table(output, log.columns)
    for note in log.notes:
        say(f"tendonfmu: {note}")
    _say_written(output, log.columns["time"])
    if finger is not None and description is not None:
        with whole_file(finger) as temporary:
            temporary.write_text(description, encoding="utf-8")
        say(f"{finger}: the machine described as a finger; `tendonfmu fit` estimates its numbers")


def _say_written(output: Path, time: NDArray[Any]) -> None:
    say(f"{output}: {len(time)} samples, {time[-1] - time[0]:.3f} s")
