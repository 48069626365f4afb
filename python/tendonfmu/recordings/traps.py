"""Traps of real logs that show in the channels alone: magnitudes, unsigned numbers, filled gaps, slow sensors, units.

Nothing here uses a friction model. A trap is reported once for each column, or for all that have it at the same time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonfmu.arrays import Numbers, flagged_rows
from tendonfmu.model import Finding, Finger
from tendonfmu.recordings.counters import finest, wrap_of
from tendonfmu.recordings.faults import tendon_angles
from tendonfmu.recordings.kinematics import UNITS
from tendonfmu.recordings.recording import Recording
from tendonfmu.recordings.routing import Learned

NEAR_ZERO, TOUCHES = 0.02, 0.005  # of the largest value, and of the samples that are so small
AT_ZERO = 0.005  # of the largest value: the smallest
RESTS = 0.1  # of the samples at exactly 0
ALIKE = 1.0 / 3.0  # of the mean force in the other direction
BOTH_WAYS = 0.25  # of a joint's range, that it travels in each direction
MADE_UP = 0.5  # of the samples; more straight lines are signals that are made up
STRAIGHT, LONGEST_STRAIGHT = 1e-6, 0.1  # of the range, second differences of a line; s
FEWEST = 8  # samples of a line
FINEST = 0.05  # of the steps of a sensor: its resolution, or slow motion
FAST, REPEATED = 5.0, 0.04  # steps of the sensor, of a motion that no repeat belongs in; of its samples
REGULAR, FEWEST_CHANGES, LONG = 0.9, 50, 1000  # of the changes; changes that are needed; samples of a rest
WINDOWS = 24  # over which units are compared
OFF = 0.25  # of the logarithm of a unit, by which the change of scale differs from it
STEADY = 0.25  # of the change, by which a part may vary
RESTING, TINY = 1e-6, 1e-30  # of the fastest part: less is rest
FAR, NEIGHBOURS = 3.0, 20  # largest steps among so many samples before and after, beyond which a value jumps
ROUNDING = 0.01  # of a value, by the digits of a log


@dataclass(frozen=True)
class Trap:
    """What is wrong with columns."""

    kind: str  # "magnitude", "wrapped", "filled", "slow", "repeated" or "switched"
    columns: tuple[str, ...]
    size: float  # steps of a word, s of a line, samples between changes, % of the samples, factor of the unit
    at: float = 0.0  # s, where it begins
    what: str = ""  # the joint, or the unit


def find_traps(finger: Finger, recording: Recording) -> Iterator[Trap]:
    """Find the traps of a recording. They are of `recording`, before any correction."""
    yield from _magnitudes(finger, recording)
    groups = {name: recording.groups[name] for name in UNITS if name in recording.groups}
    for name, values in groups.items():
        for k, column in enumerate(values.T):
            if (word := wrap_of(column, name.endswith("position"))) is not None:
                yield Trap("wrapped", (f"{name}[{k + 1}]",), word / (finest(column) or 1.0))
    yield from _filled(recording.time, groups)
    yield from _slow(recording.time, groups)
    yield from _switched(recording.time, groups)


def is_magnitude(force: Numbers, angle: Numbers) -> bool:
    """Return whether a force [N] comes to 0 fast, and turns back there, although the joint [N] moves both ways."""
    if len(force) < FEWEST or not force.any():
        return False
    step, extent = np.diff(angle), float(np.ptp(angle))
    ways = step[step > 0.0].sum(), -step[step < 0.0].sum()
    small, change = force[1:] <= NEAR_ZERO * force.max(), np.abs(np.diff(force))
    if not 0.0 <= force.min() <= AT_ZERO * force.max() or small.mean() < TOUCHES:
        return False
    # a force that only comes near 0 turns slowly; one that rests at 0 for long, and is never below, has lost its sign
    rests = bool((force == 0.0).mean() > RESTS)
    is_fast = rests or np.median(change[small]) >= 0.5 * np.median(change)
    if not (is_fast and extent > 0.0 and min(ways) > BOTH_WAYS * extent):
        return False
    # under a load that friction nearly balances one way, a force with its sign comes near 0 that way only
    pulls = [float(force[1:][way].mean()) for way in (step > 0.0, step < 0.0)]
    return rests or min(pulls) > ALIKE * max(pulls)


def _magnitudes(finger: Finger, recording: Recording) -> Iterator[Trap]:
    angle = recording.groups.get("joint_position")
    angle = tendon_angles(recording, finger) if angle is None else angle
    for i, tendon in enumerate(finger.data["tendons"]):
        joint = int(np.argmax(np.abs(tendon["moment_arms"])))
        force = recording.groups["tendon_force"][:, i]
        if tendon.get("bidirectional") and is_magnitude(force, angle[:, joint]):
            yield Trap("magnitude", (f"tendon_force[{i + 1}]",), 0.0, what=finger.joint_names[joint])


def _filled(time: Numbers, groups: Mapping[str, Numbers]) -> Iterator[Trap]:
    """Yield the longest time in which all channels that change are straight lines."""
    columns = np.column_stack(list(groups.values()))
    columns = columns[:, np.ptp(columns, axis=0) > 0.0]
    if len(columns) < 4 * FEWEST or not columns.shape[1]:
        return
    bend = np.abs(np.diff(columns, 2, axis=0)) / np.ptp(columns, axis=0)
    moving = np.abs(np.diff(columns, axis=0))[1:].any(axis=1)
    line = np.asarray((bend < STRAIGHT).all(axis=1) & moving)
    if line.mean() > MADE_UP:
        return
    begin, end = max(flagged_rows(line), key=lambda run: run[1] - run[0], default=(0, 0))
    if end - begin >= FEWEST and time[end] - time[begin] > LONGEST_STRAIGHT:
        yield Trap("filled", tuple(groups), float(time[end + 1] - time[begin]), float(time[begin]))


def _slow(time: Numbers, groups: Mapping[str, Numbers]) -> Iterator[Trap]:
    """Yield the groups whose columns change at every so-many-th sample only, as of a slower sensor."""
    for name, values in groups.items():
        between = [found for column in values.T if (found := _between_changes(column)) is not None]
        if len(between) == values.shape[1]:
            yield Trap("slow", (name,), float(np.median(between)), what=f"{1.0 / np.median(np.diff(time)):.4g}")
        elif name.endswith("position") and (share := _repeats(values)) > REPEATED:
            yield Trap("repeated", (name,), 100.0 * share)


def _repeats(values: Numbers) -> float:
    """Return the share of samples that repeat the one before in the middle of a fast motion, in all columns [N, k]."""
    step = np.abs(np.diff(values, axis=0))
    if len(step) < 3 * FEWEST or not step.any():
        return 0.0
    # encoders repeat a value while they move by less than a step; rounding may have made the steps unequal
    finest = np.array([np.quantile(of[of > 0.0], FINEST) if of.any() else 0.0 for of in step.T])
    moves = np.asarray(step.any(axis=1))
    fast = np.asarray((step > FAST * finest).any(axis=1)) & moves
    between = ~moves[1:-1] & fast[:-2] & fast[2:]
    return float(between.sum() / max(fast.sum(), FEWEST_CHANGES))


def _between_changes(column: Numbers) -> float | None:
    """Return the samples between two changes if they are the same throughout, or next to each other, else None."""
    apart = np.diff(np.flatnonzero(np.diff(column)))
    if len(apart) < FEWEST_CHANGES:
        return None
    counts = np.bincount(apart[apart < LONG], minlength=2)
    usual = max(int(np.argmax(counts)), 1)
    pair = max((counts[usual : usual + 2].sum(), usual), (counts[usual - 1 : usual + 1].sum(), usual - 1))
    is_even = usual > 1 and bool((apart % usual == 0).mean() > REGULAR)
    if is_even:
        return float(usual)
    return float(apart[apart <= pair[1] + 1].mean()) if pair[1] > 1 and pair[0] > REGULAR * len(apart) else None


def _switched(time: Numbers, groups: Mapping[str, Numbers]) -> Iterator[Trap]:
    """Yield columns that move, from some time on, by the factor of a unit more or less, and no other group does."""
    parts = np.array_split(np.arange(len(time) - 1), WINDOWS)
    if len(time) < WINDOWS * 3 * FEWEST:
        return
    sizes = {}
    for name, values in groups.items():
        step = np.diff(values.astype(np.float64), axis=0)
        size = np.array([np.sqrt((step[part] ** 2).mean(axis=0)) for part in parts])
        sizes[name] = np.log(np.maximum(size, RESTING * size.max(axis=0) + TINY))
    for name, size in sizes.items():
        for k in range(size.shape[1]):
            others = np.column_stack([each for other, each in sizes.items() if other != name] or [size * 0.0])
            relative = size[:, k] - np.median(others - others.mean(axis=0), axis=1)
            split = min(
                range(3, WINDOWS - 2), key=lambda at: relative[:at].var() * at + relative[at:].var() * (WINDOWS - at)
            )
            change = float(np.median(relative[split:]) - np.median(relative[:split]))
            spread = max(relative[: split - 1].std(), relative[split + 1 :].std())
            near = slice(max(parts[split][0] - len(parts[0]), 0), parts[split][-1] + len(parts[0]))
            begin = float(time[parts[split][0]])
            for factor, unit in UNITS[name] if spread < STEADY * abs(change) else ():
                turned = factor if (change > 0.0) == (factor > 1.0) else 1.0 / factor
                is_near = abs(change / np.log(turned) - 1.0) < OFF
                if is_near and _jumps_by(groups[name][near, k], turned):
                    yield Trap("switched", (f"{name}[{k + 1}]",), float(np.exp(change)), begin, unit)
                    break


def _jumps_by(column: Numbers, factor: float) -> bool:
    """Return whether a value is followed by so many times itself, within a step, and by what no step reaches."""
    before, after = column[:-1], column[1:]
    for k in np.flatnonzero(np.abs(after - factor * before) < np.abs(after - before) / FAR):
        near = column[max(k - NEIGHBOURS, 0) : k + 1], column[k + 1 : k + 2 + NEIGHBOURS]
        step = max(float(np.abs(np.diff(side)).max(initial=0.0)) for side in near)
        if (
            abs(after[k] - factor * before[k]) <= step + ROUNDING * abs(after[k])
            and step < abs(after[k] - before[k]) / FAR
        ):
            return True
    return False


# --- in words ---------------------------------------------------------------------------------------------------------


# what is seen, its probable cause, what to write: of `traps.Trap`, by kind
_TRAPS = {
    "magnitude": (
        "error",
        "never negative while {what} moves both ways: a magnitude",
        "a current or load without its sign",
        "log the signed number; friction cannot be learned from a magnitude",
    ),
    "wrapped": (
        "error",
        "jumps by {size:.0f} steps",
        "signed numbers stored as unsigned, an encoder of many turns, or a counter that overflows",
        'write into the map of columns, at this column: "wrap": {size:.0f} if its unit is a step',
    ),
    "filled": (
        "warning",
        "straight lines in all channels for {size:.3g} s from {at:.4g} s",
        "a gap that was filled by interpolation",
        "cut this time out, or leave the gap in the log",
    ),
    "slow": (
        "warning",
        "changes only once in {size:.3g} samples, of {what} a second",
        "a log resampled from a slower sensor",
        "log at the sensor's own rate, or let convert table interpolate with the sensor's own time",
    ),
    "repeated": (
        "warning",
        "{size:.2g} % of the samples repeat the one before in the middle of a motion",
        "written by another clock than the sensor's: velocities jump there",
        "log each sample with the sensor's own time, or smooth the velocity (velocity_cutoff)",
    ),
    "switched": (
        "error",
        "moves {size:.4g} times as much after {at:.4g} s as before, and no other signal does",
        "another unit from there on ({what})",
        "convert both parts by themselves, each with its unit",
    ),
}


def trap_finding(path: Path, found: Trap) -> Finding:
    """Describe a trap that shows in the channels alone."""
    severity, *texts = _TRAPS[found.kind]
    seen, probably, write = (text.format(size=found.size, at=found.at, what=found.what) for text in texts)
    return Finding(severity, found.kind, path, found.columns, seen, probably, write)


def drift_finding(path: Path, found: Learned, duration: float) -> Finding:
    """Describe clocks that run apart."""
    seen = (
        f"the joint positions run {1e6 * found.value:+.3g} ± {1e6 * found.half:.2g} ppm against the tendons, "
        f"{1e3 * abs(found.value) * duration:.2g} ms over this recording"
    )
    write = "log all signals with one clock, or let convert table bring both onto one"
    return Finding("warning", "drift", path, ("time",), seen, "two clocks", write)
