"""How large a change is: its main number in the reference and now, with intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.changes.numbers import changed
from tendonfmu.diagnosis.changes.search import Change, ChangeSearch
from tendonfmu.diagnosis.effects.description_edit import data_number
from tendonfmu.diagnosis.effects.friction_law_places import thresholds
from tendonfmu.diagnosis.extension_fit import added_paths
from tendonfmu.diagnosis.result import ChangedSize, FoundPlace
from tendonfmu.diagnosis.size import NBSP, quantity, size_of
from tendonfmu.model import native
from tendonfmu.statistics import Interval

TWO_SIDED = 1.96
LEAST_OF_NOW = 0.05  # of the present value: a change from a smaller number is not reported as a share of it
_OTHER_SIDE = {"positive": "negative", "negative": "positive"}


@dataclass(frozen=True)
class Sized:
    """The size of a change."""

    places: tuple[FoundPlace, ...]  # values now and units of all numbers that changed, by place
    size: ChangedSize  # of the main number
    words: str  # the size in plain words


def sized(search: ChangeSearch, changes: Sequence[Change], number: int) -> Sized:
    """Return the size of one of the changes, estimated together with all others."""
    now = search.now_data(changes)
    units = {parameter.path: parameter.unit for parameter in native.Instance.from_description(now).parameters()}
    if changes[number].hypothesis.members:
        return _new_term(search, changes, number, now, units)
    then = search.now_data([change for k, change in enumerate(changes) if k != number])
    return _other_number(search, changes[number], then, now, units)


def _relative_error(change: Change) -> float:
    """Return the standard error of the whole change over its size, along the direction in which it was found."""
    value = float(np.linalg.norm(change.magnitudes))
    direction = change.magnitudes / max(value, 1e-300)
    return math.sqrt(max(float(direction @ change.covariance @ direction), 0.0)) / max(value, 1e-300)


def _interval(value: float, error: float) -> Interval:
    return Interval(value, value - TWO_SIDED * error, value + TWO_SIDED * error)


# --- a term that the description lacks --------------------------------------------------------------------------------


def _new_term(
    search: ChangeSearch, changes: Sequence[Change], number: int, now: Data, units: Mapping[str, str]
) -> Sized:
    change = changes[number]
    first = len(search.accepted(changes[:number]))
    own = search.accepted([change])
    paths = added_paths(changed(search.data, search.added(changes)), search.accepted(changes))[first:]
    places = [
        FoundPlace(
            each.place.joint,
            each.place.tendon,
            {path: (data_number(now, path), units[path]) for path in of if path in units},
        )
        for each, of in zip(own, paths, strict=False)
    ]
    main = _main([path for place in places for path in place.parameters], now, change)
    unit = units.get(main[0], "1") if main else "1"
    value = math.hypot(*(data_number(now, path) for path in main)) if len(main) > 1 else data_number(now, main[0])
    nothing = Interval(0.0, 0.0, 0.0)
    size = _interval(value, abs(value) * _relative_error(change))
    name = "amplitude" if len(main) > 1 else main[0].rsplit(".", 1)[-1]
    words = f"{size_of(change.hypothesis.effect, places, thresholds(now))}, beyond what the reference has"
    return Sized(tuple(places), ChangedSize(name, unit, nothing, size, size), words)


_FORM = ("stribeck_velocity", "beyond", "turns", "time_constant", "reaction", "rest_angle", "displacement")


def _main(paths: Sequence[str], now: Data, change: Change) -> list[str]:
    """Return the paths that say how large the term is."""
    waves = [path for path in paths if path.rsplit(".", 1)[-1] in ("sine", "cosine")]
    if waves:
        return waves[:2]
    sizes = [path for path in paths if path.rsplit(".", 1)[-1] not in _FORM] or list(paths)
    return [max(sizes, key=lambda path: abs(data_number(now, path)))]


# --- a number that the description has --------------------------------------------------------------------------------


def _other_number(search: ChangeSearch, change: Change, then: Data, now: Data, units: Mapping[str, str]) -> Sized:
    """Return the size of a changed number; `then` is the description of now without this change."""
    first = change.hypothesis.mix.shape[0] - len(search.numbers)
    moved = np.flatnonzero(change.hypothesis.mix[first:].any(axis=1))
    by_place: dict[tuple[int | None, int | None], dict[str, tuple[float, str]]] = {}
    for k in moved:
        number = search.numbers[k]
        own = by_place.setdefault((number.place.joint, number.place.tendon), {})
        own[number.path] = (data_number(now, number.path), units[number.path])
    places = tuple(FoundPlace(*place, numbers) for place, numbers in by_place.items())
    paths = [path for place in places for path in place.parameters]
    main = max(paths, key=lambda path: abs(data_number(now, path) - data_number(then, path)))
    before, after = data_number(then, main), data_number(now, main)
    name, unit = main.rsplit(".", 1)[-1], units[main]
    if change.hypothesis.effect == "asymmetric_friction":
        before, after = _difference(then, main), _difference(now, main)
        name = f"{name}, positive less negative"
    error = abs(after - before) * _relative_error(change)
    has_share = abs(before) >= LEAST_OF_NOW * abs(after) and change.hypothesis.effect != "asymmetric_friction"
    share = (after - before) / before if has_share and before else math.nan
    size = ChangedSize(name, unit, _interval(before, 0.0), _interval(after, error), _interval(after - before, error))
    more = f"{100 * share:+.0f}{NBSP}%: ".replace("-", "−") if math.isfinite(share) else ""
    where = f", at the largest of {len(places)} places" if len(places) > 1 else ""
    return Sized(places, size, f"{more}{quantity(before, unit)} then, {quantity(after, unit)} now{where}")


def _difference(data: Data, path: str) -> float:
    """Return the difference between the two sides of a law in a number, positive less negative."""
    for side, other in _OTHER_SIDE.items():
        if f".{side}." in path:
            sign = 1.0 if side == "positive" else -1.0
            return sign * (data_number(data, path) - data_number(data, path.replace(f".{side}.", f".{other}.")))
    return data_number(data, path)
