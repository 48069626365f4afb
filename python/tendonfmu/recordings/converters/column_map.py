"""What MAP.json of `tendonfmu convert table` says: which column of a log becomes which of ours, in which unit.

Each of our columns is  sign · scale · factor of the unit · (reading − offset). docs/reference/commands/convert.md
explains the keys, and `schema/map.schema.json` defines them for editors.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files import Node, Refusal, read_json
from tendonfmu.recordings.converters import units
from tendonfmu.recordings.recording import GROUPS, LABEL

FORMAT = "tendonfmu-map-1"
LARGEST = 1e12  # of offsets and scales, as of the signals of a recording
SEPARATORS = (",", ";", "\t", "|", " ")

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

_COLUMN = re.compile(r"([a-z_]+)\[([1-9][0-9]?)\]")


@dataclass(frozen=True)
class MappedColumn:
    """One of our columns.

    Attributes
    ----------
    path
        Its key in the map.
    source
        Name of the column in the log, or its number from 1.
    factor
        sign · scale · unit.
    offset
        The reading that stands for zero, in the log's unit. None: the first reading.
    """

    path: str
    source: str | int
    factor: float = 1.0
    offset: float | None = 0.0

    def values(self, readings: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values [N] in SI of readings [N]."""
        offset = readings[0] if self.offset is None else self.offset
        # no unnecessary arithmetic: numbers in SI must not change by rounding
        shifted = readings - offset if offset else readings
        return shifted * self.factor if self.factor != 1.0 else shifted


@dataclass(frozen=True)
class Joint:
    """A one-joint machine.

    Attributes
    ----------
    kind
        "turning" or "sliding".
    name
        Name of the joint.
    velocity_cutoff
        Cut-off of the velocity (Hz). 0: no filter. None: chosen by the log's sample rate.
    """

    kind: str
    name: str
    velocity_cutoff: float | None


@dataclass(frozen=True)
class LogFormat:
    """How a CSV log is written.

    Attributes
    ----------
    separator
        None: found in the first line.
    decimal
        "." or ",".
    skip
        Lines before the header.
    header
        Whether the log has a line of names.
    """

    separator: str | None = None
    decimal: str = "."
    skip: int = 0
    header: bool = True


@dataclass(frozen=True)
class ColumnMap:
    """A map that has been checked.

    Attributes
    ----------
    path
        File of the map.
    columns
        By our name, or by the keys of `joint` if that is given.
    joint
        The one-joint machine, or None.
    log
        Format of the log.
    """

    path: Path
    columns: Mapping[str, MappedColumn]
    joint: Joint | None = None
    log: LogFormat = field(default_factory=LogFormat)


def read_map(path: Path) -> ColumnMap:
    """Read and check MAP.json. Raise InputError with file, key and what was expected."""
    document = read_json(path, "a map of columns")
    try:
        return _read(path, Node(document))
    except Refusal as refused:
        raise InputError(f"{path}: {refused}") from None


def _read(path: Path, node: Node) -> ColumnMap:
    node.keys(("format", "log", "columns", "joint"))
    node.member("format").choice(FORMAT)
    log = _read_log(node.member("log"))
    columns, joint = node.member("columns"), node.member("joint")
    if columns.absent == joint.absent:
        joint.refuse('either "columns" or "joint", one of the two')
    if joint.absent:
        return ColumnMap(path, dict(_read_columns(columns)), None, log)
    found, machine = _read_joint(joint)
    return ColumnMap(path, found, machine, log)


def _read_log(node: Node) -> LogFormat:
    if node.absent:
        return LogFormat()
    node.keys(("separator", "decimal", "skip", "header"))
    separator = node.member("separator")
    decimal = node.member("decimal")
    header = node.member("header")
    if not header.absent and not isinstance(header.value, bool):
        header.refuse("true or false")
    found = LogFormat(
        separator=None if separator.absent else separator.choice(*SEPARATORS),
        decimal="." if decimal.absent else decimal.choice(".", ","),
        skip=node.member("skip").integer(0, 10000, 0),
        header=header.absent or header.value,
    )
    if found.separator == found.decimal:
        decimal.refuse("another character than the separator")
    return found


def _read_columns(node: Node) -> Iterator[tuple[str, MappedColumn]]:
    """Read the long form: our columns by name. The reader of recordings checks their number."""
    names = node.keys(node.value if isinstance(node.value, dict) else ()).value
    for name in names:
        match = _COLUMN.fullmatch(name)
        group = match[1] if match else name
        if group not in units.OF_COLUMN or (match is None) != (group in ("time", LABEL)):
            known = ("time", *(f"{each}[1]" for each in GROUPS), LABEL)
            raise Refusal(f"{node.path}.{name}: unknown column; expected one of {units.nearest(name, known)}")
        yield name, _read_column(node.member(name), units.OF_COLUMN[group])
    if "time" not in names:
        node.member("time").refuse("the log's column of time")
    for group, (unit, needed) in GROUPS.items():
        numbers = sorted(int(match[2]) for name in names if (match := _COLUMN.fullmatch(name)) and match[1] == group)
        for i in range(1, max(numbers, default=1 if needed else 0) + 1):
            if i not in numbers:
                raise Refusal(f"{node.path}.{group}[{i}]: missing; expected the log's column of it, to be in {unit}")


def _read_joint(node: Node) -> tuple[dict[str, MappedColumn], Joint]:
    kind_of = node.member("kind") if isinstance(node.value, dict) else Node(None)
    kind = "turning" if kind_of.absent else kind_of.choice("turning", "sliding")
    parts = TURNING if kind == "turning" else SLIDING
    node.keys(("kind", "name", "velocity_cutoff", *parts))
    for word in REQUIRED[kind]:
        if node.member(word).absent:
            node.member(word).refuse(f"the log's column of it, in one of {', '.join(parts[word])}")
    name, cutoff = node.member("name"), node.member("velocity_cutoff")
    if not cutoff.absent and not node.member("velocity").absent:
        cutoff.refuse("no cut-off together with a column of velocity, which is not filtered")
    joint = Joint(
        kind,
        "joint" if name.absent else name.text("a name"),
        None if cutoff.absent else cutoff.number(0.0, 1e6, "Hz"),
    )
    columns = {
        word: _read_column(node.member(word), known) for word, known in parts.items() if not node.member(word).absent
    }
    return columns, joint


def _read_column(node: Node, known: Mapping[str, float]) -> MappedColumn:
    node.keys(("column", "unit", "sign", "scale", "offset"))
    source = node.member("column")
    if isinstance(source.value, int) and not isinstance(source.value, bool) and source.value >= 1:
        column: str | int = source.value
    else:
        column = source.text("the name of a column of the log, or its number from 1")
    unit = node.member("unit")
    sign = node.member("sign").integer(-1, 1, 1)
    if sign == 0:
        node.member("sign").refuse("1 or -1")
    scale = node.member("scale").number(0.0, LARGEST, "", 1.0, above=True)
    offset = node.member("offset")
    first = offset.value == "first"
    start = None if first else offset.number(-LARGEST * 1e9, LARGEST * 1e9, "the log's unit", 0.0)
    return MappedColumn(node.path, column, sign * scale * _factor(unit, known), start)


def _factor(unit: Node, known: Mapping[str, float]) -> float:
    """Return the factor of the unit. A missing unit is refused unless the quantity has none."""
    if known is units.NONE and unit.absent:
        return 1.0
    if not isinstance(unit.value, str) or unit.value not in known:
        unit.refuse(f"one of {', '.join(known)}")
    return known[str(unit.value)]
