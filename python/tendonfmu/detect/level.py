"""The level of each signal's bound: innovation or evidence first, then the residual, in sample and held out.

The shape of a bound is chosen on all cells, and on each half of them to be counted on the other half. A bound looks
better than it is on the data that it was chosen on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.detect.alarm_level import Cells, Index, level_for
from tendonfmu.detect.bounds import COMPARED, Bound, Choice, Search, Tried, choose, choose_at
from tendonfmu.detect.free_motion import FreePart, Signal

SECOND_SHARE = 4  # the residual, as second signal, gets one in so many of the allowed alarms
_SCALES = np.geomspace(0.15, 3.0, 48)  # scales of a bound at which evidence is computed
_FASTEST = 10.0  # growth of g: docs/reference/semantics.md#contact-detector


@dataclass(frozen=True)
class Line:
    """One way to an alarm: a signal and its bound, at the number of alarms at which shapes are compared."""

    bound: Bound
    halves: tuple[Bound, Bound]
    statistic: Numbers
    held: Numbers
    tried: Sequence[Tried]
    least: float = 0.0

    @property
    def shares(self) -> list[tuple[float, float]]:
        """c_H and c_J of all cells, and of each half."""
        return [(bound.stuck_share, bound.jump_share) for bound in (self.bound, *self.halves)]


@dataclass(frozen=True)
class Level:
    """Factor on the bound of a line."""

    in_sample: float
    held_out: float

    @property
    def factor(self) -> float:
        """The larger factor, so that the rate also holds on data that the bound was not chosen on."""
        return max(self.in_sample, self.held_out)


def subsets_of(cells: Cells) -> list[Flags]:
    """Return the masks of all cells, and of each half."""
    return [np.ones(len(cells.fold), dtype=bool), cells.fold == 0, cells.fold == 1]


def compared_at(allowed: int) -> list[int]:
    """Return the numbers of alarms at which shapes are compared: for all cells, and for each half."""
    whole = max(allowed, COMPARED)
    return [whole, whole // 2, whole // 2]


def searched_line(search: Search, allowed: int, tick: Callable[[], None] | None = None) -> Line:
    """Search the line with the best shares."""
    return _line(search, choose(search, _sound(subsets_of(search.cells)), compared_at(allowed), tick))


def given_line(search: Search, shares: Sequence[tuple[float, float]], allowed: int) -> Line:
    """Build a line with given shares of all cells and of each half."""
    subsets = _sound(subsets_of(search.cells))
    rows = zip(shares, subsets, compared_at(allowed), strict=True)
    return _line(search, [choose_at(search, pair, subset, most) for pair, subset, most in rows])


def _sound(subsets: list[Flags]) -> list[Flags]:
    """Replace an empty half (too short for a block) by all cells."""
    return [subset if subset.any() else np.ones_like(subset) for subset in subsets]


def _line(search: Search, choices: Sequence[Choice]) -> Line:
    whole, first, second = (choice.bound for choice in choices)
    fold = search.cells.fold
    # the bound chosen on fold 0 is counted on fold 1
    held = np.where(fold == 1, search.statistic(first), search.statistic(second))
    return Line(whole, (first, second), search.statistic(whole), held, choices[0].tried, search.least_factor(whole))


def level_of(line: Line, cells: Cells, allowed: int, others: Index | None = None, held: Index | None = None) -> Level:
    """Find the level of a line. `others` and `held` are cells in alarm by another line, in sample and held out."""
    return Level(
        in_sample=max(level_for(line.statistic, cells.order, allowed, others), line.least),
        held_out=max(level_for(line.held, cells.order, allowed, held), line.least),
    )


# --- evidence ---------------------------------------------------------------------------------------------------------


def evidence_line(search: Search, line: Line, parts: Sequence[FreePart], time: float) -> Line:
    """Return the line of method `cusum`: the same bounds, exceeded when the evidence passes `time` (s)."""
    step, force, start = _sample_steps(search.cells, parts)
    found = []
    for bound in (line.bound, *line.halves):
        critical = np.full(len(search.cells.order), _SCALES[0])
        for scale, above in pairwise(_SCALES):
            alarm = _evidence(search, bound.scaled(float(scale)), step, force, start) > time
            if not alarm.any():
                break
            critical[alarm] = above  # at the next scale the cell has no alarm
        found.append(critical)
    whole, first, second = found
    held = np.where(search.cells.fold == 1, first, second)
    return Line(line.bound, line.halves, whole, held, line.tried, line.least)


def _sample_steps(cells: Cells, parts: Sequence[FreePart]) -> tuple[Numbers, Numbers, Index]:
    """Return [N] the time since the previous counted sample (s), [N] the mean force (N), and the starts of parts."""
    step = np.concatenate([part.seconds[rows] for part, rows in zip(parts, cells.rows, strict=True)])
    force = np.concatenate([part.mean_force[rows] for part, rows in zip(parts, cells.rows, strict=True)])
    lengths = [len(rows) for rows in cells.rows if len(rows)]
    return step, force, np.cumsum([0, *lengths], dtype=np.int64)


def _evidence(search: Search, bound: Bound, step: Numbers, force: Numbers, start: Index) -> Signal:
    """Compute [c] the largest g of each cell over all joints (s; docs/reference/semantics.md#contact-detector)."""
    largest = np.zeros(len(search.cells.order))
    for j in range(len(search.signal)):
        whole = bound.base[j] + bound.per_force[j] * force
        whole += bound.stuck_share * search.stuck[j] + bound.jump_share * search.jump[j]
        gain = step * np.minimum(_FASTEST, search.signal[j] / whole - 1.0)
        evidence = np.empty_like(gain)
        for begin, end in pairwise(start):
            total = np.cumsum(gain[begin:end])
            evidence[begin:end] = total - np.minimum(np.minimum.accumulate(total), 0.0)
        largest = np.maximum(largest, np.maximum.reduceat(evidence, search.cells.first))
    return np.asarray(largest)
