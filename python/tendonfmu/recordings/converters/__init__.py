"""How recordings of others become recordings of tendonfmu: one foreign format per file.

A converter is a function (file, its own options) -> columns of a recording (docs/reference/recordings.md). To add one,
write a module in this package and name it in `CONVERTERS`. Logs without a format of their own are read with a map of
columns (`table`).
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from tendonfmu.errors import InputError

Columns = dict[str, NDArray[Any]]
Converter = Callable[..., Columns]


@dataclass(frozen=True)
class Source:
    """A foreign format."""

    module: str  # the module that reads it
    about: str  # what the format is
    options: tuple[str, ...]  # the options of `convert` that it takes


# key: name on the command line
CONVERTERS = {
    "davinci": Source(
        "tendonfmu.recordings.converters.davinci",
        "da Vinci tool characterisation, University of Minnesota (.TXT)",
        ("radius", "pretension"),
    ),
    "emps": Source(
        "tendonfmu.recordings.converters.emps",
        "EMPS, electro-mechanical positioning system, nonlinear system identification benchmark (.mat)",
        ("mass", "decimation"),
    ),
}


def converter(name: str) -> Converter:
    """Return the converter of that name. Raise InputError with the known names."""
    if name not in CONVERTERS:
        raise InputError(f"convert: unknown format {name!r}; expected one of {', '.join(CONVERTERS)}, table, lerobot")
    convert: Converter = importlib.import_module(CONVERTERS[name].module).convert
    return convert


def convert_file(name: str, file: Path, options: Mapping[str, Any]) -> Columns:
    """Convert a file of a foreign format to columns [N]."""
    convert = converter(name)
    known = CONVERTERS[name].options
    for option in options:
        if option not in known:
            takes = " or ".join(f"--{other}" for other in known)
            raise InputError(f"convert {name}: no option --{option} for this format; expected {takes}")
    return convert(file, **options)
