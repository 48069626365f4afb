"""How topics with clocks of their own come onto one: linear interpolation, and what gaps it must not span."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted
from tendonfmu.recordings.converters.column_map import ColumnMap, Resampling
from tendonfmu.recordings.recording import LABEL

Series = NDArray[np.float64]

STEPS = 10.0  # median steps; a longer one is a gap unless the map says otherwise


def on_one_clock(
    file: Path, topics: Mapping[str, Mapping[str, Series]], main: str, wanted: ColumnMap
) -> tuple[dict[str, Series], list[str]]:
    """Return the columns of all topics at common times."""
    # topics: [N]; returns [M]
    rule = wanted.resample or Resampling()
    time, notes = _times(file, topics, main, rule)
    in_gap = np.zeros(len(time), dtype=bool)
    for name, columns in topics.items():
        if name == main and rule.rate is None:
            continue
        gaps, largest, limit = _gaps(columns["time"], time, rule)
        label = f"{name}: " if name else ""
        is_there = bool(np.isin(time, columns["time"]).all())
        done = "has a sample at each time, none is interpolated" if is_there else "interpolated onto one clock"
        widest = _largest_step(columns["time"], time)
        notes.append(f"{file}: {label}{done}; its largest gap is {1e3 * widest:.4g} ms")
        if gaps.any() and not rule.leave_out_gaps:
            at = float(time[int(np.argmax(gaps))])
            raise InputError(
                f"{file}: {label}a gap of {largest:.4g} s, the first near time {at:.6g} s; expected at most "
                f'{limit:.4g} s, or "resample": {{"gaps": "leave out"}} or a "largest_gap" in the map'
            )
        in_gap |= gaps
    lost = int(np.count_nonzero(in_gap))
    if lost:
        notes.append(f"{file}: {lost} of {counted(len(time), 'sample')} in gaps {are(lost)} left out")
        time = time[~in_gap]
    if not len(time):
        raise InputError(f'{file}: no sample outside gaps; expected a smaller "rate" or a larger "largest_gap"')
    found = {"time": time}
    for name, columns in topics.items():
        for key, values in columns.items():
            if key == "time":
                continue
            if name == main and rule.rate is None:
                found[key] = values[np.isin(columns["time"], time)]
            else:
                found[key] = (
                    _held(time, columns["time"], values) if key == LABEL else np.interp(time, columns["time"], values)
                )
    return found, notes


def _times(
    file: Path, topics: Mapping[str, Mapping[str, Series]], main: str, rule: Resampling
) -> tuple[Series, list[str]]:
    """Return the common times, where all topics have samples."""
    begin = max(float(columns["time"][0]) for columns in topics.values())
    end = min(float(columns["time"][-1]) for columns in topics.values())
    if begin >= end:
        spans = ", ".join(f"{name} {c['time'][0]:.6g} to {c['time'][-1]:.6g} s" for name, c in topics.items())
        raise InputError(f"{file}: the topics do not overlap in time ({spans}); expected clocks with the same zero")
    own = topics[main]["time"]
    if rule.rate is None:
        inside = own[(own >= begin) & (own <= end)]
        lost = len(own) - len(inside)
        notes = [f"{file}: left out before or after the other topics: {counted(lost, 'sample')}"] if lost else []
        return inside, notes
    count = int(np.floor((end - begin) * rule.rate * (1 + 1e-12))) + 1
    return begin + np.arange(count) / rule.rate, [f"{file}: resampled at {rule.rate:g} Hz"]


def _gaps(own: Series, time: Series, rule: Resampling) -> tuple[NDArray[np.bool_], float, float]:
    """Return which times [M] lie in gaps of a topic, its largest step between them, and the limit (s)."""
    if len(own) < 2:
        return np.zeros(len(time), dtype=bool), 0.0, np.inf
    steps = np.diff(own)
    limit = rule.largest_gap if rule.largest_gap is not None else STEPS * float(np.median(steps))
    after = np.clip(np.searchsorted(own, time, side="right") - 1, 0, len(steps) - 1)
    around = np.where(own[after] == time, 0.0, steps[after])  # a sample of the topic itself lies in no gap
    around[time == own[-1]] = 0.0
    return around > limit, float(around.max(initial=0.0)), limit


def _largest_step(own: Series, time: Series) -> float:
    """Return the largest step (s) of a topic between the first and last of the common times."""
    if not len(time):
        return 0.0
    first = max(int(np.searchsorted(own, time[0], side="right")) - 1, 0)
    last = int(np.searchsorted(own, time[-1], side="left"))
    return float(np.diff(own[first : last + 1]).max(initial=0.0))


def _held(time: Series, own: Series, values: Series) -> Series:
    """Return labels, which are not interpolated: each sample has the last one before it."""
    return values[np.clip(np.searchsorted(own, time, side="right") - 1, 0, len(own) - 1)]
