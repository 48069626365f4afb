"""How pandas tables of numbers are read, with the errors of files, and made."""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files.tables import CheckNames, Table, check_duplicates, check_finite

if TYPE_CHECKING:
    import pandas as pd
    from typing_extensions import TypeIs


def is_frame(value: object) -> TypeIs[pd.DataFrame]:
    """Return whether a value is a pandas DataFrame, without importing pandas."""
    pandas = sys.modules.get("pandas")
    return pandas is not None and isinstance(value, pandas.DataFrame)


def frame_of(columns: Mapping[str, NDArray[Any]]) -> pd.DataFrame:
    """Make a DataFrame."""
    # columns: [N]
    import pandas as pd

    frame: pd.DataFrame = pd.DataFrame(dict(columns))
    return frame


def table_of_frame(file: Path, frame: pd.DataFrame, check_names: CheckNames, flags: Collection[str] = ()) -> Table:
    """Read the columns of a DataFrame as finite numbers."""
    # returns columns [N] in their order
    if not is_frame(frame):
        raise InputError(f"{file}: {type(frame).__name__}; expected a pandas DataFrame")
    names = [str(name) for name in frame.columns]
    check_duplicates(file, names)
    wanted = check_names(file, names)
    table = {
        name: _numbers(file, name, frame.iloc[:, names.index(name)], flags)
        for name in (names if wanted is None else wanted)
    }
    check_finite(file, table)
    return table


def _numbers(file: Path, name: str, column: pd.Series[Any], flags: Collection[str]) -> NDArray[np.float64]:
    """Return one column. A missing value becomes NaN."""
    from pandas.api import types

    kind = column.dtype
    if types.is_bool_dtype(kind) and name not in flags:
        raise InputError(f"{file}: column {name}, row 1: {kind} values; expected numbers")
    if types.is_datetime64_any_dtype(kind):
        raise InputError(
            f"{file}: column {name}: {kind} values; expected seconds as numbers, such as "
            f"(df[{name!r}] - df[{name!r}].iloc[0]).dt.total_seconds()"
        )
    if types.is_timedelta64_dtype(kind):
        raise InputError(
            f"{file}: column {name}: {kind} values; expected seconds as numbers, such as "
            f"df[{name!r}].dt.total_seconds()"
        )
    if types.is_numeric_dtype(kind) and not types.is_complex_dtype(kind):
        return column.to_numpy(dtype=np.float64, na_value=np.nan)
    number = (int, float, np.integer, np.floating) + ((bool, np.bool_) if name in flags else ())
    for row, value in enumerate(column, start=1):
        if not isinstance(value, number) or (isinstance(value, bool) and name not in flags):
            raise InputError(f"{file}: column {name}, row {row}: {value!r}; expected a finite number")
    return column.to_numpy(dtype=np.float64)
