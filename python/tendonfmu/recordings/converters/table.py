"""How a user's log becomes a recording, with a map of columns: docs/reference/commands/convert.md.

Rows pass in blocks where each row of the recording depends on one row of the log. A one-joint machine, several clocks,
a new rate and sorting need the whole log.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted
from tendonfmu.recordings.converters.column_map import ColumnMap, MappedColumn, read_map
from tendonfmu.recordings.converters.log import Log, Topic, find_field
from tendonfmu.recordings.converters.log_file import open_log
from tendonfmu.recordings.converters.one_joint import joint_columns
from tendonfmu.recordings.converters.plausible import Ranges
from tendonfmu.recordings.converters.resampling import on_one_clock
from tendonfmu.recordings.converters.topic_rows import Rows, TopicRows, as_columns, clock_of
from tendonfmu.recordings.recording import LABEL

Series = NDArray[np.float64]


@dataclass(frozen=True)
class ConvertedLog:
    """A log that has been converted."""

    columns: dict[str, Series]  # columns of a recording, [N] each, in SI
    map: ColumnMap  # the map that was used
    velocity_cutoff: float = 0.0  # cut-off of velocities that were computed here (Hz); 0 if there are none
    notes: list[str] = field(default_factory=list)  # what was left out or computed, one sentence each


class Conversion:
    """A log that is being converted."""

    def __init__(self, file: Path, map_file: Path) -> None:
        self.map = read_map(map_file)
        self.log: Log = open_log(file, self.map.log)
        self.notes: list[str] = []
        self.velocity_cutoff = 0.0
        self._topics: dict[str, Topic] = {}
        self._names: dict[str, dict[str, str]] = {}
        for key, column in self.map.columns.items():
            topic, name = find_field(self.log, column.source, f"{self.map.path}: {column.path}")
            self._topics[topic.name] = topic
            self._names.setdefault(topic.name, {})[key] = name
        self._main = next(name for name, keys in self._names.items() if "time" in keys)
        self._clocks: dict[str, MappedColumn] = {}
        self._add_clocks()
        simple = len(self._names) == 1 and self.map.joint is None
        self.in_blocks = simple and self.map.resample is None and not self.map.log.sort

    def _add_clocks(self) -> None:
        """Find the time of each topic beside that of the column `time`."""
        main = self._topics[self._main]
        time = self.map.columns["time"]
        for name, topic in self._topics.items():
            self._clocks[name] = time
            if name == self._main:
                continue
            clock = self.map.log.clocks.get(name)
            if clock is None:
                clock = clock_of(self.log.file, topic, main, self._names[self._main]["time"], time)
            owner, source = find_field(self.log, clock.source, f"{self.map.path}: {clock.path}")
            if owner.name != name:
                raise InputError(
                    f"{self.map.path}: {clock.path}.column = {clock.source!r}: a field of {owner.name}; "
                    f"expected one of {name}"
                )
            if bool(clock.stamp) != bool(time.stamp):
                raise InputError(
                    f'{self.map.path}: {clock.path}: a clock of another kind than {time.path}; expected "unit": '
                    '"datetime" or epoch_... for both, or for none'
                )
            self._clocks[name] = clock
            self._names[name]["time"] = source

    def blocks(self) -> Iterator[dict[str, Series]]:
        """Yield columns of the recording, block by block."""
        # returns [N] each, in SI
        ranges = Ranges(self.log.file, self.map)
        for columns in self._in_blocks() if self.in_blocks else self._at_once():
            ranges.add(columns)
            yield columns
        self.notes += ranges.notes()

    def recording(self) -> Iterator[dict[str, Series]]:
        """Yield the columns of the recording, also of a one-joint machine; as `blocks`, at least one block."""
        count = 0
        for columns in self.blocks():
            count += 1
            if self.map.joint is None:
                yield columns
            else:
                made, self.velocity_cutoff, notes = joint_columns(self.log.file, columns, self.map.joint)
                self.notes += notes
                yield made
        if not count:
            raise InputError(f"{self.log.file}: no samples; expected at least one row of numbers")

    def _readers(self) -> dict[str, TopicRows]:
        settings = self.map.log
        readers = {}
        for name, names in self._names.items():
            columns = {key: self._clocks[name] if key == "time" else self.map.columns[key] for key in names}
            readers[name] = TopicRows(self.log.file, columns, names, settings.leave_out_missing, settings.sort)
        return readers

    def _rows(self, readers: Mapping[str, TopicRows]) -> Iterator[tuple[str, Rows]]:
        """Yield rows of all topics."""
        wanted = {name: list(dict.fromkeys(names.values())) for name, names in self._names.items()}
        texts = [names["time"] for name, names in self._names.items() if self._clocks[name].stamp]
        for name, block in self.log.blocks(wanted, texts):
            yield name, readers[name].rows(block)
        for name, reader in readers.items():
            if not reader.count:
                raise InputError(
                    f"{self.log.file}: no samples{f' of {name}' if name else ''}; expected at least one row"
                )
            if reader.left_out:
                out = reader.left_out
                self.notes.append(f"{self.log.file}: {counted(out, 'row')} without a number {are(out)} left out")

    def _in_blocks(self) -> Iterator[dict[str, Series]]:
        readers = self._readers()
        reader = readers[self._main]
        for _, rows in self._rows(readers):
            reader.check_time(rows)
            columns = as_columns(rows, reader.columns, reader.first)
            _check_contact(self.log.file, self.map, columns, rows)
            if len(columns["time"]):
                yield columns
        self.notes = [*self.log.notes, *self.notes]

    def _at_once(self) -> Iterator[dict[str, Series]]:
        readers = self._readers()
        parts: dict[str, list[Rows]] = {name: [] for name in readers}
        for name, rows in self._rows(readers):
            parts[name].append(rows)
        found = {}
        ordered = {name: reader.in_order(Rows.joined(parts[name]), self.notes) for name, reader in readers.items()}
        start = ordered[self._main].readings["time"][0]
        for name, rows in ordered.items():
            first = {key: values[0] for key, values in rows.readings.items()}
            found[name] = as_columns(rows, readers[name].columns, {**first, "time": start})
            _check_contact(self.log.file, self.map, found[name], rows)
        self.notes = [*self.log.notes, *self.notes]
        if len(found) == 1 and (self.map.resample is None or self.map.resample.rate is None):
            yield self._in_the_order_of_the_map(found[self._main])
            return
        columns, notes = on_one_clock(self.log.file, found, self._main, self.map)
        self.notes += notes
        yield self._in_the_order_of_the_map(columns)

    def _in_the_order_of_the_map(self, columns: Mapping[str, Series]) -> dict[str, Series]:
        return {key: columns[key] for key in self.map.columns}


def convert_table(file: Path, map_file: Path) -> ConvertedLog:
    """Convert a log with a map of columns."""
    # returns its columns are those of docs/reference/recordings.md, [N] each
    conversion = Conversion(file, map_file)
    blocks = list(conversion.recording())
    columns = {key: np.concatenate([block[key] for block in blocks]) for key in blocks[0]}
    return ConvertedLog(columns, conversion.map, conversion.velocity_cutoff, conversion.notes)


def _check_contact(file: Path, wanted: ColumnMap, columns: Mapping[str, Series], rows: Rows) -> None:
    label = columns.get(LABEL)
    if label is not None and not np.isin(label, (0.0, 1.0)).all():
        k = int(np.flatnonzero(~np.isin(label, (0.0, 1.0)))[0])
        raise InputError(
            f"{file}: column {wanted.columns[LABEL].source}, row {rows.numbers[k]}: {label[k]:g}; expected 0 or 1"
        )
