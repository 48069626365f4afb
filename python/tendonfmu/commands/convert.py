"""The command `convert`: any log as a recording."""

# ruff: noqa: RUF009 (`option` makes a field)

from __future__ import annotations

import json
import os
import re
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tendonfmu import files, model
from tendonfmu import recordings as recorded
from tendonfmu.commands import console
from tendonfmu.commands.command import command, output_option
from tendonfmu.errors import InputError, OutputError
from tendonfmu.options import File, Options, option

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tendonfmu.recordings import Conversion, Inspection, Proposal, Recording

TABLE, LEROBOT = "table", "lerobot"  # the formats whose columns a map describes
INSPECT = "inspect"
TAKEN = {  # format -> its options
    "davinci": ("radius", "pretension"),
    "emps": ("mass", "decimation"),
    TABLE: ("map", "finger"),
    LEROBOT: ("map", "episodes"),
    INSPECT: ("map", "episodes"),
}
CONVERSION = "tendonfmu-conversion-1"  # format of the report


def convert(log: str | os.PathLike[str], map: Mapping[str, Any] | str | os.PathLike[str]) -> Recording:
    """Convert a log by a map of columns (`tendonfmu convert table`).

    Parameters
    ----------
    log
        CSV, Parquet, MATLAB, HDF5, MCAP or ROS 2 bag.
    map
        The map, or the file of it; `tendonfmu convert inspect` proposes one.

    Returns
    -------
    Recording
        The log with the columns of a recording; its path is that of the log.

    Raises
    ------
    InputError
        The log or the map does not allow it.
    """
    columns = recorded.convert_table(Path(log), map if isinstance(map, Mapping) else Path(map)).columns
    return recorded.Recording.from_frame(files.frame_of(columns), name=str(log))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ConvertOptions(Options):
    """Options of `convert`; each format takes those of `TAKEN`."""

    radius: float | None = option(
        None, "m; davinci: radius of the pulley with the recorded torque [default: 0.005]", None, 1e-6, 1.0
    )
    pretension: float | None = option(
        None,
        "N; davinci: pretension of the loop, records the closing cable only [default: 0, net force]",
        None,
        0.0,
        1e6,
    )
    mass: float | None = option(
        None, "kg; emps: moved mass, whose inertial force is known load [default: 95.1089]", None, 0.0, 1e6
    )
    decimation: int | None = option(None, "emps: keep one in so many samples, smoothed [default: 10]", None, 1, 1000)
    map_: File | None = option(
        None, 'name, unit and sign of each column; inspect: how a text is written, of its "log"', "MAP.json"
    )
    finger: File | None = option(None, "table: description of the one-joint machine to write", "FINGER.json")
    episodes: str | None = option(None, "lerobot, inspect: episodes to read [default: all]", "0-9,12")


@command("convert", ConvertOptions, reads=("file",))
def convert_files(
    source: Annotated[str, typer.Argument(metavar="FORMAT", help="davinci, emps, table, lerobot, or inspect")],
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="third-party recording; for table and inspect any log: CSV, Parquet, MATLAB, HDF5, MCAP, ROS 2 bag; "
            "for lerobot and inspect the folder of a LeRobot dataset",
        ),
    ],
    options: ConvertOptions,
    output: Annotated[
        Path | None,
        output_option(
            "REC.csv",
            "recording, .csv, .parquet or .mcap; lerobot: or a folder, for a recording of each episode; inspect: "
            "MAP.json to write",
        ),
    ] = None,
) -> None:
    """Convert a third-party recording or any log into a recording of tendonfmu.

    convert inspect LOG lists what is in a log and proposes a map; convert table
    LOG --map MAP.json -o REC.parquet converts it. convert lerobot FOLDER --map
    MAP.json -o DIR converts each episode of a LeRobot dataset.
    """
    if source not in TAKEN:
        raise InputError(f"convert: unknown format {source!r}; expected one of {', '.join(TAKEN)}")
    given = {name.rstrip("_"): value for name, value in vars(options).items() if value is not None}
    for name in (each for each in given if each not in TAKEN[source]):
        expected = " or ".join(f"--{each}" for each in TAKEN[source])
        others = files.listed([f"convert {other}" for other, taken in TAKEN.items() if name in taken])
        raise InputError(
            f"convert {source}: --{name}: not an option of this format, but of {others}; expected {expected}"
        )
    if source == INSPECT:
        report = _inspect(file, output, options.map_, options.episodes)
    elif output is None:
        raise InputError(f"convert {source}: --output: missing; expected the recording to write, -o REC.parquet")
    elif source in (TABLE, LEROBOT):
        report = _convert_table(source, file, output, options)
    else:
        console.check_table(output, file)
        table = recorded.convert_file(source, file, **given)
        console.write_table(output, table)
        report = _written(output, len(table["time"]), float(table["time"][-1] - table["time"][0]), [])
    console.print_json(lambda: report)


def _inspect(file: Path, output: Path | None, map_file: File | None, episodes: str | None) -> dict[str, Any]:
    """Print what is in a log, write the proposed map, and return both."""
    if output is not None:
        if output.suffix.lower() != ".json":
            raise InputError(f"{output}: unknown format {output.suffix!r}; expected a map, .json")
        files.check_output(output, file)
    log = None if episodes is None else recorded.LeRobotLog(file, chosen=episodes)
    inspection = recorded.inspect_log(file, log, None if map_file is None else recorded.read_log_format(Path(map_file)))
    proposal = recorded.propose(inspection)
    _print_inspection(inspection, proposal)
    for note in (*inspection.notes, *proposal.notes):
        console.warn(note)
    if output is not None:
        files.write_text(output, json.dumps(proposal.document, indent=1, ensure_ascii=False) + "\n")
        left = f'; "?" is left to you: {", ".join(proposal.undecided)}' if proposal.undecided else ""
        console.say(f"{output}: a map of {files.counted(len(proposal.lines), 'column')}{left}")
    return recorded.inspection_document(inspection, proposal)


def _print_inspection(inspection: Inspection, proposal: Proposal) -> None:
    headings = ("field", "type", "unit", "values", "missing", "least", "most")
    for topic in inspection.topics:
        line = recorded.clock_line(topic, proposal.time_factor)
        console.print_results([(topic.topic.name, headings, list(recorded.field_rows(topic)))], [line], "")
    orders = [order.line() for order in proposal.orders]
    columns = ("column", "field", "unit", "sure", "why")
    console.print_results(
        [("proposed map", columns, list(recorded.proposal_rows(proposal)))],
        [*orders, *recorded.unused_line(proposal)],
        "why",
    )


def _convert_table(source: str, file: Path, output: Path, options: ConvertOptions) -> dict[str, Any]:
    """Convert a log or dataset by its map, and write the description of a one-joint machine."""
    if options.map_ is None:
        raise InputError(
            f"convert {source}: --map: missing; expected a map of columns (JSON), see tendonfmu convert {INSPECT}"
        )
    map_file, episodes = Path(options.map_), options.episodes
    finger = None if options.finger is None else Path(options.finger)
    if source == LEROBOT and file.resolve() in (output.resolve(), *output.resolve().parents):
        raise InputError(f"{output}: a place in the dataset {file}; expected another one")
    if source == LEROBOT and output != console.DASH and output.suffix.lower() not in files.OUTPUTS:
        return _convert_episodes(file, output, map_file, episodes)
    console.check_table(output, file, map_file)
    console.check_second_file(finger, output, "recording and description", file, map_file)
    if finger is not None:
        return _convert_with_finger(file, output, map_file, finger)
    conversion = recorded.Conversion(
        file, map_file, recorded.LeRobotLog(file, chosen=episodes) if source == LEROBOT else None
    )
    return _written(output, *_write_in_blocks(conversion, output), conversion.notes)


def _convert_episodes(folder: Path, output: Path, map_file: Path, episodes: str | None) -> dict[str, Any]:
    """Write a recording of each episode of a LeRobot dataset to a folder, all or none."""
    files.check_output_folder(output)
    log = recorded.LeRobotLog(folder, chosen=episodes)
    made: dict[str, dict[str, Any]] = {}  # by the file's name
    said: dict[str, list[str]] = {}  # the episodes of each note
    target = output.absolute()
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}-") as scratch:
        for episode in log.episodes:
            alone, name = log.only(episode), f"episode_{episode.number:06d}.parquet"
            conversion = recorded.Conversion(folder, map_file, alone)
            try:
                count, duration = _write_in_blocks(conversion, Path(scratch, name))
            except OutputError as refused:
                raise OutputError(str(refused).replace(scratch, str(output))) from None
            made[name] = {"recording": str(output / name), "samples": count, "duration": duration}
            for note in conversion.notes:
                said.setdefault(note.removeprefix(f"{alone.file}: "), []).append(str(episode.number))
        target.mkdir(exist_ok=True)
        for name in made:
            os.replace(Path(scratch, name), target / name)
    notes = [f"{folder}: {note} (episode {files.listed(numbers)})" for note, numbers in said.items()]
    _say_notes(notes)
    console.say(f"{output}: {files.counted(len(made), 'recording')}")
    return {"format": CONVERSION, "recordings": list(made.values()), "notes": notes}


def _write_in_blocks(conversion: Conversion, output: Path) -> tuple[int, float]:
    """Write a recording, return its samples and s; if its map allows, only some rows are in memory at any time."""
    count, first, last = 0, 0.0, 0.0

    def with_count() -> Iterator[dict[str, NDArray[Any]]]:
        nonlocal count, first, last
        for columns in conversion.recording():
            first = first if count else float(columns["time"][0])
            count, last = count + len(columns["time"]), float(columns["time"][-1])
            yield columns

    console.write_blocks(output, with_count())
    return count, last - first


def _convert_with_finger(file: Path, output: Path, map_file: Path, finger: Path) -> dict[str, Any]:
    log = recorded.convert_table(file, map_file)
    description = model.description_text(recorded.describe_joint(log))
    console.write_table(output, log.columns)
    files.write_text(finger, description)
    time = log.columns["time"]
    report = _written(output, len(time), float(time[-1] - time[0]), log.notes)
    console.say(f"{finger}: the machine described as a finger; `tendonfmu fit` estimates its numbers")
    return report


def _written(output: Path, count: int, duration: float, notes: list[str]) -> dict[str, Any]:
    """Say what was written and what was left out or recovered, and return it."""
    _say_notes(notes)
    console.say(f"{console.name_of(output)}: {files.counted(count, 'sample')}, {duration:.3f} s")
    return {
        "format": CONVERSION,
        "recording": str(output),
        "samples": count,
        "duration": duration,
        "notes": notes,
    }


def _say_notes(notes: list[str]) -> None:
    for note in notes:
        # what the user should look at: doubtful units, and logs that were cut off
        if ": warning: " in note or re.search(" (is|are) kept$", note):
            console.warn(note.replace(": warning: ", ": ", 1))
        else:
            console.say(note)
