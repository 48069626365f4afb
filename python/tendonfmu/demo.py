"""The demo: the built-in finger and its built-in recording, through the FMU to a table and a figure. Computes, prints
nothing.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.fmu import run_fmu
from tendonfmu.packaging import build_fmu
from tendonfmu.recording import Recording, read_recording, write_table

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
    with as_file(data / FINGER) as description, as_file(data / RECORDING) as path:
        finger = json.loads(description.read_text(encoding="utf-8"))
        recording = read_recording(path)
        build_fmu(description, fmu)
    outputs = run_fmu(fmu, recording, progress=lambda done: progress(done, len(recording)))
    write_table(csv, outputs)
    _draw(finger, recording, outputs, figure)
    what = {fmu: "the FMU", csv: "its outputs", figure: "torques, what is left of them, contacts"}
    return _summarise(finger, recording, outputs, what)


def rows(outputs: dict[str, NDArray[Any]], name: str) -> NDArray[Any]:
    """[N, n] the columns name[1], name[2], ..."""
    count = sum(column.startswith(f"{name}[") for column in outputs)
    return np.column_stack([outputs[f"{name}[{i}]"] for i in range(1, count + 1)])


def intervals(time: NDArray[np.float64], flag: NDArray[np.bool_], merge: float = 0.0) -> list[tuple[float, float]]:
    """Times [begin, end] (s) during which a flag holds; gaps up to `merge` are closed."""
    edges = np.diff(np.concatenate(([0], flag.astype(int), [0])))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    found: list[tuple[float, float]] = []
    for begin, end in zip(time[begins], time[ends], strict=True):
        if found and begin - found[-1][1] <= merge:
            found[-1] = (found[-1][0], float(end))
        else:
            found.append((float(begin), float(end)))
    return found


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")


def _summarise(
    finger: dict[str, Any], recording: Recording, outputs: dict[str, NDArray[Any]], written: dict[Path, str]
) -> DemoResult:
    torque, left = rows(outputs, "joint_torque"), rows(outputs, "compensated_torque")
    label = np.zeros(len(recording), bool) if recording.contact is None else recording.contact
    pushes = intervals(recording.time, label, MERGE)
    alarms = intervals(recording.time, outputs["contact"], MERGE)
    found = [any(a[0] <= push[1] and a[1] >= push[0] for a in alarms) for push in pushes]
    false = [not any(a[0] <= push[1] + START and a[1] >= push[0] for push in pushes) for a in alarms]
    joints = [
        JointResult(
            str(joint.get("name", f"joint {j + 1}")),
            _rms(torque[:, j]),
            _rms(left[~label, j]),
            _rms(left[label, j]),
        )
        for j, joint in enumerate(finger["joints"])
    ]
    seconds = float(recording.time[-1] - recording.time[0])
    return DemoResult(str(finger["name"]), seconds, joints, len(pushes), sum(found), sum(false), written)
