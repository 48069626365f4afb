"""How a text log is written, found in its first lines: separator, decimal mark, line of names, units, first row.

A line is a row if the columns that hold numbers in most of the lines hold some in it too, so names are taken only from
a line above rows. A cell may have its unit, brackets, a Fortran exponent, or a missing number as C libraries print it.
"""

from __future__ import annotations

import csv
import functools
import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tendonfmu.errors import InputError
from tendonfmu.files import counted
from tendonfmu.recordings.converters.column_map import GROUP_MARKS, SEPARATORS, LogFormat
from tendonfmu.recordings.converters.units import quantity

COMMENTS = ("#", "%", "//")
FLAGS = {"true": 1.0, "false": 0.0}
MISSING = ("", "nan", "na", "n/a", "null", "none", "#n/a", "-nan", "<na>", "nat", "-", "--", "---")  # in lower case
END_OF_HEADER = "***End_of_Header***"  # of LabVIEW
LAST = 50  # lines of the sample in which the columns of numbers are found

_NO_NUMBER = re.compile(r"[+-]?(1\.#(ind|qnan|snan|nan)\d*|nan\(.*\))")
_NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[ed]([+-]?\d+))?(?![\d.])", re.IGNORECASE)
_DATE = r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}"
_HOUR = r"\d{1,2}:\d{2}(:\d{2})?([.,]\d+)? ?([AaPp]\.?[Mm]\.?)?"
_MOMENT = re.compile(rf"{_DATE}|{_HOUR}|{_DATE}[T ]+{_HOUR}.*")


# a time that a terminal writes before each line: [2026-01-05 10:30:25.123] or 10:30:25.123 ->
_STAMP = re.compile(rf"^\[?(?:({_DATE})[T ]+)?(\d{{1,2}}:\d\d:\d\d(?:[.,:]\d+)?)(?:\]| ->)[ \t]*(?=\S)", re.MULTILINE)


def stamp_separator(lines: Sequence[str]) -> str | None:
    """Return the separator of lines before which a terminal has written a time, or None."""
    stamped = [line[match.end() :] for line in lines[-LAST:] if (match := _STAMP.match(line))]
    if 2 * len(stamped) <= len(lines[-LAST:]):
        return None
    return next((mark for mark in SEPARATORS if mark in stamped[-1]), " ")


def with_column_of_stamps(text: str, separator: str) -> str:
    """Return lines whose times are a column."""
    return _STAMP.sub(lambda match: f"{f'{match[1]}T' if match[1] else ''}{match[2]}{separator}", text)


@dataclass(frozen=True)
class Layout:
    """How a text log is written."""

    separator: str  # a space stands for any number of them
    decimal: str  # "." or ","
    thousands: str  # mark between groups of three digits, or ""
    start: int  # number of lines before the first row
    names: list[str]  # of the columns; "1", "2", ... if the log has none
    units: list[str]  # of the columns, if the log states them in a row or in the cells; otherwise empty
    skip: int  # number of lines before the line of names
    header: bool  # whether there is a line of names
    has_units_row: bool  # whether a row of units follows the names
    width: int  # fields of a row; more than the names if rows end in a separator


# --- cells ------------------------------------------------------------------------------------------------------------


def fields_of(line: str, separator: str) -> list[str]:
    """Return the cells of a line."""
    if separator == " ":
        return line.split()
    fields = line.split(separator) if '"' not in line else next(csv.reader([line], delimiter=separator))
    return [field.strip() for field in fields]


def number_of(text: str, decimal: str, thousands: str = "") -> tuple[float, str] | None:
    """Return the number in a cell and its unit, NaN for a missing one, or None if there is none."""
    plain = text.strip()
    if plain[:1] == "(" and plain[-1:] == ")":  # of accountants: a negative number
        return None
    plain = plain.strip("[](){}").strip()
    lower = plain.lower()
    if lower in FLAGS:
        return FLAGS[lower], ""
    if lower in MISSING or _NO_NUMBER.fullmatch(lower):
        return math.nan, ""
    if thousands and _is_grouped(plain, decimal, thousands):
        plain = plain.replace(thousands, "")
    if decimal == ",":
        plain = plain.replace(".", "\0").replace(",", ".")
    match = _NUMBER.match(plain)
    unit = plain[match.end() :].strip() if match else ""
    if match is None or (unit and _quantity(unit) is None):
        return None
    return float(f"{match[1]}e{match[2] or 0}"), unit


_quantity = functools.cache(quantity)


def _is_grouped(text: str, decimal: str, thousands: str) -> bool:
    number = rf"[+-]?\d{{1,3}}({re.escape(thousands)}\d{{3}})+({re.escape(decimal)}\d*)?"
    return re.fullmatch(number, text) is not None


def is_value(text: str, decimal: str, thousands: str = "") -> bool:
    """Return whether a cell holds a number, a date or a time of day, or stands for a missing number."""
    return number_of(text, decimal, thousands) is not None or _MOMENT.fullmatch(text.strip()) is not None


def is_missing(text: str) -> bool:
    """Return whether a cell stands for a missing number."""
    plain = text.strip().lower()
    return plain in MISSING or _NO_NUMBER.fullmatch(plain) is not None


def is_comment(line: str) -> bool:
    """Return whether a line is a comment."""
    return line.lstrip().startswith(COMMENTS)


def _uncommented(line: str) -> str:
    stripped = line.strip()
    mark = next((mark for mark in COMMENTS if stripped.startswith(mark)), "")
    return stripped.removeprefix(mark).strip() if mark else line


# --- lines ------------------------------------------------------------------------------------------------------------


def find_layout(file: Path, lines: list[str], log: LogFormat) -> Layout:
    """Return how a log is written. Raise InputError if no column has numbers, or names and rows do not fit."""
    return _Lines(file, lines, log).layout()


class _Lines:
    """The first lines of a log."""

    def __init__(self, file: Path, lines: list[str], log: LogFormat) -> None:
        self.file, self.log = file, log
        ends = [k for k, line in enumerate(lines) if line.startswith(END_OF_HEADER)][:2]  # of the file, and of channels
        self.given = log.skip if log.skip is not None else ends[-1] + 1 if ends else 0
        # their numbers, and those that are not empty
        self.content = [(k, line) for k, line in enumerate(lines) if k >= self.given and line.strip()]
        if not self.content:
            raise InputError(f"{file}: no line after the {self.given} that the map skips; expected a line of names")
        plain = [line for _, line in self.content if not is_comment(line)] or [line for _, line in self.content]
        self.separator = log.separator or _separator(plain, log.decimal)
        # the cells of those that are no comments
        self.rows = [(k, fields_of(line, self.separator)) for k, line in self.content if not is_comment(line)]
        last = [row for _, row in self.rows[-LAST:]]
        self.decimal = log.decimal or _decimal(last)
        self.thousands = log.thousands if log.thousands is not None else _thousands(last, self.decimal)
        # units of the channels in the header of LabVIEW
        of_channels = (line for line in lines if line.startswith("Y_Unit_Label"))
        self.labels = next((fields_of(line, self.separator)[1:] for line in of_channels), [])
        self.width = Counter(map(len, last)).most_common(1)[0][0] if last else 0
        self.even = [row for row in last if len(row) == self.width]
        # columns with numbers in most of the last lines
        counts = [sum(self.is_number(row[k]) for row in self.even) for k in range(self.width)]
        self.numeric = [k for k, count in enumerate(counts) if count and 2 * count >= max(counts)]

    def is_number(self, cell: str) -> bool:
        return not is_missing(cell) and is_value(cell, self.decimal, self.thousands)

    def is_row(self, row: Sequence[str]) -> bool:
        """Return whether all columns of numbers hold some, or stand for missing ones."""
        cells = [row[k] for k in self.numeric] if len(row) == self.width else []
        return any(map(self.is_number, cells)) and all(is_value(cell, self.decimal, self.thousands) for cell in cells)

    def layout(self) -> Layout:
        first = next((k for k, row in self.rows if self.is_row(row)), None)
        if first is None and not self.numeric:
            self.refuse_texts()
        at = None if self.log.header is False else self.names_at(first)
        units: list[str] = []
        has_units = False
        if at is None:
            self.refuse_other_names(first or 0)
            start = first if first is not None and self.log.skip is None else (self.rows or self.content)[0][0]
            names, number = [str(i) for i in range(1, self.width + 1)], start if self.log.skip is None else self.given
        else:
            number, line = self.content[at]
            names = self.fitted(fields_of(_uncommented(line), self.separator))
            below = [(k, row) for k, row in self.rows if k > number]
            names = self.with_levels(names, self.content[:at], below[0][1] if below else [])
            if below:
                is_units = self.is_units(below[0][1], len(names))
                has_units = is_units if self.log.units_row is None else self.log.units_row
            if has_units:
                units = [unit.strip(" []()") for unit in below.pop(0)[1]]
            # a line with numbers is a row, if a faulty one: it is refused, not passed over
            after = self.content[-1][0] + 1
            start = next((k for k, row in below if any(map(self.is_number, row))), after)
        units = units or self.stated_units(names)
        marks = self.separator, self.decimal, self.thousands
        return Layout(*marks, start, names, units, number, at is not None, has_units, max(self.width, len(names)))

    def has_some(self, row: Sequence[str]) -> bool:
        return any(self.is_number(row[k]) for k in self.numeric)

    def stated_units(self, names: list[str]) -> list[str]:
        """Return the units in the header of LabVIEW or in the cells; none if there are none."""
        cells = [next((row[k] for row in self.even if not is_missing(row[k])), "") for k in range(self.width)]
        numbers = [number_of(cell, self.decimal, self.thousands) for cell in cells]
        labels = iter(self.labels)
        units = [number[1] if number else "" for number in numbers]
        if self.labels:
            units = ["s" if name == "X_Value" else next(labels, "") for name in names]
        return (units + [""] * len(names))[: len(names)] if any(units) else []

    def fitted(self, names: list[str]) -> list[str]:
        """Return a name for each column: rows may end in a separator, or begin with a number that has no name."""
        if len(names) == self.width - 1:
            if all(not row[-1] for row in self.even):
                return [*names, ""]
            if all(row[0].strip('"').isdigit() for row in self.even):
                return ["", *names]
            if all(_MOMENT.fullmatch(row[0]) for row in self.even):
                return ["time", *names]
        return names

    def with_levels(self, names: list[str], above: Sequence[tuple[int, str]], below: list[str]) -> list[str]:
        """Join the lines of names of columns with several levels, as pandas writes them, or cells that are merged."""
        next_names = [] if len(below) != len(names) or any(map(self.is_number, below)) else below
        lines = [fields_of(_uncommented(line), self.separator) for _, line in reversed(above)]
        if next_names and not all(names[1:]) and all(next_names[1:]) and not self.is_units(next_names, len(names)):
            lines, names, next_names = [names, *lines], next_names, []
        for upper in lines:
            given = [name for name in names if name]
            if len(set(given)) == len(given) or len(upper) != len(names) or any(map(self.is_number, upper)):
                break
            for k in range(2, len(upper)):
                upper[k] = upper[k] or upper[k - 1]
            names = [".".join(filter(None, levels)) for levels in zip(upper, names, strict=True)]
            names = [name or own for name, own in zip(names, next_names or names, strict=True)]
        return names

    def names_at(self, first: int | None) -> int | None:
        """Return the index in `content` of the line of names, or None: the one above the rows with most names."""
        if self.log.skip is not None:
            return 0 if self.log.header or not self.has_number(self.content[0][1]) else None
        top = fields_of(self.content[0][1], self.separator)
        if len(top) > 2 and top in (list(map(str, range(self.width))), list(map(str, range(1, self.width + 1)))):
            return 0  # columns that pandas or Excel has numbered
        before = [line for k, line in self.content if first is None or k < first]
        best, most = None, 0
        for at, line in reversed(list(enumerate(before))):
            fields = fields_of(_uncommented(line), self.separator)
            is_wide = len(fields) == self.width or len(self.fitted(fields)) == self.width
            cells = fields_of(line, self.separator)
            is_row = len(cells) == self.width and self.has_some(cells)
            if not is_wide or is_row or self.is_units(cells, self.width):
                continue
            different = len({field for field in fields if field})
            if best is not None and (different < most or best - at > 3):
                break
            if different > most or best is None:
                best, most = at, different
        return 0 if best is None and self.log.header else best

    def has_number(self, line: str) -> bool:
        return any(map(self.is_number, fields_of(line, self.separator)))

    def is_units(self, fields: list[str], width: int) -> bool:
        """Return whether fields are a row of units: brackets, names of units, or nothing."""
        filled = [field for field in fields if field.strip()]
        if len(fields) != width or not filled or any(map(self.is_number, fields)):
            return False
        known = [re.fullmatch(r"[\[(].*[\])]|-", field) or quantity(field) for field in filled]
        return sum(map(bool, known)) * 2 > len(filled)

    def refuse_other_names(self, first: int) -> None:
        """Raise InputError if the line above the rows has half as many names as they have fields."""
        names = next((row for k, row in reversed(self.rows) if k < first), [])
        if self.separator == "," and len(names) > 1 and len(names) * 2 == self.width:
            given = f"{len(names)} names and {self.width} fields in a row between commas, as of decimal commas"
            raise InputError(f"{self.file}: {given}; write ; between the fields, or decimal points")

    def refuse_texts(self) -> None:
        """Raise InputError: no column has numbers."""
        line = self.content[-1][1]
        pairs = re.findall(r"([A-Za-z_][\w.]*)['\"]?\s*[:=]\s*[-+]?\d", line)
        advice = 'set "separator", "decimal" or "skip" in "log" of the map'
        if len(pairs) > 1:
            advice = f"print the names ({', '.join(pairs[:3])}, ...) once, in the first line, and then the values alone"
        if line.strip().startswith('{"'):
            advice = "name a file with a JSON object in each line .jsonl"
        if len(self.content) == 1 and not pairs:
            return  # a line of names without rows
        lines = f"the first {counted(len(self.content), 'line')}, such as {line.strip()[:60]!r}"
        raise InputError(f"{self.file}: no column has numbers in {lines}; {advice}")


def _separator(lines: list[str], decimal: str | None) -> str:
    """Return the separator by which most lines have the same number of fields, and most of them numbers."""
    best, best_score = " ", (0.0, 0)
    for separator in SEPARATORS:
        rows = [fields_of(line, separator) for line in lines]
        counts = Counter(map(len, rows))
        width, most = max(counts.items(), key=lambda item: (item[1], item[0]))
        if width < 2 or (separator == decimal and '"' not in lines[-1]):
            continue
        cells = [cell for row in [row for row in rows if len(row) == width][-LAST:] for cell in row]
        decimals = (decimal,) if decimal else (".", ",")
        numbers = max(
            sum(is_value(cell, mark, other) for cell in cells)
            for mark in decimals
            for other in ("", "." if mark == "," else ",")
        )
        # a space counts only if no other separates: dates and names have spaces too
        score = (most / len(lines) - (0.5 if separator == " " else 0.0) + numbers / len(cells), width)
        if score > best_score:
            best, best_score = separator, score
    return best


def _decimal(rows: list[list[str]]) -> str:
    cells = [cell for row in rows for cell in row]
    commas, points = (
        sum(mark in cell and (number_of(cell, mark) is not None or _is_grouped(cell, mark, other)) for cell in cells)
        for mark, other in (",.", ".,")
    )
    return "," if commas > points else "."


def _thousands(rows: list[list[str]], decimal: str) -> str:
    """Return the mark between groups of digits, if a cell has it beside the decimal mark; "" otherwise."""
    cells = [cell for row in rows for cell in row if decimal in cell]
    marks = [mark for mark in GROUP_MARKS if mark != decimal]
    return next((mark for mark in marks if any(_is_grouped(cell, decimal, mark) for cell in cells)), "")
