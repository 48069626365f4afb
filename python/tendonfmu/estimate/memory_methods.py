"""The method `batch` for a finger whose friction remembers: starts, weights, prior and uncertainty about `memory_fit`.

1. From each start of the memory's numbers (`memory.starts`) a few steps on evenly spread windows of the recordings.
2. The best two are refined on all of them, with each block counting as one.
3. The residuals say how many independent blocks they are worth, and the prior is the one under which the data are most
   likely (`prior`). With both the better one is refined again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.estimate.core_runs import CoreRuns
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.memory import starts
from tendonfmu.estimate.memory_fit import MemoryProblem, Minimum, State, minimise
from tendonfmu.estimate.slow_drift import SlowDrift, slowest_drift
from tendonfmu.estimate.structure import Structure
from tendonfmu.recordings import FitRecording, Grid, Segment, make_grid
from tendonfmu.statistics import sample_weights

COARSE_RATE = 200.0  # Hz, and s in all: enough to tell starts apart
COARSE_TIME, WINDOW = 30.0, 10.0
COARSE_STEPS, REFINED = 6, 2  # steps from each start, and starts that are refined
FACTOR = np.log(10.0)  # expected error of a logarithm: nobody knows these numbers better than by a factor
_MOVES = 0.05  # of the largest speed of a joint: what is slower is no stroke


def windows(grid: Grid, seconds: float = COARSE_TIME) -> Grid:
    """Return a grid of evenly spread windows of about `seconds` in all; all of it if it has no more."""
    total = grid.blocks * grid.step
    if total <= 1.5 * seconds:
        return grid
    segments: list[Segment] = []
    first = 0
    for segment in grid.segments:
        count = max(1, round(seconds * segment.count / grid.blocks / WINDOW))
        length = int(seconds * segment.count / grid.blocks / count / grid.step)
        for k in range(count):
            begin = (2 * k + 1) * segment.count // (2 * count) - length // 2
            start = segment.part.start + max(begin, 0) * segment.samples
            part = slice(start, start + length * segment.samples)
            if length:
                segments.append(replace(segment, part=part, first=first, count=length))
                first += length
    return Grid(tuple(segments), grid.step)


def coarse_problem(
    structure: Structure, estimator: Estimator, recordings: Sequence[FitRecording], grid: Grid, threads: int
) -> MemoryProblem:
    """Return the problem over few windows at a low rate, with the prior of guesses."""
    runs = CoreRuns(structure.start.data, recordings, windows(grid), rate=COARSE_RATE, threads=threads)
    problem = MemoryProblem(structure, estimator, runs, SlowDrift(runs.time, runs.stretch, runs.used))
    problem.mean = problem.scale.coordinates(estimator.start)
    problem.known = np.diag(guess_size(problem, estimator) ** -2.0)
    return problem


def guess_size(problem: MemoryProblem, estimator: Estimator) -> Numbers:
    """Return [u] by how much the numbers of a guess are off, in coordinates."""
    return np.where(problem.scale.log, FACTOR, estimator.scale / problem.scale.size)


def from_starts(problem: MemoryProblem, begin: Numbers, tolerance: float) -> list[State]:
    """Go a few steps down from each start of the memory about z = `begin` [u]; return the ends, the best first."""
    places = {unknown.path: k for k, unknown in enumerate(problem.estimator.unknowns)}
    first = problem.scale.coordinates(begin)
    ends = []
    for start in starts(problem.runs.data):
        u = first.copy()
        for path, value in start.items():
            if path in places:
                u[places[path]] = np.log(value / problem.scale.size[places[path]])
        u = np.clip(u, problem.lower, problem.upper)
        if not any(np.array_equal(u, end.u) for end in ends):
            ends.append(minimise(problem, problem.state(u), COARSE_STEPS, tolerance).state)
    return sorted(ends, key=lambda state: state.cost)


def full_problem(
    structure: Structure, estimator: Estimator, recordings: Sequence[FitRecording], grid: Grid, threads: int
) -> MemoryProblem:
    """Return the problem over all samples, whose drift is the slowest that the rests demand."""
    runs = CoreRuns(structure.start.data, recordings, grid, threads=threads)
    drift = slowest_drift(runs.residual(), runs.time, runs.stretch, runs.used, runs.still)
    return MemoryProblem(structure, estimator, runs, drift)


def effective_blocks(problem: MemoryProblem, state: State) -> tuple[Numbers, list[Numbers]]:
    """Return N_j [n], and by stretch [n] the share of an independent block that each block counts for."""
    runs = problem.runs
    whole = np.full((len(runs.used), runs.joints), np.nan)
    whole[runs.used] = state.residual / np.sqrt(problem.variance(state.residual))
    shares = []
    for number, segment in enumerate(runs.grid.segments):
        rows = runs.stretch == number
        shares.append(sample_weights(whole[rows], runs.grid.step, stroke_time(runs.speed[rows], runs.grid.step)))
    counts = [np.count_nonzero(runs.used[segment.blocks]) for segment in runs.grid.segments]
    worth = np.sum([count * share for count, share in zip(counts, shares, strict=True)], axis=0)
    return np.maximum(worth, 1.0), shares


def stroke_time(joint_speed: Numbers, step: float) -> float:
    """Return the mean time (s) between reversals of any joint."""
    reversals = 1
    for speed in joint_speed.T:
        moving = speed[np.abs(speed) > _MOVES * np.abs(speed).max(initial=0.0)]
        reversals += np.count_nonzero(np.diff(np.sign(moving)))
    return step * len(joint_speed) / reversals


def minimum_from_starts(
    structure: Structure,
    estimator: Estimator,
    recordings: Sequence[FitRecording],
    begin: Numbers,
    tolerance: float,
    threads: int = 0,
    most: int = 30,
) -> tuple[MemoryProblem, Minimum]:
    """Fit from several starts with each block counting as one, under the prior of guesses."""
    grid = make_grid(recordings)
    coarse = coarse_problem(structure, estimator, recordings, grid, threads)
    ends = from_starts(coarse, begin, tolerance)
    problem = full_problem(structure, estimator, recordings, grid, threads)
    problem.mean, problem.known = coarse.mean, coarse.known
    found = [minimise(problem, problem.state(end.u), most, tolerance) for end in ends[:REFINED]]
    return problem, min(found, key=lambda each: each.state.cost)
