"""How the recording of a hand is split into recordings of its parts, with the angles of the wrist that they share."""

from __future__ import annotations

import os
import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.commands.hand.description import POSITIONS, Hand, HandPart
from tendonfmu.commands.hand.hand_types import WRIST
from tendonfmu.errors import InputError, InputWarning
from tendonfmu.files import Table, counted, is_frame, path_of, read_table, table_of_frame
from tendonfmu.fmu import run_model
from tendonfmu.model import moment_arms, tendon_positions
from tendonfmu.recordings import GROUP_PER, GROUPS, LABEL, Recording, RecordingSource, element_of, right_spelling

HandRecording: TypeAlias = "RecordingSource"  # a file, or a DataFrame


def split_recording(hand: Hand, source: HandRecording, others: Collection[str] = ()) -> dict[str, Recording]:
    """Split a recording of a hand into the recordings of its parts.

    The source is read once. With a wrist, the recordings of the fingers have the angles of all joints: those of the
    wrist as measured, or by its own tendons; those of the finger as measured, or by its tendons,
    q_f = R_f⁺ (x1 − R_w q_w).

    Parameters
    ----------
    hand
        The hand.
    source
        A .csv or .parquet file, or a pandas DataFrame.
    others
        Further columns to keep; with a prefix they are those of one finger, without it of all.

    Returns
    -------
    dict of str to Recording
        By the names of the parts.

    Raises
    ------
    InputError
        The file, the column or row that is wrong, and what was expected.

    Warns
    -----
    InputWarning
        Columns are ignored.
    """
    recordings, failed = split_parts(hand, source, others)
    for reason in failed.values():
        raise InputError(reason)
    return recordings


def split_parts(
    hand: Hand, source: HandRecording, others: Collection[str] = ()
) -> tuple[dict[str, Recording], dict[str, str]]:
    """Split a recording, and say why parts have none, by the names of the parts. Nothing is there without the wrist."""
    file, table = _table(hand, source, others)
    own = hand.wrist.part if hand.wrist else None
    wrist = None if own is None else _recording(file, table, own, 0, others)
    shared = _wrist_motion(file, table, hand, wrist) if hand.wrist else None
    recordings, failed = dict[str, Recording](), dict[str, str]()
    for part in hand.fingers:
        try:
            recording = _recording(file, table, part, hand.wrist_joints, others)
            recordings[part.name] = recording if shared is None else _with_wrist(hand, part, recording, table, shared)
        except InputError as refused:
            failed[part.name] = str(refused)
    return recordings | ({} if wrist is None else {WRIST: wrist}), failed


# --- the table --------------------------------------------------------------------------------------------------------


def _table(hand: Hand, source: HandRecording, others: Collection[str]) -> tuple[Path, Table]:
    flags = {LABEL, *others, *(part.columns[LABEL] for part in hand.parts if LABEL in part.columns)}
    check = partial(_columns_to_read, hand, others)
    if is_frame(source):
        return Path("DataFrame"), table_of_frame(Path("DataFrame"), source, check, flags=flags)
    if not isinstance(source, str | os.PathLike):
        raise InputError(f"recording: {type(source).__name__}; expected a path or a DataFrame of the whole hand")
    file = path_of(source)
    return file, read_table(file, check, flags=flags)


def _columns_to_read(hand: Hand, others: Collection[str], file: Path, names: list[str]) -> list[str]:
    """Return the columns of a table that belong to the hand; warn of the others."""
    known = {"time", LABEL, *others}
    for part in hand.parts:
        known |= {*part.columns.values(), *(f"{part.prefix}{name}" for name in others if part.prefix is not None)}
    if hand.wrist:
        known |= set(hand.wrist.columns.values())
    if "time" not in names:
        raise InputError(f"{file}: no column time; expected the time of every sample in s")
    ignored = [name for name in names if name not in known]
    for name in ignored:
        for part in hand.parts:
            if part.prefix is not None and name.startswith(part.prefix):
                _check_spelling(file, part, name)
    if ignored:
        listed = ", ".join(map(repr, ignored[:6])) + (f" and {len(ignored) - 6} more" if len(ignored) > 6 else "")
        warnings.warn(
            f"{file}: ignored columns: {listed}; no finger of {hand.path} has them", InputWarning, stacklevel=2
        )
    return [name for name in names if name in known]


def _check_spelling(file: Path, part: HandPart, name: str) -> None:
    """Refuse a column that is one of a part in another spelling, or beyond its joints and tendons."""
    rest = name[len(part.prefix or "") :]
    element, right = element_of(rest), right_spelling(rest)
    if element and element[0] in GROUPS:
        finger = part.finger
        size = f"{counted(finger.joints, 'joint')} and {counted(finger.tendons, 'tendon')}"
        raise InputError(f"{file}: column {name!r}; expected none of this number, since {part.name} has {size}")
    if right is not None:
        raise InputError(f"{file}: column {name!r}; expected the name {part.prefix}{right}")


# --- a part -----------------------------------------------------------------------------------------------------------


def _recording(file: Path, table: Table, part: HandPart, shared: int, others: Collection[str]) -> Recording:
    """Make the recording of a part. With shared joints it has no positions yet."""
    groups = {}
    for group, (unit, required) in GROUPS.items():
        size = part.finger.tendons if GROUP_PER[group] == "tendon" else part.finger.joints
        if shared and group in POSITIONS:
            continue
        columns = _group(file, table, part, [f"{group}[{i}]" for i in range(1, size + 1)])
        if columns is not None:
            groups[group] = columns
        elif required:
            name = part.columns[f"{group}[1]"]
            raise InputError(
                f"{file}: no column {name}; expected {counted(size, 'column')} with {group} of {part.name}, in {unit}"
            )
    label = part.columns.get(LABEL, LABEL)
    recording = Recording.from_arrays(
        table["time"],
        groups.pop("tendon_force"),
        groups.pop("tendon_position"),
        contact=table.get(label, table.get(LABEL)),
        name=f"{file}:{part.name}",
        **groups,
    )
    kept = {name: table.get(f"{part.prefix}{name}", table.get(name)) for name in others}
    return replace(recording, others={name: values for name, values in kept.items() if values is not None})


def _group(file: Path, table: Table, part: HandPart, names: Sequence[str]) -> Numbers | None:
    """Return the columns of a group [N, k]; None if there is none of them."""
    listed = {name: part.columns[name] for name in names if name in part.columns}
    if not any(theirs in table for theirs in listed.values()):
        return None
    for name in names:
        if listed.get(name) not in table:
            wanted = listed.get(name, name)
            raise InputError(f"{file}: no column {wanted}; expected {names[0]} to {names[-1]} of {part.name}, or none")
    return np.column_stack([table[listed[name]] for name in names])


# --- the wrist --------------------------------------------------------------------------------------------------------


def _wrist_motion(file: Path, table: Table, hand: Hand, recording: Recording | None) -> Mapping[str, Numbers]:
    """Return the positions [N, w] (rad), and the velocities (rad/s) where they are measured."""
    assert hand.wrist is not None
    if recording is not None and hand.wrist.part is not None:
        measured = {group: recording.groups[group] for group in POSITIONS if group in recording.groups}
        if "joint_position" not in measured:
            measured["joint_position"] = run_model(hand.wrist.part.finger, recording)["joint_angle"]
        return measured
    motion = {}
    for group in POSITIONS:
        names = [hand.wrist.columns.get(f"{group}[{j}]", "") for j in range(1, hand.wrist_joints + 1)]
        missing = [name for name in names if name not in table]
        if not missing:
            motion[group] = np.column_stack([table[name] for name in names])
        elif group == "joint_position":
            joints = ", ".join(hand.wrist.joints)
            raise InputError(f"{file}: no column {missing[0]}; expected the measured angles of the wrist, {joints}")
    return motion


def _with_wrist(
    hand: Hand, part: HandPart, recording: Recording, table: Table, wrist: Mapping[str, Numbers]
) -> Recording:
    """Return the recording of a finger with the positions of all joints, and velocities where all are measured."""
    shared, finger, file = hand.wrist_joints, part.finger, Path(recording.path)
    groups = dict(recording.groups)
    for group in POSITIONS:
        names = [f"{group}[{j}]" for j in range(1, finger.joints + 1)]
        for name in names[:shared]:
            if part.columns.get(name) in table:
                raise InputError(
                    f"{file}: column {part.columns[name]}; expected none, since joint {name[len(group) + 1 : -1]} of "
                    f"{part.name} is the wrist's, whose columns are read"
                )
        measured = _group(file, table, part, names[shared:])
        if measured is None and group == "joint_position":
            measured = _angles_beyond(finger.data, groups, wrist[group])
        if measured is not None and group in wrist:
            groups[group] = np.column_stack([wrist[group], measured])
    ordered = {name: groups[name] for name in GROUPS if name in groups}
    return replace(recording, groups=ordered)


def _angles_beyond(data: Mapping[str, object], groups: Mapping[str, Numbers], wrist: Numbers) -> Numbers:
    """Return the angles [N, n − w] (rad) that tendons and wrist [N, w] give, q_f = R_f⁺ (x1 − R_w q_w)."""
    arms, count = moment_arms(data), wrist.shape[1]
    known = np.column_stack([wrist, np.zeros((len(wrist), arms.shape[1] - count))])
    beyond = groups["tendon_position"] - tendon_positions(data, known, groups["tendon_force"])
    return np.asarray(beyond @ np.linalg.pinv(arms[:, count:], rcond=1e-15).T)
