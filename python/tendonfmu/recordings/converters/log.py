"""What every log format is read as: topics, each a table of fields, read in blocks.

A CSV or Parquet file is one topic without a name. In a file of messages each topic has its own clock. A reader of a
format is a class with the members of `Log`; `log_file.open_log` chooses it by the suffix.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from tendonfmu.errors import InputError
from tendonfmu.files import counted
from tendonfmu.recordings.converters.units import nearest

# Columns of some rows, by name: float64, int64 or bool arrays [N]; texts as an Arrow array. Times that the format
# declares as such are int64, in ns since 1970.
Block = dict[str, Any]

NUMBER, TIME, TEXT, OTHER = "number", "time", "text", "other"  # kinds of fields
TIME_NAMES = ("time", "t", "stamp", "timestamp", "time_s", "time_ms", "header.stamp", "@log_time")
NUMBERED = "#"  # before the number of a column whose name is not unique
LONGEST = 64  # elements of an array that are listed as fields; images and clouds are not


@dataclass(frozen=True)
class Field:
    """A field of a topic."""

    name: str  # as a map names it; unique in the log, but for columns of CSV files that occur twice
    kind: str = NUMBER  # NUMBER, TIME, TEXT or OTHER
    type: str = ""  # as the log calls it, such as "double"
    unit: str = ""  # what the log states, or ""


@dataclass(frozen=True)
class Topic:
    """Fields with a common clock."""

    name: str  # "" if the log has only one
    fields: tuple[Field, ...]  # in the log's order
    rows: int | None = None  # number of rows, or None if it takes a pass over the log to count them
    prefix: str = ""  # with which the names of its fields begin

    def field(self, name: str) -> Field | None:
        """Return the field of that name, or None."""
        return next((each for each in self.fields if each.name == name), None)

    def clocks(self) -> list[str]:
        """Return the names of fields that may be the clock, the most likely first."""
        usable = [each for each in self.fields if each.kind != OTHER]
        ranks = {each.name: _rank(each, self.prefix) for each in usable}
        return sorted((name for name, rank in ranks.items() if rank is not None), key=lambda name: ranks[name] or 0)


def _rank(field: Field, prefix: str) -> int | None:
    """Return how likely a field is a clock, 0 most likely, or None."""
    name = field.name.lower()
    inner = name[len(prefix) :] if name.startswith(prefix.lower()) else name
    # without a unit: "Time [s]", "t_ms"
    inner = re.sub(r"[_ ]*(\[.*\]|\(.*\)|_(s|sec|ms|msec|us|usec|ns|nsec))$", "", inner)
    last = re.split(r"[/.]", re.sub(r"[\[(].*$", "", name))[-1]
    for k, wanted in enumerate(TIME_NAMES):
        if inner == wanted:
            return k
    if field.kind == NUMBER and last in TIME_NAMES:
        return len(TIME_NAMES) + TIME_NAMES.index(last)
    return 3 * len(TIME_NAMES) if field.kind == TIME else None


class Log(Protocol):
    """A log that has been opened."""

    file: Path  # the file or folder
    topics: list[Topic]  # what is in it
    notes: list[str]  # what was recovered or left out, one sentence each
    # whether messages may have more fields than are listed: elements of long arrays, joints that come later
    open_ended: bool

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read fields."""
        ...


def find_field(log: Log, source: str | int, where: str) -> tuple[Topic, str]:
    """Return topic and name of a field."""
    if isinstance(source, int):
        return _numbered(log, source, where)
    found = [(topic, field) for topic in log.topics for field in topic.fields if field.name == source]
    if len(found) > 1:
        raise InputError(
            f"{log.file}: column {source!r} of {where} occurs {len(found)} times; expected once, or its number"
        )
    if found:
        return found[0][0], found[0][1].name
    if log.open_ended:
        for topic in sorted(log.topics, key=lambda each: -len(each.prefix)):
            if source.startswith(topic.prefix):
                return topic, source
    names = [field.name for topic in log.topics for field in topic.fields]
    raise InputError(f"{log.file}: column {source!r} of {where} is missing; it has {nearest(source, names)}")


def _numbered(log: Log, number: int, where: str) -> tuple[Topic, str]:
    if len(log.topics) != 1:
        raise InputError(
            f"{where}.column = {number}: {log.file} has {counted(len(log.topics), 'topic')}; expected a name"
        )
    fields = log.topics[0].fields
    if number > len(fields):
        raise InputError(f"{where}.column = {number}: {log.file} has {counted(len(fields), 'column')}")
    name = fields[number - 1].name
    occurs = sum(field.name == name for field in fields)
    return log.topics[0], name if occurs == 1 else f"{NUMBERED}{number}"


def as_numbers(values: Any) -> Any:
    """Return an array [N] as int64 or float64, whichever keeps its values."""
    array = np.asarray(values)
    if array.dtype.kind in "iu" and array.dtype != np.uint64:
        return array.astype(np.int64)
    return array.astype(np.float64)
