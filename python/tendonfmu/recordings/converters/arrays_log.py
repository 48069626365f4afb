"""What MATLAB and HDF5 files have in common: arrays with names, which become topics and fields.

Arrays of one struct or group are a topic. A row is an element along the longer side of an array; the columns of a
matrix are fields `name[1]`, `name[2]`, ...
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.errors import InputError
from tendonfmu.files import counted
from tendonfmu.recordings.converters.log import (
    LONGEST,
    NUMBER,
    OTHER,
    TEXT,
    TIME_NAMES,
    Block,
    Field,
    Topic,
    as_numbers,
)

ROWS = 1 << 18  # of a block


@dataclass(frozen=True)
class Array:
    """An array of a file."""

    topic: str  # struct or group, with the separator at its end; "" at the top
    name: str  # full name
    shape: tuple[int, ...]  # as rows and columns are counted in the file
    dtype: np.dtype[Any]  # of its elements
    read: Callable[[int, int], Any]  # returns rows (start, stop) of it, [rows] or [rows, columns]
    unit: str = ""  # what the file states, or ""

    def fields(self) -> Iterator[tuple[Field, int | None]]:
        """Yield the fields, each with the column that it is; None: of the only one."""
        kind = {"b": NUMBER, "i": NUMBER, "u": NUMBER, "f": NUMBER, "S": TEXT, "U": TEXT, "O": TEXT}.get(
            self.dtype.kind, OTHER
        )
        kind_name = str(self.dtype)
        if len(self.shape) < 2 or self.shape[1] == 1:
            yield Field(self.name, kind, kind_name, self.unit), None
        elif self.shape[1] <= LONGEST and len(self.shape) == 2:
            for k in range(self.shape[1]):
                yield Field(f"{self.name}[{k + 1}]", kind, kind_name, self.unit), k
        else:
            sizes = " x ".join(str(size) for size in self.shape)
            yield Field(self.name, OTHER, f"{kind_name} {sizes}", self.unit), None


def rows_of(values: Any, start: int, stop: int) -> Any:
    """Return rows of an array or dataset."""
    return values[start:stop]


def turned_rows(values: Any, start: int, stop: int) -> Any:
    """Return columns of an array or dataset as rows."""
    return np.asarray(values[:, start:stop]).T


class ArraysLog:
    """A file of arrays."""

    open_ended = False

    def __init__(self, file: Path, arrays: Sequence[Array], notes: list[str]) -> None:
        self.file = file
        self.notes = notes
        self._columns: dict[str, tuple[Array, int | None]] = {}
        arrays = [array for array in arrays if array.shape[0] > 1]  # a single value is a setting, not a signal
        self.topics: list[Topic] = []
        for group in _together(arrays):
            self._add_topic(group)
        if not self.topics:
            said = f" ({'; '.join(notes)})" if notes else ""
            raise InputError(f"{file}: no arrays of numbers{said}; expected at least a time and a force")

    def _add_topic(self, arrays: Sequence[Array]) -> None:
        fields = []
        for array in arrays:
            for field, column in array.fields():
                self._columns[field.name] = (array, column)
                fields.append(field)
        prefix = arrays[0].topic
        title = prefix.rstrip("/.") or "top"
        if any(topic.name == title for topic in self.topics):
            title = f"{title} ({counted(arrays[0].shape[0], 'row')})"
        self.topics.append(Topic(title, tuple(fields), arrays[0].shape[0], prefix))

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read columns; see `log.Log`."""
        for topic in self.topics:
            names = wanted.get(topic.name)
            if not names:
                continue
            for start in range(0, topic.rows or 0, ROWS):
                yield topic.name, {name: self._values(name, start) for name in names}

    def _values(self, name: str, start: int) -> Any:
        import pyarrow as pa

        array, column = self._columns[name]
        try:
            rows = np.asarray(array.read(start, min(start + ROWS, array.shape[0])))
        except (OSError, ValueError) as error:
            raise InputError(
                f"{self.file}: {name}: cannot be read ({error}); the file is damaged: copy it again, or write it again"
            ) from None
        values = rows.reshape(len(rows), -1)[:, column or 0] if rows.ndim > 1 else rows
        if values.dtype.kind in "SUO":
            texts = [each.decode("utf-8", "replace") if isinstance(each, bytes) else each for each in values.tolist()]
            if all(isinstance(each, str) for each in texts):
                return pa.array(texts, pa.string())
        if values.dtype.kind not in "biuf":
            raise InputError(f"{self.file}: column {name}, row {start + 1}: {values.dtype} values; expected numbers")
        return as_numbers(values)


def _together(arrays: Sequence[Array]) -> list[list[Array]]:
    """Return arrays that are sampled together: of one length, and of one group if several groups have a clock."""
    found = []
    for length in dict.fromkeys(array.shape[0] for array in arrays):
        alike = [array for array in arrays if array.shape[0] == length]
        groups = {
            name: [each for each in alike if each.topic == name] for name in dict.fromkeys(a.topic for a in alike)
        }
        timed = [name for name, members in groups.items() if _has_clock(name, members)]
        if len(timed) < 2:
            first = timed or list(groups)[:1]
            found.append([*groups.pop(first[0]), *(each for members in groups.values() for each in members)])
        else:
            found += list(groups.values())
    return found


def _has_clock(prefix: str, arrays: Sequence[Array]) -> bool:
    return any(array.name[len(prefix) :].lower() in TIME_NAMES for array in arrays)
