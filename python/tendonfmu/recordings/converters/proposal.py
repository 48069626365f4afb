"""Which map fits a log, and what `convert inspect` reports: what each field likely is, and how sure that is.

What cannot be decided becomes "?" in the map, which `convert table` refuses.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from tendonfmu.files import are, counted
from tendonfmu.recordings.converters import units
from tendonfmu.recordings.converters.column_map import FORMAT, UNDECIDED
from tendonfmu.recordings.converters.guesses import (
    GUESS,
    KNOWN,
    LIKELY,
    OTHERS,
    SI,
    SURE,
    Guess,
    Member,
    Order,
    field_groups,
    in_order,
    matched,
    order_of,
    unit_of,
    unit_of_time,
    words_of,
)
from tendonfmu.recordings.converters.guesses import UNDECIDED as NOT_SURE
from tendonfmu.recordings.converters.inspection import TOGETHER, ClockSummary, FieldSummary, Inspection, TopicSummary
from tendonfmu.recordings.converters.log import NUMBER, TIME

REPORT_FORMAT = "tendonfmu-inspection-1"
NO_SIGN = 0.02  # of the largest torque: the smallest of a magnitude
WORDS = (2.0**8, 2.0**16, 2.0**32)  # after which signed numbers stored as unsigned start again
LONGEST_NAME = 40  # characters in a table
QUANTITY = {
    "tendon_force": "force",
    "tendon_position": "length",
    "joint_position": "angle",
    "joint_velocity": "angular speed",
    "external_torque": "torque",
    "torque": "torque",
}


@dataclass(frozen=True)
class Line:
    """A line of the proposed map."""

    column: str  # our name
    source: str | int  # the log's, or "?"
    unit: str  # its unit, or "?"
    sure: str  # SURE, LIKELY, GUESS or UNDECIDED
    why: str  # in words
    wrap: float | None = None  # readings after which it starts again
    pattern: str = ""  # of texts of times that are not of ISO 8601


@dataclass
class Proposal:
    """A proposed map."""

    document: dict[str, Any]  # the map, as in the JSON file
    lines: list[Line] = field(default_factory=list)  # its lines
    unused: list[str] = field(default_factory=list)  # names of fields that it does not use
    moving: dict[str, str] = field(default_factory=dict)  # of those that may be signals, why
    orders: list[Order] = field(default_factory=list)  # how tendons and joints are numbered, where there are several
    undecided: list[str] = field(default_factory=list)  # keys of the map that are "?"
    notes: list[str] = field(default_factory=list)  # what is wrong with fields beside each other

    @property
    def time_factor(self) -> float | None:
        """Factor of the clocks to s, if their unit is known."""
        unit = next((line.unit for line in self.lines if line.column == "time"), UNDECIDED)
        if unit in units.STAMPS:
            return 1e-9 * units.STAMPS[unit]
        return units.TIME.get(unit)


def propose(inspection: Inspection) -> Proposal:
    """Propose a map."""
    groups, by_name = field_groups(inspection)
    is_one_joint = "tendon_force" not in groups and "torque" in groups
    slots, orders = _numbered(groups)
    if is_one_joint:
        lines, orders = _joint(inspection, groups), []
    else:
        lines = [_doubtful(line, orders) for line in _finger(inspection, slots, by_name)]
        if not groups.get("joint_position"):
            lines += _perhaps_angles(inspection, {line.source for line in lines}, len(slots.get("tendon_force", [])))
        lines += _contact(groups.get("contact", []))
    log = _log_settings(inspection, lines)
    undecided = [f"log.{key}" for key, value in log.items() if value == UNDECIDED]
    undecided += [line.column for line in lines if UNDECIDED in (line.source, line.unit)]
    document = _document(inspection, log, lines, orders, is_one_joint)
    unused, moving = _unused(inspection, lines)
    return Proposal(document, lines, unused, moving, orders, undecided, list(_magnitudes(groups)))


def _unused(inspection: Inspection, lines: Sequence[Line]) -> tuple[list[str], dict[str, str]]:
    """Return the names of the fields that no line uses, and of those that move with a signal which, and how much."""
    columns = {line.source: line.column for line in lines if line.column != "time"}
    used = {line.source for line in lines}
    unused, moving = [], {}
    for topic in inspection.topics:
        signals = [(columns[_source(part)], part) for part in topic.fields if _source(part) in columns]
        for part in topic.fields:
            if _source(part) in used:
                continue
            unused.append(part.field.name)
            fits = {column: part.moves_with(signal) for column, signal in signals if part.field.kind == NUMBER}
            best = max(fits, key=lambda column: abs(fits[column]), default="")
            if best and abs(fits[best]) > TOGETHER and not part.rising:
                moving[part.field.name] = f"moves with {best}, correlation {fits[best]:.2f}"
    return unused, moving


def _magnitudes(groups: Mapping[str, Sequence[Member]]) -> Iterator[str]:
    """Yield the torques that are never negative while their joint moves both ways."""
    speeds = [summary for _, summary in groups.get("joint_velocity", [])]
    for name in ("torque", "external_torque"):
        members = groups.get(name, [])
        both = zip([summary for _, summary in members], speeds, strict=True) if len(members) == len(speeds) else ()
        unsigned = [
            torque.field.name
            for torque, speed in both
            if 0.0 <= torque.low < NO_SIGN * torque.high and speed.low < 0.0 < speed.high
        ]
        if unsigned:
            yield (
                f"{', '.join(unsigned)}: never negative while the joint moves both ways: a magnitude; friction cannot "
                "be learned from a current or load without its sign"
            )


# --- order ------------------------------------------------------------------------------------------------------------

OF_TENDONS = ("tendon_force", "tendon_position")
OF_JOINTS = ("joint_position", "joint_velocity", "external_torque")
Slots = dict[str, list[Member | None]]


def _numbered(groups: dict[str, list[Member]]) -> tuple[Slots, list[Order]]:
    """Return the fields of each group by index, None where an element has none, and what the order is by."""
    slots: Slots = {}
    orders = []
    for of, names in (("tendons", OF_TENDONS), ("joints", OF_JOINTS)):
        present = [name for name in names if groups.get(name)]
        if not present:
            continue
        first = max(present, key=lambda name: len(groups[name]))
        leading, by_number = in_order(groups[first], _name)
        slots[first] = list(leading)
        for name in present:
            if name != first:
                slots[name], is_matched = _beside(leading, groups[name])
                by_number &= is_matched
        if len(leading) > 1:
            listed = [[_name(member) if member else "" for member in slots[name]] for name in present]
            orders.append(order_of(of, by_number, listed))
    return slots, orders


def _beside(leading: Sequence[Member], members: Sequence[Member]) -> tuple[list[Member | None], bool]:
    """Return members at the indices of those with the same number or name, or else in an order of their own."""
    places = matched([_name(member) for member in leading], [_name(member) for member in members])
    if places is None:
        ordered, by_number = in_order(members, _name)
        return list(ordered), by_number
    return [members[places.index(k)] if k in places else None for k in range(max(places) + 1)], True


def _name(member: Member) -> str:
    return member[1].field.name


def _doubtful(line: Line, orders: Sequence[Order]) -> Line:
    """Return a line, not surer than the index of its tendon or joint."""
    of = "tendons" if line.column.startswith(OF_TENDONS) else "joints" if line.column.startswith(OF_JOINTS) else ""
    guessed = any(order.of == of and order.sure == GUESS for order in orders)
    return replace(line, sure=LIKELY) if guessed and line.sure == SURE else line


# --- lines ------------------------------------------------------------------------------------------------------------


def _undecided(column: str, why: str) -> Line:
    return Line(column, UNDECIDED, UNDECIDED, NOT_SURE, why)


def _finger(inspection: Inspection, slots: Slots, by_name: Container[str]) -> list[Line]:
    """Return the lines of a finger. by_name: tendon positions that are known only by names like those of the forces."""
    present = {name: [member for member in members if member] for name, members in slots.items()}
    lines = [_time(inspection, next((present[name][0] for name in OF_TENDONS if present.get(name)), None))]
    count = max(*(len(slots.get(name, [])) for name in OF_TENDONS), 1)
    for name in (*OF_TENDONS, *OF_JOINTS):
        of_tendons = name in OF_TENDONS
        members = slots.get(name, [])
        seen = len(present.get(name, []))
        if of_tendons:
            members = [*members, *[None] * (count - len(members))]
            reason = f"{counted(count, 'tendon')} {are(count)} needed"
        else:
            reason = "the log has more joints"
        for k, member in enumerate(members, start=1):
            if member is None:
                looks = f"{counted(seen, 'field')} look{'s' if seen == 1 else ''} like {name}"
                lines.append(_undecided(f"{name}[{k}]", f"{looks}, and {reason}"))
                continue
            line = _line(inspection, f"{name}[{k}]", name, member[1], of_tendons and count > seen)
            lines.append(_by_name(line) if of_tendons and _name(member) in by_name else line)
    return lines


def _perhaps_angles(inspection: Inspection, used: Container[str | int], most: int) -> Iterator[Line]:
    """Yield lines for unused fields that come as a group with names of their own, as encoders of joints do."""
    families: dict[str, list[FieldSummary]] = {}
    for topic in inspection.topics:
        for summary in topic.fields:
            words = words_of(summary.field.name)
            moves = summary.field.kind == NUMBER and summary.low < 0.0 < summary.high
            if words and moves and _source(summary) not in used and not OTHERS & set(words):
                families.setdefault(words[0], []).append(summary)
    for stem, members in families.items():
        if 1 < len(members) <= most:
            fields = counted(len(members), "unused field")
            why = f"{fields} named {stem}: angles of joints? State the unit, or remove this"
            for k, summary in enumerate(members, start=1):
                yield Line(f"joint_position[{k}]", _source(summary), UNDECIDED, NOT_SURE, why)
            return


def _contact(members: Sequence[Member]) -> list[Line]:
    if len(members) != 1:
        return []
    return [Line("contact", _source(members[0][1]), "1", LIKELY, "its name, and it is only 0 or 1")]


def _by_name(line: Line) -> Line:
    """Return the line of a position that may also be the angle of a joint."""
    sure = LIKELY if line.sure == SURE else line.sure
    return replace(line, sure=sure, why=f"as many as forces, with the same names or numbers; {line.why}")


def _joint(inspection: Inspection, groups: dict[str, list[Member]]) -> list[Line]:
    """Return the lines of a machine with one joint. Of several joints the user has to choose one."""
    lines = [_time(inspection, groups["torque"][0])]
    for key, group in (("torque", "torque"), ("angle", "joint_position"), ("velocity", "joint_velocity")):
        members = groups.get(group, [])
        if len(members) == 1:
            lines.append(_line(inspection, key, group, members[0][1], False))
        elif key != "velocity":
            names = ", ".join(_name(member) for member in members[:8])
            why = f"{counted(len(members), 'field')} may be it: {names}" if members else "no field looks like it"
            lines.append(_undecided(key, why))
    return lines


def _line(inspection: Inspection, column: str, group: str, summary: FieldSummary, is_short: bool) -> Line:
    """Return the line of a field. is_short: its group has fewer fields than the finger has tendons."""
    name, source = summary.field.name, _source(summary)
    if summary.low == summary.high and group != "contact":
        why = f"constant at {summary.low:.6g}: a sensor that is not connected? State the unit, or remove this"
        return Line(column, source, UNDECIDED, NOT_SURE, why)
    statement = units.stated(name, summary.field.unit)
    if re.search(rf"(^|[./]){re.escape(column)}$", name) and not summary.field.unit:
        return Line(column, source, SI[QUANTITY[group]], SURE, "the name of a recording's column, in SI")
    if group == "tendon_position" and statement is not None and statement[1] == "angle":
        advice = f'{statement[2]}, an angle: write "unit": "m" and "scale", the radius of the spool times rad'
        guess = Guess(UNDECIDED, NOT_SURE, advice)
    else:
        guess = unit_of(name, summary.field.unit, QUANTITY[group], summary.low, summary.high, inspection.messages)
    is_named = bool(set(words_of(name)) & KNOWN)
    why = f"named like {group}; {guess.why}" if is_named else guess.why
    sure = LIKELY if guess.sure == SURE and (is_short or not is_named) else guess.sure
    if summary.missing:
        values = f"{summary.missing} of {counted(summary.count, 'value')} {are(summary.missing)} missing"
        why += f'; {values}: see "missing" in "log"'
    wrap = summary.wrap if QUANTITY[group] in ("length", "angle") or (summary.wrap or 0.0) in WORDS else None
    return Line(column, source, guess.unit, sure, why, wrap)


def _time(inspection: Inspection, beside: Member | None) -> Line:
    """Return the line of time: the clock of the topic with the forces."""
    with_clock = (topic for topic in inspection.topics if topic.clock)
    topic = beside[0] if beside else next(with_clock, inspection.topics[0])
    clock = topic.clock
    named = next((summary for summary in topic.fields if clock and summary.field.name == clock.name), None)
    if clock is None or named is None or named.count == named.missing:
        advice = 'no field looks like a time; for rows equally far apart write {"rate": HZ} in its place'
        return _undecided("time", advice)
    summary = named
    faults = ""
    if clock.backwards or clock.repeated:
        faults = (
            f"; it goes back {counted(clock.backwards, 'time')} and stands still {counted(clock.repeated, 'time')}: "
            'see "disorder" in "log"'
        )
    guess = Guess(clock.stamp, SURE, "its values are points in time")
    if not clock.stamp:
        guess = unit_of_time(clock.name, summary.field.unit, clock.first, clock.step)
    return Line("time", _source(summary), guess.unit, guess.sure, f"{guess.why}{faults}", clock.wrap, clock.pattern)


def _source(summary: FieldSummary) -> str | int:
    return summary.field.name if summary.key == summary.field.name else int(summary.key[1:])


# --- the map ----------------------------------------------------------------------------------------------------------


def _log_settings(inspection: Inspection, lines: Sequence[Line]) -> dict[str, Any]:
    """Return the key `log` of the map. What to do with missing numbers of its columns is left to the user."""
    settings = dict(inspection.settings)
    used = {line.source for line in lines}
    summaries = [summary for topic in inspection.topics for summary in topic.fields]
    if any(summary.missing and _source(summary) in used for summary in summaries):
        settings["missing"] = UNDECIDED
    return settings


def _document(
    inspection: Inspection, log: dict[str, Any], lines: Sequence[Line], orders: Sequence[Order], is_one_joint: bool
) -> dict[str, Any]:
    columns: dict[str, dict[str, Any]] = {
        line.column: {"column": line.source, "unit": line.unit, "comment": f"{line.sure}: {line.why}"}
        | {key: value for key, value in (("wrap", line.wrap), ("pattern", line.pattern)) if value}
        for line in lines
    }
    document: dict[str, Any] = {"format": FORMAT}
    if orders:
        document["comment"] = "; ".join(order.line() for order in orders)
    if log:
        document["log"] = log
    if is_one_joint:
        document["joint"] = {"name": re.sub(r"\W+", "_", inspection.file.name.split(".")[0]) or "joint", **columns}
    else:
        document["columns"] = columns
    return document


# --- what is reported -------------------------------------------------------------------------------------------------


def inspection_document(inspection: Inspection, proposal: Proposal) -> dict[str, Any]:
    """Return all results as JSON values."""
    return {
        "format": REPORT_FORMAT,
        "log": str(inspection.file),
        "topics": [_topic(topic, proposal.time_factor) for topic in inspection.topics],
        "proposal": [asdict(line) for line in proposal.lines],
        "orders": [{**asdict(order), "line": order.line()} for order in proposal.orders],
        "undecided": proposal.undecided,
        "unused": proposal.unused,
        "moving": proposal.moving,
        "map": proposal.document,
        "notes": [*inspection.notes, *proposal.notes],
    }


def _topic(topic: TopicSummary, factor: float | None) -> dict[str, Any]:
    fields = [
        {
            "name": summary.field.name,
            "type": summary.field.type,
            "unit": summary.field.unit,
            "count": summary.count,
            "missing": summary.missing,
            "range": [summary.low, summary.high] if summary.low <= summary.high else None,
            "example": summary.example or None,
        }
        for summary in topic.fields
    ]
    clock = None if topic.clock is None else _clock(topic.clock, factor)
    return {"name": topic.topic.name, "clock": clock, "fields": fields}


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
    for summary in topic.fields:
        if summary.low > summary.high:
            span = [_short(summary.example), ""]
        elif summary.field.kind == TIME:
            span = [_moment(summary.low), _moment(summary.high)]
        else:
            span = [f"{summary.low:.6g}", f"{summary.high:.6g}"]
        yield [
            _short(summary.field.name),
            summary.field.type,
            summary.field.unit,
            str(summary.count - summary.missing) if summary.count else "",
            str(summary.missing) if summary.missing else "",
            *span,
        ]


def clock_line(topic: TopicSummary, factor: float | None) -> str:
    """Return a sentence about a topic's clock."""
    name, clock = topic.topic.name or "the log", topic.clock
    if clock is None:
        return f"{name}: no field looks like a time"
    first, last = (_moment(time) if clock.stamp else f"{time:.10g}" for time in (clock.first, clock.last))
    parts = [f"{counted(clock.rows, 'row')} by {clock.name}, from {first} to {last}"]
    step = clock.seconds(clock.step, factor)
    duration = clock.seconds(clock.last - clock.first, factor)
    if step and duration is not None:
        parts.append(f"{duration:.6g} s at {1.0 / step:.4g} Hz")
        parts.append(f"largest step {1e3 * (clock.seconds(clock.largest, factor) or 0.0):.4g} ms")
    if clock.gaps:
        parts.append(f"{counted(clock.gaps, 'gap')} of more than ten steps")
    if clock.repeated:
        parts.append(counted(clock.repeated, "repeated time"))
    if clock.backwards:
        parts.append(f"goes back {counted(clock.backwards, 'time')}")
    return f"{name}: {', '.join(parts)}"


def _moment(nanoseconds: float) -> str:
    moment = datetime.datetime.fromtimestamp(nanoseconds * 1e-9, datetime.timezone.utc)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def proposal_rows(proposal: Proposal) -> Iterator[list[str]]:
    """Yield the cells of each line of the map: our column, the log's, unit, how sure, why."""
    for line in proposal.lines:
        yield [line.column, _short(str(line.source)), line.unit, line.sure, line.why]


def unused_line(proposal: Proposal) -> Iterator[str]:
    """Yield a sentence about the fields that no line uses, with "?" where they may be signals."""
    if proposal.unused:
        listed = (f"{name}{' ?' if name in proposal.moving else ''}" for name in proposal.unused)
        yield f"not used: {', '.join(listed)}"
    yield from (f"? {name}: {why}" for name, why in proposal.moving.items())


def _short(name: str) -> str:
    return name if len(name) <= LONGEST_NAME else f"...{name[-(LONGEST_NAME - 3) :]}"
