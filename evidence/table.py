"""Tables of Markdown, their cells (numbers, shares and rates with 95 % intervals), and their places in the pages.

A page has `<!-- fit.paper: contact -->`, the table `contact` of that part, and `<!-- end -->`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from evidence.part import Figures
from tendonfmu.statistics.intervals import share

NOTHING = "–"  # in a cell without a case

Row = dict[str, Any]


def table(head: Sequence[str], rows: Iterable[Sequence[Any]], text_columns: int = 1) -> str:
    """A table whose first columns hold text, and all others numbers."""
    rule = ["---"] * text_columns + ["---:"] * (len(head) - text_columns)
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in (head, rule, *rows))


def of_cells(path: str, head: Sequence[str], text_columns: int = 1) -> Callable[[Figures], str]:
    """A table whose cells stand in the figures already, as a list of lines."""
    return lambda figures: table(head, at(figures, path), text_columns)


def at(figures: Figures, path: str) -> Any:
    """What the figures have at `jaw.left`; a number stands for an item of a list."""
    value: Any = figures
    for key in path.split("."):
        value = value[int(key)] if isinstance(value, list) else value[key]
    return value


# --- marked blocks of the pages ---------------------------------------------------------------------------------------

_BLOCK = re.compile(r"<!-- (?P<part>[\w.]+): (?P<name>[^>]+?) -->\n(?P<text>.*?)<!-- end -->", re.DOTALL)


def blocks(page: str) -> dict[tuple[str, str], str]:
    """The texts of a page's marked blocks, by part and name."""
    return {(match["part"], match["name"]): match["text"].strip() for match in _BLOCK.finditer(page)}


def with_blocks(page: str, part: str, texts: Mapping[str, str]) -> str:
    """The page with the part's blocks replaced."""

    def replaced(match: re.Match[str]) -> str:
        if match["part"] != part or match["name"] not in texts:
            return match[0]
        return f"<!-- {part}: {match['name']} -->\n\n{texts[match['name']]}\n\n<!-- end -->"

    return _BLOCK.sub(replaced, page)


# --- cells ------------------------------------------------------------------------------------------------------------


def number(value: float | None, form: str = ".2f", scale: float = 1.0) -> str:
    return NOTHING if value is None or math.isnan(value) else format(scale * value, form)


def percent(hits: Iterable[Any], form: str = ".0f") -> str:
    """Share of the cases in percent, with its interval."""
    answers = [bool(hit) for hit in hits]
    known = share(sum(answers), len(answers))
    value, *limits = (number(part, form, 100.0) for part in (known.value, known.low, known.high))
    return value if math.isnan(known.low) else f"{value} ({' to '.join(limits)})"


def count(hits: Iterable[Any]) -> str:
    """How many of the cases, as `3/5`."""
    answers = [bool(hit) for hit in hits]
    return f"{sum(answers)}/{len(answers)}" if answers else NOTHING


def median(values: Iterable[float | None], form: str = ".2f", scale: float = 1.0) -> str:
    """Median of the known values; NaN and None are left out."""
    known = np.array(list(values), dtype=float)
    known = known[~np.isnan(known)]
    return number(float(np.median(known)), form, scale) if len(known) else NOTHING


def rms(values: Any) -> float:
    """Root of the mean square; NaN without a value."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else math.nan


# --- rows -------------------------------------------------------------------------------------------------------------


def column(rows: Iterable[Row], key: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Numbers of a column; NaN where a row has none."""
    return np.array([row.get(key) for row in rows], dtype=float)


def values_of(rows: Iterable[Row], key: str) -> list[Any]:
    """The different values of a column, in the order of the rows."""
    return list(dict.fromkeys(row[key] for row in rows))


def where(rows: Iterable[Row], **wanted: Any) -> list[Row]:
    """The rows that have these values."""
    return [row for row in rows if all(row.get(key) == value for key, value in wanted.items())]


def by(rows: Sequence[Row], keys: Sequence[str], cells: Callable[[Sequence[Row]], Sequence[str]]) -> list[list[str]]:
    """Lines of a table: one for each combination of the keys' values that has rows, with the cells of those rows."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    return [[*map(_word, group), *cells(members)] for group, members in groups.items()]


def _word(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
