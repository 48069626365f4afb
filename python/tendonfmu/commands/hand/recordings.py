"""How the recording of a hand is split into recordings of its parts, with the angles of the wrist, and run."""

from __future__ import annotations

import os
import warnings
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.commands.hand.description import WRIST, Hand, HandPart, read_hand
from tendonfmu.commands.run import RunResult
from tendonfmu.commands.run import run as run_finger
from tendonfmu.errors import InputError, InputWarning
from tendonfmu.files import Table, frame_of, is_frame, path_of, read_table, table_of_frame, write_table
from tendonfmu.fmu import run_model
from tendonfmu.model import moment_arms, tendon_positions
from tendonfmu.options import RunOptions
from tendonfmu.recordings import GROUPS, LABEL, Recording, RecordingSource

if TYPE_CHECKING:
    import pandas as pd

HandRecording: TypeAlias = "RecordingSource"  # a file, or a DataFrame
POSITIONS = ("joint_position", "joint_velocity")  # groups of the joints that fingers and wrist share
SUMMED = ("compensated_torque", "joint_torque", "friction_torque", "bias_torque")
MOTION = ("joint_angle", "joint_speed")


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
    wrist = hand.wrist.part if hand.wrist else None
    last = {} if wrist is None else {WRIST: _recording(file, table, wrist, {}, others)}
    motion = _wrist_motion(file, table, hand, last)
    recordings, failed = dict[str, Recording](), dict[str, str]()
    for part in hand.fingers:
        try:
            recordings[part.name] = _recording(file, table, part, motion, others)
        except InputError as refused:
            failed[part.name] = str(refused)
    return recordings | last, failed


def _table(hand: Hand, source: HandRecording, others: Collection[str]) -> tuple[Path, Table]:
    """Read the columns that belong to the hand; warn of the others."""
    prefixes = [*(part.prefix for part in hand.parts), *([hand.wrist.prefix] if hand.wrist else [])]

    def ours(file: Path, names: list[str]) -> list[str]:
        known = {name for name in names if name in ("time", LABEL, *others) or name.startswith(tuple(prefixes))}
        if "time" not in names:
            raise InputError(f"{file}: no column time; expected the time of every sample in s")
        if ignored := [repr(name) for name in names if name not in known]:
            listed = ", ".join(ignored[:6]) + (f" and {len(ignored) - 6} more" if len(ignored) > 6 else "")
            words = f"{file}: ignored columns: {listed}; no finger of {hand.path} has them"
            warnings.warn(words, InputWarning, stacklevel=2)
        return [name for name in names if name in known]

    flags = {LABEL, *others, *(f"{prefix}{LABEL}" for prefix in prefixes)}
    if is_frame(source):
        return Path("DataFrame"), table_of_frame(Path("DataFrame"), source, ours, flags=flags)
    if not isinstance(source, str | os.PathLike):
        raise InputError(f"recording: {type(source).__name__}; expected a path or a DataFrame of the whole hand")
    return path_of(source), read_table(path_of(source), ours, flags=flags)


def _recording(
    file: Path, table: Table, part: HandPart, wrist: Mapping[str, Numbers], others: Collection[str]
) -> Recording:
    """Make the recording of a part, checked as that of a finger. wrist: motion of the joints that it shares, [N, w]."""
    columns = {name: table[name] for name in ("time", LABEL, *others) if name in table}
    columns |= {
        theirs.removeprefix(part.prefix): values
        for theirs, values in table.items()
        if theirs.startswith(part.prefix) and theirs not in others
    }
    name, finger = f"{file}:{part.name}", part.finger
    for group in POSITIONS if part.shared else ():
        behind = {f"{group}[{j}]" for j in range(part.shared + 1, finger.joints + 1)} & columns.keys()
        for j in range(1, part.shared + 1):
            if f"{group}[{j}]" in columns:
                raise InputError(
                    f"{file}: column {part.prefix}{group}[{j}]; expected none, since joint {j} of {part.name} is "
                    "the wrist's, whose columns are read"
                )
        if behind and group in wrist:
            columns |= {f"{group}[{j}]": values for j, values in enumerate(wrist[group].T, start=1)}
        for column in behind if group not in wrist else ():
            del columns[column]
    recording = Recording.from_frame(frame_of(columns), name=name, others=others)
    recording.require(finger.joints, finger.tendons, ())
    if not part.shared or "joint_position" in recording.groups:
        return recording
    angles = _angles_beyond(finger.data, recording.groups, wrist["joint_position"])
    groups = {**recording.groups, "joint_position": np.column_stack([wrist["joint_position"], angles])}
    return replace(recording, groups={name: groups[name] for name in GROUPS if name in groups})


# --- the wrist --------------------------------------------------------------------------------------------------------


def _wrist_motion(file: Path, table: Table, hand: Hand, own: Mapping[str, Recording]) -> dict[str, Numbers]:
    """Return angles and, if measured, velocities of the wrist [N, w]. own: its recording, if it has tendons."""
    if hand.wrist is None:
        return {}
    if hand.wrist.part:
        recording = own[WRIST]
        motion = {group: recording.groups[group] for group in POSITIONS if group in recording.groups}
        if "joint_position" not in motion:
            motion["joint_position"] = run_model(hand.wrist.part.finger, recording)["joint_angle"]
        return motion
    motion = {}
    for group in POSITIONS:
        names = [f"{hand.wrist.prefix}{group}[{j}]" for j in range(1, len(hand.wrist.joints) + 1)]
        missing = [name for name in names if name not in table]
        if not missing:
            motion[group] = np.column_stack([table[name] for name in names])
        elif group == "joint_position":
            joints = ", ".join(hand.wrist.joints)
            raise InputError(f"{file}: no column {missing[0]}; expected the measured angles of the wrist, {joints}")
    return motion


def _angles_beyond(data: Mapping[str, object], groups: Mapping[str, Numbers], wrist: Numbers) -> Numbers:
    """Return the angles [N, n − w] (rad) that tendons and wrist [N, w] give, q_f = R_f⁺ (x1 − R_w q_w)."""
    arms, count = moment_arms(data), wrist.shape[1]
    known = np.column_stack([wrist, np.zeros((len(wrist), arms.shape[1] - count))])
    beyond = groups["tendon_position"] - tendon_positions(data, known, groups["tendon_force"])
    return np.asarray(beyond @ np.linalg.pinv(arms[:, count:], rcond=1e-15).T)


# --- run --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class HandRun:
    """What a hand makes of a recording.

    Attributes
    ----------
    results
        The result of each part, by its name.
    wrist
        Torques of all tendons that pass the wrist, and its motion, by name [N, w]; empty without a wrist.
    """

    results: Mapping[str, RunResult]
    wrist: Mapping[str, NDArray[Any]]

    def __repr__(self) -> str:
        return f"<HandRun: {'; '.join(f'{name}: {result.summary}' for name, result in self.results.items())}>"

    @property
    def frame(self) -> pd.DataFrame:
        """All outputs as a pandas DataFrame, with the columns that `tendonfmu run` writes."""
        return frame_of(self.columns())

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return all outputs by column [N], such as `index.joint_torque[2]`, `time` first."""
        columns: dict[str, NDArray[Any]] = {"time": next(iter(self.results.values())).outputs["time"]}
        for name, result in self.results.items():
            columns |= {f"{name}.{column}": values for column, values in result.columns().items() if column != "time"}
        for name, values in self.wrist.items():  # in the place of those of the wrist's own tendons
            columns |= {f"{WRIST}.{name}[{j}]": column for j, column in enumerate(values.T, start=1)}
        return columns

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write all outputs as .csv or .parquet, whole or not at all. Raises InputError if that is not possible."""
        write_table(path, self.columns())


def run_hand(hand: Hand | str | os.PathLike[str], recording: HandRecording, *, kinematics: int = 1) -> HandRun:
    """Run all fingers of a hand over a recording.

    Parameters
    ----------
    hand
        A hand, or the file of it.
    recording
        A .csv or .parquet file, or a pandas DataFrame, with the columns of all fingers.
    kinematics
        1 tendon positions, 2 measured joint positions, 3 joint positions and velocities. Fingers with a shared wrist
        take at least 2.

    Returns
    -------
    HandRun
        All outputs of all fingers. With a wrist, its torques are the sums over all tendons that pass it.

    Raises
    ------
    InputError
        The hand or the recording is refused, or they do not fit.
    """
    asked = RunOptions(kinematics=kinematics).kinematics
    given = read_hand(hand)
    recordings = split_recording(given, recording)
    results = {
        part.name: run_finger(part.finger, recordings[part.name], kinematics=part.kinematics(asked))
        for part in given.parts
    }
    if given.wrist is None:
        return HandRun(results, {})
    count, outputs = len(given.wrist.joints), [results[part.name].outputs for part in given.parts]
    summed = {name: np.sum([each[name][:, :count] for each in outputs], axis=0) for name in SUMMED}
    return HandRun(results, summed | {name: outputs[0][name][:, :count] for name in MOTION})
