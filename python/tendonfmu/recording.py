"""Recordings: columns, units, formats and checks of contract section 3; CSV and Parquet in and out.

A column is `time` (s) or one of the groups below with an index from 1, such as `tendon_force[3]`.
"""

from __future__ import annotations

import csv
import itertools
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.whole_file import whole_file

# group: unit, and whether every recording has it
GROUPS: dict[str, tuple[str, bool]] = {
    "tendon_force": ("N", True),
    "tendon_position": ("m", True),
    "joint_position": ("rad", False),
    "joint_velocity": ("rad/s", False),
    "external_torque": ("N.m", False),
}
LABEL = "contact"
FORMATS = (".csv", ".parquet")

_ELEMENT = re.compile(r"([a-z_]+)\[([1-9][0-9]*)\]")


@dataclass(frozen=True)
class Recording:
    """Measured samples of one finger.

    time: [N] s, strictly increasing. groups: name -> [N, m] or [N, n], units in `GROUPS`.
    contact: [N] bool label, or None.
    """

    path: Path
    time: NDArray[np.float64]
    groups: Mapping[str, NDArray[np.float64]]
    contact: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.time)

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """`time` and the groups in one dict, as `native.Finger.run` takes them."""
        return {"time": self.time, **self.groups}

    def require(self, joints: int, tendons: int, groups: tuple[str, ...]) -> None:
        """Refuses a recording that does not fit a finger, or lacks a group that is needed."""
        for name in groups:
            if name not in self.groups:
                raise InputError(f"{self.path}: no column {name}[1]; expected {name}[1..{joints}] for these kinematics")
        for name, array in self.groups.items():
            expected = tendons if name.startswith("tendon") else joints
            if array.shape[1] != expected:
                raise InputError(
                    f"{self.path}: {array.shape[1]} columns {name}[...], expected {expected}: "
                    f"the finger has {joints} joints and {tendons} tendons"
                )


def read_recording(path: str | os.PathLike[str]) -> Recording:
    """Reads and checks a recording (.csv or .parquet). Raises InputError naming column and row."""
    file = Path(path)
    table = read_table(file)
    _check_columns(file, list(table))
    time = table["time"]
    late = np.flatnonzero(np.diff(time) <= 0)
    if late.size:
        row = int(late[0]) + 2
        raise InputError(
            f"{file}: column time, row {row}: {time[row - 1]!r} s after {time[row - 2]!r} s; expected increasing times"
        )
    label = table.get(LABEL)
    if label is not None and not np.isin(label, (0.0, 1.0)).all():
        row = int(np.flatnonzero(~np.isin(label, (0.0, 1.0)))[0]) + 1
        raise InputError(f"{file}: column {LABEL}, row {row}: {label[row - 1]:g}; expected 0 or 1")
    groups = {name: np.column_stack(columns) for name, columns in _grouped(table).items()}
    return Recording(file, time, groups, None if label is None else label.astype(bool))


def _grouped(table: Mapping[str, NDArray[np.float64]]) -> dict[str, list[NDArray[np.float64]]]:
    """Columns of each group in the order of their index."""
    found: dict[str, dict[int, NDArray[np.float64]]] = {}
    for name, column in table.items():
        if match := _ELEMENT.fullmatch(name):
            found.setdefault(match[1], {})[int(match[2])] = column
    return {name: [columns[i] for i in sorted(columns)] for name, columns in found.items()}


def _check_columns(file: Path, names: list[str]) -> None:
    """Every column known, none missing, no gap in a group."""
    if "time" not in names:
        raise InputError(f"{file}: no column time; expected the time of every sample in s")
    counts: dict[str, set[int]] = {name: set() for name in GROUPS}
    for name in names:
        match = _ELEMENT.fullmatch(name)
        if match and match[1] in GROUPS:
            counts[match[1]].add(int(match[2]))
        elif name not in ("time", LABEL):
            known = ", ".join(f"{group}[i]" for group in GROUPS)
            raise InputError(f"{file}: unknown column {name!r}; expected time, {known} or {LABEL}")
    for name, indices in counts.items():
        if not indices and GROUPS[name][1]:
            raise InputError(f"{file}: no column {name}[1]; expected one {name}[i] per tendon, in {GROUPS[name][0]}")
        if indices and len(indices) < max(indices):
            missing = next(i for i in itertools.count(1) if i not in indices)
            raise InputError(f"{file}: no column {name}[{missing}], but {name}[{max(indices)}]; expected all from 1 on")


# --- tables of numbers ----------------------------------------------------------------------------------------------


def read_table(file: Path) -> dict[str, NDArray[np.float64]]:
    """All columns of a CSV or Parquet file as finite numbers, in order. Raises InputError."""
    suffix = file.suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"{file}: unknown format {suffix!r}; expected .csv or .parquet")
    if not file.is_file():
        raise InputError(f"{file}: no such file")
    frame = _read_csv(file) if suffix == ".csv" else _read_parquet(file)
    if frame.empty:
        raise InputError(f"{file}: no samples; expected at least one row")
    table = {}
    for name in frame.columns:
        column = frame[name]
        if column.dtype.kind not in "iufb":
            raise InputError(f"{file}: column {name}: {column.dtype} values; expected numbers")
        numbers = column.to_numpy(dtype=np.float64)
        if not np.isfinite(numbers).all():
            row = int(np.flatnonzero(~np.isfinite(numbers))[0]) + 1
            raise InputError(f"{file}: column {name}, row {row}: {numbers[row - 1]}; expected a finite number")
        table[str(name)] = numbers
    return table


def _read_parquet(file: Path) -> pd.DataFrame:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(file)
    except (pa.ArrowInvalid, OSError) as error:
        raise InputError(f"{file}: not a whole Parquet file ({str(error).splitlines()[0]})") from None
    _check_duplicates(file, table.column_names)
    return pd.DataFrame(table.to_pandas())


def _check_duplicates(file: Path, names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{file}: column {name!r} is there {names.count(name)} times; expected once")


def _read_csv(file: Path) -> pd.DataFrame:
    try:
        with open(file, encoding="utf-8-sig", newline="") as lines:
            header = next(csv.reader(lines), [])
    except UnicodeDecodeError:
        raise InputError(f"{file}: not a text file in UTF-8") from None
    names = [name.strip() for name in header]
    if not names:
        raise InputError(f"{file}: empty file; expected a line of column names")
    _check_duplicates(file, names)
    try:
        # round_trip: the very number that was written
        frame = pd.read_csv(
            file, names=names, skiprows=1, encoding="utf-8-sig", float_precision="round_trip", index_col=False
        )
        sound = all(frame[name].dtype.kind in "iufb" for name in names) and not frame.isna().to_numpy().any()
    except (pd.errors.ParserError, pd.errors.EmptyDataError, ValueError):
        sound = False
    if not sound or _has_long_rows(file, len(names)):
        _name_bad_field(file, names)
    return frame


def _has_long_rows(file: Path, columns: int) -> bool:
    """pandas drops surplus fields without a word."""
    with open(file, "rb") as lines:
        next(lines, None)
        return any(line.count(b",") != columns - 1 for line in lines if line.strip())


def _name_bad_field(file: Path, names: list[str]) -> None:
    """Reads line by line and refuses the first bad field; returns when the numbers are only NaN or infinite."""
    with open(file, encoding="utf-8-sig", newline="") as lines:
        reader = csv.reader(lines)
        next(reader)
        rows = [fields for fields in reader if fields]
    for row, fields in enumerate(rows, start=1):
        if len(fields) != len(names):
            if row == len(rows) and len(fields) < len(names):
                raise InputError(
                    f"{file}: truncated last line (row {row}): {len(fields)} of {len(names)} columns; "
                    f"the {row - 1} rows before it are good"
                )
            raise InputError(f"{file}: row {row}: {len(fields)} fields; expected {len(names)}")
        for name, field in zip(names, fields, strict=True):
            _check_field(file, name, row, len(rows), field)


def _check_field(file: Path, name: str, row: int, rows: int, field: str) -> None:
    try:
        number = float(field)
    except ValueError:
        hint = f"; if the file was cut off, the {row - 1} rows before it are good" if row == rows else ""
        raise InputError(f"{file}: column {name}, row {row}: {field!r}; expected a number{hint}") from None
    if not np.isfinite(number):
        raise InputError(f"{file}: column {name}, row {row}: {field}; expected a finite number")


def write_table(path: str | os.PathLike[str], table: Mapping[str, NDArray[Any]]) -> None:
    """Writes columns of equal length as CSV or Parquet, by the suffix: whole or not at all.

    Numbers are written so that they read back the same; flags as 0 and 1.
    """
    file = Path(path)
    if file.suffix.lower() not in FORMATS:
        raise InputError(f"{file}: unknown format {file.suffix!r}; expected .csv or .parquet")
    columns = {name: np.asarray(values) for name, values in table.items()}
    frame = pd.DataFrame({n: c.astype(np.uint8) if c.dtype == bool else c for n, c in columns.items()})
    with whole_file(file) as temporary:
        if file.suffix.lower() == ".csv":
            frame.to_csv(temporary, index=False, lineterminator="\n")
        else:
            frame.to_parquet(temporary, index=False)
