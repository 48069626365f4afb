"""The ten 0.1 Hz runs of the da Vinci instrument as recordings of the jaw, and the error they are judged by."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters import convert_file
from tendonfmu.recordings.recording import Recording

Array = NDArray[Any]

SLOW = tuple(f"0{load}" for load in range(10))  # 0.1 Hz, jaw loaded with 10 % .. 100 %
FAST = ("40", "42", "44", "46", "48")  # 0.5 Hz, those that are in the folder
FAULT = {"07": 16.5}  # s; the instrument jams from 17.08 s on: not friction, left out of fit and score


def data_folder() -> Path:
    """Folder of the text files, in $TENDONFMU_DATA or in ../shared/data beside the repository.

    Raises InputError if it is absent.
    """
    root = Path(__file__).resolve().parents[2]
    data = Path(os.environ.get("TENDONFMU_DATA") or root.parent / "shared" / "data")
    folder = data / "davinci_tool" / "Tool_4_Maryland_L_4"
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; expected the da Vinci recordings (docs/evidence/davinci.md)")
    return folder


def read_run(folder: Path, name: str) -> Recording:
    """One run as `tendonfmu convert davinci` writes it, up to its fault if it has one."""
    file = folder / f"{name}.TXT"
    columns = convert_file("davinci", file, {})
    end = np.searchsorted(columns["time"], FAULT.get(name, np.inf), side="right")
    groups = {column.removesuffix("[1]"): values[:end, None] for column, values in columns.items() if column != "time"}
    return Recording(file, columns["time"][:end], groups)


def rms(values: Array) -> float:
    """Root of the mean square, in the unit of the values."""
    return float(np.sqrt(np.mean(np.square(values))))


def torque_error(recording: Recording, outputs: Mapping[str, Array]) -> Array:
    """[N] N·m: compensated torque minus what the sensor at the jaw felt."""
    return np.asarray(outputs["compensated_torque"] - recording.groups["external_torque"])[:, 0]
