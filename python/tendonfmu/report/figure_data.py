"""What the figures of compensated recordings show: joint torques and contacts, computed for `plots.py`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Array
from tendonfmu.detect import score_detection
from tendonfmu.model import Finger
from tendonfmu.recordings import flagged_stretches

Interval = tuple[float, float]


@dataclass(frozen=True)
class JointCurves:
    """Torques of one joint over time."""

    name: str  # name of the joint
    measured: Array  #
    predicted: Array
    compensated: Array
    external: Array | None


@dataclass(frozen=True)
class CompensationFigure:
    """What a figure of one compensated recording shows."""

    title: str  # heading
    time: Array
    joints: list[JointCurves]  # curves of each joint drawn
    found: list[Interval]
    false: list[Interval]
    labelled: list[Interval] | None


@dataclass(frozen=True)
class StoryFigure:
    """What the figure of the demo shows."""

    title: str  # heading
    free: list[CompensationFigure]  # recordings of free motion, one joint each, side by side
    pushed: CompensationFigure  # A recording with contact, below them


@dataclass(frozen=True)
class ReferenceCurves:
    """One joint of a recording against its reference sensor."""

    title: str  # name of the recording
    time: Array
    measured: Array  #
    compensated: Array
    external: Array


@dataclass(frozen=True)
class ReferenceFigure:
    """Recordings against their reference sensor."""

    title: str  # heading
    drawn: list[ReferenceCurves]  # the recordings whose curves are drawn
    names: list[str]
    error: Array  # rms error of each, with and without the friction model
    error_without: Array
    limit: float


def compensation_figure(
    description: Finger,
    recording: Mapping[str, Array],
    outputs: Mapping[str, Array],
    *,
    title: str,
    joints: Sequence[int],
) -> CompensationFigure:
    """Compute the curves and contacts of one recording."""
    # recording: [N]; outputs: [N, n]
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
        found=flagged_stretches(time, found & ~is_false),
        false=flagged_stretches(time, is_false),
        labelled=None if labels is None else flagged_stretches(time, labels),
    )
