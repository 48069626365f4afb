"""Runs all fingers of a hand over a recording, and sums the torques that they hold at the wrist."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.commands.hand.description import Hand, read_hand
from tendonfmu.commands.hand.hand_types import WRIST
from tendonfmu.commands.hand.recordings import HandRecording, split_recording
from tendonfmu.commands.run import RunResult
from tendonfmu.commands.run import run as run_finger
from tendonfmu.files import frame_of, write_table
from tendonfmu.options import RunOptions

if TYPE_CHECKING:
    import pandas as pd

SUMMED = ("compensated_torque", "joint_torque", "friction_torque", "bias_torque")
MOTION = ("joint_angle", "joint_speed")


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
            columns |= {f"{WRIST}.{name}[{j + 1}]": values[:, j] for j in range(values.shape[1])}
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
        part.name: run_finger(part.finger, recordings[part.name], kinematics=given.kinematics(part, asked))
        for part in given.parts
    }
    return HandRun(results, _at_wrist(given, results))


def _at_wrist(hand: Hand, results: Mapping[str, RunResult]) -> dict[str, NDArray[Any]]:
    count = hand.wrist_joints
    if not count:
        return {}
    outputs = [results[part.name].outputs for part in hand.parts]
    summed = {name: np.sum([each[name][:, :count] for each in outputs], axis=0) for name in SUMMED}
    return summed | {name: outputs[0][name][:, :count] for name in MOTION}
