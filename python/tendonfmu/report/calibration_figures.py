"""What a calibrated model leaves of a typical stretch of motion, as curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.drawing import Curve, Panel, Sheet
from tendonfmu.report.numbers import rms, rounded, torque_unit


@dataclass(frozen=True)
class MotionShown:
    """A stretch of a recording that no number was fitted to."""

    recording: str
    time: Numbers  # s [N]
    torque: Numbers  # of the tendons, less a known load, N·m [N, n]
    before: Numbers  # what the model that was given leaves of it, before the bias sees the sample, N·m [N, n]
    after: Numbers  # what the calibrated model leaves, N·m [N, n]


def motion_sheet(shown: MotionShown, joints: list[str], given: str) -> Sheet:
    """Draw for each joint the torque and what each model leaves of it; `given` says what was given."""
    factor, unit = torque_unit(float(np.nanmax(np.abs(shown.torque))))
    panels = []
    for j, joint in enumerate(joints):
        before, after = (rounded(factor * rms(left[:, j])) for left in (shown.before, shown.after))
        curves = (("measured", shown.torque), ("before", shown.before), ("after", shown.after))
        panels.append(
            Panel(
                title=joint,
                note=f"left: {before} → {after} {unit} rms",
                alt=f"Joint {joint}: torque of the tendons, and what is left of it: {before} {unit} rms with {given}, "
                f"{after} {unit} calibrated.",
                x_label="time (s)",
                y_label=f"torque ({unit})",
                size="medium",
                curves=tuple(Curve(style, shown.time, factor * values[:, j]) for style, values in curves),
                zoom="motion",
            )
        )
    return Sheet(
        section="motion",
        name="motion",
        title=f"{shown.recording}, {shown.time[0]:.0f} to {shown.time[-1]:.0f} s",
        keys=(
            ("measured", "torque of the tendons"),
            ("before", f"left of it with {given}"),
            ("after", "left of it, calibrated"),
        ),
        panels=panels,
        caption="A stretch with a typical error, which no number was fitted to. What is left is what the finger would "
        "feel although nothing touches it.",
    )
