"""Which index each tendon and joint of a log gets: by the numbers in the names, otherwise in the log's order."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from tendonfmu.recordings.converters import units
from tendonfmu.recordings.converters.unit_guess import GUESS, LIKELY

T = TypeVar("T")


@dataclass(frozen=True)
class Order:
    """How the elements of a finger are numbered."""

    of: str  # "tendons" or "joints"
    sure: str  # LIKELY by numbers in the names, GUESS by the order of the log
    elements: tuple[tuple[str, ...], ...]  # the log's names of each element, from index 1 on

    def line(self) -> str:
        """Return the order in one line, and what to do about it."""
        how = "as in the log" if self.sure == GUESS else "by the numbers in their names"
        listed = ", ".join(f"{k} = {' and '.join(names)}" for k, names in enumerate(self.elements, start=1))
        doubt = "a guess" if self.sure == GUESS else "likely"
        return f"order of {self.of} {how}, {doubt}; check it against the finger: {listed}"


def numbers_of(name: str) -> tuple[int, ...]:
    """Return the numbers in a name; those of a unit in brackets do not count."""
    return tuple(int(part) for part in re.findall(r"\d+", _without_unit(name)))


def in_order(members: Sequence[T], name_of: Callable[[T], str]) -> tuple[list[T], bool]:
    """Return members by the numbers in their names, and True; or in their own order, and False."""
    numbers = [numbers_of(name_of(each)) for each in members]
    if all(numbers) and len(set(numbers)) == len(numbers):
        return sorted(members, key=lambda each: numbers_of(name_of(each))), True
    return list(members), False


def matched(names: Sequence[str], others: Sequence[str]) -> list[int] | None:
    """Return for each of some names the index of the name of the same element: `x_flex` belongs to `F_flex`."""
    for marks in (_parts, _stems):
        wanted, given = marks(names), marks(others)
        found = []
        for mark in given:
            fits = [k for k, each in enumerate(wanted) if each and not each - mark]
            # part 1 of `finger1_F1` is in each name; the element with the most parts in common is meant
            most = max((sum(wanted[k].values()) for k in fits), default=0)
            best = [k for k in fits if sum(wanted[k].values()) == most]
            if len(best) != 1:
                break
            found.append(best[0])
        if len(found) == len(others) and len(set(found)) == len(found):
            return found
    return None


def _parts(names: Sequence[str]) -> list[Counter[str]]:
    """Return the words and numbers of each name that not all names have."""
    parts = [Counter(re.findall(r"\d+|[a-z]+", _without_unit(name).lower())) for name in names]
    common = parts[0] if len(parts) > 1 else Counter()
    for each in parts[1:]:
        common = common & each
    return [each - common for each in parts]


def _stems(names: Sequence[str]) -> list[Counter[str]]:
    """Return what is left of each name without the beginning and end that all names have: `Fflex` is `flex`."""
    texts = [_without_unit(name).lower().strip() for name in names]
    if len(texts) < 2:
        return [Counter() for _ in texts]
    first = _length_of_beginning(texts)
    last = _length_of_beginning([text[first:][::-1] for text in texts])
    return [Counter([text[first : len(text) - last]]) for text in texts]


def _length_of_beginning(texts: Sequence[str]) -> int:
    least = min(len(text) for text in texts)
    return next((k for k in range(least) if len({text[k] for text in texts}) > 1), least)


def _without_unit(name: str) -> str:
    def kept(match: re.Match[str]) -> Any:
        return " " if units.quantity(match[1].strip()) else match[0]

    return re.sub(r"[\[(]([^\])]+)[\])]", kept, name)


def order_of(of: str, by_number: bool, groups: Sequence[Sequence[str]]) -> Order:
    """Return the order of elements."""
    longest = max((len(names) for names in groups), default=0)
    elements = tuple(tuple(names[k] for names in groups if k < len(names) and names[k]) for k in range(longest))
    return Order(of, LIKELY if by_number else GUESS, elements)
