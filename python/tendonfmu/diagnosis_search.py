"""From recordings to the causes that a description lacks: fits, selections, and fits of the extended description."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.cause_search import View, bias_of, look, predicted_of, series_of
from tendonfmu.contact_scan import left_out, scan_events
from tendonfmu.diagnosis_result import Event
from tendonfmu.diagnosis_series import Grid, Series, Trial, make_grid
from tendonfmu.effects import Candidate, Place
from tendonfmu.extension_fit import Accepted, FitSettings, FittedModel, fit_extended, possible
from tendonfmu.fit_recordings import FitRecording
from tendonfmu.naming import Found, Selection
from tendonfmu.nominal_fit import fitted
from tendonfmu.significance import residual_of

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]
Phase = Callable[[str, int, int | None], None]

ROUNDS = 6  # of selection and fit
PAYS = 0.003  # least share of the residual's variance that a cause takes away, refitted with and without it
STRONG = 0.3  # share of the whitened residual's variance above which causes are taken one at a time, each fitted first


@dataclass(frozen=True)
class NamedCause:
    """A cause as it was found, and as the description takes it."""

    found: Found
    accepted: Accepted


@dataclass(frozen=True)
class Search:
    """nominal, extended: fitted descriptions. first, last: what each lacks and leaves. fitted_to: recordings with
    forces that the model predicts, contact left out. causes: the largest gain first. parameters: of each cause, path ->
    (value, unit). events: contact and stalls."""

    nominal: FittedModel
    extended: FittedModel
    first: View
    last: View
    fitted_to: Sequence[FitRecording]
    causes: tuple[NamedCause, ...]
    parameters: tuple[Mapping[str, tuple[float, str]], ...]
    events: tuple[Event, ...]


def candidate_of(trial: Trial) -> tuple[Candidate, Place]:
    """The candidate and place that a trial was made of."""
    proposal = trial.origin[0]
    return proposal.candidate, proposal.place


def accepted_of(found: Found) -> Accepted:
    """A cause as `extension_fit` takes it."""
    candidate, place = candidate_of(found.trial)
    return Accepted(candidate, place, dict(found.trial.shape), tuple(float(value) for value in found.magnitudes))


def search(
    data: Mapping[str, Any],
    recordings: Sequence[FitRecording],
    seed: int,
    phase: Phase,
    threads: int,
    most_rounds: int = ROUNDS,
) -> Search:
    """data: the nominal description. recordings: `train` says where to look. most_rounds: of selection; 0: none.

    Raises InputError.
    """
    settings, grid = FitSettings(threads=threads), make_grid(recordings)
    phase("fitting the nominal model", 0, None)
    model = fitted(data, recordings, settings)
    phase("looking for contact", 0, None)
    names = [str(recording.path) for recording in recordings]
    series = series_of(model.data, recordings, grid)
    events = _events(model.data, series, names, seed)
    out = left_out(series, events, names)
    recordings = [_without(recording, k, grid, out) for k, recording in enumerate(recordings)]
    series = replace(series, used=series.used & ~out)
    clean = predicted_of(model.data, recordings, grid, series)
    phase("fitting the nominal model", 0, None)
    nominal = fitted(model.data, clean, settings, given=data)
    first = look(nominal.data, recordings, grid, out, lambda done, total: phase("columns of all effects", done, total))
    rounds = _Rounds(nominal, first, recordings, grid, out, settings, seed, phase)
    causes = rounds.run(most_rounds)
    return Search(nominal, rounds.model, first, rounds.view, clean, tuple(causes), rounds.parameters, events)


def without_events(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], seed: int
) -> tuple[list[FitRecording], tuple[Event, ...]]:
    """Recordings that are only judged on, less what no friction explains, and what that is. data: the model with its
    causes, since what it lacks would hide a short event."""
    if not recordings:
        return [], ()
    grid = make_grid(recordings)
    series = series_of(data, recordings, grid)
    names = [str(recording.path) for recording in recordings]
    events = _events(data, series, names, seed)
    out = left_out(series, events, names)
    return [_without(recording, k, grid, out) for k, recording in enumerate(recordings)], events


def _events(data: Mapping[str, Any], series: Series, names: Sequence[str], seed: int) -> tuple[Event, ...]:
    splines = bias_of(data, series)
    residual = residual_of(series, splines, np.zeros((*series.target.shape, 0)))
    return scan_events(series, residual, [splines] * residual.shape[1], names, seed=seed)


def _without(recording: FitRecording, number: int, grid: Grid, out: Flags) -> FitRecording:
    """The recording without the samples of the blocks [B] that are out."""
    if not out.any():
        return recording
    train = recording.train.copy()
    for segment in grid.segments:
        if segment.recording == number:
            begin = segment.part.start
            rows = np.flatnonzero(np.repeat(out[segment.blocks], segment.samples))
            train[begin + rows] = False
    return replace(recording, train=train)


class _Rounds:
    """Selection on the columns of the present description, fit of the extended one, and again, until nothing is found.

    Where much is missing the columns of the nominal description are far from those of the true one: then the best
    cause alone is fitted before the others are looked at.
    """

    def __init__(
        self,
        nominal: FittedModel,
        first: View,
        recordings: Sequence[FitRecording],
        grid: Grid,
        out: Flags,
        settings: FitSettings,
        seed: int,
        phase: Phase,
    ) -> None:
        self.model, self.view, self._first = nominal, first, first
        self.parameters: tuple[Mapping[str, tuple[float, str]], ...] = ()
        self._nominal, self._recordings, self._grid, self._out = nominal, recordings, grid, out
        self._settings, self._seed, self._phase = settings, seed, phase

    def run(self, most: int) -> list[NamedCause]:
        causes: list[NamedCause] = []
        for number in range(most):
            self._phase("telling causes apart", number, None)
            selection = Selection(self.view.problem, self.view.eligible, self._seed)
            found = selection.run()
            if not found:
                break
            if len(found) > 1 and _explained(found, self.view) > STRONG:
                found = [selection.found(found[0].trial.place, [])]
            found = _apart(found)
            taken = self._fitted([*causes, *(NamedCause(each, accepted_of(each)) for each in found)])
            if len(taken) <= len(causes):
                break
            causes = taken
        causes = self._paying(causes)
        order = sorted(range(len(causes)), key=lambda k: -causes[k].found.gain)
        self.parameters = tuple(self.parameters[k] for k in order)
        return [causes[k] for k in order]

    def _paying(self, causes: list[NamedCause]) -> list[NamedCause]:
        """Without causes that nothing is lost with, the least worth first, all fitted again after each.

        In long recordings everything is significant; and what was selected first may be another's by the end.
        """
        while causes:
            accepted = [cause.accepted for cause in causes]
            clean = predicted_of(self.view.data, self._recordings, self._grid, self.view.series)
            without = fit_extended(self._nominal, accepted, clean, self._settings, compare=True).without
            left = self._variance(self.model.data)
            worth = [1.0 - left / max(self._variance(model.data), 1e-300) for model in without]
            least = int(np.argmin(worth))
            if worth[least] >= PAYS:
                break
            causes = self._fitted([*causes[:least], *causes[least + 1 :]])
        if not causes:
            self.model, self.view, self.parameters = self._nominal, self._first, ()
        return causes

    def _variance(self, data: Mapping[str, Any]) -> float:
        """Of the residual of a model over the recordings as they were measured, bias taken off, N²m²."""
        series = series_of(data, self._recordings, self._grid, self._out)
        left = residual_of(series, bias_of(data, series), np.zeros((*series.target.shape, 0)))
        return float(np.mean(left[series.used] ** 2))

    def _fitted(self, causes: list[NamedCause]) -> list[NamedCause]:
        """Fits the description with these causes; those that the fit drives to nothing are dropped."""
        while causes:
            self._phase("fitting the extended model", len(causes), None)
            accepted = possible(self._nominal.data, [cause.accepted for cause in causes])
            causes = [cause for cause in causes if any(cause.accepted is each for each in accepted)]
            if not causes:
                break
            clean = predicted_of(self.view.data, self._recordings, self._grid, self.view.series)
            found = fit_extended(self._nominal, accepted, clean, self._settings, compare=False)
            gone = _gone(found.model, found.paths)
            causes = [cause for cause, lost in zip(causes, gone, strict=True) if not lost]
            if not any(gone):
                self.model, self.parameters = found.model, found.parameters
                self.view = look(found.model.data, self._recordings, self._grid, self._out)
                break
        return causes


def _apart(found: Sequence[Found]) -> list[Found]:
    """Without what another cause brings: an effect everywhere, and the same at single places; the larger gain stays."""
    kept: list[Found] = []
    for each in found:
        own = [other.trial for other in kept if other.trial.effect == each.trial.effect]
        everywhere = [trial.joint is None and trial.tendon is None for trial in [each.trial, *own]]
        if not own or not any(everywhere):
            kept.append(each)
    return kept


def _gone(model: FittedModel, paths: Sequence[Sequence[str]]) -> list[bool]:
    """By cause: whether the fit left nothing of its numbers."""
    found = []
    for given in paths:
        own = [path for path in given if path in model.values]
        found.append(bool(own) and all(model.values[path] == 0.0 for path in own))
    return found


def _explained(found: Sequence[Found], view: View) -> float:
    """Share of the whitened residual's variance that the causes explain on held-out blocks, about."""
    rows = int(view.series.used.sum()) * view.series.target.shape[1]
    gain = sum(each.gain for each in found)
    return float(gain / (rows + gain))
