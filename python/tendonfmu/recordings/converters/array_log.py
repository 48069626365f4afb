"""How files of arrays with names are read: HDF5, numpy, and MATLAB (v5 to v7.2 by scipy, v7.3, which is HDF5, by h5py).

Arrays of one struct or group are a topic. A row is an element along the longer side of an array; the columns of a
matrix are fields `name[1]`, `name[2]`, ... Datasets are named by path, `/group/force` or `/group/force[2]`, fields of
compound datasets by a dot; in MATLAB a field of a struct is `data.force`, an element of an array of structs
`out.signals[1].values`. A file that is cut off is refused: HDF5 finds its data by tables that may lie anywhere.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io

from tendonfmu.errors import InputError
from tendonfmu.files import counted, require_extra
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.log import (
    LONGEST,
    NUMBER,
    OTHER,
    ROWS,
    TEXT,
    TIME_NAMES,
    Block,
    Field,
    Topic,
    as_numbers,
)


@dataclass(frozen=True)
class Array:
    """An array of a file."""

    topic: str  # struct or group, with the separator at its end; "" at the top
    name: str  # full name
    shape: tuple[int, ...]  # as rows and columns are counted in the file
    dtype: np.dtype[Any]  # of its elements
    read: Callable[[int, int], Any]  # returns rows (start, stop) of it, [rows] or [rows, columns]
    unit: str = ""  # what the file states, or ""

    @classmethod
    def of(cls, topic: str, name: str, values: Any, by_columns: bool, unit: str = "") -> Array:
        """Return the array of an array or dataset. by_columns: the columns of a matrix are the rows."""
        shape = (values.shape[1], values.shape[0]) if by_columns else values.shape
        if by_columns:
            return cls(topic, name, shape, values.dtype, lambda start, stop: np.asarray(values[:, start:stop]).T, unit)
        return cls(topic, name, shape, values.dtype, lambda start, stop: values[start:stop], unit)

    def fields(self) -> Iterator[tuple[Field, int]]:
        """Yield the fields, each with the column that it is."""
        kind = NUMBER if self.dtype.kind in "biuf" else TEXT if self.dtype.kind in "SUO" else OTHER
        if len(self.shape) < 2 or self.shape[1] == 1:
            yield Field(self.name, kind, str(self.dtype), self.unit), 0
        elif self.shape[1] <= LONGEST and len(self.shape) == 2:
            for k in range(self.shape[1]):
                yield Field(f"{self.name}[{k + 1}]", kind, str(self.dtype), self.unit), k
        else:
            sizes = " x ".join(map(str, self.shape))
            yield Field(self.name, OTHER, f"{self.dtype} {sizes}", self.unit), 0


def _rows_of(values: Any, part: Callable[[Any], Any]) -> Callable[[int, int], Any]:
    """Return a function that reads rows (start, stop) of an array, and of these a part."""
    return lambda start, stop: part(values[start:stop])


class ArraysLog:
    """A file of arrays."""

    open_ended = False

    def __init__(self, file: Path, arrays: Sequence[Array], notes: list[str]) -> None:
        self.file = file
        self.notes = notes
        self._columns: dict[str, tuple[Array, int]] = {}
        self.topics: list[Topic] = []
        # a single value is a setting, not a signal
        for group in _sampled_together([array for array in arrays if array.shape[0] > 1]):
            self._add_topic(group)
        if not self.topics:
            reasons = f" ({'; '.join(notes)})" if notes else ""
            raise InputError(f"{file}: no arrays of numbers{reasons}; expected at least a time and a force")

    def _add_topic(self, arrays: Sequence[Array]) -> None:
        fields = []
        for array in arrays:
            for field, column in array.fields():
                self._columns[field.name] = (array, column)
                fields.append(field)
        prefix, rows = arrays[0].topic, arrays[0].shape[0]
        title = prefix.rstrip("/.") or "top"
        if any(topic.name == title for topic in self.topics):
            title = f"{title} ({counted(rows, 'row')})"
        self.topics.append(Topic(title, tuple(fields), rows, prefix))

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read columns; see `log.Log`."""
        for topic in self.topics:
            names = wanted.get(topic.name)
            if names:
                for start in range(0, topic.rows or 0, ROWS):
                    yield topic.name, {name: self._values(name, start) for name in names}

    def _values(self, name: str, start: int) -> Any:
        import pyarrow as pa

        array, column = self._columns[name]
        try:
            rows = np.asarray(array.read(start, min(start + ROWS, array.shape[0])))
        except (OSError, ValueError) as error:
            raise InputError(f"{self.file}: {name}: cannot be read ({error}); copy or write the file again") from None
        values = rows.reshape(len(rows), -1)[:, column] if rows.ndim > 1 else rows
        if values.dtype.kind in "SUO":
            texts = [text.decode("utf-8", "replace") if isinstance(text, bytes) else text for text in values.tolist()]
            if all(isinstance(text, str) for text in texts):
                return pa.array(texts, pa.string())
        if values.dtype.kind not in "biuf":
            raise InputError(f"{self.file}: column {name}, row {start + 1}: {values.dtype} values; expected numbers")
        return as_numbers(values)


def _sampled_together(arrays: Sequence[Array]) -> Iterator[list[Array]]:
    """Yield arrays of one length; if several groups of that length have a clock, those of each group."""
    for length in dict.fromkeys(array.shape[0] for array in arrays):
        groups: dict[str, list[Array]] = {}
        for array in arrays:
            if array.shape[0] == length:
                groups.setdefault(array.topic, []).append(array)
        with_clock = [
            prefix
            for prefix, members in groups.items()
            if any(array.name[len(prefix) :].lower() in TIME_NAMES for array in members)
        ]
        if len(with_clock) > 1:
            yield from groups.values()
        else:
            first = groups.pop(with_clock[0] if with_clock else next(iter(groups)))
            yield [*first, *(array for members in groups.values() for array in members)]


# --- HDF5 -------------------------------------------------------------------------------------------------------------


def open_hdf5(file: Path, settings: LogFormat) -> ArraysLog:
    """Open an HDF5 file. Raise InputError."""
    h5 = _open_hdf5(file)
    arrays: list[Array] = []

    def add(name: str, node: Any) -> None:
        if isinstance(node, require_extra("h5py", str(file)).Dataset):
            arrays.extend(_arrays(f"/{name}", node))
        elif "block0_items" in node:
            arrays.extend(_of_pandas(f"/{name}/", node))

    try:
        h5.visititems(add)
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise _damaged(file, error) from None
    return ArraysLog(file, arrays, [])


def open_numpy(file: Path, settings: LogFormat) -> ArraysLog:
    """Open a file of numpy. Raise InputError."""
    try:
        content = np.load(file, allow_pickle=False)
        values = {"values": content} if file.suffix.lower() == ".npy" else {name: content[name] for name in content}
    except Exception as error:  # of zip, numpy's header, or an array of objects
        raise InputError(f"{file}: not a whole file of numpy arrays ({error}); save it again by np.savez") from None
    return ArraysLog(file, [part for name, array in values.items() for part in _arrays(name, array)], [])


def _open_hdf5(file: Path) -> Any:
    """Open a file with h5py. Raise InputError."""
    h5py = require_extra("h5py", str(file))
    try:
        return h5py.File(file, "r")
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise _damaged(file, error) from None


def _damaged(file: Path, error: Exception) -> InputError:
    """Return the refusal of a file that HDF5 cannot read."""
    reason = str(error).splitlines()[0] if str(error) else type(error).__name__
    return InputError(f"{file}: not a whole HDF5 file ({reason}); nothing can be recovered: copy or write it again")


def _arrays(name: str, dataset: Any) -> Iterator[Array]:
    unit = _unit(dataset)
    if "block0_items" in getattr(dataset, "parent", ()):  # of pandas, see `_of_pandas`
        return
    if dataset.shape is None or len(dataset.shape) == 0:
        return
    if not dataset.dtype.names:
        # signals may lie in rows: time runs along the longer side
        by_columns = len(dataset.shape) == 2 and dataset.shape[0] < dataset.shape[1]
        yield Array.of(name[: name.rfind("/") + 1], name, dataset, by_columns, unit)
        return
    for part in dataset.dtype.names:
        inner = dataset.dtype[part]
        shape = (*dataset.shape, *inner.shape)
        yield Array(
            f"{name}.",
            f"{name}.{part}",
            shape,
            inner.base,
            _rows_of(dataset, itemgetter(part)),
            unit,
        )


def _of_pandas(group: str, node: Any) -> Iterator[Array]:
    """Yield the columns of a DataFrame, which pandas stores by blocks of one type, with their names beside them."""
    if node["axis1"].dtype.kind in "iuf":
        yield Array.of(group, f"{group}index", node["axis1"], False)
    for block in (name.removesuffix("_items") for name in node if name.endswith("_items")):
        for k, label in enumerate(node[f"{block}_items"][()]):
            name = label.decode("utf-8", "replace") if isinstance(label, bytes) else str(label)
            values = node[f"{block}_values"]
            yield Array(
                group,
                f"{group}{name}",
                values.shape[:1],
                values.dtype,
                _rows_of(values, itemgetter((slice(None), k))),
            )


def _unit(dataset: Any) -> str:
    for key in ("units", "unit", "Units", "Unit"):
        value = getattr(dataset, "attrs", {}).get(key)
        if isinstance(value, bytes):
            return value.decode("utf-8", "replace")
        if isinstance(value, str):
            return value
    return ""


# --- MATLAB -----------------------------------------------------------------------------------------------------------

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


def _arrays_of_v5(file: Path, notes: list[str]) -> Iterator[Array]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of objects, which are noted below
            content = io.loadmat(file, struct_as_record=False, squeeze_me=True, chars_as_strings=True)
    except Exception as error:  # scipy raises whatever a damaged file leads to, from KeyError to MemoryError
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{file}: not a whole MATLAB file ({reason}); copy or save the file again") from None
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


def _arrays_of_hdf5(file: Path, notes: list[str]) -> Iterator[Array]:
    h5 = _open_hdf5(file)
    try:
        for name in h5:
            if not name.startswith("#"):
                yield from _walk_hdf5(file, h5, name, h5[name], "", notes)
    except (OSError, RuntimeError, KeyError) as error:
        raise _damaged(file, error) from None


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
