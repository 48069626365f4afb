"""How a description's numbers are fitted: by what runs of the core leave, without a learning bias.

The likelihood is that of `estimate.memory_fit`; noise is correlated over some blocks, so that so many count as one.
Derivatives are differences between runs. Between two computations of them Broyden's rank-one update keeps them good
enough (Broyden, Math. Comp. 19, 1965), and a fit begins with those of a similar model.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Array, Data, Numbers
from tendonfmu.diagnosis.effects import Term
from tendonfmu.diagnosis.effects.description_edit import sides_at
from tendonfmu.diagnosis.effects.memory import PRESLIDING, memory_of, needs_presliding
from tendonfmu.diagnosis.effects.terms import changed_law
from tendonfmu.diagnosis.samples import Samples
from tendonfmu.estimate import (
    Choice,
    Estimator,
    MemoryProblem,
    State,
    Structure,
    build_structure,
    get_number,
    guess_prior,
    own_copy,
    set_number,
    unknown_names,
    unknowns,
    with_known_numbers,
    with_values,
)
from tendonfmu.model import effects, extension_rows, finger_from_data, law_path, native
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import MEMORY, bounded

PLACE = ("effect", "joint", "tendon", "level")
MOST_STEPS = 20
LASTING = 0.2  # s, for which an error of the model lasts, about
LEAST_FALL = 1e-3  # of the cost, for each independent block: a step that lowers it by less is the last one
STEP = 1e-3  # of a coordinate, for derivatives
FARTHEST = 10.0  # times its expected magnitude, that a step moves a number
TINY = 1e-9  # expected magnitude of a number that is 0, which stays there
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
    # derivatives of what is left by the unknowns, by their keys [R, n]; of the samples it was fitted to
    slopes: Mapping[str, Numbers] = field(default_factory=dict, repr=False, compare=False)
    scale: Numbers = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)  # of the unknowns [u]

    def columns(self, samples: Samples) -> tuple[Array, Numbers]:
        """Return the derivatives of the torque by the unknowns [B, n, u], 0 where not used, and their scale [u]."""
        joints = len(self.data["joints"])
        columns = np.zeros((samples.grid.blocks, joints, len(self.slopes)), dtype=np.float32)
        for k, slope in enumerate(self.slopes.values()):
            columns[samples.used, :, k] = -slope
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
    fit = problem.fit
    state, columns = _minimised(problem, np.clip(fit.mean, fit.lower, fit.upper), known or {}, rough)
    numbers = fit.estimator.values(
        np.clip(fit.scale.unknowns(state.u), *(fit.scale.unknowns(end) for end in (fit.lower, fit.upper)))
    )
    return FittedModel(
        data=with_values(structure, numbers).data,
        given=origin,
        values={number.path: float(numbers[structure.index[number.path]]) for number in structure.numbers},
        cost=state.cost,
        fixed=fixed,
        slopes=problem.known(columns),
        scale=np.where(fit.scale.log, np.log(10.0), fit.scale.size),
    )


class _Problem:
    """A fit of a structure, with derivatives that other fits know."""

    def __init__(self, structure: Structure, samples: Samples) -> None:
        estimator = Estimator(structure.start.image, structure.group, structure.scale)
        self.fit = MemoryProblem(structure, estimator, samples.runs.of(structure.start.data), samples.drift)
        self.fit.blocks = self.fit.blocks * (samples.grid.step / LASTING / MEMORY)
        self.fit.mean, self.fit.known = guess_prior(self.fit)
        self.keys = [key_of(structure.start.data, name) for name in unknown_names(estimator)]
        self._unit = np.where(self.fit.scale.log, 1.0, self.fit.scale.size)  # of a coordinate

    def columns(self, state: State, known: Mapping[str, Numbers]) -> Numbers:
        """Return the derivatives of the residual at a state [R, n, u]; those that are known are taken as they are."""
        columns = np.empty((*state.residual.shape, len(state.u)))
        for k, key in enumerate(self.keys):
            if key in known and len(known[key]) == len(state.residual):
                columns[:, :, k] = known[key] * self._unit[k]
                continue
            step = STEP if state.u[k] + STEP <= self.fit.upper[k] else -STEP
            moved = state.u.copy()
            moved[k] += step
            columns[:, :, k] = (self.fit.state(moved).residual - state.residual) / step
        return columns

    def known(self, columns: Numbers) -> dict[str, Numbers]:
        """Return derivatives by their keys [R, n], for another fit."""
        return {key: columns[:, :, k] / self._unit[k] for k, key in enumerate(self.keys)}

    def step(self, state: State, columns: Numbers, damping: float) -> Numbers:
        """Return the step [u] that minimises the damped quadratic model between bounds."""
        fit = self.fit
        weighted = columns * (fit.blocks / len(state.residual) / fit.variance(state.residual))[:, None]
        matrix = np.tensordot(columns, weighted, ([0, 1], [0, 1])) + fit.known
        score = -np.tensordot(weighted, state.residual, ([0, 1], [0, 1])) - fit.known @ (state.u - fit.mean)
        matrix[np.diag_indices_from(matrix)] *= 1.0 + damping
        low, high = np.maximum(fit.lower - state.u, -FARTHEST), np.minimum(fit.upper - state.u, FARTHEST)
        return np.asarray(bounded(matrix[None], score[None], low, high)[0])


def _minimised(problem: _Problem, begin: Numbers, known: Mapping[str, Numbers], rough: bool) -> tuple[State, Numbers]:
    """Go down from coordinates `begin` [u] (Levenberg, Marquardt); return where it ends, and the derivatives there."""
    fit = problem.fit
    state, damping = fit.state(begin), 1e-3
    columns, is_fresh = problem.columns(state, known), not known
    for _ in range(MOST_STEPS if len(begin) else 0):
        step = problem.step(state, columns, damping)
        tried = fit.state(state.u + step)
        fall = state.cost - tried.cost
        if fall > 0.0:
            missed = tried.residual - state.residual - columns @ step
            columns = columns + missed[:, :, None] * (step / max(float(step @ step), 1e-300))
            state, damping = tried, max(damping / 5.0, 1e-6)
        if fall > LEAST_FALL * float(fit.blocks.sum()):
            is_fresh = False
        elif not (is_fresh or rough):
            columns, is_fresh = problem.columns(state, {}), True
        elif fall >= 0.0 or damping > 1.0:
            break
        else:
            damping *= 10.0
    return state, columns


def number_columns(data: Data, samples: Samples) -> tuple[Array, Numbers]:
    """Return the derivatives of a torque by the numbers that a fit estimates [B, n, u], and the scale of these [u]."""
    if not unknowns(data):
        return np.zeros((samples.grid.blocks, len(data["joints"]), 0)), np.zeros(0)
    problem = _Problem(structure_of(data), samples)
    fit = problem.fit
    chosen = [k for k, unknown in enumerate(fit.estimator.unknowns) if not unknown.path.startswith("bias.")]
    return fit.slopes(fit.state(fit.mean), fit.runs)[:, :, chosen], fit.scale.size[chosen]


def structure_of(data: Data) -> Structure:
    """Return the numbers of a description that a fit estimates, with their expected magnitudes."""
    return _with_scale(build_structure(finger_from_data(data, Path("finger")), Choice()), data)


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
    # a number that goes with another one there may be free here: `static` of a law that had no drop
    theirs = {
        key_of(known, path): path
        for number in unknowns(known)
        for path in (number.path, number.with_path)
        if path is not None
    }
    result = own_copy(data)
    for number in unknowns(data):
        path = theirs.get(key_of(data, number.path))
        for own in (number.path, number.with_path):
            if own is not None and path is not None:
                set_number(result, own, float(get_number(known, path)))
    for effect in effects(result):  # a drop that only this one has stays above what came of the other
        for side in sides_at(result, effect.path):
            side["static"] = max(side["static"], side["coulomb"])
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
    """Return, for each cause, the paths of the numbers that it adds or replaces, in the description with all causes."""
    added, before = [], _numbers_by_row(data)
    for cause in causes:
        data = cause.added_to(data)
        after = _numbers_by_row(data)
        # a number that is only written differently does not belong to the cause
        added.append([row for row, (_, value) in after.items() if row not in before or before[row][1] != value])
        before = after
    return tuple(tuple(before[row][0] for row in rows if row in before) for rows in added)


def _numbers_by_row(data: Data) -> dict[Any, tuple[str, float]]:
    """Return (path, value) of all numbers; those of extensions by effect and place, since rows move."""
    rows = [tuple(row.get(key) for key in PLACE) for row in extension_rows(data)]
    found: dict[Any, tuple[str, float]] = {}
    for path, value in _leaves(data):
        place = re.match(r"extensions\[(\d+)\]", path)
        k = 0 if place is None else int(place[1])
        key: Any = (rows[k - 1], rows[: k - 1].count(rows[k - 1]), path[place.end() :]) if place else path
        found[key] = (path, value)
    return found


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
        if needs_presliding(cause) and not any(row["effect"] == PRESLIDING for row in memory_of(data)):
            continue
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
                scale[structure.index[path]] = NEW * abs(begin) if begin else TINY
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
