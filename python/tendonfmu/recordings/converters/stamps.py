"""How stamps of a log become points in time: ns since 1970, as integers, which lose nothing."""

from __future__ import annotations

import datetime
import zoneinfo
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.column_map import MappedColumn
from tendonfmu.recordings.converters.units import STAMPS

NANOSECONDS = 10**9
LATEST = 2**62  # ns; the year 2116
ZONED = r"(Z|[+-]\d{2}:?(\d{2})?)\s*$"


def nanoseconds(file: Path, column: MappedColumn, readings: Any, row: int = 0) -> NDArray[np.int64]:
    """Return stamps as ns since 1970."""
    # readings: [N]; returns int64 [N]
    import pyarrow as pa

    if not isinstance(readings, pa.Array | pa.ChunkedArray):
        return _of_numbers(file, column, np.asarray(readings), row)
    if column.stamp != "datetime":
        return _of_digits(file, column, readings, row)
    return _of_texts(file, column, readings, row)


def _of_numbers(file: Path, column: MappedColumn, readings: NDArray[Any], row: int) -> NDArray[np.int64]:
    unit = STAMPS[column.stamp]
    if readings.dtype.kind in "iu":
        whole = readings.astype(np.int64)
        _refuse(file, column, np.abs(whole) > LATEST // unit, readings, row, f"at most {LATEST // unit} {column.stamp}")
        return whole * unit
    if column.stamp == "datetime":
        raise InputError(
            f"{file}: column {column.source}, row {row + 1}: {readings[0]!r}; expected a time; for a number write "
            f'"unit": "epoch_s" (or ms, us, ns) at {column.path}'
        )
    _refuse(file, column, ~(np.abs(readings) <= LATEST / unit), readings, row, f"a time in {column.stamp}")
    whole = np.floor(readings)
    # the integer part apart: a product of a double would lose nanoseconds
    stamps: NDArray[np.int64] = whole.astype(np.int64) * unit + np.round((readings - whole) * unit).astype(np.int64)
    return stamps


def _of_digits(file: Path, column: MappedColumn, readings: Any, row: int) -> NDArray[np.int64]:
    """Return stamps of texts of digits, exact to the nanosecond."""
    import pyarrow as pa
    import pyarrow.compute as pc

    trimmed = pc.utf8_trim_whitespace(readings)
    try:
        return np.asarray(trimmed.cast(pa.int64()).to_numpy()) * STAMPS[column.stamp]
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        pass
    found = np.empty(len(trimmed), dtype=np.int64)
    for k, text in enumerate(trimmed.to_pylist()):
        found[k] = _exact(file, column, text, row + k)
    return found


def _exact(file: Path, column: MappedColumn, text: str | None, row: int) -> int:
    from decimal import Decimal, InvalidOperation

    try:
        value = Decimal((text or "").replace(",", ".")) * STAMPS[column.stamp]
        if abs(value) <= LATEST:  # NaN raises InvalidOperation
            return int(value.to_integral_value())
    except InvalidOperation:
        pass
    raise InputError(
        f"{file}: column {column.source}, row {row + 1}: {text or ''!r}; expected a time in {column.stamp}"
    )


def _of_texts(file: Path, column: MappedColumn, readings: Any, row: int) -> NDArray[np.int64]:
    import pyarrow as pa
    import pyarrow.compute as pc

    texts = pc.utf8_trim_whitespace(readings)
    if column.pattern:
        return np.array(
            [_by_pattern(file, column, text, row + k) for k, text in enumerate(texts.to_pylist())], np.int64
        )
    zoned = pc.match_substring_regex(texts, ZONED)
    try:
        if pc.all(zoned).as_py():
            return np.asarray(texts.cast(pa.timestamp("ns", "UTC")).cast(pa.int64()).to_numpy())
        if not pc.any(zoned).as_py() and not texts.null_count:
            local = texts.cast(pa.timestamp("ns"))
            if column.zone != "UTC":
                # an hour that occurs twice is taken as the earlier one, so that time does not jump ahead
                local = pc.assume_timezone(local, column.zone, ambiguous="earliest", nonexistent="earliest")
            return np.asarray(local.cast(pa.int64()).to_numpy())
    except pa.ArrowInvalid:
        pass
    return np.array([_by_iso(file, column, text, row + k) for k, text in enumerate(texts.to_pylist())], np.int64)


def _by_iso(file: Path, column: MappedColumn, text: str | None, row: int) -> int:
    """Return one stamp; the place where the first invalid one is named."""
    import pyarrow as pa

    try:
        if text and text[-1:].isdigit() and "+" not in text and text.count("-") <= 2:
            moment = pa.scalar(text).cast(pa.timestamp("ns")).value
            if column.zone == "UTC":
                return int(moment)
            local = datetime.datetime.fromtimestamp(moment // NANOSECONDS, datetime.timezone.utc)
            return _in_zone(local, column.zone) * NANOSECONDS + int(moment) % NANOSECONDS
        return int(pa.scalar(text or "").cast(pa.timestamp("ns", "UTC")).value)
    except pa.ArrowInvalid:
        raise InputError(
            f"{file}: column {column.source}, row {row + 1}: {text or ''!r}; expected a time as in "
            f'2026-05-01T12:00:00.5Z, or a "pattern" at {column.path}'
        ) from None


def _in_zone(local: datetime.datetime, zone: str) -> int:
    """Return s since 1970 of a local time without fraction."""
    return int(local.replace(tzinfo=zoneinfo.ZoneInfo(zone)).timestamp())


def _by_pattern(file: Path, column: MappedColumn, text: str | None, row: int) -> int:
    try:
        moment = datetime.datetime.strptime(text or "", column.pattern)
    except ValueError:
        raise InputError(
            f"{file}: column {column.source}, row {row + 1}: {text or ''!r}; expected a time like {column.pattern}, "
            f"the pattern at {column.path}"
        ) from None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=zoneinfo.ZoneInfo(column.zone))
    since = moment - datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)
    return (since.days * 86400 + since.seconds) * NANOSECONDS + since.microseconds * 1000


def _refuse(
    file: Path, column: MappedColumn, wrong: NDArray[np.bool_], readings: NDArray[Any], row: int, wanted: str
) -> None:
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(f"{file}: column {column.source}, row {row + k + 1}: {readings[k]!r}; expected {wanted}")
