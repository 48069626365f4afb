"""How the log of a one-joint machine becomes a finger of one bidirectional tendon with a moment arm of 1 m.

Torque is tendon force:

| recording | turning | sliding |
| --- | --- | --- |
| tendon_force[1], N | torque, N.m | force, N |
| tendon_position[1], m; joint_position[1], rad | angle, rad | position, m |
| joint_velocity[1], rad/s | velocity, rad/s | velocity, m/s |
| external_torque[1], N.m | known load, N.m | known load, N |

So a metre of a sliding axis is a radian, a newton is a newton metre, and a kilogram is a kg·m². Where there is a column
of velocity, `velocity_cutoff` filters it. Else it is computed from the angle: central differences, then the filter. It
is a Butterworth filter of 2nd order forwards and backwards, which adds no delay.

The description starts from a straight line that explains the torque: torque − known load = coulomb·sgn(v) + viscous·v +
inertia·a + offset, by least squares over the samples in motion. With a known load there is no row `inertia`: a known
load already contains the torque that accelerates the machine.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.files import are, counted
from tendonfmu.model import DEFAULTS
from tendonfmu.recordings.converters.column_map import ConvertedLog, Joint
from tendonfmu.recordings.faults import value_step
from tendonfmu.recordings.recording import Recording
from tendonfmu.recordings.traps import is_magnitude

CUTOFF = DEFAULTS["velocity_filter_cutoff"]  # Hz
SHARE_OF_RATE = 0.2  # of the sample rate; the cut-off is at most this, since central differences fall off above it
GAP = 10.0  # times the usual step; a longer step interrupts the log, and no filter spans it
LEAST = 20  # samples

STIFFNESS = 1e9  # N/m: the drive is rigid, q = x0
SLOWEST, FASTEST = 1e-3, 0.1  # of the largest speed; below, the joint counts as at rest; the most for noise and filter
WINDOW, QUIET, SIGMAS = 0.25, 0.1, 6.0  # s; share of the windows that are quieter than the noise; of it, that is rest
THRESHOLD = 5.0  # times the residual of the straight line (rms); `tendonfmu tune` finds better thresholds
# of the drive's largest torque, where nothing is measured; geared drives lose some 5 to 30 % in all
COULOMB_SHARE, VISCOUS_SHARE, INERTIA_SHARE, NOISE_SHARE = 0.05, 0.02, 0.01, 0.005
LEAST_SHARE = 1e-3  # of the torque's rms; starting value of a magnitude for which least squares gives less


def joint_columns(file: Path, parts: dict[str, Numbers], joint: Joint) -> tuple[dict[str, Numbers], float, list[str]]:
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
        if joint.velocity_cutoff:
            velocity = _smooth(time, velocity, _cutoff(file, time, joint.velocity_cutoff))
    else:
        cutoff = _cutoff(file, time, joint.velocity_cutoff)
        velocity = central_velocity(time, angle, cutoff)
        filtered = f"then a zero-phase Butterworth filter of {cutoff:g} Hz" if cutoff else "not filtered"
        notes.append(f"{file}: joint_velocity[1] is made of central differences, {filtered}")
    if is_magnitude(torque, angle):
        drives = "torque" if joint.kind == "turning" else "force"
        notes.append(f"{file}: the {drives} is never negative while {joint.name} moves both ways: a magnitude")
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
    if not np.any(velocity):
        raise InputError(f"{file}: the joint does not move; expected a log of motion")
    begin = int(np.argmax(np.abs(velocity) > slowest_motion(time, velocity, angle, cutoff or CUTOFF)))
    if begin:
        notes.append(f"{file}: {counted(begin, 'sample')} at rest before the first motion {are(begin)} left out")
    return {name: values[begin:] for name, values in columns.items()}, cutoff, notes


def central_velocity(time: Numbers, angle: Numbers, cutoff: float) -> Numbers:
    """Return the velocity [N] of angles [N] at times [N]. Gaps of the log divide it."""
    velocity = np.zeros_like(angle)
    for piece in _pieces(time):
        if len(piece) > 1:
            velocity[piece] = np.gradient(angle[piece], time[piece])
    return _smooth(time, velocity, cutoff) if cutoff else velocity


def _smooth(time: Numbers, values: Numbers, cutoff: float) -> Numbers:
    """Filter values [N] without delay between the gaps of the log; pieces too short for it stay."""
    sections = signal.butter(2, cutoff, fs=1.0 / float(np.median(np.diff(time))), output="sos")
    smooth: Numbers = values.copy()
    for piece in _pieces(time):
        if len(piece) >= LEAST:
            smooth[piece] = signal.sosfiltfilt(sections, values[piece])
    return np.asarray(smooth)


def _pieces(time: Numbers) -> list[NDArray[np.intp]]:
    steps = np.diff(time)
    return np.split(np.arange(len(time)), np.flatnonzero(steps > GAP * float(np.median(steps))) + 1)


def _cutoff(file: Path, time: Numbers, wanted: float | None) -> float:
    rate = 1.0 / float(np.median(np.diff(time)))
    if wanted is None:
        return min(CUTOFF, SHARE_OF_RATE * rate)
    if wanted > SHARE_OF_RATE * rate:
        most = f"at most {SHARE_OF_RATE * rate:g} Hz at {rate:g} samples per second, or 0 for none"
        raise InputError(f"{file}: joint.velocity_cutoff = {wanted:g}: expected {most}")
    return wanted


# --- the description --------------------------------------------------------------------------------------------------


def describe_joint(log: ConvertedLog) -> dict[str, Any]:
    """Make the finger description of the machine in a log."""
    joint = log.map.joint
    if joint is None:
        raise InputError(f'{log.map.path}: joint: missing; --finger needs "joint" instead of "columns"')
    return _measured(joint.name, log.columns, log.velocity_cutoff or CUTOFF, 1.0)


def describe_recorded_joint(name: str, recording: Recording, moment_arm: float) -> dict[str, Any]:
    """Make the finger description of a one-joint machine, with starting numbers from its recording."""
    # moment_arm: (m)
    recording.require(1, 1, ())
    groups = {f"{group}[1]": values[:, 0] for group, values in recording.groups.items()}
    torque = moment_arm * groups["tendon_force[1]"]
    angle = groups.get("joint_position[1]", groups["tendon_position[1]"] / moment_arm)
    velocity = groups.get("joint_velocity[1]")
    if velocity is None:
        rate = 1.0 / float(np.median(np.diff(recording.time)))
        velocity = central_velocity(recording.time, angle, min(CUTOFF, SHARE_OF_RATE * rate))
    if not np.abs(velocity).max() > 0.0:
        raise InputError(f"{recording.path}: the joint does not move; expected a recording of motion")
    columns = {"time": recording.time, "tendon_force[1]": torque, "joint_position[1]": angle}
    columns["joint_velocity[1]"] = velocity
    known = groups.get("external_torque[1]")
    if known is not None:
        columns["external_torque[1]"] = known
    return _measured(name, columns, CUTOFF, moment_arm)


def joint_description(
    name: str,
    *,
    torque: float = 1.0,
    speed: float = 5.0,
    coulomb: float | None = None,
    viscous: float | None = None,
    inertia: float = 0.0,
    moment_arm: float = 1.0,
) -> dict[str, Any]:
    """Make the finger description of a one-joint machine from what its data sheet says."""
    # speed: (rad/s); moment_arm: (m)
    numbers = {
        "coulomb": COULOMB_SHARE * torque if coulomb is None else coulomb,
        "viscous": VISCOUS_SHARE * torque / speed if viscous is None else viscous,
        "inertia": inertia or INERTIA_SHARE * torque / speed,
        "offset": 0.0,
        "missed": NOISE_SHARE * torque,
    }
    numbers = {key: float(f"{value:.6g}") for key, value in numbers.items()}
    return _description(name, numbers, SLOWEST * speed, speed / 10, CUTOFF, moment_arm, known=False)


def _measured(name: str, columns: dict[str, Numbers], cutoff: float, moment_arm: float) -> dict[str, Any]:
    """Return the description whose numbers are those of the straight line."""
    velocity = columns["joint_velocity[1]"]
    slowest = slowest_motion(columns["time"], velocity, columns["joint_position[1]"], cutoff)
    numbers = starting_numbers(columns, slowest)
    known = "external_torque[1]" in columns
    return _description(name, numbers, slowest, float(np.abs(velocity).max()) / 10, cutoff, moment_arm, known)


def _description(
    name: str,
    numbers: dict[str, float],
    slowest: float,
    stribeck_velocity: float,
    cutoff: float,
    moment_arm: float,
    known: bool,
) -> dict[str, Any]:
    """Return a description. known: the recordings hold the known load, which includes the torque of inertia."""
    law = {
        "static": numbers["coulomb"],
        "coulomb": numbers["coulomb"],
        "stribeck_velocity": float(f"{stribeck_velocity:.3g}"),
        "viscous": numbers["viscous"],
    }
    inertia = {"effect": "inertia", "joint": 1, "inertia": numbers["inertia"]}
    return {
        "format": "tendonfmu-finger-1",
        "name": name,
        "joints": [{"name": name, "friction": law}],
        "tendons": [{"name": "drive", "bidirectional": True, "stiffness": STIFFNESS, "moment_arms": [moment_arm]}],
        "velocity_threshold": {"tendon": float(f"{slowest * moment_arm:.3g}"), "joint": float(f"{slowest:.3g}")},
        "velocity_filter_cutoff": cutoff,
        # one offset for a recording: a bias that learns would follow the friction that is to be estimated
        "bias": {
            "drift_variance": 0.0,
            "noise_std": numbers["missed"],
            "initial_variance": 0.0,
            "forget_rate": 0.0,
            "initial_torque": [numbers["offset"]],
        },
        "contact": {"threshold": [float(f"{THRESHOLD * numbers['missed']:.4g}")]},
        "extensions": [] if known else [inertia],
    }


def slowest_motion(time: Numbers, velocity: Numbers, angle: Numbers, cutoff: float) -> float:
    """Return the speed (rad/s) below which the joint is at rest: the encoder's step, noise, or the filter's smear."""
    largest = float(np.abs(velocity).max())
    step = max(2 * np.pi * cutoff * value_step(angle), value_step(velocity))
    noise = SIGMAS * _speed_noise(velocity, float(np.median(np.diff(time))))
    smear = SLOWEST * largest * max(1.0, CUTOFF / cutoff) ** 2  # a move of 1 s ends with t², and the filter prolongs it
    return float(f"{max(step, min(max(noise, smear), FASTEST * largest)):.3g}")


def _speed_noise(velocity: Numbers, step: float) -> float:
    """Return the noise of a velocity [N]: what parabolas leave of its quietest windows. step: s."""
    count = min(max(LEAST, round(WINDOW / step)), len(velocity))
    windows = velocity[: len(velocity) // count * count].reshape(-1, count).T
    parabola = np.vander(np.linspace(-1.0, 1.0, count), 3)
    left = windows - parabola @ np.linalg.lstsq(parabola, windows, rcond=None)[0]
    return float(np.quantile(np.sqrt(np.mean(left**2, axis=0)), QUIET))


def starting_numbers(columns: dict[str, Numbers], slowest: float) -> dict[str, float]:
    """Return the numbers of the straight line."""
    velocity = columns["joint_velocity[1]"]
    known = columns.get("external_torque[1]")
    torque = columns["tendon_force[1]"] - (0.0 if known is None else known)
    acceleration = np.gradient(velocity, columns["time"])
    moving = np.abs(velocity) > slowest
    regressors = [np.sign(velocity), velocity, np.ones_like(velocity)] + ([acceleration] if known is None else [])
    matrix = np.column_stack(regressors)[moving]
    # normalised columns: for a motion at one speed, where two columns are equal, this gives the smallest numbers
    sizes = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
    coefficients = np.linalg.lstsq(matrix / sizes, torque[moving], rcond=1e-9)[0] / sizes
    missed = float(np.sqrt(np.mean((torque[moving] - matrix @ coefficients) ** 2)))
    least = LEAST_SHARE * float(np.sqrt(np.mean(torque**2)))
    speed = float(np.sqrt(np.mean(velocity[moving] ** 2)))
    numbers = {
        "coulomb": max(float(coefficients[0]), least),
        "viscous": max(float(coefficients[1]), least / speed),
        "inertia": float(coefficients[3]) if known is None else 0.0,
        "offset": float(coefficients[2]),
        "missed": max(missed, least),
    }
    return {name: float(f"{value:.6g}") for name, value in numbers.items()}
