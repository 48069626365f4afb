"""What a calibrated model leaves of a typical stretch of motion, and a push that it finds, as curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.drawing import Curve, Panel, Sheet, line_of
from tendonfmu.report.numbers import rms, rounded, torque_unit

VISIBLE = 0.003  # of the longest recording: shorter alarms are drawn so long


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
        caption="A stretch with a typical error; nothing was tuned on it. What is left is the torque that the finger "
        "reports although nothing touches it.",
    )


def push_sheet(shown: PushShown) -> Sheet:
    """Draw what is felt at a joint while it is pushed, and when contact is reported."""
    factor, unit = torque_unit(float(np.max(np.abs(shown.felt))))
    time, curves = 1e3 * np.asarray(shown.time), [("after", shown.felt)]
    if shown.sensor is not None:
        curves.insert(0, ("measured", shown.sensor))
    panel = Panel(
        title=shown.joint,
        note=f"contact reported after {1e3 * shown.delay:.0f} ms",
        alt=f"Joint {shown.joint}: the torque felt during a push; contact is reported {1e3 * shown.delay:.0f} ms after "
        "its onset.",
        x_label="time from the onset (ms)",
        y_label=f"torque ({unit})",
        size="wide",
        curves=tuple(Curve(style, time, factor * np.asarray(values)) for style, values in curves),
        stripes={"label_stripe": [(0.0, 1e3 * shown.end)]},
        line=1e3 * shown.delay,
    )
    keys = [("after", "torque felt: the torque that the tendons have to hold, less friction")]
    keys += [("measured", "reference sensor")] if shown.sensor is not None else []
    return Sheet(
        section="push",
        name="push",
        title=f"{shown.recording}, at {shown.onset:.1f} s",
        keys=(*keys, ("label_stripe", "pushed, as labelled")),
        panels=[panel],
        caption="The push with the median delay of those that are found. The line is where contact is reported.",
    )


def pushes_sheet(pushes: Sequence[Mapping[str, Any]], alarms: Sequence[Mapping[str, Any]]) -> Sheet:
    """Draw when pushes were found and missed, and false alarms, a row per recording."""
    names = list(dict.fromkeys(each["recording"] for each in pushes))
    kinds = {
        "alarm": ("push, found", [each for each in pushes if each["found"]], "onset_s"),
        "missed": ("push, missed", [each for each in pushes if not each["found"]], "onset_s"),
        "false_alarm": ("alarm without a push", list(alarms), "begin_s"),
    }
    least = VISIBLE * max(each["end_s"] for each in pushes)
    curves, keys = [], []
    for style, (meaning, stretches, begin) in kinds.items():
        for row, name in enumerate(names):
            spans = [
                (each[begin], max(each["end_s"], each[begin] + least))
                for each in stretches
                if each["recording"] == name
            ]
            curves += [Curve(style, *line_of(spans, row))] if spans else []
        keys += [(style, meaning)] if stretches else []
    panel = Panel(
        title="Pushes and false alarms",
        alt="When pushes were found and missed, and when there was an alarm without a push",
        x_label="time (s)",
        y_label="",
        size="wide",
        height=100 + 36 * len(names),
        curves=tuple(curves),
        rows=tuple(names),
        zoom="pushes",
    )
    return Sheet("pushes", "pushes", "All pushes", keys, [panel])
