"""How a description and recordings look as columns: what the description leaves, and what every effect would add."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.diagnosis.candidate_columns import CandidateColumns, candidate_columns, without_uncertainty
from tendonfmu.diagnosis.cause import Cause, Key
from tendonfmu.diagnosis.confirmation import Confirmation
from tendonfmu.diagnosis.effects import CANDIDATES, Candidate
from tendonfmu.diagnosis.hypotheses import hypotheses
from tendonfmu.diagnosis.least_sizes import LeastSizes
from tendonfmu.diagnosis.regressors import predicted_forces
from tendonfmu.diagnosis.selection import Selection
from tendonfmu.diagnosis.series import Grid, Series, block_prediction, make_series
from tendonfmu.estimate import Estimator
from tendonfmu.model import moment_arms, native
from tendonfmu.recordings import FitRecording, bias_settings
from tendonfmu.statistics import (
    KNOTS,
    TRENDS,
    Folds,
    Grams,
    Products,
    SampleBlocks,
    Splines,
    bias_splines,
    constant_bias,
    make_folds,
    residual_of,
)


@dataclass(frozen=True)
class View:
    """A description and what it may lack, on all recordings."""

    data: Mapping[str, Any]
    recordings: Sequence[FitRecording]
    predicted: Sequence[FitRecording]  # the recordings with the forces that the model predicts
    series: Series
    splines: Splines  # splines of the slow bias [B, s]
    columns: CandidateColumns
    folds: Folds
    grams: Grams  # products of all columns
    least: LeastSizes  # sizes that the sensors can show

    @cached_property
    def selection(self) -> Selection:
        reach = np.abs(self.series.angle[self.series.used]).max(axis=0, initial=0.0)
        return Selection(self.grams, hypotheses(self.columns, moment_arms(self.data), reach), self.least)

    def beside(self, keys: Collection[Key]) -> Selection:
        """Return what is missing if these causes are present, each with all its shapes at that place."""
        known = [cause for cause in self.selection.causes if cause.key in keys]
        return Selection(self.grams, self.selection.causes, self.least, known) if known else self.selection

    @cached_property
    def residual(self) -> Numbers:
        """Residual without the bias and all that refitting can explain, N·m [B, n]."""
        return residual_of(self.series, self.splines, self.columns.nominal)

    @cached_property
    def confirmation(self) -> Confirmation:
        trends = bias_of(self.data, self.series, TRENDS)
        return Confirmation(self.series, self.folds, self.splines, trends, self.columns.nominal)

    def p_value(self, cause: Cause) -> float:
        """Return the probability of such a result by chance, corrected for all candidates that were tried."""
        mix = cause.direction.mix
        used = np.flatnonzero(mix.any(axis=1))
        columns = self.columns.values[:, :, used].astype(np.float64) @ mix[used]
        return self.confirmation.p_value(columns, len(self.columns.proposals))


def look(
    data: Mapping[str, Any],
    recordings: Sequence[FitRecording],
    grid: Grid,
    least: LeastSizes,
    left_out: Flags | None = None,
    progress: Callable[[int, int], None] | None = None,
    candidates: Sequence[Candidate] = CANDIDATES,
) -> View:
    """Compute the view of a fitted description; blocks in `left_out` [B] are ignored."""
    series = series_of(data, recordings, grid, left_out)
    splines = bias_of(data, series)
    predicted = predicted_of(data, recordings, grid, series)
    columns = candidate_columns(
        data,
        predicted,
        blocks_of(grid, recordings),
        candidates=candidates,
        worth=least.worth,
        progress=progress,
    )
    folds = make_folds(series)
    products = Products(folds, columns.nominal, columns.values, splines)
    grams = Grams(products, series.target, nominal_scale(data))
    return View(data, recordings, predicted, series, splines, columns, folds, grams, least)


def nominal_scale(data: Mapping[str, Any]) -> Numbers:
    """Return how large each number that a fit of the description estimates is expected to be [u]."""
    estimator = Estimator(native.image_from_json(json.dumps(without_uncertainty(data))))
    return np.array([unknown.scale for unknown in estimator.unknowns if not unknown.path.startswith("bias.")])


def series_of(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, left_out: Flags | None = None
) -> Series:
    """Return the block means of a description's signals and residual."""
    # left_out: [B]; returns block means [B, ...] with `target` = y − G, N·m
    series = make_series(data, recordings, grid, block_prediction(data, recordings, grid))
    return series if left_out is None else replace(series, used=series.used & ~left_out)


def predicted_of(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, series: Series
) -> list[FitRecording]:
    """Return the recordings with the forces that the description predicts."""
    return predicted_forces(data, recordings, grid, series, residual_alone(data, series))


def residual_alone(data: Mapping[str, Any], series: Series) -> Numbers:
    """Return what the description leaves with its numbers as they are, bias removed, N·m [B, n]."""
    return residual_of(series, bias_of(data, series), np.zeros((*series.target.shape, 0)))


def bias_of(data: Mapping[str, Any], series: Series, knots: float = KNOTS) -> Splines:
    """Return the columns of the bias [B, s]: splines, or constants if the description's bias does not drift."""
    return bias_splines(series, knots) if bias_settings(data).drift > 0 else constant_bias(series)


def blocks_of(grid: Grid, recordings: Sequence[FitRecording]) -> SampleBlocks:
    """Return the grid's blocks in the form that `candidate_columns` takes."""
    numbers_of = [np.full(len(recording.time), -1, dtype=np.int64) for recording in recordings]
    for segment in grid.segments:
        numbers = np.repeat(np.arange(segment.first, segment.first + segment.count), segment.samples)
        numbers_of[segment.recording][segment.part.start : segment.part.start + len(numbers)] = numbers
    return SampleBlocks(tuple(numbers_of), grid.blocks)
