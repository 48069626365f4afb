"""How a user's log becomes a recording, with a map of columns: docs/reference/commands/convert.md.

Rows pass in blocks where each row of the recording depends on one row of the log. A one-joint machine, several clocks,
a new rate and sorting need the whole log. Topics with clocks of their own come onto one by linear interpolation.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.errors import InputError
from tendonfmu.files import are, counted
from tendonfmu.recordings.converters import units
from tendonfmu.recordings.converters.column_map import ColumnMap, ConvertedLog, Resampling, read_map
from tendonfmu.recordings.converters.log import TIME_NAMES, Log, Topic, find_field, open_log
from tendonfmu.recordings.converters.one_joint import joint_columns
from tendonfmu.recordings.converters.units import DAY, MappedColumn, nanoseconds, of_day_alone
from tendonfmu.recordings.recording import LABEL
from tendonfmu.recordings.traps import overflow, unwrapped

GAP = 10.0  # median steps; a longer one is a gap unless the map says otherwise

# Largest magnitude that is believed, SI. A hand's tendon carries up to some hundred newtons and moves by centimetres;
# joints turn by less than one and a half turns.
LARGEST = {
    "tendon_force": 3000.0,
    "tendon_position": 1.0,
    "joint_position": 9.0,
    "joint_velocity": 200.0,
    "external_torque": 300.0,
}
# Smallest span that is believed to be motion; a smaller one is likely in too large a unit.
SMALLEST = {"tendon_position": 1e-5, "joint_position": 1e-3}
FASTEST_TURN = 0.25  # of a counter's turn: a larger step may be one in the other direction
STEPS = (2e-6, 2.0)  # s; usual time from sample to sample

Columns = dict[str, Numbers]  # of a recording, [N] each, in SI


def convert_table(file: Path, columns_of: Path | Mapping[str, Any]) -> ConvertedLog:
    """Convert a log with a map of columns, or its file."""
    conversion = Conversion(file, columns_of)
    blocks = list(conversion.recording())
    columns = {key: np.concatenate([block[key] for block in blocks]) for key in blocks[0]}
    return ConvertedLog(columns, conversion.map, conversion.velocity_cutoff, conversion.notes)


class Conversion:
    """A log that is being converted."""

    def __init__(self, file: Path, columns_of: Path | Mapping[str, Any], log: Log | None = None) -> None:
        self.map = read_map(columns_of)
        self.log: Log = log or open_log(file, self.map.log)
        self.notes: list[str] = []
        self.velocity_cutoff = 0.0
        self._topics: dict[str, Topic] = {}
        self._readers_used: list[TopicRows] = []
        self._names: dict[str, dict[str, str]] = {}  # by topic and key of the map, the field
        self._is_counted = self.map.columns["time"].rate > 0.0
        for key, column in self.map.columns.items():
            if column.rate:
                continue
            topic, name = find_field(self.log, column.source, f"{self.map.path}: {column.path}")
            self._topics[topic.name] = topic
            self._names.setdefault(topic.name, {})[key] = name
        self._main = next(name for name, keys in self._names.items() if "time" in keys or self._is_counted)
        if self._is_counted and len(self._topics) > 1:
            raise InputError(f"{self.map.path}: columns.time.rate: {file} has several topics; expected their clocks")
        self._clocks = {name: self._clock_of(topic) for name, topic in self._topics.items()}
        is_simple = len(self._names) == 1 and self.map.joint is None
        self.in_blocks = is_simple and self.map.resample is None and self.map.log.disorder != "sort"

    def _clock_of(self, topic: Topic) -> MappedColumn:
        """Return the time of a topic: the column `time`, that of the map, or the field of the same name."""
        time = self.map.columns["time"]
        if topic.name == self._main:
            return time
        clock = self.map.log.clocks.get(topic.name) or self._same_clock(topic, time)
        owner, source = find_field(self.log, clock.source, f"{self.map.path}: {clock.path}")
        if owner.name != topic.name:
            given = f"{clock.path}.column = {clock.source!r}: a field of {owner.name}"
            raise InputError(f"{self.map.path}: {given}; expected one of {topic.name}")
        if bool(clock.stamp) != bool(time.stamp):
            expected = '"unit": "datetime" or epoch_... for both, or for none'
            other = f"a clock of another kind than {time.path}"
            raise InputError(f"{self.map.path}: {clock.path}: {other}; expected {expected}")
        self._names[topic.name]["time"] = source
        return clock

    def _same_clock(self, topic: Topic, time: MappedColumn) -> MappedColumn:
        relative = self._names[self._main]["time"].removeprefix(self._topics[self._main].prefix)
        if any(field.name == topic.prefix + relative for field in topic.fields):
            return dataclasses.replace(time, source=topic.prefix + relative)
        example = next(iter(topic.clocks()), f"{topic.prefix}{TIME_NAMES[0]}")
        raise InputError(
            f"{self.log.file}: {topic.name} has another clock than {self._main}, and no {relative}; expected its time "
            f'in the map, such as "log": {{"clocks": {{"{topic.name}": {{"column": "{example}", "unit": ...}}}}}}'
        )

    def recording(self) -> Iterator[Columns]:
        """Yield the columns of the recording, also of a one-joint machine, in blocks; at least one."""
        ranges = _Ranges(self.log.file, self.map)
        count = 0
        for columns in self._in_blocks() if self.in_blocks else self._at_once():
            count += 1
            ranges.add(columns)
            if self.map.joint is None:
                yield columns
            else:
                made, self.velocity_cutoff, notes = joint_columns(self.log.file, columns, self.map.joint)
                self.notes += notes
                yield made
        self.notes += ranges.notes()
        self.notes += (note for reader in self._readers_used for note in reader.notes())
        if not count:
            raise InputError(f"{self.log.file}: no samples; expected at least one row of numbers")

    def _readers(self) -> dict[str, TopicRows]:
        readers = {}
        for topic, names in self._names.items():
            keys = ["time", *names] if self._is_counted else names
            columns = {key: self._clocks[topic] if key == "time" else self.map.columns[key] for key in keys}
            readers[topic] = TopicRows(self.log.file, columns, names, self.map.log.leaves_out)
        self._readers_used = list(readers.values())
        return readers

    def _rows(self, readers: Mapping[str, TopicRows]) -> Iterator[tuple[str, Rows]]:
        """Yield rows of all topics."""
        wanted = {topic: list(dict.fromkeys(names.values())) for topic, names in self._names.items()}
        texts = [names["time"] for topic, names in self._names.items() if self._clocks[topic].stamp]
        for topic, block in self.log.blocks(wanted, texts):
            yield topic, readers[topic].rows(block)
        for topic, reader in readers.items():
            if not reader.count:
                of_topic = f" of {topic}" if topic else ""
                raise InputError(f"{self.log.file}: no samples{of_topic}; expected at least one row")
            if reader.left_out:
                out = reader.left_out
                self.notes.append(f"{self.log.file}: {counted(out, 'row')} without a number {are(out)} left out")

    def _in_blocks(self) -> Iterator[Columns]:
        readers = self._readers()
        reader = readers[self._main]
        for _, rows in self._rows(readers):
            reader.check_time(rows)
            if len(rows.numbers):
                yield reader.in_si(rows, reader.first)
        self.notes = [*self.log.notes, *self.notes]

    def _at_once(self) -> Iterator[Columns]:
        readers = self._readers()
        parts: dict[str, list[Rows]] = {topic: [] for topic in readers}
        for topic, rows in self._rows(readers):
            parts[topic].append(rows)
        ordered = {}
        for topic, reader in readers.items():
            ordered[topic] = Rows.joined(parts[topic])
            if self.map.log.disorder == "sort":
                ordered[topic] = _sorted(self.log.file, ordered[topic], self._clocks[topic], self.notes)
            else:
                reader.check_time(ordered[topic])
        start = ordered[self._main].readings["time"][0]
        topics = {}
        for topic, rows in ordered.items():
            first = {key: values[0] for key, values in rows.readings.items()}
            topics[topic] = readers[topic].in_si(rows, {**first, "time": start})
        self.notes = [*self.log.notes, *self.notes]
        columns = topics[self._main]
        if len(topics) > 1 or (self.map.resample is not None and self.map.resample.rate is not None):
            columns = on_one_clock(self.log.file, topics, self._main, self.map.resample or Resampling(), self.notes)
        yield {key: columns[key] for key in self.map.columns}


# --- the rows of one topic --------------------------------------------------------------------------------------------


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
        self, file: Path, columns: Mapping[str, MappedColumn], names: Mapping[str, str], leave_out_missing: bool
    ) -> None:
        self.first: dict[str, Any] = {}  # the first reading of each column
        self.count = self.left_out = 0
        self._file, self._columns, self._names = file, columns, names
        self._leave_out_missing = leave_out_missing
        self._last: Any = None  # time
        self._midnight: tuple[int, int] | None = None  # last time of day, and how often it has started again
        self._turned: dict[str, float] = {}  # last reading of each counter of many turns, without its jumps
        self._fastest: dict[str, float] = {}  # and its largest step

    def _refused(self, key: str, row: int, reading: str, expected: str) -> InputError:
        where = f"{self._file}: column {self._columns[key].source}, row {row}"
        return InputError(f"{where}: {reading}; expected {expected}")

    def rows(self, block: Mapping[str, Any]) -> Rows:
        """Take a block of the log. Raise InputError for what is no number."""
        row = self.count
        readings = {key: self._numeric(key, block[name], row) for key, name in self._names.items()}
        count = len(next(iter(readings.values())))
        if rate := self._columns["time"].rate:
            readings["time"] = (row + np.arange(count)) / rate
        self.count += count
        rows = Rows(readings, np.arange(row + 1, row + count + 1))
        is_sound = np.ones(count, dtype=bool)
        for key, values in readings.items():
            if values.dtype.kind == "f":
                finite = np.isfinite(values)
                is_sound &= finite
                if not finite.all() and not (self._leave_out_missing and np.isnan(values[~finite]).all()):
                    raise self._missing(key, values, row)
        if not is_sound.all():
            self.left_out += int(np.count_nonzero(~is_sound))
            rows = rows.only(is_sound)
        if of_day_alone(self._columns["time"]) and len(rows.numbers):
            time = rows.readings["time"]
            before = time[0] if self._midnight is None else self._midnight[0]
            days = np.cumsum(np.diff(time, prepend=before) < -DAY // 2) + (self._midnight or (0, 0))[1]
            self._midnight = time[-1], days[-1]
            rows = Rows({**rows.readings, "time": time + DAY * days}, rows.numbers)
        if self._columns["time"].wrap and len(rows.numbers):
            time = rows.readings["time"]
            rows = Rows({**rows.readings, "time": self._followed("time", time, float(time[0]))}, rows.numbers)
        if len(rows.numbers) and not self.first:
            self.first = {key: values[0] for key, values in rows.readings.items()}
        return rows

    def _missing(self, key: str, values: NDArray[Any], row: int) -> InputError:
        k = int(np.flatnonzero(~np.isfinite(values))[0])
        if np.isnan(values[k]):
            advice = 'a finite number, or "missing": "leave out" in "log" of the map'
            return self._refused(key, row + k + 1, "no number ('' or nan)", advice)
        return self._refused(key, row + k + 1, f"{values[k]:g}", "a finite number")

    def _numeric(self, key: str, values: Any, row: int) -> NDArray[Any]:
        if self._columns[key].stamp:
            return nanoseconds(self._file, self._columns[key], values, row)
        if not isinstance(values, np.ndarray):
            at = next((k for k, value in enumerate(values) if value.is_valid), 0)
            reading = values[at].as_py() if len(values) else ""
            advice = ' (a point in time has "unit": "datetime")' if key == "time" else ""
            raise self._refused(key, row + at + 1, repr(reading), f"numbers{advice}")
        return values

    def _followed(self, key: str, values: NDArray[Any], start: float) -> Numbers:
        """Return readings [N] of a counter without its jumps, from block to block."""
        if not len(values):
            return values.astype(np.float64)
        last, wrap = self._turned.get(key), self._columns[key].wrap
        turned = unwrapped(values, wrap, start if last is None else last)
        step = float(np.abs(np.diff(turned, prepend=turned[0] if last is None else last)).max())
        self._fastest[key], self._turned[key] = max(self._fastest.get(key, 0.0), step), float(turned[-1])
        return turned

    def notes(self) -> Iterator[str]:
        """Yield a sentence for each counter that may have turned too far between two rows."""
        for key, step in self._fastest.items():
            column = self._columns[key]
            if step > FASTEST_TURN * column.wrap:
                moves = f"moves by up to {step:.4g} of the {column.wrap:g} readings of a turn from row to row"
                yield f"{self._file}: warning: {column.path}: {moves}; turns may be lost"

    def check_time(self, rows: Rows) -> None:
        """Check that time increases, from block to block too. Raise InputError."""
        time = rows.readings["time"]
        if self._last is not None and len(time):
            time = np.concatenate([[self._last], time])
        late = np.flatnonzero(~(np.diff(time) > 0))
        if late.size:
            k = int(late[0]) + 1
            raise self._refused(
                "time",
                rows.numbers[k - (len(time) - len(rows.numbers))],
                f"{'the same time' if time[k] == time[k - 1] else 'time goes back'}, {time[k].item()!r} after "
                f"{time[k - 1].item()!r}",
                _advice(overflow(time), self._columns["time"]),
            )
        if len(time):
            self._last = time[-1]

    def in_si(self, rows: Rows, first: Mapping[str, Any]) -> Columns:
        """Return rows in SI; `first` is the first reading of each column."""
        columns = {}
        for key, values in rows.readings.items():
            column = self._columns[key]
            if column.offset is None:
                column = dataclasses.replace(column, offset=first[key].item())
            if column.turns and column.wrap and key != "time":
                # the first reading is taken within half a turn of the zero
                values = self._followed(key, values, float(column.offset or 0.0))
            columns[key] = column.values(values)
        for key in filter(_is_label, columns):
            is_label = np.isin(columns[key], (0.0, 1.0))
            if not is_label.all():
                k = int(np.argmin(is_label))
                raise self._refused(key, rows.numbers[k], f"{columns[key][k]:g}", "0 or 1")
        return columns


def _is_label(key: str) -> bool:
    """Return whether a column is the label of a finger, alone or in a hand."""
    return key == LABEL or key.endswith((f"_{LABEL}", f".{LABEL}", f"-{LABEL}"))


def _advice(word: float | None, column: MappedColumn) -> str:
    """Return what to do about a time that does not increase. word: readings after which it starts again."""
    if word is not None and not column.stamp:
        return f'increasing times; the timer overflows: write "wrap": {repr(word).removesuffix(".0")} at {column.path}'
    return (
        "increasing times. Divide the log there; or, if rows are only shuffled or repeated, set "
        '"disorder": "sort" in "log" of the map'
    )


def _sorted(file: Path, rows: Rows, column: MappedColumn, notes: list[str]) -> Rows:
    """Return rows by time, without those with the time of another. A timer that overflows is refused."""
    time = rows.readings["time"]
    if (word := overflow(time)) is not None and not column.stamp:
        raise InputError(f"{file}: column {column.source}: time goes back; expected {_advice(word, column)}")
    order = np.argsort(time, kind="stable")
    moved = int(np.count_nonzero(np.diff(time) < 0))
    again = np.flatnonzero(np.diff(time[order]) == 0) + 1
    if moved:
        notes.append(f"{file}: time goes back at {counted(moved, 'place')}; the rows are sorted by time")
    if again.size:
        notes.append(f"{file}: {counted(again.size, 'row')} with the time of another {are(again.size)} left out")
    return rows.only(np.delete(order, again))


# --- several clocks ---------------------------------------------------------------------------------------------------


def on_one_clock(file: Path, topics: Mapping[str, Columns], main: str, rule: Resampling, notes: list[str]) -> Columns:
    """Return the columns of all topics at common times [M]. Adds to the notes what was done."""
    time = _common_times(file, topics, main, rule, notes)
    in_gap = np.zeros(len(time), dtype=bool)
    for name, columns in topics.items():
        if name != main or rule.rate is not None:
            in_gap |= _gaps(f"{file}: {name}: " if name else f"{file}: ", columns["time"], time, rule, notes)
    lost = int(np.count_nonzero(in_gap))
    if lost:
        notes.append(f"{file}: {lost} of {counted(len(time), 'sample')} in gaps {are(lost)} left out")
        time = time[~in_gap]
    if not len(time):
        raise InputError(f'{file}: no sample outside gaps; expected a smaller "rate" or a larger "largest_gap"')
    joined = {"time": time}
    for name, columns in topics.items():
        clock = columns["time"]
        for key, values in columns.items():
            if key == "time":
                continue
            if name == main and rule.rate is None:
                joined[key] = values[np.isin(clock, time)]
            elif _is_label(key):  # labels are not interpolated: each sample has the last one before it
                joined[key] = values[np.clip(np.searchsorted(clock, time, side="right") - 1, 0, len(clock) - 1)]
            else:
                joined[key] = np.interp(time, clock, values)
    return joined


def _common_times(file: Path, topics: Mapping[str, Columns], main: str, rule: Resampling, notes: list[str]) -> Numbers:
    """Return the common times, where all topics have samples."""
    begin = max(float(columns["time"][0]) for columns in topics.values())
    end = min(float(columns["time"][-1]) for columns in topics.values())
    if begin >= end:
        spans = ", ".join(f"{name} {c['time'][0]:.6g} to {c['time'][-1]:.6g} s" for name, c in topics.items())
        raise InputError(f"{file}: the topics do not overlap in time ({spans}); expected clocks with the same zero")
    if rule.rate is not None:
        notes.append(f"{file}: resampled at {rule.rate:g} Hz")
        count = int(np.floor((end - begin) * rule.rate * (1 + 1e-12))) + 1
        return begin + np.arange(count) / rule.rate
    time = topics[main]["time"]
    inside = time[(time >= begin) & (time <= end)]
    lost = len(time) - len(inside)
    if lost:
        notes.append(f"{file}: left out before or after the other topics: {counted(lost, 'sample')}")
    return inside


def _gaps(place: str, clock: Numbers, time: Numbers, rule: Resampling, notes: list[str]) -> Flags:
    """Return which common times [M] lie in gaps of a topic, or refuse them. clock: times of the topic (s)."""
    is_there = bool(np.isin(time, clock).all())
    done = "has a sample at each time, none is interpolated" if is_there else "interpolated onto one clock"
    notes.append(f"{place}{done}; its largest gap is {1e3 * _largest_step(clock, time):.4g} ms")
    if len(clock) < 2:
        return np.zeros(len(time), dtype=bool)
    steps = np.diff(clock)
    limit = rule.largest_gap if rule.largest_gap is not None else GAP * float(np.median(steps))
    after = np.clip(np.searchsorted(clock, time, side="right") - 1, 0, len(steps) - 1)
    around = np.where(clock[after] == time, 0.0, steps[after])  # a sample of the topic itself lies in no gap
    around[time == clock[-1]] = 0.0
    gaps = np.asarray(around > limit)
    if gaps.any() and rule.gaps != "leave out":
        at, largest = float(time[int(np.argmax(gaps))]), float(around.max(initial=0.0))
        gap = f"a gap of {largest:.4g} s, the first near time {at:.6g} s; expected at most {limit:.4g} s"
        raise InputError(f'{place}{gap}, or "resample": {{"gaps": "leave out"}} or a "largest_gap" in the map')
    return gaps


def _largest_step(clock: Numbers, time: Numbers) -> float:
    """Return the largest step (s) of a topic between the first and last of the common times."""
    if not len(time):
        return 0.0
    first = max(int(np.searchsorted(clock, time[0], side="right")) - 1, 0)
    last = int(np.searchsorted(clock, time[-1], side="left"))
    return float(np.diff(clock[first : last + 1]).max(initial=0.0))


# --- doubtful units ---------------------------------------------------------------------------------------------------


class _Ranges:
    """Follows the ranges of columns, block by block."""

    def __init__(self, file: Path, wanted: ColumnMap) -> None:
        self._file, self._map = file, wanted
        self._ranges: dict[str, tuple[float, float]] = {}
        self._step = 0.0

    def add(self, columns: Columns) -> None:
        for key, values in columns.items():
            if len(values):
                low, high = self._ranges.get(key, (np.inf, -np.inf))
                self._ranges[key] = (min(low, float(values.min())), max(high, float(values.max())))
        if not self._step and len(columns["time"]) > 1:
            self._step = float(np.median(np.diff(columns["time"])))

    def notes(self) -> Iterator[str]:
        """Yield a sentence for each column whose unit is doubtful. A machine of any size may have one joint."""
        doubts = []
        if self._step and not STEPS[0] <= self._step <= STEPS[1]:
            doubts.append(("time", f"{self._step:.3g} s from sample to sample"))
        for key, (low, high) in self._ranges.items() if self._map.joint is None else ():
            group = key.split("[")[0]
            group = next((name for name in LARGEST if group.endswith(name)), group)  # of a finger of a hand
            what = ""
            if max(abs(low), abs(high)) > LARGEST.get(group, np.inf):
                what = "more than a finger has"
            elif 0.0 < high - low < SMALLEST.get(group, 0.0):
                what = "hardly a motion"
            if what:
                doubts.append((key, f"{low:.4g} to {high:.4g} {units.si_of(units.OF_COLUMN[group])}, {what}"))
        for key, doubt in doubts:
            yield f"{self._file}: warning: {self._map.columns[key].path}: {doubt}; is its unit right?"
