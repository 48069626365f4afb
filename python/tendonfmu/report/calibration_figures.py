"""What a calibrated model leaves of a typical stretch of motion, and a push that it finds, as curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.drawing import BLUE, DARK, SAND, VERMILION, Sheet, curve, mark, panel, stripes
from tendonfmu.report.numbers import rms, rounded, torque_unit


@dataclass(frozen=True)
class MotionShown:
    """A stretch of a recording that nothing was chosen on, as both models run over it."""

    recording: str
    time: Numbers  # s [N]
    torque: Numbers  # of the tendons, less a known load, N·m [N, n]
    before: Numbers  # what the model that was given leaves of it, N·m [N, n]
    after: Numbers  # what the calibrated model leaves of it, N·m [N, n]


@dataclass(frozen=True)
class PushShown:
    """A push that is found, at the joint that bears most of it; times from its onset, s."""

    recording: str
    onset: float  # in the recording, s
    joint: str
    end: float
    delay: float
    time: Sequence[float]  # [N]
    felt: Sequence[float]  # the compensated torque, N·m [N]
    sensor: Sequence[float] | None  # that of a reference sensor, N·m [N]


def motion_sheet(shown: MotionShown, joints: list[str], given: str) -> Sheet:
    """Draw for each joint the torque and what each model leaves of it; `given` says what was given."""
    factor, unit = torque_unit(float(np.nanmax(np.abs(shown.torque))))
    panels = []
    for j, joint in enumerate(joints):
        before, after = (rounded(factor * rms(left[:, j])) for left in (shown.before, shown.after))
        panels.append(
            panel(
                joint,
                f"Joint {joint}: torque of the tendons, and what is left of it: {before} {unit} rms with {given}, "
                f"{after} {unit} calibrated.",
                "time (s)",
                f"torque ({unit})",
                curve(shown.time, factor * shown.torque[:, j], "torque of the tendons", DARK, 1.0),
                curve(shown.time, factor * shown.before[:, j], f"left of it with {given}", VERMILION, 1.0, alpha=0.9),
                curve(shown.time, factor * shown.after[:, j], "left of it, calibrated", BLUE, 1.0),
                note=f"left: {before} → {after} {unit} rms",
                size="medium",
                zoom="motion",
            )
        )
    return Sheet(
        "motion",
        "motion",
        f"{shown.recording}, {shown.time[0]:.0f} to {shown.time[-1]:.0f} s",
        panels,
        "A stretch with a typical error; nothing was tuned on it. What is left is the torque that the finger "
        "reports although nothing touches it.",
    )


def push_sheet(shown: PushShown) -> Sheet:
    """Draw what is felt at a joint while it is pushed, and when contact is reported."""
    factor, unit = torque_unit(float(np.max(np.abs(shown.felt))))
    time, delay = 1e3 * np.asarray(shown.time), 1e3 * shown.delay
    felt = "torque felt: the torque that the tendons have to hold, less friction"
    drawn = panel(
        shown.joint,
        f"Joint {shown.joint}: the torque felt during a push; contact is reported {delay:.0f} ms after its onset.",
        "time from the onset (ms)",
        f"torque ({unit})",
        [] if shown.sensor is None else curve(time, factor * np.asarray(shown.sensor), "reference sensor", DARK, 1.0),
        curve(time, factor * np.asarray(shown.felt), felt, BLUE, 1.0),
        stripes([(0.0, 1e3 * shown.end)], "pushed, as labelled", SAND, 0.3),
        mark(delay),
        note=f"contact reported after {delay:.0f} ms",
        size="wide",
    )
    caption = "The push with the median delay of those that are found. The line is where contact is reported."
    return Sheet("push", "push", f"{shown.recording}, at {shown.onset:.1f} s", [drawn], caption)
