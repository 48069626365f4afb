"""Which columns a recording has, which of a table's columns are read, and which are an error or ignored."""

from __future__ import annotations

import re
import warnings
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Annotated, TypedDict

from tendonfmu.errors import InputError, InputWarning
from tendonfmu.files import counted
from tendonfmu.json_types import Count, Index, Kinematics, Number, Schema, Size, Values

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

_ELEMENT = re.compile(r"([a-z_]+)\[([1-9][0-9]*)\]")
_ONE_OF_OURS = re.compile(r"([a-z]+?)([0-9]*)")
_GROUP_OF_LETTERS = {name.replace("_", ""): name for name in GROUPS}
_OTHER_TABLES = "`tendonfmu convert table` reads tables with other columns"


def element_of(column: str) -> tuple[str, int] | None:
    """Return group and index, from 1, of a column such as `tendon_force[3]`; None if it is of another form."""
    match = _ELEMENT.fullmatch(column)
    return None if match is None else (match[1], int(match[2]))


def read_columns(file: Path, names: Sequence[str], known: Collection[str]) -> list[str]:
    """Return the columns of a table that a recording has."""
    for separator in ";\t":
        if len(names) == 1 and separator in names[0]:
            raise InputError(f"{file}: columns separated by {separator!r}; expected commas; {_OTHER_TABLES}")
    ours = [name for name in names if name == "time" or name in known or (element_of(name) or ("",))[0] in GROUPS]
    ignored = [name for name in names if name not in ours]
    for name in ignored:
        right = right_spelling(name)
        if right is not None:
            raise InputError(f"{file}: column {name!r}; expected the name {right}; {_OTHER_TABLES}")
    if "time" not in ours:
        raise InputError(f"{file}: no column time; expected the time of every sample in s")
    _check_groups(file, [found for found in map(element_of, ours) if found is not None])
    if ignored:
        listed = ", ".join(repr(name) for name in ignored)
        groups = ", ".join(f"{group}[i]" for group in GROUPS)
        warnings.warn(
            f"{file}: ignored columns: {listed}; a recording has time, {groups} and {LABEL}", InputWarning, stacklevel=2
        )
    return ours


def right_spelling(column: str) -> str | None:
    """Return the right name of a column that is one of ours in another spelling."""
    match = _ONE_OF_OURS.fullmatch(re.sub(r"[\s_.\-()\[\]{}]", "", column).lower())
    if match is None:
        return None
    word, index = match[1], match[2].lstrip("0")
    if word in ("time", LABEL) and not match[2]:
        return word
    if word not in _GROUP_OF_LETTERS:
        return None
    group = _GROUP_OF_LETTERS[word]
    return f"{group}[{index}]" if index else f"{group}[1], {group}[2], ..., with indices from 1"


def _check_groups(file: Path, elements: Sequence[tuple[str, int]]) -> None:
    """Refuse missing groups, gaps in a group, and groups of different size."""
    counts: dict[str, set[int]] = {name: set() for name in GROUPS}
    for group, index in elements:
        if group in counts:
            counts[group].add(index)
    for name, indices in counts.items():
        if not indices and GROUPS[name][1]:
            raise InputError(f"{file}: no column {name}[1]; expected one {name}[i] per tendon, in {GROUPS[name][0]}")
        for i in range(1, len(indices) + 1):
            if i not in indices:
                raise InputError(f"{file}: no column {name}[{i}], but {name}[{max(indices)}]; expected all from 1 on")
    check_sizes(file, {name: len(indices) for name, indices in counts.items() if indices})


def check_sizes(file: Path, sizes: Mapping[str, int]) -> None:
    """Refuse groups of tendons that differ in their number of columns, and groups of joints likewise."""
    first: dict[str, str] = {}
    for name, size in sizes.items():
        other = first.setdefault(GROUP_PER[name], name)
        if size != sizes[other]:
            given = f"{counted(size, 'column')} {name}[...]"
            raise InputError(f"{file}: {given}, expected {sizes[other]} as of {other}[...]")


# --- what reports say of recordings -----------------------------------------------------------------------------------


class RecordingEntry(TypedDict):
    path: str
    samples: Count
    used: Count
    held_out: Count
    contact_left_out: Count
    # Samples left out because a sensor is stuck, or because the part between two gaps is too short.
    faulty_left_out: Count
    # Samples left out because no friction slides: a motor holds there with any torque up to friction. Only where the
    # bias is constant.
    at_rest: Count
    parts: Index  # Parts between gaps, each with its own bias path.
    duration: Size  # s, without gaps.
    mean_force: Size  # N, mean magnitude of all tendon forces.
    kinematics: Kinematics
    external_torque: bool  # Whether the known load was subtracted (eq. 9).


class Nis(TypedDict):
    mean: Size | None
    interval: Annotated[Values, Schema(minItems=2, maxItems=2)]
    consistent: bool


class Whiteness(TypedDict):
    lag_one: Values
    ljung_box_p: Values


class LearnedNumber(TypedDict):
    path: str
    described: float
    value: Number
    half_width: Size | None  # Half of the 95 % interval.
    known: bool  # Whether the recordings determine it.
    changed: bool  # Whether the value replaces the described one.


class RoutingEntry(TypedDict):
    """Moment arms, stiffness and zeros that --routing learned before anything else."""

    numbers: list[LearnedNumber]
    sentences: list[str]
