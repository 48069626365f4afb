"""Bounds of contact detection that free motion stays within: their shape by tails, their level by a number of alarms.

A bound of joint j is base_j + per_force_j·f + c_H·H_j + c_J·J_j (docs/reference/semantics.md#contact-detector). Among
the bounds with at most the allowed alarms, the best is the one that the lightest push exceeds (`least_load`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import nnls

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.detect.alarm_level import Cells, level_for, rows_of
from tendonfmu.detect.free_motion import FreeRun, Signal

# Pairs (c_H, c_J) to try. A push makes the model jump and ends stiction, so large shares hide it:
# docs/reference/commands/tune.md
SHARES = ((0.4, 0.4),)
TAILS = (4.0, 16.0)  # times the wished rate: the rates of the tails that shape a bound
COMPARED = 12  # alarms at which bounds are compared, if fewer are allowed: single extremes say little about a shape
_LEAST = 0.02  # of a signal's rms: least value of the part of a bound that is not friction
WORTH_STUCK, WORTH_JUMP = 0.25, 5.0  # weights of H and J that a push has to exceed, see `Search.in_the_way`
_EVERY = 10  # one cell in so many for the mean logarithm
_FACTORS = (0.9, 1.1)
_NEAR = 0.4  # of a bound: cells below it cannot exceed a refined bound
_FEW_ROUNDS, _ROUNDS = 2, 4  # rounds over all joints: for every pair of shares, and for the best one


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


@dataclass(frozen=True)
class Tried:
    """A pair of shares that was tried, and the mean logarithm of `least_load` (N·m) at the allowed number of alarms."""

    stuck_share: float
    jump_share: float
    mean_log: float


@dataclass(frozen=True)
class Choice:
    """The best bound of a subset of cells, and all pairs that were tried."""

    bound: Bound
    mean_log: float
    tried: list[Tried]


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

    def statistic(self, bound: Bound) -> Numbers:
        """Compute [c] the largest ratio over joints of the excess to base + per_force·f; above 1 is an alarm."""
        return statistic(self.excess(bound.stuck_share, bound.jump_share), bound, self.cells.force)

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


def choose(
    search: Search, subsets: Sequence[Flags], allowed: Sequence[int], tick: Callable[[], None] | None = None
) -> list[Choice]:
    """Choose the best bound of every subset of cells [c], with at most `allowed` alarms in each."""
    best: list[Choice | None] = [None] * len(subsets)

    def consider(pair: tuple[float, float]) -> None:
        over = search.excess(*pair)
        for k, (subset, most) in enumerate(zip(subsets, allowed, strict=True)):
            found = _best_tail(search, pair, over[subset], subset, most)
            found = _refined(search, found, over[subset], subset, most, _FEW_ROUNDS)
            before = best[k]
            tried = [*(before.tried if before else []), Tried(*pair, found.mean_log)]
            better = before is None or found.mean_log < before.mean_log
            best[k] = replace(found if better or before is None else before, tried=tried)
        if tick is not None:
            tick()

    for pair in SHARES:
        consider(pair)
    done = zip([each for each in best if each is not None], subsets, allowed, strict=True)
    return [_refined_whole(search, *each) for each in done]


def choose_at(search: Search, pair: tuple[float, float], subset: Flags, allowed: int) -> Choice:
    """Choose the best bound of a subset of cells with given shares."""
    return _refined_whole(
        search, _best_tail(search, pair, search.excess(*pair)[subset], subset, allowed), subset, allowed
    )


def _best_tail(search: Search, pair: tuple[float, float], over: Signal, subset: Flags, allowed: int) -> Choice:
    found: Choice | None = None
    for tail in TAILS:
        force, level = tail_levels(search.cells, over, subset, tail * search.rate)
        shape = search.sound(Bound(*lines_through(force, np.maximum(level, search.least)), *pair))
        bound, worth = _at_level(search, shape, over, subset, allowed)
        if found is None or worth < found.mean_log:
            found = Choice(bound, worth, [])
    assert found is not None
    return found


def _at_level(search: Search, shape: Bound, over: Signal, subset: Flags, allowed: int) -> tuple[Bound, float]:
    """Return a shape at the least level with the allowed alarms, and the mean logarithm of the lightest push found."""
    level = level_for(statistic(over, shape, search.cells.force[subset]), search.cells.order[subset], allowed)
    return _worth(search, shape.scaled(max(level, search.least_factor(shape))), subset)


def _worth(search: Search, bound: Bound, subset: Flags) -> tuple[Bound, float]:
    rows = np.flatnonzero(subset)[::_EVERY]
    return bound, float(np.mean(np.log(least_load(search.in_the_way(bound, rows)))))


def _refined_whole(search: Search, choice: Choice, subset: Flags, allowed: int) -> Choice:
    over = search.excess(choice.bound.stuck_share, choice.bound.jump_share)[subset]
    return _refined(search, choice, over, subset, allowed, _ROUNDS)


def _refined(search: Search, choice: Choice, over: Signal, subset: Flags, allowed: int, rounds: int) -> Choice:
    """Raise or lower the bases of single joints as long as this finds lighter pushes."""
    best = choice
    # a cell far below the bound stays below all bounds near it
    near = np.flatnonzero(statistic(over, choice.bound, search.cells.force[subset]) > _NEAR)
    over, force, order = over[near], search.cells.force[subset][near], search.cells.order[subset][near]
    for _ in range(rounds):
        before = best.mean_log
        for j, factor in product(range(over.shape[1]), _FACTORS):
            scale = np.ones(over.shape[1])
            scale[j] = factor
            shape = replace(best.bound, base=scale * best.bound.base, per_force=scale * best.bound.per_force)
            level = level_for(statistic(over, shape, force), order, allowed)
            bound, worth = _worth(search, shape.scaled(max(level, search.least_factor(shape))), subset)
            if worth < best.mean_log:
                best = replace(best, bound=bound, mean_log=worth)
        if before - best.mean_log < 1e-3:
            break
    return best


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
    found = np.array([nnls(columns / each[:, None], np.ones_like(force))[0] for each in level.T])
    found[found * np.array([1.0, force.max()]) < 1e-9 * level.max()] = 0.0  # rounding
    return found[:, 0], found[:, 1]
