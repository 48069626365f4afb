"""Which numbers of a finger a fit estimates, and which of them share one value.

A pattern is a path of the description in which `*` stands for anything and `?` for one character; brackets are
literal. It matches a number, or a part of the description and thus all numbers in it: `tendons[*].edge_friction[2]`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Data, Numbers
from tendonfmu.errors import InputError, own_fault
from tendonfmu.estimate.memory import has_memory
from tendonfmu.model import (
    LAW_NUMBERS,
    Finger,
    Law,
    Number,
    effects,
    estimable_numbers,
    extension_rows,
    friction_numbers,
    law_path,
    laws,
    own_copy,
    set_number,
    sides,
)

FIXED = -1
DIGITS = 10  # of a fitted number: far finer than any standard error, and static friction stays above coulomb


# effects whose numbers scale the measured torque: the error of a fit would be least with no torque at all
SCALING = ("force_gain", "moment_arm", "moment_arm_variation", "pulley_eccentricity")


@dataclass(frozen=True)
class Structure:
    """What is fitted."""

    # what the fit starts from: laws expanded or merged, shared values made equal; with the given detector
    given: Finger
    numbers: list[Number]  # the estimated numbers in the order of `estimable_numbers`
    # [p] by parameter of the description in canonical order: −1 is fixed, equal numbers share one value
    group: NDArray[np.int32]
    scale: NDArray[np.float64]  # [p] expected magnitudes; NaN: that of the start

    @property
    def start(self) -> Finger:
        """The friction model that the fit starts from."""
        return self.given.model

    @cached_property
    def index(self) -> Mapping[str, int]:
        """Path -> index among the p parameters."""
        return {path: k for k, path in enumerate(self.start.numbers)}

    def values_of(self, finger: Finger) -> Numbers:
        """Return [p] the values of its parameters in another finger. Raises InputError."""
        numbers = finger.model.numbers
        if missing := [path for path in self.index if path not in numbers]:
            raise InputError(f"{finger.path}: no {missing[0]}; expected the structure of {self.start.path}")
        return np.array([numbers[path].start for path in self.index])

    @property
    def needs_runs(self) -> bool:
        """Whether the estimator lacks its derivatives: friction remembers, or numbers of extensions are estimated."""
        return has_memory(self.start.data) or any(number.extension for number in self.numbers)


@dataclass(frozen=True)
class Choice:
    """The options of a fit that shape its structure."""

    sides: str = "given"  # "given", "symmetric" or "asymmetric"
    only: Sequence[str] = ()  # patterns of the numbers to estimate, or not to estimate
    fix: Sequence[str] = ()
    share: Sequence[str] = ()  # "tendons", "pulleys" or patterns of the laws that share their values
    scale: Sequence[str] = ()  # "PATTERN=VALUE": expected magnitude in the unit of the description


def torque_scales(data: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the paths of the numbers that scale the measured torque, which motion alone does not tell."""
    return tuple(number.path for number in friction_numbers(data) if number.extension in SCALING)


def held_delay(data: Data) -> tuple[str, ...]:
    """Return the pattern of a described delay, for fits that leave it: friction that remembers imitates one."""
    return ("extensions[*].delay",) if any(row["effect"] == "time_delay" for row in extension_rows(data)) else ()


def build_structure(finger: Finger, choice: Choice) -> Structure:
    """Choose the numbers of a finger that a fit estimates; patterns may name tendons and joints."""
    only, fix, share, scale = (
        [finger.numbered(text) for text in texts] for texts in (choice.only, choice.fix, choice.share, choice.scale)
    )
    choice = Choice(choice.sides, only, fix, share, scale)
    finger = finger.with_data(with_sides(finger.data, choice.sides))
    numbers = estimable_numbers(finger.data)
    if not numbers:
        raise InputError(f"{finger.path}: nothing to estimate: no friction, cover or extension; expected at least one")
    chosen = _chosen(numbers, choice)
    owners = _owners(chosen, choice.share)
    finger = _with_equal_values(finger, chosen, owners)
    index = {path: k for k, path in enumerate(finger.model.numbers)}
    group = np.full(len(index), FIXED, dtype=np.int32)
    for number, owner in zip(chosen, owners, strict=True):
        group[[index[path] for path in number.paths]] = owner
    return Structure(finger, numbers_in(finger, chosen), group, _scales(index, chosen, choice.scale))


def numbers_in(finger: Finger, numbers: Sequence[Number]) -> list[Number]:
    """Return numbers with their values in another finger of the same structure."""
    by_path = {effect.path: effect for effect in effects(finger.data)}
    return [
        replace(number, value=finger.numbers[number.path].start, effect=number.effect and by_path[number.effect.path])
        for number in numbers
    ]


# --- the fitted description -------------------------------------------------------------------------------------------


def with_values(structure: Structure, values: Numbers) -> Finger:
    """Replace the estimated numbers in the description of the start. values: [p]."""
    index, known = structure.index, structure.given.numbers
    new = {path: float(f"{values[index[path]]:.{DIGITS}g}") for number in structure.numbers for path in number.paths}
    for number in structure.numbers:  # rounding must not take Fc above an Fs that is not rounded
        if number.key == "coulomb" and number.effect is not None:
            static = f"{number.path.rpartition('.')[0]}.static"
            new[number.path] = min(new[number.path], new.get(static, known[static].start))
    with own_fault("the fitted description"):  # a fit keeps within every bound
        return structure.given.replace(new)


# --- sides of laws ----------------------------------------------------------------------------------------------------


def with_sides(data: Mapping[str, Any], wanted: str) -> Mapping[str, Any]:
    """Return the description with every law "symmetric", "asymmetric", or as "given"."""
    if wanted == "given":
        return data
    change = _two_sides if wanted == "asymmetric" else _one_side
    result = own_copy(data)
    for path, _, law in list(laws(result)):
        set_number(result, path, change(law))
    return result


def _two_sides(law: Law) -> Law:
    return law if len(sides(law)) == 2 else {"positive": dict(law), "negative": dict(law)}


def _one_side(law: Law) -> Law:
    both = sides(law)
    if len(both) == 1:
        return law
    mean = {key: float(np.mean([side.get(key) or 0.0 for side in both])) for key in LAW_NUMBERS}
    return {key: value for key, value in mean.items() if key != "viscous" or value}


# --- patterns ---------------------------------------------------------------------------------------------------------


def matcher(pattern: str) -> re.Pattern[str]:
    """Compile a pattern. Group 1 of a match is what the pattern itself matches, group 2 the rest inside that part."""
    body = "".join({"*": ".*?", "?": "."}.get(letter, re.escape(letter)) for letter in pattern)
    return re.compile(rf"({body})((?:[.\[].*)?)")


def _select(numbers: Sequence[Number], patterns: Iterable[str], option: str) -> set[str]:
    """Return the paths of the numbers that match any pattern. Raises InputError if a pattern matches none."""
    selected: set[str] = set()
    for pattern in patterns:
        match = matcher(pattern).fullmatch
        hits = {number.path for number in numbers if any(map(match, number.paths))}
        if not hits:
            raise InputError(_no_match(option, pattern, numbers))
        selected |= hits
    return selected


def _no_match(option: str, pattern: str, numbers: Sequence[Number]) -> str:
    return (
        f"{option} {pattern}: matches none of the {len(numbers)} numbers that a fit of this finger estimates; "
        f"expected a path such as {numbers[0].path}, where * stands for anything"
    )


def _chosen(numbers: list[Number], choice: Choice) -> list[Number]:
    only = _select(numbers, choice.only, "--only") if choice.only else {number.path for number in numbers}
    fixed = _select(numbers, choice.fix, "--fix")
    chosen = [number for number in numbers if number.path in only - fixed]
    if not chosen:
        raise InputError("--only, --fix: no number is left to estimate; expected at least one")
    return chosen


def _scales(index: Mapping[str, int], chosen: Sequence[Number], given: Sequence[str]) -> NDArray[np.float64]:
    scale = np.full(len(index), np.nan)
    for text in given:
        pattern, _, number = text.rpartition("=")
        try:
            value = float(number)
        except ValueError:
            value = np.nan
        if not pattern or not 0 < value < np.inf:
            raise InputError(f"--scale {text}: expected PATTERN=VALUE with a value above 0, in the description's unit")
        hits = _select(chosen, [pattern], "--scale")
        scale[[index[path] for path in hits]] = value
    return scale


# --- sharing ----------------------------------------------------------------------------------------------------------


def _owners(numbers: Sequence[Number], share: Sequence[str]) -> list[int]:
    """Return [numbers] the group of each: its own index, or that of the first number that it shares a value with."""
    owners = list(range(len(numbers)))
    for key in _shared_keys(numbers, share):
        first: dict[str, int] = {}
        for k, name in enumerate(key):
            if name is None:
                continue
            other = owners[first.setdefault(name, k)]
            owners = [other if owner == owners[k] else owner for owner in owners]
    _check_alike(numbers, owners)
    return owners


def _shared_keys(numbers: Sequence[Number], share: Sequence[str]) -> Iterator[list[str | None]]:
    """Yield per option [numbers] a key, equal where values are shared and None where nothing is shared."""
    for asked in share:
        if asked == "tendons":  # the same place of every tendon
            keys = [_place(number, "tendon") for number in numbers]
        elif asked == "pulleys":  # all pulleys of a tendon
            keys = [_place(number, "joint", "pulley_friction") for number in numbers]
        else:
            match = matcher(asked).fullmatch
            matches = [match(number.path) for number in numbers]
            keys = [None if hit is None else _rest(n, hit[2]) for n, hit in zip(numbers, matches, strict=True)]
        if not any(keys):
            raise InputError(_no_match("--share", asked, numbers))
        yield keys


def _place(number: Number, left_out: str, only: str | None = None) -> str | None:
    """Name where along a tendon a number is, without its tendon or its joint; working points by their angle."""
    law = law_path(number.path)
    if law is None or law.tendon is None or law.kind != (only or law.kind):
        return None
    parts = {"tendon": law.tendon, "kind": law.kind, "joint": law.joint, "side": law.side, "number": law.number}
    return repr([*(part for name, part in parts.items() if name != left_out), law.point and _angle(number)])


def _rest(number: Number, rest: str) -> str:
    """Return the part after a match, working points by their angle; the magnitude if the match is the whole path."""
    return re.sub(r"\.laws\[\d+\]", f".laws@{_angle(number)}", rest) if rest else number.key


def _angle(number: Number) -> str:
    return repr(number.effect.angles[number.point]) if number.effect is not None and number.effect.angles else ""


def _check_alike(numbers: Sequence[Number], owners: Sequence[int]) -> None:
    """Check that shared numbers are of the same kind, and that all or none have a Stribeck effect."""
    for number, owner in zip(numbers, owners, strict=True):
        first = numbers[owner]
        if number.key != first.key:
            raise InputError(
                f"--share: {number.path} and {first.path} would share a value; expected numbers of the same kind"
            )
        if (number.with_path is None) != (first.with_path is None):
            having, lacking = (first, number) if first.with_path is None else (number, first)
            raise InputError(
                f"--share: {having.path} belongs to a law with a Stribeck effect, {lacking.path} to one without "
                "(static = coulomb); expected laws of the same structure"
            )


def _with_equal_values(finger: Finger, numbers: Sequence[Number], owners: Sequence[int]) -> Finger:
    """Start numbers that share a value from their mean."""
    values: dict[str, float] = {}
    for owner in set(owners):
        members = [number for number, own in zip(numbers, owners, strict=True) if own == owner]
        mean = float(np.mean([member.value for member in members]))
        values |= {path: mean for member in members for path in member.paths if len(members) > 1}
    return finger.replace(values) if values else finger
