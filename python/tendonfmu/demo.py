"""The demo: the built-in finger and its built-in recordings, through the FMU to a table and a figure. Computes, prints
nothing.

The paper's story on a simulated finger whose truth is known: free motion at a low pretension, the same motion at four
times the pretension, and pushes on the fingertip. The description holds the simulated finger's own static friction;
nothing is fitted to these recordings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.description import FingerDescription, read_finger
from tendonfmu.detection_score import DetectionScore, score_detection
from tendonfmu.errors import InputError
from tendonfmu.figure_data import CompensationFigure, StoryFigure, compensation_figure
from tendonfmu.fmu import run_fmu
from tendonfmu.packaging import build_fmu
from tendonfmu.recording import Recording, read_recording
from tendonfmu.signals import NUMBERS
from tendonfmu.tables import write_table

FINGER = "index_finger.json"
FREE, FREE_X4, PUSHES = "index_finger_free", "index_finger_free_x4", "index_finger_pushes"
ABDUCTION, FLEXION = "mcp_abduction", "mcp_flexion"  # the joints that are drawn
FMU, FIGURE = "index_finger.fmu", "compensated.png"

Outputs = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class JointResult:
    """rms in N·m. measured, left: joint torque and what compensation leaves of it, while nobody pushes.

    load, error: external torque, and compensated minus external, while somebody pushes; nan if nobody ever does.
    """

    name: str
    measured: float
    left: float
    load: float
    error: float


@dataclass(frozen=True)
class RecordingResult:
    """mean_force: N, of all tendons over all samples. score: against the labels; without them all alarms are wrong."""

    name: str
    seconds: float
    mean_force: float
    joints: list[JointResult]
    score: DetectionScore


@dataclass(frozen=True)
class DemoResult:
    """free, free_x4, pushed: the recordings in the order of the story. files: path -> what is in it."""

    finger: str
    free: RecordingResult
    free_x4: RecordingResult
    pushed: RecordingResult
    files: dict[Path, str]

    @property
    def recordings(self) -> tuple[RecordingResult, RecordingResult, RecordingResult]:
        return self.free, self.free_x4, self.pushed


def run_demo(folder: Path, *, progress: Callable[[int, int], None]) -> DemoResult:
    """Builds the FMU, runs it over the recordings, writes FMU, outputs and figure into `folder` (made if missing)."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
    data = files("tendonfmu") / "data"
    fmu, figure = folder / FMU, folder / FIGURE
    with as_file(data / FINGER) as finger:
        description = read_finger(finger)
        build_fmu(finger, fmu)
    recordings = {}
    for name in (FREE, FREE_X4, PUSHES):
        with as_file(data / f"{name}.parquet") as path:
            recordings[name] = read_recording(path)

    total = sum(map(len, recordings.values()))
    outputs: dict[str, Outputs] = {}
    written = {fmu: "the FMU"}
    for name, recording in recordings.items():
        before = sum(len(done["time"]) for done in outputs.values())
        outputs[name] = run_fmu(fmu, recording, progress=partial(_advance, progress, before, total))
        table = folder / f"{name}.csv"
        write_table(table, outputs[name])
        written[table] = f"its outputs over {name}.parquet"

    results = {name: _result(description, name, recordings[name], outputs[name]) for name in recordings}
    _draw(description, results, recordings, outputs, figure)
    written[figure] = "torques, what is left of them, contacts"
    return DemoResult(description.name, results[FREE], results[FREE_X4], results[PUSHES], written)


def _advance(progress: Callable[[int, int], None], before: int, total: int, done: int) -> None:
    progress(before + done, total)


def _draw(
    description: FingerDescription,
    results: Mapping[str, RecordingResult],
    recordings: Mapping[str, Recording],
    outputs: Mapping[str, Outputs],
    figure: Path,
) -> None:
    from tendonfmu.plots import draw_story

    def panel(name: str, title: str, joints: Sequence[int]) -> CompensationFigure:
        recording = recordings[name]
        measured: dict[str, NDArray[Any]] = recording.arrays()
        if recording.contact is not None:
            measured["contact"] = recording.contact
        series = {each: _rows(outputs[name], each) for each in NUMBERS} | {"contact": outputs[name]["contact"]}
        title = f"{title}, {results[name].mean_force:.0f} N"
        return compensation_figure(description, measured, series, title=title, joints=joints)

    flexion = description.joint_names.index(FLEXION)
    free = [panel(FREE, "(a) free motion", [flexion]), panel(FREE_X4, "(b) the same motion", [flexion])]
    pushed = panel(PUSHES, "(c) with pushes", [description.joint_names.index(ABDUCTION), flexion])
    story = StoryFigure(f"{description.name}: friction compensation", free, pushed)
    draw_story(story, figure)


def _rows(outputs: Outputs, name: str) -> NDArray[Any]:
    """[N, n] the columns name[1], name[2], ..."""
    count = sum(column.startswith(f"{name}[") for column in outputs)
    return np.column_stack([outputs[f"{name}[{i}]"] for i in range(1, count + 1)])


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")


def _result(description: FingerDescription, name: str, recording: Recording, outputs: Outputs) -> RecordingResult:
    torque, left = _rows(outputs, "joint_torque"), _rows(outputs, "compensated_torque")
    label = np.zeros(len(recording), bool) if recording.contact is None else recording.contact
    external = recording.groups.get("external_torque", np.zeros_like(torque))
    joints = [
        JointResult(
            name=joint,
            measured=_rms(torque[~label, j]),
            left=_rms(left[~label, j]),
            load=_rms(external[label, j]),
            error=_rms(left[label, j] - external[label, j]),
        )
        for j, joint in enumerate(description.joint_names)
    ]
    return RecordingResult(
        name=name,
        seconds=float(recording.time[-1] - recording.time[0]),
        mean_force=float(recording.groups["tendon_force"].mean()),
        joints=joints,
        score=score_detection(recording.time, label, outputs["contact"]),
    )
