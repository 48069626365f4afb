"""The level of each way to an alarm: innovation or evidence, and behind it the residual, in sample and held out.

Shapes are chosen on all cells, and on each half of them to be counted on the other: what is chosen on the very data it
is counted on looks better than it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tendonfmu.detect.alarm_level import Cells, Index, level_for
from tendonfmu.detect.bounds import COMPARED, Bound, Choice, Search, Tried, choose, choose_at
from tendonfmu.detect.free_motion import FreePart, Signal

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]

SECOND_SHARE = 4  # the residual, as second line, has every so many'th of the allowed alarms
_SCALES = np.geomspace(0.15, 3.0, 48)  # of a bound, at which evidence is looked at
_FASTEST = 10.0  # growth of g: docs/reference/semantics.md#contact-detector


@dataclass(frozen=True)
class Line:
    """A way to an alarm: a signal and its bound, at the number of alarms at which shapes are compared.

    statistic: [c] by how much the base has to be scaled for no alarm in a cell. held: the same by the bound that was
    chosen on the other half of the blocks. least: the smallest factor that leaves a bound (`Search.least_factor`).
    """

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
    """Factor on a line's bound. in_sample: for the allowed alarms; held_out: for as many of them in the other half."""

    in_sample: float
    held_out: float

    @property
    def factor(self) -> float:
        """The higher one: the rate holds on data that were not chosen on."""
        return max(self.in_sample, self.held_out)


def subsets_of(cells: Cells) -> list[Flags]:
    """All cells, and each half."""
    return [np.ones(len(cells.fold), dtype=bool), cells.fold == 0, cells.fold == 1]


def compared_at(allowed: int) -> list[int]:
    """Alarms at which the shapes for all cells, and for each half, are compared."""
    whole = max(allowed, COMPARED)
    return [whole, whole // 2, whole // 2]


def searched_line(search: Search, allowed: int, tick: Callable[[], None] | None = None) -> Line:
    """A line with the best shares."""
    return _line(search, choose(search, _sound(subsets_of(search.cells)), compared_at(allowed), tick))


def given_line(search: Search, shares: Sequence[tuple[float, float]], allowed: int) -> Line:
    """A line with given shares of all cells and of each half."""
    subsets = _sound(subsets_of(search.cells))
    rows = zip(shares, subsets, compared_at(allowed), strict=True)
    return _line(search, [choose_at(search, pair, subset, most) for pair, subset, most in rows])


def _sound(subsets: list[Flags]) -> list[Flags]:
    """A half without any cell, of less than a block, is all cells."""
    return [subset if subset.any() else np.ones_like(subset) for subset in subsets]


def _line(search: Search, choices: Sequence[Choice]) -> Line:
    whole, first, second = (choice.bound for choice in choices)
    fold = search.cells.fold
    # what was chosen on fold 0 is counted on fold 1
    held = np.where(fold == 1, search.statistic(first), search.statistic(second))
    return Line(whole, (first, second), search.statistic(whole), held, choices[0].tried, search.least_factor(whole))


def level_of(line: Line, cells: Cells, allowed: int, others: Index | None = None, held: Index | None = None) -> Level:
    """others, held: cells in which another line alarms anyway, in sample and held out."""
    return Level(
        in_sample=max(level_for(line.statistic, cells.order, allowed, others), line.least),
        held_out=max(level_for(line.held, cells.order, allowed, held), line.least),
    )


# --- evidence ---------------------------------------------------------------------------------------------------------


def evidence_line(search: Search, line: Line, parts: Sequence[FreePart], time: float) -> Line:
    """The same bounds for the method `cusum`: what evidence passes `time` (s), instead of the signal itself."""
    step, force, start = _sample_steps(search.cells, parts)
    found = []
    for bound in (line.bound, *line.halves):
        critical = np.full(len(search.cells.order), _SCALES[0])
        for scale, above in pairwise(_SCALES):
            alarm = _evidence(search, bound.scaled(float(scale)), step, force, start) > time
            if not alarm.any():
                break
            critical[alarm] = above  # the next scale is without an alarm there
        found.append(critical)
    whole, first, second = found
    held = np.where(search.cells.fold == 1, first, second)
    return Line(line.bound, line.halves, whole, held, line.tried, line.least)


def _sample_steps(cells: Cells, parts: Sequence[FreePart]) -> tuple[Numbers, Numbers, Index]:
    """Of the counted samples [N]: time since the sample before, s; mean force, N; and where each part begins."""
    step = np.concatenate([part.seconds[rows] for part, rows in zip(parts, cells.rows, strict=True)])
    force = np.concatenate([part.mean_force[rows] for part, rows in zip(parts, cells.rows, strict=True)])
    lengths = [len(rows) for rows in cells.rows if len(rows)]
    return step, force, np.cumsum([0, *lengths], dtype=np.int64)


def _evidence(search: Search, bound: Bound, step: Numbers, force: Numbers, start: Index) -> Signal:
    """[c] largest g of each cell over all joints, s (docs/reference/semantics.md#contact-detector)."""
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
