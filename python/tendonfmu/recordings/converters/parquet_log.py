"""How Parquet logs are read, batch by batch. Their index is at the end, so a file that is cut off cannot be read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tendonfmu.errors import InputError, is_without_memory
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.log import NUMBER, OTHER, ROWS, TEXT, TIME, Block, Field, Topic, as_numbers


class ParquetLog:
    """A Parquet log."""

    open_ended = False

    def __init__(self, file: Path, settings: LogFormat) -> None:
        self.file = file
        self.notes: list[str] = []
        with opened(file) as parquet:
            schema, rows = parquet.schema_arrow, parquet.metadata.num_rows
        fields = [Field(field.name, _kind(field.type), str(field.type), _unit(field)) for field in schema]
        self.topics = [Topic("", tuple(fields), rows)]

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read columns; see `log.Log`."""
        places = {name: self.topics[0].place(name) for name in wanted.get("", ())}
        row = 0
        with opened(self.file) as parquet:
            names = parquet.schema_arrow.names
            is_unique = len(set(names)) == len(names)  # otherwise columns cannot be chosen by name, and all are read
            chosen = sorted({names[place] for place in places.values()}) if is_unique else None
            try:
                for batch in parquet.iter_batches(ROWS, columns=chosen):
                    block = {}
                    for name, place in places.items():
                        column = batch.column(names[place] if is_unique else place)
                        block[name] = values_of(self.file, names[place], column, row)
                    yield "", block
                    row += batch.num_rows
            except (pa.ArrowException, OSError) as error:
                raise cut_off(self.file, error) from None


def opened(file: Path) -> Any:
    """Open a Parquet file."""
    try:
        return pq.ParquetFile(file)
    except (pa.ArrowException, OSError) as error:
        raise cut_off(file, error) from None


def cut_off(file: Path, error: Exception) -> Exception:
    """Return the error of a file that cannot be read."""
    if is_without_memory(error):
        return error
    return InputError(
        f"{file}: not a whole Parquet file ({str(error).splitlines()[0]}); its index is at its end, so "
        "nothing can be recovered: copy the file again, or write it again from its source"
    )


def values_of(file: Path, name: str, column: Any, row: int) -> Any:
    """Return a column as numbers or texts. row: rows before it. A missing number becomes NaN."""
    kind = _kind(column.type)
    if kind == TEXT:
        return column
    if kind == TIME:
        return np.asarray(column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64()).to_numpy(False))
    if kind == OTHER:
        at = next((k for k, value in enumerate(column, start=1) if value.is_valid), 1)
        raise InputError(f"{file}: column {name}, row {row + at}: {column.type} values; expected numbers")
    if pa.types.is_boolean(column.type):
        column = column.cast(pa.int8())
    if pa.types.is_integer(column.type) and not column.null_count:
        return as_numbers(column.to_numpy(False))
    return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(False), dtype=np.float64)


def _kind(kind: Any) -> str:
    if pa.types.is_timestamp(kind):
        return TIME
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        return TEXT
    numeric = (pa.types.is_integer, pa.types.is_floating, pa.types.is_boolean, pa.types.is_decimal, pa.types.is_null)
    return NUMBER if any(is_kind(kind) for is_kind in numeric) else OTHER


def _unit(field: Any) -> str:
    """Return the unit that the metadata of a column states, as pandas and others write it, or ""."""
    stated = field.metadata or {}
    return next((stated[key].decode("utf-8", "replace") for key in (b"unit", b"units") if key in stated), "")
