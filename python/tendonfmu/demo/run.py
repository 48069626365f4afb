"""The demo's chapters `detect` and `run`: the calibrated index finger's FMU over its built-in recordings.

As in the paper, but on a simulated finger whose truth is known: pushes on the fingertip, free motion at a low
pretension, and the same motion at four times the pretension. The description was calibrated on 27 min of other motion
of that finger (examples/demo_recording/make_calibrated.py); nothing is fitted to these recordings.
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

from tendonfmu.detect import DetectionScore, score_detection
from tendonfmu.files import write_table
from tendonfmu.fmu import build_fmu, run_fmu
from tendonfmu.model import NUMBERS, Finger, Instance, read_finger
from tendonfmu.recordings import Recording, read_recording
from tendonfmu.report import CompensationFigure, StoryFigure, compensation_figure

FINGER, GIVEN = "index_finger_calibrated.json", "index_finger.json"  # after and before the calibration
MINUTES = 27  # of free motion that it was calibrated on
FREE, FREE_X4, PUSHES = "index_finger_free", "index_finger_free_x4", "index_finger_pushes"
ABDUCTION, FLEXION = "mcp_abduction", "mcp_flexion"  # the joints that are drawn
FMU, FIGURE = "index_finger.fmu", "compensated.png"
DATA = files("tendonfmu") / "data"

Outputs = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class JointResult:
    """rms of one joint (N·m)."""

    name: str
    measured: float
    left: float
    load: float
    error: float


@dataclass(frozen=True)
class RecordingResult:
    """Results of one recording."""

    name: str
    seconds: float
    mean_force: float
    joints: list[JointResult]
    score: DetectionScore


class IndexFinger:
    """The calibrated index finger in an existing folder: `pushes` runs first, then `free_motion`."""

    as_given: DetectionScore

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.files: dict[Path, str] = {}
        self.results: dict[str, RecordingResult] = {}
        self._recordings: dict[str, Recording] = {}
        self._outputs: dict[str, Outputs] = {}

    def pushes(self, progress: Callable[[int, int], None]) -> None:
        """Build the FMU and run it over the recording with pushes; `progress` receives samples done and samples."""
        with as_file(DATA / FINGER) as finger, as_file(DATA / GIVEN) as given:
            self.description, before = read_finger(finger), read_finger(given)
            build_fmu(finger, self.folder / FMU)
        self.files[self.folder / FMU] = "the calibrated index finger's FMU"
        self._run((PUSHES,), progress)
        recording = self._recordings[PUSHES]
        contact = Instance(before.image).run(recording.arrays())["contact"]
        self.as_given = score_detection(recording.time, _label(recording), contact)

    def free_motion(self, progress: Callable[[int, int], None]) -> None:
        """Run the FMU over both recordings of free motion, and draw all three recordings."""
        self._run((FREE, FREE_X4), progress)
        figure = self.folder / FIGURE
        _draw(self.description, self.results, self._recordings, self._outputs, figure)
        self.files[figure] = "torques, what is left of them, contacts"

    def curves(self, name: str, joints: Sequence[str], title: str) -> CompensationFigure:
        """Return the curves of some joints of a recording that has been run."""
        numbers = [self.description.joint_names.index(joint) for joint in joints]
        return _curves(self.description, self._recordings[name], self._outputs[name], title, numbers)

    def _run(self, names: Sequence[str], progress: Callable[[int, int], None]) -> None:
        for name in names:
            with as_file(DATA / f"{name}.parquet") as path:
                self._recordings[name] = read_recording(path)
        total, before = sum(len(self._recordings[name]) for name in names), 0
        for name in names:
            recording = self._recordings[name]
            outputs = run_fmu(self.folder / FMU, recording, progress=partial(_advance, progress, before, total))
            before += len(recording)
            table = self.folder / f"{name}.csv"
            write_table(table, outputs)
            self.files[table] = f"its outputs over {name}.parquet"
            self._outputs[name], self.results[name] = outputs, _result(self.description, name, recording, outputs)


def _advance(progress: Callable[[int, int], None], before: int, total: int, done: int) -> None:
    progress(before + done, total)


def _draw(
    description: Finger,
    results: Mapping[str, RecordingResult],
    recordings: Mapping[str, Recording],
    outputs: Mapping[str, Outputs],
    figure: Path,
) -> None:
    from tendonfmu.report import draw_story

    def panel(name: str, title: str, joints: Sequence[str]) -> CompensationFigure:
        numbers = [description.joint_names.index(joint) for joint in joints]
        title = f"{title}, {results[name].mean_force:.0f} N"
        return _curves(description, recordings[name], outputs[name], title, numbers)

    free = [panel(FREE, "(a) free motion", [FLEXION]), panel(FREE_X4, "(b) the same motion", [FLEXION])]
    pushed = panel(PUSHES, "(c) with pushes", [ABDUCTION, FLEXION])
    story = StoryFigure(f"{description.name}: friction compensation", free, pushed)
    draw_story(story, figure)


def _curves(
    description: Finger, recording: Recording, outputs: Outputs, title: str, joints: Sequence[int]
) -> CompensationFigure:
    measured: dict[str, NDArray[Any]] = recording.arrays()
    if recording.contact is not None:
        measured["contact"] = recording.contact
    series = {each: _rows(outputs, each) for each in NUMBERS} | {"contact": outputs["contact"]}
    return compensation_figure(description, measured, series, title=title, joints=joints)


def _rows(outputs: Outputs, name: str) -> NDArray[Any]:
    """Join the columns name[1], name[2], ... to [N, n]."""
    count = sum(column.startswith(f"{name}[") for column in outputs)
    return np.column_stack([outputs[f"{name}[{i}]"] for i in range(1, count + 1)])


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")


def _label(recording: Recording) -> NDArray[np.bool_]:
    """Return [N] whether somebody pushes."""
    return np.zeros(len(recording), bool) if recording.contact is None else recording.contact


def _result(description: Finger, name: str, recording: Recording, outputs: Outputs) -> RecordingResult:
    torque, left = _rows(outputs, "joint_torque"), _rows(outputs, "compensated_torque")
    label = _label(recording)
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
