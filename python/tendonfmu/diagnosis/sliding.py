"""Samples in which everything slides, for recordings whose stuck samples would mislead a search.

A law does not say what the friction of a stuck place is: it balances the load, anywhere between the two sides of the
law. A fit to all samples of a finger that sticks and slips is therefore a compromise, and a cause may be named only
because it changes the compromise. In MuJoCo fingers that stick for a quarter of the time, four fifths of the squared
error were in these samples; friction came out a third too large, and "friction that rises from standstill" was named,
which none of them has. Fitted to the samples that slide, friction was right within 1 % (docs/evidence/diagnosis.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from tendonfmu.arrays import Flags
from tendonfmu.diagnosis.extension_fit import FittedModel, fit_numbers
from tendonfmu.diagnosis.signal_choice import Estimation, estimation_recordings, part_of, starting_point
from tendonfmu.diagnosis.view import residual_alone, series_of
from tendonfmu.model import Finger, effects, sliding_velocity, velocity_threshold
from tendonfmu.recordings import FitRecording, Grid, Signals
from tendonfmu.statistics import FEWEST_STRETCHES, STRETCH

WORSE = 1.8  # times the error of the samples that slide: a smaller error of stuck ones does not mislead
TIMES = tuple(
    0.001 * 2.0**k for k in range(9)
)  # s, of presliding; a place moves for some 10 to 100 ms around a reversal
RUNS = 1.3  # times the rms of r over all samples, which the model fitted to the others may have
BETTER = 0.65  # of the error of samples that slide, which a fit to them alone must stay below


def is_stuck(data: Mapping[str, Any], recording: FitRecording) -> Flags:
    """Return the samples in which a friction effect that slides at other times is stuck, |v| <= v_min [N]."""
    flags = np.zeros(len(recording.time), dtype=bool)
    for effect in effects(data):
        stuck = np.abs(sliding_velocity(data, effect, recording.model.joint_speed)) <= velocity_threshold(data, effect)
        if not stuck.all():
            flags |= stuck
    return flags


def without_stuck(given: Finger, recordings: Sequence[FitRecording], signals: Signals) -> list[FitRecording]:
    """Return recordings as they were measured, without the samples in which the chosen signals show anything stuck."""
    finger = replace(given, data=signals.description(given.data))
    sliding = []
    for recording, own in zip(recordings, estimation_recordings(finger, recordings, signals), strict=True):
        at = np.minimum(np.searchsorted(own.time, recording.time), len(own.time) - 1)
        slides = ~is_stuck(finger.data, own)[at]
        sliding.append(replace(recording, train=recording.train & slides, held_out=recording.held_out & slides))
    return sliding


class Sliding:
    """Recordings without stuck samples, as they were measured, and what is estimated from them."""

    def __init__(self, given: Finger, measured: list[FitRecording], chosen: Estimation) -> None:
        """Prepare recordings of the samples in which everything slides."""
        self.measured, self._given, self._all = measured, given, chosen
        finger = replace(given, data=chosen.signals.description(given.data))
        self.recordings = estimation_recordings(finger, measured, chosen.signals)

    @cached_property
    def estimation(self) -> Estimation:
        chosen = self._all
        best = starting_point(self._given, part_of(self._given, self.measured), chosen.signals, chosen.settings)
        nominal = fit_numbers(chosen.nominal.data, self.recordings, chosen.settings, given=chosen.nominal.given)
        return replace(chosen, recordings=self.recordings, nominal=nominal, start=best.start, model=best.model)

    def worse_where_stuck(self, model: FittedModel) -> float:
        """Return how many times its error here a model that was fitted to all samples leaves in the stuck ones."""
        stuck = _squares(model.data, _without(self._all.recordings, self.recordings), self._all.grid)
        return float(np.sqrt(stuck / max(self._square(model), 1e-300)))

    def is_better(self, alone: FittedModel, model: FittedModel) -> bool:
        """Return whether stuck samples mislead: a model fitted alone leaves much less here than one fitted to all."""
        return self._square(alone) < BETTER**2 * self._square(model)

    def _square(self, model: FittedModel) -> float:
        return _squares(model.data, self.recordings, self._all.grid)


def sliding_alone(given: Finger, recordings: Sequence[FitRecording], chosen: Estimation) -> Sliding | None:
    """Return recordings without stuck samples; None if these are too few."""
    free = without_stuck(given, recordings, chosen.signals)
    return Sliding(given, free, chosen) if _enough(free) else None


def settled(data: Mapping[str, Any], error: Callable[[Mapping[str, Any]], float]) -> Mapping[str, Any]:
    """Choose the time of presliding everywhere, which sliding hardly shows; keep the other numbers of a description."""
    rows = list(data.get("extensions") or [])
    at = [k for k, row in enumerate(rows) if row["effect"] == "presliding" and not {"joint", "tendon"} & {*row}]
    if not at:
        return data

    def with_time(time: float) -> dict[str, Any]:
        return {**data, "extensions": [*rows[: at[0]], {**rows[at[0]], "displacement": time}, *rows[at[0] + 1 :]]}

    # downhill from the nearest time: an error of all samples takes long
    number = int(np.argmin(np.abs(np.log(np.array(TIMES) / max(rows[at[0]]["displacement"], TIMES[0])))))
    errors = {k: error(with_time(TIMES[k])) for k in (number, number + 1) if k < len(TIMES)}
    step = -1 if errors[number] <= errors.get(number + 1, np.inf) else 1
    while 0 <= (following := min(errors) - 1 if step < 0 else max(errors) + 1) < len(TIMES):
        errors[following] = error(with_time(TIMES[following]))
        if errors[following] > errors[following - step]:
            break
    best = min(errors, key=lambda k: errors[k])
    return with_time(TIMES[best]) if errors[best] < error(data) else data


def _enough(recordings: Sequence[FitRecording]) -> bool:
    seconds = sum(float(np.median(np.diff(recording.time))) * int(recording.train.sum()) for recording in recordings)
    return seconds >= FEWEST_STRETCHES * STRETCH


def _without(recordings: Sequence[FitRecording], others: Sequence[FitRecording]) -> list[FitRecording]:
    """Return the recordings without the samples that others of the same times train on."""
    return [
        replace(recording, train=recording.train & ~other.train)
        for recording, other in zip(recordings, others, strict=True)
    ]


def _squares(data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid) -> float:
    """Return the mean square that a description leaves, bias removed, (N·m)²; 0 without a block."""
    series = series_of(data, recordings, grid)
    return float(np.mean(residual_alone(data, series)[series.used] ** 2)) if series.used.any() else 0.0
