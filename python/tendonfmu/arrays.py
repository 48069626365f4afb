"""Types of arrays; shape and unit stand where a name is declared."""

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
