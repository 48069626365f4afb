"""Recordings and a description made into the problem that `naming.Selection` solves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.block_averages import Blocks
from tendonfmu.candidate_columns import CandidateColumns, candidate_columns
from tendonfmu.diagnosis_series import Bank, Columns, Grid, Series, Trial, block_prediction, make_series
from tendonfmu.fit_recordings import FitRecording
from tendonfmu.fit_residuals import bias_settings
from tendonfmu.nuisance import KNOTS, TRENDS, basis, bias_splines, constant_bias, without
from tendonfmu.regressors import predicted_forces
from tendonfmu.significance import Problem, residual_of

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]
Array = NDArray[Any]

LEAST_SHARE = 0.01  # of a candidate's variance that has to survive the refit for it to be visible


@dataclass(frozen=True)
class View:
    """A description and what it may lack, on all recordings.

    predicted: the recordings with the forces that the model predicts. bias: [B, s] splines. residual: [B, n] N·m, bias
    and all that refitting can mend taken off. shares: [T] of each trial's variance that survives. eligible: [T] whether
    it is visible.
    """

    data: Mapping[str, Any]
    recordings: Sequence[FitRecording]
    predicted: Sequence[FitRecording]
    problem: Problem
    columns: CandidateColumns
    bias: Numbers
    residual: Numbers
    shares: Numbers

    @property
    def series(self) -> Series:
        return self.problem.series

    @property
    def eligible(self) -> list[bool]:
        return [bool(share >= LEAST_SHARE) for share in self.shares]


def look(
    data: Mapping[str, Any],
    recordings: Sequence[FitRecording],
    grid: Grid,
    left_out: Flags | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> View:
    """data: a fitted description. left_out: [B] blocks that are not looked at."""
    series = series_of(data, recordings, grid, left_out)
    splines = bias_of(data, series)
    predicted = predicted_of(data, recordings, grid, series)
    columns = candidate_columns(data, predicted, blocks_of(grid, recordings), progress=progress)
    trends = bias_of(data, series, TRENDS)
    problem = Problem(series, bank_of(columns), trends, columns.nominal)
    residual = residual_of(series, splines, columns.nominal)
    shares = surviving_shares(replace(problem, splines=splines))
    return View(data, recordings, predicted, problem, columns, splines, residual, shares)


def series_of(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, left_out: Flags | None = None
) -> Series:
    """left_out: [B] blocks that are not used."""
    series = make_series(data, recordings, grid, block_prediction(data, recordings, grid))
    return series if left_out is None else replace(series, used=series.used & ~left_out)


def predicted_of(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, series: Series
) -> list[FitRecording]:
    """The recordings with the forces that the description predicts; series: of it."""
    nothing = np.zeros((*series.target.shape, 0))
    return predicted_forces(data, recordings, grid, series, residual_of(series, bias_of(data, series), nothing))


def bias_of(data: Mapping[str, Any], series: Series, knots: float = KNOTS) -> Numbers:
    """[B, s]: splines, or constants where the description says that the bias does not wander. knots: s apart."""
    return bias_splines(series, knots) if bias_settings(data).drift > 0 else constant_bias(series)


def blocks_of(grid: Grid, recordings: Sequence[FitRecording]) -> Blocks:
    """The grid's blocks, as `candidate_columns` takes them."""
    found = [np.full(len(recording.time), -1, dtype=np.int64) for recording in recordings]
    for segment in grid.segments:
        numbers = np.repeat(np.arange(segment.first, segment.first + segment.count), segment.samples)
        found[segment.recording][segment.part.start : segment.part.start + len(numbers)] = numbers
    return Blocks(tuple(found), grid.blocks)


def bank_of(columns: CandidateColumns) -> Bank:
    """Every shape of every proposal as a trial; its origin is (proposal, shape)."""
    trials = [
        Trial(
            effect=proposal.candidate.name,
            joint=proposal.place.joint,
            tendon=proposal.place.tendon,
            signs=tuple(shape.signs),
            shape=shape.shape,
            first=shape.columns.start,
            count=shape.columns.stop - shape.columns.start,
            origin=(proposal, shape),
        )
        for proposal in columns.proposals
        for shape in proposal.shapes
    ]
    return Bank(Columns(columns.values, tuple(columns.names)), tuple(trials))


def surviving_shares(problem: Problem) -> Numbers:
    """[T] share of each trial's variance that bias and refit leave, of its columns' combination that keeps most."""
    series, values = problem.series, problem.bank.columns.values
    used = series.used
    span = basis(problem.splines[used])
    joints = values.shape[1]
    nominal = np.asarray(problem.nominal[used], dtype=np.float64)
    own = np.stack([without(nominal[:, j], span) for j in range(joints)], axis=1)
    refit = basis(own.reshape(own.shape[0] * joints, own.shape[2]))
    found = np.zeros(len(problem.bank.trials))
    for k, trial in enumerate(problem.bank.trials):
        columns = np.asarray(values[used, :, trial.first : trial.first + trial.count], dtype=np.float64)
        columns = columns - columns.mean(axis=0)
        left = np.stack([without(columns[:, j], span) for j in range(joints)], axis=1)
        found[k] = _largest_share(columns.reshape(-1, trial.count), without(left.reshape(-1, trial.count), refit))
    return found


def _largest_share(whole: Numbers, left: Numbers) -> float:
    length = np.sqrt(np.einsum("rc,rc->c", whole, whole))
    if not (length > 0).any():
        return 0.0
    whole, left = whole[:, length > 0] / length[length > 0], left[:, length > 0] / length[length > 0]
    power, direction = np.linalg.eigh(whole.T @ whole)
    kept = power > 1e-6 * power[-1]
    scaled = left @ (direction[:, kept] / np.sqrt(power[kept]))
    return float(np.linalg.eigvalsh(scaled.T @ scaled)[-1])
