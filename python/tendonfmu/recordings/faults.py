"""Which parts of a well-formed recording are faulty: its clock, and sensors that stand still, clip or are coarse.

This module does not use a friction model. The values that a channel is compared with come from the other channels.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.files import are, counted, percent
from tendonfmu.model import Finger
from tendonfmu.recordings.recording import GROUPS, Recording
from tendonfmu.recordings.residuals import with_linear_springs

Runs = list[tuple[int, int]]  # (begin, end) of samples, end excluded

GAP = 10.0  # sample times; a longer step is a gap
SHORTEST_GAP = 0.1  # s; single lost samples do no harm
STUCK = 1.0  # s; a sensor that repeats one value longer, while others say that it should not, is stuck
TURNS = 20.0  # rad; further than a joint of a finger turns
SETTLING = 1.0  # s after a stuck sensor, until the velocity filter has forgotten it
SLOW_RATE, FAST_RATE = 50.0, 5000.0  # samples per second; the model's events need the first, none needs the second
# m, rad, rad; a channel is stuck only if it should have moved by more
_MOVES = {"tendon_position": 2e-4, "joint_position": 0.02, "joint_velocity": 0.05}
FEWEST_LEARNED = 100  # samples of motion for each channel that a value is learned from
MOST_LEARNED = 20_000  # samples that this is learned from, evenly spread
_FORCE_SHARE = 0.1  # of a tendon's mean force; a force is stuck only if the others change by more
_OF_RANGE = 0.05  # of the range in the whole recording; a channel is stuck only if it should have moved by more

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
GRID = 1e-3  # of a step; differences this near to a multiple of the step count as multiples
MOST_LEVELS = 0.5  # distinct values per sample, at most, where values come in steps
LEVELS = 40  # a channel with fewer steps in the range of its motion is coarse
COARSE = {"tendon_force": 0.05, "tendon_position": 2e-5, "joint_position": 2e-3}  # N, m, rad; finer ones are not coarse


@dataclass(frozen=True)
class StuckSensor:
    """A channel that holds one value although it should change."""

    group: str  # name of the group, as in `recording.GROUPS`
    element: int  # index in the group, from 1
    value: float  # the value that it holds, in the unit of the group
    begin: int  # first sample, and the one after the last
    end: int


def gaps(time: Numbers) -> list[int]:
    """Return the first samples after gaps or jumps of the clock. time: [N] (s)."""
    if len(time) < 3:
        return []
    step = np.diff(time)
    return [int(k) + 1 for k in np.flatnonzero(step > max(GAP * float(np.median(step)), SHORTEST_GAP))]


def gap_sentences(recording: Recording) -> Iterator[str]:
    """Describe the gaps."""
    if starts := gaps(recording.time):
        before, after = recording.time[starts[0] - 1 : starts[0] + 1]
        jump = f"time jumps by {after - before:.4g} s after row {starts[0]} ({before:.6g} s)"
        more = f", and {len(starts) - 1} times more" if len(starts) > 1 else ""
        yield f"{jump}{more}: a gap or a jump of the clock; the parts before and after it are fitted separately"


def rate_sentences(recording: Recording, finger: Finger) -> Iterator[str]:
    """Describe a sample rate that is too low to show reversals of friction, or higher than useful."""
    if len(recording) < 3:
        return
    rate = 1 / float(np.median(np.diff(recording.time)))
    if rate < SLOW_RATE:
        poor = f"reversals, sticking and static friction are poorly resolved at {rate:.3g} samples per second"
        yield f"{poor}; expected at least {SLOW_RATE:g}, better 500"
    if rate > FAST_RATE:
        per_sample = (finger.data.get("bias") or {}).get("noise_time") is None
        noise = "; without bias.noise_time the noise counts per sample, and standard errors may be too small"
        more = f"{rate:.5g} samples per second give no better result than 1000{noise if per_sample else ''}"
        yield f"{more}; expected at most {FAST_RATE:g}, by decimating after a low-pass filter"


def silent_tendons(recording: Recording, finger: Finger) -> Iterator[str]:
    """Describe tendons whose force is zero throughout."""
    for i in np.flatnonzero(~recording.groups["tendon_force"].any(axis=0)):
        silent = f"tendon_force[{i + 1}] ({finger.tendon_names[i]}) is 0 throughout"
        yield f"{silent}: no tension or no signal; its friction cannot be estimated and keeps the given numbers"


# --- stuck sensors ----------------------------------------------------------------------------------------------------


def stuck_sensors(recording: Recording, finger: Finger) -> dict[str, list[StuckSensor]]:
    """Find columns that repeat a value for more than `STUCK` while the other channels show that they should change."""
    stuck: dict[str, list[StuckSensor]] = {}
    for name, k, runs in _still(recording):
        sensors: list[StuckSensor] = []
        if name == "tendon_force":
            sensors = list(_stuck_force(recording.groups["tendon_force"], k, runs))
        else:
            expected = expected_values(recording, finger, name, k)
            if expected is not None:
                known = [expected, _learned_values(recording, name, k, runs)]
                sensors = list(_stuck(name, recording.groups[name], k, [of for of in known if of is not None], runs))
        if sensors:
            stuck[f"{name}[{k + 1}]"] = sensors
    return stuck


def expected_values(recording: Recording, finger: Finger, group: str, k: int) -> Numbers | None:
    """Return what a channel should read according to the other channels, up to a constant."""
    # returns [N], in the unit of the channel
    groups = recording.groups
    if group == "tendon_position":
        return _position_by_others(groups, np.asarray(finger.moment_arms, dtype=float), _stretch(recording, finger), k)
    angle = tendon_angles(recording, finger)
    if group == "joint_position":
        return np.asarray(angle[:, k])
    step = np.diff(recording.time, prepend=recording.time[0])
    return np.asarray(groups.get("joint_position", angle)[:, k] - np.cumsum(groups[group][:, k] * step))


def _learned_values(recording: Recording, group: str, k: int, runs: Runs) -> Numbers | None:
    """Return the same [N] as the motion outside `runs` teaches it, whatever is described; None if it is too little."""
    if group == "joint_velocity":
        return None
    moving = np.ones(len(recording), dtype=bool)
    for begin, end in runs:
        moving[begin:end] = False
    rows = np.flatnonzero(moving)
    others = [
        np.delete(recording.groups[name], k, axis=1) if name == group else recording.groups[name]
        for name in ("tendon_position", "tendon_force", "joint_position")
        if name in recording.groups
    ]
    known = np.column_stack([*others, np.ones(len(recording))])
    if len(rows) < FEWEST_LEARNED * known.shape[1]:
        return None
    known /= np.maximum(np.abs(known).max(axis=0), 1e-12)
    rows = rows[:: max(1, len(rows) // MOST_LEARNED)]
    weights = np.linalg.lstsq(known[rows], recording.groups[group][rows, k], rcond=1e-9)[0]
    return np.asarray(known @ weights)


def tendon_angles(recording: Recording, finger: Finger) -> Numbers:
    """Return the joint angles [N, n] (rad) that follow from tendon positions and forces, R⁺(x0 − f0/k)."""
    recording = with_linear_springs(finger, recording)
    zero = [tendon.get("zero") or 0.0 for tendon in finger.data["tendons"]]
    position = recording.groups["tendon_position"] - _stretch(recording, finger) - zero
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
        for k, column in enumerate(values.T):
            runs = still_runs(recording.time, column)
            if runs:
                yield name, k, runs


def still_runs(time: Numbers, column: Numbers) -> Runs:
    """Return the runs of equal values that last longer than `STUCK`. time, column: [N]."""
    bounds = np.concatenate([[0], np.flatnonzero(np.diff(column)) + 1, [len(column)]])
    long = time[bounds[1:] - 1] - time[bounds[:-1]] > STUCK
    return list(zip(bounds[:-1][long].tolist(), bounds[1:][long].tolist(), strict=True))


def _position_by_others(groups: Mapping[str, Numbers], arms: Numbers, stretch: Numbers, i: int) -> Numbers | None:
    """Return tendon i's motor position [N] (m) that follows from the measured joint angles or the other tendons."""
    if "joint_position" in groups:
        return np.asarray(groups["joint_position"] @ arms[i] + stretch[:, i])
    others = np.delete(np.arange(len(arms)), i)
    if np.linalg.matrix_rank(arms[others]) < arms.shape[1]:
        return None
    angle = (groups["tendon_position"] - stretch)[:, others] @ np.linalg.pinv(arms[others]).T
    return np.asarray(angle @ arms[i] + stretch[:, i])


def _stuck(group: str, values: Numbers, k: int, expected: Sequence[Numbers], runs: Runs) -> Iterator[StuckSensor]:
    """Yield the runs during which all expected values [N] change."""
    enough = [max(_MOVES[group], _OF_RANGE * float(np.ptp(of))) for of in expected]
    for begin, end in runs:
        if all(np.ptp(of[begin:end]) > least for of, least in zip(expected, enough, strict=True)):
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


# --- the clock and single channels ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Fault:
    """Something wrong with columns, which they show by themselves."""

    kind: str  # of `findings`
    columns: tuple[str, ...]
    numbers: Mapping[str, Any] = field(default_factory=dict)  # what its sentences name, and `share` of the samples


def clock_faults(time: Numbers) -> Iterator[Fault]:
    """Find a sample rate that no control loop has, gaps, lost samples and uneven steps of times [N]."""
    if len(time) <= FEWEST_STEPS:
        return
    steps = np.diff(time)
    median = float(np.median(steps))
    rate, unit = 1.0 / median, None
    if rate <= SLOWEST * (1 + 1e-6) or rate > FASTEST:
        unit = next((unit for unit in CLOCK_UNITS if USUAL[0] <= rate / unit[0] <= USUAL[1]), None)
        of: dict[str, Any] = {"samples": counted(len(time), "sample"), "step": median, "rate": rate}
        if unit is not None:
            is_number = abs(median - 1.0) < 1e-9
            of |= {"unit": unit[1] + ", or the number of the sample" * is_number, "entry": {"scale": unit[0]}}
        yield Fault("clock" if unit else "clock, unknown", ("time",), of)
    long = gaps(time * (unit[0] if unit else 1.0))
    if long:
        longest = time[long[0]] - time[long[0] - 1]
        yield Fault("gaps", ("time",), {"count": counted(len(long), "gap"), "longest": longest, "row": long[0]})
    short = np.delete(steps, np.asarray(long, dtype=int) - 1) / median
    whole = np.round(short)
    usual = 1.4826 * float(np.median(np.abs(short - 1.0)))  # standard deviation, not affected by lost samples
    is_lost = (short > max(LOST, 1.0 + CERTAIN * usual)) & (np.abs(short - whole) < WHOLE)
    lost = int((whole[is_lost] - 1).sum())
    share, jitter = lost / (len(time) + lost), float(np.std(short[~is_lost]))
    if share > LOST_SHARE:
        missing = f"{lost} of {len(time) + lost} samples {are(lost)} missing"
        yield Fault("lost", ("time",), {"missing": missing, "share": percent(share), "step": median})
    if jitter > JITTER:
        yield Fault("jitter", ("time",), {"step": median, "share": percent(jitter)})


def clipped_channels(recording: Recording, finger: Finger) -> Iterator[Fault]:
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
                    extreme, end = ("largest", "above") if is_top else ("smallest", "below")
                    of = {"value": value, "share": share, "percent": percent(share), "runs": len(runs)}
                    yield Fault("clipped", (f"{name}[{k + 1}]",), {**of, "extreme": extreme, "end": end})


def _clipped_runs(column: Numbers) -> Runs:
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


def coarse_channels(recording: Recording) -> Iterator[Fault]:
    """Find channels that move in few steps."""
    for name, finest in COARSE.items():
        for k, column in enumerate(recording.groups.get(name, np.empty((0, 0))).T):
            step, extent = value_step(column), float(np.ptp(column))
            if step > finest and extent < LEVELS * step:
                of = {"range": extent, "step": step, "steps": counted(round(extent / step), "step")}
                yield Fault("coarse", (f"{name}[{k + 1}]",), {**of, "unit": GROUPS[name][0]})


def held_channels(recording: Recording, finger: Finger) -> Iterator[Fault]:
    """Find stuck sensors, and channels that never change while most of their group do."""
    stuck, time = stuck_sensors(recording, finger), recording.time
    for column, sensors in stuck.items():
        share = sum(sensor.end - sensor.begin for sensor in sensors) / len(time)
        yield _held(column, sensors[0].value, share, time[sensors[0].begin], time[sensors[0].end - 1])
    for name in COARSE:
        values = recording.groups.get(name, np.empty((1, 0)))
        still = np.ptp(values, axis=0) == 0.0
        moving = np.ptp(values, axis=0) > COARSE[name] * LEVELS
        for k in np.flatnonzero(still):
            column = f"{name}[{k + 1}]"
            if moving.sum() > still.sum() and column not in stuck:
                yield _held(column, float(values[0, k]), 1.0, time[0], time[-1])


def _held(column: str, value: float, share: float, first: float, last: float) -> Fault:
    of = {"value": value, "share": share, "percent": percent(share), "first": first, "last": last}
    return Fault("held", (column,), of)


def value_step(column: Numbers) -> float:
    """Return the width of the equal steps in which a column's values [N] come, in its unit; 0 if there are none."""
    levels = np.unique(column)
    if len(levels) < 2 or len(levels) > MOST_LEVELS * len(column):
        return 0.0
    steps = np.diff(levels)
    # equal values may differ by rounding of the file
    steps = steps[steps > 1e-9 * np.abs(levels).max()]
    if not len(steps):
        return 0.0
    step = float(np.median(steps[steps <= 1.5 * steps.min()]))
    multiples = steps / step
    return step if np.abs(multiples - np.round(multiples)).max() <= GRID * max(1.0, multiples.max()) else 0.0
