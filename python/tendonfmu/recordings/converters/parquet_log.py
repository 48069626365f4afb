"""How tables of Arrow are read, batch by batch: Parquet, Feather and lines of JSON.

A field of a struct is `state.force`, an element of a list `force[2]`. The index of a Parquet file is at its end, so a
file that is cut off cannot be read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from pyarrow import feather, json

from tendonfmu.errors import InputError, is_without_memory
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.log import (
    LONGEST,
    NUMBER,
    NUMBERED,
    OTHER,
    ROWS,
    TEXT,
    TIME,
    Block,
    Field,
    Topic,
    as_numbers,
)


class ParquetLog:
    """A log that Arrow reads as batches of a table: Parquet."""

    open_ended = False

    def __init__(self, file: Path, settings: LogFormat) -> None:
        self.file = file
        self.notes: list[str] = []
        schema, rows, first = self._begin()
        self._paths: dict[str, tuple[int, tuple[str | int, ...]]] = {}  # column, and the way to each field in it
        fields = []
        for place, column in enumerate(schema):
            values = None if first is None or not first.num_rows else first.column(place)
            for name, path, kind in _leaves(column.name, (), column.type, values):
                of_duration = str(kind.unit) if pa.types.is_duration(kind) else ""
                fields.append(Field(name, _kind(kind), str(kind), _unit(column) or of_duration))
                self._paths[f"{NUMBERED}{len(fields)}"] = self._paths[name] = place, path
        self.topics = [Topic("", tuple(fields), rows)]

    def _begin(self) -> tuple[Any, int, Any]:
        """Return the schema, the number of rows and the first of them."""
        with opened(self.file) as parquet:
            schema = parquet.schema_arrow
            first = next(parquet.iter_batches(1), None) if any(map(pa.types.is_nested, schema.types)) else None
            return schema, parquet.metadata.num_rows, first

    def _batches(self, places: Sequence[int]) -> Iterator[dict[int, Any]]:
        """Yield some columns, by their places in the schema."""
        with opened(self.file) as parquet:
            names = parquet.schema_arrow.names
            is_unique = len(set(names)) == len(names)  # otherwise columns cannot be chosen by name, and all are read
            chosen = [names[place] for place in places] if is_unique else None
            try:
                for batch in parquet.iter_batches(ROWS, columns=chosen):
                    yield {place: batch.column(names[place] if is_unique else place) for place in places}
            except (pa.ArrowException, OSError) as error:
                raise cut_off(self.file, error) from None

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read columns; see `log.Log`."""
        paths = {name: self._paths[name] for name in wanted.get("", ())}
        row = 0
        for columns in self._batches(sorted({place for place, _ in paths.values()})):
            yield (
                "",
                {
                    name: values_of(self.file, name, self._at(columns[k], path, name, row), row)
                    for name, (k, path) in paths.items()
                },
            )
            row += len(next(iter(columns.values()), ()))

    def _at(self, column: Any, path: Sequence[str | int], name: str, row: int) -> Any:
        """Return the part of a column at the end of a way."""
        for step in path:
            try:
                column = pc.struct_field(column, step) if isinstance(step, str) else pc.list_element(column, step)
            except pa.ArrowException:
                rows = f"rows from {row + 1} on: fewer elements than in the first row"
                raise InputError(f"{self.file}: column {name}, {rows}") from None
        return column


class TableLog(ParquetLog):
    """A log that is read at once: Feather, or a JSON document in each line."""

    def _begin(self) -> tuple[Any, int, Any]:
        try:
            if self.file.suffix.lower() in (".feather", ".arrow"):
                table = feather.read_table(self.file)
            else:
                table = json.read_json(self.file)
        except (pa.ArrowException, OSError) as error:
            reason = str(error).splitlines()[0]
            expected = "a table of Arrow, or a JSON object in each line"
            raise InputError(f"{self.file}: {reason}; expected {expected}") from None
        self._table = table.combine_chunks()
        return table.schema, table.num_rows, self._table.slice(0, 1)

    def _batches(self, places: Sequence[int]) -> Iterator[dict[int, Any]]:
        for batch in self._table.to_batches(ROWS):
            yield {place: batch.column(place) for place in places}


def _leaves(name: str, path: tuple[str | int, ...], kind: Any, values: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield name, way and type of each field in a column. values: its first rows."""
    if pa.types.is_struct(kind):
        for k in range(kind.num_fields):
            part = kind.field(k)
            inner = None if values is None else pc.struct_field(values, part.name)
            yield from _leaves(f"{name}.{part.name}", (*path, part.name), part.type, inner)
        return
    is_list = pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)
    length = len(values[0]) if is_list and values is not None and values[0].is_valid else 0
    if not 0 < length <= LONGEST:
        yield name, path, kind
        return
    for k in range(length):
        yield from _leaves(f"{name}[{k + 1}]", (*path, k), kind.value_type, pc.list_element(values, k))


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
    reason = str(error).splitlines()[0]
    return InputError(f"{file}: not a whole Parquet file ({reason}); nothing can be recovered: copy or write it again")


def values_of(file: Path, name: str, column: Any, row: int) -> Any:
    """Return a column as numbers or texts. row: rows before it. A missing number becomes NaN."""
    if pa.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    kind = _kind(column.type)
    if kind == TEXT:
        return column
    if kind == TIME:
        return np.asarray(column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64()).to_numpy(False))
    if kind == OTHER:
        at = next((k for k, value in enumerate(column, start=1) if value.is_valid), 1)
        raise InputError(f"{file}: column {name}, row {row + at}: {column.type} values; expected numbers")
    if pa.types.is_duration(column.type):
        column = column.cast(pa.int64())
    if pa.types.is_boolean(column.type):
        column = column.cast(pa.int8())
    if pa.types.is_integer(column.type) and not column.null_count:
        return as_numbers(column.to_numpy(False))
    return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(False), dtype=np.float64)


def _kind(kind: Any) -> str:
    if pa.types.is_dictionary(kind):
        return _kind(kind.value_type)
    if pa.types.is_timestamp(kind):
        return TIME
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        return TEXT
    is_number = any(
        getattr(pa.types, f"is_{name}")(kind)
        for name in ("integer", "floating", "boolean", "decimal", "null", "duration")
    )
    return NUMBER if is_number else OTHER


def _unit(field: Any) -> str:
    """Return the unit that the metadata of a column states, as pandas and others write it, or ""."""
    stated = field.metadata or {}
    return next((stated[key].decode("utf-8", "replace") for key in (b"unit", b"units") if key in stated), "")
