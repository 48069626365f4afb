"""How MATLAB files are read: v5 to v7.2 by scipy, v7.3 (which is HDF5) by h5py; the same names for both.

A field of a struct is `data.force`, a column of a matrix `data.force[2]`, an element of an array of structs
`out.signals[1].values`. Objects (timetable, table, datetime, timeseries) are stored in a form that no library reads
fully; a note says how to save them as a struct.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.hdf5_log import Array, ArraysLog, damaged, open_file

HDF5_MARK = b"\x89HDF\r\n\x1a\n"
HDF5_AT = 512  # bytes; where MATLAB puts it
OBJECTS = ("table", "timetable", "datetime", "duration", "timeseries", "string", "categorical")


def open_matlab(file: Path, settings: LogFormat) -> ArraysLog:
    """Open a MATLAB file. Raise InputError."""
    try:
        with open(file, "rb") as raw:
            begin = raw.read(HDF5_AT + len(HDF5_MARK))
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from None
    is_hdf5 = begin[HDF5_AT:] == HDF5_MARK or begin.startswith(HDF5_MARK)
    notes: list[str] = []
    return ArraysLog(file, list((_arrays_of_hdf5 if is_hdf5 else _arrays_of_v5)(file, notes)), notes)


def _note_of_object(file: Path, name: str) -> str:
    return (
        f"{file}: {name} is a MATLAB object (timetable, datetime, ...), which is not read; in MATLAB save it as a "
        "struct: S = table2struct(timetable2table(T), 'ToScalar', true), times by posixtime, then save('log.mat', 'S')"
    )


# --- v5 ---------------------------------------------------------------------------------------------------------------


def _arrays_of_v5(file: Path, notes: list[str]) -> Iterator[Array]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of objects, which are noted below
            content = io.loadmat(file, struct_as_record=False, squeeze_me=True, chars_as_strings=True)
    except Exception as error:  # scipy raises whatever a damaged file leads to, from KeyError to MemoryError
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(
            f"{file}: not a whole MATLAB file ({reason}); copy the file again, or save it again in MATLAB"
        ) from None
    for name, value in content.items():
        if name == "None":
            notes.append(_note_of_object(file, "a variable"))
        elif not name.startswith("__"):
            yield from _walk(file, name, value, "", notes)


def _walk(file: Path, name: str, value: Any, topic: str, notes: list[str]) -> Iterator[Array]:
    """Yield the arrays in a value."""
    if hasattr(value, "_fieldnames"):
        for key in value._fieldnames:
            yield from _walk(file, f"{name}.{key}", getattr(value, key), f"{name}.", notes)
    elif type(value).__name__ in ("MatlabOpaque", "MatlabFunction", "MatlabObject"):
        notes.append(_note_of_object(file, name))
    elif isinstance(value, np.ndarray) and value.dtype == object:
        if value.size and isinstance(value.flat[0], str):
            yield Array.of(topic, name, value.ravel(), False)
            return
        for k, inner in enumerate(value.flat, start=1):
            yield from _walk(file, f"{name}[{k}]", inner, topic, notes)
    elif isinstance(value, np.ndarray) and value.ndim and value.size and value.dtype.names is None:
        yield Array.of(topic, name, value, value.ndim == 2 and value.shape[0] < value.shape[1])


# --- v7.3 -------------------------------------------------------------------------------------------------------------


def _arrays_of_hdf5(file: Path, notes: list[str]) -> Iterator[Array]:
    h5 = open_file(file)
    try:
        for name in h5:
            if not name.startswith("#"):
                yield from _walk_hdf5(file, h5, name, h5[name], "", notes)
    except (OSError, RuntimeError, KeyError) as error:
        raise damaged(file, error) from None


def _walk_hdf5(file: Path, h5: Any, name: str, node: Any, topic: str, notes: list[str]) -> Iterator[Array]:
    kind = node.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if kind in OBJECTS or "MATLAB_object_decode" in node.attrs:
        notes.append(_note_of_object(file, name))
    elif hasattr(node, "keys"):
        for key in node:
            yield from _walk_hdf5(file, h5, f"{name}.{key}", node[key], f"{name}.", notes)
    elif node.dtype == object:  # an array of structs holds references for each field
        base, _, key = name.rpartition(".")
        for k, reference in enumerate(np.asarray(node[()]).ravel(), start=1):
            inner = f"{base}[{k}].{key}" if base else f"{name}[{k}]"
            yield from _walk_hdf5(file, h5, inner, h5[reference], f"{base}[{k}]." if base else topic, notes)
    elif kind != "char" and node.shape and "MATLAB_empty" not in node.attrs:
        # MATLAB stores a matrix by columns and HDF5 shows it by rows; time runs along the longer side
        yield Array.of(topic, name, node, len(node.shape) == 2 and node.shape[0] <= node.shape[1])
