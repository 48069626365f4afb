"""Where a search starts: a fitted description with memory, its delay and position-dependent torque settled.

1. A delay between forces and positions is scanned for: derivatives find a large one neither before nor after friction
   with a memory has been fitted to it.
2. Torque that depends on the angles and not on the direction comes before friction, which takes it up otherwise.
3. Friction with a memory is fitted, whether the description has it or not. What it lacked is a cause. A described
   memory stays where a cause beside it explains more than another memory: that would take the cause up.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.diagnosis.delay import DELAY, Positions, delay_of_torque, late_forces
from tendonfmu.diagnosis.effects import MECHANISMS, Mechanism, Term, Where, by_name
from tendonfmu.diagnosis.extension_fit import (
    FitSettings,
    FittedModel,
    extended_description,
    fit_numbers,
    memory_of,
    memory_terms,
)
from tendonfmu.diagnosis.samples import Samples
from tendonfmu.diagnosis.selection import LeastSizes, least_sizes
from tendonfmu.diagnosis.view import View, look
from tendonfmu.estimate import choose_memory, held_delay, without_memory
from tendonfmu.model import Finger
from tendonfmu.recordings import FitRecording

POSITION = ("cover_stiffness", "cover_hardening", "gravity", "joint_coupling")  # torque that depends on angles alone


@dataclass(frozen=True)
class Base:
    """What the search starts from."""

    samples: Samples
    least: LeastSizes  # sizes that the sensors can show
    nominal: FittedModel  # the given structure
    start: tuple[tuple[Term, ...], ...]  # delay, position-dependent torque and memory that the description lacks
    model: FittedModel  # fitted with `start`
    settings: FitSettings
    positions: Positions  # what they tell of a delay

    def look(self, model: FittedModel, mechanisms: Sequence[Mechanism] = MECHANISMS) -> View:
        """Return what a model that was fitted to the samples lacks."""
        return look(model.data, self.samples, self.least, mechanisms, model).as_described

    def left_unseen(self, model: FittedModel) -> Numbers:
        """Return Σ e² of a model on unseen stretches, (N·m)² [K]."""
        return self.look(model, ()).selection.base

    def without(self, out: Flags) -> Base:
        """Return the base fitted without some blocks [B]."""
        samples = self.samples.without(out)
        nominal, model = (refitted(each, samples, self.settings) for each in (self.nominal, self.model))
        return replace(self, samples=samples, nominal=nominal, model=model)


def refitted(model: FittedModel, samples: Samples, settings: FitSettings, rough: bool = False) -> FittedModel:
    """Fit a model again, at the forces that it predicts."""
    return fit_numbers(
        model.data, samples.at_predicted_forces(model.data), settings, given=model.given, fixed=model.fixed, rough=rough
    )


def forgetful(model: FittedModel, samples: Samples, settings: FitSettings) -> FittedModel:
    """Fit a model again without its memory."""
    if not memory_of(model.data):
        return model
    bare, given = without_memory(model.data), without_memory(model.given)
    return refitted(FittedModel(bare, given, {}, fixed=held_delay(bare) if model.fixed else ()), samples, settings)


def find_base(
    given: Finger,
    recordings: Sequence[FitRecording],
    settings: FitSettings,
    least_gain: float,
    known: Sequence[tuple[Term, ...]] = (),
) -> Base:
    """Fit the given description, and find what it lacks beside `known`: delay, position-dependent torque and memory.

    The last answer is kept, because a history asks the same of its reference for every recording.
    """
    key = _digest(given, recordings, settings, least_gain, known)
    if key not in _LAST:
        found = _found_base(given, recordings, settings, least_gain, known)
        _LAST.clear()
        _LAST[key] = found
    return _LAST[key]


_LAST: dict[str, Base] = {}


def _digest(given: Finger, recordings: Sequence[FitRecording], *others: object) -> str:
    """Return a hash of everything that a base depends on."""
    known = hashlib.sha256(json.dumps([given.data, str(others)]).encode())
    for recording in recordings:
        known.update(f"{recording.kinematics} {recording.parts}".encode())
        groups = [values for _, values in sorted(recording.recording.groups.items())]
        for values in (recording.time, recording.target, recording.train, recording.silent, *groups):
            known.update(values.tobytes())
    return known.hexdigest()


def _found_base(
    given: Finger,
    recordings: Sequence[FitRecording],
    settings: FitSettings,
    least_gain: float,
    known: Sequence[tuple[Term, ...]],
) -> Base:
    positions = Positions(given, recordings)
    given, held = _with_shown_delay(given, positions)
    samples = Samples.of(given.data, recordings, settings.threads)
    nominal = fit_numbers(given.data, samples, settings, fixed=held)
    samples = samples.as_rests_demand(nominal.data)
    nominal = refitted(nominal, samples, settings)
    least = least_sizes(given.data, recordings, float(np.median(np.diff(recordings[0].time))))
    late: tuple[Term, ...] = ()
    is_new = bool(DELAY.places(nominal.data, samples.recordings[0].kinematics))
    if is_new and positions.delay is not None and abs(positions.delay) >= least.least(Where(DELAY.name)):
        late = late_forces(positions.delay, fixed=True)
    start = [*known, late] if late else list(known)
    start = [*_position_dependent(nominal, start, samples, settings, least, least_gain), *start]
    model, memory = _with_memory(given, nominal, start, samples, settings)
    remember = _with_memory
    if memory and memory_of(nominal.data):
        own = _with_own_memory(given, nominal, start, samples, settings)
        answered = {DELAY.name} if positions.delay is not None else ()
        best = look(own[0].data, samples, least, model=own[0]).as_described.selection.best(least_gain, answered)
        other = look(model.data, samples, least, (), model).as_described.selection.base
        if best is not None and best.unseen.sum() < other.sum():
            (model, memory), remember = own, _with_own_memory
    if positions.delay is None and (late := delay_of_torque(model, samples, least)):
        others = remember(given, nominal, [*start, late], samples, settings)
        if others[0].cost < model.cost:
            (model, memory), start = others, [*start, late]
    return Base(samples, least, nominal, (*start, *memory), model, settings, positions)


def _with_shown_delay(given: Finger, positions: Positions) -> tuple[Finger, tuple[str, ...]]:
    """Return the finger with a described delay as positions show it, and what the fits leave of it."""
    if positions.delay is None or not (held := held_delay(given.data)):
        return given, ()
    rows = [
        {**row, "delay": positions.delay} if row["effect"] == DELAY.name else row for row in given.data["extensions"]
    ]
    return given.with_data({**given.data, "extensions": rows}), held


# --- position-dependent torque ----------------------------------------------------------------------------------------


def _position_dependent(
    nominal: FittedModel,
    start: Sequence[tuple[Term, ...]],
    samples: Samples,
    settings: FitSettings,
    least: LeastSizes,
    least_gain: float,
) -> list[tuple[Term, ...]]:
    """Return the terms of effects that depend on angles alone, one effect after the other.

    All numbers are fitted again after each: weight would otherwise correct how a cover that hardens was linearised.
    """
    data, held = _started(nominal, start)
    found: list[tuple[Term, ...]] = []
    refused: set[str] = set()
    mechanisms = [by_name(name) for name in POSITION]
    while best := look(data, samples, least, mechanisms).selection.best(least_gain, refused):
        described = extended_description(data, terms := best.scaled())
        model = refitted(FittedModel(described, nominal.given, {}, fixed=held), samples, settings, rough=True)
        if least.shows_all(best.effect, terms, model.data):
            data, found = model.data, [*found, terms]
        else:
            refused.add(best.effect)
    return found


# --- memory -----------------------------------------------------------------------------------------------------------


def _with_memory(
    given: Finger, nominal: FittedModel, start: Sequence[tuple[Term, ...]], samples: Samples, settings: FitSettings
) -> tuple[FittedModel, list[tuple[Term, ...]]]:
    """Return the model with the memory that recordings choose, and the terms of it that the description lacks."""
    described, held = _started(nominal, start)
    return remembering(replace(given, data=described), nominal, samples, settings, held)


def _with_own_memory(
    given: Finger, nominal: FittedModel, start: Sequence[tuple[Term, ...]], samples: Samples, settings: FitSettings
) -> tuple[FittedModel, list[tuple[Term, ...]]]:
    """Return the model with the memory that the description has, which lacks nothing of it."""
    described, held = _started(nominal, start)
    return refitted(FittedModel(described, given.data, {}, fixed=held), samples, settings) if start else nominal, []


def _started(nominal: FittedModel, start: Sequence[tuple[Term, ...]]) -> tuple[Data, tuple[str, ...]]:
    """Return the description with the terms of the start, and what fits leave of it."""
    terms = [term for each in start for term in each]
    described = extended_description(nominal.data, terms)
    is_held = nominal.fixed or any(term.fixed for term in terms)
    return described, held_delay(described) if is_held else ()


def remembering(
    described: Finger, nominal: FittedModel, samples: Samples, settings: FitSettings, fixed: tuple[str, ...] = ()
) -> tuple[FittedModel, list[tuple[Term, ...]]]:
    """Fit a description with the memory that recordings choose, from several starts; return what is new of it, too."""
    fitted = replace(settings.choice, fix=(*settings.choice.fix, *fixed))
    choice = choose_memory(described, samples.recordings, fitted, threads=settings.threads)
    model = FittedModel(choice.finger.data, nominal.given, {}, fixed=fixed)
    return refitted(model, samples, settings), memory_terms(nominal.data, memory_of(choice.finger.data))
