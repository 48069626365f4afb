"""The fit of a finger whose friction remembers: all numbers together, by runs of the core, without a learning bias.

The residual of joint j is r = τ − T less its constant or slowest drift (`SlowDrift`), as block means, with the mean
square Q_j. Its variance is s²·p_j with unknown s and given p_j, so the negative log likelihood is
½ N log Σ_j (N_j/N)·Q_j(u)/p_j, with N_j the effective number of blocks and N their sum, plus the prior
½ (u − u_0)ᵀ P (u − u_0). With p_j = 1 no joint is fitted at the cost of another; `reweighted` sets p_j = Q_j near the
minimum. Levenberg and Marquardt minimise it between bounds; each step solves the quadratic model
of the Gauss-Newton matrix within them. Numbers of the memory are fitted as their logarithms (`memory.starts`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.estimate.core_runs import CoreRuns, SlowDrift
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.memory import memory_paths
from tendonfmu.estimate.structure import FIXED, Structure

# --- derivatives by the numbers of laws -------------------------------------------------------------------------------
# The core takes the share of its limit that friction with a memory holds as constant, which is exact for what slips and
# near for what does not. Numbers of the memory and of other extensions have none here.


class LawSlopes:
    """The derivatives over some runs."""

    def __init__(self, structure: Structure, runs: CoreRuns) -> None:
        finger = structure.start.replace({"bias.noise_std": 1.0, "bias.forget_rate": 0.0})  # as runs have it
        self._estimator, self._blocks = Estimator(finger.image, structure.group, structure.scale), runs.grid.blocks
        self._stretches = []
        for stretch in runs.stretches:
            number = self._estimator.add_recording(stretch.arrays, stretch.kinematics)
            self._stretches.append((number, len(stretch.arrays["time"]), stretch.segment))

    def at(self, z: Numbers) -> Numbers:
        """Return [B, n, u] the derivatives of τ − T less the jumps by the unknowns z [u] (N·m each)."""
        slopes = np.empty((self._blocks, self._estimator.joints, len(z)))
        for number, samples, segment in self._stretches:
            length = samples // segment.count
            _, _, by_torque, by_jump = self._estimator.jacobian(number, z, 0, samples, length)
            if by_jump.any():
                by_torque += length * (np.cumsum(by_jump, axis=0) - 0.5 * by_jump)
            np.negative(by_torque, out=slopes[segment.blocks])
        return slopes


STEP = 1e-4  # of a coordinate: far above rounding, far below what moves many samples across a limit
BLOCKS, SHORTEST, FEWEST = 60, 2.0, 8  # stretches of scores: how many, and least length (s) and number
FARTHEST = float(np.log(1e6))  # of a logarithm from a number's magnitude
FLOOR = 1e-3  # of a joint's torque: a residual's rms below it gives a joint no more weight
LEAST_SPREAD = 0.04  # of the mean variance over the joints
WELL = 0.5  # of the fall that the derivatives predict: below, a step is bad
PATIENCE = 4  # bad steps, until derivatives are computed anew
RIGID = 1e12  # N/m
LEAST_FALL = 3e-4  # of the cost, for each joint and effective block, in rough fits
ROUNDS = 30  # of a step between bounds
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
    products: Numbers  # [u, u] of the columns, each joint by its blocks and spread
    information: Numbers  # [u, u] of the data
    gradient: Numbers  # [u] of the data's cost


class MemoryProblem:
    """Residuals of a structure over runs of the core, and their likelihood."""

    def __init__(self, structure: Structure, estimator: Estimator, runs: CoreRuns, drift: SlowDrift) -> None:
        self._structure, self.estimator, self.runs, self.drift = structure, estimator, runs, drift
        remembered = set(memory_paths(structure.start.data))
        self._paths = [path for path, k in structure.index.items() if structure.group[k] != FIXED]
        self._rows = [structure.index[path] for path in self._paths]
        unknowns, of_row = estimator.unknowns, {row: path for path, row in structure.index.items()}
        self.shared = [[of_row[row] for row in unknown.parameters] for unknown in unknowns]  # paths of each unknown
        log = np.array([unknown.path in remembered for unknown in unknowns])
        initial = {k: each.path for k, each in enumerate(unknowns) if each.path.startswith("bias.initial_torque[")}
        self._constants = {k: int(path.rpartition("[")[2][:-1]) - 1 for k, path in initial.items()}  # joints from 0
        self.scale = Scale(log, estimator.scale)
        ends = (np.array([getattr(unknown, end) for unknown in unknowns]) for end in ("lower", "upper"))
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = (self.scale.coordinates(end) for end in ends)
        self.lower = np.where(log, np.maximum(low, -FARTHEST), low)
        self.upper = np.where(log, np.minimum(high, FARTHEST), high)
        self.span: Numbers = np.eye(len(log))  # [u, v] directions that a step may take, in coordinates
        self.blocks = np.full(runs.joints, float(drift.used.sum()))  # N_j: those that count, all until it is measured
        self.spread = np.ones(runs.joints)  # p_j
        target = drift.without(runs.torque)
        self._floor = FLOOR**2 * np.mean(target**2, axis=0) + 1e-30
        self._laws = LawSlopes(structure, runs)
        self._by_runs = np.array([unknown.path.startswith("extensions[") for unknown in unknowns])
        self.mean, self.known = np.zeros(len(log)), np.zeros((len(log), len(log)))  # u_0 and P of the prior
        # directions, coordinates and derivatives of the last `linearised`: weights change without them
        self._last: tuple[Numbers, Numbers, Numbers] | None = None

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

    def unknowns_at(self, state: State) -> Numbers:
        """Return the unknowns z [u] of a state; `bias.initial_torque` is the constant that the residual leaves."""
        z = self.scale.unknowns(state.u)
        if self._constants:
            left = self.runs.residual(self._of_description(self.values(state.u)))[self.drift.used].mean(axis=0)
            for k, joint in self._constants.items():
                z[k] = left[joint]
        return z

    def cost(self, residual: Numbers, u: Numbers) -> float:
        """Return the negative log likelihood with the prior."""
        away = u - self.mean
        return float(0.5 * self.blocks.sum() * np.log(self._common(residual)) + 0.5 * away @ self.known @ away)

    def _common(self, residual: Numbers) -> float:
        """Return s²."""
        return float(self.blocks @ (self.variance(residual) / self.spread) / self.blocks.sum())

    def variance(self, residual: Numbers) -> Numbers:
        """Return Q, [n] ((N·m)²)."""
        return np.asarray(np.mean(residual**2, axis=0) + self._floor)

    def linearised(self, state: State) -> Linearised:
        """Return the derivatives by the directions of `span` at a state."""
        if self._last is None or self._last[0] is not self.span or not np.array_equal(self._last[1], state.u):
            self._last = self.span, state.u, self.drift.without(self._columns(state.u, self.span))
        columns = self._last[2]
        products = np.zeros((columns.shape[2],) * 2)
        for j, share in enumerate(self.blocks / self.spread):
            products += share * (columns[:, j].T @ columns[:, j])
        return self._of_columns(state, columns, products)

    def _of_columns(self, state: State, columns: Numbers, products: Numbers) -> Linearised:
        """Return what follows from derivatives [R, n, v] at a state, and their products [v, v]."""
        information = products / (len(state.residual) * self._common(state.residual))
        for k, joint in self._constants.items() if columns.shape[2] == len(self.scale.log) else ():
            information[k, k] += self.blocks[joint] / self.variance(state.residual)[joint] * self.scale.size[k] ** 2
        gradient = self._pull(columns, self._weight(state.residual) * state.residual)
        return Linearised(columns, products, information, gradient)

    def updated(self, linearised: Linearised, state: State, step: Numbers, tried: State, at: State) -> Linearised:
        """Return derivatives at one of two states that agree with the step [v] between them: Broyden's update."""
        way = step / max(float(step @ step), 1e-300)
        missed = tried.residual - state.residual - linearised.columns @ step
        weighted = missed * self.blocks / self.spread
        pull = np.outer(self._pull(linearised.columns, weighted), way)
        products = linearised.products + pull + pull.T + np.sum(missed * weighted) * np.outer(way, way)
        return self._of_columns(at, linearised.columns + missed[:, :, None] * way, products)

    def _pull(self, columns: Numbers, values: Numbers) -> Numbers:
        """Return [v] the products of derivatives with values [R, n]."""
        return np.asarray(values.ravel() @ columns.reshape(-1, columns.shape[2]))

    def columns(self, u: Numbers, chosen: Sequence[int]) -> Numbers:
        """Return [B, n, c] the derivatives of τ − T by the chosen of u (N·m)."""
        return self._columns(u, np.eye(len(u))[:, list(chosen)])

    def _weight(self, residual: Numbers) -> Numbers:
        """Return [n] what a block of each joint weighs."""
        return self.blocks / len(residual) / (self._common(residual) * self.spread)

    def reweighted(self, state: State) -> State:
        """Give each joint the weight that its residual shows, and return the state with its new cost."""
        variance = self.variance(state.residual)
        self.spread = np.maximum(variance / variance.mean(), LEAST_SPREAD)
        return replace(state, cost=self.cost(state.residual, state.u))

    def _columns(self, u: Numbers, span: Numbers) -> Numbers:
        """Return [B, n, v] the derivatives of τ − T by directions [u, v] of u (N·m): by runs where laws have none."""
        z = np.clip(self.scale.unknowns(u), *self.bounds)
        columns = self._laws.at(z)
        columns *= self.scale.slopes(z)
        if span.shape[1] < len(u):
            columns = columns @ span
        rest = np.where(self._by_runs[:, None], span, 0.0)
        moved = np.flatnonzero(rest.any(axis=0))
        moves = [self._move(way, u) for way in rest.T[moved]]
        columns[:, :, moved] += self.runs.columns(moves, self._of_description(self.values(u)))
        return columns

    def over(self, runs: CoreRuns) -> MemoryProblem:
        """Return the problem over other runs, for derivatives only."""
        other = copy(self)
        other.runs, other._laws, other._last = runs, LawSlopes(self._structure, runs), None
        return other

    def slopes(self, state: State) -> Numbers:
        """Return [B, n, u] the derivatives of T by the unknowns z (N·m each)."""
        return -self._columns(state.u, np.eye(len(state.u))) / self.scale.slopes(self.scale.unknowns(state.u))

    def scores(self, state: State, linearised: Linearised) -> tuple[Numbers, float]:
        """Return [K, u] the gradients of the data's cost by z over stretches of time, and their length (s)."""
        seconds = self.runs.grid.step * len(state.residual)
        length = min(max(seconds / BLOCKS, SHORTEST), seconds / FEWEST)
        size = max(1, round(length / self.runs.grid.step))
        weight = self._weight(state.residual)
        rows = np.einsum("rju,rj->ru", linearised.columns, state.residual * weight)
        sums = np.add.reduceat(rows, np.arange(0, len(rows), size), axis=0)
        scores = sums / self.scale.slopes(self.scale.unknowns(state.u))
        return scores - scores.mean(axis=0), length

    def _move(self, way: Numbers, u: Numbers) -> tuple[dict[str, float], float]:
        """Return the numbers a step along a way [u], and its length; it is backwards where it would cross a bound."""
        step = STEP * max(1.0, float(np.abs(u[(way != 0.0) & ~self.scale.log]).max(initial=0.0)))
        step = -step if (u + step * way > self.upper)[way != 0.0].any() else step
        return self._of_description(self.values(u + step * way)), step

    def without(self, state: State, path: str) -> float:
        """Return the cost at a state without a relaxation time, and all that share it, or with rigid cords."""
        least = RIGID if path.endswith(".stiffness") else 0.0
        values = self.values(state.u)
        shared = next(unknown for unknown in self.shared if path in unknown)
        left = self.runs.residual(self._of_description(values | dict.fromkeys(shared, least)))
        return self.cost(self.drift.without(left), state.u)

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
    rough: bool = False,
) -> Minimum:
    """Go down from a state, in at most `most` steps, until a step is below `tolerance` standard errors (rms).

    Every step, good or bad, corrects the derivatives (Broyden, Math. Comp. 19, 1965). They are computed anew after some
    bad ones, and near the end. A rough end has corrected ones.
    """
    state, damping, number, converged, span = begin, DAMPING[0], 0, False, problem.span
    least = LEAST_FALL * float(problem.blocks.sum()) if rough else 0.5 * tolerance**2
    linearised, is_fresh, bad = problem.linearised(state), True, 0
    while number < most:
        number += 1
        gradient = linearised.gradient + span.T @ problem.known @ (state.u - problem.mean)
        matrix = linearised.information + span.T @ problem.known @ span
        room = _room(span, problem.lower - state.u, problem.upper - state.u)
        step = bounded_step(matrix, gradient, damping, *room)
        tried = problem.state(np.clip(state.u + span @ step, problem.lower, problem.upper))
        expected = -float(gradient @ step + 0.5 * step @ matrix @ step)
        fall = state.cost - tried.cost
        is_small = step @ matrix @ step < tolerance**2 * len(step) or abs(fall) < least
        is_good = fall > WELL * expected
        better = tried if fall > 0.0 else state
        linearised, state = problem.updated(linearised, state, step, tried, better), better
        damping = max(damping / 5.0, DAMPING[1]) if is_good else damping if fall > 0.0 else 8.0 * damping
        if fall > 0.0 and watch is not None:
            watch(number, state)
        if (is_small and (is_fresh or rough)) or damping > DAMPING[2]:
            converged = True
            break
        bad = 0 if is_good else bad + 1
        is_fresh = is_small or bad > PATIENCE
        if is_fresh:
            linearised, bad = problem.linearised(state), 0
    return Minimum(state, linearised if rough else problem.linearised(state), number, converged)


def _room(span: Numbers, low: Numbers, high: Numbers) -> tuple[Numbers, Numbers]:
    """Return how far a step may go along each direction [v] before one of its numbers [u] is at a bound."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([low[:, None] / span, high[:, None] / span])
    ends[:, span == 0.0] = np.inf
    least = np.where(span == 0.0, -np.inf, ends.min(axis=0)).max(axis=0)
    return least, np.where(span == 0.0, np.inf, ends.max(axis=0)).min(axis=0)


def bounded_step(matrix: Numbers, gradient: Numbers, damping: float, low: Numbers, high: Numbers) -> Numbers:
    """Return the step that minimises the damped quadratic model between bounds, some of which it may be at."""
    diagonal = np.maximum(np.diag(matrix), 1e-12 * float(np.diag(matrix).max()) + 1e-300)
    length = np.sqrt(diagonal)
    scaled = matrix / np.outer(length, length) + (damping + 1e-10) * np.eye(len(length))
    right, least, most = -gradient / length, low * length, high * length
    at_low = at_high = np.zeros(len(length), dtype=bool)
    step = np.zeros(len(length))
    for _ in range(ROUNDS):  # all that is beyond a bound stays there, until it is pulled back
        free = ~(at_low | at_high)
        step = np.where(at_low, least, np.where(at_high, most, 0.0))
        own = cho_factor(scaled[np.ix_(free, free)], check_finite=False)
        step[free] = cho_solve(own, (right - scaled @ step)[free], check_finite=False)
        pull = scaled @ step - right
        lower = np.where(free, step < least, at_low & (pull > 0.0))
        upper = np.where(free, step > most, at_high & (pull < 0.0))
        if (lower == at_low).all() and (upper == at_high).all():
            break
        at_low, at_high = lower, upper
    return np.asarray(np.clip(step, least, most) / length)
