"""How logs of messages are read, and how fields are found by path: ROS 2, JSON and Protobuf messages alike.

| path | is |
| --- | --- |
| `/imu.linear_acceleration.x` | a field of a field |
| `/hand/tendons.effort[3]` | the third element of an array; indices start at 1 |
| `/joint_states.position[knuckle]` | the element of that name: the message lists names, as many as elements |
| `/states.interface_values[knuckle].values[effort]` | the same, where each element has names of its own |
| `/joint_states.header.stamp` | a time, in ns |
| `/joint_states.@log_time`, `@publish_time` | when the message was recorded, sent; in ns |
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted, require_extra
from tendonfmu.recordings.converters.log import LONGEST, NUMBER, OTHER, TEXT, TIME, Block, Field, Topic

LOG_TIME, PUBLISH_TIME = "@log_time", "@publish_time"
NAME_LISTS = ("name", "names", "joint_names", "joint_name", "interface_names", "labels")
ROWS = 1 << 16  # messages of a block
SAMPLES = 5  # messages of each topic whose fields are listed, and of each further length: arrays may be empty first
NANOSECONDS = 10**9

_STEP = re.compile(r"\.?([^.\[\]]+)|\[([^\[\]]+)\]")

Decoder = Callable[[bytes], Any]  # raises ValueError if the message is damaged


@dataclass
class Received:
    """A message as its file has it."""

    topic: str
    log_time: int  # ns since 1970, or since an arbitrary start
    publish_time: int
    decode: Decoder
    data: bytes

    def content(self) -> Any:
        """Return the decoded message. Raise ValueError if it is damaged."""
        return self.decode(self.data)


# --- the log ----------------------------------------------------------------------------------------------------------


class MessageLog(ABC):
    """Files of messages, one after the other."""

    open_ended = True

    def __init__(self, file: Path, parts: Sequence[Path]) -> None:
        self.file = file
        self.notes: list[str] = []
        self.unknown: dict[str, str] = {}  # by topic, why its messages cannot be read
        self._parts = parts
        self.topics = _topics_of(self._messages())
        if not self.topics:
            reasons = "; ".join([*self.unknown.values(), *self.notes])
            why = f" ({reasons})" if reasons else ""
            raise InputError(f"{file}: no messages that can be read{why}; expected at least one")
        self.notes.clear()

    @abstractmethod
    def messages_of(self, part: Path) -> Iterator[Received]:
        """Yield the messages of one file."""

    def _messages(self) -> Iterator[Received]:
        for part in self._parts:
            yield from self.messages_of(part)

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read fields; see `log.Log`."""
        self.notes.clear()
        getters = {topic: [_getter_of(name[len(topic) + 1 :]) for name in names] for topic, names in wanted.items()}
        rows: dict[str, list[list[Any]]] = {topic: [] for topic in wanted}
        damaged = 0
        for received in self._messages():
            topic = received.topic
            if topic not in getters:
                continue
            content = None
            if any(not of_time for of_time, _ in getters[topic]):
                try:
                    content = received.content()
                except ValueError:
                    damaged += 1
                    continue
            rows[topic].append([get(received if of_time else content) for of_time, get in getters[topic]])
            if len(rows[topic]) >= ROWS:
                yield topic, _block(wanted[topic], rows[topic])
                rows[topic] = []
        for topic, last in rows.items():
            if last:
                yield topic, _block(wanted[topic], last)
        if damaged:
            self.notes.append(f"{self.file}: {counted(damaged, 'damaged message')} {are(damaged)} left out")


def _topics_of(messages: Iterator[Received]) -> list[Topic]:
    """Return the topics in alphabetical order, with the fields of their first messages."""
    fields_of: dict[str, dict[str, Field]] = {}
    counts: Counter[str] = Counter()
    lengths: Counter[tuple[str, int]] = Counter()
    for received in messages:
        topic, length = received.topic, len(received.data)
        counts[topic] += 1
        lengths[topic, length] += 1
        if lengths[topic, length] > SAMPLES:
            continue
        try:
            content = received.content()
        except ValueError:
            continue
        fields = fields_of.setdefault(topic, {})
        for path, kind, value in _leaves(content):
            type_name = str(value) if kind == OTHER else "time" if kind == TIME else type(value).__name__
            fields.setdefault(path, Field(f"{topic}.{path}", kind, type_name))
        for path in (LOG_TIME, PUBLISH_TIME):
            fields.setdefault(path, Field(f"{topic}.{path}", TIME, "time"))
    return [Topic(name, tuple(fields.values()), counts[name], f"{name}.") for name, fields in sorted(fields_of.items())]


def _getter_of(path: str) -> tuple[bool, Callable[[Any], Any]]:
    """Return a function that gets a field, and whether of the `Received`, not of its content."""
    if path in (LOG_TIME, PUBLISH_TIME):
        return True, lambda received: getattr(received, path[1:])
    return False, _getter(path)


def _block(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> Block:
    return {name: _column(values) for name, values in zip(names, zip(*rows, strict=True), strict=True)}


def _column(values: Sequence[Any]) -> Any:
    """Return values as a column: integers stay exact, a missing value becomes NaN, texts an Arrow array."""
    if any(isinstance(value, str) for value in values):
        return pa.array([value if isinstance(value, str) else None for value in values], pa.string())
    if all(type(value) is int for value in values):
        return np.array(values, dtype=np.int64)
    return np.array([math.nan if value is None else float(value) for value in values], dtype=np.float64)


# --- content ----------------------------------------------------------------------------------------------------------


def _members(value: Any) -> Mapping[str, Any] | None:
    """Return the fields of a message by name, or None if the value is no message."""
    if isinstance(value, Mapping):
        return value
    if hasattr(value, "__dataclass_fields__"):
        return {name: getattr(value, name) for name in value.__dataclass_fields__ if not name.startswith("__")}
    if hasattr(value, "DESCRIPTOR"):
        return {field.name: getattr(value, field.name) for field in value.DESCRIPTOR.fields}
    return None


def _stamp_of(parts: Mapping[str, Any]) -> int | None:
    """Return the ns of a time, or None if the fields are not those of one."""
    for seconds, fraction in (("sec", "nanosec"), ("seconds", "nanos"), ("sec", "nsec"), ("secs", "nsecs")):
        if parts.keys() == {seconds, fraction}:
            return int(parts[seconds]) * NANOSECONDS + int(parts[fraction])
    return None


def _leaves(value: Any, path: str = "", names: Sequence[str] = ()) -> Iterator[tuple[str, str, Any]]:
    """Yield (path, kind, value) of each field of a message, down to numbers."""
    parts = _members(value)
    if parts is not None:
        stamp = _stamp_of(parts)
        if stamp is not None:
            yield path, TIME, stamp
            return
        inner_names = _names_of(parts) or names
        for name, inner in parts.items():
            yield from _leaves(inner, f"{path}.{name}" if path else name, inner_names)
    elif isinstance(value, str | bytes):
        yield path, TEXT, value
    elif isinstance(value, bool | int | float | np.number | np.bool_):
        yield path, NUMBER, value
    elif isinstance(value, np.ndarray | Sequence) or hasattr(value, "__getitem__"):
        if len(value) > LONGEST:
            yield path, OTHER, f"array of {len(value)}"
            return
        has_names = len(names) == len(value) and len(set(names)) == len(names)
        for k, inner in enumerate(value):
            if not isinstance(inner, str):
                yield from _leaves(inner, f"{path}[{names[k] if has_names else k + 1}]")


def _names_of(parts: Mapping[str, Any]) -> list[str]:
    """Return the list of names in a message, or an empty one."""
    for key in NAME_LISTS:
        names = parts.get(key)
        if names is not None and not isinstance(names, str) and len(names) and all(isinstance(n, str) for n in names):
            return list(names)
    return []


def _getter(path: str) -> Callable[[Any], Any]:
    """Return a function that gets the field of a path, a number, text or time in ns, or None if it is not there."""
    steps = _STEP.findall(path)

    def get(message: Any) -> Any:
        parts = _members(message)
        if parts is not None and path in parts:  # names in JSON may hold dots and brackets
            return _plain(parts[path])
        value: Any = message
        names: list[str] = []
        for name, element in steps:
            if name:
                parts = _members(value)
                if parts is None or name not in parts:
                    return None
                names = _names_of(parts) or names
                value = parts[name]
            else:
                place = int(element) - 1 if element.isdigit() else (names.index(element) if element in names else -1)
                if place < 0 or not hasattr(value, "__len__") or place >= len(value):
                    return None
                value, names = value[place], []
        return _plain(value)

    return get


def _plain(value: Any) -> Any:
    if isinstance(value, bool | int | float | str | np.number | np.bool_):
        return value
    parts = _members(value)
    return None if parts is None else _stamp_of(parts)


# --- ROS 2 ------------------------------------------------------------------------------------------------------------


class Ros2Types:
    """Types of ROS 2 messages in CDR, which the package rosbags decodes without ROS."""

    def __init__(self, file: Path) -> None:
        self._typesys = require_extra("rosbags.typesys", str(file))
        self._defined = self._typesys.get_typestore(self._typesys.Stores.EMPTY)

    @cached_property
    def _common(self) -> Any:
        """Types that come with ROS."""
        return self._typesys.get_typestore(self._typesys.Stores.LATEST)

    def decoder(self, name: str, definition: str, encoding: str) -> Decoder | None:
        """Return a function that decodes messages, or None if the type is not known."""
        if name.count("/") == 1:
            name = name.replace("/", "/msg/")
        if definition.strip():
            self._define(name, definition, encoding)
        store = self._defined if definition.strip() else self._common
        return partial(_decode_cdr, store, name) if name in store.fielddefs else None

    def _define(self, name: str, definition: str, encoding: str) -> None:
        known = self._defined.fielddefs
        if name in known:
            return
        try:
            if encoding == "ros2idl":
                types = self._typesys.get_types_from_idl(definition)
            else:
                types = self._typesys.get_types_from_msg(definition, name)
            self._defined.register({key: value for key, value in types.items() if key not in known})
        except Exception:  # the parser of rosbags raises errors of its own for a definition that it cannot read
            return


def _decode_cdr(store: Any, name: str, data: bytes) -> Any:
    try:
        return store.deserialize_cdr(data, name)
    except Exception as error:  # generated code fails in any way on a damaged message
        raise ValueError(str(error)) from None
