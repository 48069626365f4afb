"""The method `batch` for a finger whose friction remembers: starts, weights, prior and uncertainty about `memory_fit`.

1. From each start of the memory's numbers (`memory.starts`) a few steps on evenly spread windows of the recordings.
2. The best is refined on `FITTED_TIME`. A prior that held it back here would make the errors of a wrong model last.
3. The residuals of all samples say how many independent blocks they are worth, and the prior is the one under which the
   data are most likely (`prior`). With both it is refined on all samples, if they are many with few derivatives.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.estimate.core_runs import RATE, CoreRuns, SlowDrift, slowest_drift
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.learning import (
    GUESS,
    FitProgress,
    Interrupted,
    Learned,
    MemoryEvidence,
    Prior,
    Settings,
    Watch,
    inverse,
    most_likely,
    posterior_factor,
)
from tendonfmu.estimate.memory import starts
from tendonfmu.estimate.memory_fit import MemoryProblem, Minimum, State, minimise
from tendonfmu.estimate.structure import Structure
from tendonfmu.recordings import FitRecording, Grid, Segment, make_grid
from tendonfmu.statistics import sample_weights

STEP = 0.02  # s, blocks of a fit: friction changes in tens of milliseconds
COARSE_RATE = 200.0  # Hz: averaged samples leave 0.1 to 0.4 mN·m (elements with relaxation within 2 ms) more
COARSE_TIME, WINDOW = 30.0, 10.0  # s in all, and of a window: enough to tell starts apart
FITTED_TIME = 240.0  # s of windows that a long fit is made on, before it is refined on all samples
ROUGH_STEPS, COARSE_STEPS, POLISHED = 14, 8, 2  # from each start; of the best ones with all numbers; how many these are
SAME = 0.3  # of a logarithm
NEAR = 0.3  # standard errors (rms) if each block counted: where a fit is refined
FACTOR = np.log(10.0)  # expected error of a logarithm: nobody knows these numbers better than by a factor
_MOVES = 0.05  # of the largest speed of a joint: what is slower is no stroke

Shown = Callable[[MemoryProblem, str], Callable[[int, State], None]]  # what watches the steps of a phase


def no_show(_problem: MemoryProblem, _what: str) -> Callable[[int, State], None]:
    """Watch nothing."""
    return lambda _number, _state: None


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
    runs = CoreRuns(structure.start, recordings, windows(grid), rate=COARSE_RATE, threads=threads)
    problem = MemoryProblem(structure, estimator, runs, SlowDrift(runs.time, runs.stretch, runs.used))
    problem.mean, problem.known = guess_prior(problem)
    return problem


def guess_prior(problem: MemoryProblem) -> tuple[Numbers, Numbers]:
    """Return mean [u] and information [u, u] of coordinates that were guessed: off by their size, or by a factor."""
    size = np.where(problem.scale.log, FACTOR, 1.0)
    return problem.scale.coordinates(problem.estimator.start), np.diag(size**-2.0)


def from_starts(
    problem: MemoryProblem,
    begin: Numbers,
    tolerance: float,
    watch: Callable[[int, State], None],
    memories: Iterable[Mapping[str, float]] | None = None,
) -> list[State]:
    """Go a few steps down from each start of the memory about z = `begin` [u]; return the best ends, the best first.

    `memories`: numbers of the memory by path to start from; None: those of `starts`. First the numbers of the memory
    and one factor for all friction of a kind move, then all numbers of the best.
    """
    places = {unknown.path: k for k, unknown in enumerate(problem.estimator.unknowns)}
    first = problem.scale.coordinates(begin)
    whole = problem.span
    problem.span = _few_directions(problem, first)
    ends: list[State] = []
    for start in starts(problem.runs.finger.data) if memories is None else memories:
        u = first.copy()
        for path, value in start.items():
            if path in places:
                u[places[path]] = np.log(value / problem.scale.size[places[path]])
        u = np.clip(u, problem.lower, problem.upper)
        ends.append(minimise(problem, problem.state(u), ROUGH_STEPS, tolerance, watch, rough=True).state)
    problem.span = whole
    best = _distinct(sorted(ends, key=lambda state: state.cost), problem)[:POLISHED]
    polished = [minimise(problem, end, COARSE_STEPS, tolerance, watch, rough=True).state for end in best]
    return sorted(polished, key=lambda state: state.cost)


def _few_directions(problem: MemoryProblem, u: Numbers) -> Numbers:
    """Return [u, v]: each number of the memory, and all other numbers of a kind and role by one factor."""
    groups: dict[str, Numbers] = {}
    for k, unknown in enumerate(problem.estimator.unknowns):
        kind = re.sub(r"\[\d+\]", "", unknown.name)
        name = unknown.name if problem.scale.log[k] or unknown.role not in ("coulomb", "value") else kind
        if problem.scale.log[k] or unknown.role in ("coulomb", "value"):
            groups.setdefault(name, np.zeros(len(u)))[k] = 1.0 if problem.scale.log[k] else u[k] or 1.0
    return np.column_stack(list(groups.values()))


def _distinct(ends: list[State], problem: MemoryProblem) -> list[State]:
    """Return the ends whose memory differs from that of all better ones by more than SAME in a logarithm."""
    kept: list[State] = []
    for end in ends:
        if all(np.abs(end.u - other.u)[problem.scale.log].max(initial=0.0) > SAME for other in kept):
            kept.append(end)
    return kept


def full_problem(
    structure: Structure, estimator: Estimator, recordings: Sequence[FitRecording], grid: Grid, threads: int
) -> MemoryProblem:
    """Return the problem over all samples, whose drift is the slowest that the rests demand."""
    rate = RATE if grid.step < 2.0 * STEP else COARSE_RATE  # long blocks see less of what is fast
    runs = CoreRuns(structure.start, recordings, grid, rate=rate, threads=threads)
    drift = slowest_drift(runs.residual(), runs.time, runs.stretch, runs.used, runs.still)
    return MemoryProblem(structure, estimator, runs, drift)


def effective_blocks(problem: MemoryProblem, state: State) -> tuple[Numbers, list[Numbers]]:
    """Return N_j [n], and by stretch [n] the share of an independent block that each block counts for."""
    runs = problem.runs
    whole = np.full((len(runs.used), runs.joints), np.nan)
    whole[runs.used] = state.residual / np.sqrt(problem.variance(state.residual))
    shares = []
    for segment in runs.grid.segments:
        rows = segment.blocks
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
    settings: Settings,
    shown: Shown = no_show,
) -> tuple[MemoryProblem, State, int]:
    """Fit windows roughly from several starts, each block counting as one, under the prior of guesses.

    Returns the problem of all samples, its state there, and the number of steps.
    """
    threads, tolerance = settings.options.threads, settings.options.tolerance
    grid = make_grid(recordings, STEP)
    whole = full_problem(structure, estimator, recordings, grid, threads)
    part = windows(grid, FITTED_TIME)
    problem = whole if part is grid else full_problem(structure, estimator, recordings, part, threads)
    for each in (whole, problem):
        each.mean, each.known = guess_prior(each)
    u = problem.scale.coordinates(begin)
    if not settings.near:
        coarse = coarse_problem(structure, estimator, recordings, grid, threads)
        u = from_starts(coarse, begin, tolerance, shown(coarse, "starts"))[0].u
    watch = shown(problem, "windows" if problem is not whole else "all samples")
    found = minimise(problem, problem.state(u), settings.passes, max(tolerance, NEAR), watch)
    return whole, found.state if problem is whole else whole.state(found.state.u), found.steps


# --- the method -------------------------------------------------------------------------------------------------------


def learn_with_memory(
    structure: Structure,
    estimator: Estimator,
    recordings: Sequence[FitRecording],
    watch: Watch,
    settings: Settings,
    begin: Numbers,
) -> Learned:
    """Estimate all numbers together, from z = `begin` [u] and the starts of the memory. Raises Interrupted."""
    passes = 0

    def shown(problem: MemoryProblem, what: str) -> Callable[[int, State], None]:
        def show(number: int, state: State) -> None:
            nonlocal passes
            passes += 1
            blocks = problem.runs.grid.blocks
            if not watch(FitProgress(f"step {number}, {what}", passes, blocks, blocks, state.cost)):
                raise Interrupted(estimator, problem.scale.unknowns(state.u), watch.by_user)

        return show

    try:
        problem, first, steps = minimum_from_starts(structure, estimator, recordings, begin, settings, shown)
        last, prior, shares = _weighted(problem, first, settings, shown)
        weights = _weights(problem, recordings, shares)
        return learned_of(problem, last, prior, settings.options.prior, weights, steps, passes)
    except KeyboardInterrupt:
        raise Interrupted(estimator, begin, by_user=True) from None


def _weighted(
    problem: MemoryProblem, first: State, settings: Settings, shown: Shown
) -> tuple[Minimum, Prior, list[Numbers]]:
    """Refine a state with the effective number of blocks and the most likely prior.

    Returns minimum, prior, and by stretch [n] the share of an independent block that each block counts for.
    """
    prior, grid = coordinate_prior(problem, settings), problem.runs.grid
    given, shares = settings.options.prior, [np.ones(problem.runs.joints)] * len(grid.segments)
    if settings.options.effective_samples:
        problem.blocks, shares = effective_blocks(problem, first)
    problem.reweighted(first)
    if given is None:
        now = problem.linearised(first)
        pull = now.information @ (first.u - problem.mean) - now.gradient
        covariance = most_likely(now.information, pull, prior)
    else:
        covariance = prior.of_spread(given)
    problem.known = inverse(covariance)
    again, is_long = problem.reweighted(first), windows(grid, FITTED_TIME) is not grid
    show = shown(problem, "effective samples")
    return minimise(problem, again, settings.passes, settings.options.tolerance, show, rough=is_long), prior, shares


def learned_of(
    problem: MemoryProblem,
    last: Minimum,
    prior: Prior,
    given: float | None,
    weights: list[Numbers],
    steps: int,
    passes: int,
) -> Learned:
    """Return what a minimum tells, in unknowns z instead of coordinates u."""
    z = problem.unknowns_at(last.state)
    turn = problem.scale.slopes(z)
    information, both = last.linearised.information, np.outer(turn, turn)
    known = prior.reported(given)
    factor, _ = posterior_factor(information, known)
    return Learned(
        estimator=problem.estimator,
        z=z,
        covariance=both * (factor @ factor.T),
        prior=both * known,
        information=information / both,
        cost=last.state.cost,
        iterations=steps + last.steps,
        passes=passes,
        converged=last.converged,
        weights=weights,
        warnings=[] if last.converged else [f"not converged after {passes} steps"],
        memory=MemoryEvidence(problem, last),
    )


def coordinate_prior(problem: MemoryProblem, settings: Settings) -> Prior:
    """Return the prior of the coordinates u about the numbers of the description."""
    of_z = Prior.of(problem.estimator, settings)
    turn = problem.scale.slopes(problem.estimator.start)
    size = np.where(problem.scale.log, FACTOR / GUESS, of_z.size / problem.scale.size)
    size = np.where(problem.scale.log & of_z.estimated, 1.0, size)
    return Prior(of_z.covariance / np.outer(turn, turn), size, of_z.estimated)


def _weights(problem: MemoryProblem, recordings: Sequence[FitRecording], shares: list[Numbers]) -> list[Numbers]:
    """Return by recording [N, n] the share of an independent sample that each sample counts for."""
    weights = [np.ones_like(recording.target) for recording in recordings]
    for segment, share in zip(problem.runs.grid.segments, shares, strict=True):
        weights[segment.recording][segment.part] = share / segment.samples
    return weights


def learned_with_memory_at(
    structure: Structure, estimator: Estimator, recordings: Sequence[FitRecording], settings: Settings
) -> Learned:
    """Return what recordings tell of numbers that were fitted to them; the estimate is the start of the structure."""
    problem = full_problem(structure, estimator, recordings, make_grid(recordings, STEP), settings.options.threads)
    problem.mean = problem.scale.coordinates(estimator.start)
    state = problem.state(problem.mean)
    problem.blocks, shares = effective_blocks(problem, state)
    here = Minimum(state, problem.linearised(state), 0, converged=True)
    weights = _weights(problem, recordings, shares)
    return learned_of(problem, here, coordinate_prior(problem, settings), None, weights, 0, 1)
