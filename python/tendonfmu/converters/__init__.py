"""Third-party recordings to ours: one foreign format a file.

A converter is a function (file, radius) -> columns of a recording (contract section 3). To add one, write a module
beside this and name it in `CONVERTERS`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from tendonfmu.errors import InputError

Converter = Callable[[Path, float], dict[str, NDArray[Any]]]

# name on the command line: (module, what it reads)
CONVERTERS = {
    "davinci": ("tendonfmu.converters.davinci", "da Vinci tool characterisation, University of Minnesota (.TXT)"),
}


def converter(name: str) -> Converter:
    """The converter of that name; raises InputError listing the known ones."""
    if name not in CONVERTERS:
        raise InputError(f"convert: unknown format {name!r}; expected one of {', '.join(CONVERTERS)}")
    convert: Converter = importlib.import_module(CONVERTERS[name][0]).convert
    return convert
