"""Which format a log has: the only place that knows all of them.

To add a format: a module with a class (or function) of the form of `log.Log`, and a line in `FORMATS`.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import cast

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.log import Log

TEXTS = (".csv", ".txt", ".tsv", ".dat", ".log")

# suffix: module and name of what opens it
FORMATS = {
    **dict.fromkeys(TEXTS, ("text_log", "TextLog")),
    ".parquet": ("parquet_log", "ParquetLog"),
    ".mat": ("matlab_log", "open_matlab"),
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), ("hdf5_log", "open_hdf5")),
    ".mcap": ("mcap_log", "McapLog"),
    ".db3": ("ros2_bag_log", "open_bag"),
}
FOLDER = ("ros2_bag_log", "open_bag")


def open_log(file: Path, settings: LogFormat) -> Log:
    """Open a log."""
    suffix = (Path(file.stem).suffix if file.suffix.lower() == ".gz" else file.suffix).lower()
    known = ", ".join(FORMATS)
    if not file.is_dir():
        if suffix not in FORMATS or (file.suffix.lower() == ".gz" and suffix not in TEXTS):
            raise InputError(
                f"{file}: unknown format {suffix!r}; expected {known}, texts also with .gz, or a bag's folder"
            )
        if not file.is_file():
            raise InputError(f"{file}: no such file; expected a log, {known}")
    module, name = FOLDER if file.is_dir() else FORMATS[suffix]
    opened = getattr(importlib.import_module(f"tendonfmu.recordings.converters.{module}"), name)
    return cast("Log", opened(file, settings))
