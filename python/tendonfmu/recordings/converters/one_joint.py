"""How the log of a one-joint machine becomes a finger of one bidirectional tendon with a moment arm of 1 m.

Torque is tendon force:

| recording | turning | sliding |
| --- | --- | --- |
| tendon_force[1], N | torque, N.m | force, N |
| tendon_position[1], m; joint_position[1], rad | angle, rad | position, m |
| joint_velocity[1], rad/s | velocity, rad/s | velocity, m/s |
| external_torque[1], N.m | known load, N.m | known load, N |

So a metre of a sliding axis is a radian, a newton is a newton metre, and a kilogram is a kg·m². If there is no column
of velocity, it is computed from the angle: central differences, then a Butterworth filter of 2nd order forwards and
backwards, which adds no delay.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted
from tendonfmu.model import DEFAULTS
from tendonfmu.recordings.converters.column_map import Joint

Series = NDArray[np.float64]

CUTOFF = DEFAULTS["velocity_filter_cutoff"]  # Hz
SHARE_OF_RATE = 0.2  # of the sample rate; the cut-off is at most this, since central differences fall off above it
GAP = 10.0  # times the usual step; a longer step interrupts the log, and no filter spans it
LEAST = 20  # samples
RESTS = 0.01  # of the largest speed; slower samples before the first motion are a start at rest


def joint_columns(file: Path, parts: dict[str, Series], joint: Joint) -> tuple[dict[str, Series], float, list[str]]:
    """Return the columns of the recording, the cut-off of its velocity in Hz (0: not filtered, or given), and notes."""
    time = parts["time"]
    if len(time) < LEAST:
        raise InputError(f"{file}: {counted(len(time), 'sample')}; expected at least {LEAST} of a one-joint machine")
    torque, angle = (
        parts[word] for word in (("torque", "angle") if joint.kind == "turning" else ("force", "position"))
    )
    notes = []
    if "velocity" in parts:
        velocity, cutoff = parts["velocity"], 0.0
    else:
        cutoff = _cutoff(file, time, joint.velocity_cutoff)
        velocity = central_velocity(time, angle, cutoff)
        filtered = f"then a zero-phase Butterworth filter of {cutoff:g} Hz" if cutoff else "not filtered"
        notes.append(f"{file}: joint_velocity[1] is made of central differences, {filtered}")
    columns = {
        "time": time,
        "tendon_force[1]": torque,
        "tendon_position[1]": angle,
        "joint_position[1]": angle,
        "joint_velocity[1]": velocity,
    }
    if "known_load" in parts:
        columns["external_torque[1]"] = parts["known_load"]
    if "contact" in parts:
        columns["contact"] = parts["contact"]
    begin = first_motion(file, velocity)
    if begin:
        notes.append(f"{file}: {counted(begin, 'sample')} at rest before the first motion {are(begin)} left out")
    return {name: values[begin:] for name, values in columns.items()}, cutoff, notes


def central_velocity(time: Series, angle: Series, cutoff: float) -> Series:
    """Return the velocity [N] of angles [N] at times [N]. Gaps of the log divide it."""
    steps = np.diff(time)
    usual = float(np.median(steps))
    velocity = np.empty_like(angle)
    for piece in np.split(np.arange(len(time)), np.flatnonzero(steps > GAP * usual) + 1):
        if len(piece) < LEAST:
            velocity[piece] = np.gradient(angle[piece], time[piece]) if len(piece) > 1 else 0.0
            continue
        raw = np.gradient(angle[piece], time[piece])
        if cutoff:
            raw = signal.sosfiltfilt(signal.butter(2, cutoff, fs=1.0 / usual, output="sos"), raw)
        velocity[piece] = raw
    return velocity


def first_motion(file: Path, velocity: Series) -> int:
    """Return the number of samples before the first motion."""
    speed = np.abs(velocity)
    if not speed.max() > 0.0:
        raise InputError(f"{file}: the joint does not move; expected a log of motion")
    return int(np.argmax(speed > RESTS * np.quantile(speed, 0.99)))


def _cutoff(file: Path, time: Series, wanted: float | None) -> float:
    rate = 1.0 / float(np.median(np.diff(time)))
    if wanted is None:
        return min(CUTOFF, SHARE_OF_RATE * rate)
    if wanted > SHARE_OF_RATE * rate:
        raise InputError(
            f"{file}: {rate:g} samples per second; joint.velocity_cutoff = {wanted:g}: "
            f"expected at most {SHARE_OF_RATE * rate:g} Hz, or 0 for none"
        )
    return wanted
