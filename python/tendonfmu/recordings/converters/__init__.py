"""How recordings of others become recordings of tendonfmu.

A converter is a function `convert_NAME` of `machines` (file, its own options) -> columns of a recording
(docs/reference/recordings.md). Logs without a format of their own are read with a map of columns (`table`).
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from tendonfmu.errors import InputError

Columns = dict[str, NDArray[Any]]
Converter = Callable[..., Columns]


# options of `convert` that each format takes
CONVERTERS = {"davinci": ("radius", "pretension"), "emps": ("mass", "decimation")}


def converter(name: str) -> Converter:
    """Return the converter of that name. Raise InputError with the known names."""
    if name not in CONVERTERS:
        raise InputError(f"convert: unknown format {name!r}; expected one of {', '.join(CONVERTERS)}, table, lerobot")
    convert: Converter = getattr(importlib.import_module("tendonfmu.recordings.converters.machines"), f"convert_{name}")
    return convert


def convert_file(name: str, file: Path, options: Mapping[str, Any]) -> Columns:
    """Convert a file of a foreign format to columns [N]."""
    convert = converter(name)
    known = CONVERTERS[name]
    for option in options:
        if option not in known:
            takes = " or ".join(f"--{other}" for other in known)
            raise InputError(f"convert {name}: no option --{option} for this format; expected {takes}")
    return convert(file, **options)
