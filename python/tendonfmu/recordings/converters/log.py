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
import pyarrow as pa
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
    ".mat": ("array_log", "open_matlab"),
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), ("array_log", "open_hdf5")),
    **dict.fromkeys((".feather", ".arrow", ".jsonl", ".ndjson"), ("parquet_log", "TableLog")),
    **dict.fromkeys((".npz", ".npy"), ("array_log", "open_numpy")),
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
TIME_NAMES = (
    *("time", "t", "stamp", "timestamp", "time_s", "time_ms", "x_value", "datetime", "date_time", "date/time"),
    *("date time", "header.stamp", "@log_time"),
)
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
            expected = f"{known}, texts also with .gz, or the folder of a bag or dataset{advice}"
            raise InputError(f"{file}: unknown format {suffix!r}; expected {expected}")
        if not file.is_file():
            raise InputError(f"{file}: no such file; expected a log, {known}")
    folder = DATASET if (file / INFO).is_file() else FOLDER
    module, name = folder if file.is_dir() else FORMATS[suffix]
    opener = getattr(importlib.import_module(f"tendonfmu.recordings.converters.{module}"), name)
    log = cast("Log", opener(file, settings))
    split = SplitStamps(log)
    return _by_channel(cast("Log", split) if split.topics != log.topics else log)


def find_field(log: Log, source: str | int, where: str) -> tuple[Topic, str]:
    """Return topic and name of a field."""
    if isinstance(source, int):
        return _numbered(log, source, where)
    topics = [topic for topic in log.topics for field in topic.fields if field.name == source]
    if len(topics) > 1:
        times = f"column {source!r} of {where} occurs {len(topics)} times"
        raise InputError(f"{log.file}: {times}; expected once, or its number")
    if log.open_ended and not topics:
        by_length = sorted(log.topics, key=lambda topic: -len(topic.prefix))
        topics = [topic for topic in by_length if source.startswith(topic.prefix)]
    if not topics:
        names = [field.name for topic in log.topics for field in topic.fields]
        raise InputError(f"{log.file}: column {source!r} of {where} is missing; it has {_nearest(source, names)}")
    return topics[0], source


def _numbered(log: Log, number: int, where: str) -> tuple[Topic, str]:
    if len(log.topics) != 1:
        has = f"{log.file} has {counted(len(log.topics), 'topic')}"
        raise InputError(f"{where}.column = {number}: {has}; expected a name")
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


# --- logs with one value a row, whose channel a text names, as databases export them ----------------------------------

MOST, FEWEST = 200, 20  # channels; rows of a channel
CLOCK = "time"  # of each channel, after its name
VALUES = ("value", "val", "data")  # names of the values, where there are other numbers


def _by_channel(log: Log) -> Log:
    """Return the log with a topic for each channel if each of its rows is one value of one of them."""
    if len(log.topics) != 1 or log.open_ended:
        return log
    topic = log.topics[0]
    numbers = [field.name for field in topic.fields if field.kind == NUMBER]
    texts = [field.name for field in topic.fields if field.kind == TEXT]
    clock = next(iter(topic.clocks()), None)
    values = [name for name in numbers if name != clock]
    if len(values) > 1:
        values = [name for name in values if name.strip("_").lower() in VALUES]
    if clock is None or len(values) != 1 or not set(texts) - {clock}:
        return log
    rows = list(log.blocks({topic.name: [clock, *texts]}, texts))
    names = {name: _texts([block[name] for _, block in rows]) for name in texts if name != clock}
    several = [name for name, each in names.items() if pc.count_distinct(each).as_py() > 1]
    if len(several) != 1:
        return log
    channel, times = names[several[0]], np.concatenate([np.asarray(block[clock]) for _, block in rows])
    counts = {entry["values"]: entry["counts"] for entry in pc.value_counts(channel).to_pylist()}
    if None in counts or len(counts) > MOST or min(counts.values()) < FEWEST:
        return log
    # times of samples rise from row to row; those of values from one of a channel to the next
    if _rise(times) or not all(_rise(times[np.asarray(pc.equal(channel, name))]) for name in counts):
        return log
    return cast("Log", ChannelRows(log, (clock, several[0], values[0]), counts))


def _texts(blocks: Sequence[Any]) -> Any:
    return pa.chunked_array([pa.array(block, pa.string()) for block in blocks])


def _rise(times: NDArray[Any]) -> bool:
    return bool(np.all(times[1:] > times[:-1]))


class ChannelRows:
    """A log with one topic for each channel, of its times and its values."""

    open_ended = False

    def __init__(self, log: Log, columns: tuple[str, str, str], counts: Mapping[str, int]) -> None:
        """Take the log, its columns of times, of names and of values, and the rows of each channel."""
        self.log, self.file = log, log.file
        self._clock, self._name, self._value = columns
        fields = {field.name: field for field in log.topics[0].fields}
        self.topics = [
            Topic(
                channel,
                (
                    replace(fields[self._clock], name=f"{channel}.{CLOCK}"),
                    replace(fields[self._value], name=channel),
                ),
                count,
                f"{channel}.",
            )
            for channel, count in counts.items()
        ]

    @property
    def notes(self) -> list[str]:
        """What was recovered or left out, one sentence each."""
        channels = counted(len(self.topics), "channel")
        return [f"{self.file}: one value a row: {self._name} names {channels} of {self._value}", *self.log.notes]

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read fields, as every log does."""
        is_text = any(name.endswith(f".{CLOCK}") for name in texts)
        columns = [self._clock, self._name, self._value]
        topic = self.log.topics[0].name
        for _, block in self.log.blocks({topic: columns}, [self._name, *[self._clock] * is_text]):
            for channel, names in wanted.items():
                rows = np.asarray(pc.equal(block[self._name], channel))
                picked = {
                    f"{channel}.{CLOCK}": block[self._clock].filter(rows) if is_text else block[self._clock][rows],
                    channel: block[self._value][rows],
                }
                if rows.any():
                    yield channel, {name: picked[name] for name in names}
