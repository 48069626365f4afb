"""Which numbers of a description may have changed: each at its place, under the name of its effect."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.effects import Place
from tendonfmu.diagnosis.hypotheses import EVERYWHERE, HERE, SHARED, SOMEWHERE, Hypothesis
from tendonfmu.estimate import Estimator, Unknown, own_copy, set_number
from tendonfmu.model import law_path, native, steps_of

_OF_LAW = {"friction": "joint_friction", "load_friction": "joint_load_friction"}
_OF_NUMBER = {"viscous": "viscous_friction", "static": "stribeck", "stribeck_velocity": "stribeck"}


@dataclass(frozen=True)
class Number:
    """One unknown of a description's fit."""

    effect: str  # name of the effect
    place: Place
    side: int  # of its law: 1 or −1; 0 if both sides are one
    index: int  # among the unknowns
    path: str
    value: float  # start and bounds in the unit of the unknown
    low: float
    high: float


def estimator_of(data: Data) -> tuple[Estimator, list[str]]:
    """Return an estimator of all numbers that a fit estimates, and the paths of the description's parameters."""
    plain = {**data, "sensor_fault": None}
    image = native.image_from_json(json.dumps(plain))
    return Estimator(image), [parameter.path for parameter in native.Instance(image).parameters()]


def numbers_of(data: Data) -> list[Number]:
    """Return the numbers in the order of `derivative_passes.nominal_directions`."""
    estimator, _ = estimator_of(data)
    unknowns = [each for each in estimator.unknowns if not each.path.startswith("bias.")]
    return [_number(data, k, each) for k, each in enumerate(unknowns)]


def _number(data: Data, index: int, unknown: Unknown) -> Number:
    effect, place, side = _owner(data, unknown.path)
    return Number(effect, place, side, index, unknown.path, unknown.start, unknown.lower, unknown.upper)


def _owner(data: Data, path: str) -> tuple[str, Place, int]:
    """Return effect, place and side of a number."""
    law = law_path(path)
    if law is not None and law.number is not None:
        side = {"positive": 1, "negative": -1}.get(law.side or "", 0)
        effect = _OF_NUMBER.get(law.number) or _OF_LAW.get(law.kind, law.kind)
        return effect, Place(law.joint, law.tendon), side
    owner, index, *key = steps_of(path)
    if owner == "joints" and key == ["cover", "stiffness"]:
        return "cover_stiffness", Place(int(index) + 1), 0
    if owner == "extensions" and len(key) == 1:
        row = data["extensions"][index]
        return row["effect"], Place(row.get("joint"), row.get("tendon")), 0
    return path, Place(), 0


# --- hypotheses -------------------------------------------------------------------------------------------------------


def number_hypotheses(numbers: Sequence[Number], count: int, first: int) -> list[Hypothesis]:
    """Return each effect at each place, of one joint or tendon, and everywhere; the coarse ones first."""
    by_place: dict[tuple[str, Place], list[Number]] = {}
    for number in numbers:
        by_place.setdefault((number.effect, number.place), []).append(number)
    found = []
    for (effect, place), own in by_place.items():
        level = EVERYWHERE if place == Place() else HERE
        if any(each.side for each in own):
            found += list(_two_sided(effect, place, own, count, first, level))
        else:
            found.append(_free(effect, place, own, count, first, level))
    for effect in SHARED:
        places = {place: own for (name, place), own in by_place.items() if name == effect}
        found += list(_groups(effect, places, count, first))
    return sorted(found, key=lambda each: each.level)


def _free(effect: str, place: Place, own: Sequence[Number], count: int, first: int, level: int) -> Hypothesis:
    """Return a hypothesis in which each number is free: of working points, or of a term with several numbers."""
    mix = np.zeros((count, len(own)))
    for k, each in enumerate(own):
        mix[first + each.index, k] = 1.0
    low, high = _bounds(own)
    return Hypothesis(effect, place.joint, place.tendon, level, (), mix, low, high)


def _bounds(own: Sequence[Number]) -> tuple[Numbers, Numbers]:
    """Return the bounds of what may be added [d]."""
    value = np.array([each.value for each in own])
    low, high = np.array([each.low for each in own]), np.array([each.high for each in own])
    return low - value, high - value


def _two_sided(
    effect: str, place: Place, own: Sequence[Number], count: int, first: int, level: int
) -> Iterator[Hypothesis]:
    yield _scaled(effect, place, own, count, first, level)
    if effect not in ("stribeck",):
        sides = [[each for each in own if each.side == side] for side in (1, -1)]
        mix = np.zeros((count, 1))
        for side, members in zip((1.0, -1.0), sides, strict=True):
            for each in members:
                mix[first + each.index, 0] = side
        most = min(each.value - each.low for each in own)
        yield Hypothesis(
            "asymmetric_friction", place.joint, place.tendon, level, (), mix, np.array([-most]), np.array([most])
        )


def _scaled(effect: str, place: Place, own: Sequence[Number], count: int, first: int, level: int) -> Hypothesis:
    """Return a hypothesis in which all numbers change by the same share."""
    mix = np.zeros((count, 1))
    size = np.array([abs(each.value) for each in own])
    size = np.where(size > 0.0, size, size.max(initial=0.0) or 1.0)
    for each, share in zip(own, size, strict=True):
        mix[first + each.index, 0] = share
    low = max(float((each.low - each.value) / share) for each, share in zip(own, size, strict=True))
    high = min(float((each.high - each.value) / share) for each, share in zip(own, size, strict=True))
    return Hypothesis(effect, place.joint, place.tendon, level, (), mix, np.array([low]), np.array([high]))


def _groups(effect: str, places: Mapping[Place, Sequence[Number]], count: int, first: int) -> Iterator[Hypothesis]:
    """Yield hypotheses of all places, and of the places of each joint and tendon if these are several but not all."""
    if len(places) < 2:
        return
    groups: dict[tuple[int | None, int | None], list[Place]] = {(None, None): list(places)}
    for place in places:
        if place.joint is not None:
            groups.setdefault((place.joint, None), []).append(place)
        if place.tendon is not None:
            groups.setdefault((None, place.tendon), []).append(place)
    for (joint, tendon), members in groups.items():
        whole = (joint, tendon) == (None, None)
        if len(members) < 2 or (not whole and len(members) == len(places)):
            continue
        own = [each for place in members for each in places[place]]
        yield _scaled(effect, Place(joint, tendon), own, count, first, EVERYWHERE if whole else SOMEWHERE)


# --- a description with changed numbers ------------------------------------------------------------------------------


def changed(data: Data, added: Numbers) -> dict[str, Any]:
    """Return the description with `added` [u] added to its unknowns, within their bounds."""
    estimator, paths = estimator_of(data)
    z = estimator.start.copy()
    rows = [k for k, each in enumerate(estimator.unknowns) if not each.path.startswith("bias.")]
    z[rows] += added
    low, high = (np.array([getattr(each, end) for each in estimator.unknowns]) for end in ("lower", "upper"))
    z = np.clip(z, low, high)
    before, after = estimator.values(estimator.start), estimator.values(z)
    result = own_copy(data)
    for path, one, other in zip(paths, before, after, strict=True):
        if one != other:
            set_number(result, path, float(other))
    return result
