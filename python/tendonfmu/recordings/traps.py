"""Traps of real logs that show in the channels alone: magnitudes, unsigned numbers, filled gaps, slow sensors, units.

Nothing here uses a friction model. A trap is reported once for each column, or for all that have it at the same time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers, flagged_rows
from tendonfmu.model import Finger
from tendonfmu.recordings.faults import Fault, tendon_angles, value_step
from tendonfmu.recordings.kinematics import UNITS
from tendonfmu.recordings.recording import Recording

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


def find_traps(finger: Finger, recording: Recording) -> Iterator[Fault]:
    """Find the traps of a recording. They are of `recording`, before any correction."""
    yield from _magnitudes(finger, recording)
    groups = {name: recording.groups[name] for name in UNITS if name in recording.groups}
    for name, values in groups.items():
        for k, column in enumerate(values.T):
            if (word := wrap_of(column, name.endswith("position"))) is not None:
                yield Fault("wrapped", (f"{name}[{k + 1}]",), {"steps": word / (finest(column) or 1.0)})
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


def _magnitudes(finger: Finger, recording: Recording) -> Iterator[Fault]:
    angle = recording.groups.get("joint_position")
    angle = tendon_angles(recording, finger) if angle is None else angle
    for i, tendon in enumerate(finger.data["tendons"]):
        joint = int(np.argmax(np.abs(tendon["moment_arms"])))
        force = recording.groups["tendon_force"][:, i]
        if tendon.get("bidirectional") and is_magnitude(force, angle[:, joint]):
            yield Fault("magnitude", (f"tendon_force[{i + 1}]",), {"joint": finger.joint_names[joint]})


def _filled(time: Numbers, groups: Mapping[str, Numbers]) -> Iterator[Fault]:
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
        yield Fault("filled", tuple(groups), {"duration": time[end + 1] - time[begin], "at": time[begin]})


def _slow(time: Numbers, groups: Mapping[str, Numbers]) -> Iterator[Fault]:
    """Yield the groups whose columns change at every so-many-th sample only, as of a slower sensor."""
    for name, values in groups.items():
        between = [found for column in values.T if (found := _between_changes(column)) is not None]
        if len(between) == values.shape[1]:
            yield Fault("slow", (name,), {"samples": np.median(between), "rate": 1.0 / np.median(np.diff(time))})
        elif name.endswith("position") and (share := _repeats(values)) > REPEATED:
            yield Fault("repeated", (name,), {"share": 100.0 * share})


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


def _switched(time: Numbers, groups: Mapping[str, Numbers]) -> Iterator[Fault]:
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
                    numbers = {"factor": np.exp(change), "at": begin, "unit": unit}
                    yield Fault("switched", (f"{name}[{k + 1}]",), numbers)
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


# --- counters that start again: signed words stored as unsigned, encoders of many turns, timers that overflow ---------

EMPTY = 0.1  # of the range: the widest part that no sample reaches
GRID = 0.01  # of the smallest difference: others are as near to a multiple of it
LEAST_WORD = 128.0  # steps; sensors use each second or fourth step of a word, too
SAME = 0.02  # relative, between the jumps and the word
SHORT, OPPOSITE = 0.25, 0.8  # of the range: the steps of a turning encoder between its jumps; share of jumps backwards
# readings of one turn or word: powers of two, degrees and their parts, radians, whole turns, decimal encoders
DECIMAL = [float(digits * 10**k) for k in range(4) for digits in (1000, 2000, 2400, 4000, 5000, 8000)]
CIRCLES = np.array([2.0 * np.pi, *(2.0**k for k in range(7, 33)), *(360.0 * 10**k for k in range(4)), *DECIMAL])
# a counter of 16, 24, 31 or 32 bits, and one of 32 bits in ms or µs written in coarser units; a day in s, ms and ns
OVERFLOWS = (2.0**16, 2.0**24, 2.0**31, 2.0**32, 2.0**32 / 1e3, 2.0**32 / 1e6, 86400.0, 86400e3, 86400e9)
FRACTIONS = (1e3, 1e6, 1e9)  # ms, µs and ns beyond a second, which start again many times


def unwrapped(readings: NDArray[Any], wrap: float, last: float) -> NDArray[np.float64]:
    """Return readings [N] of a counter without its jumps: each within half a turn of the one before, or of `last`."""
    steps = np.diff(readings, prepend=last)
    path = last + np.cumsum((steps + wrap / 2.0) % wrap - wrap / 2.0)
    # whole turns alone are added, so that readings do not change by rounding
    return np.asarray(readings + wrap * np.round((path - readings) / wrap), dtype=np.float64)


def overflow(times: NDArray[Any]) -> float | None:
    """Return the readings after which a timer [N] starts again at 0, or None."""
    steps = np.diff(times.astype(np.float64))
    falls = np.flatnonzero(steps < 0.0)
    rises = steps[steps > 0.0]
    if not len(falls) or not len(rises):
        return None
    beyond = max(10.0 * float(np.median(rises)), 1.0)  # a step over the end may be longer than the usual ones
    for word in (*OVERFLOWS, *(FRACTIONS if len(falls) > 1 else ())):
        over = word + steps[falls]
        is_over = (over >= 0.0).all() and (over < beyond).all() and beyond < 0.5 * word
        if is_over and (times <= word).all():
            return float(word)
    return None


def wrap_of(column: Numbers, turns: bool = True) -> float | None:
    """Return the readings after which a word, or with turns an encoder, [N] starts again, in its unit, or None."""
    if len(column) < 3 or not np.abs(np.diff(column)).max() > 0.5 * np.ptp(column):
        return None  # a counter jumps by nearly its range
    step = finest(column)
    steps = _word(column, step) if step else None
    if steps is None:
        return _turn(column, step) if turns else None
    return steps * step


def finest(column: Numbers) -> float:
    """Return the width of a column's steps [N], or 0 if it has none."""
    step = np.diff(column)
    if not step.any():
        return 0.0
    sizes = np.abs(step[step != 0.0])
    multiples = sizes / sizes.min()
    is_grid = np.abs(multiples - np.round(multiples)).max() < GRID
    return value_step(column) or (float(sizes.min()) if is_grid else 0.0)


def _word(column: Numbers, finest_step: float) -> float | None:
    """Return the steps by which a column jumps if they are those of a word of a computer and no value is between."""
    levels, step = np.unique(column), np.diff(column)
    if len(levels) < 3:
        return None
    widest = int(np.argmax(np.diff(levels)))
    above = column > (levels[widest] + levels[widest + 1]) / 2.0
    jumps = np.abs(step[np.diff(above)])
    if levels[widest + 1] - levels[widest] < EMPTY * float(np.ptp(column)) or not len(jumps):
        return None
    count = float(np.median(jumps)) / finest_step
    word = float(2.0 ** np.round(np.log2(count)))
    return word if word >= LEAST_WORD and abs(count / word - 1.0) < SAME else None


def _turn(column: Numbers, finest_step: float) -> float | None:
    """Return the readings of one turn of an encoder that jumps back from one end of its range to the other."""
    steps, span = np.diff(column), float(np.ptp(column))
    is_jump = np.abs(steps) > span / 2.0
    if not is_jump.any() or np.abs(steps[~is_jump]).max(initial=np.inf if is_jump.all() else 0.0) > SHORT * span:
        return None
    if np.diff(np.unique(column)).max() > EMPTY * span:
        return None
    smooth = np.where(is_jump, np.nan, steps)
    beside = np.stack([np.concatenate([[np.nan], smooth[:-1]]), np.concatenate([smooth[1:], [np.nan]])])
    known = ~np.isnan(beside)
    motion = np.where(known, beside, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    jumps, motion = steps[is_jump], motion[is_jump]
    if (jumps * motion <= 0.0).mean() < OPPOSITE or not motion.any():
        return None
    size = float(np.median(np.abs(jumps - motion)))
    # in SI, a step of the encoder is the unit in which its turn is a round number
    units = [1.0, finest_step] if finest_step else [1.0]
    sizes = np.concatenate([CIRCLES * unit for unit in units])
    fitting = sizes[(sizes >= span * (1.0 - 1e-9)) & (np.abs(sizes / size - 1.0) < SAME)]
    if len(fitting):
        return float(fitting[np.argmin(np.abs(fitting - size))])
    usual = float(f"{span + finest_step:.3g}")  # an encoder of another number of steps, which has been all around
    return usual if len(jumps) > 2 and usual >= span and abs(usual / size - 1.0) < SAME else None
