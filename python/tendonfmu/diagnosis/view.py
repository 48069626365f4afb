"""How a description and recordings look as columns: what the description leaves, and what every effect would add.

Columns are computed at the forces that the model itself predicts. The joint torque to be explained is computed from
the measured forces, and so is every column that contains a force. So the part of the torque that no model explains is
in both, and a column that carries it would fit the noise and appear as a cause of every recording. Predicted are the
measured forces less the unexplained torque, which is spread over the tendons as the smallest forces that produce it
(errors in variables; instrument).
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
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
from tendonfmu.diagnosis.selection import Selection
from tendonfmu.diagnosis.series import Series, block_prediction, exact_model, make_series
from tendonfmu.estimate import Estimator
from tendonfmu.model import moment_arms, native, number_of
from tendonfmu.recordings import FitRecording, Grid, sample_blocks
from tendonfmu.statistics import (
    KNOTS,
    TRENDS,
    Folds,
    Grams,
    Products,
    Splines,
    bias_splines,
    constant_bias,
    make_folds,
    residual_of,
)

MOST_SHIFT = 10.0  # times the largest measured force


@dataclass(frozen=True)
class View:
    """A description and what it may lack, on all recordings."""

    data: Mapping[str, Any]
    recordings: Sequence[FitRecording]
    predicted: Sequence[FitRecording]  # the recordings with the forces that the model predicts
    series: Series
    splines: Splines  # splines of the slow bias [B, s]
    columns: CandidateColumns
    least: LeastSizes  # sizes that the sensors can show

    @cached_property
    def folds(self) -> Folds:
        return make_folds(self.series)

    @property
    def lean(self) -> View:
        """The view without the columns of candidates, which take most of the memory."""
        nominal, none = self.columns.nominal.copy(), self.columns.values[:, :, :0].copy()
        return replace(self, columns=replace(self.columns, nominal=nominal, values=none, proposals=()))

    @cached_property
    def grams(self) -> Grams:
        """Products of all columns."""
        products = Products(self.folds, self.columns.nominal, self.columns.values, self.splines)
        return Grams(products, self.series.target, nominal_scale(self.data))

    @cached_property
    def selection(self) -> Selection:
        return Selection(self.grams, self.candidates, self.least)

    @property
    def candidates(self) -> list[Cause]:
        """All effects that the description may lack."""
        reach = np.abs(self.series.angle[self.series.used]).max(axis=0, initial=0.0)
        return hypotheses(self.columns, moment_arms(self.data), reach)

    def beside(self, keys: Collection[Key]) -> Selection:
        """Return what is missing if these causes are present, each with all its shapes at that place."""
        whole = self.selection
        known = [cause for cause in whole.causes if cause.key in keys]
        return Selection(self.grams, whole.causes, self.least, known, whole.shares) if known else whole

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
    candidates: Sequence[Candidate] = CANDIDATES,
) -> View:
    """Compute the view of a fitted description; blocks in `left_out` [B] are ignored."""
    series = series_of(data, recordings, grid, left_out)
    splines = bias_of(data, series)
    predicted = predicted_of(data, recordings, grid, series)
    columns = candidate_columns(
        data,
        predicted,
        sample_blocks(grid, recordings),
        candidates=candidates,
        worth=least.worth,
    )
    return View(data, recordings, predicted, series, splines, columns, least)


def nominal_scale(data: Mapping[str, Any]) -> Numbers:
    """Return how large each number that a fit of the description estimates is expected to be [u]."""
    estimator = Estimator(native.image_from_json(json.dumps(without_uncertainty(data))))
    return np.array([unknown.scale for unknown in estimator.unknowns if not unknown.path.startswith("bias.")])


def series_of(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, left_out: Flags | None = None
) -> Series:
    """Return the block means of a description's signals and residual."""
    # left_out: [B]; returns block means [B, ...] with `target` = y − G, N·m
    series = make_series(data, recordings, grid, block_prediction(data, recordings, sample_blocks(grid, recordings)))
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
    return bias_splines(series, knots) if number_of(data, "bias.drift_variance") > 0 else constant_bias(series)


# --- forces that a model predicts ------------------------------------------------------------------------------------


def predicted_forces(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, series: Series, residual: Numbers
) -> list[FitRecording]:
    """Return the recordings with predicted forces, and with tendon positions that keep the joint angles as measured."""
    arms = moment_arms(data)
    spread = np.linalg.pinv(arms)
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]])
    pulls = np.array([not tendon.get("bidirectional") for tendon in data["tendons"]])
    moved = []
    for number, recording in enumerate(recordings):
        groups = dict(recording.recording.groups)
        force = groups["tendon_force"]
        most = MOST_SHIFT * np.abs(force).max(initial=0.0)  # a model that explains nothing predicts no forces either
        shift = np.clip(_unexplained(data, recording, number, grid, series, residual) @ spread, -most, most)
        predicted = np.where(pulls & (force > 0), np.maximum(force - shift, 0.0), force - shift)
        groups["tendon_force"] = predicted
        if "tendon_position" in groups:
            # a description with a delay pairs the present position with the force `delay` s later
            change = _shifted(recording, (predicted - force) / stiffness, _delay(data))
            groups["tendon_position"] = groups["tendon_position"] + change
        moved.append(replace(recording, recording=replace(recording.recording, groups=groups)))
    return moved


def _delay(data: Mapping[str, Any]) -> float:
    """Return by how many seconds forces come later than positions, according to the description."""
    rows = data.get("extensions") or []
    return float(sum(row["delay"] for row in rows if row["effect"] == "time_delay"))


def _shifted(recording: FitRecording, values: Numbers, delay: float) -> Numbers:
    """Return the values [N, m] of `delay` s later, within each part."""
    if not delay:
        return values
    shifted: Numbers = values.copy()
    for part in recording.parts:
        time = recording.time[part]
        for i in range(values.shape[1]):
            shifted[part, i] = np.interp(time + delay, time, values[part, i])
    return shifted


def _unexplained(
    data: Mapping[str, Any], recording: FitRecording, number: int, grid: Grid, series: Series, residual: Numbers
) -> Numbers:
    """Return the unexplained torque at every sample [N, n], N·m; 0 at samples that are not trained on."""
    model = exact_model(data, recording)
    unexplained = np.zeros_like(recording.target)
    for segment in grid.segments:
        if segment.recording != number:
            continue
        part, blocks = segment.part, segment.blocks
        left = recording.target[part] - model[part]
        slow = series.target[blocks] - residual[blocks]
        time = recording.time[part]
        for j in range(left.shape[1]):
            unexplained[part, j] = left[:, j] - np.interp(time, series.time[blocks], slow[:, j])
    return np.where(recording.train[:, None], unexplained, 0.0)
