"""What a recording is: its columns, units and checks (docs/reference/recordings.md).

A column is `time` (s) or one of the groups below with an index from 1, such as `tendon_force[3]`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files import read_table

# group: unit, and whether every recording has it
GROUPS: dict[str, tuple[str, bool]] = {
    "tendon_force": ("N", True),
    "tendon_position": ("m", True),
    "joint_position": ("rad", False),
    "joint_velocity": ("rad/s", False),
    "external_torque": ("N.m", False),
}
GROUP_PER = {name: "tendon" if name.startswith("tendon") else "joint" for name in GROUPS}
LABEL = "contact"
LARGEST, LATEST = 1e12, 1e15  # largest signal, in its unit, and latest time (s) that the model accepts

_ELEMENT = re.compile(r"([a-z_]+)\[([1-9][0-9]*)\]")


@dataclass(frozen=True)
class Recording:
    """Measured samples of one finger.

    Attributes
    ----------
    path
        File of the recording.
    time
        Times [N] (s), strictly increasing.
    groups
        Signals by name of the group, [N, m] for tendons and [N, n] for joints, in the units of `GROUPS`.
    contact
        Contact label [N], or None.
    others
        Other columns that were asked for, [N] each.
    """

    path: Path
    time: NDArray[np.float64]
    groups: Mapping[str, NDArray[np.float64]]
    contact: NDArray[np.bool_] | None = None
    others: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time)

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """Return `time` and the groups in one dict, as `native.Finger.run` takes them.

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
                raise InputError(
                    f"{self.path}: {array.shape[1]} columns {name}[...], expected {expected}: "
                    f"the finger has {joints} joints and {tendons} tendons"
                )


def read_recording(path: str | os.PathLike[str], *, label: str = LABEL, others: Collection[str] = ()) -> Recording:
    """Read and check a recording.

    Parameters
    ----------
    path
        A .csv or .parquet file.
    label
        Column of the contact label, 0 or 1.
    others
        Other columns to keep, if the file has them.

    Returns
    -------
    Recording
        The checked recording.

    Raises
    ------
    InputError
        The file, column or row that is wrong, and what was expected.
    """
    file = path if isinstance(path, Path) else Path(path)
    known = {LABEL, label, *others}
    table = read_table(file, partial(_check_columns, known=known), flags=(LABEL, label))
    time = table["time"]
    check_times(file, time)
    found = table.get(label)
    if found is not None and not np.isin(found, (0.0, 1.0)).all():
        row = int(np.flatnonzero(~np.isin(found, (0.0, 1.0)))[0]) + 1
        raise InputError(f"{file}: column {label}, row {row}: {found[row - 1]:g}; expected 0 or 1")
    groups = {name: np.column_stack(columns) for name, columns in _grouped(table).items()}
    kept = {name: table[name] for name in others if name in table}
    return Recording(file, time, groups, None if found is None else found.astype(bool), kept)


def check_numbers(recording: Recording) -> None:
    """Check a recording made in memory as `read_recording` checks a file. Raise InputError."""
    check_times(recording.path, recording.time)
    for name, values in recording.groups.items():
        wrong = np.argwhere(~(np.abs(values) <= LARGEST))
        if len(wrong):
            row, column = wrong[0]
            what = f"at most {LARGEST:g}" if np.isfinite(values[row, column]) else "a finite number"
            raise InputError(
                f"{recording.path}: column {name}[{column + 1}], row {row + 1}: {values[row, column]:g}; "
                f"expected {what}"
            )
    if np.abs(recording.time).max(initial=0.0) > LATEST:
        raise InputError(f"{recording.path}: column time: {recording.time[-1]:g} s; expected at most {LATEST:g} s")


def check_times(file: Path, time: NDArray[np.float64]) -> None:
    """Raise InputError unless times [N] are strictly increasing."""
    late = np.flatnonzero(~(np.diff(time) > 0))
    if late.size:
        row = int(late[0]) + 2
        raise InputError(
            f"{file}: column time, row {row}: {float(time[row - 1])!r} s after {float(time[row - 2])!r} s; "
            "expected increasing times"
        )


def _grouped(table: Mapping[str, NDArray[np.float64]]) -> dict[str, list[NDArray[np.float64]]]:
    """Return the columns of each group in the order of their index."""
    found: dict[str, dict[int, NDArray[np.float64]]] = {}
    for name, column in table.items():
        if match := _ELEMENT.fullmatch(name):
            found.setdefault(match[1], {})[int(match[2])] = column
    return {name: [columns[i] for i in sorted(columns)] for name, columns in found.items()}


def _check_columns(file: Path, names: list[str], known: Collection[str]) -> None:
    """Refuse unknown and missing columns, and gaps in a group. known: columns in addition to time and the groups."""
    for separator in ";\t":
        if len(names) == 1 and separator in names[0]:
            raise InputError(f"{file}: columns separated by {separator!r}; expected commas, and points in numbers")
    if "time" not in names:
        raise InputError(f"{file}: no column time; expected the time of every sample in s")
    counts: dict[str, set[int]] = {name: set() for name in GROUPS}
    for name in names:
        match = _ELEMENT.fullmatch(name)
        if match and match[1] in GROUPS:
            counts[match[1]].add(int(match[2]))
        elif name != "time" and name not in known:
            groups = ", ".join(f"{group}[i]" for group in GROUPS)
            raise InputError(f"{file}: unknown column {name!r}; expected time, {groups} or {LABEL}")
    for name, indices in counts.items():
        if not indices and GROUPS[name][1]:
            raise InputError(f"{file}: no column {name}[1]; expected one {name}[i] per tendon, in {GROUPS[name][0]}")
        for i in range(1, len(indices) + 1):
            if i not in indices:
                raise InputError(f"{file}: no column {name}[{i}], but {name}[{max(indices)}]; expected all from 1 on")
    _check_sizes(file, {name: len(indices) for name, indices in counts.items() if indices})


def _check_sizes(file: Path, sizes: Mapping[str, int]) -> None:
    """Refuse groups of tendons that differ in their number of columns, and groups of joints likewise."""
    first: dict[str, str] = {}
    for name, size in sizes.items():
        other = first.setdefault(GROUP_PER[name], name)
        if size != sizes[other]:
            raise InputError(f"{file}: {size} columns {name}[...], expected {sizes[other]} as of {other}[...]")
