"""How the rows of one topic become columns of a recording: missing numbers, order of time, units."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted
from tendonfmu.recordings.converters.column_map import MappedColumn
from tendonfmu.recordings.converters.log import TIME_NAMES, Topic
from tendonfmu.recordings.converters.stamps import nanoseconds

Series = NDArray[np.float64]


@dataclass(frozen=True)
class Rows:
    """Rows of a topic."""

    readings: Mapping[str, NDArray[Any]]  # by key of the map, [N] each; stamps in ns
    numbers: NDArray[np.int64]  # number of each row in the log, from 1, [N]

    @staticmethod
    def joined(parts: Sequence[Rows]) -> Rows:
        """Return the rows of all parts, one after the other."""
        readings = {key: np.concatenate([part.readings[key] for part in parts]) for key in parts[0].readings}
        return Rows(readings, np.concatenate([part.numbers for part in parts]))

    def only(self, chosen: NDArray[Any]) -> Rows:
        """Return some of the rows, by index or mask."""
        return Rows({key: values[chosen] for key, values in self.readings.items()}, self.numbers[chosen])


class TopicRows:
    """Takes the rows of a topic, block by block."""

    def __init__(
        self,
        file: Path,
        columns: Mapping[str, MappedColumn],
        names: Mapping[str, str],
        leave_out_missing: bool,
        sort: bool,
    ) -> None:
        self.columns = columns
        self.first: dict[str, Any] = {}
        self.count = self.left_out = 0
        self._file, self._names = file, names
        self._leave_out_missing, self._sort = leave_out_missing, sort
        self._last: Any = None

    def rows(self, block: Mapping[str, Any]) -> Rows:
        """Take a block of the log. Raise InputError for what is no number."""
        row = self.count
        readings = {key: self._numeric(key, block[name], row) for key, name in self._names.items()}
        count = len(next(iter(readings.values())))
        self.count += count
        rows = Rows(readings, np.arange(row + 1, row + count + 1))
        sound = np.ones(count, dtype=bool)
        for key, values in readings.items():
            if values.dtype.kind != "f":
                continue
            finite = np.isfinite(values)
            sound &= finite
            if not finite.all() and not (self._leave_out_missing and np.isnan(values[~finite]).all()):
                self._refuse_missing(key, values, row)
        if not sound.all():
            self.left_out += int(np.count_nonzero(~sound))
            rows = rows.only(sound)
        if len(rows.numbers) and not self.first:
            self.first = {key: values[0] for key, values in rows.readings.items()}
        return rows

    def _refuse_missing(self, key: str, values: NDArray[Any], row: int) -> None:
        k = int(np.flatnonzero(~np.isfinite(values))[0])
        advice = ', or "missing": "leave out" in "log" of the map' if np.isnan(values[k]) else ""
        found = "no number ('' or nan)" if np.isnan(values[k]) else f"{values[k]:g}"
        raise InputError(
            f"{self._file}: column {self.columns[key].source}, row {row + k + 1}: {found}; "
            f"expected a finite number{advice}"
        )

    def _numeric(self, key: str, values: Any, row: int) -> NDArray[Any]:
        column = self.columns[key]
        if column.stamp:
            return nanoseconds(self._file, column, values, row)
        if not isinstance(values, np.ndarray):
            at = next((k for k, value in enumerate(values) if value.is_valid), 0)
            said = values[at].as_py() if len(values) else ""
            advice = ' (a point in time has "unit": "datetime")' if key == "time" else ""
            raise InputError(
                f"{self._file}: column {column.source}, row {row + at + 1}: {said!r}; expected numbers{advice}"
            )
        return values

    def check_time(self, rows: Rows) -> None:
        """Check that time increases, from block to block too. Raise InputError."""
        time = rows.readings["time"]
        if self._last is not None and len(time):
            time = np.concatenate([[self._last], time])
        late = np.flatnonzero(~(np.diff(time) > 0))
        if late.size:
            k = int(late[0]) + 1
            number = rows.numbers[k - (len(time) - len(rows.numbers))]
            what = "the same time" if time[k] == time[k - 1] else "time goes back"
            raise InputError(
                f"{self._file}: column {self.columns['time'].source}, row {number}: {what}, {time[k].item()!r} after "
                f"{time[k - 1].item()!r}; expected increasing times. Divide the log there; or, if rows are only "
                'shuffled or repeated, set "disorder": "sort" in "log" of the map'
            )
        if len(time):
            self._last = time[-1]

    def in_order(self, rows: Rows, notes: list[str]) -> Rows:
        """Return all rows with increasing times, or raise InputError if they are not and must not be sorted."""
        if not self._sort:
            self.check_time(rows)
            return rows
        time = rows.readings["time"]
        order = np.argsort(time, kind="stable")
        moved = int(np.count_nonzero(np.diff(time) < 0))
        again = np.flatnonzero(np.diff(time[order]) == 0) + 1
        if moved:
            notes.append(f"{self._file}: time goes back at {counted(moved, 'place')}; the rows are sorted by time")
        if again.size:
            notes.append(
                f"{self._file}: {counted(again.size, 'row')} with the time of another {are(again.size)} left out"
            )
        return rows.only(np.delete(order, again))


def as_columns(rows: Rows, columns: Mapping[str, MappedColumn], first: Mapping[str, Any]) -> dict[str, Series]:
    """Return rows in SI; `first` is the first reading of each column."""
    found = {}
    for key, values in rows.readings.items():
        column = columns[key]
        if column.offset is None:
            start = first[key]
            column = dataclasses.replace(column, offset=start.item() if hasattr(start, "item") else start)
        found[key] = column.values(values)
    return found


def clock_of(file: Path, topic: Topic, main: Topic, name: str, time: MappedColumn) -> MappedColumn:
    """Return the clock of a topic beside the main one: the field with the same name in it."""
    relative = name[len(main.prefix) :] if name.startswith(main.prefix) else name
    wanted = topic.prefix + relative
    if topic.field(wanted) is not None:
        return dataclasses.replace(time, source=wanted)
    likely = topic.clocks()
    example = likely[0] if likely else f"{topic.prefix}{TIME_NAMES[0]}"
    raise InputError(
        f"{file}: {topic.name} has another clock than {main.name}, and no {relative}; expected its time in the map, "
        f'such as "log": {{"clocks": {{"{topic.name}": {{"column": "{example}", "unit": ...}}}}}}'
    )
