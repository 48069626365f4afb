"""How large a cause is, in plain words with physical units; of a change, its main number then and now."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.candidate_columns import with_numbers
from tendonfmu.diagnosis.change_search import ChangeSearch
from tendonfmu.diagnosis.effects import BY_NAME, Place
from tendonfmu.diagnosis.effects.mechanism import data_number
from tendonfmu.diagnosis.effects.places import thresholds
from tendonfmu.diagnosis.effects.words import NBSP, quantity
from tendonfmu.diagnosis.extension_fit import added_paths
from tendonfmu.diagnosis.result import CausePlace, ChangedSize, Parameters, with_error
from tendonfmu.diagnosis.selection import Judged
from tendonfmu.files import counted
from tendonfmu.model import native
from tendonfmu.statistics import Interval

Thresholds = tuple[float, float]

LEAST_OF_NOW = 0.05  # of the present value: a change from a smaller number is not reported as a share of it
_OTHER_SIDE = {"positive": "negative", "negative": "positive"}
# numbers that say of which form a term is, not how large it is
_FORM = ("stribeck_velocity", "beyond", "turns", "time_constant", "reaction", "rest_angle", "displacement")
_SHOWN = 3  # numbers that are listed for an effect without words of its own


def size_of(effect: str, places: Sequence[CausePlace], thresholds: Thresholds) -> str:
    """Return a size such as "a play of 0.32 mm"; for several places the largest one and their number."""
    sized = [place for place in places if place.parameters]
    if not sized:
        return ""
    sizes = list(dict.fromkeys(size_at(effect, place.parameters, thresholds) for place in sized))
    if len(sized) == 1:
        return sizes[0]
    if len(sizes) == 1:
        return f"{sizes[0]}, at each of {len(sized)} places"
    units = {_first(place)[1] for place in sized}
    if len(units) > 1:  # for example everywhere and at a joint
        return f"{sizes[0]}; different at {counted(len(sized) - 1, 'place')}"
    largest = max(sized, key=lambda place: abs(_first(place)[0]))
    return f"{size_at(effect, largest.parameters, thresholds)} at the largest of {len(sized)} places"


def size_at(effect: str, parameters: Parameters, thresholds: Thresholds) -> str:
    """Return the size of an effect at one place in plain words."""
    if effect == "presliding" and (sized := _travel(parameters, thresholds)):
        return sized
    numbers: dict[str, list[tuple[float, str]]] = {}
    for path, number in parameters.items():
        numbers.setdefault(path.rsplit(".", 1)[-1], []).append(number)
    try:
        return BY_NAME[effect].size(numbers)
    except (KeyError, ValueError):  # it is given by other numbers, for example by a law instead of a row
        return _listed(parameters)


def _travel(parameters: Parameters, thresholds: Thresholds) -> str:
    """Return the travel of presliding at all places, whose number is a time: time × threshold of motion."""
    times = [value for path, (value, unit) in parameters.items() if path.endswith(".displacement") and unit == "s"]
    if not times:
        return ""
    time = max(times)
    tendon, joint = (quantity(time * threshold, unit) for threshold, unit in zip(thresholds, ("m", "rad"), strict=True))
    return f"over {tendon} at tendons, {joint} at joints"


def _first(place: CausePlace) -> tuple[float, str]:
    return next(iter(place.parameters.values()))


def _listed(parameters: Parameters) -> str:
    """Return names and values of the first few numbers."""
    names = [path.rsplit(".", 1)[-1].replace("_", " ") for path in parameters]
    shown = [f"{name} {quantity(*number)}" for name, number in zip(names, parameters.values(), strict=True)]
    more = len(shown) - _SHOWN
    return ", ".join(shown[:_SHOWN]) + (f" and {more} more" if more > 0 else "")


# --- changes ----------------------------------------------------------------------------------------------------------


def sized(search: ChangeSearch, number: int) -> dict[str, Any]:
    """Return the size of one of the changes, as fields of `Cause`, estimated together with all others."""
    changes = search.causes
    now = search.now_data()
    units = {parameter.path: parameter.unit for parameter in native.Instance.from_description(now).parameters()}
    if changes[number].terms:
        return _new_term(search, number, now, units)
    then = search.now_data([change for k, change in enumerate(changes) if k != number])
    return _other_number(search, changes[number], then, now, units)


def _relative_error(change: Judged) -> float:
    """Return the standard error of the whole change over its size, along the direction in which it was found."""
    value = float(np.linalg.norm(change.magnitudes))
    direction = change.magnitudes / max(value, 1e-300)
    return math.sqrt(max(float(direction @ change.covariance @ direction), 0.0)) / max(value, 1e-300)


def _new_term(search: ChangeSearch, number: int, now: Data, units: Mapping[str, str]) -> dict[str, Any]:
    """Return the size of a term that the description lacks."""
    changes, change = search.causes, search.causes[number]
    first, terms = len(search.terms(changes[:number])), change.scaled()
    paths = added_paths(with_numbers(search.data, search.added(changes)), search.terms(changes))[first:]
    places = tuple(
        CausePlace(*term.place, {path: (data_number(now, path), units[path]) for path in added if path in units})
        for term, added in zip(terms, paths, strict=False)
    )
    main = _main([path for place in places for path in place.parameters], now)
    unit = units.get(main[0], "1") if main else "1"
    value = math.hypot(*(data_number(now, path) for path in main)) if len(main) > 1 else data_number(now, main[0])
    error = abs(value) * _relative_error(change)
    size, intervals = with_error(value, error), {path: with_error(data_number(now, path), error) for path in main}
    name = "amplitude" if len(main) > 1 else main[0].rsplit(".", 1)[-1]
    words = f"{size_of(change.effect, places, thresholds(now))}, beyond what the reference has"
    changed = ChangedSize(name, unit, Interval(0.0, 0.0, 0.0), size, size)
    return {"places": places, "changed": changed, "size": words, "intervals": intervals}


def _main(paths: Sequence[str], now: Data) -> list[str]:
    """Return the paths that say how large the term is."""
    waves = [path for path in paths if path.rsplit(".", 1)[-1] in ("sine", "cosine")]
    if waves:
        return waves[:2]
    sizes = [path for path in paths if path.rsplit(".", 1)[-1] not in _FORM] or list(paths)
    return [max(sizes, key=lambda path: abs(data_number(now, path)))]


def _other_number(
    search: ChangeSearch, change: Judged, then: Data, now: Data, units: Mapping[str, str]
) -> dict[str, Any]:
    """Return the size of a number that the description has; `then` is the description of now without this change."""
    by_place: dict[Place, dict[str, tuple[float, str]]] = {}
    for k in np.flatnonzero(change.mix[-len(search.numbers) :].any(axis=1)):
        number = search.numbers[k]
        by_place.setdefault(number.place, {})[number.path] = (data_number(now, number.path), units[number.path])
    places = tuple(CausePlace(*place, numbers) for place, numbers in by_place.items())
    paths = [path for place in places for path in place.parameters]
    main = max(paths, key=lambda path: abs(data_number(now, path) - data_number(then, path)))
    before, after = data_number(then, main), data_number(now, main)
    name, unit, apart = main.rsplit(".", 1)[-1], units[main], change.effect == "asymmetric_friction"
    if apart:
        before, after = _difference(then, main), _difference(now, main)
        name = f"{name}, positive minus negative direction"
    error = abs(after - before) * _relative_error(change)
    more = ""
    if before and abs(before) >= LEAST_OF_NOW * abs(after) and not apart:
        more = f"{100 * ((after - before) / before):+.0f}{NBSP}%: ".replace("-", "−")
    where = f", at the largest of {len(places)} places" if len(places) > 1 else ""
    words = f"{more}{quantity(before, unit)} then, {quantity(after, unit)} now{where}"
    changed = ChangedSize(
        name, unit, with_error(before, 0.0), with_error(after, error), with_error(after - before, error)
    )
    intervals = {main: with_error(data_number(now, main), error)}
    return {"places": places, "changed": changed, "size": words, "intervals": intervals}


def _difference(data: Data, path: str) -> float:
    """Return the difference between the two sides of a law in a number, positive minus negative direction."""
    for side, other in _OTHER_SIDE.items():
        if f".{side}." in path:
            sign = 1.0 if side == "positive" else -1.0
            return sign * (data_number(data, path) - data_number(data, path.replace(f".{side}.", f".{other}.")))
    return data_number(data, path)


def with_sizes_by_recording(search: ChangeSearch, number: int, known: dict[str, Any]) -> dict[str, Any]:
    """Add the size in each of several new recordings, in their order."""
    size: ChangedSize = known["changed"]
    if len(search.new_recordings) < 2:
        return known
    moved = size.change.value
    by = [
        with_error(size.reference.value + moved * share, abs(moved) * error)
        for share, error in search.shares_by_recording(number)
    ]
    return known | {"changed": replace(size, by=tuple(by))}
