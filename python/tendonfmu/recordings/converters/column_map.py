"""What MAP.json of `tendonfmu convert table` says: which column of a log becomes which of ours, in which unit.

Each of our columns is  sign · scale · factor of the unit · (reading − offset); `wrap` first takes the jumps out of
readings of a counter that starts again. Where `convert inspect` could not decide, a value is
"?", which is refused here. docs/reference/commands/convert.md explains the keys, and
`schema/map.schema.json`, made from `map_types`, is for editors.
"""

from __future__ import annotations

import codecs
import json
import re
import zoneinfo
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.files import Node, Refusal, read_json
from tendonfmu.recordings.converters import units
from tendonfmu.recordings.converters.units import MappedColumn
from tendonfmu.recordings.recording import GROUPS, LABEL

FORMAT = "tendonfmu-map-1"
LARGEST = 1e12  # of offsets and scales, as of the signals of a recording
LEAVE_OUT = "leave out"
UNDECIDED = "?"  # written by `convert inspect`, refused by `convert table`
SEPARATORS = (",", ";", "\t", "|", " ")
GROUP_MARKS = (",", ".", " ", "'")  # between thousands

TURNING = {
    "time": units.TIME,
    "torque": units.TORQUE,
    "angle": units.ANGLE,
    "velocity": units.ANGULAR_SPEED,
    "known_load": units.TORQUE,
    "contact": units.NONE,
}
SLIDING = {
    "time": units.TIME,
    "force": units.FORCE,
    "position": units.LENGTH,
    "velocity": units.SPEED,
    "known_load": units.FORCE,
    "contact": units.NONE,
}
REQUIRED = {"turning": ("time", "torque", "angle"), "sliding": ("time", "force", "position")}

TURNING_QUANTITIES = (units.TIME, units.LENGTH, units.ANGLE)  # a force or torque makes no turns

_PREFIX = r"(?P<prefix>(?:[A-Za-z][A-Za-z0-9_.-]*?[_.-])?)"  # of a finger of a hand
_COLUMN = re.compile(rf"{_PREFIX}(?P<group>{'|'.join(units.OF_COLUMN)})(?:\[(?P<number>[1-9][0-9]?)\])?")


@dataclass(frozen=True)
class Joint:
    """A one-joint machine."""

    kind: str  # "turning" or "sliding"
    name: str  # name of the joint
    velocity_cutoff: float | None  # cut-off of the velocity (Hz)


@dataclass(frozen=True)
class LogFormat:
    """How a log is written, and what to do about its faults: `log` of the map."""

    separator: str | None = None  # of texts
    decimal: str | None = None
    thousands: str | None = None
    skip: int | None = None
    header: bool | None = None
    units_row: bool | None = None
    encoding: str | None = None
    missing: str = "refuse"  # rows without a number; or "leave out"
    disorder: str = "refuse"  # rows whose time does not increase; or "sort", and leave out what has the same time
    # column of time by topic, where it is not the obvious one
    clocks: Mapping[str, MappedColumn] = field(default_factory=dict)

    @property
    def leaves_out(self) -> bool:
        """Whether rows without a number are left out."""
        return self.missing == LEAVE_OUT


@dataclass(frozen=True)
class Resampling:
    """How topics come onto one clock."""

    rate: float | None = None  # samples per second
    largest_gap: float | None = None  # s; None: ten times the median step of each topic
    gaps: str = "refuse"  # samples in larger gaps; or "leave out"


@dataclass(frozen=True)
class ColumnMap:
    """A map that has been checked."""

    path: Path  # file of the map
    columns: Mapping[str, MappedColumn]  # by our name, or by the keys of `joint` if that is given
    joint: Joint | None = None  # the one-joint machine, or None
    log: LogFormat = field(default_factory=LogFormat)  # format of the log
    resample: Resampling | None = None  # none: only if the columns have several clocks


@dataclass(frozen=True)
class ConvertedLog:
    """A log that has been converted."""

    columns: dict[str, Numbers]  # columns of a recording, [N] each, in SI
    map: ColumnMap  # the map that was used
    velocity_cutoff: float = 0.0  # cut-off of velocities that were computed (Hz); 0 if there are none
    notes: list[str] = field(default_factory=list)  # what was left out or computed, one sentence each


def read_map(source: Path | Mapping[str, Any]) -> ColumnMap:
    """Read and check MAP.json, or its content. Raise InputError with file, key and what was expected."""
    path = source if isinstance(source, Path) else Path("map")
    document = read_json(path, "a map of columns") if source is path else json.loads(json.dumps(source))
    try:
        return _read(path, Node(document))
    except Refusal as refused:
        raise InputError(f"{path}: {refused}") from None


def read_log_format(path: Path) -> LogFormat:
    """Read `log` alone of MAP.json, for `convert inspect`: rows without a number stay. Raise InputError."""
    node = Node(read_json(path, "a map of columns"))
    try:
        node.member("format").choice(FORMAT)
        log = node.member("log").value or {}
        log = {key: value for key, value in log.items() if key not in ("missing", "disorder")}
        return replace(_read_log(Node(log, "log")), missing=LEAVE_OUT)
    except Refusal as refused:
        raise InputError(f"{path}: {refused}") from None


def _read(path: Path, node: Node) -> ColumnMap:
    node.keys(("format", "comment", "log", "columns", "joint", "resample"))
    node.member("format").choice(FORMAT)
    log, resample = _read_log(node.member("log")), _read_resampling(node.member("resample"))
    columns, joint = node.member("columns"), node.member("joint")
    if columns.absent == joint.absent:
        joint.refuse('either "columns" or "joint", one of the two')
    mapped, machine = (dict(_read_columns(columns)), None) if joint.absent else _read_joint(joint)
    return ColumnMap(path, mapped, machine, log, resample)


def _read_log(node: Node) -> LogFormat:
    return LogFormat(
        **_read_keys(
            node,
            {
                "separator": lambda key: key.choice(*SEPARATORS),
                "decimal": lambda key: key.choice(".", ","),
                "thousands": lambda key: key.choice(*GROUP_MARKS),
                "skip": lambda key: key.integer(0, 10000),
                "header": _flag,
                "units_row": _flag,
                "encoding": _encoding,
                "missing": lambda key: _decided(key, "refuse or leave out").choice("refuse", LEAVE_OUT),
                "disorder": lambda key: _decided(key, "refuse or sort").choice("refuse", "sort"),
                "clocks": _read_clocks,
            },
        )
    )


def _read_keys(node: Node, readers: Mapping[str, Callable[[Node], Any]]) -> dict[str, Any]:
    """Return the values of the keys of an object, of those that are there."""
    members = {} if node.absent else {key: node.member(key) for key in node.keys(readers).value}
    return {key: readers[key](member) for key, member in members.items() if not member.absent}


def _decided(node: Node, choices: str) -> Node:
    """Refuse what `convert inspect` has not decided."""
    if node.value == UNDECIDED:
        node.refuse(f"a decision that `convert inspect` has left to you: {choices}")
    return node


def _flag(node: Node) -> bool:
    if not isinstance(node.value, bool):
        node.refuse("true or false")
    return bool(node.value)


def _encoding(node: Node) -> str:
    try:
        return codecs.lookup(node.text("the name of an encoding")).name
    except LookupError:
        node.refuse("the name of an encoding, such as utf-8, utf-16 or latin-1")


def _read_clocks(node: Node) -> dict[str, MappedColumn]:
    names = node.keys(node.value if isinstance(node.value, dict) else ()).value
    return {name: _read_column(node.member(name), units.TIME) for name in names}


def _read_resampling(node: Node) -> Resampling | None:
    readers: dict[str, Callable[[Node], Any]] = {
        "rate": lambda key: key.number(0.0, 1e6, "Hz", above=True),
        "largest_gap": lambda key: key.number(0.0, 1e6, "s", above=True),
        "gaps": lambda key: key.choice("refuse", LEAVE_OUT),
    }
    return None if node.absent else Resampling(**_read_keys(node, readers))


def _read_columns(node: Node) -> Iterator[tuple[str, MappedColumn]]:
    """Read the long form: our columns by name, those of a finger of a hand with its prefix (docs/reference/hand.md)."""
    names = node.keys(node.value if isinstance(node.value, dict) else ()).value
    numbers: dict[str, dict[str, list[int]]] = {}  # by prefix and group
    for name in names:
        match = _COLUMN.fullmatch(name)
        is_clock = match is not None and match["group"] == "time" and bool(match["prefix"])
        if match is None or is_clock or (match["number"] is None) != (match["group"] in ("time", LABEL)):
            known = sorted(["time", *(f"{name}[1]" for name in GROUPS), LABEL])
            raise Refusal(f"{node.path}.{name}: unknown column; expected one of {', '.join(known)}")
        if match["number"]:
            numbers.setdefault(match["prefix"], {}).setdefault(match["group"], []).append(int(match["number"]))
        yield name, _read_column(node.member(name), units.OF_COLUMN[match["group"]])
    if "time" not in names:
        node.member("time").refuse("the log's column of time")
    for prefix, of_finger in (numbers or {"": {}}).items():
        has_tendons = not prefix or any(group.startswith("tendon") for group in of_finger)  # a wrist may have none
        for group, (unit, needed) in GROUPS.items():
            for i in range(1, max(of_finger.get(group, []), default=1 if needed and has_tendons else 0) + 1):
                if i not in of_finger.get(group, []):
                    where = f"{node.path}.{prefix}{group}[{i}]"
                    raise Refusal(f"{where}: missing; expected the log's column of it, to be in {unit}")


def _read_joint(node: Node) -> tuple[dict[str, MappedColumn], Joint]:
    kind_of = node.member("kind") if isinstance(node.value, dict) else Node(None)
    kind = "turning" if kind_of.absent else kind_of.choice("turning", "sliding")
    parts = TURNING if kind == "turning" else SLIDING
    node.keys(("kind", "name", "velocity_cutoff", *parts))
    for word in REQUIRED[kind]:
        if node.member(word).absent:
            node.member(word).refuse(f"the log's column of it, in one of {', '.join(parts[word])}")
    name, cutoff = node.member("name"), node.member("velocity_cutoff")
    wanted = None if cutoff.absent else cutoff.number(0.0, 1e6, "Hz")
    columns = {word: node.member(word) for word in parts if not node.member(word).absent}
    joint = Joint(kind, "joint" if name.absent else name.text("a name"), wanted)
    return {word: _read_column(column, parts[word]) for word, column in columns.items()}, joint


def _read_column(node: Node, known: Mapping[str, float]) -> MappedColumn:
    is_time = known is units.TIME
    rate = node.member("rate") if is_time and isinstance(node.value, dict) else Node(None)
    if not rate.absent:
        node.keys(("rate", "comment"))
        return MappedColumn(node.path, "", rate=rate.number(0.0, 1e6, "rows a second", above=True))
    extra = ("zone", "pattern") if is_time else ()
    node.keys(("column", "unit", "sign", "scale", "offset", "wrap", "comment", *extra))
    unit_names = [*known, *units.STAMPS] if is_time else list(known)
    source = _decided(node.member("column"), "the name of a column of the log")
    unit = _decided(node.member("unit"), f"one of {', '.join(unit_names)}")
    if isinstance(source.value, int) and not isinstance(source.value, bool) and source.value >= 1:
        column: str | int = source.value
    else:
        column = source.text("the name of a column of the log, or its number from 1")
    stamp = str(unit.value) if is_time and unit.value in units.STAMPS else ""
    for key in ("sign", "scale", "offset", "wrap") if stamp else ():
        if not node.member(key).absent:
            node.member(key).refuse(f'no such key with "unit": "{stamp}"; time counts from the first row')
    for key in extra if stamp != "datetime" else ():
        if not node.member(key).absent:
            node.member(key).refuse('no such key without "unit": "datetime"')
    if stamp:  # the recording's time counts from the first of them
        pattern = node.member("pattern")
        shape = "" if pattern.absent else pattern.text("a pattern of Python's strptime, such as %d.%m.%Y %H:%M:%S.%f")
        return MappedColumn(node.path, column, 1e-9, None, stamp, _zone(node.member("zone")), shape)
    sign = node.member("sign").integer(-1, 1, 1)
    if sign == 0:
        node.member("sign").refuse("1 or -1")
    scale = node.member("scale").number(0.0, LARGEST, "", 1.0, above=True)
    offset = node.member("offset")
    is_first = offset.value == "first"
    start = None if is_first else offset.number(-LARGEST * 1e9, LARGEST * 1e9, "the log's unit", 0.0)
    wrap = node.member("wrap").number(0.0, LARGEST, "the log's unit", 0.0)
    factor = sign * scale * _factor(unit, known, unit_names)
    return MappedColumn(node.path, column, factor, start, wrap=wrap, turns=known in TURNING_QUANTITIES)


def _zone(node: Node) -> str:
    name = "UTC" if node.absent else node.text("the name of a time zone, such as Europe/Berlin")
    try:
        return zoneinfo.ZoneInfo(name).key
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
        node.refuse("the name of a time zone, such as Europe/Berlin")


def _factor(unit: Node, known: Mapping[str, float], names: list[str]) -> float:
    """Return the factor of the unit. A missing unit is refused unless the quantity has none."""
    if known is units.NONE and unit.absent:
        return 1.0
    value = units.factor(unit.value, known) if isinstance(unit.value, str) and unit.value else None
    if value is None:
        unit.refuse(f"one of {', '.join(names)}" + ("" if known is units.NONE else ", or another unit of this kind"))
    return value
