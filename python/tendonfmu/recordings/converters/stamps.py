"""How stamps of a log become points in time: ns since 1970, as integers, which lose nothing."""

from __future__ import annotations

import datetime
import re
import zoneinfo
from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.column_map import MappedColumn
from tendonfmu.recordings.converters.units import STAMPS

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
