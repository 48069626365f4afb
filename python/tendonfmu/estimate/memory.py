"""Friction with a memory in a description: `presliding` and `cord_stretch`, their numbers, and where a fit starts.

docs/reference/semantics/presliding.md has the element. Its numbers may be wrong by orders of magnitude, and the sum of
squares has several minima in them, so they are fitted on a logarithmic scale and from several starts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any

from tendonfmu.arrays import Data
from tendonfmu.model import extension_rows, get_number, own_copy, steps_of

PRESLIDING, CORDS = "presliding", "cord_stretch"
CHOSEN = FOLLOWS, FILTERED = "follows_limit", "filtered_travel"  # numbers of presliding that no fit moves
TIMES = (1.0, 0.005)  # s, of a relaxation: cables creep for seconds, contacts of a soft constraint for milliseconds
APART = 10.0  # ratio of the distances, or stiffnesses, that a fit starts from
STRETCH = 2e4, 2e5  # N/m, cords to start from: 20 N stretch them by 1 mm, or by 0.1 mm


def memory_rows(data: Data) -> list[tuple[int, Mapping[str, Any]]]:
    """Return the rows of friction with a memory, with their index in `extensions` from 1."""
    return [(k, row) for k, row in enumerate(extension_rows(data), start=1) if row["effect"] in (PRESLIDING, CORDS)]


def has_memory(data: Data) -> bool:
    """Return whether any friction of a description remembers."""
    return any(row["effect"] == PRESLIDING for _, row in memory_rows(data))


def memory_paths(data: Data) -> list[str]:
    """Return the paths of the numbers of the memory that are present."""
    keys = ("displacement", "stiffness", "relaxation_time", "share")
    return [f"extensions[{k}].{key}" for k, row in memory_rows(data) for key in keys if row.get(key) is not None]


def without_memory(data: Data) -> dict[str, Any]:
    """Return the description with the friction of the paper."""
    kept = [row for row in extension_rows(data) if row["effect"] not in (PRESLIDING, CORDS)]
    return {**data, "extensions": kept}


def with_rows(data: Data, *rows: Mapping[str, Any]) -> dict[str, Any]:
    """Return the description with these rows of memory in place of its own."""
    bare = without_memory(data)
    return {**bare, "extensions": [*bare["extensions"], *map(dict, rows)]}


def without_time(data: Data, path: str) -> dict[str, Any]:
    """Return the description without one relaxation time, by its path, or without the stretch of cords."""
    bare = own_copy(data)
    _, index, key = steps_of(path)
    if _is_cord(data, path):
        del bare["extensions"][index]
    else:
        del bare["extensions"][index][key]
    return bare


def starts(data: Data) -> Iterator[dict[str, float]]:
    """Yield numbers of the memory by path to start a fit from, the given ones first."""
    given = memory_values(data)
    yield given
    lengths = [path for path in given if path.endswith((".displacement", ".stiffness")) and not _is_cord(data, path)]
    times = [path for path in given if path.endswith(".relaxation_time")]
    cords = [path for path in given if _is_cord(data, path)]
    # relaxation within milliseconds goes with a short distance: only their ratio shows
    near_and_far = [(APART**-0.5, TIMES[1]), (APART**0.5, TIMES[0])]
    for (factor, time), cord in product(near_and_far, STRETCH if cords else (None,)):
        start = dict(given)
        start |= {path: factor * given[path] for path in lengths}
        start |= dict.fromkeys(times, time)
        start |= {} if cord is None else dict.fromkeys(cords, cord)
        if start != given:
            yield start


def memory_values(data: Data) -> dict[str, float]:
    """Return the numbers of the memory by path."""
    return {path: float(get_number(data, path)) for path in memory_paths(data)}


def optional_paths(data: Data) -> list[str]:
    """Return the paths of the numbers that the memory can be without: relaxation times, and the stiffness of cords."""
    return [path for path in memory_paths(data) if path.endswith(".relaxation_time") or _is_cord(data, path)]


def _is_cord(data: Data, path: str) -> bool:
    return bool(get_number(data, path.rpartition(".")[0])["effect"] == CORDS)
