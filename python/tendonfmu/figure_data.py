"""What the figures of compensated recordings show, computed for `plots.py`: joint torques, thresholds, contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.description import FingerDescription

Array = NDArray[Any]
Interval = tuple[float, float]


@dataclass(frozen=True)
class JointCurves:
    """Curves of one joint, [N] N·m each; external: reference sensor, None without one."""

    name: str
    measured: Array
    predicted: Array
    compensated: Array
    threshold: Array
    external: Array | None


@dataclass(frozen=True)
class CompensationFigure:
    """One recording. time: [N] s. Intervals (begin, end) in s: contact found where a label says so, contact found
    where none does, and contact as labelled, which is None without labels.
    """

    title: str
    time: Array
    joints: list[JointCurves]
    found: list[Interval]
    unlabelled: list[Interval]
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

    recording: `time` [N], `tendon_force` [N, m], maybe `external_torque` [N, n] and `contact` [N].
    outputs: those of `native.Finger.run`, [N, n] and [N].
    """
    thresholds = contact_thresholds(description, recording["tendon_force"])
    time = recording["time"]
    labels, external = recording.get("contact"), recording.get("external_torque")
    found = outputs["contact"].ravel().astype(bool)
    pushed = np.zeros_like(found) if labels is None else labels.astype(bool)
    return CompensationFigure(
        title=title,
        time=time,
        joints=[
            JointCurves(
                name=description.joint_names[j],
                measured=outputs["joint_torque"][:, j],
                predicted=outputs["friction_torque"][:, j],
                compensated=outputs["compensated_torque"][:, j],
                threshold=thresholds[:, j],
                external=None if external is None else external[:, j],
            )
            for j in joints
        ],
        found=intervals(time, found & pushed),
        unlabelled=intervals(time, found & ~pushed),
        labelled=None if labels is None else intervals(time, labels),
    )


def contact_thresholds(description: FingerDescription, tendon_force: Array) -> Array:
    """[N, n] N·m: threshold + threshold_per_force·mean|f0| (contract section 5, step 5) of every sample."""
    contact = description.data["contact"]
    n = len(contact["threshold"])
    per_force = [value or 0.0 for value in contact.get("threshold_per_force") or [0.0] * n]
    mean_force = np.abs(tendon_force).mean(axis=1)
    return np.asarray(np.array(contact["threshold"]) + mean_force[:, None] * np.array(per_force))


def intervals(time: Array, flags: Array) -> list[Interval]:
    """Begin and end (s) of each stretch of samples whose flag is set; a stretch lasts until the next sample."""
    steps = np.diff(np.concatenate([[0], np.asarray(flags).astype(bool).astype(int), [0]]))
    begins, ends = np.flatnonzero(steps > 0), np.minimum(np.flatnonzero(steps < 0), len(time) - 1)
    return [(float(time[a]), float(time[b])) for a, b in zip(begins, ends, strict=True)]
