"""What the figures of compensated recordings show, computed for `plots.py`: joint torques and contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.detect import score_detection
from tendonfmu.model import FingerDescription

Array = NDArray[Any]
Interval = tuple[float, float]


@dataclass(frozen=True)
class JointCurves:
    """Curves of one joint, [N] N·m each; external: reference sensor, None without one."""

    name: str
    measured: Array
    predicted: Array
    compensated: Array
    external: Array | None


@dataclass(frozen=True)
class CompensationFigure:
    """One recording. time: [N] s. Intervals (begin, end) in s: contact found, but for false alarms; false alarms, as
    `score_detection` counts them; and contact as labelled, which is None without labels.
    """

    title: str
    time: Array
    joints: list[JointCurves]
    found: list[Interval]
    false: list[Interval]
    labelled: list[Interval] | None


@dataclass(frozen=True)
class StoryFigure:
    """free: recordings of free motion, one joint each, side by side. pushed: one with contact, below them."""

    title: str
    free: list[CompensationFigure]
    pushed: CompensationFigure


@dataclass(frozen=True)
class ReferenceCurves:
    """One recording against its reference sensor. time: [N] s; the rest: [N] N·m, of one joint."""

    title: str
    time: Array
    measured: Array
    compensated: Array
    external: Array


@dataclass(frozen=True)
class ReferenceFigure:
    """Recordings drawn, and the rms error (N·m) of all of them: names [r], with and without the friction model [r]."""

    title: str
    drawn: list[ReferenceCurves]
    names: list[str]
    error: Array
    error_without: Array
    limit: float


def compensation_figure(
    description: FingerDescription,
    recording: Mapping[str, Array],
    outputs: Mapping[str, Array],
    *,
    title: str,
    joints: Sequence[int],
) -> CompensationFigure:
    """Curves of some joints (indices from 0) of one recording.

    recording: `time` [N], maybe `external_torque` [N, n] and `contact` [N].
    outputs: those of `native.Finger.run`, [N, n] and [N].
    """
    time = recording["time"]
    labels, external = recording.get("contact"), recording.get("external_torque")
    found = outputs["contact"].ravel().astype(bool)
    alarms = score_detection(time, np.zeros_like(found) if labels is None else labels.astype(bool), found).false_alarms
    is_false = np.any([(time >= begin) & (time <= end) for begin, end in alarms] or [np.zeros_like(found)], axis=0)
    return CompensationFigure(
        title=title,
        time=time,
        joints=[
            JointCurves(
                name=description.joint_names[j],
                measured=outputs["joint_torque"][:, j],
                predicted=outputs["friction_torque"][:, j],
                compensated=outputs["compensated_torque"][:, j],
                external=None if external is None else external[:, j],
            )
            for j in joints
        ],
        found=intervals(time, found & ~is_false),
        false=intervals(time, is_false),
        labelled=None if labels is None else intervals(time, labels),
    )


def intervals(time: Array, flags: Array) -> list[Interval]:
    """Begin and end (s) of each stretch of samples whose flag is set; a stretch lasts until the next sample."""
    steps = np.diff(np.concatenate([[0], np.asarray(flags).astype(bool).astype(int), [0]]))
    begins, ends = np.flatnonzero(steps > 0), np.minimum(np.flatnonzero(steps < 0), len(time) - 1)
    return [(float(time[a]), float(time[b])) for a, b in zip(begins, ends, strict=True)]
