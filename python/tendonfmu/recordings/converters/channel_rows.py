"""Logs with one value a row, whose channel a text names, as InfluxDB and other databases export them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from tendonfmu.files import counted
from tendonfmu.recordings.converters.log import NUMBER, TEXT, Block, Log, Topic

MOST, FEWEST = 200, 20  # channels; rows of a channel
CLOCK = "time"  # of each channel, after its name
VALUES = ("value", "val", "data")  # names of the values, where there are other numbers


def by_channel(log: Log) -> Log:
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
