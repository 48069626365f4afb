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


def rounded(values: Numbers, digits: int) -> list[float]:
    """Round numbers to significant digits, as a description holds them."""
    return [float(f"{value:.{digits}g}") for value in values]
