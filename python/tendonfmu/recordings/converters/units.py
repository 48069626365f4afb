"""Which units a map of columns may name, each with its factor to SI: si = factor · value.

The tables hold the common units with their exact factors. Any other name is looked up in pint, which takes most of a
second to import. Angles are kept apart from plain numbers, and no unit is both a length and an angle. A metre of a
sliding axis stands for a radian (see `one_joint`).

Stamps of a log become points in time, ns since 1970: integers, which lose nothing.
"""

from __future__ import annotations

import datetime
import functools
import math
import re
import zoneinfo
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from tendonfmu.errors import InputError

POUND_FORCE = 4.4482216152605  # N, by definition
INCH = 0.0254  # m, by definition

TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": 9.80665, "gf": 9.80665e-3, "lbf": POUND_FORCE}
TORQUE = {
    "N.m": 1.0,
    "mN.m": 1e-3,
    "kN.m": 1e3,
    "N.mm": 1e-3,
    "N.cm": 1e-2,
    "kgf.cm": 9.80665e-2,
    "lbf.in": POUND_FORCE * INCH,
}
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "inch": INCH}
ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "turn": 2 * math.pi}
SPEED = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "m/min": 1.0 / 60}
ANGULAR_SPEED = {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": math.pi / 180, "rpm": 2 * math.pi / 60, "turn/s": 2 * math.pi}
NONE = {"1": 1.0}

# Units of time that are points in time. `datetime` is a text, or a field that its format declares a time.
STAMPS = {"epoch_s": 10**9, "epoch_ms": 10**6, "epoch_us": 10**3, "epoch_ns": 1, "datetime": 1}  # ns per unit

# units in which each column of a recording may be given
OF_COLUMN = {
    "time": TIME,
    "tendon_force": FORCE,
    "tendon_position": LENGTH,
    "joint_position": ANGLE,
    "joint_velocity": ANGULAR_SPEED,
    "external_torque": TORQUE,
    "contact": NONE,
}

# name in the tables: what loggers and engineers write
_SPELLINGS = {
    "s": "sec secs second seconds [s]",
    "ms": "msec millis millisecond milliseconds",
    "us": "usec micros microsecond µs μs microseconds",
    "ns": "nsec nanoseconds",
    "min": "minutes",
    "N": "newton newtons Newton",
    "kgf": "kg-force",
    "N.m": "Nm N*m N·m N-m",
    "mN.m": "mNm mN*m mN·m",
    "N.mm": "Nmm N*mm N·mm",
    "N.cm": "Ncm N*cm",
    "kgf.cm": "kgfcm kgcm kg.cm",
    "lbf.in": "inlbf in.lbf",
    "m": "meter metre meters metres",
    "mm": "millimeter millimetre millimeters millimetres",
    "um": "µm μm",
    "inch": "in inches",
    "rad": "radian radians",
    "deg": "° degree degrees",
    "turn": "rev revolution revolutions turns",
    "turn/s": "rps rev/s",
    "deg/s": "°/s degree/s degrees/s deg/sec",
    "rad/s": "rad/sec",
    "rpm": "RPM 1/min rev/min",
    "m/s": "mps",
}
ALIASES = {"N m": "N.m"} | {alias: name for name, aliases in _SPELLINGS.items() for alias in aliases.split()}

QUANTITIES = {
    "time": TIME,
    "force": FORCE,
    "torque": TORQUE,
    "length": LENGTH,
    "angle": ANGLE,
    "speed": SPEED,
    "angular speed": ANGULAR_SPEED,
}


def factor(name: str, known: Mapping[str, float]) -> float | None:
    """Return the factor of a unit to SI."""
    usual = ALIASES.get(name, name)
    if usual in known:
        return known[usual]
    if known is NONE or any(usual in table for table in QUANTITIES.values()):
        return None
    return _factor_by_pint(name, si_of(known))


def si_of(known: Mapping[str, float]) -> str:
    """Return the name of the SI unit in a table."""
    return next(unit for unit, value in known.items() if value == 1.0)


def quantity(name: str) -> tuple[str, str] | None:
    """Return (name in the tables, quantity) of a common unit, or None."""
    usual = ALIASES.get(name, name)
    for what, table in QUANTITIES.items():
        if usual in table:
            return usual, what
    return None


def stated(name: str, unit: str) -> tuple[str, str, str] | None:
    """Return (unit, quantity, where) that a log states for a field, in its unit or its name, or None."""
    if unit and (known := quantity(unit.strip(" []()"))):
        return (*known, f"the log states {unit!r}")
    for text in re.findall(r"[\[(]\s*([^\])]+?)\s*[\])]", name):
        if known := quantity(text):
            return (*known, f"the name says [{text}]")
    if (whole := quantity(name.lower())) and whole[1] == "time" and len(name) > 3:
        return (*whole, f"the name is {name}")
    for text in reversed(re.split(r"[_ /]|(?<=[a-z])\.(?=[a-z])", name)[1:]):
        known = quantity(text)
        # single letters and words such as "in" and "min" mean many things; N and s at the end of a name do not
        if known and (len(text) > 1 or text in ("N", "s", "m")) and text not in ("in", "min", "us", "s2"):
            return (*known, f"the name ends in {text}") if name.endswith(text) else None
    return None


@functools.cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


def _factor_by_pint(name: str, reference: str) -> float | None:
    """Return the factor to `reference`, or None. Root units keep the radian, which has no dimension, apart from 1."""
    registry = _registry()
    try:
        given = registry.Quantity(1.0, registry.parse_units(name)).to_root_units()
    except Exception:  # pint raises errors of its parser and of Python's tokenizer for texts that are no unit
        return None
    wanted = registry.Quantity(1.0, registry.parse_units(reference.replace(".", "*"))).to_root_units()
    if given.units != wanted.units:
        return None
    value = float(given.magnitude / wanted.magnitude)
    return value if math.isfinite(value) and value > 0.0 else None


# --- a column ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class MappedColumn:
    """One of our columns."""

    path: str  # its key in the map
    source: str | int  # name of the column in the log, or its number from 1
    factor: float = 1.0  # sign · scale · unit
    offset: float | int | None = 0.0  # the reading that stands for zero, in the log's unit
    stamp: str = ""  # one of `STAMPS` if the readings are points in time, or ""
    zone: str = "UTC"  # time zone of texts without one
    pattern: str = ""  # pattern of texts (`datetime.strptime`), or "": ISO 8601
    rate: float = 0.0  # rows a second of a log without a column of time, or 0
    wrap: float = 0.0  # readings after which a counter starts again, or 0
    # whether its jumps are followed over many turns; otherwise readings above half of `wrap` count as negative
    turns: bool = False

    def values(self, readings: NDArray[Any]) -> NDArray[np.float64]:
        """Return the values [N] in SI of readings [N], integer or float. The offset is a number."""
        # no unnecessary arithmetic: numbers in SI must not change by rounding
        if self.wrap and not self.turns:
            readings = (readings + self.wrap / 2.0) % self.wrap - self.wrap / 2.0
        shifted = readings - self.offset if self.offset else readings
        return (shifted * self.factor if self.factor != 1.0 else shifted).astype(np.float64)


# --- stamps -----------------------------------------------------------------------------------------------------------

NANOSECONDS = 10**9
LATEST = 2**62  # ns; the year 2116
DAY = 86400 * NANOSECONDS
DATES = (
    *("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y", "%d.%m.%y"),
    *("%d/%m/%y", "%m/%d/%y", "%d-%b-%Y", "%d %b %Y", "%b %d, %Y", "%Y%m%d", "0 days"),
)
PATTERNS = [
    f"{date}{hour}"
    for date in ("", *(f"{date} " for date in DATES), *(f"{date}T" for date in DATES))
    for hour in ("%H:%M:%S.%f", "%I:%M:%S.%f %p", "%M:%S.%f")
]
FRACTION = re.compile(r"(.*?\d:\d\d(?::\d\d)?)(?:[.,:](\d+))?(\D*)")  # of a second, which may be left out
ZONED = r"(Z|[+-]\d{2}:?(\d{2})?)\s*$"
EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)

Stamps = NDArray[np.int64]


def nanoseconds(file: Path, column: MappedColumn, readings: Any, row: int = 0) -> Stamps:
    """Return stamps [N] as ns since 1970. row: rows of the log before them."""
    if not isinstance(readings, pa.Array | pa.ChunkedArray):
        return _of_numbers(file, column, np.asarray(readings), row)
    texts = pc.utf8_trim_whitespace(readings)
    if column.stamp == "datetime":
        texts = pc.replace_substring_regex(texts, r"(:\d\d),(\d)", r"\1.\2")
    try:
        stamps = _at_once(column, texts)
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        stamps = None
    if stamps is not None:
        return stamps
    return np.array([_alone(file, column, text or "", row + k) for k, text in enumerate(texts.to_pylist())], np.int64)


def pattern_of(texts: Sequence[str]) -> str:
    """Return the pattern of `PATTERNS` that fits all texts; of several the one by which they lie closest; or ""."""
    spans = {}
    for pattern in PATTERNS:
        try:
            times = [_moment(text.strip(), pattern, "UTC") for text in texts]
        except ValueError:
            continue
        spans[pattern] = max(times) - min(times)
    return min(spans, key=lambda pattern: spans[pattern], default="")


def of_day_alone(column: MappedColumn) -> bool:
    """Return whether a column's texts are times of day, which start again at midnight."""
    return bool(column.pattern) and not re.search("%[djxcU]", column.pattern)


def _refused(file: Path, column: MappedColumn, row: int, reading: Any, expected: str) -> InputError:
    return InputError(f"{file}: column {column.source}, row {row + 1}: {reading!r}; expected {expected}")


def _of_numbers(file: Path, column: MappedColumn, readings: NDArray[Any], row: int) -> Stamps:
    unit = STAMPS[column.stamp]
    is_whole = readings.dtype.kind in "iu"
    if is_whole:
        expected = f"at most {LATEST // unit} {column.stamp}"
        wrong = np.abs(readings.astype(np.int64)) > LATEST // unit
    elif column.stamp == "datetime":
        expected = f'a time; for a number write "unit": "epoch_s" (or ms, us, ns) at {column.path}'
        wrong = np.ones(len(readings), dtype=bool)
    else:
        expected = f"a time in {column.stamp}"
        wrong = ~(np.abs(readings) <= LATEST / unit)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise _refused(file, column, row + k, readings[k], expected)
    if is_whole:
        return readings.astype(np.int64) * unit
    whole = np.floor(readings)
    # the integer part apart: a product of a double would lose nanoseconds
    stamps: Stamps = whole.astype(np.int64) * unit + np.round((readings - whole) * unit).astype(np.int64)
    return stamps


def _at_once(column: MappedColumn, texts: Any) -> Stamps | None:
    """Return the stamps of texts [N], or None if each has to be read alone. Raise an error of Arrow likewise."""
    if column.stamp != "datetime":
        return np.asarray(texts.cast(pa.int64()).to_numpy()) * STAMPS[column.stamp]
    if column.pattern:
        return None
    zoned = pc.match_substring_regex(texts, ZONED)
    if pc.all(zoned).as_py():
        return np.asarray(texts.cast(pa.timestamp("ns", "UTC")).cast(pa.int64()).to_numpy())
    if pc.any(zoned).as_py() or texts.null_count:
        return None
    local = texts.cast(pa.timestamp("ns"))
    if column.zone != "UTC":
        # an hour that occurs twice is taken as the earlier one, so that time does not jump ahead
        local = pc.assume_timezone(local, column.zone, ambiguous="earliest", nonexistent="earliest")
    return np.asarray(local.cast(pa.int64()).to_numpy())


def _alone(file: Path, column: MappedColumn, text: str, row: int) -> int:
    """Return the stamp of a text, exact to the nanosecond."""
    expected = f'a time as in 2026-05-01T12:00:00.5Z, or a "pattern" at {column.path}'
    try:
        if column.stamp != "datetime":
            expected = f"a time in {column.stamp}"
            value = Decimal(text.replace(",", ".")) * STAMPS[column.stamp]
            if abs(value) > LATEST:  # NaN raises InvalidOperation
                raise ValueError(text)
            return int(value.to_integral_value())
        if column.pattern:
            expected = f"a time like {column.pattern}, the pattern at {column.path}"
            return _moment(text, column.pattern, column.zone)
        return _by_iso(text, column.zone)
    except (ValueError, InvalidOperation):
        raise _refused(file, column, row, text, expected) from None


def _by_iso(text: str, zone: str) -> int:
    if not (text[-1:].isdigit() and "+" not in text and text.count("-") <= 2):
        return int(pa.scalar(text).cast(pa.timestamp("ns", "UTC")).value)
    moment = int(pa.scalar(text).cast(pa.timestamp("ns")).value)
    if zone == "UTC":
        return moment
    local = datetime.datetime.fromtimestamp(moment // NANOSECONDS, datetime.timezone.utc)
    seconds = int(local.replace(tzinfo=zoneinfo.ZoneInfo(zone)).timestamp())
    return seconds * NANOSECONDS + moment % NANOSECONDS


def _moment(text: str, pattern: str, zone: str) -> int:
    """Return the ns since 1970 of a text; its fraction of a second may have any number of digits, or none."""
    parts = FRACTION.fullmatch(text)
    beyond = 0
    if parts and pattern.count("%f") == 1:
        text, pattern = parts[1] + parts[3], re.sub(r"[.,:]%f", "", pattern)
        beyond = int((parts[2] or "").ljust(9, "0")[:9])
    moment = datetime.datetime.strptime(text, pattern)
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=zoneinfo.ZoneInfo(zone))
    since = moment - EPOCH
    return (since.days * 86400 + since.seconds) * NANOSECONDS + since.microseconds * 1000 + beyond
