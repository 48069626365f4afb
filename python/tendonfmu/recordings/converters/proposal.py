"""Which map fits a log: what each field likely is, by its name and unit, and how sure that is.

What cannot be decided becomes "?" in the map, which `convert table` refuses.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from tendonfmu.recordings.converters.column_map import FORMAT, UNDECIDED
from tendonfmu.recordings.converters.inspection import FieldSummary, Inspection, TopicSummary, is_numeric
from tendonfmu.recordings.converters.unit_guess import SURE, Guess, stated, unit_of, unit_of_time
from tendonfmu.recordings.converters.unit_guess import UNDECIDED as NOT_SURE

QUANTITY = {
    "tendon_force": "force",
    "tendon_position": "length",
    "joint_position": "angle",
    "joint_velocity": "angular speed",
    "external_torque": "torque",
    "torque": "torque",
}
BY_QUANTITY = {"force": "tendon_force", "length": "tendon_position", "angle": "joint_position", "torque": "torque"}
BY_QUANTITY["angular speed"] = "joint_velocity"

SI = {"force": "N", "length": "m", "angle": "rad", "angular speed": "rad/s", "torque": "N.m"}

TENDON = {"tendon", "tendons", "cable", "spool", "motor", "motors", "actuator", "wire", "winch", "excursion", "x0"}
MOTION = {
    "position",
    "pos",
    "length",
    "displacement",
    "stroke",
    "excursion",
    "travel",
    "spool",
    "x0",
    "x",
    "motor",
    "encoder",
}
FORCES = {"tension", "tensions", "force", "forces", "loadcell", "f", "f0", "load"}
TORQUES = {"torque", "torques", "tau", "effort", "moment", "trq"}
SPEEDS = {"velocity", "velocities", "vel", "speed", "qd", "dq", "omega", "rate"}
ANGLES = {"joint", "joints", "angle", "angles", "q", "theta", "phi", "position", "pos", "encoder", "ang"}
REFERENCE = {"external", "ext", "reference", "ref", "ft", "sensor"}
CONTACT = {"contact", "touch", "label", "touching"}
# words that say that a signal is not measured, or no signal of a finger
OTHERS = {"desired", "des", "target", "command", "cmd", "setpoint", "goal", "temperature", "temp", "current", "voltage"}
OTHERS |= {"pwm", "error", "imu", "acceleration", "acc", "covariance", "seq", "status", "mode"}


@dataclass(frozen=True)
class Line:
    """A line of the proposed map.

    Attributes
    ----------
    column
        Our name.
    source
        The log's, or "?".
    unit
        Its unit, or "?".
    sure
        SURE, LIKELY, GUESS or UNDECIDED.
    why
        In words.
    """

    column: str
    source: str | int
    unit: str
    sure: str
    why: str


@dataclass
class Proposal:
    """A proposed map.

    Attributes
    ----------
    document
        The map, as in the JSON file.
    lines
        Its lines.
    unused
        Names of fields that it does not use.
    """

    document: dict[str, Any]
    lines: list[Line] = field(default_factory=list)
    unused: list[str] = field(default_factory=list)


def propose(found: Inspection) -> Proposal:
    """Propose a map.

    Parameters
    ----------
    found
        What is in the log.

    Returns
    -------
    Proposal
        The map, and why.
    """
    groups: dict[str, list[tuple[TopicSummary, FieldSummary]]] = {}
    for topic in found.topics:
        for each in topic.fields:
            group = group_of(each) if topic.clock is None or each.field.name != topic.clock.name else None
            if group:
                groups.setdefault(group, []).append((topic, each))
    for members in groups.values():
        members.sort(key=lambda member: _in_order(member[1].field.name))
    one_joint = "tendon_force" not in groups and "torque" in groups
    lines = _joint(found, groups) if one_joint else _finger(found, groups)
    used = {line.source for line in lines}
    names = [f.field.name for topic in found.topics for f in topic.fields]
    return Proposal(_document(found, lines, one_joint), lines, [name for name in names if name not in used])


def words_of(name: str) -> list[str]:
    """Return the words of a name in lower case: `TendonForce_2` is tendon, force."""
    plain = re.sub(r"[\[(].*?[\])]", " ", name) if not re.search(r"\[\w+\]$", name) else name
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", plain)
    return [word.lower() for word in re.findall(r"[A-Za-z]+0?(?![A-Za-z])|[A-Za-z]+", apart)]


def group_of(summary: FieldSummary) -> str | None:
    """Return what a field likely is: a group of columns, "torque", or None."""
    if not is_numeric(summary):
        return None
    words = set(words_of(summary.field.name))
    if words & OTHERS:
        return None
    if words & CONTACT:
        return "contact" if summary.only_flags else None
    if words & TORQUES and words & REFERENCE:
        return "external_torque"
    said = stated(summary.field.name, summary.field.unit)
    if said is not None:
        quantity = said[1]
        if quantity == "angle" and words & TENDON and not words & {"joint", "joints"}:
            return "tendon_position"  # a motor's angle, which needs the radius of its spool
        return BY_QUANTITY.get(quantity)
    if words & SPEEDS:
        return None if words & TENDON else "joint_velocity"
    if words & FORCES or (words & TENDON and words & {"effort"}):
        return "tendon_force"
    if words & TORQUES:
        return "torque"
    if words & TENDON and words & MOTION:
        return "tendon_position"
    return "joint_position" if words & ANGLES else None


def _in_order(name: str) -> list[Any]:
    """Return a key by which F2 comes before F10."""
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"(\d+)", name) if part]


# --- lines ------------------------------------------------------------------------------------------------------------


def _finger(found: Inspection, groups: dict[str, list[tuple[TopicSummary, FieldSummary]]]) -> list[Line]:
    forces = groups.get("tendon_force", [])
    positions = groups.get("tendon_position", [])
    lines = [_time(found, next(iter(forces or positions), None))]
    count = max(len(forces), len(positions), 1)
    for name, members in (("tendon_force", forces), ("tendon_position", positions)):
        for k in range(count):
            column = f"{name}[{k + 1}]"
            if k < len(members):
                lines.append(_line(found, column, name, members[k][1], count > len(members)))
            else:
                why = (
                    f"{len(members)} fields look like {name}, and {max(len(forces), len(positions))} tendons are needed"
                )
                lines.append(Line(column, UNDECIDED, UNDECIDED, NOT_SURE, why))
    for name in ("joint_position", "joint_velocity", "external_torque"):
        for k, (_, each) in enumerate(groups.get(name, []), start=1):
            lines.append(_line(found, f"{name}[{k}]", name, each, False))
    contacts = groups.get("contact", [])
    if len(contacts) == 1:
        lines.append(Line("contact", _source(found, contacts[0][1]), "1", "likely", "its name, and it is only 0 or 1"))
    return lines


def _joint(found: Inspection, groups: dict[str, list[tuple[TopicSummary, FieldSummary]]]) -> list[Line]:
    """Return the lines of a machine with one joint. Of several joints the user has to choose one."""
    lines = [_time(found, groups["torque"][0])]
    for key, group in (("torque", "torque"), ("angle", "joint_position"), ("velocity", "joint_velocity")):
        members = groups.get(group, [])
        if len(members) == 1:
            line = _line(found, key, group, members[0][1], False)
            lines.append(line)
        elif key != "velocity":
            names = ", ".join(str(each.field.name) for _, each in members[:8])
            why = f"{len(members)} fields may be it: {names}" if members else "no field looks like it"
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
    if not words & (TENDON | FORCES | TORQUES | SPEEDS | ANGLES | REFERENCE):
        sure, why = ("likely" if guess.sure == SURE else guess.sure), guess.why
    if short and sure == SURE:
        sure = "likely"
    if summary.missing:
        why += f'; {summary.missing} of {summary.count} values are missing: see "missing" in "log"'
    return Line(column, _source(found, summary), guess.unit, sure, why)


def _time(found: Inspection, beside: tuple[TopicSummary, FieldSummary] | None) -> Line:
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
            f'; it goes back {clock.backwards} times and stands still {clock.repeated} times: see "disorder" in "log"'
        )
    if clock.stamp:
        return Line("time", source, clock.stamp, SURE, f"its values are points in time{faults}")
    guess = unit_of_time(clock.name, summary.field.unit, clock.first, clock.step)
    return Line("time", source, guess.unit, guess.sure, f"{guess.why}{faults}")


def _source(found: Inspection, summary: FieldSummary) -> str | int:
    return summary.field.name if summary.key == summary.field.name else int(summary.key[1:])


# --- the map ----------------------------------------------------------------------------------------------------------


def _document(found: Inspection, lines: Sequence[Line], one_joint: bool) -> dict[str, Any]:
    columns = {}
    for line in lines:
        columns[line.column] = {"column": line.source, "unit": line.unit, "comment": f"{line.sure}: {line.why}"}
    document: dict[str, Any] = {"format": FORMAT}
    if found.settings:
        document["log"] = dict(found.settings)
    if one_joint:
        document["joint"] = {"name": re.sub(r"\W+", "_", found.file.name.split(".")[0]) or "joint", **columns}
    else:
        document["columns"] = columns
    return document
