"""What a finger leaves of motion that nothing of it was chosen on, as `tendonfmu run` shows it.

The *error* of a calibration is the rms of `compensated_torque`, less a known `external_torque`: what the delivered FMU
feels although nothing touches the finger. Its bias learns as slowly as it was tuned, and stops in contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Flags, Indices, Numbers
from tendonfmu.detect import pretension_of, sample_seconds, stretches
from tendonfmu.fmu import run_model
from tendonfmu.model import finger_from_data
from tendonfmu.recordings import FitRecording, Held, Recording, at_rows, flagged_stretches, held_out_blocks, rms
from tendonfmu.report import MotionShown
from tendonfmu.statistics import intervals

SHOWN = 20.0  # s


def without_held_out(recording: Recording, held: Held) -> Recording:
    """Cut the held-out blocks out of a recording: what is left of it has gaps there."""
    return at_rows(recording, ~held_out_blocks(recording, held))


@dataclass(frozen=True)
class Judged:
    """Recordings, with the samples [N] that no number, structure or threshold was chosen on."""

    recordings: Sequence[FitRecording]
    held_out: bool  # whether these are held-out blocks of the recordings; else all of them

    def masks(self) -> list[Flags]:
        """Return the judged samples [N] of each recording."""
        return [each.held_out if self.held_out else each.tracked for each in self.recordings]

    def minutes(self, chosen: Sequence[Flags]) -> float:
        """Return the time of the chosen samples [N] of each recording (min)."""
        seconds = (sample_seconds(each.time)[own] for each, own in zip(self.recordings, chosen, strict=True))
        return sum(float(own.sum()) for own in seconds) / 60.0


class Delivered:
    """A finger that has run over all judged recordings."""

    def __init__(self, data: Data, judged: Judged) -> None:
        finger = finger_from_data(data, Path("finger.json"))
        self._judged = judged
        self.torque: list[Numbers] = []  # of the tendons, less a known load, N·m [N, n] of each recording
        self.left: list[Numbers] = []  # of it, less friction and bias
        self.contact: list[Flags] = []  # [N]
        for each in judged.recordings:
            outputs = run_model(finger, each.recording, kinematics_source=each.kinematics)
            known = 0.0 if each.external is None else each.external
            self.torque.append(outputs["joint_torque"] - known)
            self.left.append(outputs["compensated_torque"] - known)
            self.contact.append(outputs["contact"].ravel().astype(bool))

    def errors(self, chosen: Sequence[Flags] | None = None) -> list[float]:
        """Return [n] the rms of what is left at the chosen samples [N] of each recording, or at all judged ones."""
        return rms(np.concatenate(self.left), np.concatenate(chosen or self._judged.masks()))

    def alarms(self) -> dict[str, Any]:
        """Count the contacts that begin in judged motion; the rate with its 95 % interval (1/h)."""
        count = 0
        for each, contact, mask in zip(self._judged.recordings, self.contact, self._judged.masks(), strict=True):
            count += int(mask[stretches(each.time, contact)[:, 0]].sum())
        minutes = self._judged.minutes(self._judged.masks())
        rate = intervals.rate(count, minutes / 60.0)
        return {"alarms": count, "minutes": minutes, "interval": [rate.low, rate.high]}


def compared(before: Delivered, after: Delivered, judged: Judged, name: str) -> dict[str, Any]:
    """Report the errors of the model before, which has a name, and of the calibrated one, also by pretension."""
    return {
        "held_out": judged.held_out,
        "minutes": judged.minutes(judged.masks()),
        name: before.errors(),
        "calibrated": after.errors(),
        "pretensions": [
            {
                "mean_force": force,
                "minutes": judged.minutes(chosen),
                name: before.errors(chosen),
                "calibrated": after.errors(chosen),
            }
            for force, chosen in _by_pretension(judged)
        ],
    }


def _by_pretension(judged: Judged) -> list[tuple[float, list[Flags]]]:
    """Return the mean force (N) of each pretension, rising, and its judged samples [N] of each recording."""
    masks = judged.masks()
    force = [np.abs(each.recording.groups["tendon_force"]).mean(axis=1) for each in judged.recordings]
    times = [each.time - each.time[0] for each in judged.recordings]
    chosen = np.concatenate(masks)
    all_force = np.concatenate(force)
    if not chosen.any():
        return []
    owners = np.repeat(np.arange(len(times)), [len(time) for time in times])
    label: Indices = np.full(len(chosen), -1)
    label[chosen] = pretension_of(all_force[chosen], np.concatenate(times)[chosen], owners[chosen])
    ends = np.cumsum([len(mask) for mask in masks])[:-1]
    return [
        (float(all_force[label == group].mean()), np.split(label == group, ends)) for group in range(label.max() + 1)
    ]


def typical_motion(before: Delivered, after: Delivered, judged: Judged) -> MotionShown:
    """Return a judged stretch whose error with the second model is the median."""
    listed: list[tuple[float, float, int, Flags]] = []
    for k, (each, mask) in enumerate(zip(judged.recordings, judged.masks(), strict=True)):
        time = each.time
        for first, end in flagged_stretches(time, mask if mask.any() else each.tracked):
            for begin in np.arange(first, end, SHOWN):
                rows = (time >= begin) & (time <= min(end, begin + SHOWN))
                listed.append((min(end - begin, SHOWN), float(np.mean(after.left[k][rows] ** 2)), k, rows))
    least = 0.5 * max(length for length, *_ in listed)
    long = sorted((stretch for stretch in listed if stretch[0] >= least), key=lambda stretch: stretch[1])
    _, _, k, rows = long[len(long) // 2]
    own = judged.recordings[k]
    return MotionShown(own.path.name, own.time[rows], after.torque[k][rows], before.left[k][rows], after.left[k][rows])
