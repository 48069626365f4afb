"""How fields of messages are found by path: ROS 2, JSON and Protobuf messages alike.

| path | is |
| --- | --- |
| `/imu.linear_acceleration.x` | a field of a field |
| `/hand/tendons.effort[3]` | the third element of an array; indices start at 1 |
| `/joint_states.position[knuckle]` | the element of that name: the message lists names, as many as elements |
| `/joint_states.header.stamp` | a time, in ns |
| `/joint_states.@log_time`, `@publish_time` | when the message was recorded, sent; in ns |
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.files import are, counted
from tendonfmu.recordings.converters.log import LONGEST, NUMBER, OTHER, TEXT, TIME, Block, Field, Topic

LOG_TIME, PUBLISH_TIME = "@log_time", "@publish_time"
NAME_LISTS = ("name", "names", "joint_names", "joint_name")
ROWS = 1 << 16  # messages of a block
SAMPLES = 5  # messages of each topic whose fields are listed
NANOSECONDS = 10**9

_STEP = re.compile(r"\.?([^.\[\]]+)|\[([^\[\]]+)\]")


@dataclass
class Received:
    """A message as its file has it."""

    topic: str  # its topic
    log_time: int  # ns since 1970, or since an arbitrary start
    publish_time: int
    decode: Callable[[], Any]  # returns its content; raises ValueError if it is damaged


# --- content ----------------------------------------------------------------------------------------------------------


def members(value: Any) -> Mapping[str, Any] | None:
    """Return the fields of a message by name, or None if the value is no message."""
    if isinstance(value, Mapping):
        return value
    if hasattr(value, "__dataclass_fields__"):
        return {name: getattr(value, name) for name in value.__dataclass_fields__ if not name.startswith("__")}
    if hasattr(value, "DESCRIPTOR"):
        return {field.name: getattr(value, field.name) for field in value.DESCRIPTOR.fields}
    return None


def stamp_of(parts: Mapping[str, Any]) -> int | None:
    """Return the ns of a time, or None if the fields are not those of one."""
    for seconds, fraction in (("sec", "nanosec"), ("seconds", "nanos"), ("sec", "nsec"), ("secs", "nsecs")):
        if parts.keys() == {seconds, fraction}:
            return int(parts[seconds]) * NANOSECONDS + int(parts[fraction])
    return None


def leaves(value: Any, path: str = "", names: Sequence[str] = ()) -> Iterator[tuple[str, str, Any]]:
    """Yield (path, kind, value) of each field of a message, down to numbers."""
    parts = members(value)
    if parts is not None:
        stamp = stamp_of(parts)
        if stamp is not None:
            yield path, TIME, stamp
            return
        inner_names = names_of(parts) or names
        for name, inner in parts.items():
            yield from leaves(inner, f"{path}.{name}" if path else name, inner_names)
    elif isinstance(value, str | bytes):
        yield path, TEXT, value
    elif isinstance(value, bool | int | float | np.number | np.bool_):
        yield path, NUMBER, value
    elif isinstance(value, np.ndarray | Sequence) or hasattr(value, "__getitem__"):
        yield from _elements(value, path, names)


def _elements(value: Any, path: str, names: Sequence[str]) -> Iterator[tuple[str, str, Any]]:
    if len(value) > LONGEST:
        yield path, OTHER, f"array of {len(value)}"
        return
    by_name = len(names) == len(value) and len(set(names)) == len(names)
    for k, inner in enumerate(value):
        if isinstance(inner, str):
            continue
        yield from leaves(inner, f"{path}[{names[k] if by_name else k + 1}]", names)


def names_of(parts: Mapping[str, Any]) -> list[str]:
    """Return the list of names in a message, or an empty one."""
    for key in NAME_LISTS:
        found = parts.get(key)
        if found is not None and not isinstance(found, str) and len(found) and all(isinstance(n, str) for n in found):
            return list(found)
    return []


def getter(path: str) -> Callable[[Any], Any]:
    """Return a function that gets the field of a path, a number, text or time in ns, or None if it is not there."""
    steps = [(name, element) for name, element in _STEP.findall(path)]

    def get(message: Any) -> Any:
        parts = members(message)
        if parts is not None and path in parts:  # names in JSON may hold dots and brackets
            return _plain(parts[path])
        value: Any = message
        names: list[str] = []
        for name, element in steps:
            if name:
                parts = members(value)
                if parts is None or name not in parts:
                    return None
                names = names_of(parts) or names
                value = parts[name]
            else:
                place = int(element) - 1 if element.isdigit() else (names.index(element) if element in names else -1)
                if place < 0 or not hasattr(value, "__len__") or place >= len(value):
                    return None
                value = value[place]
        return _plain(value)

    return get


def _plain(value: Any) -> Any:
    if isinstance(value, bool | int | float | str | np.number | np.bool_):
        return value
    parts = members(value)
    return None if parts is None else stamp_of(parts)


# --- topics -----------------------------------------------------------------------------------------------------------


class FieldLister:
    """Lists the fields of topics from their first messages."""

    def __init__(self) -> None:
        self._found: dict[str, dict[str, Field]] = {}
        self._seen: dict[str, int] = {}

    def add(self, received: Received) -> None:
        """Take the fields of a message, if it is among the first of its topic."""
        seen = self._seen.get(received.topic, 0)
        self._seen[received.topic] = seen + 1
        if seen >= SAMPLES:
            return
        prefix = f"{received.topic}."
        fields = self._found.setdefault(received.topic, {})
        try:
            content = received.decode()
        except ValueError:
            return
        for path, kind, value in leaves(content):
            name = prefix + path
            said = str(value) if kind == OTHER else "time" if kind == TIME else type(value).__name__
            fields.setdefault(name, Field(name, kind, said))
        for path in (LOG_TIME, PUBLISH_TIME):
            fields.setdefault(prefix + path, Field(prefix + path, TIME, "time"))

    def topics(self) -> list[Topic]:
        """Return the topics in alphabetical order."""
        return [
            Topic(name, tuple(fields.values()), self._seen[name], f"{name}.")
            for name, fields in sorted(self._found.items())
            if fields
        ]


class Collector:
    """Collects fields of messages as columns."""

    def __init__(self, wanted: Mapping[str, Sequence[str]]) -> None:
        self._names = wanted
        self._getters = {
            topic: [_getter_of(name[len(topic) + 1 :]) for name in names] for topic, names in wanted.items()
        }
        self._rows: dict[str, list[list[Any]]] = {topic: [] for topic in wanted}
        self._damaged = 0

    def blocks(self, messages: Iterable[Received]) -> Iterator[tuple[str, Block]]:
        """Take all messages; yield the blocks of their topics."""
        for received in messages:
            yield from self._add(received)
        for topic, rows in self._rows.items():
            if rows:
                yield topic, self._block(topic)

    def notes(self, file: Path) -> list[str]:
        """Return what is to be said of the messages of a file: how many were damaged."""
        out = self._damaged
        return [f"{file}: {counted(out, 'damaged message')} {are(out)} left out"] if out else []

    def _add(self, received: Received) -> Iterator[tuple[str, Block]]:
        """Take a message; yield its topic's block if it is full."""
        getters = self._getters.get(received.topic)
        if getters is None:
            return
        content = None
        if any(not of_time for of_time, _ in getters):
            try:
                content = received.decode()
            except ValueError:
                self._damaged += 1
                return
        rows = self._rows[received.topic]
        rows.append([get(received if of_time else content) for of_time, get in getters])
        if len(rows) >= ROWS:
            yield received.topic, self._block(received.topic)

    def _block(self, topic: str) -> Block:
        rows, self._rows[topic] = self._rows[topic], []
        return {name: _column(values) for name, values in zip(self._names[topic], zip(*rows, strict=True), strict=True)}


def _getter_of(path: str) -> tuple[bool, Callable[[Any], Any]]:
    if path in (LOG_TIME, PUBLISH_TIME):
        attribute = path[1:]
        return True, lambda received: getattr(received, attribute)
    return False, getter(path)


def _column(values: Sequence[Any]) -> Any:
    """Return values as a column: integers stay exact, a missing value becomes NaN, texts an Arrow array."""
    if any(isinstance(value, str) for value in values):
        import pyarrow as pa

        return pa.array([value if isinstance(value, str) else None for value in values], pa.string())
    if all(type(value) is int for value in values):
        return np.array(values, dtype=np.int64)
    return np.array([math.nan if value is None else float(value) for value in values], dtype=np.float64)
