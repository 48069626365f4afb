"""What `convert inspect` says, as rows of a table and as JSON."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from typing import Any

from tendonfmu.files import counted
from tendonfmu.recordings.converters import units
from tendonfmu.recordings.converters.inspection import ClockSummary, FieldSummary, Inspection, TopicSummary
from tendonfmu.recordings.converters.log import TIME
from tendonfmu.recordings.converters.proposal import Proposal

FORMAT = "tendonfmu-inspection-1"
MOST = 40  # characters of a name in a table


def inspection_document(found: Inspection, proposal: Proposal) -> dict[str, Any]:
    """Return all results as JSON values."""
    return {
        "format": FORMAT,
        "log": str(found.file),
        "topics": [_topic(topic, time_factor(proposal, topic)) for topic in found.topics],
        "proposal": [
            {"column": line.column, "source": line.source, "unit": line.unit, "sure": line.sure, "why": line.why}
            for line in proposal.lines
        ],
        "orders": [
            {"of": order.of, "sure": order.sure, "elements": order.elements, "line": order.line()}
            for order in proposal.orders
        ],
        "undecided": proposal.undecided,
        "unused": proposal.unused,
        "map": proposal.document,
        "notes": found.notes,
    }


def time_factor(proposal: Proposal, topic: TopicSummary) -> float | None:
    """Return the factor of a topic's clock to s, if the proposal knows its unit."""
    unit = next((line.unit for line in proposal.lines if line.column == "time"), "?")
    if unit in units.STAMPS:
        return 1e-9 * units.STAMPS[unit]
    return units.TIME.get(unit)


def _topic(topic: TopicSummary, factor: float | None) -> dict[str, Any]:
    fields = [
        {
            "name": each.field.name,
            "type": each.field.type,
            "unit": each.field.unit,
            "count": each.count,
            "missing": each.missing,
            "range": [each.low, each.high] if each.low <= each.high else None,
            "example": each.example or None,
        }
        for each in topic.fields
    ]
    clock = topic.clock
    return {
        "name": topic.topic.name,
        "clock": None if clock is None else _clock(clock, factor),
        "fields": fields,
    }


def _clock(clock: ClockSummary, factor: float | None) -> dict[str, Any]:
    step = clock.seconds(clock.step, factor)
    return {
        "field": clock.name,
        "rows": clock.rows,
        "first": clock.first,
        "last": clock.last,
        "rate": 1.0 / step if step else None,
        "duration": clock.seconds(clock.last - clock.first, factor),
        "largest_step": clock.seconds(clock.largest, factor),
        "gaps": clock.gaps,
        "repeated": clock.repeated,
        "backwards": clock.backwards,
    }


def field_rows(topic: TopicSummary) -> Iterator[list[str]]:
    """Yield the cells of each field: name, type, unit, values, missing, least, most."""
    for each in topic.fields:
        yield [
            _short(each.field.name),
            each.field.type,
            each.field.unit,
            str(each.count - each.missing) if each.count else "",
            str(each.missing) if each.missing else "",
            *_range(each),
        ]


def _range(each: FieldSummary) -> tuple[str, str]:
    if each.low <= each.high and each.field.kind == TIME:
        return _moment(each.low), _moment(each.high)
    if each.low <= each.high:
        return f"{each.low:.6g}", f"{each.high:.6g}"
    return _short(each.example), ""


def clock_line(topic: TopicSummary, factor: float | None) -> str:
    """Return a sentence about a topic's clock."""
    clock = topic.clock
    if clock is None:
        return f"{topic.topic.name or 'the log'}: no field looks like a time"
    step = clock.seconds(clock.step, factor)
    duration = clock.seconds(clock.last - clock.first, factor)
    parts = [
        f"{counted(clock.rows, 'row')} by {clock.name}, from {_time(clock, clock.first)} to {_time(clock, clock.last)}"
    ]
    if step and duration is not None:
        parts.append(f"{duration:.6g} s at {1.0 / step:.4g} Hz")
        parts.append(f"largest step {1e3 * (clock.seconds(clock.largest, factor) or 0.0):.4g} ms")
    if clock.gaps:
        parts.append(f"{counted(clock.gaps, 'gap')} of more than ten steps")
    if clock.repeated:
        parts.append(counted(clock.repeated, "repeated time"))
    if clock.backwards:
        parts.append(f"goes back {counted(clock.backwards, 'time')}")
    return f"{topic.topic.name or 'the log'}: {', '.join(parts)}"


def _time(clock: ClockSummary, value: float) -> str:
    if not clock.stamp:
        return f"{value:.10g}"
    return _moment(value)


def _moment(nanoseconds: float) -> str:
    moment = datetime.datetime.fromtimestamp(nanoseconds * 1e-9, datetime.timezone.utc)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def proposal_rows(proposal: Proposal) -> Iterator[list[str]]:
    """Yield the cells of each line of the map: our column, the log's, unit, how sure, why."""
    for line in proposal.lines:
        yield [line.column, _short(str(line.source)), line.unit, line.sure, line.why]


def _short(name: str) -> str:
    return name if len(name) <= MOST else f"...{name[-(MOST - 3) :]}"
