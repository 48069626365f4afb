"""How high a bound must be for a number of alarms: cells of time, merged alarms, levels, and which rate is supported.

A cell is a short stretch of time, of which only the largest excess over a bound counts. This makes it cheap to try many
bounds.
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

from tendonfmu.arrays import Numbers
from tendonfmu.detect.counting import MERGED
from tendonfmu.detect.free_motion import FreePart, Signal
from tendonfmu.errors import InputError

Index = NDArray[np.int64]

CELL = 0.02  # s
_APART = round(MERGED / CELL)  # cells; alarms closer than this are one
_LONG = round(1.0 / CELL)  # most cells per alarm on average; otherwise one alarm of minutes would count as few
_FAR = 10**9  # cells between parts, so that their alarms are never merged
WINDOW = 10.0  # s over which a mean force is computed to find the pretension of a cell
SAME = 1.2  # largest factor between neighbouring mean forces of one group
WIDEST = 1.6  # largest factor across a group; wider ones are divided
BLOCK = 60.0  # s; cross-validation takes every second block. Short parts have shorter blocks:
BLOCKS = 6  # at least so many per part
OF_BOTH = 0.25  # least share of each pretension's time in either half if whole recordings are held out


# --- rates ------------------------------------------------------------------------------------------------------------


def rate_limit(alarms: float, hours: float, confidence: float) -> float:
    """Compute the exact one-sided upper limit of a Poisson rate (1/h): Γ⁻¹(alarms + 1, confidence)/hours."""
    # hours: (h)
    return float(gammaincinv(alarms + 1.0, confidence)) / hours if hours > 0 else math.inf


def least_hours(rate: float, confidence: float) -> float:
    """Compute the time without any alarm that supports a rate (h): −ln(1 − confidence)/rate."""
    return -math.log1p(-confidence) / rate


def allowed_alarms(hours: float, rate: float, confidence: float) -> int:
    """Return the most alarms whose upper limit is at most the rate; −1 if even no alarm would be too many."""
    count = -1
    while rate_limit(count + 1, hours, confidence) <= rate:
        count += 1
    return count


# --- cells ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cells:
    """The counted time of all parts, in [c] cells."""

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
        """Average [n, N] counted samples over each cell; the result is [c, n]."""
        size = np.diff(np.append(self.first, values.shape[1]))
        return np.asarray((np.add.reduceat(values, self.first, axis=1) / size).T, dtype=float)

    def alarms_at(self, group: int, part: int, begins: Sequence[float]) -> int:
        """Count the alarms of a part that begin at one pretension, by the nearest counted cell."""
        inside = np.flatnonzero(self.part == part)
        if not len(inside):
            return 0
        near = inside[np.clip(np.searchsorted(self.time[inside], begins), 0, len(inside) - 1)]
        return int((self.group[near] == group).sum())


def cells_of(parts: Sequence[FreePart]) -> Cells:
    """Divide the counted samples into cells; parts without any have none."""
    rows = [np.flatnonzero(part.counted) for part in parts]
    time = np.concatenate([part.time[counted] - part.time[0] for part, counted in zip(parts, rows, strict=True)])
    owner = np.repeat(np.arange(len(parts)), [len(counted) for counted in rows])
    force = np.concatenate([part.mean_force[counted] for part, counted in zip(parts, rows, strict=True)])
    seconds = np.concatenate([part.seconds[counted] for part, counted in zip(parts, rows, strict=True)])
    order = np.floor(time / CELL + 1e-6).astype(np.int64) + _FAR * owner
    first = np.flatnonzero(np.diff(order, prepend=-1))
    size = np.diff(np.append(first, len(order)))
    mean_force = np.add.reduceat(force, first) / size
    group = pretension_of(mean_force, time[first], owner[first])
    hours = np.add.reduceat(seconds, first) / 3600.0
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
    """Assign whole recordings to halves in turn, in the order of their mean force, so that other motion is held out."""
    # Returns [c] 0 or 1, or None if a pretension has too little time in one of the halves.
    _, recording = np.unique([part.source for part in parts], return_inverse=True)
    of_cell = recording[owner]
    mean = np.bincount(of_cell, force) / np.maximum(np.bincount(of_cell), 1)
    fold = (np.argsort(np.argsort(mean)) % 2)[of_cell]
    share = np.bincount(group, hours * fold) / np.bincount(group, hours)
    return fold if share.min() >= OF_BOTH and share.max() <= 1.0 - OF_BOTH else None


def _blocks(parts: Sequence[FreePart]) -> Numbers:
    """Return [parts] the length of a block (s)."""
    return np.array([min(BLOCK, max((part.time[-1] - part.time[0]) / BLOCKS, CELL)) for part in parts])


def rows_of(values: Sequence[Signal], cells: Cells) -> Signal:
    """Join the counted samples of all parts: [N, n] of each become [n, N]."""
    return np.concatenate([signal[rows].T for signal, rows in zip(values, cells.rows, strict=True)], axis=1)


def pretension_of(force: Numbers, time: Numbers, owner: Index) -> Index:
    """Return [c] the pretension of each force, in rising order: similar means over a `WINDOW` of an owner are one."""
    # force: (N); time: (s); owner: recording, or part of one
    _, inverse = np.unique(np.floor(time / WINDOW).astype(np.int64) + _FAR * owner, return_inverse=True)
    mean = np.maximum(np.bincount(inverse, force) / np.bincount(inverse), 1e-9)
    ordered = np.sort(mean)
    bounds = [ordered[0], *ordered[1:][ordered[1:] > SAME * ordered[:-1]], np.inf]
    edges: list[float] = []
    for low, above in pairwise(bounds):
        high = float(ordered[ordered < above].max())
        cuts = max(1, math.ceil(math.log(high / low) / math.log(WIDEST) - 1e-9))
        edges += [float(low * (high / low) ** (k / cuts)) for k in range(cuts)]
    label = np.searchsorted(np.array(edges[1:]), mean, side="right")
    _, label = np.unique(label, return_inverse=True)  # drops groups without a window
    return np.asarray(label[inverse], dtype=np.int64)


# --- alarms -----------------------------------------------------------------------------------------------------------


def count_alarms(order: Index) -> int:
    """Count the alarms of the cells [k] (increasing) that exceed their bound."""
    return 0 if not len(order) else 1 + int((np.diff(order) > _APART).sum())


def alarms_above(order: Index, above: NDArray[np.bool_]) -> int:
    """Count the alarms of cells [c], given which of them [c] exceed their bound."""
    return count_alarms(order[above])


def level_for(statistic: Numbers, order: Index, allowed: int, others: Index | None = None) -> float:
    """Find the smallest level that at most `allowed` alarms exceed, here and at every higher level, none for long."""
    present: list[int] = [] if others is None else sorted(map(int, others))
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
    """Yield the cells by falling statistic."""
    if len(statistic) <= few:
        yield from np.argsort(-statistic, kind="stable").tolist()
        return
    top = np.argpartition(-statistic, few)[:few]
    yield from top[np.argsort(-statistic[top], kind="stable")].tolist()
    rest = np.setdiff1d(np.arange(len(statistic)), top)
    yield from rest[np.argsort(-statistic[rest], kind="stable")].tolist()


def _joins(present: list[int], cell: int) -> int:
    """Return the change of the number of alarms by one more cell: a new alarm, part of one, or two merged into one."""
    k = bisect_left(present, cell)
    before = k > 0 and cell - present[k - 1] <= _APART
    after = k < len(present) and present[k] - cell <= _APART
    if before and after and present[k] - present[k - 1] <= _APART:
        return 0
    return 1 - int(before) - int(after)


# --- which rate the recordings are long enough for --------------------------------------------------------------------


class NotEnough(InputError):
    """There is too little free motion: for the wished rate, or any at all."""

    def __init__(self, message: str, more: float) -> None:
        super().__init__(message)
        self.more = more


@dataclass(frozen=True)
class Support:
    """The rate that a tuning is for."""

    rate: float  # (1/h)
    allowed: int  # alarms
    more: float = 0.0  # time missing for the wished rate (min)
    sentences: tuple[str, ...] = ()


def supported(cells: Cells, hours: float, wished: float, confidence: float, strict: bool) -> Support:
    """Find the rate that the recordings support, for a wished rate (1/h)."""
    allowed = allowed_alarms(hours, wished, confidence)
    if allowed >= 0:
        return Support(wished, allowed)
    needed = least_hours(wished, confidence)
    share = needed / cells.groups
    thin = [(force, there) for force, there in hours_by_pretension(cells) if there < share]
    evenly = ", ".join(f"{60 * (share - there):.1f} min at {force:.3g} N" for force, there in thin)
    more, rate = 60 * (needed - hours), rate_limit(0, hours, confidence)
    if strict:
        raise NotEnough(
            f"{60 * hours:.1f} min of free motion: even without any alarm the rate may be {rate:.3g} per hour "
            f"at confidence {confidence:g}; expected {60 * needed:.1f} min for {wished:g} per hour: record {more:.1f} "
            f"min more ({evenly})",
            more,
        )
    sentence = (
        f"{60 * hours:.1f} min of free motion: at most {rate:.3g} false alarms an hour with {100 * confidence:g} % "
        f"confidence; for {wished:g} an hour record {more:.1f} min more ({evenly})"
    )
    return Support(rate, 0, more, (sentence,))


def hours_by_pretension(cells: Cells) -> list[tuple[float, float]]:
    """Return the mean force (N) and the time (h) of each pretension."""
    return [
        (float(cells.force[cells.group == g].mean()), float(cells.hours[cells.group == g].sum()))
        for g in range(cells.groups)
    ]
