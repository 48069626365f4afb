"""How a description's numbers are fitted: least squares of what runs of the core leave, without a learning bias.

One constant a joint and stretch is left out of all that is compared; noise is correlated over some blocks, and prior
knowledge of how large a number usually is counts as much as that. The derivatives come from runs of the core. Between
two computations of them Broyden's rank-one update keeps them good enough (Broyden, Math. Comp. 19, 1965).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Array, Data, Numbers
from tendonfmu.diagnosis.effects import Term
from tendonfmu.diagnosis.effects.terms import changed_law
from tendonfmu.diagnosis.samples import Samples
from tendonfmu.estimate import (
    Choice,
    Estimator,
    Structure,
    build_structure,
    get_number,
    own_copy,
    set_number,
    unknown_names,
    unknowns,
    with_known_numbers,
    with_values,
)
from tendonfmu.model import effects, finger_from_data, law_path, native
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import MEMORY, bounded

MOST_STEPS = 20
TOLERANCE = 2e-3  # of the cost: a step that lowers it by less is the last one
RELATIVE, ABSOLUTE = 1e-3, 1e-4  # steps of derivatives, of a number and of its expected magnitude
OF_LOGARITHM = 0.01  # the same of numbers that are fitted by their logarithm
LOGARITHMIC = ("displacement", "stiffness", "relaxation_time", "time_constant")  # numbers of rows that may be far off
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
    cost: float = float("nan")  # Σ e² with the prior, (N·m)²
    warnings: tuple[str, ...] = ()  # sentences
    fixed: tuple[str, ...] = ()  # paths of numbers that no fit of this model changes
    # derivatives of what is left by the unknowns, by their keys [R·n]; of the samples it was fitted to
    slopes: Mapping[str, Numbers] = field(default_factory=dict, repr=False, compare=False)
    scale: Numbers = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)  # of the unknowns [u]

    def columns(self, samples: Samples) -> tuple[Array, Numbers]:
        """Return the derivatives of the torque by the unknowns [B, n, u], 0 where not used, and their scale [u]."""
        joints = len(self.data["joints"])
        columns = np.zeros((samples.grid.blocks, joints, len(self.slopes)), dtype=np.float32)
        for k, slope in enumerate(self.slopes.values()):
            columns[samples.used, :, k] = -slope.reshape(-1, joints)
        return columns, self.scale


def fit_numbers(
    data: Mapping[str, Any],
    samples: Samples,
    settings: FitSettings = FitSettings(),
    *,
    given: Mapping[str, Any] | None = None,
    fixed: tuple[str, ...] = (),
    known: Mapping[str, Numbers] | None = None,
    rough: bool = False,
) -> FittedModel:
    """Fit the numbers of a description, starting at its own; one without numbers stays as it is.

    `known` are derivatives of a similar model, to begin with. A rough fit does not compute them anew at its end.
    """
    # The samples have the forces that the model predicts: they lack the noise, which a term that scales with the force
    # would otherwise fit by shrinking the force.
    if not unknowns(data):
        return FittedModel(data=data, given=data, values={})
    origin = data if given is None else given
    if fixed:
        settings = replace(settings, choice=replace(settings.choice, fix=(*settings.choice.fix, *fixed)))
    structure = _with_scale(build_structure(finger_from_data(data, settings.path), settings.choice), origin)
    problem = _Problem(structure, samples)
    x, cost, slopes = _minimised(problem, known or {}, rough)
    numbers = problem.numbers(x)
    return FittedModel(
        data=with_values(structure, numbers).data,
        given=origin,
        values={number.path: float(numbers[structure.index[number.path]]) for number in structure.numbers},
        cost=cost,
        fixed=fixed,
        slopes=dict(zip(problem.keys, slopes.T, strict=True)),
        scale=problem.scale,
    )


class _Problem:
    """What the unknowns of a structure leave of samples. Some unknowns are fitted by their logarithm."""

    def __init__(self, structure: Structure, samples: Samples) -> None:
        self._structure, self._samples = structure, samples
        self._estimator = Estimator(structure.start.image, structure.group, structure.scale)
        chosen = [k for k, each in enumerate(self._estimator.unknowns) if not each.path.startswith("bias.")]
        own = [self._estimator.unknowns[k] for k in chosen]
        names = unknown_names(self._estimator)
        self._chosen = np.array(chosen, dtype=np.intp)
        self.keys = [key_of(structure.start.data, names[k]) for k in chosen]
        self._is_log = np.array([_is_logarithmic(each.path, each.start) for each in own], dtype=bool)
        self.start, self.low, self.high = (
            self._turned(np.array([getattr(each, end) for each in own])) for end in ("start", "lower", "upper")
        )
        scale = self.plain_scale = np.array([each.scale for each in own])
        self.scale = np.where(self._is_log, np.log(10.0), np.where(np.isfinite(scale) & (scale > 0.0), scale, np.inf))
        self.start = np.clip(self.start, self.low, self.high)

    def _turned(self, values: Numbers) -> Numbers:
        return np.where(self._is_log, np.log(np.maximum(values, 1e-300)), values)

    def numbers(self, x: Numbers) -> Numbers:
        """Return the numbers of the description [p]."""
        z = self._estimator.start.copy()
        z[self._chosen] = np.where(self._is_log, np.exp(np.where(self._is_log, x, 0.0)), x)
        return self._estimator.values(z)

    @cached_property
    def _paths(self) -> list[str]:
        both = ((number.path, number.with_path) for number in self._structure.numbers)
        return [path for pair in both for path in pair if path is not None and not path.startswith("bias.")]

    def left(self, x: Numbers) -> Numbers:
        """Return what is left at used blocks, without its constants [R·n], N·m."""
        numbers = self.numbers(x)
        values = {path: float(numbers[self._structure.index[path]]) for path in self._paths}
        return self._samples.drift.without(self._samples.left(self._structure.start.data, values)).ravel()

    def whole_slopes(self) -> Numbers:
        """Return the derivatives of the model's torque by the unknowns as they are, at the start [B, n, u]."""
        data, x = self._structure.start.data, self.start
        base = self._samples.left(data)
        columns = np.empty((*base.shape, len(x)))
        steps = self._steps(x)
        for k in range(len(x)):
            moved = x.copy()
            moved[k] += steps[k]
            numbers = self.numbers(moved)
            values = {path: float(numbers[self._structure.index[path]]) for path in self._paths}
            per = steps[k] * (np.exp(x[k]) if self._is_log[k] else 1.0)
            columns[:, :, k] = (base - self._samples.left(data, values)) / per
        return columns

    def _steps(self, x: Numbers) -> Numbers:
        steps = np.where(self._is_log, OF_LOGARITHM, np.maximum(RELATIVE * np.abs(x), ABSOLUTE * self.size))
        return np.where(x + steps <= self.high, steps, -steps)

    def slopes(self, x: Numbers, left: Numbers, known: Mapping[str, Numbers]) -> Numbers:
        """Return the derivatives of `left` [R·n, u]; those that are known are taken as they are."""
        columns = np.empty((len(left), len(x)))
        steps = self._steps(x)
        for k, key in enumerate(self.keys):
            if key in known and len(known[key]) == len(left):
                columns[:, k] = known[key]
                continue
            moved = x.copy()
            moved[k] += steps[k]
            columns[:, k] = (self.left(moved) - left) / steps[k]
        return columns

    @cached_property
    def size(self) -> Numbers:
        """Expected magnitudes, also where none is known [u]."""
        return np.where(np.isfinite(self.scale), self.scale, np.maximum(np.abs(self.start), 1e-6))


def number_columns(data: Data, samples: Samples) -> tuple[Array, Numbers]:
    """Return the derivatives of a torque by the numbers that a fit estimates [B, n, u], and the scale of these [u]."""
    if not unknowns(data):
        return np.zeros((samples.grid.blocks, len(data["joints"]), 0)), np.zeros(0)
    problem = _Problem(build_structure(finger_from_data(data, Path("finger")), Choice()), samples)
    return problem.whole_slopes(), problem.plain_scale


def _is_logarithmic(path: str, start: float) -> bool:
    return path.startswith("extensions[") and path.rsplit(".", 1)[-1] in LOGARITHMIC and start > 0.0


def key_of(data: Data, name: str) -> str:
    """Return a name of an unknown that another description has, too: rows of `extensions` by effect and place."""
    if not name.startswith("extensions["):
        return name
    head, _, last = name.partition(".")
    number = int(head[len("extensions[") : -1]) - 1
    rows = data["extensions"]

    def mark(row: Mapping[str, Any]) -> tuple[Any, ...]:
        return tuple(row.get(key) for key in ("effect", "joint", "tendon", "level"))

    same = sum(mark(row) == mark(rows[number]) for row in rows[:number])
    return f"{mark(rows[number])} {same}.{last}"


def _minimised(problem: _Problem, known: Mapping[str, Numbers], rough: bool) -> tuple[Numbers, float, Numbers]:
    """Return the unknowns [u] of least cost, the cost, and the derivatives there [R·n, u] (Levenberg, Marquardt)."""
    x, damping = problem.start.copy(), 1e-3
    left = problem.left(x)
    slopes, is_fresh = problem.slopes(x, left, known), not known
    if not len(x):
        return x, float(left @ left), slopes
    # the weight of prior knowledge: that of `MEMORY` independent rows of what is left
    weight = MEMORY * float(left @ left) / len(left) / problem.scale**2
    cost = float(left @ left + weight @ (x - problem.start) ** 2)
    for _ in range(MOST_STEPS):
        gram, score = slopes.T @ slopes, -slopes.T @ left - weight * (x - problem.start)
        gram[np.diag_indices_from(gram)] += weight + damping * np.maximum(np.diagonal(gram), 1e-300)
        step = bounded(gram[None], score[None], problem.low - x, problem.high - x)[0]
        after = problem.left(x + step)
        lower = float(after @ after + weight @ (x + step - problem.start) ** 2)
        gain = cost - lower
        if gain > 0.0:
            turned = step / problem.size**2
            slopes += np.outer((after - left - slopes @ step) / max(float(step @ turned), 1e-300), turned)
            x, left, cost, damping = x + step, after, lower, max(damping / 5.0, 1e-6)
        if gain < TOLERANCE * cost:
            if (is_fresh or rough) and (gain >= 0.0 or damping > 1.0):
                break
            if is_fresh or rough:
                damping *= 10.0
                continue
            slopes, is_fresh = problem.slopes(x, left, {}), True
        else:
            is_fresh = False
    return x, cost, slopes


def with_known(data: Mapping[str, Any], recordings: Sequence[FitRecording], settings: FitSettings) -> Mapping[str, Any]:
    """Return a fitted description with what recordings tell of its numbers (`estimated`)."""
    return with_known_numbers(finger_from_data(data, settings.path), recordings).data


def fit_extended(
    nominal: FittedModel,
    causes: Sequence[Term],
    samples: Samples,
    settings: FitSettings = FitSettings(),
    begin: FittedModel | None = None,
    rough: bool = False,
) -> FittedModel:
    """Fit the nominal model with the causes' terms, all numbers again; those that `begin` has start there."""
    causes = possible(nominal.data, causes)
    if not causes:
        return nominal
    data = extended_description(nominal.data, causes)
    added = zip(causes, added_paths(nominal.data, causes), strict=True)
    estimated = {number.path for number in unknowns(data)}
    fixed = tuple(path for cause, paths in added if cause.fixed for path in paths if path in estimated)
    known = None if begin is None else begin.slopes
    if begin is not None:
        data = carried(data, begin.data)
    return fit_numbers(data, samples, settings, given=nominal.given, fixed=fixed, known=known, rough=rough)


def carried(data: Data, known: Data) -> Mapping[str, Any]:
    """Return a description with the numbers that another one has, too."""
    theirs = {key_of(known, number.path): number.path for number in unknowns(known)}
    result = own_copy(data)
    for number in unknowns(data):
        path = theirs.get(key_of(data, number.path))
        for own in (number.path, number.with_path):
            if own is not None and path is not None:
                set_number(result, own, float(get_number(known, path)))
    return result


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
