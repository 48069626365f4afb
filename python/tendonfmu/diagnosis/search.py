"""From recordings to the causes that a description lacks: signals, events, cause after cause.

The search ends when no candidate is material and certain. Where stuck samples mislead it, it is made once more without
them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tendonfmu.arrays import Flags
from tendonfmu.diagnosis.cause import Cause
from tendonfmu.diagnosis.cause_search import View, predicted_of, series_of
from tendonfmu.diagnosis.events import events_of, without_blocks, without_events
from tendonfmu.diagnosis.extension_fit import FittedModel, fit_numbers
from tendonfmu.diagnosis.extension_search import MOST_CAUSES, ExtensionSearch
from tendonfmu.diagnosis.online_error import OnlineError
from tendonfmu.diagnosis.result import Event
from tendonfmu.diagnosis.signal_choice import Estimation
from tendonfmu.diagnosis.sliding import RUNS, settled, sliding_alone
from tendonfmu.model import Finger
from tendonfmu.recordings import FitRecording
from tendonfmu.tasks import Phases, Step


@dataclass(frozen=True)
class Search:
    """The result of a search."""

    estimation: Estimation  # signals and recordings
    nominal: FittedModel  # fitted descriptions with the settings for estimation
    extended: FittedModel
    first: View  # what each of them lacks and leaves
    last: View
    causes: tuple[Cause, ...]  # in the order in which they were found
    models: tuple[FittedModel, ...]  # the nominal model, then the model after each cause [causes + 1]
    small: tuple[Cause, ...]  # effects that are certain but not material
    events: tuple[Event, ...]  # contact and stalls
    out: Flags  # blocks that lie in events [B]
    fitted_to: Sequence[FitRecording]  # recordings with the forces that the model predicts, without events
    everything: Sequence[FitRecording]  # the same with the samples in which something is stuck
    only_sliding: bool  # whether these are left out, because they would mislead (`sliding.py`)


def search(
    given: Finger,
    recordings: Sequence[FitRecording],
    chosen: Estimation,
    *,
    least_gain: float,
    seed: int,
    phases: Phases,
) -> Search:
    """Search for the causes that a description lacks."""
    with phases.start("contact"):
        events, out = events_of(chosen.model.data, chosen.recordings, chosen.grid, seed)
    measured = [without_events(recording, events) for recording in recordings]
    own, clean = _without_blocks(chosen, out)
    with phases.start("causes", MOST_CAUSES) as step:
        searched = _searched(given, own, clean, measured, out, least_gain, step)
    rounds, only_sliding = searched.rounds, searched.clean is not clean
    models = [own.nominal, *rounds.models[1:]]
    if events:
        # drop events that the causes explain
        left, _ = events_of(models[-1].data, chosen.recordings, chosen.grid, seed)
        events = tuple(event for event in events if any(_overlap(event, other) for other in left))
    return Search(
        estimation=searched.chosen,
        nominal=models[0],
        extended=models[-1],
        first=rounds.first,
        last=rounds.view,
        causes=tuple(rounds.causes),
        models=tuple(models),
        small=(*rounds.refused, *rounds.small()),
        events=events,
        out=out,
        fitted_to=searched.clean,
        everything=clean,
        only_sliding=only_sliding,
    )


@dataclass(frozen=True)
class _Searched:
    """A search that has ended, and the recordings that it was in."""

    rounds: ExtensionSearch
    chosen: Estimation
    clean: Sequence[FitRecording]

    @property
    def model(self) -> FittedModel:
        return self.rounds.models[-1]


def _searched(
    given: Finger,
    chosen: Estimation,
    clean: Sequence[FitRecording],
    measured: Sequence[FitRecording],
    out: Flags,
    least_gain: float,
    step: Step,
) -> _Searched:
    """Search in all samples, and without those in which something is stuck if these may mislead; return the better."""
    online = OnlineError(chosen.online(chosen.nominal.data), measured)
    rounds = ExtensionSearch(chosen, out, online, least_gain)
    rounds.run(step)
    whole = _Searched(rounds, chosen, clean)
    alone = sliding_alone(given, measured, chosen, whole.model)
    if alone is None:
        return whole
    own, predicted = _without_blocks(alone.estimation, out)
    rounds = ExtensionSearch(own, out, OnlineError(own.online(own.nominal.data), alone.measured), least_gain)
    rounds.run(step)
    sliding = _Searched(rounds, own, predicted)

    def error(data: Mapping[str, Any]) -> float:
        return online.square(chosen.online(data))

    is_better = alone.is_better(sliding.model, whole.model)
    runs = is_better and error(settled(sliding.model.data, error)) < RUNS**2 * error(whole.model.data)
    return sliding if runs else whole


def _without_blocks(chosen: Estimation, out: Flags) -> tuple[Estimation, list[FitRecording]]:
    """Return an estimation without some blocks [B], and its recordings with the nominal model's forces."""
    nominal = chosen.nominal
    own = [without_blocks(recording, k, chosen.grid, out) for k, recording in enumerate(chosen.recordings)]
    clean = predicted_of(nominal.data, own, chosen.grid, series_of(nominal.data, own, chosen.grid, out))
    nominal = fit_numbers(nominal.data, clean, chosen.settings, given=nominal.given)
    return replace(chosen, nominal=nominal, recordings=own), clean


def _overlap(one: Event, other: Event) -> bool:
    return one.recording == other.recording and one.start < other.end and other.start < one.end
