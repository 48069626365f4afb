"""The fit of a finger whose friction remembers: all numbers together, by runs of the core, without a learning bias.

The residual of joint j is r = τ − T less its constant or slowest drift (`slow_drift`), as block means. Its variance Q_j
is unknown, so the negative log likelihood is ½ Σ_j N_j log Q_j(u), with N_j the effective number of blocks, plus the
prior ½ (u − u_0)ᵀ P (u − u_0). Levenberg and Marquardt minimise it between bounds; each step solves the quadratic model
of the Gauss-Newton matrix within them. Numbers of the memory are fitted as their logarithms (`memory.starts`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.estimate.core_runs import STEP, CoreRuns, Direction
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.memory import memory_paths
from tendonfmu.estimate.slow_drift import SlowDrift
from tendonfmu.estimate.structure import FIXED, Structure

BLOCKS, SHORTEST, FEWEST = 60, 2.0, 8  # stretches of scores: how many, and least length (s) and number
FARTHEST = float(np.log(1e6))  # of a logarithm from a number's magnitude
FLOOR = 1e-3  # of a joint's torque: a residual's rms below it gives a joint no more weight
LEAST_FALL = 1e-4  # of the cost, for each joint and effective block
DAMPING = 1e-3, 1e-9, 1e6  # of Levenberg and Marquardt: at first, least, most


@dataclass(frozen=True)
class Scale:
    """The coordinates u of a fit: logarithms of the memory's numbers, other unknowns in units of their magnitude."""

    log: Flags  # [u]
    size: Numbers  # [u]

    def coordinates(self, z: Numbers) -> Numbers:
        """Return u for unknowns z."""
        return np.where(self.log, np.log(np.where(self.log, z, 1.0) / self.size), z / self.size)

    def unknowns(self, u: Numbers) -> Numbers:
        """Return the unknowns z for u."""
        return self.size * np.where(self.log, np.exp(np.where(self.log, u, 0.0)), u)

    def slopes(self, z: Numbers) -> Numbers:
        """Return dz/du, [u]."""
        return np.where(self.log, z, self.size)


@dataclass(frozen=True)
class State:
    """Where a minimisation is."""

    u: Numbers  # [u]
    residual: Numbers  # [R, n] (N·m), used blocks without their constants
    cost: float


@dataclass(frozen=True)
class Linearised:
    """Residual and derivatives at a state."""

    columns: Numbers  # [R, n, u] (N·m)
    information: Numbers  # [u, u] of the data
    gradient: Numbers  # [u] of the data's cost


class MemoryProblem:
    """Residuals of a structure over runs of the core, and their likelihood."""

    def __init__(self, structure: Structure, estimator: Estimator, runs: CoreRuns, drift: SlowDrift) -> None:
        self._structure, self.estimator, self.runs, self.drift = structure, estimator, runs, drift
        remembered = set(memory_paths(structure.start.data))
        self._paths = [path for path, k in structure.index.items() if structure.group[k] != FIXED]
        self._rows = [structure.index[path] for path in self._paths]
        unknowns = estimator.unknowns
        log = np.array([unknown.path in remembered for unknown in unknowns])
        self.scale = Scale(log, estimator.scale)
        ends = (np.array([getattr(unknown, end) for unknown in unknowns]) for end in ("lower", "upper"))
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = (self.scale.coordinates(end) for end in ends)
        self.lower = np.where(log, np.maximum(low, -FARTHEST), low)
        self.upper = np.where(log, np.minimum(high, FARTHEST), high)
        self.blocks = np.full(runs.joints, float(drift.used.sum()))  # N_j: those that count
        target = drift.without(runs.torque)
        self._floor = FLOOR**2 * np.mean(target**2, axis=0) + 1e-30
        self.mean, self.known = np.zeros(len(log)), np.zeros((len(log), len(log)))  # u_0 and P of the prior

    def values(self, u: Numbers) -> dict[str, float]:
        """Return the numbers of the description by path."""
        numbers = self.estimator.values(np.clip(self.scale.unknowns(u), *self.bounds))
        return dict(zip(self._paths, numbers[self._rows].tolist(), strict=True))

    @property
    def bounds(self) -> tuple[Numbers, Numbers]:
        """Lower and upper bounds of the unknowns z."""
        return self.scale.unknowns(self.lower), self.scale.unknowns(self.upper)

    def state(self, u: Numbers) -> State:
        """Run the core at u."""
        residual = self.drift.without(self.runs.residual(self._of_description(self.values(u))))
        return State(u, residual, self.cost(residual, u))

    def cost(self, residual: Numbers, u: Numbers) -> float:
        """Return the negative log likelihood with the prior."""
        away = u - self.mean
        return float(0.5 * self.blocks @ np.log(self.variance(residual)) + 0.5 * away @ self.known @ away)

    def variance(self, residual: Numbers) -> Numbers:
        """Return Q, [n] ((N·m)²)."""
        return np.asarray(np.mean(residual**2, axis=0) + self._floor)

    def linearised(self, state: State, like: Linearised | None = None) -> Linearised:
        """Return the derivatives at a state; only those by numbers of the memory are new if there are others like it."""
        if like is None:
            return self.of_columns(state, self.drift.without(self.columns(state.u)))
        remembered, columns = np.flatnonzero(self.scale.log), like.columns.copy()
        columns[:, :, remembered] = self.drift.without(self.columns(state.u, remembered.tolist()))
        return self.of_columns(state, columns)

    def of_columns(self, state: State, columns: Numbers) -> Linearised:
        """Return what follows from derivatives [R, n, u] at a state."""
        weight = self.blocks / len(state.residual) / self.variance(state.residual)
        information = np.zeros((len(state.u), len(state.u)))
        gradient = np.zeros(len(state.u))
        for j, share in enumerate(weight):
            information += share * columns[:, j].T @ columns[:, j]
            gradient += share * columns[:, j].T @ state.residual[:, j]
        return Linearised(columns, information, gradient)

    def columns(self, u: Numbers, chosen: Sequence[int] | None = None, runs: CoreRuns | None = None) -> Numbers:
        """Return [B, n, c] the derivatives of τ − T by the chosen of u, or all (N·m), over some runs."""
        here = self.values(u)
        directions = [self._direction(k, u, here) for k in (range(len(u)) if chosen is None else chosen)]
        return (self.runs if runs is None else runs).columns(directions, self._of_description(here))

    def moved_on(self, state: State, linearised: Linearised, tried: State) -> Linearised:
        """Return derivatives at `tried` that agree with the step there: Broyden's update."""
        step = tried.u - state.u
        missed = tried.residual - state.residual - linearised.columns @ step
        return self.of_columns(
            tried, linearised.columns + missed[:, :, None] * (step / max(float(step @ step), 1e-300))
        )

    def slopes(self, state: State, runs: CoreRuns) -> Numbers:
        """Return [B, n, u] the derivatives of T by the unknowns z (N·m each) over some runs."""
        return -self.columns(state.u, None, runs) / self.scale.slopes(self.scale.unknowns(state.u))

    def scores(self, state: State, linearised: Linearised) -> tuple[Numbers, float]:
        """Return [K, u] the gradients of the data's cost by z over stretches of time, and their length (s)."""
        seconds = self.runs.grid.step * len(state.residual)
        length = min(max(seconds / BLOCKS, SHORTEST), seconds / FEWEST)
        size = max(1, round(length / self.runs.grid.step))
        weight = self.blocks / len(state.residual) / self.variance(state.residual)
        rows = np.einsum("rju,rj->ru", linearised.columns, state.residual * weight)
        sums = np.add.reduceat(rows, np.arange(0, len(rows), size), axis=0)
        scores = sums / self.scale.slopes(self.scale.unknowns(state.u))
        return scores - scores.mean(axis=0), length

    def _direction(self, k: int, u: Numbers, here: Mapping[str, float]) -> Direction:
        """Return the move of unknown k, inwards at its upper bound."""
        step = STEP * max(1.0, abs(u[k])) if not self.scale.log[k] else STEP
        step = -step if u[k] + step > self.upper[k] else step
        moved = u.copy()
        moved[k] += step
        there = self._of_description(self.values(moved))
        return Direction({path: (there[path] - here[path]) / step for path in there if there[path] != here[path]}, step)

    def _of_description(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the values without those of the bias, which runs lack."""
        return {path: value for path, value in values.items() if not path.startswith("bias.")}


Watch = Callable[[int, State], None]  # called after each step with its number; may raise to stop


@dataclass(frozen=True)
class Minimum:
    """The end of a minimisation."""

    state: State
    linearised: Linearised
    steps: int
    converged: bool


def minimise(
    problem: MemoryProblem,
    begin: State,
    most: int,
    tolerance: float,
    watch: Watch | None = None,
    *,
    known: Linearised | None = None,
    rough: bool = False,
) -> Minimum:
    """Go down from a state, in at most `most` steps, until a step is below `tolerance` standard errors.

    Between two computations of the derivatives Broyden's update keeps them good enough (Math. Comp. 19, 1965). `known`
    are some to begin with; a rough end has updated ones.
    """
    state, damping, converged, number = begin, DAMPING[0], False, 0
    linearised, is_fresh = (problem.linearised(state), True) if known is None else (known, False)
    while not converged and number < most:
        number += 1
        gradient = linearised.gradient + problem.known @ (state.u - problem.mean)
        matrix = linearised.information + problem.known
        step = bounded_step(matrix, gradient, damping, problem.lower - state.u, problem.upper - state.u)
        tried = problem.state(state.u + step)
        fall = state.cost - tried.cost
        small = step @ matrix @ step < tolerance**2 or fall < LEAST_FALL * float(problem.blocks.sum())
        if fall > 0.0:
            linearised = problem.moved_on(state, linearised, tried)
            state, damping = tried, max(damping / 5.0, DAMPING[1])
            if watch is not None:
                watch(number, state)
        else:
            damping *= 8.0
        if small and (is_fresh or rough):
            converged = fall >= 0.0 or damping > 1.0
        elif small:
            linearised, is_fresh = problem.linearised(state), True
            continue
        is_fresh = is_fresh and fall <= 0.0
    return Minimum(state, linearised if is_fresh or rough else problem.linearised(state), number, converged)


def bounded_step(matrix: Numbers, gradient: Numbers, damping: float, low: Numbers, high: Numbers) -> Numbers:
    """Return the step that minimises the damped quadratic model between bounds."""
    diagonal = np.maximum(np.diag(matrix), 1e-12 * float(np.diag(matrix).max()) + 1e-300)
    length = np.sqrt(diagonal)
    scaled = matrix / np.outer(length, length) + (damping + 1e-10) * np.eye(len(length))
    root = cholesky(scaled, lower=False)
    right = -solve_triangular(root, gradient / length, trans="T")
    free = solve_triangular(root, right) / length
    if (free >= low).all() and (free <= high).all():
        return np.asarray(free)
    room = np.minimum(low, -1e-300), np.maximum(high, 1e-300)
    found = lsq_linear(root, right, (room[0] * length, room[1] * length), method="bvls")
    return np.asarray(np.clip(found.x / length, low, high))


def best_of(problem: MemoryProblem, begins: Sequence[State], most: int, tolerance: float) -> list[State]:
    """Go a few steps down from each start; return where they end, the best first."""
    ends = [minimise(problem, begin, most, tolerance, rough=True).state for begin in begins]
    return sorted(ends, key=lambda state: state.cost)
