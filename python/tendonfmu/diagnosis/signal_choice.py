"""Which signals the numbers are estimated from, smoothed or raw ones: those with the smaller error on unseen stretches.

Both are compared at frequencies that both contain: the residual of raw signals is smoothed like the other one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.candidate_columns import candidate_columns, without_uncertainty
from tendonfmu.diagnosis.effects.shapes import is_spring
from tendonfmu.diagnosis.extension_fit import FitSettings, FittedModel, fit_extended, fit_numbers
from tendonfmu.diagnosis.gain import OnlineError
from tendonfmu.diagnosis.least_sizes import LeastSizes, noise_of
from tendonfmu.diagnosis.selection import CERTAIN, rms_gain
from tendonfmu.diagnosis.series import Grid, make_grid, sample_blocks
from tendonfmu.diagnosis.span import span_of
from tendonfmu.diagnosis.starting_point import Start, scan
from tendonfmu.diagnosis.view import bias_of, nominal_scale, series_of
from tendonfmu.model import Finger, moment_arms
from tendonfmu.recordings import FEWEST as FEWEST_SAMPLES
from tendonfmu.recordings import FitRecording, Held, Signals, joint_position_noise, prepare, smoothing_of, zero_phase
from tendonfmu.statistics import Grams, Products, make_folds

NOISIEST = 1000.0  # rad; the largest noise that `position_filter` accepts
NOISE_CUTOFF = 15.0  # Hz: faster motion of the positions is noise
ENOUGH = 90.0  # s of motion that suffice to choose signals and a starting point
BETTER = 0.7  # of the error of smoothed signals, which raw ones must stay below, because they need a filter with a lag


@dataclass(frozen=True)
class Estimation:
    """The signals and models that the estimation starts from."""

    signals: Signals
    recordings: list[FitRecording]  # `train` says which samples are used
    grid: Grid
    least: LeastSizes  # sizes that the sensors can show
    nominal: FittedModel  # the given structure, fitted with these settings
    start: Start  # delay and presliding that the search starts with
    model: FittedModel  # the model fitted with `start`
    settings: FitSettings
    given: Mapping[str, Any]  # the given description, with the filter that suits it online

    def online(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Return an estimated description with the settings for raw samples."""
        return self.signals.restored(data, self.given)

    @property
    def words(self) -> str:
        """Which signals are used, for the report."""
        filtered = "position_filter" in self.given
        return f"{self.signals.words}; online {'the position filter' if filtered else 'the velocity filter'}"


def choose(given: Finger, recordings: Sequence[FitRecording], settings: FitSettings) -> Estimation:
    """Choose signals and starting point for recordings as they were measured."""
    smoothing = smoothing_of([recording.recording for recording in recordings], given.data)
    raw = Signals()
    part = part_of(given, recordings)
    if smoothing is None:
        signals, start = raw, starting_point(given, part, raw, settings).start
    else:
        smooth = starting_point(given, part, smoothing, settings)
        rough = starting_point(given, part, raw, settings, smooth)
        lags = any(recording.kinematics != 3 for recording in recordings)
        is_raw = rough.error < (BETTER if lags else 1.0) * smooth.error
        signals, start = (raw, rough.start) if is_raw else (smoothing, smooth.start)
    finger = replace(given, data=signals.description(given.data))
    own = estimation_recordings(finger, recordings, signals)
    nominal = fit_numbers(finger.data, own, settings)
    model = fit_extended(nominal, start.terms, own, settings) if start.causes else nominal
    least = least_sizes(given.data, recordings, float(np.median(np.diff(own[0].time))))
    chosen = Estimation(signals, own, make_grid(own), least, nominal, start, model, settings, given.data)
    return _with_filter(chosen, recordings)


def part_of(given: Finger, recordings: Sequence[FitRecording]) -> list[FitRecording]:
    """Return the first seconds of each recording, ENOUGH in total."""
    share = ENOUGH / max(sum(recording.duration for recording in recordings), 1e-300)
    if share >= 1.0:
        return list(recordings)
    parts = []
    for recording in recordings:
        end = int(np.searchsorted(recording.time, recording.time[0] + share * (recording.time[-1] - recording.time[0])))
        if end < FEWEST_SAMPLES or not recording.train[:end].any():
            continue
        whole = recording.recording
        part = replace(
            whole,
            time=whole.time[:end],
            groups={name: values[:end] for name, values in whole.groups.items()},
            contact=None if whole.contact is None else whole.contact[:end],
        )
        own = prepare(given, part, recording.kinematics, Held())
        parts.append(replace(own, train=own.train & recording.train[:end]))
    return parts or list(recordings)


def _with_filter(chosen: Estimation, recordings: Sequence[FitRecording]) -> Estimation:
    """Add an online position filter if the estimated models then leave a smaller error on raw samples."""
    long_enough = all(len(recording.time) >= FEWEST_SAMPLES for recording in recordings)
    if chosen.signals.cutoff is None or "position_filter" in chosen.given or not long_enough:
        return chosen
    if any(recording.kinematics == 3 for recording in recordings):
        return chosen
    noise = np.max([joint_position_noise(chosen.given, recording) for recording in recordings], axis=0)
    if noise.max() > NOISIEST:
        return chosen
    filtered = replace(chosen, given={**chosen.given, "position_filter": {"noise": [float(value) for value in noise]}})
    error = OnlineError(chosen.online(chosen.nominal.data), recordings)
    before, after = (error.by_stretch(result.online(result.model.data)) for result in (chosen, filtered))
    gain, spread = rms_gain(before, after)
    return filtered if gain > CERTAIN * spread else chosen


@dataclass(frozen=True)
class Compared:
    """A starting point with certain signals; `error` is the rms on unseen stretches, N·m."""

    signals: Signals
    start: Start
    error: float


def starting_point(
    given: Finger,
    recordings: Sequence[FitRecording],
    signals: Signals,
    settings: FitSettings,
    known: Compared | None = None,
) -> Compared:
    """Find the starting point with these signals, or take it from `known`, which used other signals."""
    finger = replace(given, data=signals.description(given.data))
    own = estimation_recordings(finger, recordings, signals)
    grid = make_grid(own)
    nominal = fit_numbers(finger.data, own, settings)
    if known is None:
        least = least_sizes(given.data, recordings, float(np.median(np.diff(own[0].time))))
        starts = scan(nominal.data, own, grid, least.least("time_delay", None, None))
        # with a known delay, try the two best distances: the derivative of one need not lead to the better
        tried = [starts[0], *[start for start in starts[1:] if start.presliding != starts[0].presliding][:1]]
    else:
        tried = [known.start]
    cutoff = signals.cutoff or (known.signals.cutoff if known else None)
    span = span_of(nominal.data, own)
    compared = []
    for start in tried:
        model = fit_extended(nominal, start.terms, own, settings) if start.causes else nominal
        if is_spring(model.data, span):  # a spring is missing, and would not be found beside long presliding
            start = replace(start, presliding=())
            model = fit_extended(nominal, start.terms, own, settings) if start.causes else nominal
        compared.append(Compared(signals, start, _error(model.data, own, grid, cutoff)))
    return min(compared, key=lambda result: result.error)


def estimation_recordings(finger: Finger, recordings: Sequence[FitRecording], signals: Signals) -> list[FitRecording]:
    """Return recordings whose signals are smoothed as chosen."""
    if signals.cutoff is None:
        return list(recordings)
    listed = []
    for recording in recordings:
        own = prepare(finger, signals.recording(recording.recording), recording.kinematics, Held())
        at = np.minimum(np.searchsorted(recording.time, own.time), len(recording.time) - 1)
        listed.append(replace(own, train=own.train & recording.train[at], held_out=recording.held_out[at]))
    return listed


def least_sizes(data: Mapping[str, Any], recordings: Sequence[FitRecording], step: float) -> LeastSizes:
    """Measure the sensor noise of recordings; `step` is the time between the samples that are estimated from, s."""
    joints: list[Numbers] = []
    tendons: list[Numbers] = []
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]])
    for recording in recordings:
        groups = recording.recording.groups
        angle, force = recording.model.joint_angle, groups["tendon_force"]
        reached = (
            groups["tendon_position"] - force / stiffness
            if "tendon_position" in groups
            else angle @ moment_arms(data).T
        )
        for part in recording.parts:
            rate = 1.0 / float(np.median(np.diff(recording.time[part])))
            for values, noise in ((angle[part], joints), (reached[part], tendons)):
                noise.append(noise_of(values, zero_phase(values, NOISE_CUTOFF, rate)))
    return LeastSizes(np.max(joints, axis=0), np.max(tendons, axis=0), step, 0.0)


def _error(data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, cutoff: float | None) -> float:
    """Return the rms on held-out folds, N·m, with the description's numbers refitted."""
    plain = without_uncertainty(data)
    series = series_of(plain, recordings, grid)
    columns = candidate_columns(plain, recordings, sample_blocks(grid, recordings), candidates=())
    target, nominal = series.target.copy(), np.asarray(columns.nominal, dtype=np.float64)
    if cutoff is not None and cutoff < 0.4 / grid.step:
        for segment in grid.segments:
            if segment.count > 10:
                rows = segment.blocks
                target[rows] = zero_phase(target[rows], cutoff, 1.0 / grid.step)
                nominal[rows] = zero_phase(nominal[rows], cutoff, 1.0 / grid.step)
    folds = make_folds(series)
    products = Products(folds, nominal, columns.values, bias_of(plain, series))
    grams = Grams(products, target, nominal_scale(plain))
    return float(np.sqrt(grams.without / max(len(folds.rows) * target.shape[1], 1)))
