"""What every log format is read as: topics, each a table of fields, read in blocks.

A CSV or Parquet file is one topic without a name. In a file of messages each topic has its own clock. To add a format,
write a module with a class (or function) that makes a `Log`, and add its suffix to `FORMATS`.
"""

from __future__ import annotations

import difflib
import importlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np
import pyarrow.compute as pc
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files import counted
from tendonfmu.recordings.converters.column_map import LogFormat

TEXTS = (".csv", ".txt", ".tsv", ".dat", ".log", ".lvm")
# suffix: module and name of what opens it
FORMATS = {
    **dict.fromkeys(TEXTS, ("text_log", "TextLog")),
    ".parquet": ("parquet_log", "ParquetLog"),
    ".mat": ("matlab_log", "open_matlab"),
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), ("hdf5_log", "open_hdf5")),
    **dict.fromkeys((".feather", ".arrow", ".jsonl", ".ndjson"), ("parquet_log", "TableLog")),
    **dict.fromkeys((".npz", ".npy"), ("hdf5_log", "open_numpy")),
    ".mcap": ("ros2_bag_log", "McapLog"),
    ".db3": ("ros2_bag_log", "open_bag"),
}
# formats that another program turns into one of these
ELSEWHERE = {
    ".bag": "a bag of ROS 1 becomes one of ROS 2 by `rosbags-convert --src LOG.bag --dst LOG`",
    ".tdms": "TDMS becomes CSV or HDF5 by the Python package npTDMS, or in LabVIEW",
    ".xlsx": "save the sheet as CSV",
    ".pkl": "write it by DataFrame.to_parquet",
}
FOLDER = ("ros2_bag_log", "open_bag")
DATASET, INFO = ("lerobot_log", "LeRobotLog"), "meta/info.json"  # a folder with this file is a LeRobot dataset

# Columns of some rows, by name: float64, int64 or bool arrays [N]; texts as an Arrow array. Times that the format
# declares as such are int64, in ns since 1970.
Block = dict[str, Any]

ROWS = 1 << 18  # of a block
NUMBER, TIME, TEXT, OTHER = "number", "time", "text", "other"  # kinds of fields
DATE_TIME = "date and time"  # type of a field that is made of two columns
TIME_NAMES: tuple[str, ...] = (
    "time",
    "t",
    "stamp",
    "timestamp",
    "time_s",
    "time_ms",
    "x_value",
    "datetime",
    "date_time",
    "date/time",
    "date time",
    "header.stamp",
)
TIME_NAMES += ("@log_time",)
NUMBERED = "#"  # before the number of a column whose name is not unique
NANOSECONDS = 10**9
# ends of the names of both columns, which begin alike
PAIRS = (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"), ("seconds", "nanos"), ("seconds", "nanoseconds"))
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

    def clocks(self) -> list[str]:
        """Return the names of fields that may be the clock, the most likely first."""
        ranks = {field.name: _rank(field, self.prefix) for field in self.fields if field.kind != OTHER}
        return sorted((name for name, rank in ranks.items() if rank is not None), key=lambda name: ranks[name] or 0)

    def place(self, name: str) -> int:
        """Return the index of a field by its name, or by `NUMBERED` and its number."""
        names = [field.name for field in self.fields]
        if name.startswith(NUMBERED) and name not in names:
            return int(name[len(NUMBERED) :]) - 1
        return names.index(name)


def _rank(field: Field, prefix: str) -> int | None:
    """Return how likely a field is a clock, 0 most likely, or None."""
    name = field.name.lower()
    if field.type == DATE_TIME:
        return 0
    # without a unit: "Time [s]", "t_ms"
    plain = re.sub(
        r"[_ ]*(\[.*\]|\(.*\)|_(s|sec|ms|msec|us|usec|ns|nsec))$", "", name.removeprefix(prefix.lower())
    ).lstrip("_")
    if plain in TIME_NAMES:
        return TIME_NAMES.index(plain)
    last = re.split(r"[/.]", re.sub(r"[\[(].*$", "", name))[-1]
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
        """Read fields: yield the name of a topic and some of its rows. texts: fields that are not numbers."""
        ...


def open_log(file: Path, settings: LogFormat) -> Log:
    """Open a log."""
    is_gzip = file.suffix.lower() == ".gz"
    suffix = (Path(file.stem).suffix if is_gzip else file.suffix).lower()
    known = ", ".join(FORMATS)
    if not file.is_dir():
        if suffix not in (TEXTS if is_gzip else FORMATS):
            advice = f"; {ELSEWHERE[suffix]}" if suffix in ELSEWHERE else ""
            raise InputError(
                f"{file}: unknown format {suffix!r}; expected {known}, texts also with .gz, or the folder of a bag "
                f"or dataset{advice}"
            )
        if not file.is_file():
            raise InputError(f"{file}: no such file; expected a log, {known}")
    folder = DATASET if (file / INFO).is_file() else FOLDER
    module, name = folder if file.is_dir() else FORMATS[suffix]
    opener = getattr(importlib.import_module(f"tendonfmu.recordings.converters.{module}"), name)
    log = cast("Log", opener(file, settings))
    split = SplitStamps(log)
    log = cast("Log", split) if split.topics != log.topics else log
    rows = importlib.import_module("tendonfmu.recordings.converters.channel_rows")
    return cast("Log", rows.by_channel(log))


def find_field(log: Log, source: str | int, where: str) -> tuple[Topic, str]:
    """Return topic and name of a field."""
    if isinstance(source, int):
        return _numbered(log, source, where)
    topics = [topic for topic in log.topics for field in topic.fields if field.name == source]
    if len(topics) > 1:
        raise InputError(
            f"{log.file}: column {source!r} of {where} occurs {len(topics)} times; expected once, or its number"
        )
    if log.open_ended and not topics:
        by_length = sorted(log.topics, key=lambda topic: -len(topic.prefix))
        topics = [topic for topic in by_length if source.startswith(topic.prefix)]
    if not topics:
        names = [field.name for topic in log.topics for field in topic.fields]
        raise InputError(f"{log.file}: column {source!r} of {where} is missing; it has {_nearest(source, names)}")
    return topics[0], source


def _numbered(log: Log, number: int, where: str) -> tuple[Topic, str]:
    if len(log.topics) != 1:
        raise InputError(
            f"{where}.column = {number}: {log.file} has {counted(len(log.topics), 'topic')}; expected a name"
        )
    names = [field.name for field in log.topics[0].fields]
    if number > len(names):
        raise InputError(f"{where}.column = {number}: {log.file} has {counted(len(names), 'column')}")
    name = names[number - 1]
    return log.topics[0], name if names.count(name) == 1 else f"{NUMBERED}{number}"


def _nearest(name: str, known: Iterable[str]) -> str:
    """Return the known names for a message, the most similar first, at most six."""
    names = list(known)
    folded = {name.casefold(): name for name in names}
    alike = [folded[match] for match in difflib.get_close_matches(name.casefold(), folded, n=3, cutoff=0.5)]
    listed = [*alike, *(name for name in names if name not in alike)]
    return ", ".join(listed[:6]) + (", ..." if len(listed) > 6 else "")


def as_numbers(values: Any) -> Any:
    """Return an array [N] as int64 or float64, whichever keeps its values."""
    array = np.asarray(values)
    if array.dtype.kind in "iu" and array.dtype != np.uint64:
        return array.astype(np.int64)
    return array.astype(np.float64)


# --- a time in two columns, whole seconds and the nanoseconds beyond, as ROS writes it into tables --------------------


class SplitStamps:
    """A log with each time of two columns as one field: `sec+nanosec` in ns since 1970, `Date+Time` a text."""

    def __init__(self, log: Log) -> None:
        self.log, self.file, self.open_ended = log, log.file, log.open_ended
        self._parts: dict[str, tuple[str, str]] = {}  # names of both columns, by that of the field
        self._texts: dict[str, tuple[str, str]] = {}  # of those, a date and a time of day
        self.topics = [self._with_stamps(topic) for topic in log.topics]

    @property
    def notes(self) -> list[str]:
        """What was recovered or left out, one sentence each."""
        return self.log.notes

    def _with_stamps(self, topic: Topic) -> Topic:
        names = [field.name for field in topic.fields]
        found = {}
        for name in names:
            for whole, rest in PAIRS:
                other = name.removesuffix(whole) + rest
                if name.endswith(whole) and name != other and names.count(name) == names.count(other) == 1:
                    found[f"{name}+{rest}"] = (name, other)
        texts = {field.name.lower(): field.name for field in topic.fields if field.kind == TEXT}
        for name in texts:
            other = re.sub("date(?!.*date)", "time", name)
            if name != other and other in texts:
                self._texts[f"{texts[name]}+{texts[other]}"] = (texts[name], texts[other])
        dates = {name: pair for name, pair in self._texts.items() if pair[0] in names}
        self._parts |= found | dates
        parts = {part for pair in (found | dates).values() for part in pair}
        fields = [replace(field, kind=OTHER if field.name in parts else field.kind) for field in topic.fields]
        joined = [*(Field(name, TIME) for name in found), *(Field(name, TEXT, DATE_TIME) for name in dates)]
        return replace(topic, fields=(*fields, *joined))

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read fields, as every log does."""
        asked = {
            topic: list(dict.fromkeys(part for name in names for part in self._parts.get(name, (name,))))
            for topic, names in wanted.items()
        }
        row = dict.fromkeys(wanted, 0)
        of_texts = [part for name in texts for part in self._texts.get(name, () if name in self._parts else (name,))]
        for topic, block in self.log.blocks(asked, of_texts):
            joined = {name: self._stamps(name, block, row[topic]) for name in wanted[topic] if name in self._parts}
            row[topic] += len(next(iter(block.values()), ()))
            yield topic, block | joined

    def _stamps(self, name: str, block: Block, row: int) -> Any:
        if name in self._texts:
            return pc.binary_join_element_wise(*(block[part] for part in self._texts[name]), " ")
        whole, rest = (self._whole(part, block[part], row) for part in self._parts[name])
        return whole * NANOSECONDS + rest

    def _whole(self, name: str, values: Any, row: int) -> NDArray[np.int64]:
        numbers = np.asarray(values)
        wrong = ~(np.abs(numbers) < 2.0**33) if numbers.dtype.kind == "f" else np.zeros(len(numbers), dtype=bool)
        if wrong.any():
            k = int(np.argmax(wrong))
            raise InputError(f"{self.file}: column {name}, row {row + k + 1}: {numbers[k]}; expected a part of a time")
        return numbers.astype(np.int64)
