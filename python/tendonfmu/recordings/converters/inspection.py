"""What is in a log: its topics and fields, with counts, rates, ranges and gaps."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.log import (
    NUMBER,
    NUMBERED,
    OTHER,
    TEXT,
    TIME,
    ChannelRows,
    Field,
    Log,
    SplitStamps,
    Topic,
    open_log,
)
from tendonfmu.recordings.converters.text_log import TextLog
from tendonfmu.recordings.converters.units import MappedColumn, nanoseconds, pattern_of, stated
from tendonfmu.recordings.traps import overflow, unwrapped, wrap_of

GAP = 10.0  # median steps
CLOCKS = 10.0 ** np.arange(-9, 10)  # s, ms, µs and ns against each other
EFFORT = re.compile("force|tension|load|torque|effort|current|tau|amp")  # what jumps by sticking, not by turning
SAMPLE = 2000  # values of a field that are kept
TOGETHER = 0.5  # correlation with a signal from which a field may be one
DRIFT = 3e-6, 1e-3  # of two clocks; less is rounding, and more is no second clock


@dataclass
class FieldSummary:
    """A field and its values."""

    field: Field  # the field
    key: str  # with which it is read: its name, or its number if the name is not unique
    count: int = 0  # rows, and those without a number
    missing: int = 0
    low: float = np.inf  # range of the numbers
    high: float = -np.inf
    example: str = ""  # first text
    only_flags: bool = True  # whether all numbers are 0 or 1
    wrap: float | None = None  # readings after which it starts again (`counters.wrap_of`)
    sample: NDArray[np.float64] | None = None  # up to `SAMPLE` values of the first block, equally far apart
    rising: bool = True  # whether each number is above the one before, and the first and last of them
    first: float = np.nan
    last: float = -np.inf

    @property
    def source(self) -> str | int:
        """The field as a map names it: its name, or its number if that is not unique."""
        return self.field.name if self.key == self.field.name else int(self.key[len(NUMBERED) :])

    def add(self, values: Any) -> None:
        """Take a block of the field."""
        self.count += len(values)
        if not isinstance(values, np.ndarray):
            self.missing += int(values.null_count)
            self.example = self.example or next((str(text) for text in values[:100] if text.is_valid), "")
            return
        if self.sample is None:
            self.sample = values[:: max(len(values) // SAMPLE, 1)].astype(np.float64)
        finite = values[np.isfinite(values)]
        self.missing += len(values) - len(finite)
        if len(finite):
            if self.count == len(values):
                self.first = float(finite[0])
            self.wrap = self.wrap or wrap_of(finite.astype(np.float64), not EFFORT.search(self.field.name.lower()))
            self.rising = self.rising and bool((np.diff(finite) > 0).all()) and float(finite[0]) > self.last
            self.last = float(finite[-1])
            self.low, self.high = min(self.low, float(finite.min())), max(self.high, float(finite.max()))
            self.only_flags = self.only_flags and bool(np.isin(finite, (0, 1)).all())

    def moves_with(self, other: FieldSummary) -> float:
        """Return the correlation with another field of the topic; 0 if one of them stands still."""
        if self.sample is None or other.sample is None or len(self.sample) != len(other.sample):
            return 0.0
        both = np.isfinite(self.sample) & np.isfinite(other.sample)
        if not both.any():
            return 0.0
        mine, its = (values[both] - values[both].mean() for values in (self.sample, other.sample))
        size = float(np.linalg.norm(mine) * np.linalg.norm(its))
        return float(mine @ its) / size if size > 0.0 else 0.0


@dataclass
class ClockSummary:
    """The times of a topic, in the unit of its field; ns for points in time."""

    name: str  # the field
    stamp: str = ""  # kind of a point in time that the field holds without doubt, or ""
    pattern: str = ""  # of its texts, where they are not of ISO 8601
    first: float = 0.0  # first and last time
    last: float = 0.0
    step: float = 0.0  # median step, of the first block
    largest: float = 0.0  # largest step
    gaps: int = 0  # steps of more than `GAP` median steps
    repeated: int = 0  # steps of zero, and negative ones
    backwards: int = 0
    rows: int = 0  # number of times
    whole: bool = True
    wrap: float | None = None  # readings after which a timer starts again
    _end: Any = None

    def add(self, values: NDArray[Any]) -> None:
        """Take a block of the times."""
        values = values[np.isfinite(values)]
        if not len(values):
            return
        if self._end is None:
            self.first = float(values[0])
        else:
            values = np.concatenate([[self._end], values])
            self.rows -= 1
        self._end, self.last, self.rows = values[-1], float(values[-1]), self.rows + len(values)
        self.wrap = self.wrap or (None if self.stamp else overflow(values))
        if self.wrap:
            values = unwrapped(values, self.wrap, values[0])
            self._end, self.last = values[-1], float(values[-1])
        steps = np.diff(values)
        if not len(steps):
            return
        self.step = self.step or float(np.median(steps))
        self.largest = max(self.largest, float(steps.max()))
        self.gaps += int(np.count_nonzero(steps > GAP * self.step)) if self.step > 0 else 0
        self.repeated += int(np.count_nonzero(steps == 0))
        self.backwards += int(np.count_nonzero(steps < 0))
        self.whole = self.whole and bool((np.floor(values) == values).all())

    def seconds(self, step: float, factor: float | None) -> float | None:
        """Return a step in s, or None if the unit is not known."""
        return step * 1e-9 if self.stamp else None if factor is None else step * factor


# of a clock without a clock's name: rows, difference of a step from the median one, and share of steps below it
FEWEST_TIMES, UNEVEN, EVEN = 50, 0.5, 0.9


@dataclass
class TopicSummary:
    """A topic, its fields and its clock, if one of its fields can be one."""

    topic: Topic
    fields: list[FieldSummary]
    clock: ClockSummary | None


@dataclass
class Inspection:
    """What is in a log."""

    file: Path  # the log
    topics: list[TopicSummary]  # its topics
    # how a text is written, as keys of `log` in a map; empty for other formats
    settings: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)  # what was recovered or could not be read
    messages: bool = False  # whether the log holds messages, whose units are those of ROS unless stated


def inspect_log(file: Path, log: Log | None = None, settings: LogFormat | None = None) -> Inspection:
    """Read a log and summarise it. log: the log, if it is open. settings: what is known of its format."""
    log = log or open_log(file, settings or LogFormat(missing="leave out"))
    topics = {topic.name: _empty_summary(topic) for topic in log.topics}
    wanted = {name: [part.key for part in topic.fields if part.field.kind != OTHER] for name, topic in topics.items()}
    texts = [part.key for topic in topics.values() for part in topic.fields if part.field.kind == TEXT]
    for name, block in log.blocks(wanted, texts):
        _add(log, topics[name], block)
    notes = [*log.notes, *(note for topic in topics.values() for note in _traps(topic))]
    return Inspection(file, list(topics.values()), _settings(log), notes, log.open_ended)


def _traps(topic: TopicSummary) -> Iterator[str]:
    """Yield what is wrong with fields by themselves: words that start again, and clocks that run apart."""
    clock = topic.clock
    counters: dict[float, list[str]] = {}
    for summary in topic.fields:
        if summary.wrap and not (clock and summary.field.name == clock.name):
            counters.setdefault(summary.wrap, []).append(summary.field.name)
    for wrap, names in counters.items():
        why = "signed numbers stored as unsigned, an encoder of many turns, or a counter that overflows"
        yield f'{", ".join(names)}: jumps by {wrap:.6g}: {why}; "wrap": {wrap:.6g} in the map takes the jumps out'
    for summary in topic.fields:
        name = summary.field.name
        if clock is not None and name == clock.name and clock.wrap:
            yield f'{name}: a timer that overflows at {clock.wrap:.16g}; "wrap" in the map makes its times go on'
        is_second = clock is not None and name != clock.name and summary.rising and summary.count == clock.rows
        if clock is None or not is_second or clock.last <= clock.first:
            continue
        ratio = (summary.last - summary.first) / (clock.last - clock.first)
        drift = ratio / CLOCKS[np.argmin(np.abs(np.log(CLOCKS / ratio)))] - 1.0
        if DRIFT[0] < abs(drift) < DRIFT[1]:
            share = f"{1e6 * drift:+.3g} ppm"
            yield f"{name}: runs {share} against {clock.name}: two clocks; take one of them for all signals"


def _empty_summary(topic: Topic) -> TopicSummary:
    names = [field.name for field in topic.fields]
    keys = [name if names.count(name) == 1 else f"{NUMBERED}{k}" for k, name in enumerate(names, start=1)]
    fields = [FieldSummary(field, key) for field, key in zip(topic.fields, keys, strict=True)]
    stated_units = {field.name: stated(field.name, field.unit) for field in topic.fields}
    of_time = [name for name, statement in stated_units.items() if statement and statement[1] == "time"]
    clock = next((name for name in [*topic.clocks(), *of_time] if names.count(name) == 1), None)
    if clock is None:
        return TopicSummary(topic, fields, None)
    is_moment = topic.fields[names.index(clock)].kind == TIME
    return TopicSummary(topic, fields, ClockSummary(clock, "datetime" if is_moment else ""))


def _clock_by_values(log: Log, topic: TopicSummary, block: dict[str, Any]) -> ClockSummary | None:
    """Return the field of times as text, or that alone rises at every row by nearly the same step, or None."""
    found = []
    for summary in topic.fields:
        values = block.get(summary.key)
        if summary.field.kind == TEXT and values is not None:
            clock = ClockSummary(summary.key)
            if _as_times(log, clock, values) is not None:
                return clock
        if summary.field.kind != NUMBER or not isinstance(values, np.ndarray) or len(values) < FEWEST_TIMES:
            continue
        step = np.diff(values.astype(np.float64))
        middle = float(np.median(step))
        even = (np.abs(step - middle) < UNEVEN * abs(middle)).mean() if middle > 0.0 else 0.0
        is_counter = values[0] in (0, 1) and bool((step == 1.0).all())
        if (step > 0.0).all() and even > EVEN and not is_counter:
            found.append(summary.key)
    return ClockSummary(found[0], "") if len(found) == 1 else None


def _add(log: Log, topic: TopicSummary, block: dict[str, Any]) -> None:
    if topic.clock is None and not any(summary.count for summary in topic.fields):
        topic.clock = _clock_by_values(log, topic, block)
    for summary in topic.fields:
        values = block.get(summary.key)
        if values is None:
            continue
        summary.add(values)
        if topic.clock is None or summary.key != topic.clock.name:
            continue
        if summary.field.kind == TEXT and (topic.clock.stamp or not topic.clock.rows):
            values = _as_times(log, topic.clock, values)
            topic.clock.stamp = "datetime" if values is not None else ""
        if isinstance(values, np.ndarray):
            topic.clock.add(values)


def _as_times(log: Log, clock: ClockSummary, texts: Any) -> NDArray[np.int64] | None:
    """Return texts as ns since 1970, or None if they are no times. Sets the pattern that fits them."""
    for has_pattern in (bool(clock.pattern), True):
        if has_pattern and not clock.pattern:
            known = texts.drop_null()
            clock.pattern = pattern_of([str(text) for text in (*known[:100], *known[-1:])]) if len(known) else ""
            if not clock.pattern:
                return None
        try:
            column = MappedColumn("time", clock.name, 1e-9, None, "datetime", pattern=clock.pattern)
            return nanoseconds(log.file, column, texts)
        except InputError:
            continue
    clock.pattern = ""
    return None


def _settings(log: Log) -> dict[str, Any]:
    """Return what was found in the first lines, so that `convert table` reads the log in the same way."""
    while isinstance(log, SplitStamps | ChannelRows):
        log = log.log
    if not isinstance(log, TextLog):
        return {}
    layout = log.layout
    found = {
        "separator": layout.separator,
        "decimal": layout.decimal,
        "encoding": "" if log.encoding in ("utf-8", "utf-8-sig") else log.encoding,
        "thousands": layout.thousands,
        "skip": layout.skip,
        "header": None if layout.header else False,
        "units_row": layout.has_units_row or None,
    }
    return {key: value for key, value in found.items() if value or value is False}
