"""What is wrong with a recording beyond its format: gaps, rates, sensors that stand still.

Every finding is a sentence; which samples it costs is said too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonfmu.model import FingerDescription
from tendonfmu.recordings.recording import Recording

Numbers = NDArray[np.float64]
Runs = list[tuple[int, int]]  # (begin, end) of samples, end excluded

GAP = 10.0  # sample times; a longer step is a gap
SHORTEST_GAP = 0.1  # s; single lost samples do no harm
STUCK = 1.0  # s; a sensor that repeats one value longer, while others say that it should not, is stuck
TURNS = 20.0  # rad; further than a joint of a finger turns
SETTLING = 1.0  # s after a stuck sensor, until the velocity filter has forgotten it
SLOW_RATE, FAST_RATE = 50.0, 5000.0  # samples per second; the model's events need the first, nothing needs the second
_MOVES = {"tendon_position": 2e-4, "joint_position": 0.02, "joint_velocity": 0.05}  # m, rad, rad: should have moved by
_FORCE_SHARE = 0.1  # of a tendon's mean force by which the others change meanwhile
_OF_RANGE = 0.05  # of what it moves in the whole recording


@dataclass(frozen=True)
class StuckSensor:
    """A channel that holds one value from sample begin to sample end (excluded) though it should change.

    group: as in recording.GROUPS. element: from 1.
    """

    group: str
    element: int
    value: float
    begin: int
    end: int

    @property
    def column(self) -> str:
        return f"{self.group}[{self.element}]"


def gaps(time: Numbers) -> list[int]:
    """Indices of the first sample after each gap, or after a jump of the clock."""
    if len(time) < 3:
        return []
    step = np.diff(time)
    return [int(k) + 1 for k in np.flatnonzero(step > max(GAP * float(np.median(step)), SHORTEST_GAP))]


def gap_sentences(recording: Recording) -> Iterator[str]:
    """About each gap, at most three of them."""
    found = gaps(recording.time)
    for k in found[:3]:
        before, after = recording.time[k - 1], recording.time[k]
        yield (
            f"time goes on by {after - before:.4g} s after row {k} ({before:.6g} s): a gap or a jump of the clock; "
            "the parts before and after it are fitted as recordings of their own"
        )
    if len(found) > 3:
        yield f"{len(found) - 3} more gaps; every part is fitted as a recording of its own"


def rate_sentences(recording: Recording, finger: FingerDescription) -> Iterator[str]:
    """About a sample rate that is too low to see friction change sides, or higher than helps."""
    if len(recording) < 3:
        return
    rate = 1 / float(np.median(np.diff(recording.time)))
    if rate < SLOW_RATE:
        yield (
            f"{rate:.3g} samples per second: reversals, sticking and the velocity filter are poorly resolved, and so "
            f"are static friction and Stribeck velocities; expected at least {SLOW_RATE:g}, better 500"
        )
    if rate > FAST_RATE:
        per_sample = (finger.data.get("bias") or {}).get("noise_time") is None
        noise = (
            "; without bias.noise_time the noise counts per sample, so standard errors are too small unless the "
            "sensors' noise is white up to there"
        )
        yield (
            f"{rate:.5g} samples per second: works, but takes {rate / 1000:.2g} times as long as 1000 and tells no more"
            f"{noise if per_sample else ''}; decimating (after a low-pass filter) is better"
        )


def silent_tendons(recording: Recording, finger: FingerDescription) -> Iterator[str]:
    """About tendons whose force is zero throughout."""
    for i in np.flatnonzero(~recording.groups["tendon_force"].any(axis=0)):
        yield (
            f"tendon_force[{i + 1}] ({finger.tendon_names[i]}) is 0 throughout: a tendon without tension or a sensor "
            "without signal; what its friction is cannot be told, its numbers stay as they were"
        )


# --- stuck sensors ----------------------------------------------------------------------------------------------------


def stuck_sensors(recording: Recording, finger: FingerDescription) -> list[StuckSensor]:
    """Channels that repeat one value for more than `STUCK` while the other channels say that they should change."""
    found: list[StuckSensor] = []
    for name, k, runs in _still(recording):
        if name == "tendon_force":
            found += _stuck_force(recording.groups["tendon_force"], k, runs)
            continue
        expected = expected_values(recording, finger, name, k)
        if expected is not None:
            found += _stuck(name, recording.groups[name], k, expected, runs)
    return found


def expected_values(recording: Recording, finger: FingerDescription, group: str, k: int) -> Numbers | None:
    """What a channel should read, up to a constant, by the other channels.

    Parameters
    ----------
    group: `tendon_position`, `joint_position` or `joint_velocity`. Of a velocity: what it does not account for [rad].
    k: element from 0.

    Returns
    -------
    [N] in the unit of the group (of `joint_velocity` rad); None where the other channels do not tell.
    """
    groups = recording.groups
    if group == "tendon_position":
        return _position_by_others(groups, np.asarray(finger.moment_arms, dtype=float), _stretch(recording, finger), k)
    angle = tendon_angles(recording, finger)
    if group == "joint_position":
        return np.asarray(angle[:, k])
    step = np.diff(recording.time, prepend=recording.time[0])
    return np.asarray(groups.get("joint_position", angle)[:, k] - np.cumsum(groups[group][:, k] * step))


def tendon_angles(recording: Recording, finger: FingerDescription) -> Numbers:
    """[N, n] rad: joint angles by tendon positions and forces, R⁺(x0 − f0/k)."""
    position = recording.groups["tendon_position"] - _stretch(recording, finger)
    return np.asarray(position @ np.linalg.pinv(np.asarray(finger.moment_arms, dtype=float)).T)


def _stretch(recording: Recording, finger: FingerDescription) -> Numbers:
    """[N, m] m: of the tendons' springs."""
    stiffness = np.array([float(tendon["stiffness"]) for tendon in finger.data["tendons"]])
    return np.asarray(recording.groups["tendon_force"] / stiffness)


def _still(recording: Recording) -> Iterator[tuple[str, int, Runs]]:
    """Columns (group, element from 0) with their runs of equal values longer than `STUCK`, where there are any."""
    for name, values in recording.groups.items():
        if name == "external_torque":
            continue
        for k in range(values.shape[1]):
            bounds = np.concatenate([[0], np.flatnonzero(np.diff(values[:, k])) + 1, [len(values)]])
            long = recording.time[bounds[1:] - 1] - recording.time[bounds[:-1]] > STUCK
            if long.any():
                yield name, k, list(zip(bounds[:-1][long].tolist(), bounds[1:][long].tolist(), strict=True))


def _position_by_others(groups: Mapping[str, Numbers], arms: Numbers, stretch: Numbers, i: int) -> Numbers | None:
    """[N] m: tendon i's motor position as the other tendons, or the measured joint angles, have it."""
    if "joint_position" in groups:
        return np.asarray(groups["joint_position"] @ arms[i] + stretch[:, i])
    others = np.delete(np.arange(len(arms)), i)
    if np.linalg.matrix_rank(arms[others]) < arms.shape[1]:
        return None
    angle = (groups["tendon_position"] - stretch)[:, others] @ np.linalg.pinv(arms[others]).T
    return np.asarray(angle @ arms[i] + stretch[:, i])


def _stuck(group: str, values: Numbers, k: int, expected: Numbers, runs: Runs) -> Iterator[StuckSensor]:
    """Runs during which the expected values [N] change."""
    enough = max(_MOVES[group], _OF_RANGE * float(np.ptp(expected)))
    for begin, end in runs:
        if np.ptp(expected[begin:end]) > enough:
            yield StuckSensor(group, k + 1, float(values[begin, k]), begin, end)


def _stuck_force(force: Numbers, i: int, runs: Runs) -> Iterator[StuckSensor]:
    """A force that stands still while those of most other tendons change; 0 is a slack tendon or a silent one."""
    others = np.delete(force, i, axis=1)
    size = np.maximum(np.abs(others).mean(axis=0), 1e-9)
    for begin, end in runs:
        if force[begin, i] != 0 and others.shape[1]:
            changes = np.ptp(others[begin:end], axis=0) / size
            if np.median(changes) > _FORCE_SHARE:
                yield StuckSensor("tendon_force", i + 1, float(force[begin, i]), begin, end)
