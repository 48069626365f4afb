"""Where the search starts: a delay and a distance of presliding, scanned for together.

Derivatives find neither of the two, and a fitted distance hides a large delay (and the other way round).

If tendon positions and forces show a delay without any friction, that delay is used. With more tendons than joints,
the joint-side positions x0 − f0/k agree with each other only if positions and forces are of the same time. Otherwise a
delay is a shift of the measured torque, judged on held-out folds like the distances.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.candidate_columns import candidate_columns, without_uncertainty
from tendonfmu.diagnosis.effects import Place, Term, by_name
from tendonfmu.diagnosis.extension_fit import extended_description
from tendonfmu.diagnosis.series import Grid, sample_blocks
from tendonfmu.diagnosis.span import Span, span_of
from tendonfmu.diagnosis.view import bias_of, nominal_scale, series_of
from tendonfmu.model import EFFECT_NUMBERS, moment_arms
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import Grams, Products, make_folds

LONGEST_DELAY = EFFECT_NUMBERS["time_delay"]["delay"].most  # s in either direction

FINE = 0.001  # s
LARGE = 0.008  # s: smaller delays compete with other causes, by their derivative
CLEAR_GAIN = 0.1  # of the rms that a starting delay must remove: any other missing effect looks a little like a delay
CLEAR = 0.25  # error of the best delay, at most, over the median error of all delays
PRESLIDING, DELAY = by_name("presliding"), by_name("time_delay")


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
    return sorted(starts, key=lambda start: start.error)


def presliding_everywhere(data: Mapping[str, Any], source: int, span: Span) -> list[tuple[Term, ...]]:
    """Return presliding at all places with one distance, for each distance of a grid."""
    places = PRESLIDING.places(data, source)
    if any(row["effect"] == PRESLIDING.name for row in data.get("extensions") or []):
        return []
    by_place = [
        [Term(PRESLIDING, place, variant.shape, (1.0,)) for variant in PRESLIDING.variants(data, place, span)]
        for place in places
    ]
    return [tuple(own) for own in zip(*(each for each in by_place if each), strict=False) if own]


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
