"""What a recording is: its columns, units and checks (docs/reference/recordings.md).

A column is `time` (s) or one of the groups below with an index from 1, such as `tendon_force[3]`.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tendonfmu.arrays import flagged_rows
from tendonfmu.errors import InputError
from tendonfmu.files import Table, counted, frame_of, is_frame, path_of, read_table, table_of_frame, write_table
from tendonfmu.recordings.columns import GROUP_PER as GROUP_PER
from tendonfmu.recordings.columns import GROUPS as GROUPS
from tendonfmu.recordings.columns import LABEL as LABEL
from tendonfmu.recordings.columns import check_sizes, element_of, read_columns

if TYPE_CHECKING:
    import pandas as pd

LARGEST, LATEST = 1e12, 1e15  # largest signal, in its unit, and latest time (s) that the model accepts
RecordingSource: TypeAlias = "Recording | pd.DataFrame | str | os.PathLike[str]"


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Measured samples of one finger.

    Attributes
    ----------
    path
        File of the recording, or the name that stands for it in messages.
    time
        Times [N] (s), strictly increasing.
    groups
        Signals by name of the group, [N, m] for tendons and [N, n] for joints, in the units of `GROUPS`.
    contact
        Contact label [N], or None.
    others
        Other columns that were asked for, [N] each.
    label
        Column that `contact` was read from.
    """

    path: Path
    time: NDArray[np.float64]
    groups: Mapping[str, NDArray[np.float64]]
    contact: NDArray[np.bool_] | None = None
    others: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    label: str = LABEL

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        return f"<Recording {self.path}: {self._words()}>"

    def _words(self) -> str:
        sizes = [f"{array.shape[1]} {name}" for name, array in self.groups.items()]
        labelled = (
            [] if self.contact is None else [f"{counted(int(self.contact.sum()), 'sample')} labelled {self.label}"]
        )
        duration = self.time[-1] - self.time[0] if len(self) else 0.0
        return ", ".join([f"{counted(len(self), 'sample')} in {duration:.6g} s", *sizes, *labelled])

    def __getitem__(self, key: str | slice) -> Any:
        """Return a column such as "tendon_force[1]" [N], a group of columns [N, m], or a stretch by its times.

        Parameters
        ----------
        key
            Name of a column or group; or a slice of times (s), such as `recording[10.0:20.0]`, the end not included.

        Raises
        ------
        InputError
            There is no such column, or a slice has a step.
        """
        if isinstance(key, str):
            columns = self._columns() | dict(self.groups)
            if key not in columns:
                raise InputError(f"{self.path}: no column {key}; expected one of {', '.join(columns)}")
            return columns[key]
        if not isinstance(key, slice) or key.step is not None:
            raise InputError(f"{self.path}: {key!r}; expected the name of a column, or times as in [10.0:20.0]")
        ends = (0 if key.start is None else key.start, np.inf if key.stop is None else key.stop)
        first, last = np.searchsorted(self.time, [-np.inf if key.start is None else ends[0], ends[1]])
        rows = slice(int(first), int(last))
        if first >= last:
            raise InputError(f"{self.path}: no sample in {ends[0]:g} to {ends[1]:g} s; expected times of the recording")
        return at_rows(self, rows)

    @classmethod
    def from_frame(
        cls, frame: pd.DataFrame, *, name: str = "DataFrame", label: str = LABEL, others: Collection[str] = ()
    ) -> Recording:
        """Make a recording from a pandas DataFrame, checked like a file.

        Parameters
        ----------
        frame
            Columns as of a file, in any order; the index is not used.
        name
            Name of the recording in messages.
        label, others
            As of `read_recording`.

        Returns
        -------
        Recording
            With copies of the numbers.

        Raises
        ------
        InputError
            The column or row that is wrong, and what was expected.

        Warns
        -----
        InputWarning
            Columns are ignored.
        """
        file, known = Path(name), {LABEL, label, *others}
        if is_frame(frame) and "time" not in frame.columns:
            _refuse_time_in_index(file, frame)
        table = table_of_frame(file, frame, partial(read_columns, known=known), flags=(LABEL, label))
        return _of_table(file, table, label, others)

    @classmethod
    def from_arrays(
        cls,
        time: ArrayLike,
        tendon_force: ArrayLike,
        tendon_position: ArrayLike,
        *,
        joint_position: ArrayLike | None = None,
        joint_velocity: ArrayLike | None = None,
        external_torque: ArrayLike | None = None,
        contact: ArrayLike | None = None,
        name: str = "arrays",
    ) -> Recording:
        """Make a recording from arrays, checked like a file.

        Arrays of float64 are not copied: do not change them while the recording is in use.

        Parameters
        ----------
        time
            Times [N] (s), strictly increasing.
        tendon_force, tendon_position
            Signals [N, m] (N and m).
        joint_position, joint_velocity, external_torque
            Signals [N, n] (rad, rad/s and N·m), or None.
        contact
            Label [N], 0 or 1, or None.
        name
            Name of the recording in messages.

        Returns
        -------
        Recording
            The checked recording.

        Raises
        ------
        InputError
            The array, and row, that is wrong, and what was expected.
        """
        file = Path(name)
        given = (tendon_force, tendon_position, joint_position, joint_velocity, external_torque)
        times = _numbers(file, "time", time, 1)
        groups = {
            group: _numbers(file, group, values, 2)
            for group, values in zip(GROUPS, given, strict=True)
            if values is not None or GROUPS[group][1]
        }
        label = None if contact is None else _numbers(file, LABEL, contact, 1)
        if not len(times):
            raise InputError(f"{file}: no samples; expected at least one")
        for group, values in (groups if label is None else {**groups, LABEL: label}).items():
            if len(values) != len(times):
                raise InputError(f"{file}: {group}: {counted(len(values), 'row')}; expected {len(times)} as of time")
            if values.ndim == 2 and not values.shape[1]:
                raise InputError(f"{file}: {group}: no columns; expected one per {GROUP_PER[group]}")
        check_sizes(file, {group: values.shape[1] for group, values in groups.items()})
        recording = cls(file, times, groups, None if label is None else _flags(file, LABEL, label))
        check_numbers(recording)
        return recording

    @property
    def frame(self) -> pd.DataFrame:
        """The recording as a pandas DataFrame with the columns of a file; the label is 0 or 1."""
        return frame_of(self._columns())

    def _columns(self) -> dict[str, NDArray[Any]]:
        columns: dict[str, NDArray[Any]] = {"time": self.time}
        for name, array in self.groups.items():
            columns |= {f"{name}[{i}]": array[:, i - 1] for i in range(1, array.shape[1] + 1)}
        if self.contact is not None:
            columns[self.label] = self.contact.astype(np.uint8)
        return columns | dict(self.others)

    def plot(self) -> Any:
        """Draw all signals over time.

        Returns
        -------
        plotly.graph_objects.Figure
            A row per group of signals. Samples labelled as contact are shaded.
        """
        from tendonfmu.drawing import ORANGE, series_figure

        rows = {
            f"{name.replace('_', ' ')} ({GROUPS[name][0].replace('.', '·')})": {
                f"{name}[{i + 1}]": array[:, i] for i in range(array.shape[1])
            }
            for name, array in self.groups.items()
        }
        labelled = [] if self.contact is None else flagged_stretches(self.time, self.contact)
        return series_figure(str(self.path), "time (s)", self.time, rows, {("contact", ORANGE): labelled})

    def _repr_html_(self) -> str:
        from html import escape

        ranges = [
            f"<tr><td>{name}</td><td>{array.shape[1]}</td><td>{array.min():.4g} to {array.max():.4g} "
            f"{GROUPS[name][0].replace('.', '·')}</td></tr>"
            for name, array in self.groups.items()
        ]
        return (
            f"<p><b>{escape(str(self.path))}</b>: {escape(self._words())}</p>"
            f"<table><tr><th>signals</th><th>columns</th><th>range</th></tr>{''.join(ranges)}</table>"
        )

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the recording as .csv or .parquet, whole or not at all.

        Parameters
        ----------
        path
            The file.

        Raises
        ------
        InputError
            The format is unknown, or the file cannot be written.
        """
        write_table(path, self._columns())

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """Return `time` and the groups in one dict, as `native.Instance.run` takes them.

        Returns
        -------
        dict of arrays
            `time` [N] (s), and each group [N, m] or [N, n] in its unit.
        """
        return {"time": self.time, **self.groups}

    def require(self, joints: int, tendons: int, groups: tuple[str, ...]) -> None:
        """Refuse a recording that does not fit a finger, or lacks a group that is needed.

        Parameters
        ----------
        joints, tendons
            Numbers of joints and tendons of the finger.
        groups
            Names of the groups that are needed.

        Raises
        ------
        InputError
            A group is missing or has another number of columns.
        """
        for name in groups:
            if name not in self.groups:
                raise InputError(f"{self.path}: no column {name}[1]; expected {name}[1..{joints}] for these kinematics")
        for name, array in self.groups.items():
            expected = tendons if GROUP_PER[name] == "tendon" else joints
            if array.shape[1] != expected:
                given = f"{counted(array.shape[1], 'column')} {name}[...], expected {expected}"
                has = f"{counted(joints, 'joint')} and {counted(tendons, 'tendon')}"
                raise InputError(f"{self.path}: {given}: the finger has {has}")


def read_recording(source: RecordingSource, *, label: str = LABEL, others: Collection[str] = ()) -> Recording:
    """Read and check a recording.

    Parameters
    ----------
    source
        A .csv or .parquet file, or a pandas DataFrame. A recording is returned as it is.
    label
        Column of the contact label, 0 or 1.
    others
        Other columns to keep, if there are any.

    Returns
    -------
    Recording
        The checked recording.

    Raises
    ------
    InputError
        The file, column or row that is wrong, and what was expected.

    Warns
    -----
    InputWarning
        Columns are ignored.
    """
    if isinstance(source, Recording):
        return _labelled(source, label)
    if is_frame(source):
        return Recording.from_frame(source, label=label, others=others)
    if not isinstance(source, str | os.PathLike):
        raise InputError(f"recording: {_type_of(source)}")
    file = path_of(source)
    table = read_table(file, partial(read_columns, known={LABEL, label, *others}), flags=(LABEL, label))
    return _of_table(file, table, label, others)


def _type_of(source: object) -> str:
    """Describe what is no source of a recording."""
    hint = ""
    if isinstance(source, Mapping):
        hint = ", such as Recording.from_frame(pd.DataFrame(dict)) or Recording.from_arrays(time, tendon_force, ...)"
    return f"{type(source).__name__}; expected a path, a DataFrame or a Recording{hint}"


def read_recordings(
    sources: Sequence[RecordingSource], role: str = "recordings", *, label: str = LABEL, others: Collection[str] = ()
) -> list[Recording]:
    """Read and check several recordings; messages name a DataFrame by its place in the list."""
    recordings = []
    for place, source in enumerate(sources, start=1):
        if is_frame(source):
            name = "DataFrame" if len(sources) == 1 else f"DataFrame {place}"
            name = name if role == "recordings" else f"{role}: {name}"
            recordings.append(Recording.from_frame(source, name=name, label=label, others=others))
        elif isinstance(source, Recording | str | os.PathLike):
            recordings.append(read_recording(source, label=label, others=others))
        else:
            raise InputError(f"{role}[{place}]: {_type_of(source)}")
    return recordings


def listed_sources(sources: RecordingSource | Sequence[RecordingSource]) -> list[RecordingSource]:
    """Return sources of recordings as a list; a single one may be given without a list."""
    alone = isinstance(sources, Recording | str | os.PathLike) or is_frame(sources)
    if isinstance(sources, Mapping):
        raise InputError(f"recording: {_type_of(sources)}")
    try:
        return [sources] if alone else list(sources)  # type: ignore[list-item, arg-type]
    except TypeError:
        raise InputError(f"recordings: {type(sources).__name__}; expected paths, DataFrames or Recordings") from None


def at_rows(recording: Recording, rows: slice | NDArray[np.bool_]) -> Recording:
    """Return some rows of a recording."""
    return replace(
        recording,
        time=recording.time[rows],
        groups={name: values[rows] for name, values in recording.groups.items()},
        contact=None if recording.contact is None else recording.contact[rows],
        others={name: values[rows] for name, values in recording.others.items()},
    )


def flagged_stretches(time: NDArray[np.float64], flags: NDArray[Any]) -> list[tuple[float, float]]:
    """Return the stretches of flagged samples."""
    # time: [N] (s); flags: [N]; returns begin and end of each stretch (s); it lasts until the next sample
    return [(float(time[begin]), float(time[min(end, len(time) - 1)])) for begin, end in flagged_rows(flags)]


def _labelled(recording: Recording, label: str) -> Recording:
    """Return the recording with another of its columns as the label, if it was read with it."""
    if label == recording.label:
        return recording
    values = recording.others.get(label)
    return replace(recording, contact=None if values is None else _flags(recording.path, label, values), label=label)


def _of_table(file: Path, table: Table, label: str, others: Collection[str]) -> Recording:
    time = table["time"]
    check_times(file, time)
    flags = table.get(label)
    contact = None if flags is None else _flags(file, label, flags)
    groups = {name: np.column_stack(columns) for name, columns in _grouped(table).items()}
    kept = {name: table[name] for name in others if name in table}
    return Recording(file, time, groups, contact, kept, label)


def _flags(file: Path, label: str, values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return a label as flags. Raises InputError if a value is neither 0 nor 1."""
    if not np.isin(values, (0.0, 1.0)).all():
        row = int(np.flatnonzero(~np.isin(values, (0.0, 1.0)))[0]) + 1
        raise InputError(f"{file}: column {label}, row {row}: {values[row - 1]:g}; expected 0 or 1")
    return values.astype(bool)


def _numbers(file: Path, name: str, values: ArrayLike | None, dimensions: int) -> NDArray[np.float64]:
    """Return an array of numbers, without a copy where it is one."""
    shape = "[N]" if dimensions == 1 else "[N, m]" if GROUP_PER[name] == "tendon" else "[N, n]"
    try:
        if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
            row = int(np.argwhere(np.ma.getmaskarray(values))[0][0]) + 1 if np.ndim(values) else 1
            raise ValueError(f"masked in row {row}")
        array = np.asarray(values)
        if array.dtype.kind not in "fiub":
            raise TypeError(f"{array.dtype} values")
        numbers = array.astype(np.float64, copy=False)
    except (TypeError, ValueError) as refused:
        raise InputError(f"{file}: {name}: {refused}; expected numbers {shape}") from None
    if numbers.ndim != dimensions:
        raise InputError(f"{file}: {name}: shape {numbers.shape}; expected numbers {shape}")
    return numbers


def check_numbers(recording: Recording) -> None:
    """Check a recording made in memory as `read_recording` checks a file. Raise InputError."""
    check_times(recording.path, recording.time)
    for name, values in recording.groups.items():
        wrong = np.argwhere(~(np.abs(values) <= LARGEST))
        if len(wrong):
            row, column = wrong[0]
            what = f"at most {LARGEST:g}" if np.isfinite(values[row, column]) else "a finite number"
            where = f"{recording.path}: column {name}[{column + 1}], row {row + 1}"
            raise InputError(f"{where}: {values[row, column]:g}; expected {what}")
    if np.abs(recording.time).max(initial=0.0) > LATEST:
        raise InputError(f"{recording.path}: column time: {recording.time[-1]:g} s; expected at most {LATEST:g} s")


def check_times(file: Path, time: NDArray[np.float64]) -> None:
    """Raise InputError unless times [N] are finite and strictly increasing."""
    if len(time) and not np.isfinite(time[0]):
        raise InputError(f"{file}: column time, row 1: {time[0]:g}; expected a finite number")
    late = np.flatnonzero(~(np.diff(time) > 0))
    if late.size:
        row = int(late[0]) + 2
        times = f"{float(time[row - 1])!r} s after {float(time[row - 2])!r} s"
        raise InputError(f"{file}: column time, row {row}: {times}; expected increasing times")


def _refuse_time_in_index(file: Path, frame: pd.DataFrame) -> None:
    """Raise InputError if the index of a DataFrame without a column `time` looks like its times."""
    index, kind = frame.index, frame.index.dtype.kind
    if kind == "M":
        way = "df.assign(time=(df.index - df.index[0]).total_seconds()).reset_index(drop=True)"
    elif kind == "m":
        way = "df.assign(time=df.index.total_seconds()).reset_index(drop=True)"
    elif index.name == "time":
        way = "df.reset_index()"
    else:
        return
    raise InputError(f"{file}: no column time, only an index ({index.dtype}); expected a column in s, such as {way}")


def _grouped(table: Mapping[str, NDArray[np.float64]]) -> dict[str, list[NDArray[np.float64]]]:
    """Return the columns of each group, groups in the order of `GROUPS`, columns in that of their index."""
    columns_of: dict[str, dict[int, NDArray[np.float64]]] = {}
    for name, column in table.items():
        element = element_of(name)
        if element is not None and element[0] in GROUPS:
            columns_of.setdefault(element[0], {})[element[1]] = column
    ordered = {name: columns_of[name] for name in GROUPS if name in columns_of}
    return {name: [columns[i] for i in sorted(columns)] for name, columns in ordered.items()}
