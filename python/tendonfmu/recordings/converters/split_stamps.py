"""A time in two columns, whole seconds and the nanoseconds beyond, as ROS writes it into tables: one column more."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.log import OTHER, TIME, Block, Field, Log, Topic

NANOSECONDS = 10**9
# ends of the names of both columns, which begin alike
PAIRS = (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"), ("seconds", "nanos"), ("seconds", "nanoseconds"))


class SplitStamps:
    """A log with each time of its tables that stands in two columns as a field `sec+nanosec`, in ns since 1970."""

    def __init__(self, log: Log) -> None:
        self.log, self.file, self.open_ended = log, log.file, log.open_ended
        self._parts: dict[str, tuple[str, str]] = {}  # names of both columns, by that of the field
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
        self._parts |= found
        parts = {part for pair in found.values() for part in pair}
        fields = [replace(field, kind=OTHER if field.name in parts else field.kind) for field in topic.fields]
        return replace(topic, fields=(*fields, *(Field(name, TIME) for name in found)))

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read fields, as every log does."""
        asked = {
            topic: list(dict.fromkeys(part for name in names for part in self._parts.get(name, (name,))))
            for topic, names in wanted.items()
        }
        row = dict.fromkeys(wanted, 0)
        for topic, block in self.log.blocks(asked, [name for name in texts if name not in self._parts]):
            joined = {name: self._stamps(name, block, row[topic]) for name in wanted[topic] if name in self._parts}
            row[topic] += len(next(iter(block.values()), ()))
            yield topic, block | joined

    def _stamps(self, name: str, block: Block, row: int) -> NDArray[np.int64]:
        whole, rest = (self._whole(part, block[part], row) for part in self._parts[name])
        return whole * NANOSECONDS + rest

    def _whole(self, name: str, values: Any, row: int) -> NDArray[np.int64]:
        numbers = np.asarray(values)
        wrong = ~(np.abs(numbers) < 2.0**33) if numbers.dtype.kind == "f" else np.zeros(len(numbers), dtype=bool)
        if wrong.any():
            k = int(np.argmax(wrong))
            raise InputError(f"{self.file}: column {name}, row {row + k + 1}: {numbers[k]}; expected a part of a time")
        return numbers.astype(np.int64)
