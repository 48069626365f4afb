"""The demo: the built-in finger and its built-in recording, through the FMU to a table and a figure. Computes, prints
nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.description import FingerDescription, read_finger
from tendonfmu.errors import InputError
from tendonfmu.figure_data import Interval, compensation_figure, intervals
from tendonfmu.fmu import run_fmu
from tendonfmu.packaging import build_fmu
from tendonfmu.recording import Recording, read_recording
from tendonfmu.signals import NUMBERS
from tendonfmu.tables import write_table
from tendonfmu.whole_file import whole_file

FINGER = "index_finger.json"
RECORDING = "index_finger_demo.parquet"
MERGE = 0.1  # s; labelled contacts closer than this are one push
START = 0.5  # s; alarms this long before a push or after it still belong to it


@dataclass(frozen=True)
class JointResult:
    """rms in N.m: measured torque, compensated torque without and in labelled contact."""

    name: str
    torque_rms: float
    free_rms: float
    contact_rms: float


@dataclass(frozen=True)
class DemoResult:
    """found: labelled pushes during which contact was detected. files: path -> what is in it."""

    finger: str
    seconds: float
    joints: list[JointResult]
    pushes: int
    found: int
    false_alarms: int
    files: dict[Path, str]


def run_demo(folder: Path, *, progress: Callable[[int, int], None]) -> DemoResult:
    """Builds the FMU, runs it over the recording, writes FMU, outputs and figure into `folder` (made if missing)."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
    data = files("tendonfmu") / "data"
    fmu, csv, figure = (folder / name for name in ("index_finger.fmu", "compensated.csv", "compensated.png"))
    with as_file(data / FINGER) as finger, as_file(data / RECORDING) as path:
        description, recording = read_finger(finger), read_recording(path)
        build_fmu(finger, fmu)
    outputs = run_fmu(fmu, recording, progress=lambda done: progress(done, len(recording)))
    write_table(csv, outputs)
    _draw(description, recording, outputs, figure)
    what = {fmu: "the FMU", csv: "its outputs", figure: "torques, what is left of them, contacts"}
    return _summarise(description, recording, outputs, what)


def _draw(description: FingerDescription, recording: Recording, outputs: dict[str, NDArray[Any]], figure: Path) -> None:
    from tendonfmu.plots import draw_compensation

    measured: dict[str, NDArray[Any]] = recording.arrays()
    if recording.contact is not None:
        measured["contact"] = recording.contact
    series = {name: _rows(outputs, name) for name in NUMBERS} | {"contact": outputs["contact"]}
    with whole_file(figure) as temporary:
        draw_compensation(compensation_figure(description, measured, series), temporary)


def _rows(outputs: dict[str, NDArray[Any]], name: str) -> NDArray[Any]:
    """[N, n] the columns name[1], name[2], ..."""
    count = sum(column.startswith(f"{name}[") for column in outputs)
    return np.column_stack([outputs[f"{name}[{i}]"] for i in range(1, count + 1)])


def _merged(found: list[Interval]) -> list[Interval]:
    """Intervals with gaps up to `MERGE` closed."""
    merged: list[Interval] = []
    for begin, end in found:
        if merged and begin - merged[-1][1] <= MERGE:
            merged[-1] = (merged[-1][0], end)
        else:
            merged.append((begin, end))
    return merged


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")


def _summarise(
    description: FingerDescription, recording: Recording, outputs: dict[str, NDArray[Any]], written: dict[Path, str]
) -> DemoResult:
    torque, left = _rows(outputs, "joint_torque"), _rows(outputs, "compensated_torque")
    label = np.zeros(len(recording), bool) if recording.contact is None else recording.contact
    pushes = _merged(intervals(recording.time, label))
    alarms = _merged(intervals(recording.time, outputs["contact"]))
    found = [any(a[0] <= push[1] and a[1] >= push[0] for a in alarms) for push in pushes]
    false = [not any(a[0] <= push[1] + START and a[1] >= push[0] for push in pushes) for a in alarms]
    joints = [
        JointResult(name, _rms(torque[:, j]), _rms(left[~label, j]), _rms(left[label, j]))
        for j, name in enumerate(description.joint_names)
    ]
    seconds = float(recording.time[-1] - recording.time[0])
    return DemoResult(description.name, seconds, joints, len(pushes), sum(found), sum(false), written)
