"""How a text log is written: encoding, separator, decimal mark, lines of comments, names and units.

What the map does not say is found in the first lines.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.column_map import SEPARATORS, LogFormat
from tendonfmu.recordings.converters.units import quantity

COMMENTS = ("#", "%", "//")
SAMPLE = 200  # lines
FLAGS = {"true": 1.0, "false": 0.0}
MISSING = ("", "nan", "na", "n/a", "null", "none", "#n/a", "-nan")  # texts of no number, in lower case

_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?")
_DATE = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ]\d{1,2}:\d{2}.*")
_BOMS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


@dataclass(frozen=True)
class Layout:
    """How a text log is written."""

    separator: str  # A space stands for any number of them
    decimal: str  # "." or ","
    start: int  # number of lines before the first row
    names: list[str]  # of the columns; "1", "2", ... if the log has none
    units: list[str]  # of the columns, if the log has a row of them; otherwise empty
    skip: int  # number of lines before the line of names
    header: bool  # whether there is a line of names


def find_encoding(file: Path, begin: bytes, wanted: str | None) -> tuple[str, str]:
    """Return the encoding of a text that begins with some bytes, and a note if it is a guess."""
    for mark, name in _BOMS:
        if begin.startswith(mark):
            return name, ""
    if wanted is not None:
        return wanted, ""
    even, odd = begin[:400:2].count(0), begin[1:400:2].count(0)
    if max(even, odd) > 50 or (len(begin) > 20 and max(even, odd) * 3 > len(begin[:400]) // 2):
        return ("utf-16-be" if even > odd else "utf-16-le"), ""
    if b"\0" in begin[:400]:
        raise InputError(f"{file}: not a text file; expected CSV")
    decoder = codecs.getincrementaldecoder("utf-8")()
    try:
        decoder.decode(begin)
    except UnicodeDecodeError:
        return "latin-1", f'{file}: not UTF-8; read as latin-1. If names look wrong, set "encoding" in "log" of the map'
    return "utf-8", ""


def find_layout(file: Path, lines: list[str], log: LogFormat) -> Layout:
    """Return how a log is written."""
    given = log.skip or 0
    content = [(k, line) for k, line in enumerate(lines) if k >= given and line.strip()]
    if not content:
        raise InputError(f"{file}: no line after the {given} that the map skips; expected a line of names")
    plain = [(k, line) for k, line in content if not line.lstrip().startswith(COMMENTS)] or content
    separator = log.separator or _separator([line for _, line in plain], log)
    decimal = log.decimal or _decimal([line for _, line in plain], separator)
    at = _names_at(content, plain, separator, decimal, log)
    if at is None:
        first = plain[0]
        count = len(fields_of(first[1], separator))
        return Layout(separator, decimal, first[0], [str(i) for i in range(1, count + 1)], [], given, False)
    number, line = content[at]
    names = fields_of(_uncommented(line), separator)
    follows = [entry for entry in content[at + 1 :] if not entry[1].lstrip().startswith(COMMENTS)]
    units: list[str] = []
    if follows and _is_units(fields_of(follows[0][1], separator), len(names), decimal, log):
        units, follows = [unit.strip(" []()") for unit in fields_of(follows[0][1], separator)], follows[1:]
    start = follows[0][0] if follows else len(lines)
    return Layout(separator, decimal, start, names, units, number, True)


def fields_of(line: str, separator: str) -> list[str]:
    """Return the fields of a line."""
    if separator == " ":
        return line.split()
    if '"' not in line:
        return [name.strip() for name in line.split(separator)]
    return [name.strip() for name in next(csv.reader([line], delimiter=separator))]


def is_number(text: str, decimal: str) -> bool:
    """Return whether a text is a number, a flag, a date, or stands for a missing number."""
    plain = text.strip()
    if not _NUMBER.fullmatch(plain):
        return plain.lower() in FLAGS or plain.lower() in MISSING or bool(_DATE.fullmatch(plain))
    return "." not in plain if decimal == "," else "," not in plain


def _uncommented(line: str) -> str:
    stripped = line.strip()
    mark = next((each for each in COMMENTS if stripped.startswith(each)), "")
    return stripped[len(mark) :].strip() if mark else line


def _separator(lines: list[str], log: LogFormat) -> str:
    """Return the separator by which most lines have the same number of fields, and most of them numbers."""
    best, score = " ", (0.0, 0.0, 0)
    for each in SEPARATORS:
        if each == log.decimal:
            continue
        counts = Counter(len(fields_of(line, each)) for line in lines)
        count, lot = max(counts.items(), key=lambda item: (item[1], item[0]))
        if count < 2:
            continue
        rows = [fields_of(line, each) for line in lines if len(fields_of(line, each)) == count]
        cells = [cell for row in rows[-50:] for cell in row]
        decimals = (log.decimal,) if log.decimal else ((".", ",") if each != "," else (".",))
        numbers = max(sum(is_number(cell, mark) for cell in cells) for mark in decimals) / len(cells)
        # a space counts only if no other separates: dates and names have spaces too
        this = (lot / len(lines) - (0.5 if each == " " else 0.0), numbers, count)
        if (this[0] + this[1], this[2]) > (score[0] + score[1], score[2]):
            best, score = each, this
    return best


def _decimal(lines: list[str], separator: str) -> str:
    if separator == ",":
        return "."
    cells = [cell for line in lines[-50:] for cell in fields_of(line, separator)]
    commas = sum(is_number(cell, ",") and "," in cell for cell in cells)
    return "," if commas > sum(is_number(cell, ".") and "." in cell for cell in cells) else "."


def _names_at(
    content: list[tuple[int, str]], plain: list[tuple[int, str]], separator: str, decimal: str, log: LogFormat
) -> int | None:
    """Return the index in `content` of the line of names, or None."""
    if log.header is False:
        return None
    if log.skip is not None:
        return 0 if log.header or not _is_row(fields_of(content[0][1], separator), decimal) else None
    rows = [len(fields_of(line, separator)) for _, line in plain[-50:]]
    width = Counter(rows).most_common(1)[0][0]
    first = next(
        (
            k
            for k, line in plain
            if len(fields_of(line, separator)) == width and _is_row(fields_of(line, separator), decimal)
        ),
        None,
    )
    # the last line before the first row that has a name for each column; a comment may hold the names
    before = [at for at, (k, _) in enumerate(content) if first is None or k < first]
    named = [
        at
        for at in before
        if len(fields_of(_uncommented(content[at][1]), separator)) == width
        and not _is_units(fields_of(content[at][1], separator), width, decimal, log)
    ]
    if named:
        return named[-1]
    return 0 if log.header or (before and not content[0][1].lstrip().startswith(COMMENTS)) else None


def _is_row(fields: list[str], decimal: str) -> bool:
    """Return whether fields are those of a row: at least one is a number, and no name is beside an empty field."""
    return any(field.strip() and field.strip().lower() not in MISSING and is_number(field, decimal) for field in fields)


def _is_units(fields: list[str], width: int, decimal: str, log: LogFormat) -> bool:
    """Return whether fields are a row of units: brackets, names of units, or nothing."""
    if log.units_row is not None:
        return log.units_row
    filled = [field for field in fields if field.strip()]
    if len(fields) != width or not filled or _is_row(fields, decimal):
        return False
    known = [bool(re.fullmatch(r"[\[(].*[\])]|-", each)) or quantity(each) is not None for each in filled]
    return sum(known) * 2 > len(filled)
