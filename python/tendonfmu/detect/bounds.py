"""Bounds of contact detection that free motion stays within: their shape by tails, their level by a number of alarms.

A bound of joint j is base_j + per_force_j·f + c_H·H_j + c_J·J_j (docs/reference/semantics/detection.md). Among the
bounds with at most the allowed alarms, the best is the one that the lightest push exceeds (`least_load`).

The shape of a bound is chosen on all cells, and on each half of them to be counted on the other half. A bound looks
better than it is on the data that it was chosen on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Any

import numpy as np
from scipy.optimize import nnls

from tendonfmu.arrays import Flags, Indices, Numbers
from tendonfmu.detect.alarm_level import Cells, Index, level_for, rows_of
from tendonfmu.detect.free_motion import FreePart, FreeRun, Signal

# c_H and c_J. A push makes the model jump and ends stiction, so large shares hide it: docs/reference/commands/tune.md
SHARES = (0.4, 0.4)
TAILS = (4.0, 16.0)  # times the wished rate: the rates of the tails that shape a bound
COMPARED = 12  # alarms at which bounds are compared, if fewer are allowed: single extremes say little about a shape
_LEAST = 0.02  # of a signal's rms: least value of the part of a bound that is not friction
WORTH_STUCK, WORTH_JUMP = 0.25, 5.0  # weights of H and J that a push has to exceed, see `Search.in_the_way`
_EVERY = 10  # one cell in so many for the mean logarithm
_FACTORS = (0.9, 1.1)
_NEAR = 0.4  # of a bound: cells below it cannot exceed a refined bound
_FEW_ROUNDS, _ROUNDS = 2, 4  # rounds over all joints, the second time near the bound found by the first
SECOND_SHARE = 4  # the residual, as second signal, gets one in so many of the allowed alarms
_SCALES = np.geomspace(0.15, 3.0, 48)  # scales of a bound at which evidence is computed
_FASTEST = 10.0  # growth of g: docs/reference/semantics/detection.md#contact-detector


@dataclass(frozen=True)
class Bound:
    """A bound: base [n] (N·m), per_force [n] (N·m/N), and the shares c_H and c_J."""

    base: Numbers
    per_force: Numbers
    stuck_share: float = 0.0
    jump_share: float = 0.0

    def scaled(self, factor: float) -> Bound:
        """Return the bound with base and per_force times a factor, and the same shares."""
        return replace(self, base=factor * self.base, per_force=factor * self.per_force)

    def own(self, force: Numbers) -> Numbers:
        """Compute [c, n] base + per_force·f at mean forces [c] (N·m)."""
        return np.asarray(self.base + force[:, None] * self.per_force)

    def at_least(self, least: Numbers, force: float) -> Bound:
        """Raise the bases until base + per_force·f is at least `least` [n] (N·m) at and above a mean force."""
        return replace(self, base=np.maximum(self.base, least - force * self.per_force))


def least_load(whole: Numbers) -> Numbers:
    """Compute [c] the lightest push that exceeds bounds [c, n] (N·m): the mean logarithm over the pushed link."""
    # A force F across the middle of link k of a finger with equal links turns joint j ≤ k by (k − j + 1/2)·ℓ·F. A push
    # loads all joints before it, those near the base most, so a low bound at the base detects more than one at the tip.
    joints = whole.shape[1]
    total = np.zeros(len(whole))
    for k in range(1, joints + 1):
        arm = np.arange(k, 0, -1) - 0.5
        total += np.log(np.maximum((whole[:, :k] / arm).min(axis=1), 1e-12))
    return np.asarray(np.exp(total / joints))


# --- what is searched -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Search:
    """All counted samples, as a search of bounds needs them."""

    cells: Cells
    signal: Signal
    stuck: Signal
    jump: Signal
    uncertain: Signal | None
    mean_stuck: Numbers
    mean_jump: Numbers
    mean_uncertain: Numbers
    mean_square: Numbers
    rate: float
    least: Numbers
    lowest_force: float

    def excess(self, stuck_share: float, jump_share: float) -> Signal:
        """Compute [c, n] the largest excess of |signal| over c_H·H + c_J·J + L·u in each cell (N·m)."""
        over = self.signal
        for share, part in ((stuck_share, self.stuck), (jump_share, self.jump)):
            if share:
                over = over - np.float32(share) * part
        if self.uncertain is not None:
            over = over - self.uncertain
        return np.ascontiguousarray(np.maximum.reduceat(over, self.cells.first, axis=1).T)

    def sound(self, bound: Bound) -> Bound:
        """Raise a bound where its own part falls below `least` at a recorded force."""
        return bound.at_least(self.least, self.lowest_force)

    def least_factor(self, bound: Bound) -> float:
        """Return the smallest factor that keeps a sound bound sound, at most 1 apart from rounding."""
        return float(np.max(self.least / bound.own(np.array([self.lowest_force]))[0]))

    def in_the_way(self, bound: Bound, rows: Any) -> Numbers:
        """Compute [k, n] the torque that a push has to exceed in each of the cells in `rows` (N·m)."""
        # A push that matters moves the finger, and H = 0 in motion, so a quarter of H counts. It also makes the model
        # jump more than on average, so J counts five times. With these weights the shapes are in nearly the order in
        # which they find pushes on the virtual hand (rank correlation 0.7 to 0.8; 0.2 to 0.3 if H and J count as in
        # free motion).
        added = WORTH_STUCK * bound.stuck_share * self.mean_stuck[rows]
        added = added + WORTH_JUMP * bound.jump_share * self.mean_jump[rows]
        return np.asarray(bound.own(self.cells.force[rows]) + added + self.mean_uncertain[rows])


def search_for(runs: Sequence[FreeRun], cells: Cells, signal: str, rate: float, level: float = 0.0) -> Search:
    """Prepare a search for the signal "innovation" or "residual"."""

    def laid_out(name: str) -> Signal:
        return rows_of([getattr(run, name) for run in runs], cells)

    values, stuck, jump = np.abs(laid_out(signal)), laid_out("stuck"), laid_out("jump")
    uncertain = np.float32(level) * laid_out("uncertain") if level and runs[0].uncertain.any() else None
    mean_stuck, mean_jump, mean_square = cells.mean(stuck), cells.mean(jump), cells.mean(values**2)
    return Search(
        cells=cells,
        signal=values,
        stuck=stuck,
        jump=jump,
        uncertain=uncertain,
        mean_stuck=mean_stuck,
        mean_jump=mean_jump,
        mean_uncertain=np.zeros_like(mean_stuck) if uncertain is None else cells.mean(uncertain),
        mean_square=mean_square,
        rate=rate,
        least=np.maximum(_LEAST * np.sqrt(mean_square.mean(axis=0)), 1e-9),
        lowest_force=min(
            float(run.part.mean_force[rows].min()) for run, rows in zip(runs, cells.rows, strict=True) if len(rows)
        ),
    )


def statistic(over: Signal, bound: Bound, force: Numbers) -> Numbers:
    """Compute [c] the largest ratio over joints of the excess [c, n] to base + per_force·f; above 1 is an alarm."""
    return np.asarray(np.max(over / bound.own(force), axis=1), dtype=float)


# --- search -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Line:
    """One way to an alarm: a signal and its bound, at the number of alarms at which shapes are compared."""

    bound: Bound  # chosen on all cells
    halves: tuple[Bound, Bound]  # chosen on each half
    statistic: Numbers  # [c] in sample
    held: Numbers  # [c] by the bound of the other half
    mean_log: float = 0.0  # mean logarithm of `least_load` (N·m) after the first rounds
    least: float = 0.0  # smallest factor that keeps the bound sound


def searched_line(search: Search, allowed: int) -> Line:
    """Search the line of the first signal."""
    return _line(search, SHARES, allowed, (_FEW_ROUNDS, _ROUNDS))


def given_line(search: Search, shares: tuple[float, float], allowed: int) -> Line:
    """Search a line beside the first one, with given shares."""
    return _line(search, shares, allowed, (_ROUNDS,))


def _line(search: Search, shares: tuple[float, float], allowed: int, rounds: Sequence[int]) -> Line:
    cells, over, fold = search.cells, search.excess(*shares), search.cells.fold
    most = max(allowed, COMPARED)
    everywhere = np.ones(len(fold), dtype=bool)
    halves = [half if half.any() else everywhere for half in (fold == 0, fold == 1)]  # empty if too short for a block
    choices = []
    for subset, alarms in ((everywhere, most), (halves[0], most // 2), (halves[1], most // 2)):
        trial = _Trial(search, over[subset], subset, alarms)
        bound, mean_log = trial.best_tail(shares)
        first_log = mean_log
        for k, count in enumerate(rounds):
            bound, mean_log = trial.refined(bound, mean_log, count)
            first_log = mean_log if k == 0 else first_log
        choices.append((bound, first_log))
    (whole, mean_log), (first, _), (second, _) = choices
    # the bound chosen on fold 0 is counted on fold 1
    in_sample, of_first, of_second = (statistic(over, bound, cells.force) for bound in (whole, first, second))
    held = np.where(fold == 1, of_first, of_second)
    return Line(whole, (first, second), in_sample, held, mean_log, search.least_factor(whole))


@dataclass(frozen=True)
class _Trial:
    """A subset of cells, in which a bound may have a number of alarms."""

    search: Search
    over: Signal  # [k, n] excess in the cells of the subset
    subset: Flags  # [c]
    allowed: int

    def best_tail(self, shares: tuple[float, float]) -> tuple[Bound, float]:
        """Return the best bound by the shape of a tail, and the mean logarithm of the lightest push."""
        search = self.search
        tried = []
        for tail in TAILS:
            force, level = tail_levels(search.cells, self.over, self.subset, tail * search.rate)
            shape = search.sound(Bound(*lines_through(force, np.maximum(level, search.least)), *shares))
            tried.append(self.at_level(shape, self.over, np.flatnonzero(self.subset)))
        return min(tried, key=lambda choice: choice[1])

    def at_level(self, shape: Bound, over: Signal, cells: Indices) -> tuple[Bound, float]:
        """Return a shape at the least level with the allowed alarms in some cells, and its mean logarithm."""
        search = self.search
        level = level_for(statistic(over, shape, search.cells.force[cells]), search.cells.order[cells], self.allowed)
        bound = shape.scaled(max(level, search.least_factor(shape)))
        rows = np.flatnonzero(self.subset)[::_EVERY]
        return bound, float(np.mean(np.log(least_load(search.in_the_way(bound, rows)))))

    def refined(self, bound: Bound, mean_log: float, rounds: int) -> tuple[Bound, float]:
        """Raise or lower the bases of single joints as long as this finds lighter pushes."""
        # a cell far below the bound stays below all bounds near it
        inside = np.flatnonzero(self.subset)
        near = np.flatnonzero(statistic(self.over, bound, self.search.cells.force[inside]) > _NEAR)
        over, cells = self.over[near], inside[near]
        for _ in range(rounds):
            before = mean_log
            for j, factor in product(range(over.shape[1]), _FACTORS):
                scale = np.ones(over.shape[1])
                scale[j] = factor
                shape = replace(bound, base=scale * bound.base, per_force=scale * bound.per_force)
                other, worth = self.at_level(shape, over, cells)
                if worth < mean_log:
                    bound, mean_log = other, worth
            if before - mean_log < 1e-3:
                break
        return bound, mean_log


def tail_levels(cells: Cells, over: Signal, subset: Flags, rate: float) -> tuple[Numbers, Numbers]:
    """Find the levels that each joint exceeds at a rate of alarms of its own, by pretension."""
    # over: [k, n] (N·m); subset: [c]; returns [g] mean force of each pretension (N), [g, n] (N·m)
    group, order = cells.group[subset], cells.order[subset]
    forces, levels = [], []
    for g in np.unique(group):
        inside = group == g
        most = max(1, round(rate * float(cells.hours[subset][inside].sum())))
        forces.append(float(cells.force[subset][inside].mean()))
        levels.append([level_for(over[inside, j], order[inside], most) for j in range(over.shape[1])])
    return np.array(forces), np.array(levels)


def lines_through(force: Numbers, level: Numbers) -> tuple[Numbers, Numbers]:
    """Fit base and per_force [n], both ≥ 0, with a + b·f ≈ level [g, n] at forces [g], by least relative squares."""
    if len(force) < 2:
        return level[0].astype(float), np.zeros(level.shape[1])
    columns = np.column_stack([np.ones_like(force), force])
    lines = np.array([nnls(columns / values[:, None], np.ones_like(force))[0] for values in level.T])
    lines[lines * np.array([1.0, force.max()]) < 1e-9 * level.max()] = 0.0  # rounding
    return lines[:, 0], lines[:, 1]


# --- levels -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Level:
    """Factor on the bound of a line."""

    in_sample: float
    held_out: float

    @property
    def factor(self) -> float:
        """The larger factor, so that the rate also holds on data that the bound was not chosen on."""
        return max(self.in_sample, self.held_out)


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
    scales = []
    for bound in (line.bound, *line.halves):
        critical = np.full(len(search.cells.order), _SCALES[0])
        for scale, above in pairwise(_SCALES):
            alarm = _evidence(search, bound.scaled(float(scale)), step, force, start) > time
            if not alarm.any():
                break
            critical[alarm] = above  # at the next scale the cell has no alarm
        scales.append(critical)
    whole, first, second = scales
    held = np.where(search.cells.fold == 1, first, second)
    return replace(line, statistic=whole, held=held)


def _sample_steps(cells: Cells, parts: Sequence[FreePart]) -> tuple[Numbers, Numbers, Index]:
    """Return [N] the time since the previous counted sample (s), [N] the mean force (N), and the starts of parts."""
    step = np.concatenate([part.seconds[rows] for part, rows in zip(parts, cells.rows, strict=True)])
    force = np.concatenate([part.mean_force[rows] for part, rows in zip(parts, cells.rows, strict=True)])
    lengths = [len(rows) for rows in cells.rows if len(rows)]
    return step, force, np.cumsum([0, *lengths], dtype=np.int64)


def _evidence(search: Search, bound: Bound, step: Numbers, force: Numbers, start: Index) -> Signal:
    """Compute [c] the largest g of each cell over all joints (s; docs/reference/semantics/detection.md)."""
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
