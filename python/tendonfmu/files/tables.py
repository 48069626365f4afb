"""How tables of finite numbers are read and written: exact, whole, with errors by column and row.

CSV, Parquet and pandas tables are read and written, MCAP is written: one topic, with a JSON message for each row, whose
schema names each column, so that PlotJuggler and Foxglove offer them. Rows count from 1, without the line of names.
"""

from __future__ import annotations

import csv
import importlib
import itertools
import json
import math
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError, is_without_memory
from tendonfmu.files.writing import are, counted, path_of, whole_file

if TYPE_CHECKING:
    import pandas as pd
    from typing_extensions import TypeIs

FORMATS = (".csv", ".parquet")
OUTPUTS = (*FORMATS, ".mcap")
COMPRESSION = 12  # of Parquet, zstd; a minute of a quantised recording at 500 Hz takes about 1 MB and 1 s
LONG_COMPRESSION = 3  # of tables that come in several blocks: a third of the time, and 10 % more bytes
MCAP_TOPIC, MCAP_SCHEMA = "/tendonfmu", "tendonfmu.Table"
LATEST = 2**63  # ns; readers of MCAP take times as signed 64-bit integers

Table = dict[str, NDArray[np.float64]]
CheckNames = Callable[[Path, list[str]], Sequence[str] | None]

# float() accepts more (1_000, nan, infinity), but such text is no measurement.
_NUMBER = re.compile(r"[ \t\r\n]*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?[ \t\r\n]*")
LOGS = "pip install h5py mcap mcap-protobuf-support rosbags"  # the extra `logs`: nothing is published yet
_FLAGS = {"true": 1.0, "false": 0.0}


def require_extra(module: str, what: str) -> Any:
    """Import a module of the extra `logs`."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as missing:
        name = (missing.name or module).split(".")[0]
        raise InputError(f"{what}: needs the Python package {name}, which is not installed; {LOGS}") from None


def read_table(path: str | os.PathLike[str], check_names: CheckNames, flags: Collection[str] = ()) -> Table:
    """Read all columns of a file as finite numbers."""
    # returns columns [N] in their order
    file = path_of(path)  # a path of its own kind keeps its name in messages
    check_format(file)
    if not file.is_file():
        raise InputError(f"{file}: no such file; expected a recording, .csv or .parquet")
    try:
        table = (_read_csv if file.suffix.lower() == ".csv" else _read_parquet)(file, check_names, flags)
    except OSError as error:
        if is_without_memory(error):
            raise
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from None
    check_finite(file, table)
    return table


def check_finite(file: Path, table: Mapping[str, NDArray[np.float64]]) -> None:
    """Check that a table has rows and holds finite numbers."""
    # table: [N]
    if not len(next(iter(table.values()))):
        raise InputError(f"{file}: no samples; expected at least one row below the column names")
    for name, column in table.items():
        if not np.isfinite(column).all():
            row = int(np.flatnonzero(~np.isfinite(column))[0]) + 1
            raise InputError(f"{file}: column {name}, row {row}: {column[row - 1]:g}; expected a finite number")


def check_format(file: Path) -> None:
    """Check the suffix of a table's file."""
    if file.suffix.lower() not in FORMATS:
        raise InputError(f"{file}: unknown format {file.suffix!r}; expected .csv or .parquet")


def check_output_format(file: Path) -> None:
    """Check the suffix of a table that is written for other programs too."""
    if file.suffix.lower() not in OUTPUTS:
        raise InputError(f"{file}: unknown format {file.suffix!r}; expected .csv, .parquet or .mcap")
    if file.suffix.lower() == ".mcap":
        require_extra("mcap.writer", str(file))


def check_duplicates(file: Path, names: list[str]) -> None:
    """Raise InputError if a column occurs twice."""
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{file}: column {name!r} occurs {names.count(name)} times; expected once")


# --- pandas -----------------------------------------------------------------------------------------------------------


def is_frame(value: object) -> TypeIs[pd.DataFrame]:
    """Return whether a value is a pandas DataFrame, without importing pandas."""
    pandas = sys.modules.get("pandas")
    return pandas is not None and isinstance(value, pandas.DataFrame)


def frame_of(columns: Mapping[str, NDArray[Any]]) -> pd.DataFrame:
    """Make a DataFrame."""
    import pandas as pd

    frame: pd.DataFrame = pd.DataFrame(dict(columns))
    return frame


def table_of_frame(file: Path, frame: pd.DataFrame, check_names: CheckNames, flags: Collection[str] = ()) -> Table:
    """Read the columns of a DataFrame as finite numbers."""
    # returns columns [N] in their order
    if not is_frame(frame):
        raise InputError(f"{file}: {type(frame).__name__}; expected a pandas DataFrame")
    names = [str(name) for name in frame.columns]
    check_duplicates(file, names)
    wanted = check_names(file, names)
    table = {
        name: _frame_numbers(file, name, frame.iloc[:, names.index(name)], flags)
        for name in (names if wanted is None else wanted)
    }
    check_finite(file, table)
    return table


def _frame_numbers(file: Path, name: str, column: pd.Series[Any], flags: Collection[str]) -> NDArray[np.float64]:
    """Return one column. A missing value becomes NaN."""
    from pandas.api import types

    kind = column.dtype
    if types.is_bool_dtype(kind) and name not in flags:
        raise InputError(f"{file}: column {name}, row 1: {kind} values; expected numbers")
    if types.is_datetime64_any_dtype(kind) or types.is_timedelta64_dtype(kind):
        since = f"df[{name!r}]" if types.is_timedelta64_dtype(kind) else f"(df[{name!r}] - df[{name!r}].iloc[0])"
        raise InputError(
            f"{file}: column {name}: {kind} values; expected seconds as numbers, such as {since}.dt.total_seconds()"
        )
    if types.is_numeric_dtype(kind) and not types.is_complex_dtype(kind):
        return column.to_numpy(dtype=np.float64, na_value=np.nan)
    number = (int, float, np.integer, np.floating) + ((bool, np.bool_) if name in flags else ())
    for row, value in enumerate(column, start=1):
        if not isinstance(value, number) or (isinstance(value, bool) and name not in flags):
            raise InputError(f"{file}: column {name}, row {row}: {value!r}; expected a finite number")
    return column.to_numpy(dtype=np.float64)


# --- Parquet ----------------------------------------------------------------------------------------------------------


def _read_parquet(file: Path, check_names: CheckNames, flags: Collection[str]) -> Table:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(file, pre_buffer=False) as parquet:  # without threads, which end the process without memory
            names = parquet.schema_arrow.names
            check_duplicates(file, names)
            wanted = check_names(file, names)
            names = names if wanted is None else list(wanted)
            columns = parquet.read(columns=names, use_threads=False).select(names).columns
    except MemoryError:
        raise
    except pa.ArrowException as error:
        raise InputError(f"{file}: not a whole Parquet file ({str(error).splitlines()[0]})") from None
    return {name: _numbers(file, name, column, flags) for name, column in zip(names, columns, strict=True)}


def _numbers(file: Path, name: str, column: Any, flags: Collection[str]) -> NDArray[np.float64]:
    """Return one Arrow column. A missing value becomes NaN."""
    import pyarrow as pa

    kind = column.type
    numeric = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind)
    if not numeric and not (pa.types.is_boolean(kind) and name in flags):
        row = next((k for k, value in enumerate(column, start=1) if value.is_valid), 1)
        raise InputError(f"{file}: column {name}, row {row}: {kind} values; expected numbers")
    return np.asarray(column.cast(pa.float64()).to_numpy(), dtype=np.float64)


# --- CSV --------------------------------------------------------------------------------------------------------------


def _read_csv(file: Path, check_names: CheckNames, flags: Collection[str]) -> Table:
    header, rows, cut_off = _lines(file)
    names = [name.strip() for _, fields in _fields(file, [header], 0) for name in fields]
    if not any(names):
        raise InputError(f"{file}: empty file; expected a line of column names")
    check_duplicates(file, names)
    wanted = check_names(file, names)
    read = range(len(names)) if wanted is None else [names.index(name) for name in wanted]
    columns = _parse_fast(rows, len(names), read) if rows else np.empty((0, len(read)))
    if columns is None:
        columns = _parse_by_field(file, names, read, rows, flags, cut_off)
    if cut_off:
        raise InputError(
            f"{file}: truncated last line, row {len(rows) + 1}: {cut_off!r}; expected {counted(len(names), 'number')} "
            f"and a line end; the {counted(len(rows), 'row')} before it {are(len(rows))} good"
        )
    return {names[i]: columns[:, k] for k, i in enumerate(read)}


def _lines(file: Path) -> tuple[str, list[str], str]:
    """Return the line of names, the whole lines of numbers, and the text after the last line end ("" if whole)."""
    # A line without a line end may have lost digits, so it never counts as whole.
    try:
        text = file.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{file}: not a text file in UTF-8; expected CSV") from None
    if "\0" in text:
        raise InputError(f"{file}: not a text file; expected CSV")
    header, *lines = [line.rstrip("\r") for line in text.split("\n")]
    cut_off = lines.pop() if lines else ""
    return header, [line for line in lines if line.strip()], cut_off.strip()


def _parse_fast(rows: list[str], columns: int, read: Sequence[int]) -> NDArray[np.float64] | None:
    """Return the numbers [rows, columns to read], or None if a field needs a closer look."""
    if any(row.count(",") != columns - 1 for row in rows):
        return None
    try:
        return np.loadtxt(rows, dtype=np.float64, delimiter=",", comments=None, ndmin=2, usecols=read)
    except ValueError:
        return None


def _fields(file: Path, lines: Iterable[str], first: int) -> Iterator[tuple[int, list[str]]]:
    """Yield number and fields of each row. Raises InputError for what is no CSV, such as a lone carriage return."""
    row = first
    try:
        for row, fields in enumerate(csv.reader(lines), start=first):
            yield row, fields
    except csv.Error as error:
        reason = str(error).partition(" - ")[0]
        raise InputError(f"{file}: after row {row}: {reason}; expected numbers with commas between them") from None


def _parse_by_field(
    file: Path, names: list[str], read: Sequence[int], rows: Iterable[str], flags: Collection[str], cut_off: str
) -> NDArray[np.float64]:
    """Return the same, field by field, and refuse the first invalid field by name."""
    parsed = []
    lines = list(rows)
    for row, fields in _fields(file, lines, 1):
        if len(fields) < len(names) and row == len(lines) and not cut_off:
            raise InputError(
                f"{file}: truncated last line, row {row}: {len(fields)} of {counted(len(names), 'column')}; "
                f"the {counted(row - 1, 'row')} before it {are(row - 1)} good"
            )
        if len(fields) != len(names):
            raise InputError(f"{file}: row {row}: {counted(len(fields), 'field')}; expected {len(names)}")
        parsed.append([_parse_field(file, names[i], row, fields[i], flags) for i in read])
    return np.array(parsed, dtype=np.float64).reshape(len(parsed), len(read))


def _parse_field(file: Path, name: str, row: int, field: str, flags: Collection[str]) -> float:
    if name in flags and field.strip().lower() in _FLAGS:
        return _FLAGS[field.strip().lower()]
    if not _NUMBER.fullmatch(field) or not math.isfinite(float(field)):
        raise InputError(f"{file}: column {name}, row {row}: {field!r}; expected a finite number")
    return float(field)


# --- out --------------------------------------------------------------------------------------------------------------


def write_table(path: str | os.PathLike[str], table: Mapping[str, NDArray[Any]]) -> None:
    """Write columns of equal length as CSV, Parquet or MCAP, by the suffix: whole or not at all."""
    # table: [N]
    write_blocks(path, [table])


def write_blocks(path: str | os.PathLike[str], blocks: Iterable[Mapping[str, NDArray[Any]]]) -> None:
    """Write a table that comes in blocks of rows, as `write_table` does; only one block is in memory."""
    # blocks: [N]
    file = Path(path)
    check_output_format(file)
    write = {".csv": _write_csv, ".parquet": _write_parquet}.get(file.suffix.lower(), _write_mcap)
    with whole_file(file) as temporary:
        write(temporary, map(_columns, blocks))


def csv_lines(blocks: Iterable[Mapping[str, NDArray[Any]]]) -> Iterator[str]:
    """Yield the lines of a CSV file."""
    # blocks: [N]
    for k, columns in enumerate(map(_columns, blocks)):
        if k == 0:
            yield ",".join(columns) + "\n"
        # repr gives the shortest digits that read back as the same number
        for row in zip(*(map(repr, column.tolist()) for column in columns.values()), strict=True):
            yield ",".join(row) + "\n"


def _columns(table: Mapping[str, NDArray[Any]]) -> Table:
    """Return a table with flags as 0 and 1."""
    columns = {name: np.asarray(values) for name, values in table.items()}
    return {name: column.astype(np.uint8) if column.dtype == bool else column for name, column in columns.items()}


def _write_csv(file: Path, blocks: Iterable[Mapping[str, NDArray[Any]]]) -> None:
    with open(file, "w", encoding="utf-8", newline="\n") as out:
        out.writelines(csv_lines(blocks))


def _write_parquet(file: Path, blocks: Iterable[Mapping[str, NDArray[Any]]]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    rest = iter(blocks)
    first, second = next(rest), next(rest, None)
    if second is None:
        pq.write_table(pa.table(first), file, compression="zstd", compression_level=COMPRESSION)
        return
    schema = pa.table(first).schema
    with pq.ParquetWriter(file, schema, compression="zstd", compression_level=LONG_COMPRESSION) as out:
        for columns in itertools.chain((first, second), rest):
            out.write_table(pa.table(columns, schema=schema))


def _write_mcap(file: Path, blocks: Iterable[Mapping[str, NDArray[Any]]]) -> None:
    """Write a table."""
    # blocks: [N]
    writer_of = require_extra("mcap.writer", str(file))
    with open(file, "wb") as raw:
        writer = writer_of.Writer(raw)
        writer.start(profile="", library="tendonfmu")
        channel, count = -1, 0
        for columns in blocks:
            if channel < 0:
                channel = _add_channel(file, writer, columns)
            times = _nanoseconds(file, columns["time"])
            rows = zip(*(column.tolist() for column in columns.values()), strict=True)
            for at, row in zip(times, rows, strict=True):
                text = json.dumps(dict(zip(columns, row, strict=True)), separators=(",", ":"), allow_nan=False)
                writer.add_message(channel, at, text.encode(), at, count)
                count += 1
        writer.finish()


def _add_channel(file: Path, writer: Any, columns: Mapping[str, NDArray[Any]]) -> int:
    if "time" not in columns:
        raise InputError(f"{file}: no column time; expected one, which gives the times of MCAP's messages")
    properties = {
        name: {"type": "integer" if column.dtype.kind in "iu" else "number"} for name, column in columns.items()
    }
    schema = {"title": MCAP_SCHEMA, "type": "object", "properties": properties}
    number = writer.register_schema(MCAP_SCHEMA, "jsonschema", json.dumps(schema).encode())
    return int(writer.register_channel(MCAP_TOPIC, "json", number))


def _nanoseconds(file: Path, time: NDArray[Any]) -> list[int]:
    stamps = np.round(np.asarray(time, dtype=np.float64) * 1e9)
    if len(stamps) and not (stamps.min() >= 0.0 and stamps.max() < LATEST):
        raise InputError(
            f"{file}: time {float(time[int(np.argmin(stamps))]):g} to {float(time[int(np.argmax(stamps))]):g} s; "
            "MCAP holds times from 0 s on, expected those, or .csv or .parquet"
        )
    return [int(stamp) for stamp in stamps]
