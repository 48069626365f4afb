"""Which map fits a log: what each field likely is, by its name and unit, and how sure that is.

What cannot be decided becomes "?" in the map, which `convert table` refuses.
"""

from __future__ import annotations

import re
from collections.abc import Container, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from tendonfmu.files import are, counted
from tendonfmu.recordings.converters.column_map import FORMAT, UNDECIDED
from tendonfmu.recordings.converters.element_order import Order, in_order, matched, order_of
from tendonfmu.recordings.converters.field_groups import KNOWN, Member, field_groups, words_of
from tendonfmu.recordings.converters.inspection import FieldSummary, Inspection
from tendonfmu.recordings.converters.unit_guess import GUESS, LIKELY, SURE, Guess, stated, unit_of, unit_of_time
from tendonfmu.recordings.converters.unit_guess import UNDECIDED as NOT_SURE

QUANTITY = {
    "tendon_force": "force",
    "tendon_position": "length",
    "joint_position": "angle",
    "joint_velocity": "angular speed",
    "external_torque": "torque",
    "torque": "torque",
}
SI = {"force": "N", "length": "m", "angle": "rad", "angular speed": "rad/s", "torque": "N.m"}


@dataclass(frozen=True)
class Line:
    """A line of the proposed map."""

    column: str  # our name
    source: str | int  # the log's, or "?"
    unit: str  # its unit, or "?"
    sure: str  # SURE, LIKELY, GUESS or UNDECIDED
    why: str  # in words


@dataclass
class Proposal:
    """A proposed map."""

    document: dict[str, Any]  # the map, as in the JSON file
    lines: list[Line] = field(default_factory=list)  # its lines
    unused: list[str] = field(default_factory=list)  # names of fields that it does not use
    orders: list[Order] = field(default_factory=list)  # how tendons and joints are numbered, where there are several
    undecided: list[str] = field(default_factory=list)  # keys of the map that are "?"


def propose(found: Inspection) -> Proposal:
    """Propose a map."""
    groups, by_name = field_groups(found)
    one_joint = "tendon_force" not in groups and "torque" in groups
    slots, orders = _numbered(groups)
    if one_joint:
        lines = _joint(found, groups)
    else:
        lines = [_doubtful(line, orders) for line in _finger(found, slots, by_name)]
        lines += _contact(found, groups.get("contact", []))
    used = {line.source for line in lines}
    names = [f.field.name for topic in found.topics for f in topic.fields]
    log = _log_settings(found, lines)
    undecided = [f"log.{key}" for key, value in log.items() if value == UNDECIDED]
    undecided += [line.column for line in lines if UNDECIDED in (line.source, line.unit)]
    shown = [] if one_joint else orders
    document = _document(found, log, lines, shown, one_joint)
    return Proposal(document, lines, [name for name in names if name not in used], shown, undecided)


# --- order ------------------------------------------------------------------------------------------------------------

OF_TENDONS = ("tendon_force", "tendon_position")
OF_JOINTS = ("joint_position", "joint_velocity", "external_torque")
Slots = dict[str, list[Member | None]]


def _numbered(groups: dict[str, list[Member]]) -> tuple[Slots, list[Order]]:
    """Return the fields of each group by index, None where an element has none, and what the order is by."""
    slots: Slots = {}
    orders = []
    for of, names in (("tendons", OF_TENDONS), ("joints", OF_JOINTS)):
        here = [name for name in names if groups.get(name)]
        if not here:
            continue
        most = max(len(groups[name]) for name in here)
        first = next(name for name in here if len(groups[name]) == most)
        leading, by_number = in_order(groups[first], _name)
        for name in here:
            if name == first:
                slots[name] = list(leading)
                continue
            slots[name], known = _beside(leading, groups[name])
            by_number &= known
        if most > 1:
            listed = [[_name(each) if each else "" for each in slots[name]] for name in here]
            orders.append(order_of(of, by_number, listed))
    return slots, orders


def _beside(leading: Sequence[Member], members: Sequence[Member]) -> tuple[list[Member | None], bool]:
    """Return members at the indices of those with the same number or name, or else in an order of their own."""
    places = matched([_name(each) for each in leading], [_name(each) for each in members])
    if places is None:
        own, numbered = in_order(members, _name)
        return list(own), numbered
    return [members[places.index(k)] if k in places else None for k in range(max(places) + 1)], True


def _name(member: Member) -> str:
    return member[1].field.name


def _doubtful(line: Line, orders: Sequence[Order]) -> Line:
    """Return a line, not surer than the index of its tendon or joint."""
    of = "tendons" if line.column.startswith(OF_TENDONS) else "joints" if line.column.startswith(OF_JOINTS) else ""
    guessed = any(order.of == of and order.sure == GUESS for order in orders)
    return replace(line, sure=LIKELY) if guessed and line.sure == SURE else line


# --- lines ------------------------------------------------------------------------------------------------------------


def _looking(number: int, name: str) -> str:
    return f"{counted(number, 'field')} look{'s' if number == 1 else ''} like {name}"


def _finger(found: Inspection, slots: Slots, by_name: Container[str]) -> list[Line]:
    """Return the lines of a finger. by_name: tendon positions that are known only by names like those of the forces."""
    present = {name: [each for each in members if each] for name, members in slots.items()}
    forces, positions = (present.get(name, []) for name in OF_TENDONS)
    lines = [_time(found, next(iter(forces or positions), None))]
    count = max(*(len(slots.get(name, [])) for name in OF_TENDONS), 1)
    for name in OF_TENDONS:
        members = slots.get(name, [])
        for k in range(count):
            member = members[k] if k < len(members) else None
            if member is not None:
                line = _line(found, f"{name}[{k + 1}]", name, member[1], count > len(present[name]))
                lines.append(_by_name(line) if _name(member) in by_name else line)
            else:
                seen = len(present.get(name, []))
                why = f"{_looking(seen, name)}, and {counted(count, 'tendon')} {are(count)} needed"
                lines.append(Line(f"{name}[{k + 1}]", UNDECIDED, UNDECIDED, NOT_SURE, why))
    for name in OF_JOINTS:
        for k, each in enumerate(slots.get(name, []), start=1):
            if each is not None:
                lines.append(_line(found, f"{name}[{k}]", name, each[1], False))
            else:
                why = f"{_looking(len(present[name]), name)}, and the log has more joints"
                lines.append(Line(f"{name}[{k}]", UNDECIDED, UNDECIDED, NOT_SURE, why))
    return lines


def _contact(found: Inspection, members: Sequence[Member]) -> list[Line]:
    if len(members) != 1:
        return []
    return [Line("contact", _source(found, members[0][1]), "1", "likely", "its name, and it is only 0 or 1")]


def _by_name(line: Line) -> Line:
    """Return the line of a position that may also be the angle of a joint."""
    sure = LIKELY if line.sure == SURE else line.sure
    return replace(line, sure=sure, why=f"as many as forces, with the same names or numbers; {line.why}")


def _joint(found: Inspection, groups: dict[str, list[Member]]) -> list[Line]:
    """Return the lines of a machine with one joint. Of several joints the user has to choose one."""
    lines = [_time(found, groups["torque"][0])]
    for key, group in (("torque", "torque"), ("angle", "joint_position"), ("velocity", "joint_velocity")):
        members = groups.get(group, [])
        if len(members) == 1:
            line = _line(found, key, group, members[0][1], False)
            lines.append(line)
        elif key != "velocity":
            names = ", ".join(str(each.field.name) for _, each in members[:8])
            why = f"{counted(len(members), 'field')} may be it: {names}" if members else "no field looks like it"
            lines.append(Line(key, UNDECIDED, UNDECIDED, NOT_SURE, why))
    return lines


def _line(found: Inspection, column: str, group: str, summary: FieldSummary, short: bool) -> Line:
    named = summary.field
    words = set(words_of(named.name))
    said = stated(named.name, named.unit)
    if re.search(rf"(^|[./]){re.escape(column)}$", named.name) and not named.unit:
        return Line(
            column, _source(found, summary), SI[QUANTITY[group]], SURE, "the name of a recording's column, in SI"
        )
    if group == "tendon_position" and said is not None and said[1] == "angle":
        guess = Guess(
            UNDECIDED,
            NOT_SURE,
            f'{said[2]}, an angle: write "unit": "m" and "scale", the radius of the spool times rad',
        )
    else:
        guess = unit_of(named.name, named.unit, QUANTITY[group], summary.low, summary.high, found.messages)
    sure, why = guess.sure, f"named like {group}; {guess.why}"
    if not words & KNOWN:
        sure, why = ("likely" if guess.sure == SURE else guess.sure), guess.why
    if short and sure == SURE:
        sure = "likely"
    if summary.missing:
        values = f"{summary.missing} of {counted(summary.count, 'value')} {are(summary.missing)} missing"
        why += f'; {values}: see "missing" in "log"'
    return Line(column, _source(found, summary), guess.unit, sure, why)


def _time(found: Inspection, beside: Member | None) -> Line:
    """Return the line of time: the clock of the topic with the forces."""
    topic = beside[0] if beside else next((each for each in found.topics if each.clock), found.topics[0])
    clock = topic.clock
    if clock is None:
        return Line("time", UNDECIDED, UNDECIDED, NOT_SURE, "no field looks like a time")
    summary = next(each for each in topic.fields if each.field.name == clock.name)
    source = _source(found, summary)
    faults = ""
    if clock.backwards or clock.repeated:
        faults = (
            f"; it goes back {counted(clock.backwards, 'time')} and stands still {counted(clock.repeated, 'time')}: "
            'see "disorder" in "log"'
        )
    if clock.stamp:
        return Line("time", source, clock.stamp, SURE, f"its values are points in time{faults}")
    guess = unit_of_time(clock.name, summary.field.unit, clock.first, clock.step)
    return Line("time", source, guess.unit, guess.sure, f"{guess.why}{faults}")


def _source(found: Inspection, summary: FieldSummary) -> str | int:
    return summary.field.name if summary.key == summary.field.name else int(summary.key[1:])


# --- the map ----------------------------------------------------------------------------------------------------------


def _log_settings(found: Inspection, lines: Sequence[Line]) -> dict[str, Any]:
    """Return the key `log` of the map. What to do with missing numbers of its columns is left to the user."""
    settings = dict(found.settings)
    used = {line.source for line in lines}
    if any(each.missing and _source(found, each) in used for topic in found.topics for each in topic.fields):
        settings["missing"] = UNDECIDED
    return settings


def _document(
    found: Inspection, log: dict[str, Any], lines: Sequence[Line], orders: Sequence[Order], one_joint: bool
) -> dict[str, Any]:
    columns = {}
    for line in lines:
        columns[line.column] = {"column": line.source, "unit": line.unit, "comment": f"{line.sure}: {line.why}"}
    document: dict[str, Any] = {"format": FORMAT}
    if orders:
        document["comment"] = "; ".join(order.line() for order in orders)
    if log:
        document["log"] = log
    if one_joint:
        document["joint"] = {"name": re.sub(r"\W+", "_", found.file.name.split(".")[0]) or "joint", **columns}
    else:
        document["columns"] = columns
    return document
