"""How high a bound must be for a number of alarms: cells of time, alarms that are one, levels, limits of rates.

A cell is a short stretch of time of which only the largest excess over a bound counts: trying many bounds is cheap.
"""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from tendonfmu.detect.counting import MERGED
from tendonfmu.detect.free_motion import FreePart, Signal

Numbers = NDArray[np.float64]
Index = NDArray[np.int64]

CELL = 0.02  # s
_APART = round(MERGED / CELL)  # cells; alarms closer than that are one
_LONG = round(1.0 / CELL)  # cells that an alarm may last on average: one that lasts for minutes is few alarms, too
_FAR = 10**9  # cells between parts: their alarms are never one
WINDOW = 10.0  # s over which a mean force is taken to say at which pretension a cell is
SAME = 1.2  # factor between mean forces of one group
WIDEST = 1.6  # factor across a group; wider ones are cut
BLOCK = 60.0  # s; cross-validation takes every other one. Of short parts a smaller one, so that there are some:
BLOCKS = 6
OF_BOTH = 0.25  # of each pretension's time, at least, is in either half when whole recordings are held out


# --- rates ------------------------------------------------------------------------------------------------------------


def rate_limit(alarms: float, hours: float, confidence: float) -> float:
    """1/h: the exact upper limit of a Poisson rate, one-sided (Garwood 1936): Γ⁻¹(alarms + 1, confidence)/hours."""
    return float(gammaincinv(alarms + 1.0, confidence)) / hours if hours > 0 else math.inf


def least_hours(rate: float, confidence: float) -> float:
    """h that support a rate if they are without any alarm: −ln(1 − confidence)/rate."""
    return -math.log1p(-confidence) / rate


def allowed_alarms(hours: float, rate: float, confidence: float) -> int:
    """The most alarms in that time whose upper limit is at most the rate; −1: none at all would be too many."""
    count = -1
    while rate_limit(count + 1, hours, confidence) <= rate:
        count += 1
    return count


# --- cells ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cells:
    """The counted time of all parts, in [c] cells.

    rows: for each part its counted samples. first: where among all of them, one part after the other, a cell begins.
    order: number of each cell in time, far apart between parts. part, time: index of the part, and s of its own clock.
    force: N, mean over all tendons. group: index of its pretension. fold: 0 or 1, the half of the time that it is in.
    hours: h of each.
    """

    rows: Sequence[Index]
    first: Index
    order: Index
    part: Index
    time: Numbers
    force: Numbers
    group: Index
    fold: Index
    hours: Numbers

    @property
    def groups(self) -> int:
        return int(self.group.max()) + 1

    def mean(self, values: Signal) -> Numbers:
        """[c, n] mean of each cell, of [n, N] counted samples."""
        size = np.diff(np.append(self.first, values.shape[1]))
        return np.asarray((np.add.reduceat(values, self.first, axis=1) / size).T, dtype=float)


def cells_of(parts: Sequence[FreePart]) -> Cells:
    """Cells of the counted samples; parts without any have none."""
    rows = [np.flatnonzero(part.counted) for part in parts]
    time = np.concatenate([part.time[each] - part.time[0] for part, each in zip(parts, rows, strict=True)])
    owner = np.repeat(np.arange(len(parts)), [len(each) for each in rows])
    force = np.concatenate([part.mean_force[each] for part, each in zip(parts, rows, strict=True)])
    seconds = np.concatenate([part.seconds[each] for part, each in zip(parts, rows, strict=True)])
    order = np.floor(time / CELL + 1e-6).astype(np.int64) + _FAR * owner
    first = np.flatnonzero(np.diff(order, prepend=-1))
    size = np.diff(np.append(first, len(order)))
    mean_force = np.add.reduceat(force, first) / size
    window = np.floor(time[first] / WINDOW).astype(np.int64) + _FAR * owner[first]
    group, hours = _groups(mean_force, window), np.add.reduceat(seconds, first) / 3600.0
    fold = _recordings_by_turns(parts, owner[first], mean_force, group, hours)
    if fold is None:
        fold = np.floor(time[first] / _blocks(parts)[owner[first]]).astype(np.int64) % 2
    return Cells(
        rows=rows,
        first=first,
        order=order[first],
        part=owner[first],
        time=time[first],
        force=mean_force,
        group=group,
        fold=fold,
        hours=hours,
    )


def _recordings_by_turns(
    parts: Sequence[FreePart], owner: Index, force: Numbers, group: Index, hours: Numbers
) -> Index | None:
    """[c] 0 or 1: whole recordings in the order of their mean force, so that other motion is held out; None where a
    pretension has too little in one of the halves. owner: [c] part of each cell.

    One motion repeats itself: its peaks are alike in all blocks, and say little of those of another motion.
    """
    _, recording = np.unique([part.source for part in parts], return_inverse=True)
    of_cell = recording[owner]
    mean = np.bincount(of_cell, force) / np.maximum(np.bincount(of_cell), 1)
    fold = (np.argsort(np.argsort(mean)) % 2)[of_cell]
    share = np.bincount(group, hours * fold) / np.bincount(group, hours)
    return fold if share.min() >= OF_BOTH and share.max() <= 1.0 - OF_BOTH else None


def _blocks(parts: Sequence[FreePart]) -> Numbers:
    """[parts] s."""
    return np.array([min(BLOCK, max((part.time[-1] - part.time[0]) / BLOCKS, CELL)) for part in parts])


def rows_of(values: Sequence[Signal], cells: Cells) -> Signal:
    """[n, N] counted samples of all parts, of [N, n] of each."""
    return np.concatenate([each[rows].T for each, rows in zip(values, cells.rows, strict=True)], axis=1)


def _groups(force: Numbers, window: Index) -> Index:
    """[c] pretension of each cell, in rising order: mean forces over `WINDOW` that are near each other are one."""
    _, inverse = np.unique(window, return_inverse=True)
    mean = np.maximum(np.bincount(inverse, force) / np.bincount(inverse), 1e-9)
    ordered = np.sort(mean)
    bounds = [ordered[0], *ordered[1:][ordered[1:] > SAME * ordered[:-1]], np.inf]
    edges: list[float] = []
    for low, above in pairwise(bounds):
        high = float(ordered[ordered < above].max())
        cuts = max(1, math.ceil(math.log(high / low) / math.log(WIDEST) - 1e-9))
        edges += [float(low * (high / low) ** (k / cuts)) for k in range(cuts)]
    label = np.searchsorted(np.array(edges[1:]), mean, side="right")
    _, label = np.unique(label, return_inverse=True)  # those that hold a window
    return np.asarray(label[inverse], dtype=np.int64)


# --- alarms -----------------------------------------------------------------------------------------------------------


def count_alarms(order: Index) -> int:
    """Alarms of the cells [k] (increasing) that exceed."""
    return 0 if not len(order) else 1 + int((np.diff(order) > _APART).sum())


def alarms_above(order: Index, above: NDArray[np.bool_]) -> int:
    """Alarms of cells [c] of which some [c] exceed."""
    return count_alarms(order[above])


def level_for(statistic: Numbers, order: Index, allowed: int, others: Index | None = None) -> float:
    """The least level that no more than `allowed` alarms exceed, here and at every higher one, none for long.

    statistic: [c] of each cell. order: [c]. others: cells that are in alarm anyway.
    """
    present: list[int] = [] if others is None else sorted(int(each) for each in others)
    alarms = count_alarms(np.array(present, dtype=np.int64))
    if alarms > allowed:
        return math.inf
    known, longest = set(present), len(present) + (allowed + 1) * _LONG
    for k in _descending(statistic):
        cell = int(order[k])
        if cell in known:
            continue
        alarms += _joins(present, cell)
        if alarms > allowed or len(present) >= longest:
            return float(statistic[k])
        insort(present, cell)
        known.add(cell)
    return float(statistic.min()) if len(statistic) else 0.0


def _descending(statistic: Numbers, few: int = 4000) -> Iterator[int]:
    """Cells from the largest statistic on; most levels are found among the first few, so the rest comes only then."""
    if len(statistic) <= few:
        yield from np.argsort(-statistic, kind="stable").tolist()
        return
    top = np.argpartition(-statistic, few)[:few]
    yield from top[np.argsort(-statistic[top], kind="stable")].tolist()
    rest = np.setdiff1d(np.arange(len(statistic)), top)
    yield from rest[np.argsort(-statistic[rest], kind="stable")].tolist()


def _joins(present: list[int], cell: int) -> int:
    """By how much a further cell changes the number of alarms: a new one, part of one, or two of them become one."""
    k = bisect_left(present, cell)
    before = k > 0 and cell - present[k - 1] <= _APART
    after = k < len(present) and present[k] - cell <= _APART
    if before and after and present[k] - present[k - 1] <= _APART:
        return 0
    return 1 - int(before) - int(after)
