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

from tendonfmu.arrays import Array
from tendonfmu.detect import DetectionScore, score_detection
from tendonfmu.files import write_table
from tendonfmu.fmu import build_fmu, run_fmu
from tendonfmu.model import Finger, Instance, read_finger
from tendonfmu.recordings import Recording, flagged_stretches, read_recording
from tendonfmu.report import rms

FINGER, GIVEN = "index_finger_calibrated.json", "index_finger.json"  # after and before the calibration
MINUTES = 27  # of free motion that it was calibrated on
FREE, FREE_X4, PUSHES = "index_finger_free", "index_finger_free_x4", "index_finger_pushes"
ABDUCTION, FLEXION = "mcp_abduction", "mcp_flexion"  # the joints that are drawn
FMU = "index_finger.fmu"
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


@dataclass(frozen=True)
class Curves:
    """One joint of a recording over time, and when contact is found and labelled."""

    joint: str
    time: Array  # [N] s
    torques: dict[str, Array]  # measured, predicted, compensated and, where a sensor is, external: [N] N·m
    found: list[tuple[float, float]]
    false: list[tuple[float, float]]  # found without a push
    labelled: list[tuple[float, float]]


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
        """Run the FMU over both recordings of free motion."""
        self._run((FREE, FREE_X4), progress)

    def curves(self, name: str, joint: str) -> Curves:
        """Return the curves of a joint in a recording that has been run."""
        recording, outputs = self._recordings[name], self._outputs[name]
        number = self.description.joint_names.index(joint)
        names = {"measured": "joint_torque", "predicted": "friction_torque", "compensated": "compensated_torque"}
        torques = {key: outputs[f"{column}[{number + 1}]"] for key, column in names.items()}
        if "external_torque" in recording.groups:
            torques["external"] = recording.groups["external_torque"][:, number]
        time, found = recording.time, outputs["contact"].ravel().astype(bool)
        alarms = self.results[name].score.false_alarms
        false = np.any([(time >= begin) & (time <= end) for begin, end in alarms] or [np.zeros_like(found)], axis=0)
        return Curves(
            joint=joint,
            time=time,
            torques=torques,
            found=flagged_stretches(time, found & ~false),
            false=flagged_stretches(time, false),
            labelled=flagged_stretches(time, _label(recording)),
        )

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


def _label(recording: Recording) -> NDArray[np.bool_]:
    """Return [N] whether somebody pushes."""
    return np.zeros(len(recording), bool) if recording.contact is None else recording.contact


def _result(description: Finger, name: str, recording: Recording, outputs: Outputs) -> RecordingResult:
    label = _label(recording)
    joints = []
    for j, joint in enumerate(description.joint_names):
        torque, left = outputs[f"joint_torque[{j + 1}]"], outputs[f"compensated_torque[{j + 1}]"]
        external = recording.groups["external_torque"][:, j] if label.any() else np.zeros_like(torque)
        joints.append(
            JointResult(
                name=joint,
                measured=rms(torque[~label]),
                left=rms(left[~label]),
                load=rms(external[label]),
                error=rms(left[label] - external[label]),
            )
        )
    return RecordingResult(
        name=name,
        seconds=float(recording.time[-1] - recording.time[0]),
        mean_force=float(recording.groups["tendon_force"].mean()),
        joints=joints,
        score=score_detection(recording.time, label, outputs["contact"]),
    )
