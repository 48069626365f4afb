"""Which columns a user's log has: CSV with any separator, also compressed by gzip, and Parquet.

Rows count from 1, without the line of names. Only the columns that are asked for need to be numbers.
"""

from __future__ import annotations

import csv
import gzip
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.column_map import SEPARATORS, ColumnMap, LogFormat, MappedColumn
from tendonfmu.recordings.converters.units import nearest

Series = NDArray[np.float64]
SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".log", ".parquet")
FLAGS = {"true": 1.0, "false": 0.0}


@dataclass(frozen=True)
class LogColumns:
    """Columns as they are in the log.

    Attributes
    ----------
    readings
        Readings [N] by the map's key.
    notes
        What was left out, one sentence each.
    """

    readings: Mapping[str, Series]
    notes: list[str] = field(default_factory=list)


def read_log(file: Path, wanted: ColumnMap) -> LogColumns:
    """Read the columns that a map names. Raise InputError with file, column, row and what was expected."""
    suffix = Path(file.stem).suffix if file.suffix.lower() == ".gz" else file.suffix
    if suffix.lower() not in SUFFIXES or (suffix.lower() == ".parquet" and file.suffix.lower() == ".gz"):
        raise InputError(f"{file}: unknown format {suffix!r}; expected {', '.join(SUFFIXES)}, text also with .gz")
    if not file.is_file():
        raise InputError(f"{file}: no such file; expected a log, {', '.join(SUFFIXES)}")
    found = _read_parquet(file, wanted) if suffix.lower() == ".parquet" else _read_text(file, wanted)
    for key, readings in found.readings.items():
        source = wanted.columns[key].source
        if not len(readings):
            raise InputError(f"{file}: no samples; expected at least one row of numbers")
        if not np.isfinite(readings).all():
            row = int(np.flatnonzero(~np.isfinite(readings))[0])
            raise InputError(f"{file}: column {source}, row {row + 1}: {readings[row]:g}; expected a finite number")
    return found


def _find(file: Path, wanted: ColumnMap, names: Sequence[str]) -> dict[str, int]:
    """Return the index, from 0, of each wanted column, by the map's key."""
    return {key: _place(file, wanted.path, column, names) for key, column in wanted.columns.items()}


def _place(file: Path, path: Path, column: MappedColumn, names: Sequence[str]) -> int:
    source = column.source
    if isinstance(source, int):
        if source > len(names):
            raise InputError(f"{path}: {column.path}.column = {source}: {file} has {len(names)} columns")
        return source - 1
    if names.count(source) != 1:
        count = names.count(source)
        what = f"occurs {count} times; expected once, or its number" if count else "is missing"
        raise InputError(
            f"{file}: column {source!r} of {column.path} in {path} {what}; it has {nearest(source, names)}"
        )
    return names.index(source)


# --- Parquet ----------------------------------------------------------------------------------------------------------


def _read_parquet(file: Path, wanted: ColumnMap) -> LogColumns:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(file) as parquet:
            table = parquet.read()
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{file}: not a whole Parquet file ({str(error).splitlines()[0]})") from None
    names = list(table.column_names)
    places = _find(file, wanted, names)
    return LogColumns({key: _arrow_numbers(file, names[i], table.column(i)) for key, i in places.items()})


def _arrow_numbers(file: Path, name: str, column: Any) -> Series:
    """Return a column as numbers. A missing value becomes NaN."""
    import pyarrow as pa

    kind = column.type
    numeric = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)
    if not numeric:
        row = next((k for k, value in enumerate(column, start=1) if value.is_valid), 1)
        raise InputError(f"{file}: column {name}, row {row}: {kind} values; expected numbers")
    flags = column.cast(pa.int8()) if pa.types.is_boolean(kind) else column
    return np.asarray(flags.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)


# --- text -------------------------------------------------------------------------------------------------------------


def _read_text(file: Path, wanted: ColumnMap) -> LogColumns:
    lines, notes = _lines(file, wanted.log.skip)
    if not lines:
        raise InputError(f"{file}: no line after the {wanted.log.skip} that the map skips; expected a line of names")
    separator = wanted.log.separator or _separator(lines[0], wanted.log)
    first = _fields(lines[0], separator)
    names = first if wanted.log.header else [str(i) for i in range(1, len(first) + 1)]
    rows = lines[1:] if wanted.log.header else lines
    places = _find(file, wanted, names)
    numbers = _parse_fast(rows, separator, wanted.log.decimal, len(names), list(places.values()))
    if numbers is None:
        numbers = _parse_by_field(file, rows, separator, wanted.log.decimal, names, list(places.values()))
    return LogColumns({key: numbers[:, k] for k, key in enumerate(places)}, notes)


def _lines(file: Path, skip: int) -> tuple[list[str], list[str]]:
    """Return the lines that are not empty, and a note if the last one has no line end: it may have lost digits."""
    try:
        content = gzip.decompress(file.read_bytes()) if file.suffix.lower() == ".gz" else file.read_bytes()
        text = content.decode("utf-8-sig")
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise InputError(f"{file}: not a whole gzip file ({error})") from None
    except UnicodeDecodeError:
        raise InputError(f"{file}: not a text file in UTF-8; expected CSV") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from None
    if "\0" in text:
        raise InputError(f"{file}: not a text file; expected CSV")
    *lines, rest = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    notes = []
    if rest.strip():
        notes.append(f"{file}: the last line has no line end and may be cut off; it is left out: {rest[:40]!r}")
    return [line for line in lines[skip:] if line.strip()], notes


def _separator(line: str, log: LogFormat) -> str:
    """Return the separator that occurs most in the first line. A space counts only if there is no other."""
    counts = {each: line.count(each) for each in SEPARATORS if each != log.decimal}
    tight = {each: count for each, count in counts.items() if each != " " and count}
    return max(tight, key=lambda each: tight[each]) if tight else " "


def _fields(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    return [name.strip() for name in next(csv.reader([line], delimiter=separator))]


def _parse_fast(
    rows: list[str], separator: str, decimal: str, columns: int, places: list[int]
) -> NDArray[np.float64] | None:
    """Return the wanted columns [rows, columns], or None if a field needs a closer look."""
    if not rows:
        return np.empty((0, len(places)))
    if decimal != "." or any('"' in row or _count(row, separator) != columns for row in rows):
        return None
    try:
        delimiter = None if separator == " " else separator
        return np.loadtxt(rows, dtype=np.float64, delimiter=delimiter, comments=None, usecols=places, ndmin=2)
    except ValueError:
        return None


def _count(row: str, separator: str) -> int:
    return len(row.split()) if separator == " " else row.count(separator) + 1


def _parse_by_field(
    file: Path, rows: list[str], separator: str, decimal: str, names: list[str], places: list[int]
) -> NDArray[np.float64]:
    """Return the same, field by field, and refuse the first invalid field by name."""
    parsed = np.empty((len(rows), len(places)))
    for k, line in enumerate(rows):
        fields = _fields(line, separator)
        if len(fields) != len(names):
            raise InputError(
                f"{file}: row {k + 1}: {len(fields)} fields between {separator!r}; expected {len(names)}, "
                "as in the first line"
            )
        for at, place in enumerate(places):
            parsed[k, at] = _number(file, names[place], k + 1, fields[place], decimal)
    return parsed


def _number(file: Path, name: str, row: int, text: str, decimal: str) -> float:
    plain = text.strip().lower()
    if plain in FLAGS:
        return FLAGS[plain]
    # a point in a number with a decimal comma separates thousands; this is refused, not guessed
    sound = "_" not in plain and (decimal == "." or "." not in plain)
    try:
        value = float(plain.replace(decimal, ".")) if sound else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{file}: column {name}, row {row}: {text!r}; expected a finite number")
    return value
