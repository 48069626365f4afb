"""Which parts of a well-formed recording are unusable: gaps, unsuitable sample rates and stuck sensors.

Each finding is a sentence that also says which samples are lost.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.files import counted
from tendonfmu.model import Finger
from tendonfmu.recordings.recording import Recording

Runs = list[tuple[int, int]]  # (begin, end) of samples, end excluded

GAP = 10.0  # sample times; a longer step is a gap
SHORTEST_GAP = 0.1  # s; single lost samples do no harm
STUCK = 1.0  # s; a sensor that repeats one value longer, while others say that it should not, is stuck
TURNS = 20.0  # rad; further than a joint of a finger turns
SETTLING = 1.0  # s after a stuck sensor, until the velocity filter has forgotten it
SLOW_RATE, FAST_RATE = 50.0, 5000.0  # samples per second; the model's events need the first, none needs the second
# m, rad, rad; a channel is stuck only if it should have moved by more
_MOVES = {"tendon_position": 2e-4, "joint_position": 0.02, "joint_velocity": 0.05}
_FORCE_SHARE = 0.1  # of a tendon's mean force; a force is stuck only if the others change by more
_OF_RANGE = 0.05  # of the range in the whole recording; a channel is stuck only if it should have moved by more


@dataclass(frozen=True)
class StuckSensor:
    """A channel that holds one value although it should change."""

    group: str  # name of the group, as in `recording.GROUPS`
    element: int  # index in the group, from 1
    value: float  # the value that it holds, in the unit of the group
    begin: int  # first sample, and the one after the last
    end: int

    @property
    def column(self) -> str:
        """Name of the column."""
        return f"{self.group}[{self.element}]"


def gaps(time: Numbers) -> list[int]:
    """Return the first samples after gaps or jumps of the clock."""
    # time: [N] (s)
    if len(time) < 3:
        return []
    step = np.diff(time)
    return [int(k) + 1 for k in np.flatnonzero(step > max(GAP * float(np.median(step)), SHORTEST_GAP))]


def gap_sentences(recording: Recording) -> Iterator[str]:
    """Describe the gaps, at most three of them each."""
    found = gaps(recording.time)
    for k in found[:3]:
        before, after = recording.time[k - 1], recording.time[k]
        yield (
            f"time jumps by {after - before:.4g} s after row {k} ({before:.6g} s): a gap or a jump of the clock; "
            "the parts before and after it are fitted as separate recordings"
        )
    if len(found) > 3:
        yield f"{counted(len(found) - 3, 'more gap')}; every part is fitted as a separate recording"


def rate_sentences(recording: Recording, finger: Finger) -> Iterator[str]:
    """Describe a sample rate that is too low to show reversals of friction, or higher than useful."""
    if len(recording) < 3:
        return
    rate = 1 / float(np.median(np.diff(recording.time)))
    if rate < SLOW_RATE:
        yield (
            f"reversals, sticking and the velocity filter are poorly resolved at {rate:.3g} samples per second, and "
            f"so are static friction and Stribeck velocities; expected at least {SLOW_RATE:g}, better 500"
        )
    if rate > FAST_RATE:
        per_sample = (finger.data.get("bias") or {}).get("noise_time") is None
        noise = (
            "; without bias.noise_time the noise counts per sample, so standard errors are too small unless the "
            "sensors' noise is white up to this rate"
        )
        yield (
            f"{rate:.5g} samples per second take {rate / 1000:.2g} times as long as 1000 and give no better result"
            f"{noise if per_sample else ''}; expected at most {FAST_RATE:g}, by decimating after a low-pass filter"
        )


def silent_tendons(recording: Recording, finger: Finger) -> Iterator[str]:
    """Describe tendons whose force is zero throughout."""
    for i in np.flatnonzero(~recording.groups["tendon_force"].any(axis=0)):
        yield (
            f"tendon_force[{i + 1}] ({finger.tendon_names[i]}) is 0 throughout: a tendon without tension or a sensor "
            "without signal; its friction cannot be estimated and keeps the given numbers"
        )


# --- stuck sensors ----------------------------------------------------------------------------------------------------


def stuck_sensors(recording: Recording, finger: Finger) -> list[StuckSensor]:
    """Find channels that repeat a value for more than `STUCK` while the other channels show that they should change."""
    found: list[StuckSensor] = []
    for name, k, runs in _still(recording):
        if name == "tendon_force":
            found += _stuck_force(recording.groups["tendon_force"], k, runs)
            continue
        expected = expected_values(recording, finger, name, k)
        if expected is not None:
            found += _stuck(name, recording.groups[name], k, expected, runs)
    return found


def expected_values(recording: Recording, finger: Finger, group: str, k: int) -> Numbers | None:
    """Return what a channel should read according to the other channels, up to a constant."""
    # group: (rad); returns [N]
    groups = recording.groups
    if group == "tendon_position":
        return _position_by_others(groups, np.asarray(finger.moment_arms, dtype=float), _stretch(recording, finger), k)
    angle = tendon_angles(recording, finger)
    if group == "joint_position":
        return np.asarray(angle[:, k])
    step = np.diff(recording.time, prepend=recording.time[0])
    return np.asarray(groups.get("joint_position", angle)[:, k] - np.cumsum(groups[group][:, k] * step))


def tendon_angles(recording: Recording, finger: Finger) -> Numbers:
    """Return the joint angles [N, n] (rad) that follow from tendon positions and forces, R⁺(x0 − f0/k)."""
    position = recording.groups["tendon_position"] - _stretch(recording, finger)
    return np.asarray(position @ np.linalg.pinv(np.asarray(finger.moment_arms, dtype=float)).T)


def _stretch(recording: Recording, finger: Finger) -> Numbers:
    """Return the stretch [N, m] (m) of the tendons' springs."""
    stiffness = np.array([float(tendon["stiffness"]) for tendon in finger.data["tendons"]])
    return np.asarray(recording.groups["tendon_force"] / stiffness)


def _still(recording: Recording) -> Iterator[tuple[str, int, Runs]]:
    """Yield columns (group, element from 0) that have runs of equal values longer than `STUCK`, with these runs."""
    for name, values in recording.groups.items():
        if name == "external_torque":
            continue
        for k in range(values.shape[1]):
            bounds = np.concatenate([[0], np.flatnonzero(np.diff(values[:, k])) + 1, [len(values)]])
            long = recording.time[bounds[1:] - 1] - recording.time[bounds[:-1]] > STUCK
            if long.any():
                yield name, k, list(zip(bounds[:-1][long].tolist(), bounds[1:][long].tolist(), strict=True))


def _position_by_others(groups: Mapping[str, Numbers], arms: Numbers, stretch: Numbers, i: int) -> Numbers | None:
    """Return tendon i's motor position [N] (m) that follows from the measured joint angles or the other tendons."""
    if "joint_position" in groups:
        return np.asarray(groups["joint_position"] @ arms[i] + stretch[:, i])
    others = np.delete(np.arange(len(arms)), i)
    if np.linalg.matrix_rank(arms[others]) < arms.shape[1]:
        return None
    angle = (groups["tendon_position"] - stretch)[:, others] @ np.linalg.pinv(arms[others]).T
    return np.asarray(angle @ arms[i] + stretch[:, i])


def _stuck(group: str, values: Numbers, k: int, expected: Numbers, runs: Runs) -> Iterator[StuckSensor]:
    """Yield the runs during which the expected values [N] change."""
    enough = max(_MOVES[group], _OF_RANGE * float(np.ptp(expected)))
    for begin, end in runs:
        if np.ptp(expected[begin:end]) > enough:
            yield StuckSensor(group, k + 1, float(values[begin, k]), begin, end)


def _stuck_force(force: Numbers, i: int, runs: Runs) -> Iterator[StuckSensor]:
    """Yield runs in which a force is constant while most others change. A force of 0 is a slack or silent tendon."""
    others = np.delete(force, i, axis=1)
    size = np.maximum(np.abs(others).mean(axis=0), 1e-9)
    for begin, end in runs:
        if force[begin, i] != 0 and others.shape[1]:
            changes = np.ptp(others[begin:end], axis=0) / size
            if np.median(changes) > _FORCE_SHARE:
                yield StuckSensor("tendon_force", i + 1, float(force[begin, i]), begin, end)
