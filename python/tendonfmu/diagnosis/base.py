"""Where a search starts: a fitted description with memory, its delay and position-dependent torque settled.

1. A delay between forces and positions is scanned for: derivatives find a large one neither before nor after friction
   with a memory has been fitted to it.
2. Torque that depends on the angles and not on the direction comes before friction, which takes it up otherwise.
3. Friction with a memory is fitted, whether the description has it or not. What it lacked is a cause.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.diagnosis.effects import MECHANISMS, Mechanism, Place, Term, Where, by_name
from tendonfmu.diagnosis.extension_fit import (
    FitSettings,
    FittedModel,
    extended_description,
    fit_numbers,
    memory_of,
    memory_terms,
)
from tendonfmu.diagnosis.samples import Samples, shifted
from tendonfmu.diagnosis.selection import Judged, LeastSizes, least_sizes
from tendonfmu.diagnosis.view import View, look
from tendonfmu.estimate import choose_memory
from tendonfmu.model import EFFECT_NUMBERS, Finger, moment_arms
from tendonfmu.recordings import FitRecording

LONGEST_DELAY = EFFECT_NUMBERS["time_delay"]["delay"].most  # s in either direction
FINE = 0.001  # s
LARGE = 0.005  # s: smaller delays compete with other causes, by their derivative
CLEAR_GAIN = 0.1  # of the rms that a starting delay must remove: any other missing effect looks a little like a delay
CLEAR = 0.25  # error of the best delay, at most, over the median error of all delays
POSITION = ("cover_stiffness", "cover_hardening", "gravity", "joint_coupling")  # torque that depends on angles alone
DELAY = by_name("time_delay")


@dataclass(frozen=True)
class Base:
    """What the search starts from."""

    samples: Samples
    least: LeastSizes  # sizes that the sensors can show
    nominal: FittedModel  # the given structure
    start: tuple[tuple[Term, ...], ...]  # delay, position-dependent torque and memory that the description lacks
    model: FittedModel  # fitted with `start`
    settings: FitSettings

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


def find_base(given: Finger, recordings: Sequence[FitRecording], settings: FitSettings, least_gain: float) -> Base:
    """Fit the given description, and find what it lacks of delay, position-dependent torque and memory.

    The last answer is kept, because a history asks the same of its reference for every recording.
    """
    key = _digest(given, recordings, settings, least_gain)
    if key not in _LAST:
        found = _found_base(given, recordings, settings, least_gain)
        _LAST.clear()
        _LAST[key] = found
    return _LAST[key]


_LAST: dict[str, Base] = {}


def _digest(given: Finger, recordings: Sequence[FitRecording], settings: FitSettings, least_gain: float) -> str:
    """Return a hash of everything that a base depends on."""
    known = hashlib.sha256(json.dumps([given.data, str(settings), least_gain]).encode())
    for recording in recordings:
        known.update(f"{recording.kinematics} {recording.parts}".encode())
        groups = [values for _, values in sorted(recording.recording.groups.items())]
        for values in (recording.time, recording.target, recording.train, recording.silent, *groups):
            known.update(values.tobytes())
    return known.hexdigest()


def _found_base(given: Finger, recordings: Sequence[FitRecording], settings: FitSettings, least_gain: float) -> Base:
    samples = Samples.of(given.data, recordings, settings.threads)
    nominal = fit_numbers(given.data, samples, settings)
    samples = samples.as_rests_demand(nominal.data)
    nominal = refitted(nominal, samples, settings)
    least = least_sizes(given.data, recordings, float(np.median(np.diff(recordings[0].time))))
    late = _delay_of_positions(nominal.data, samples, least)
    start = list(_position_dependent(extended_description(nominal.data, late or ()), samples, least, least_gain))
    start += [late] if late else []
    model, memory = _with_memory(given, nominal, start, samples, settings)
    if late is None and (late := _delay_of_torque(model, samples, least)):
        others = _with_memory(given, nominal, [*start, late], samples, settings)
        if others[0].cost < model.cost:
            (model, memory), start = others, [*start, late]
    return Base(samples, least, nominal, (*start, *memory), model, settings)


# --- position-dependent torque ----------------------------------------------------------------------------------------


def _position_dependent(data: Data, samples: Samples, least: LeastSizes, least_gain: float) -> list[tuple[Term, ...]]:
    """Return the terms of effects that depend on angles alone, one effect after the other."""
    view = look(data, samples, least, [by_name(name) for name in POSITION])
    taken: list[Judged] = []
    while best := view.beside({cause.where for cause in taken}).best(least_gain):
        taken.append(best)
    return [cause.scaled() for cause in taken]


# --- memory -----------------------------------------------------------------------------------------------------------


def _with_memory(
    given: Finger, nominal: FittedModel, start: Sequence[tuple[Term, ...]], samples: Samples, settings: FitSettings
) -> tuple[FittedModel, list[tuple[Term, ...]]]:
    """Return the model with the memory that recordings choose, and the terms of it that the description lacks."""
    described = extended_description(nominal.data, [term for terms in start for term in terms])
    return remembering(replace(given, data=described), nominal, samples, settings)


def remembering(
    described: Finger, nominal: FittedModel, samples: Samples, settings: FitSettings
) -> tuple[FittedModel, list[tuple[Term, ...]]]:
    """Fit a description with the memory that recordings choose, from several starts; return what is new of it, too."""
    choice = choose_memory(described, samples.recordings, settings.choice, threads=settings.threads)
    model = FittedModel(choice.finger.data, nominal.given, {})
    return refitted(model, samples, settings), memory_terms(nominal.data, memory_of(choice.finger.data))


# --- delay ------------------------------------------------------------------------------------------------------------


def _delay_of_torque(model: FittedModel, samples: Samples, least: LeastSizes) -> tuple[Term, ...]:
    """Return a delay of forces that is too large for its derivative, beside a fitted model; () if there is none."""
    if not DELAY.places(model.data, samples.recordings[0].kinematics):
        return ()
    # a grid of all delays that a description accepts, including 0
    grid = max(2 * FINE, float(np.median(np.diff(samples.recordings[0].time))) / 2)
    delays = grid * np.arange(-int(LONGEST_DELAY / grid), int(LONGEST_DELAY / grid) + 1)
    late = ([shifted(each, each.target, delay) - each.target for each in samples.recordings] for delay in delays)
    moved = np.stack([samples.grid.means(changes) for changes in late], axis=2)
    view = look(model.data, samples, least, (), model)
    errors = view.grams.errors_of(view.series.target[:, :, None] + moved)
    still, best = int(np.argmin(np.abs(delays))), int(np.argmin(errors))
    # an optimum at the edge is no minimum; a small delay competes with other causes, by its derivative
    is_large = 0 < best < len(delays) - 1 and abs(delays[best]) >= LARGE
    clear = is_large and errors[best] < (1.0 - CLEAR_GAIN) ** 2 * errors[still]
    return _late(float(delays[best])) if clear else ()


def _delay_of_positions(data: Data, samples: Samples, least: LeastSizes) -> tuple[Term, ...] | None:
    """Return a delay of forces that positions show; None if they do not show whether there is one."""
    known = delay_of_positions(data, samples.recordings)
    if known is None or not DELAY.places(data, samples.recordings[0].kinematics):
        return None
    return _late(known) if abs(known) >= least.least(Where("time_delay")) else ()


def _late(delay: float) -> tuple[Term, ...]:
    return (Term(DELAY, Place(), {"delay": delay}, (1.0,)),)


def delay_of_positions(data: Mapping[str, Any], recordings: Sequence[FitRecording]) -> float | None:
    """Return by how many seconds forces are later than positions; None if the recordings do not show it.

    With joint encoders, or more tendons than joints, the joint-side positions x0 − f0/k agree with the angles, or with
    each other, only if positions and forces are of the same time.
    """
    arms = moment_arms(data)
    measured = all({"joint_position", "tendon_position"} <= set(each.recording.groups) for each in recordings)
    apart = np.eye(len(arms)) - (0.0 if measured else arms @ np.linalg.pinv(arms))
    if np.linalg.matrix_rank(apart) == 0 or "tendon_position" not in recordings[0].recording.groups:
        return None
    delays = np.arange(-LONGEST_DELAY, LONGEST_DELAY + FINE / 2, FINE)
    errors = np.zeros(len(delays))
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]])
    for recording in recordings:
        groups = recording.recording.groups
        position = groups["tendon_position"] - (groups["joint_position"] @ arms.T if measured else 0.0)
        for part in recording.parts:
            time, force = recording.time[part], groups["tendon_force"][part] / stiffness
            for k, delay in enumerate(delays):
                late = [np.interp(time - delay, time, column) for column in position[part].T]
                left = (np.stack(late, axis=1) - force) @ apart
                errors[k] += float(np.sum((left - left.mean(axis=0)) ** 2))
    best = int(np.argmin(errors))
    if not 0 < best < len(delays) - 1 or errors[best] > CLEAR * float(np.median(errors)):
        return None
    before, at, after = errors[best - 1 : best + 2]
    return float(delays[best] + FINE * 0.5 * (before - after) / max(before - 2 * at + after, 1e-300))
