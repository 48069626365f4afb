"""Types of arrays, whose shape and unit stand where a name is declared, and the numbers of a file from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
Array = NDArray[Any]
Data = Mapping[str, Any]  # parsed JSON


def flagged_rows(flags: Array) -> list[tuple[int, int]]:
    """Return the first row of each stretch of flagged samples [N], and the row after its last."""
    steps = np.diff(np.concatenate([[0], np.asarray(flags).astype(bool).astype(int), [0]]))
    return list(zip(np.flatnonzero(steps > 0).tolist(), np.flatnonzero(steps < 0).tolist(), strict=True))


def rounded(values: Numbers, digits: int) -> list[float]:
    """Round numbers to significant digits, as a description holds them."""
    return [float(f"{value:.{digits}g}") for value in values]
