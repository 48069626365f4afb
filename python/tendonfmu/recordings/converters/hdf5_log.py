"""How HDF5 files are read: datasets by path, `/group/force` or `/group/force[2]`; fields of compound datasets by a dot.

A file that is cut off is refused: HDF5 finds its data by tables that may lie anywhere in the file.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.files import require_extra
from tendonfmu.recordings.converters.arrays_log import Array, ArraysLog, rows_of, turned_rows
from tendonfmu.recordings.converters.column_map import LogFormat


def open_hdf5(file: Path, settings: LogFormat) -> ArraysLog:
    """Open an HDF5 file. Raise InputError."""
    h5 = open_file(file)
    notes: list[str] = []
    arrays: list[Array] = []

    def add(name: str, node: Any) -> None:
        if isinstance(node, require_extra("h5py", str(file)).Dataset):
            arrays.extend(_arrays(f"/{name}", node))

    try:
        h5.visititems(add)
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise damaged(file, error) from None
    return ArraysLog(file, arrays, notes)


def open_file(file: Path) -> Any:
    """Open a file with h5py. Raise InputError."""
    h5py = require_extra("h5py", str(file))
    try:
        return h5py.File(file, "r")
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise damaged(file, error) from None


def damaged(file: Path, error: Exception) -> InputError:
    """Return the refusal of a file that HDF5 cannot read."""
    reason = str(error).splitlines()[0] if str(error) else type(error).__name__
    return InputError(
        f"{file}: not a whole HDF5 file ({reason}); nothing can be recovered: copy the file again, close it "
        "properly in the logger, or write it again from its source"
    )


def _arrays(name: str, dataset: Any) -> Iterator[Array]:
    topic = name[: name.rindex("/") + 1]
    unit = _unit(dataset)
    if dataset.shape is None or len(dataset.shape) == 0:
        return
    if dataset.dtype.names:
        for part in dataset.dtype.names:
            inner = dataset.dtype[part]
            shape = (*dataset.shape, *inner.shape)
            yield Array(f"{name}.", f"{name}.{part}", shape, inner.base, functools.partial(_part, dataset, part), unit)
        return
    if len(dataset.shape) == 2 and dataset.shape[0] < dataset.shape[1]:
        # signals lie in rows: time runs along the longer side
        turned = (dataset.shape[1], dataset.shape[0])
        yield Array(topic, name, turned, dataset.dtype, functools.partial(turned_rows, dataset), unit)
        return
    yield Array(topic, name, dataset.shape, dataset.dtype, functools.partial(rows_of, dataset), unit)


def _part(dataset: Any, part: str, start: int, stop: int) -> Any:
    return dataset[start:stop][part]


def _unit(dataset: Any) -> str:
    for key in ("units", "unit", "Units", "Unit"):
        value = dataset.attrs.get(key)
        if isinstance(value, bytes):
            return value.decode("utf-8", "replace")
        if isinstance(value, str):
            return value
    return ""
