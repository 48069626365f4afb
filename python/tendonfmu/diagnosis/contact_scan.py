"""Which stretches of a residual no smooth effect explains: a push, a stall, a slack tendon.

Windows of several lengths slide over the part of the residual that neither a slow bias nor a flexible learner predicts
on unseen blocks.

- The bias is a running median here. Splines would bend towards a push and leave its mirror image on either side.
- Each length has its own robust scale, so the colour of the noise does not matter.
- The largest value that chance reaches is extrapolated from the quartiles of the block maxima (Gumbel distribution).
  Heavy tails raise it, a few contaminated blocks do not.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter1d

from tendonfmu.arrays import Data, Flags, Numbers, flagged_rows
from tendonfmu.detect import (
    SETTLING,
    ContactTuning,
    TuneWarning,
    free_parts,
    pooled,
    require_no_contact,
    run_track,
)
from tendonfmu.diagnosis.remainder_features import features, run_starts
from tendonfmu.diagnosis.remainder_learner import Learner
from tendonfmu.diagnosis.result import DetectionGain, Event
from tendonfmu.diagnosis.samples import Samples, Series
from tendonfmu.errors import InputError
from tendonfmu.model import Finger, finger_of
from tendonfmu.recordings import FitRecording, Recording
from tendonfmu.statistics import Folds, Interval, Splines, blocks_of, intervals, make_folds

LEVEL = 0.01  # probability of any event in recordings without one
LEAST = 5.5  # robust standard deviations: least height of an event, whatever the quartiles give
EDGE = 3.0  # of the shortest window, in robust standard deviations: an event extends as far as this
SLOW = 4.0  # s of the running median, more than twice the longest push
WIDTHS = {
    0.1: 1.5,
    0.2: 1.5,
    0.4: 1.5,
    0.8: SLOW,
    1.6: SLOW,
    3.2: 2 * SLOW,
}  # s of a window -> s of the running median that it is compared with
JUMP = 8.0  # times the usual speed: such motion is too rare to be learned, so a residual of LEAST is enough
MERGED = 0.3  # s between parts of one event
EXPLAINED = 0.5  # of the residual's variance: a learner that predicts more is subtracted
PAD = 0.1  # s on either side
MOST = 0.25  # of the time: something that is there more often is not an event
FAR = 2.0  # times what free motion reaches elsewhere: another motion is not predicted as well
# times the events of a reference: kicks at the start of a motion differ by a third in size
LARGER, MORE = 1.5, 3.0
MAD = 1.4826  # standard deviation of a normal distribution over its median absolute deviation
_TWO_SIDED = 1.96  # of the standard error, for a 95 % interval


def scan_events(
    series: Series,
    residual: Numbers,
    splines: Splines,
    recordings: Sequence[str],
    *,
    seed: int = 0,
    usual: Numbers | None = None,
) -> tuple[Event, ...]:
    """Find events in a residual [B, n], N·m, of a model, in order of recording and time.

    usual: [W, n] what the same model's residual reaches in free motion elsewhere, N·m (`reached`).
    """
    residual = np.where(series.used[:, None], residual, 0.0)
    plan = make_folds(series)
    if not plan.enough:
        return ()
    left = np.array(series.target)
    if usual is None:
        left[plan.rows] -= _predicted(series, residual, splines, plan, seed)
    inside = _outlying(series, left, plan, np.zeros(left.shape, dtype=bool), usual)
    if inside.any():
        # scan again with a bias that ignores the blocks found so far
        inside = _outlying(series, left, plan, inside, usual)
    if float(inside[plan.rows].any(axis=1).mean()) > (MOST if usual is None else 2.0 * MOST):
        return ()
    left[plan.rows] = _flat(left, plan, inside, max(3, round(SLOW / series.step)))
    return tuple(_event(series, left, inside, rows, recordings) for rows in _stretches(series, inside))


def _predicted(series: Series, residual: Numbers, splines: Splines, plan: Folds, seed: int) -> Numbers:
    """Return what a learner predicts of the joints' residuals of which it predicts most, N·m [U, n]."""
    learner = Learner(features(series, seed=seed), residual, splines, plan)
    guess = learner.predicted(learner.columns)
    # a prediction of most of the residual is an effect; a smaller one may be the push, learned from its neighbours
    helps = learner.gains(guess).sum(axis=0) > EXPLAINED * np.sum(learner.target**2, axis=0)
    return np.where(helps, guess, 0.0)


def reached(series: Series) -> Numbers:
    """Return what a residual without events reaches in means over windows of `WIDTHS`, N·m [W, n]."""
    plan, known, levels = make_folds(series), np.zeros(series.target.shape, dtype=bool), list[Numbers]()
    if not plan.enough:
        return np.full((len(WIDTHS), len(known.T)), np.inf)
    for width, slow in WIDTHS.items():
        flat = _flat(series.target, plan, known, max(3, round(slow / series.step)))
        means = [_sliding(column, plan.run, max(1, round(width / series.step))) for column in flat.T]
        levels.append(np.abs(means).max(axis=1))
    return np.array(levels)


def left_out(series: Series, events: Sequence[Event], recordings: Sequence[str]) -> Flags:
    """Return whether each block lies in an event [B]."""
    inside = np.zeros(len(series.time), dtype=bool)
    for number, name in enumerate(recordings):
        inside |= (series.recording == number) & _inside(events, name, series.time)
    return inside


def _inside(events: Sequence[Event], recording: str, time: Numbers) -> Flags:
    """Return which times [N] of a recording lie in one of its events."""
    inside = np.zeros(len(time), dtype=bool)
    for event in events:
        if event.recording == recording:
            inside |= (time >= event.start) & (time <= event.end)
    return inside


def _flat(left: Numbers, plan: Folds, known: Flags, length: int) -> Numbers:
    """Return the residual without its running median [U, n]."""
    result = left[plan.rows]
    for joint in range(left.shape[1]):
        values, own = left[plan.rows, joint], known[plan.rows, joint]
        if own.any() and not own.all():
            calm = median_filter(values[~own], size=max(3, length // 4), mode="nearest")
            values = np.where(own, np.interp(plan.rows, plan.rows[~own], calm), values)
        result[:, joint] -= _slow(values, plan.run, length)
    return np.asarray(result)


def _slow(values: Numbers, run: NDArray[np.int64], length: int) -> Numbers:
    """Return the running median within each run."""
    result = np.empty(len(values))
    for begin, end in pairwise(run_starts(run)):
        result[begin:end] = median_filter(values[begin:end], size=min(length, end - begin), mode="nearest")
    return np.asarray(result)


def _outlying(series: Series, left: Numbers, plan: Folds, known: Flags, usual: Numbers | None) -> Flags:
    """Return the blocks of windows that exceed what chance reaches [B, n]."""
    inside = np.zeros(left.shape, dtype=bool)
    tests = len(WIDTHS) * left.shape[1]
    flat = {slow: _flat(left, plan, known, max(3, round(slow / series.step))) for slow in set(WIDTHS.values())}
    for joint in range(left.shape[1]):
        core = np.zeros(len(plan.rows), dtype=bool)
        jump = _jumps(series.velocity[plan.rows, joint])
        for k, (width, slow) in enumerate(WIDTHS.items()):
            length = max(1, round(width / series.step))
            mean = _sliding(flat[slow][:, joint], plan.run, length)
            scale = MAD * float(np.median(np.abs(mean)))
            if scale > 0.0:
                score = np.abs(mean) / scale
                most = _reach(score, plan, tests) if usual is None else FAR * float(usual[k, joint]) / scale
                core |= _widened(score > most, plan.run, length)
                core |= _widened(jump, plan.run, length) & _widened(score > LEAST, plan.run, length)
        mean = np.abs(_sliding(flat[SLOW][:, joint], plan.run, max(1, round(min(WIDTHS) / series.step))))
        edge = EDGE * MAD * float(np.median(mean))
        raised = mean > (edge if usual is None else min(edge, float(usual[0, joint])))
        found = _touched(core, raised, plan.run)
        own = found if usual is None else _far(found, flat[SLOW][:, joint], usual[:, joint], series.step)
        inside[plan.rows, joint] = own
    return inside


def _far(inside: Flags, values: Numbers, usual: Numbers, step: float) -> Flags:
    """Return the stretches that are far from what free motion reaches [W]: not only under the window of another one."""
    widths, result = list(WIDTHS), np.zeros_like(inside)
    for begin, end in flagged_rows(inside):
        level = usual[min(int(np.searchsorted(widths, (end - begin) * step)), len(widths) - 1)]
        result[begin:end] = np.sqrt(np.mean(values[begin:end] ** 2)) > FAR * level
    return result


def _jumps(velocity: Numbers) -> Flags:
    """Return blocks with a speed that the joint has at no other time [U]: it came loose, or was thrown."""
    speed = np.abs(velocity)
    moving = speed[speed > np.median(speed)]
    return np.asarray(speed > JUMP * np.quantile(moving, 0.9)) if len(moving) else np.zeros(len(speed), dtype=bool)


def _touched(core: Flags, raised: Flags, run: NDArray[np.int64]) -> Flags:
    """Return the stretches of raised rows of a run that touch a core; a core without raised rows stays as it is."""
    edge = np.flatnonzero((np.diff(raised.astype(int)) != 0) | (np.diff(run) != 0)) + 1
    result = np.zeros(len(core), dtype=bool)
    for begin, end in pairwise([0, *edge.tolist(), len(core)]):
        result[begin:end] = raised[begin] and core[begin:end].any()
    lonely = core & ~np.isin(np.cumsum(np.diff(core, prepend=False)), np.cumsum(np.diff(core, prepend=False))[result])
    return np.asarray(result | lonely)


def _sliding(values: Numbers, run: NDArray[np.int64], length: int) -> Numbers:
    """Return centred means over a window within each run; 0 in runs shorter than the window."""
    result = np.zeros(len(values))
    for begin, end in pairwise(run_starts(run)):
        if end - begin >= length:
            mean = np.asarray(uniform_filter1d(values[begin:end], length, mode="constant"))
            half = length // 2
            result[begin + half : end - half] = mean[half : end - begin - half]
    return result


def _reach(score: Numbers, plan: Folds, tests: int) -> float:
    """Return the value that chance reaches: Gumbel distribution through the quartiles of the block maxima."""
    highest = np.zeros(plan.stretches)
    np.maximum.at(highest, plan.stretch, score)
    low, middle, high = np.quantile(highest, (0.25, 0.5, 0.75))
    spread = (high - low) / (np.log(np.log(4.0)) - np.log(np.log(4.0 / 3.0)))
    centre = middle + spread * np.log(np.log(2.0))
    return max(LEAST, float(centre + spread * np.log(plan.stretches * tests / LEVEL)))


def _widened(high: Flags, run: NDArray[np.int64], length: int) -> Flags:
    """Return the blocks under a window of this length around each marked centre, in the same run."""
    result = np.zeros(len(high), dtype=bool)
    for centre in np.flatnonzero(high):
        part = slice(max(0, centre - length // 2), centre + length // 2 + 1)
        result[part] |= run[part] == run[centre]
    return result


def _stretches(series: Series, inside: Flags) -> list[NDArray[np.int64]]:
    """Return the rows of each event."""
    marked = np.flatnonzero(inside.any(axis=1))
    if not len(marked):
        return []
    apart = (np.diff(marked) * series.step > MERGED) | (np.diff(series.segment[marked]) != 0)
    pad = round(PAD / series.step)
    stretches = []
    for rows in np.split(marked, np.flatnonzero(apart) + 1):
        wide = np.arange(max(0, rows[0] - pad), min(len(series.time), rows[-1] + pad + 1))
        stretches.append(wide[series.segment[wide] == series.segment[rows[0]]])
    return stretches


def _event(series: Series, left: Numbers, inside: Flags, rows: NDArray[np.int64], recordings: Sequence[str]) -> Event:
    joints = np.flatnonzero(inside[rows].any(axis=0))
    own = rows[series.used[rows]]
    length = min(len(own), max(1, round(min(WIDTHS) / series.step)))
    mean = uniform_filter1d(left[np.ix_(own, joints)], length, axis=0, mode="nearest")
    peak = float(np.abs(mean).max())
    first, last = float(series.time[rows[0]]), float(series.time[rows[-1]])
    start, end = first - series.step / 2.0, last + series.step / 2.0
    strongest = int(joints[np.argmax(np.abs(mean).max(axis=0))])
    names = " and ".join(str(joint + 1) for joint in joints)
    plural = "s" if len(joints) > 1 else ""
    description = (
        f"{end - start:.2g} s at joint{plural} {names}, up to {1000.0 * peak:.3g} mN·m that neither motion nor force "
        f"explains{_circumstances(series, own, strongest)}"
    )
    name = recordings[int(series.recording[rows[0]])]
    return Event(name, start, end, tuple(int(joint) + 1 for joint in joints), peak, description)


def _circumstances(series: Series, rows: NDArray[np.int64], joint: int) -> str:
    """Return what the recording shows at that time: a slack tendon, a jumping or resting joint."""
    notes = []
    usual = np.median(np.abs(series.force), axis=0)
    slack = np.flatnonzero(np.abs(series.force[rows]).min(axis=0) < 0.05 * usual)
    if len(slack):
        notes.append(f"tendon {' and '.join(str(tendon + 1) for tendon in slack)} nearly slack")
    speed = np.abs(series.velocity[:, joint])
    if _jumps(speed)[rows].any():
        notes.append(f"joint {joint + 1} jumps")
    elif np.median(speed[rows]) < 0.03 * np.quantile(speed, 0.95):
        notes.append(f"joint {joint + 1} stands still")
    return f" ({', '.join(notes)})" if notes else ""


# --- recordings without events ---------------------------------------------------------------------------------------


def events_of(data: Data, samples: Samples, seed: int, usual: Numbers | None = None) -> tuple[tuple[Event, ...], Flags]:
    """Find the stretches that no friction explains in the residual of a model."""
    # returns blocks that lie in an event [B]
    series = samples.series(data)
    names = [str(recording.path) for recording in samples.recordings]
    events = scan_events(series, samples.residual(data), samples.splines, names, seed=seed, usual=usual)
    return events, left_out(series, events, names)


def unusual(events: Sequence[Event], usual: Sequence[Event], longer: float) -> Sequence[Event]:
    """Return the events that are not as the usual ones: all if there are far more of them, else the larger ones."""
    # longer: duration of the recordings of the events over that of the usual ones
    if len(events) > MORE * longer * len(usual):
        return events
    at = {event: [other.peak for other in usual if set(other.joints) & set(event.joints)] for event in events}
    return [event for event, peaks in at.items() if event.peak > LARGER * max(peaks, default=0.0)]


def without_events(recording: FitRecording, events: Sequence[Event]) -> FitRecording:
    """Return the recording without the samples that lie in its events."""
    outside = ~_inside(events, str(recording.path), recording.time)
    return replace(recording, train=recording.train & outside, held_out=recording.held_out & outside)


# --- what leaving them out gains --------------------------------------------------------------------------------------


def event_gain(data: Mapping[str, Any], recordings: Sequence[FitRecording], events: Sequence[Event]) -> Interval | None:
    """Return the share of the rms that leaving the events out removes, with a 95 % interval; None without events."""
    if not events:
        return None
    finger = finger_of(data)
    within, samples, parts = 0.0, 0, []  # Σ r² in the events and their samples; both of the blocks outside [B, 2]
    for recording in recordings:
        squares = np.sum(recording.run(finger).residual ** 2, axis=1)
        judged = recording.train & np.isfinite(squares)
        inside = _inside(events, str(recording.path), recording.time)
        within += float(squares[judged & inside].sum())
        samples += int((judged & inside).sum())
        blocks = blocks_of(recording.time, judged & ~inside)
        sums = [blocks.sums(values) for values in (np.where(judged, squares, 0.0), np.ones(len(judged)))]
        parts.append(np.column_stack(sums))
    free, free_samples = np.concatenate(parts).T
    rest, count = float(free.sum()), float(free_samples.sum())
    if len(free) < intervals.FEWEST_BLOCKS or not rest > 0.0:
        return None
    mean = rest / count
    # standard error of a ratio of sums, by blocks
    spread = float(np.sqrt(np.sum((free - mean * free_samples) ** 2) * len(free) / (len(free) - 1)))
    ratio = math.log(mean * (count + samples) / (rest + within)) / 2.0  # log of the rms without over with events
    error = within / (rest + within) * spread / rest / 2.0
    ends = (ratio, ratio + _TWO_SIDED * error, ratio - _TWO_SIDED * error)
    return Interval(*(1.0 - math.exp(end) for end in ends))


# --- what a model gains for contact detection -------------------------------------------------------------------------
# Both models are tuned alike on free motion, for the same rate of false alarms in the same free motion
# (`detect.tuning.ContactTuning`). Both are then scored on the labels: `detect.counting` counts events, false alarms and
# delays.


RATE, HIGHEST = 6.0, 3600.0  # 1/h; false alarm rate that both are tuned for, at least one alarm in the free motion
SHORTEST = 4.0  # s; shortest stretch without contact that counts as free motion
AROUND = 1.0  # s, on either side of a contact


def detection_gain(nominal: Data, extended: Data, recordings: Sequence[FitRecording]) -> DetectionGain | None:
    """Return the gain for contact detection; None without labelled contact or if nothing can be tuned."""
    every = [recording.recording for recording in recordings]
    labelled = [recording for recording in every if recording.contact is not None and recording.contact.any()]
    kinematics = recordings[0].kinematics
    free = _free_motion(finger_of(nominal), every, kinematics) if labelled else []
    hours = sum(float(recording.time[-1] - recording.time[0]) - SETTLING for recording in free) / 3600
    if not hours > 0:
        return None
    try:
        tuned = [_tuned(data, free, kinematics, min(max(RATE, 1.0 / hours), HIGHEST)) for data in (nominal, extended)]
    except InputError:  # nothing can be tuned, for example with a bias without drift
        return None
    before, after = (
        pooled([run_track(tuning.description_, each, kinematics).score() for each in labelled]) for tuning in tuned
    )
    delays = [float(np.median(score.delays)) if len(score.delays) else None for score in (before, after)]
    return DetectionGain(
        events=len(before.events),
        found_before=before.found,
        found_after=after.found,
        false_alarms_before=len(before.false_alarms),
        false_alarms_after=len(after.false_alarms),
        median_delay_before=delays[0],
        median_delay_after=delays[1],
        smallest_push_before=tuple(map(float, tuned[0].push_)),
        smallest_push_after=tuple(map(float, tuned[1].push_)),
    )


# --- free motion ------------------------------------------------------------------------------------------------------


def _free_motion(finger: Finger, recordings: Sequence[Recording], kinematics: int) -> list[Recording]:
    whole = [recording for recording in recordings if recording.contact is None or not recording.contact.any()]
    pieces = [piece for each in recordings if each.contact is not None for piece in _pieces(each, each.contact)]
    free = ([one for one in chosen if _is_free(finger, one, kinematics)] for chosen in (whole, pieces))
    return next((found for found in free if found), [])


def _is_free(finger: Finger, recording: Recording, kinematics: int) -> bool:
    """Return whether a recording is free motion: long enough, moving, and without a load on a reference sensor."""
    try:
        require_no_contact(recording)
        parts, _ = free_parts(finger, recording, kinematics)
    except InputError:
        return False
    return any(part.counted.any() for part in parts)


def _pieces(recording: Recording, contact: Flags) -> list[Recording]:
    """Return the stretches that are not in or close to contact."""
    time = recording.time
    touched = time[contact]
    after = np.searchsorted(touched, time - AROUND) < np.searchsorted(touched, time + AROUND, side="right")
    pieces = []
    for begin, end in flagged_rows(~after):
        if time[end - 1] - time[begin] >= SHORTEST:
            groups = {name: np.ascontiguousarray(values[begin:end]) for name, values in recording.groups.items()}
            piece = Recording(Path(f"{recording.path}, from {time[begin]:.4g} s"), time[begin:end].copy(), groups)
            pieces.append(replace(piece, contact=np.zeros(end - begin, dtype=bool)))
    return pieces


# --- tuned and scored -------------------------------------------------------------------------------------------------


def _tuned(data: Data, free: Sequence[Recording], kinematics: int, rate: float) -> ContactTuning:
    tuning = ContactTuning(finger_of(data), false_alarms_per_hour=rate, kinematics=kinematics)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TuneWarning)
        return tuning.tune(list(free), checked=True)
