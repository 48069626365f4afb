"""What to write into a map of columns so that a recording belongs to a finger: its keys, as JSON and in words."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

from tendonfmu.recordings.converters import units
from tendonfmu.recordings.kinematics import Correction

SAME = 1e-6  # relative difference of two factors of one unit

Entry = Mapping[str, float | str]


def map_keys(entries: Mapping[str, Entry]) -> dict[str, dict[str, float | str]]:
    """Return the keys of a map whose log is the recording itself, with its columns in SI."""
    return {column: _keys(column.split("[")[0], entry) for column, entry in entries.items()}


def _keys(group: str, entry: Entry) -> dict[str, float | str]:
    found: dict[str, float | str] = {}
    for key, value in entry.items():
        if isinstance(value, str):
            found["column"] = value
        elif key == "sign":
            found["sign"] = int(value)
        else:
            unit = unit_of_factor(group, value)
            found |= {"unit": unit} if unit else {"scale": value}
    return found


def unit_of_factor(group: str, factor: float) -> str:
    """Return the unit of a group of columns that has a factor to SI, or ""."""
    known = units.OF_COLUMN[group]
    return next((unit for unit, value in known.items() if abs(factor / value - 1.0) < SAME), "")


def what_to_write(correction: Correction) -> str:
    """Say which keys of the map a correction changes."""
    if correction.kind == "exchange":
        return _new_keys(correction)
    return what_to_set(correction.columns, {correction.kind: correction.factor})


def what_to_set(columns: Sequence[str], entry: Entry) -> str:
    """Say what the entries of columns get in the map. entry: `sign` or `scale`."""
    group = columns[0].split("[")[0]
    keys = _keys(group, entry)
    words = ", ".join(f'"{key}": {json.dumps(value)}' for key, value in keys.items())
    if "unit" in keys:
        words += f' in place of "{unit_of_factor(group, 1.0)}"'
    if "sign" in keys:
        words += " (1 where it is -1 now)"
    return f"write into the map of columns, at {_named(columns)}: {words}"


def _named(columns: Sequence[str]) -> str:
    """Return the names of columns; of three and more in a row, the first and last."""
    group, _, first = columns[0].rstrip("]").partition("[")
    row = [f"{group}[{int(first) + k}]" for k in range(len(columns))] if first else []
    if len(columns) > 2 and list(columns) == row:
        return f'each of "{row[0]}" to "{row[-1]}"'
    return ("each of " if len(columns) > 1 else "") + ", ".join(f'"{column}"' for column in columns)


def _new_keys(correction: Correction) -> str:
    """Say which keys of the map change places: its entries, with their units, belong to other columns."""
    column_of = {source: column for column, source in correction.pairs}
    if all(column_of[column] == source for source, column in column_of.items()):
        swaps = [f'"{column}" and "{source}"' for column, source in correction.pairs if column < source]
        return f"exchange in the map of columns the keys {', '.join(swaps)}"
    names = ", ".join(f'"{source}" to "{column}"' for column, source in correction.pairs)
    return f"rename in the map of columns the keys {names}"
