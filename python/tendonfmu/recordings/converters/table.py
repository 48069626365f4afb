"""How a user's log becomes a recording, with a map of columns: docs/reference/commands/convert.md."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.column_map import ColumnMap, read_map
from tendonfmu.recordings.converters.log_file import read_log
from tendonfmu.recordings.converters.one_joint import joint_columns
from tendonfmu.recordings.recording import LABEL

Series = NDArray[np.float64]


@dataclass(frozen=True)
class ConvertedLog:
    """A log that has been converted.

    Attributes
    ----------
    columns
        Columns of a recording, [N] each, in SI.
    map
        The map that was used.
    velocity_cutoff
        Cut-off of velocities that were computed here (Hz); 0 if there are none.
    notes
        What was left out or computed, one sentence each.
    """

    columns: dict[str, Series]
    map: ColumnMap
    velocity_cutoff: float = 0.0
    notes: list[str] = field(default_factory=list)


def convert_table(file: Path, map_file: Path) -> ConvertedLog:
    """Convert a log with a map of columns.

    Parameters
    ----------
    file
        The log: CSV with any separator (also .gz) or Parquet.
    map_file
        MAP.json.

    Returns
    -------
    ConvertedLog
        Its columns are those of docs/reference/recordings.md, [N] each.

    Raises
    ------
    InputError
        The file, column or key, and row that is wrong, and what was expected.
    """
    wanted = read_map(map_file)
    log = read_log(file, wanted)
    columns = {key: column.values(log.readings[key]) for key, column in wanted.columns.items()}
    _check_time(file, wanted, log.readings["time"], columns["time"])
    _check_contact(file, wanted, columns)
    if wanted.joint is None:
        return ConvertedLog(columns, wanted, notes=log.notes)
    made, cutoff, notes = joint_columns(file, columns, wanted.joint)
    return ConvertedLog(made, wanted, cutoff, [*log.notes, *notes])


def _check_time(file: Path, wanted: ColumnMap, readings: Series, time: Series) -> None:
    late = np.flatnonzero(~(np.diff(time) > 0))
    if late.size:
        row = int(late[0]) + 1
        raise InputError(
            f"{file}: column {wanted.columns['time'].source}, row {row + 1}: {float(readings[row])!r} after "
            f"{float(readings[row - 1])!r}; expected increasing times"
        )


def _check_contact(file: Path, wanted: ColumnMap, columns: dict[str, Any]) -> None:
    label = columns.get(LABEL)
    if label is not None and not np.isin(label, (0.0, 1.0)).all():
        row = int(np.flatnonzero(~np.isin(label, (0.0, 1.0)))[0])
        raise InputError(
            f"{file}: column {wanted.columns[LABEL].source}, row {row + 1}: {label[row]:g}; expected 0 or 1"
        )
