"""How a description's numbers are fitted: by what runs of the core leave, without a learning bias.

The likelihood is that of `estimate.memory_fit`; noise is correlated over some blocks, so that so many count as one.
Between two computations of derivatives Broyden's rank-one update keeps them good enough.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Array, Data, Numbers
from tendonfmu.diagnosis.effects import Place, Term, by_name
from tendonfmu.diagnosis.effects.mechanism import sides_at
from tendonfmu.diagnosis.effects.terms import changed_law
from tendonfmu.diagnosis.result import with_error
from tendonfmu.diagnosis.samples import Samples
from tendonfmu.estimate import (
    CHOSEN,
    Choice,
    Estimator,
    MemoryProblem,
    Structure,
    build_structure,
    guess_prior,
    minimise,
    with_known_numbers,
    with_values,
)
from tendonfmu.model import (
    Finger,
    Number,
    effects,
    extension_rows,
    finger_of,
    friction_numbers,
    get_number,
    law_path,
    own_copy,
    set_number,
)
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import MEMORY, Interval

# --- memory of friction -----------------------------------------------------------------------------------------------


REMEMBERING = PRESLIDING, RELAXATION, CORDS = "presliding", "relaxation", "cord_stretch"
Row = Mapping[str, Any]  # of `extensions`


@dataclass(frozen=True)
class MemoryTerm(Term):
    """A part of the memory; its rows take the place of what the description has of it."""

    rows: tuple[Row, ...] = ()

    def added_to(self, data: Data) -> dict[str, Any]:
        """Return the description with this part."""
        present = list(data.get("extensions") or [])
        elements = [row for row in present if row["effect"] == PRESLIDING]
        others = [row for row in present if row["effect"] not in (PRESLIDING, CORDS)]
        cords = [row for row in present if row["effect"] == CORDS]
        if self.mechanism.name == PRESLIDING:
            elements = [dict(row) for row in self.rows]
        elif self.mechanism.name == RELAXATION:
            times = [row["relaxation_time"] for row in self.rows]
            elements = [{**row, "relaxation_time": time} for row, time in zip(elements, times, strict=True)]
        else:
            cords = [dict(row) for row in self.rows]
        return {**data, "extensions": [*others, *elements, *cords]}


def with_part(presliding: Term, part: Term) -> MemoryTerm:
    """Return the term of presliding with relaxation or cords of its own."""
    assert isinstance(presliding, MemoryTerm) and isinstance(part, MemoryTerm)
    of_cords = part.mechanism.name == CORDS
    others = [row for row in presliding.rows if (row["effect"] == CORDS) != of_cords]
    return replace(presliding, rows=(*others, *part.rows) if of_cords else (*part.rows, *others))


def memory_terms(data: Data, rows: Sequence[Row]) -> list[tuple[Term, ...]]:
    """Return what a description lacks of the rows of a memory, each part as the terms of one cause."""
    given = memory_of(data)
    chosen = [row for row in rows if row["effect"] == PRESLIDING]
    parts: list[tuple[Term, ...]] = []
    if [_form(row) for row in chosen] != [_form(row) for row in given if row["effect"] == PRESLIDING]:
        bare = tuple({key: value for key, value in row.items() if key != "relaxation_time"} for row in chosen)
        parts.append((_term(PRESLIDING, bare),))
    relaxing = all("relaxation_time" in row for row in chosen) and chosen
    if relaxing and not any("relaxation_time" in row for row in given):
        parts.append((_term(RELAXATION, tuple(chosen)),))
    cords = tuple(row for row in rows if row["effect"] == CORDS)
    if cords and not any(row["effect"] == CORDS for row in given):
        parts.append((_term(CORDS, cords),))
    return parts


def memory_of(data: Data) -> list[Row]:
    """Return the rows of memory of a description."""
    return [row for row in data.get("extensions") or [] if row["effect"] in (PRESLIDING, CORDS)]


def _term(name: str, rows: tuple[Row, ...]) -> MemoryTerm:
    return MemoryTerm(by_name(name), Place(), rows=rows)


def _form(row: Row) -> tuple[Any, ...]:
    """Return what a row is about, whatever its numbers are."""
    place = tuple(row.get(key) for key in ("joint", "tendon", "level"))
    return place, "displacement" in row, "share" in row, *(bool(row.get(key)) for key in CHOSEN)


# --- all numbers ------------------------------------------------------------------------------------------------------

PLACE = ("effect", "joint", "tendon", "level")
MOST_STEPS = 20
LASTING = 0.2  # s, for which an error of the model lasts, about
STEP = 1e-3  # of a coordinate, for slopes of numbers
TOLERANCE = 0.05  # standard errors (rms): a shorter step is the last one, and so few blocks have large ones
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
    # derivatives of what is left by the unknowns [R, n, u]; of the samples it was fitted to
    slopes: Numbers = field(default_factory=lambda: np.zeros((0, 0, 0)), repr=False, compare=False)
    scale: Numbers = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)  # of the unknowns [u]

    def columns(self, samples: Samples) -> tuple[Array, Numbers]:
        """Return the derivatives of the torque by the unknowns [B, n, u], 0 where not used, and their scale [u]."""
        joints = len(self.data["joints"])
        columns = np.zeros((samples.grid.blocks, joints, self.slopes.shape[2]), dtype=np.float32)
        if self.slopes.size:
            columns[samples.used] = -self.slopes
        return columns, self.scale


def fit_numbers(
    data: Mapping[str, Any],
    samples: Samples,
    settings: FitSettings = FitSettings(),
    *,
    given: Mapping[str, Any] | None = None,
    fixed: tuple[str, ...] = (),
    rough: bool = False,
) -> FittedModel:
    """Fit the numbers of a description, starting at its own; one without numbers stays as it is.

    A rough fit does not compute the derivatives anew at its end.
    """
    # The samples have the forces that the model predicts: they lack the noise, which a term that scales with the force
    # would otherwise fit by shrinking the force.
    if not friction_numbers(data):
        return FittedModel(data=data, given=data, values={})
    origin = data if given is None else given
    structure = _structure(data, origin, fixed, settings)
    problem = _problem(structure, samples)
    begin = problem.state(np.clip(problem.mean, problem.lower, problem.upper))
    found = minimise(problem, begin, MOST_STEPS, TOLERANCE, rough=True)
    state, last = found.state, found.linearised if rough else problem.linearised(found.state)
    numbers = problem.estimator.values(np.clip(problem.unknowns_at(state), *problem.bounds))
    log, size = problem.scale.log, problem.scale.size
    return FittedModel(
        data=with_values(structure, numbers).data,
        given=origin,
        values={number.path: float(numbers[structure.index[number.path]]) for number in structure.numbers},
        cost=state.cost,
        fixed=fixed,
        slopes=last.columns / np.where(log, 1.0, size),
        scale=np.where(log, np.log(10.0), size),
    )


def _problem(structure: Structure, samples: Samples) -> MemoryProblem:
    """Return a fit of a structure, whose blocks are worth fewer independent ones."""
    estimator = Estimator(structure.start.image, structure.group, structure.scale)
    problem = MemoryProblem(structure, estimator, samples.runs.of(structure.start), samples.drift)
    problem.blocks = problem.blocks * (samples.grid.step / LASTING / MEMORY)
    problem.mean, problem.known = guess_prior(problem)
    return problem


def _structure(data: Data, given: Data, fixed: tuple[str, ...], settings: FitSettings) -> Structure:
    """Return what is fitted of a description; `given` says how large each number may be."""
    choice = replace(settings.choice, fix=(*settings.choice.fix, *fixed))
    return _with_scale(build_structure(Finger(settings.path, data), choice), given)


def intervals_of(model: FittedModel, samples: Samples, settings: FitSettings) -> dict[str, Interval]:
    """Return the 95 % intervals of the numbers of a fitted model, by path.

    The error is the larger one of what lasting errors of the model allow and what blocks of time differ by.
    """
    if not model.values:
        return {}
    fit = _problem(_structure(model.data, model.given, model.fixed, settings), samples)
    state = fit.state(np.clip(fit.mean, fit.lower, fit.upper))
    linearised, values = fit.linearised(state), fit.values(state.u)
    scores = fit.scores(state, linearised)[0] * fit.scale.slopes(fit.scale.unknowns(state.u))
    lasting = np.linalg.pinv(linearised.information + fit.known)
    scattered = scores @ lasting
    moves = [fit.values(state.u + STEP * way) for way in np.eye(len(state.u))]

    def interval(path: str) -> Interval:
        slope = np.array([moved[path] - values[path] for moved in moves]) / STEP
        by_time = float(np.linalg.norm(scattered @ slope))
        return with_error(values[path], max(float(np.sqrt(slope @ lasting @ slope)), by_time))

    return {path: interval(path) for path in values}


def number_columns(data: Data, samples: Samples) -> tuple[Array, Numbers]:
    """Return the derivatives of a torque by the numbers that a fit estimates [B, n, u], and the scale of these [u]."""
    if not friction_numbers(data):
        return np.zeros((samples.grid.blocks, len(data["joints"]), 0)), np.zeros(0)
    problem = _problem(structure_of(data), samples)
    chosen = [k for k, unknown in enumerate(problem.estimator.unknowns) if not unknown.path.startswith("bias.")]
    return problem.slopes(problem.state(problem.mean))[:, :, chosen], problem.scale.size[chosen]


def structure_of(data: Data) -> Structure:
    """Return the numbers of a description that a fit estimates, with their expected magnitudes."""
    return _with_scale(build_structure(finger_of(data), Choice()), data)


def key_of(data: Data, path: str) -> Any:
    """Return what names a number in other descriptions, too: rows of `extensions` by effect and place, as they move."""
    place = re.match(r"extensions\[(\d+)\]", path)
    if place is None:
        return path
    *before, own = (tuple(row.get(key) for key in PLACE) for row in extension_rows(data)[: int(place[1])])
    return own, before.count(own), path[place.end() :]


def with_known(data: Mapping[str, Any], recordings: Sequence[FitRecording], settings: FitSettings) -> Mapping[str, Any]:
    """Return a fitted description with what recordings tell of its numbers (`estimated`)."""
    return with_known_numbers(Finger(settings.path, data), recordings).data


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
    estimated = {number.path for number in friction_numbers(data)}
    fixed = tuple(path for cause, paths in added if cause.fixed for path in paths if path in estimated)
    fixed = (*nominal.fixed, *fixed)
    if begin is not None:
        data = carried(data, begin.data)
    return fit_numbers(data, samples, settings, given=nominal.given, fixed=fixed, rough=rough)


def carried(data: Data, known: Data) -> Mapping[str, Any]:
    """Return a description with the numbers that another one has, too."""
    # a number that goes with another one there may be free here: `static` of a law that had no drop
    theirs = {key_of(known, path): path for number in friction_numbers(known) for path in number.paths}
    result = own_copy(data)
    for number in friction_numbers(data):
        path = theirs.get(key_of(data, number.path))
        for own in number.paths:
            if path is not None:
                set_number(result, own, float(get_number(known, path)))
    for effect in effects(data):  # a drop that only this one has stays as large a share
        for new, side in zip(sides_at(data, effect.path), sides_at(result, effect.path), strict=True):
            if new["static"] > new["coulomb"] and side["static"] <= side["coulomb"]:
                side["static"] = side["coulomb"] * new["static"] / (new["coulomb"] or new["static"])
    return result


def cause_parameters(
    nominal: Mapping[str, Any], causes: Sequence[Term], model: FittedModel
) -> tuple[Mapping[str, tuple[float, str]], ...]:
    """Return the numbers of each cause in a model that was fitted with all of them: path -> (value, unit)."""
    units = {path: number.unit for path, number in finger_of(model.data).numbers.items()}
    # those that were estimated, and all numbers of extensions
    known = {*model.values, *(path for path in units if path.startswith("extensions["))}
    return tuple(
        {path: (float(get_number(model.data, path)), units[path]) for path in paths if path in known}
        for paths in added_paths(nominal, causes)
    )


def extended_description(data: Mapping[str, Any], causes: Sequence[Term]) -> Mapping[str, Any]:
    """Return the description with the causes' terms, added one after the other."""
    for cause in causes:
        data = cause.added_to(data)
    return data


def added_paths(data: Mapping[str, Any], causes: Sequence[Term]) -> tuple[tuple[str, ...], ...]:
    """Return, for each cause, the paths of the numbers that it adds or replaces, in the description with all causes."""
    added, before = [], _numbers_by_key(data)
    for cause in causes:
        data = cause.added_to(data)
        after = _numbers_by_key(data)
        # a number that is only written differently does not belong to the cause
        added.append([key for key, (_, value) in after.items() if key not in before or before[key][1] != value])
        before = after
    return tuple(tuple(before[key][0] for key in keys if key in before) for keys in added)


def _numbers_by_key(data: Data) -> dict[Any, tuple[str, float]]:
    return {key_of(data, path): (path, value) for path, value in _leaves(data)}


# --- parts ------------------------------------------------------------------------------------------------------------


def possible(data: Mapping[str, Any], causes: Sequence[Term]) -> list[Term]:
    """Return the causes without those that change a law which only a cause outside of the list would add."""
    kept = []
    for cause in causes:
        path = changed_law(cause)
        alone = not any(row["effect"] == PRESLIDING for row in memory_of(data))
        if cause.mechanism.name in (RELAXATION, CORDS) and alone:  # they are part of a memory that has presliding
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
    ordinary: dict[str, float] = {}  # how many times its ordinary size a row of extensions has
    for number in structure.numbers:
        if number.extension:
            row = _row(number)
            ordinary[row] = max(ordinary.get(row, 0.0), abs(number.value) / number.size)
    for number in structure.numbers:
        for path in number.paths:
            if not np.isnan(scale[structure.index[path]]):
                continue
            described = next((abs(value) for known in _coarser(path) if (value := _number_or_none(given, known))), 0.0)
            new = NEW * abs(_number_or_none(structure.start.data, path) or 0.0)
            # where the row has another number, one that it lacks is as ordinary as that
            scale[structure.index[path]] = described or new or ordinary.get(_row(number), 0.0) * number.size or TINY
    return replace(structure, scale=scale)


def _row(number: Number) -> str:
    return number.path.rpartition(".")[0]


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
