"""What the figures of compensated recordings show: joint torques and contacts, computed for `plots.py`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.detect import score_detection
from tendonfmu.model import Finger
from tendonfmu.recordings import flagged_stretches

Array = NDArray[Any]
Interval = tuple[float, float]


@dataclass(frozen=True)
class JointCurves:
    """Torques of one joint over time.

    Attributes
    ----------
    name
        Name of the joint.
    measured, predicted, compensated : [N] N·m
    external : [N] N·m
        Reference sensor; None without one.
    """

    name: str
    measured: Array
    predicted: Array
    compensated: Array
    external: Array | None


@dataclass(frozen=True)
class CompensationFigure:
    """What a figure of one compensated recording shows.

    Attributes
    ----------
    title
        Heading.
    time : [N] s
    joints
        Curves of each joint drawn.
    found : (begin, end) s
        Contacts found, without false alarms.
    false : (begin, end) s
        False alarms, as `score_detection` counts them.
    labelled : (begin, end) s
        Contacts as labelled; None without labels.
    """

    title: str
    time: Array
    joints: list[JointCurves]
    found: list[Interval]
    false: list[Interval]
    labelled: list[Interval] | None


@dataclass(frozen=True)
class StoryFigure:
    """What the figure of the demo shows.

    Attributes
    ----------
    title
        Heading.
    free
        Recordings of free motion, one joint each, side by side.
    pushed
        A recording with contact, below them.
    """

    title: str
    free: list[CompensationFigure]
    pushed: CompensationFigure


@dataclass(frozen=True)
class ReferenceCurves:
    """One joint of a recording against its reference sensor.

    Attributes
    ----------
    title
        Name of the recording.
    time : [N] s
    measured, compensated, external : [N] N·m
    """

    title: str
    time: Array
    measured: Array
    compensated: Array
    external: Array


@dataclass(frozen=True)
class ReferenceFigure:
    """Recordings against their reference sensor.

    Attributes
    ----------
    title
        Heading.
    drawn
        The recordings whose curves are drawn.
    names : [r]
        All recordings.
    error, error_without : [r] N·m
        rms error of each, with and without the friction model.
    limit : N·m
        Limit of the error, drawn as a line.
    """

    title: str
    drawn: list[ReferenceCurves]
    names: list[str]
    error: Array
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
    """Compute the curves and contacts of one recording.

    Parameters
    ----------
    description
        The finger.
    recording
        `time` [N]; `external_torque` [N, n] and `contact` [N] if there are labels.
    outputs
        Outputs of `native.Instance.run`, [N, n] and [N].
    title
        Heading.
    joints
        Joints drawn, indices from 0.

    Returns
    -------
    CompensationFigure
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
        found=flagged_stretches(time, found & ~is_false),
        false=flagged_stretches(time, is_false),
        labelled=None if labels is None else flagged_stretches(time, labels),
    )
