"""How the extended finger is fitted: the nominal description with the terms of the accepted causes, all numbers again.

Likelihood, bias settings and samples are those of the nominal fit (`FrictionFit`, method batch). The numbers are not
judged one by one here, so that a selection can fit many times.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.effects import Term
from tendonfmu.diagnosis.effects.terms import changed_law
from tendonfmu.estimate import (
    Choice,
    Estimator,
    FrictionFitOptions,
    Interrupted,
    Learned,
    Settings,
    Structure,
    Watch,
    build_structure,
    get_number,
    learn_batch,
    unknown_names,
    unknowns,
    with_known_numbers,
    with_values,
)
from tendonfmu.model import effects, finger_from_data, law_path, moment_arms, native, number_of
from tendonfmu.recordings import FitRecording

MOST_SAMPLES = 20_000  # samples that a fit learns from, about
PRIOR = 1.0  # prior standard deviation, in units of each number's expected magnitude
MOST_PASSES = 60  # over the recordings
TOLERANCE = 0.3  # length of the last step, in standard errors of all unknowns together
# The same for models that are only compared. Noise is correlated over some 20 samples, and these standard errors do not
# know it: they are several times too small.
ROUGH_TOLERANCE = 0.5
NEW = 3.0  # times its start: prior standard deviation of a new number


@dataclass(frozen=True)
class FitSettings:
    """Options of a fit, as of `FrictionFit` with method batch."""

    choice: Choice = field(default_factory=Choice)  # which numbers are fitted
    threads: int = 0  # number of threads; 0 for all cores
    path: Path = Path("finger")  # file of the description, for messages


@dataclass(frozen=True)
class FittedModel:
    """A description whose numbers were fitted."""

    data: Mapping[str, Any]
    # the description that says how large each number may be: its values are the standard deviations of the prior
    given: Mapping[str, Any]
    values: Mapping[str, float]  # by path of an estimated number, SI units
    cost: float  # ½ Σ e²/S including the prior
    warnings: tuple[str, ...] = ()  # sentences
    fixed: tuple[str, ...] = ()  # paths of numbers that no fit of this model changes


def fit_numbers(
    data: Mapping[str, Any],
    recordings: Sequence[FitRecording],
    settings: FitSettings = FitSettings(),
    *,
    given: Mapping[str, Any] | None = None,
    fixed: tuple[str, ...] = (),
    begin: Mapping[str, Any] | None = None,
) -> FittedModel:
    """Fit the numbers of a description to the samples of `FitRecording.train`; one without numbers stays as it is.

    `begin` is the same description with better numbers, from which the search starts.
    """
    # The recordings are those of `predicted_forces`: they lack the noise, which a term that scales with the force would
    # otherwise fit by shrinking the force.
    if not unknowns(data):
        return FittedModel(data=data, given=data, values={}, cost=float("nan"))
    origin = data if given is None else given
    if fixed:
        settings = replace(settings, choice=replace(settings.choice, fix=(*settings.choice.fix, *fixed)))
    every = _thinning(recordings, MOST_SAMPLES)
    structure, learned = _learned(_with_noise(data, every), recordings, settings, origin, begin, every, ROUGH_TOLERANCE)
    numbers = np.asarray(learned.estimator.values(learned.z))
    finger = with_values(structure, numbers)
    return FittedModel(
        data=finger.data if every == 1 else {**finger.data, "bias": {**finger.data["bias"], **_noise(data)}},
        given=origin,
        values={number.path: float(numbers[structure.index[number.path]]) for number in structure.numbers},
        cost=float(learned.cost),
        warnings=tuple(learned.warnings),
        fixed=fixed,
    )


def learn_numbers(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], settings: FitSettings, *, given: Mapping[str, Any]
) -> tuple[Structure, Learned]:
    """Fit the numbers of a description and return everything known about the fit."""
    return _learned(data, recordings, settings, given, None, _thinning(recordings, MOST_SAMPLES), TOLERANCE)


def with_known(data: Mapping[str, Any], recordings: Sequence[FitRecording], settings: FitSettings) -> Mapping[str, Any]:
    """Return a fitted description with what recordings tell of its numbers (`estimated`)."""
    own = [_with_own_target(data, recording) for recording in recordings]
    return with_known_numbers(finger_from_data(data, settings.path), own).data


def _learned(
    data: Mapping[str, Any],
    recordings: Sequence[FitRecording],
    settings: FitSettings,
    given: Mapping[str, Any],
    begin: Mapping[str, Any] | None,
    every: int,
    tolerance: float,
) -> tuple[Structure, Learned]:
    recordings = [_thinned(_with_own_target(data, recording), every) for recording in recordings]
    structure = _with_scale(build_structure(finger_from_data(data, settings.path), settings.choice), given)
    # a diagnosis has its own noise model, so the effective number of samples does not matter
    fit = FrictionFitOptions(prior=PRIOR, tolerance=tolerance, threads=settings.threads)
    options = Settings(fit, passes=MOST_PASSES, effective=False)
    try:
        start = None if begin is None else _start_at(structure, begin, settings)
        return structure, learn_batch(structure, recordings, Watch(None), options, start)
    except Interrupted:  # the intermediate result of a partial fit is of no use
        raise KeyboardInterrupt from None


def fit_extended(
    nominal: FittedModel,
    causes: Sequence[Term],
    recordings: Sequence[FitRecording],
    settings: FitSettings = FitSettings(),
    begin: Mapping[str, Any] | None = None,
) -> FittedModel:
    """Fit the nominal model with the causes' terms, all numbers again, starting at the nominal fit or at `begin`."""
    causes = possible(nominal.data, causes)
    if not causes:
        return nominal
    data = extended_description(nominal.data, causes)
    added = zip(causes, added_paths(nominal.data, causes), strict=True)
    estimated = {number.path for number in unknowns(data)}
    fixed = tuple(path for cause, paths in added if cause.fixed for path in paths if path in estimated)
    return fit_numbers(data, recordings, settings, given=nominal.given, fixed=fixed, begin=begin)


def cause_parameters(
    nominal: Mapping[str, Any], causes: Sequence[Term], model: FittedModel
) -> tuple[Mapping[str, tuple[float, str]], ...]:
    """Return the numbers of each cause in a model that was fitted with all of them: path -> (value, unit)."""
    units = {parameter.path: parameter.unit for parameter in native.Instance.from_description(model.data).parameters()}
    return tuple(_parameters(model, own, units) for own in added_paths(nominal, causes))


def extended_description(data: Mapping[str, Any], causes: Sequence[Term]) -> Mapping[str, Any]:
    """Return the description with the causes' terms, added one after the other."""
    for cause in causes:
        data = cause.added_to(data)
    return data


def added_paths(data: Mapping[str, Any], causes: Sequence[Term]) -> tuple[tuple[str, ...], ...]:
    """Return, for each cause, the paths of the numbers that it adds or replaces."""
    added = []
    for cause in causes:
        extended = cause.added_to(data)
        before = dict(_leaves(data))
        # a number that is only written differently does not belong to the cause
        added.append(tuple(path for path, value in _leaves(extended) if path not in before or before[path] != value))
        data = extended
    return tuple(added)


def _parameters(model: FittedModel, paths: Sequence[str], units: Mapping[str, str]) -> dict[str, tuple[float, str]]:
    """Return those of the paths that were estimated, and all numbers of extensions."""
    own = (path for path in paths if path in model.values or (path in units and path.startswith("extensions[")))
    return {path: (float(get_number(model.data, path)), units[path]) for path in own}


# --- parts ------------------------------------------------------------------------------------------------------------


def possible(data: Mapping[str, Any], causes: Sequence[Term]) -> list[Term]:
    """Return the causes without those that change a law which only a cause outside of the list would add."""
    kept = []
    for cause in causes:
        path = changed_law(cause)
        if path is None or any(effect.path == path for effect in effects(data)):
            data = cause.added_to(data)
            kept.append(cause)
    return kept


def _start_at(
    structure: Structure, begin: Mapping[str, Any], settings: FitSettings
) -> Callable[[Sequence[str]], Numbers] | None:
    """Return the unknowns of a description with the same numbers as the start of a fit; None if it has others."""
    image = finger_from_data(begin, settings.path).image
    if len(native.Instance(image).parameters()) != len(structure.group):
        return None
    estimator = Estimator(image, structure.group, structure.scale)
    known = dict(zip(unknown_names(estimator), estimator.start, strict=True))
    same = known.keys() == {*unknown_names(Estimator(structure.start.image, structure.group, structure.scale))}
    return (lambda names: np.array([known[name] for name in names])) if same else None


def _with_own_target(data: Mapping[str, Any], recording: FitRecording) -> FitRecording:
    """Return the recording with the external torque that makes its target follow from its forces."""
    groups = recording.recording.groups
    known = groups["tendon_force"] @ moment_arms(data) - recording.target
    given = groups.get("external_torque", np.zeros_like(known))
    if np.allclose(known, given, rtol=1e-9, atol=1e-9 * float(np.abs(recording.target).max(initial=0.0))):
        return recording
    return replace(recording, recording=replace(recording.recording, groups={**groups, "external_torque": known}))


def _thinning(recordings: Sequence[FitRecording], most: int) -> int:
    """Return of how many samples a fit learns from one."""
    return max(1, -(-sum(int(recording.train.sum()) for recording in recordings) // most))


def _with_noise(data: Mapping[str, Any], every: int) -> Mapping[str, Any]:
    """Return the description with less noise, so that the bias follows one of `every` samples as fast as all."""
    if every == 1:
        return data
    less = {key: value / np.sqrt(every) for key, value in _noise(data).items()}
    return {**data, "bias": {**(data.get("bias") or {}), **less}}


def _noise(data: Mapping[str, Any]) -> dict[str, float]:
    return {key: number_of(data, f"bias.{key}") for key in ("noise_std", "noise_std_per_force")}


def _thinned(recording: FitRecording, every: int) -> FitRecording:
    """Train on every `every`-th sample."""
    if every == 1:
        return recording
    return replace(recording, train=recording.train & (np.arange(len(recording.train)) % every == 0))


def _coarser(path: str) -> list[str]:
    """Return the path of a number, without its side, and without its working point."""
    law = law_path(path)
    if law is None or law.number is None:
        return [path]
    point = law.effect if law.point is None else f"{law.effect}.laws[{law.point}]"
    return [path, f"{point}.{law.number}", f"{law.effect}.{law.number}"]


def _with_scale(structure: Structure, given: Mapping[str, Any]) -> Structure:
    """Set the expected magnitudes of the numbers."""
    scale = structure.scale.copy()
    for number in structure.numbers:
        for path in (number.path, number.with_path):
            if path is None or not np.isnan(scale[structure.index[path]]):
                continue
            for known in _coarser(path):
                value = _number_or_none(given, known)
                if value:
                    scale[structure.index[path]] = abs(value)
                    break
            else:
                begin = _number_or_none(structure.start.data, path)
                scale[structure.index[path]] = NEW * abs(begin) if begin else np.nan
    return replace(structure, scale=scale)


def _number_or_none(data: Mapping[str, Any], path: str) -> float | None:
    try:
        value = get_number(data, path)
    except (KeyError, IndexError, TypeError):
        return None
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _leaves(data: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Yield (path, value) of all numbers of a parsed description; indices start at 1."""
    if isinstance(data, Mapping):
        for key, value in data.items():
            yield from _leaves(value, f"{path}.{key}" if path else key)
    elif isinstance(data, list | tuple):
        for k, value in enumerate(data, start=1):
            yield from _leaves(value, f"{path}[{k}]")
    elif isinstance(data, int | float) and not isinstance(data, bool):
        yield path, float(data)
