"""Where the search starts: which signals the numbers are estimated from, with which delay and distance of presliding.

Signals are smoothed or raw ones: those with the smaller error on unseen stretches. Both are compared at frequencies
that both contain: the residual of raw signals is smoothed like the other one.

Delay and distance are scanned for together. Derivatives find neither of the two, and a fitted distance hides a large
delay (and the other way round). If tendon positions and forces show a delay without any friction, that delay is used.
With more tendons than joints, the joint-side positions x0 − f0/k agree with each other only if positions and forces
are of the same time. Otherwise a delay is a shift of the measured torque, judged on held-out folds like the distances.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.diagnosis.candidate_columns import candidate_columns, without_uncertainty
from tendonfmu.diagnosis.effects import CANDIDATES, Candidate, Place, Term, by_name
from tendonfmu.diagnosis.effects.shapes import is_spring, of_joints
from tendonfmu.diagnosis.extension_fit import FitSettings, FittedModel, extended_description, fit_extended, fit_numbers
from tendonfmu.diagnosis.gain import OnlineError
from tendonfmu.diagnosis.least_sizes import LeastSizes, noise_of
from tendonfmu.diagnosis.selection import CERTAIN, rms_gain
from tendonfmu.diagnosis.series import Series
from tendonfmu.diagnosis.span import Span, span_of
from tendonfmu.diagnosis.view import View, bias_of, look, nominal_scale, predicted_of, series_of
from tendonfmu.model import EFFECT_NUMBERS, Finger, moment_arms, number_of
from tendonfmu.recordings import FEWEST as FEWEST_SAMPLES
from tendonfmu.recordings import (
    FitRecording,
    Grid,
    Held,
    Signals,
    at_rows,
    joint_position_noise,
    make_grid,
    prepare,
    sample_blocks,
    smoothing_of,
    zero_phase,
)
from tendonfmu.statistics import Grams, Products, make_folds

NOISIEST = 1000.0  # rad; the largest noise that `position_filter` accepts
NOISE_CUTOFF = 15.0  # Hz: faster motion of the positions is noise
MOST_SAMPLES = 10_000  # that smoothed signals keep, if they are still fast enough
ENOUGH = 90.0  # s of motion that suffice to choose signals and a starting point
BETTER = 0.7  # of the error of smoothed signals, which raw ones must stay below, because they need a filter with a lag
LONGEST_DELAY = EFFECT_NUMBERS["time_delay"]["delay"].most  # s in either direction
FINE = 0.001  # s
LARGE = 0.008  # s: smaller delays compete with other causes, by their derivative
CLEAR_GAIN = 0.1  # of the rms that a starting delay must remove: any other missing effect looks a little like a delay
CLEAR = 0.25  # error of the best delay, at most, over the median error of all delays
PRESLIDING, DELAY = by_name("presliding"), by_name("time_delay")


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

    def series(self, data: Data, left_out: Flags | None = None) -> Series:
        """Return the block means of a description's signals and residual, without some blocks [B]."""
        return series_of(data, self.recordings, self.grid, left_out)

    def predicted(self, data: Data, left_out: Flags | None = None) -> list[FitRecording]:
        """Return the recordings with the forces that a description predicts."""
        return predicted_of(data, self.recordings, self.grid, self.series(data, left_out))

    def look(self, data: Data, left_out: Flags, candidates: Sequence[Candidate] = CANDIDATES) -> View:
        """Return the view of a description."""
        return look(data, self.recordings, self.grid, self.least, left_out, candidates)

    @property
    def words(self) -> str:
        """Which signals are used, for the report."""
        filtered = "position_filter" in self.given
        return f"{self.signals.words}; at run time the finger uses its {'position' if filtered else 'velocity'} filter"


def choose(given: Finger, recordings: Sequence[FitRecording], settings: FitSettings) -> Estimation:
    """Choose signals and starting point for recordings as they were measured."""
    smoothing = smoothing_of([recording.recording for recording in recordings], given.data, MOST_SAMPLES)
    raw = Signals()
    part = part_of(given, recordings)
    if smoothing is None:
        best = starting_point(given, part, raw, settings)
    else:
        smooth = starting_point(given, part, smoothing, settings)
        rough = starting_point(given, part, raw, settings, smooth)
        lags = any(recording.kinematics != 3 for recording in recordings)
        best = rough if rough.error < (BETTER if lags else 1.0) * smooth.error else smooth
    own, nominal, model, start = best.recordings, best.nominal, best.model, best.start
    if part is not recordings:
        finger = replace(given, data=best.signals.description(given.data))
        own = estimation_recordings(finger, recordings, best.signals)
        nominal = fit_numbers(finger.data, own, settings)
        model = fit_extended(nominal, start.terms, own, settings) if start.causes else nominal
    step = float(np.median(np.diff(own[0].time)))
    least = least_sizes(given.data, recordings, step, lag_of(given.data, best.signals, own[0].kinematics, step))
    chosen = Estimation(best.signals, own, make_grid(own), least, nominal, start, model, settings, given.data)
    return _with_filter(chosen, recordings)


def part_of(given: Finger, recordings: Sequence[FitRecording]) -> Sequence[FitRecording]:
    """Return the first seconds of each recording, ENOUGH in total; the same list if they have no more."""
    share = ENOUGH / max(sum(recording.duration for recording in recordings), 1e-300)
    if share >= 1.0:
        return recordings
    parts = []
    for recording in recordings:
        end = int(np.searchsorted(recording.time, recording.time[0] + share * (recording.time[-1] - recording.time[0])))
        if end < FEWEST_SAMPLES or not recording.train[:end].any():
            continue
        own = prepare(given, at_rows(recording.recording, slice(end)), recording.kinematics, Held())
        parts.append(replace(own, train=own.train & recording.train[:end]))
    return parts or recordings


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
    recordings: list[FitRecording]  # with these
    start: Start
    nominal: FittedModel
    model: FittedModel  # fitted with the start
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
        compared.append(Compared(signals, own, start, nominal, model, _error(model.data, own, grid, cutoff)))
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


def lag_of(data: Mapping[str, Any], signals: Signals, kinematics: int, step: float) -> float:
    """Return by how much velocities lag behind the positions that they are computed from, s."""
    if kinematics == 3:
        return 0.0
    cutoff = 0.0 if signals.cutoff else number_of(data, "velocity_filter_cutoff")
    return step / 2 + (1.0 / (2.0 * np.pi * cutoff) if cutoff else 0.0)


def least_sizes(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], step: float, lag: float = 0.0
) -> LeastSizes:
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
    return LeastSizes(np.max(joints, axis=0), np.max(tendons, axis=0), step, lag)


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


# --- delay and presliding --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Start:
    """One point of the scan."""

    presliding: tuple[Term, ...]  # at all places; () for none
    delay: float  # by how much forces are late, s
    error: float  # Σ e² on held-out folds, (N·m)²

    @property
    def causes(self) -> list[tuple[Term, ...]]:
        """Return the places of each effect."""
        late = [(Term(DELAY, Place(), {"delay": self.delay}, (1.0,)),)] if self.delay else []
        return [*late, *([self.presliding] if self.presliding else [])]

    @property
    def terms(self) -> list[Term]:
        return [term for cause in self.causes for term in cause]


def scan(data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, least_delay: float) -> list[Start]:
    """Return every distance and none, each with its best delay and without a delay, the best first."""
    source = recordings[0].kinematics
    span = span_of(data, recordings)
    distances = [(), *presliding_everywhere(data, source, span)]
    delays, known = np.zeros(1), None
    if DELAY.places(data, source):
        known = delay_of_positions(data, recordings) if source == 1 else None
        if known is None:
            delays = _delays(span.step)
    moved = np.stack([_torque(recordings, grid, delay) - _torque(recordings, grid, 0.0) for delay in delays], axis=2)
    starts: list[Start] = []
    for presliding in distances:
        errors = _errors(extended_description(data, presliding), recordings, grid, moved)
        still = int(np.argmin(np.abs(delays)))
        starts.append(Start(presliding, 0.0, float(errors[still])))
        best = int(np.argmin(errors))
        # an optimum at the edge is no minimum; a small delay competes with other causes, by its derivative
        is_large = 0 < best < len(delays) - 1 and abs(delays[best]) >= LARGE
        if is_large and errors[best] < (1.0 - CLEAR_GAIN) ** 2 * errors[still]:
            starts.append(Start(presliding, float(delays[best]), float(errors[best])))
    if known is not None and abs(known) >= least_delay:
        for presliding in distances:
            start = Start(presliding, known, 0.0)
            begin = extended_description(data, start.terms)
            starts.append(replace(start, error=float(_errors(begin, recordings, grid, moved[:, :, :1] * 0.0)[0])))
    first = min(starts, key=lambda start: start.error)
    at_joints = presliding_of_joints(extended_description(data, first.presliding))
    if at_joints:
        begin = extended_description(data, [*first.presliding, *at_joints])
        late = _torque(recordings, grid, first.delay) - _torque(recordings, grid, 0.0)
        error = float(_errors(begin, recordings, grid, late[:, :, None])[0])
        if error < (1.0 - CLEAR_GAIN) ** 2 * first.error:
            starts.append(Start((*first.presliding, *at_joints), first.delay, error))
    return sorted(starts, key=lambda start: start.error)


def presliding_of_joints(data: Data) -> tuple[Term, ...]:
    """Return presliding in joints over distances of their own, where a description has one distance everywhere."""
    return tuple(
        Term(PRESLIDING, place, {"displacement": distance}, (1.0,)) for place, distance in of_joints(data).items()
    )


def presliding_everywhere(data: Mapping[str, Any], source: int, span: Span) -> list[tuple[Term, ...]]:
    """Return presliding at all places with one distance, for each distance of a grid."""
    places = PRESLIDING.places(data, source)
    if any(row["effect"] == PRESLIDING.name for row in data.get("extensions") or []):
        return []
    by_place = [
        [Term(PRESLIDING, place, variant.shape, (1.0,)) for variant in PRESLIDING.variants(data, place, span)]
        for place in places
    ]
    return [terms for terms in zip(*filter(None, by_place), strict=False) if terms]


def _delays(step: float) -> Numbers:
    """Return a grid of all delays that a description accepts, including 0."""
    grid = max(2 * FINE, step / 2)
    count = int(LONGEST_DELAY / grid)
    return np.asarray(grid * np.arange(-count, count + 1), dtype=np.float64)


def delay_of_positions(data: Mapping[str, Any], recordings: Sequence[FitRecording]) -> float | None:
    """Return by how many seconds forces are later than positions; None if the recordings do not show it."""
    arms = moment_arms(data)
    apart = np.eye(len(arms)) - arms @ np.linalg.pinv(arms)
    if np.linalg.matrix_rank(apart) == 0:
        return None
    delays = np.arange(-LONGEST_DELAY, LONGEST_DELAY + FINE / 2, FINE)
    errors = np.zeros(len(delays))
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]])
    for recording in recordings:
        groups = recording.recording.groups
        for part in recording.parts:
            time, force = recording.time[part], groups["tendon_force"][part] / stiffness
            for k, delay in enumerate(delays):
                late = [np.interp(time - delay, time, column) for column in groups["tendon_position"][part].T]
                left = (np.stack(late, axis=1) - force) @ apart
                errors[k] += float(np.sum((left - left.mean(axis=0)) ** 2))
    best = int(np.argmin(errors))
    if not 0 < best < len(delays) - 1 or errors[best] > CLEAR * float(np.median(errors)):
        return None
    before, at, after = errors[best - 1 : best + 2]
    return float(delays[best] + FINE * 0.5 * (before - after) / max(before - 2 * at + after, 1e-300))


def _errors(data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, moved: Numbers) -> Numbers:
    """Return Σ e² on held-out folds, (N·m)² [K], with the target changed by `moved` [B, n, K]."""
    plain = without_uncertainty(data)
    series = series_of(plain, recordings, grid)
    columns = candidate_columns(plain, recordings, sample_blocks(grid, recordings), candidates=())
    products = Products(make_folds(series), columns.nominal, columns.values, bias_of(plain, series))
    grams = Grams(products, series.target, nominal_scale(plain))
    return grams.errors_of(series.target[:, :, None] + moved)


def _torque(recordings: Sequence[FitRecording], grid: Grid, delay: float) -> Numbers:
    """Return block means of the target `delay` s later, N·m [B, n]."""
    shifted = [recording.target.copy() for recording in recordings]
    for segment in grid.segments if delay else ():
        target, part = recordings[segment.recording].target, segment.part
        time = recordings[segment.recording].time[part]
        for j in range(target.shape[1]):
            shifted[segment.recording][part, j] = np.interp(time + delay, time, target[part, j])
    return grid.means(shifted)
