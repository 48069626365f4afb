"""Which single channels of a recording are faulty: its clock, and sensors that clip, hold a value or are coarse.

This module does not use a friction model. The values that a channel is compared with come from the other channels.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.model import Finger
from tendonfmu.recordings.faults import StuckSensor, expected_values, gaps, stuck_sensors
from tendonfmu.recordings.recording import Recording
from tendonfmu.recordings.signal_noise import value_step

# --- the clock
SLOWEST, FASTEST = 5.0, 1e5  # samples per second; nothing controls or records a finger at a rate outside these
USUAL = (20.0, 2e4)  # samples per second
CLOCK_UNITS = ((1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))
FEWEST_STEPS = 20
LOST = 1.5  # median steps; in a longer step samples were lost
WHOLE = 0.25  # median steps; the step over lost samples is this near to a whole number of median steps
LOST_SHARE = 2e-3  # of the samples; fewer do no harm
JITTER = 0.1  # of the median step, standard deviation; velocities are wrong by the same share

# --- channels
CLIPPED_RUN = 5  # samples that repeat the extreme value
CLIPPED_SHARE = 1e-3  # of the samples; fewer do no harm
APPROACH = 10  # samples before and after a run over which the approach is measured
SMOOTH_TURN = 12.0  # resolutions; a smooth signal approaches its turning point by less (8 over the time it rests there)
RESOLUTION = 2e-4  # of the range; the resolution of a channel is assumed to be no finer
CERTAIN = 4.0  # standard deviations
LEVELS = 40  # a channel with fewer steps in the range of its motion is coarse
COARSE = {"tendon_force": 0.05, "tendon_position": 2e-5, "joint_position": 2e-3}  # N, m, rad; finer ones are not coarse


@dataclass(frozen=True)
class Clock:
    """The time steps of a recording."""

    step: float  # median step (s)
    # factor to seconds and name of the unit in which the times seem to be given, or None
    unit: tuple[float, str] | None
    senseless: bool  # whether no control loop has such a sample rate
    lost: int  # number of missing samples
    gaps: tuple[int, ...]  # indices of the first sample after each gap
    jitter: float  # standard deviation of the other steps over the median step


@dataclass(frozen=True)
class Clipped:
    """A channel that repeats its largest or smallest value and reaches it at speed."""

    column: str  # name of the column
    value: float  # the repeated value, in the unit of the column
    share: float  # share of the samples that have it
    runs: int  # number of times that the channel reaches it
    is_top: bool  # whether it is the largest value, not the smallest


@dataclass(frozen=True)
class Coarse:
    """A channel whose steps are coarse compared with its motion."""

    column: str  # name of the column
    step: float  # width of its steps, in its unit
    range: float  # range of its values, in its unit


@dataclass(frozen=True)
class Held:
    """A channel that holds a value although other channels show that it should change."""

    column: str  # name of the column
    value: float  # the value that it holds
    share: float  # share of the samples in which it does
    first: tuple[float, float]  # begin and end of the first such time (s)


def read_clock(time: Numbers) -> Clock | None:
    """Return the time steps of a recording, or None for too few samples."""
    if len(time) <= FEWEST_STEPS:
        return None
    steps = np.diff(time)
    median = float(np.median(steps))
    rate = 1.0 / median
    senseless = rate <= SLOWEST * (1 + 1e-6) or rate > FASTEST
    units = [unit for unit in CLOCK_UNITS if USUAL[0] <= rate / unit[0] <= USUAL[1]] if senseless else []
    long = gaps(time * (units[0][0] if units else 1.0))
    short = np.delete(steps, np.asarray(long, dtype=int) - 1) / median
    whole = np.round(short)
    usual = 1.4826 * float(np.median(np.abs(short - 1.0)))  # standard deviation, not affected by lost samples
    is_lost = (short > max(LOST, 1.0 + CERTAIN * usual)) & (np.abs(short - whole) < WHOLE)
    return Clock(
        step=median,
        unit=units[0] if units else None,
        senseless=senseless,
        lost=int((whole[is_lost] - 1).sum()),
        gaps=tuple(long),
        jitter=float(np.std(short[~is_lost])),
    )


def clipped_channels(recording: Recording, finger: Finger) -> Iterator[Clipped]:
    """Find forces, positions and angles that saturate."""
    for name in COARSE:
        for k, column in enumerate(recording.groups.get(name, np.empty((0, 0))).T):
            for is_top in (True, False):
                sign = 1.0 if is_top else -1.0
                runs = _clipped_runs(sign * column)
                expected = expected_values(recording, finger, name, k) if runs and name != "tendon_force" else None
                if expected is not None:
                    runs = [run for run in runs if _bulges(sign * expected, run, _resolution(column))]
                share = sum(end - begin for begin, end in runs) / len(column)
                value = float(column.max() if is_top else column.min())
                if share > CLIPPED_SHARE and not (name == "tendon_force" and value == 0.0):
                    yield Clipped(f"{name}[{k + 1}]", value, share, len(runs), is_top)


def _clipped_runs(column: Numbers) -> list[tuple[int, int]]:
    """Return the runs (begin, end) at the largest value that the channel approaches at speed."""
    largest, extent = float(column.max()), float(np.ptp(column))
    at = np.flatnonzero(column == largest)
    if len(at) < CLIPPED_RUN or extent == 0.0:
        return []
    resolution = _resolution(column)
    pieces = np.split(at, np.flatnonzero(np.diff(at) > 3) + 1)
    runs = [(int(piece[0]), int(piece[-1]) + 1) for piece in pieces if len(piece) >= CLIPPED_RUN]
    kept = []
    for begin, end in runs:
        reach = min(APPROACH, end - begin)
        sides = [column[max(begin - reach, 0) : begin], column[end : end + reach]]
        falls = [largest - float(side.min()) for side in sides if len(side)]
        if falls and max(falls) > SMOOTH_TURN * resolution:
            kept.append((begin, end))
    return kept


def _resolution(column: Numbers) -> float:
    return max(value_step(column), RESOLUTION * float(np.ptp(column)))


def _bulges(expected: Numbers, run: tuple[int, int], resolution: float) -> bool:
    """Return whether the other channels show that the channel rises and falls within a run, by more than noise."""
    inside = expected[run[0] : run[1]]
    eighth = len(inside) // 8
    if not eighth:
        return False
    ends = np.concatenate([inside[:eighth], inside[-eighth:]])
    middle = inside[2 * eighth : -2 * eighth]
    noise = float(np.median(np.abs(np.diff(expected)))) * np.sqrt(1.0 / len(ends) + 1.0 / len(middle))
    return bool(middle.mean() - ends.mean() > CERTAIN * noise + resolution)


def coarse_channels(recording: Recording) -> Iterator[Coarse]:
    """Find channels that move in few steps."""
    for name, finest in COARSE.items():
        for k, column in enumerate(recording.groups.get(name, np.empty((0, 0))).T):
            step, extent = value_step(column), float(np.ptp(column))
            if step > finest and extent < LEVELS * step:
                yield Coarse(f"{name}[{k + 1}]", step, extent)


def held_channels(recording: Recording, finger: Finger) -> list[Held]:
    """Find channels that hold a value while others change."""
    # These are stuck sensors, and channels that never change while most of their group do.
    by_column: dict[str, list[StuckSensor]] = {}
    for sensor in stuck_sensors(recording, finger):
        by_column.setdefault(sensor.column, []).append(sensor)
    found = [_held(recording.time, column, sensors) for column, sensors in by_column.items()]
    for name in COARSE:
        values = recording.groups.get(name, np.empty((1, 0)))
        still = np.ptp(values, axis=0) == 0.0
        moving = np.ptp(values, axis=0) > COARSE[name] * LEVELS
        for k in np.flatnonzero(still):
            column = f"{name}[{k + 1}]"
            if moving.sum() > still.sum() and column not in by_column:
                span = (float(recording.time[0]), float(recording.time[-1]))
                found.append(Held(column, float(values[0, k]), 1.0, span))
    return found


def _held(time: Numbers, column: str, sensors: list[StuckSensor]) -> Held:
    share = sum(sensor.end - sensor.begin for sensor in sensors) / len(time)
    first = sensors[0]
    return Held(column, first.value, share, (float(time[first.begin]), float(time[first.end - 1])))
