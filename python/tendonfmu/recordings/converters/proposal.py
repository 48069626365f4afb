"""Which map fits a log, and what `convert inspect` reports: what each field likely is, and how sure that is.

What cannot be decided becomes "?" in the map, which `convert table` refuses.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Container, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from tendonfmu.files import are, counted
from tendonfmu.recordings.converters import units
from tendonfmu.recordings.converters.column_map import FORMAT, UNDECIDED
from tendonfmu.recordings.converters.inspection import TOGETHER, ClockSummary, FieldSummary, Inspection, TopicSummary
from tendonfmu.recordings.converters.log import NUMBER, TIME
from tendonfmu.recordings.converters.signals import (
    GUESS,
    KNOWN,
    LIKELY,
    NOT_SURE,
    OTHERS,
    QUANTITY,
    SURE,
    Groups,
    Order,
    field_groups,
    in_order,
    matched,
    unit_of,
    unit_of_time,
    words_of,
)

REPORT_FORMAT = "tendonfmu-inspection-1"
NO_SIGN = 0.02  # of the largest torque: the smallest of a magnitude
WORDS = (2.0**8, 2.0**16, 2.0**32)  # after which signed numbers stored as unsigned start again
LONGEST_NAME = 40  # characters in a table
OF_TENDONS = ("tendon_force", "tendon_position")
OF_JOINTS = ("joint_position", "joint_velocity", "external_torque")
Slots = dict[str, list[FieldSummary | None]]  # the fields of a group by index, None where an element has none


@dataclass(frozen=True)
class Line:
    """A line of the proposed map."""

    column: str  # our name
    source: str | int = UNDECIDED  # the log's, or "?"
    unit: str = UNDECIDED  # its unit, or "?"
    sure: str = NOT_SURE  # SURE, LIKELY, GUESS or NOT_SURE
    why: str = ""  # in words
    wrap: float | None = None  # readings after which it starts again
    pattern: str = ""  # of texts of times that are not of ISO 8601

    def entry(self) -> dict[str, Any]:
        """Return the line as the map has it."""
        entry = {"column": self.source, "unit": self.unit, "comment": f"{self.sure}: {self.why}"}
        return entry | {key: value for key, value in (("wrap", self.wrap), ("pattern", self.pattern)) if value}


@dataclass
class Proposal:
    """A proposed map."""

    document: dict[str, Any]  # the map, as in the JSON file
    lines: list[Line]  # its lines
    unused: list[str]  # names of fields that it does not use
    moving: dict[str, str]  # of those that may be signals, why
    orders: list[Order] = field(default_factory=list)  # how tendons and joints are numbered, where there are several
    undecided: list[str] = field(default_factory=list)  # keys of the map that are "?"
    notes: list[str] = field(default_factory=list)  # what is wrong with fields beside each other

    @property
    def time_factor(self) -> float | None:
        """Factor of the clocks to s, if their unit is known."""
        unit = next((line.unit for line in self.lines if line.column == "time"), UNDECIDED)
        return 1e-9 * units.STAMPS[unit] if unit in units.STAMPS else units.TIME.get(unit)


def propose(inspection: Inspection) -> Proposal:
    """Propose a map."""
    groups, by_name = field_groups(inspection)
    slots, orders = _numbered(groups)
    document: dict[str, Any] = {"format": FORMAT}
    if is_one_joint := "tendon_force" not in groups and "torque" in groups:
        lines, orders = _joint(inspection, groups), []
    else:
        guessed = tuple(name for order in orders if order.sure == GUESS for name in _groups_of(order.of))
        lines = [
            # no line is surer than the index of its tendon or joint
            replace(line, sure=LIKELY) if line.sure == SURE and line.column.startswith(guessed) else line
            for line in _finger(inspection, slots, by_name)
        ]
        if not groups.get("joint_position"):
            lines += _perhaps_angles(inspection, {line.source for line in lines}, len(slots.get("tendon_force", [])))
        if len(labels := groups.get("contact", [])) == 1:
            lines.append(Line("contact", labels[0].source, "1", LIKELY, "its name, and it is only 0 or 1"))
        if orders:
            document["comment"] = "; ".join(order.line() for order in orders)
    used = {line.source for line in lines}
    log = dict(inspection.settings)
    if any(part.missing and part.source in used for topic in inspection.topics for part in topic.fields):
        log["missing"] = UNDECIDED  # what to do with missing numbers is left to the user
    if log:
        document["log"] = log
    name = {"name": re.sub(r"\W+", "_", inspection.file.name.split(".")[0]) or "joint"} if is_one_joint else {}
    document["joint" if is_one_joint else "columns"] = name | {line.column: line.entry() for line in lines}
    undecided = [f"log.{key}" for key, value in log.items() if value == UNDECIDED]
    undecided += [line.column for line in lines if UNDECIDED in (line.source, line.unit)]
    unused, moving = _unused(inspection, lines)
    return Proposal(document, lines, unused, moving, orders, undecided, list(_magnitudes(groups)))


def _groups_of(of: str) -> tuple[str, ...]:
    return OF_TENDONS if of == "tendons" else OF_JOINTS


def _unused(inspection: Inspection, lines: Sequence[Line]) -> tuple[list[str], dict[str, str]]:
    """Return the names of the fields that no line uses, and of those that move with a signal which, and how much."""
    columns = {line.source: line.column for line in lines}
    unused, moving = [], {}
    for topic in inspection.topics:
        signals = [part for part in topic.fields if columns.get(part.source, "time") != "time"]
        for part in topic.fields:
            if part.source in columns:
                continue
            unused.append(part.field.name)
            fits = {columns[other.source]: part.moves_with(other) for other in signals if part.field.kind == NUMBER}
            best = max(fits, key=lambda column: abs(fits[column]), default="")
            if best and abs(fits[best]) > TOGETHER and not part.rising:
                moving[part.field.name] = f"moves with {best}, correlation {fits[best]:.2f}"
    return unused, moving


def _magnitudes(groups: Groups) -> Iterator[str]:
    """Yield the torques that are never negative while their joint moves both ways."""
    speeds = groups.get("joint_velocity", [])
    for name in ("torque", "external_torque"):
        torques = groups.get(name, [])
        unsigned = [
            torque.field.name
            for torque, speed in (zip(torques, speeds, strict=True) if len(torques) == len(speeds) else ())
            if 0.0 <= torque.low < NO_SIGN * torque.high and speed.low < 0.0 < speed.high
        ]
        if unsigned:
            why = "a magnitude; friction cannot be learned from a current or load without its sign"
            yield f"{', '.join(unsigned)}: never negative while the joint moves both ways: {why}"


# --- order ------------------------------------------------------------------------------------------------------------


def _numbered(groups: Groups) -> tuple[Slots, list[Order]]:
    """Return the fields of each group by index, and what the order is by."""
    slots: Slots = {}
    orders = []
    for of in ("tendons", "joints"):
        present = [name for name in _groups_of(of) if groups.get(name)]
        if not present:
            continue
        first = max(present, key=lambda name: len(groups[name]))
        leading, by_number = in_order(groups[first])
        slots[first] = list(leading)
        for name in present:
            if name != first:
                slots[name], is_matched = _beside(leading, groups[name])
                by_number &= is_matched
        if len(leading) > 1:
            count = max(len(slots[name]) for name in present)
            rows = ([slots[name][k] for name in present if k < len(slots[name])] for k in range(count))
            elements = tuple(tuple(signal.field.name for signal in row if signal) for row in rows)
            orders.append(Order(of, LIKELY if by_number else GUESS, elements))
    return slots, orders


def _beside(leading: Sequence[FieldSummary], signals: Sequence[FieldSummary]) -> tuple[list[FieldSummary | None], bool]:
    """Return fields at the indices of those with the same number or name, or else in an order of their own."""
    places = matched([signal.field.name for signal in leading], [signal.field.name for signal in signals])
    if places is None:
        ordered, by_number = in_order(signals)
        return list(ordered), by_number
    return [signals[places.index(k)] if k in places else None for k in range(max(places) + 1)], True


# --- lines ------------------------------------------------------------------------------------------------------------


def _finger(inspection: Inspection, slots: Slots, by_name: Container[str]) -> Iterator[Line]:
    """Yield the lines of a finger. by_name: tendon positions that are known only by names like those of the forces."""
    count = max(*(len(slots.get(name, [])) for name in OF_TENDONS), 1)
    present = {name: [signal for signal in signals if signal] for name, signals in slots.items()}
    yield _time(inspection, next((present[name][0] for name in OF_TENDONS if present.get(name)), None))
    for name in (*OF_TENDONS, *OF_JOINTS):
        of_tendons, signals, seen = name in OF_TENDONS, slots.get(name, []), len(present.get(name, []))
        reason = f"{counted(count, 'tendon')} {are(count)} needed" if of_tendons else "the log has more joints"
        signals = [*signals, *[None] * (count - len(signals) if of_tendons else 0)]
        for k, signal in enumerate(signals, start=1):
            if signal is None:
                looks = f"{counted(seen, 'field')} look{'s' if seen == 1 else ''} like {name}"
                yield Line(f"{name}[{k}]", why=f"{looks}, and {reason}")
                continue
            line = _line(inspection, f"{name}[{k}]", name, signal, of_tendons and count > seen)
            if of_tendons and signal.field.name in by_name:  # it may also be the angle of a joint
                why = f"as many as forces, with the same names or numbers; {line.why}"
                line = replace(line, sure=LIKELY if line.sure == SURE else line.sure, why=why)
            yield line


def _perhaps_angles(inspection: Inspection, used: Container[str | int], most: int) -> Iterator[Line]:
    """Yield lines for unused fields that come as a group with names of their own, as encoders of joints do."""
    families: dict[str, list[FieldSummary]] = {}
    for signal in (signal for topic in inspection.topics for signal in topic.fields):
        words = words_of(signal.field.name)
        moves = signal.field.kind == NUMBER and signal.low < 0.0 < signal.high
        if words and moves and signal.source not in used and not OTHERS & set(words):
            families.setdefault(words[0], []).append(signal)
    for stem, signals in families.items():
        if 1 < len(signals) <= most:
            fields = counted(len(signals), "unused field")
            why = f"{fields} named {stem}: angles of joints? State the unit, or remove this"
            for k, signal in enumerate(signals, start=1):
                yield Line(f"joint_position[{k}]", signal.source, why=why)
            return


def _joint(inspection: Inspection, groups: Groups) -> list[Line]:
    """Return the lines of a machine with one joint. Of several joints the user has to choose one."""
    lines = [_time(inspection, groups["torque"][0])]
    for key, group in (("torque", "torque"), ("angle", "joint_position"), ("velocity", "joint_velocity")):
        signals = groups.get(group, [])
        if len(signals) == 1:
            lines.append(_line(inspection, key, group, signals[0], False))
        elif key != "velocity":
            names = ", ".join(signal.field.name for signal in signals[:8])
            why = f"{counted(len(signals), 'field')} may be it: {names}" if signals else "no field looks like it"
            lines.append(Line(key, why=why))
    return lines


def _line(inspection: Inspection, column: str, group: str, signal: FieldSummary, is_short: bool) -> Line:
    """Return the line of a field. is_short: its group has fewer fields than the finger has tendons."""
    name, quantity = signal.field.name, QUANTITY[group]
    if signal.low == signal.high:
        why = f"constant at {signal.low:.6g}: a sensor that is not connected? State the unit, or remove this"
        return Line(column, signal.source, why=why)
    statement = units.stated(name, signal.field.unit)
    if re.search(rf"(^|[./]){re.escape(column)}$", name) and not signal.field.unit:
        unit = units.si_of(units.QUANTITIES[quantity])
        return Line(column, signal.source, unit, SURE, "the name of a recording's column, in SI")
    unit, sure, why = unit_of(signal, quantity, inspection.messages)
    if group == "tendon_position" and statement is not None and statement[1] == "angle":
        why = f'{statement[2]}, an angle: write "unit": "m" and "scale", the radius of the spool times rad'
    is_named = bool(set(words_of(name)) & KNOWN)
    why = f"named like {group}; {why}" if is_named else why
    sure = LIKELY if sure == SURE and (is_short or not is_named) else sure
    if signal.missing:
        values = f"{signal.missing} of {counted(signal.count, 'value')} {are(signal.missing)} missing"
        why += f'; {values}: see "missing" in "log"'
    wrap = signal.wrap if quantity in ("length", "angle") or (signal.wrap or 0.0) in WORDS else None
    return Line(column, signal.source, unit, sure, why, wrap)


def _time(inspection: Inspection, beside: FieldSummary | None) -> Line:
    """Return the line of time: the clock of the topic with the forces."""
    topics = inspection.topics
    of_signal = [topic for topic in topics if any(part is beside for part in topic.fields)]
    topic = (of_signal or [topic for topic in topics if topic.clock] or topics)[0]
    clock = topic.clock
    summary = next((part for part in topic.fields if clock and part.field.name == clock.name), None)
    if clock is None or summary is None or summary.count == summary.missing:
        why = 'no field looks like a time; for rows equally far apart write {"rate": HZ} in its place'
        return Line("time", why=why)
    unit, sure, why = clock.stamp, SURE, "its values are points in time"
    if not clock.stamp:
        unit, sure, why = unit_of_time(clock.name, summary.field.unit, clock.first, clock.step)
    if clock.backwards or clock.repeated:
        faults = f"goes back {counted(clock.backwards, 'time')} and stands still {counted(clock.repeated, 'time')}"
        why += f'; it {faults}: see "disorder" in "log"'
    return Line("time", summary.source, unit, sure, why, clock.wrap, clock.pattern)


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
        {key: getattr(summary.field, key) for key in ("name", "type", "unit")}
        | {"count": summary.count, "missing": summary.missing}
        | {"range": [summary.low, summary.high] if summary.low <= summary.high else None}
        | {"example": summary.example or None}
        for summary in topic.fields
    ]
    return {"name": topic.topic.name, "clock": topic.clock and _clock(topic.clock, factor), "fields": fields}


def _clock(clock: ClockSummary, factor: float | None) -> dict[str, Any]:
    spans = {"step": clock.step, "duration": clock.last - clock.first, "largest_step": clock.largest}
    seconds = {key: clock.seconds(span, factor) for key, span in spans.items()}
    step = seconds.pop("step")
    counts = {key: getattr(clock, key) for key in ("rows", "first", "last", "gaps", "repeated", "backwards")}
    return {"field": clock.name, "rate": 1.0 / step if step else None, **seconds, **counts}


def field_rows(topic: TopicSummary) -> Iterator[list[str]]:
    """Yield the cells of each field: name, type, unit, values, missing, least, most."""
    for summary in topic.fields:
        span = [_shown(value, summary.field.kind == TIME, ".6g") for value in (summary.low, summary.high)]
        span = [_short(summary.example), ""] if summary.low > summary.high else span
        values = [str(summary.count - summary.missing) if summary.count else "", str(summary.missing or "")]
        yield [_short(summary.field.name), summary.field.type, summary.field.unit, *values, *span]


def clock_line(topic: TopicSummary, factor: float | None) -> str:
    """Return a sentence about a topic's clock."""
    name, clock = topic.topic.name or "the log", topic.clock
    if clock is None:
        return f"{name}: no field looks like a time"
    of = _clock(clock, factor)
    first, last = (_shown(time, bool(clock.stamp), ".10g") for time in (clock.first, clock.last))
    parts = [f"{counted(clock.rows, 'row')} by {clock.name}, from {first} to {last}"]
    if of["rate"]:
        parts.append(f"{of['duration']:.6g} s at {of['rate']:.4g} Hz, largest step {1e3 * of['largest_step']:.4g} ms")
    for count, what in ((clock.gaps, "gap"), (clock.repeated, "repeated time")):
        if count:
            parts.append(counted(count, what) + " of more than ten steps" * (what == "gap"))
    if clock.backwards:
        parts.append(f"goes back {counted(clock.backwards, 'time')}")
    return f"{name}: {', '.join(parts)}"


def _shown(value: float, is_stamp: bool, form: str) -> str:
    """Return a number, or a point in time of ns since 1970, as text."""
    if not is_stamp:
        return format(value, form)
    moment = datetime.datetime.fromtimestamp(value * 1e-9, datetime.timezone.utc)
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
