"""How text logs are read: CSV with any separator, decimal mark and encoding, also compressed by gzip.

What the map does not say of their layout is found in the first lines. They are read in blocks of some megabytes, so
that memory does not grow with the log. Arrow parses a block; where it refuses one, the block is read again field by
field, to name the row. A log that is cut off is read up to its last whole line. Rows count from 1, without the line of
names.
"""

from __future__ import annotations

import codecs
import csv
import io
import math
import re
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv as arrow_csv

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted
from tendonfmu.recordings.converters.column_map import SEPARATORS, LogFormat
from tendonfmu.recordings.converters.log import LONGEST, NUMBER, TEXT, Block, Field, Topic
from tendonfmu.recordings.converters.units import quantity

CHUNK = 4 << 20  # bytes of text at once
HEAD = 1 << 18  # bytes by which the encoding is found
SAMPLE = 200  # lines by which the layout is found
COMMENTS = ("#", "%", "//")
FLAGS = {"true": 1.0, "false": 0.0}
MISSING = ("", "nan", "na", "n/a", "null", "none", "#n/a", "-nan")  # texts of no number, in lower case

_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?")
_DATE = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ]\d{1,2}:\d{2}.*")
_BOMS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))

# --- layout -----------------------------------------------------------------------------------------------------------


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


def _find_encoding(file: Path, begin: bytes, wanted: str | None) -> tuple[str, str]:
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
    try:
        codecs.getincrementaldecoder("utf-8")().decode(begin)
    except UnicodeDecodeError:
        return "latin-1", f'{file}: not UTF-8; read as latin-1. If names look wrong, set "encoding" in "log" of the map'
    return "utf-8", ""


def _find_layout(file: Path, lines: list[str], log: LogFormat) -> Layout:
    """Return how a log is written."""
    given = log.skip or 0
    content = [(k, line) for k, line in enumerate(lines) if k >= given and line.strip()]
    if not content:
        raise InputError(f"{file}: no line after the {given} that the map skips; expected a line of names")
    plain = [(k, line) for k, line in content if not _is_comment(line)] or content
    separator = log.separator or _separator([line for _, line in plain], log.decimal)
    decimal = log.decimal or _decimal([line for _, line in plain], separator)
    at = _names_at(content, plain, separator, decimal, log)
    if at is None:
        start, line = plain[0]
        count = len(_fields_of(line, separator))
        return Layout(separator, decimal, start, [str(i) for i in range(1, count + 1)], [], given, False)
    number, line = content[at]
    names = _fields_of(_uncommented(line), separator)
    below = [(k, _fields_of(line, separator)) for k, line in content[at + 1 :] if not _is_comment(line)]
    units: list[str] = []
    if below and _is_units(below[0][1], len(names), decimal, log):
        units = [unit.strip(" []()") for unit in below.pop(0)[1]]
    return Layout(separator, decimal, below[0][0] if below else len(lines), names, units, number, True)


def _fields_of(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    fields = line.split(separator) if '"' not in line else next(csv.reader([line], delimiter=separator))
    return [field.strip() for field in fields]


def _is_number(text: str, decimal: str) -> bool:
    """Return whether a text is a number, a flag, a date, or stands for a missing number."""
    plain = text.strip()
    if not _NUMBER.fullmatch(plain):
        return plain.lower() in FLAGS or plain.lower() in MISSING or bool(_DATE.fullmatch(plain))
    return "." not in plain if decimal == "," else "," not in plain


def _is_float(text: str, decimal: str) -> bool:
    plain = text.strip().lower()
    if plain in FLAGS:
        return True
    try:
        float(plain.replace(decimal, "."))
    except ValueError:
        return False
    return "_" not in plain


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(COMMENTS)


def _uncommented(line: str) -> str:
    stripped = line.strip()
    mark = next((mark for mark in COMMENTS if stripped.startswith(mark)), "")
    return stripped.removeprefix(mark).strip() if mark else line


def _separator(lines: list[str], decimal: str | None) -> str:
    """Return the separator by which most lines have the same number of fields, and most of them numbers."""
    best, best_score = " ", (0.0, 0)
    for separator in SEPARATORS:
        if separator == decimal:
            continue
        rows = [_fields_of(line, separator) for line in lines]
        counts = Counter(map(len, rows))
        width, most = max(counts.items(), key=lambda item: (item[1], item[0]))
        if width < 2:
            continue
        cells = [cell for row in [row for row in rows if len(row) == width][-50:] for cell in row]
        decimals = (decimal,) if decimal else ((".", ",") if separator != "," else (".",))
        numbers = max(sum(_is_number(cell, mark) for cell in cells) for mark in decimals) / len(cells)
        # a space counts only if no other separates: dates and names have spaces too
        score = (most / len(lines) - (0.5 if separator == " " else 0.0) + numbers, width)
        if score > best_score:
            best, best_score = separator, score
    return best


def _decimal(lines: list[str], separator: str) -> str:
    if separator == ",":
        return "."
    cells = [cell for line in lines[-50:] for cell in _fields_of(line, separator)]
    commas, points = (sum(_is_number(cell, mark) and mark in cell for cell in cells) for mark in ",.")
    return "," if commas > points else "."


def _names_at(
    content: list[tuple[int, str]], plain: list[tuple[int, str]], separator: str, decimal: str, log: LogFormat
) -> int | None:
    """Return the index in `content` of the line of names, or None."""
    if log.header is False:
        return None
    if log.skip is not None:
        return 0 if log.header or not _is_row(_fields_of(content[0][1], separator), decimal) else None
    rows = [(k, _fields_of(line, separator)) for k, line in plain]
    width = Counter(len(row) for _, row in rows[-50:]).most_common(1)[0][0]
    first = next((k for k, row in rows if len(row) == width and _is_row(row, decimal)), None)
    # the last line before the first row that has a name for each column; a comment may hold the names
    before = [line for k, line in content if first is None or k < first]
    for at, line in reversed(list(enumerate(before))):
        is_wide = len(_fields_of(_uncommented(line), separator)) == width
        if is_wide and not _is_units(_fields_of(line, separator), width, decimal, log):
            return at
    return 0 if log.header or (before and not _is_comment(content[0][1])) else None


def _is_row(fields: list[str], decimal: str) -> bool:
    """Return whether fields are those of a row: at least one is a number, and no name is beside an empty field."""
    return any(
        field.strip() and field.strip().lower() not in MISSING and _is_number(field, decimal) for field in fields
    )


def _is_units(fields: list[str], width: int, decimal: str, log: LogFormat) -> bool:
    """Return whether fields are a row of units: brackets, names of units, or nothing."""
    if log.units_row is not None:
        return log.units_row
    filled = [field for field in fields if field.strip()]
    if len(fields) != width or not filled or _is_row(fields, decimal):
        return False
    known = [re.fullmatch(r"[\[(].*[\])]|-", field) or quantity(field) for field in filled]
    return sum(map(bool, known)) * 2 > len(filled)


def _length_of_lists(cells: Sequence[str]) -> int:
    """Return how many numbers each cell holds as a list, [1.0, 2.0]; 0 if they are no such lists."""
    if not cells or not all(cell.startswith("[") and cell.endswith("]") for cell in cells):
        return 0
    numbers = _numbers_of_lists(cells)
    return 0 if numbers is None or numbers.shape[1] > LONGEST else int(numbers.shape[1])


def _numbers_of_lists(cells: Sequence[str | None]) -> Any:
    """Return the numbers [N, k] of N lists, or None if they are not equally long."""
    try:
        return np.array([cell.strip(" []").split(",") for cell in cells if cell is not None], dtype=np.float64)
    except ValueError:
        return None


# --- the log ----------------------------------------------------------------------------------------------------------


class TextLog:
    """A text log."""

    open_ended = False

    def __init__(self, file: Path, settings: LogFormat) -> None:
        self.file = file
        self.notes: list[str] = []
        self._tail_notes: list[str] = []
        begin = b""
        for chunk in self._bytes([]):
            begin += chunk
            if len(begin) >= HEAD:
                break
        self.encoding, note = _find_encoding(file, begin[:HEAD], settings.encoding)
        self._hints = [note] if note else []
        head = [line for text in self._texts(begin_only=True) for line in text.split("\n")[:-1]]
        self.layout = _find_layout(file, head[: (settings.skip or 0) + SAMPLE], settings)
        lines = [line for line in head[self.layout.start :] if line.strip()]
        self._places: list[tuple[int, int | None]] = []  # of each field: its column, and which number of a list there
        self.topics = [Topic("", tuple(self._fields(lines[:SAMPLE])))]

    def _fields(self, lines: list[str]) -> Iterator[Field]:
        """Yield the columns, with their kinds by the first lines; one with lists of numbers has a field for each."""
        layout = self.layout
        rows = [row for row in (_fields_of(line, layout.separator) for line in lines) if len(row) == len(layout.names)]
        for k, name in enumerate(layout.names):
            cells = [row[k] for row in rows if row[k].strip().lower() not in MISSING]
            is_text = cells and not any(_is_float(cell, layout.decimal) for cell in cells)
            unit = layout.units[k] if layout.units else ""
            for number in range(_length_of_lists(cells)):
                self._places.append((k, number))
                yield Field(f"{name}[{number + 1}]", NUMBER, "number of a list", unit)
            if self._places[-1:] == [] or self._places[-1][0] != k:
                kind = TEXT if is_text else NUMBER
                self._places.append((k, None))
                yield Field(name, kind, kind, unit)

    # --- bytes and lines ----------------------------------------------------------------------------------------------

    def _bytes(self, notes: list[str]) -> Iterator[bytes]:
        """Yield the content, decompressed. A stream that is cut off ends with a note."""
        try:
            with open(self.file, "rb") as raw:
                if self.file.suffix.lower() == ".gz":
                    yield from self._decompressed(raw, notes)
                    return
                while chunk := raw.read(CHUNK):
                    yield chunk
        except OSError as error:
            raise InputError(f"{self.file}: cannot be read ({error.strerror or error})") from None

    def _decompressed(self, raw: io.BufferedReader, notes: list[str]) -> Iterator[bytes]:
        # zlib gives what there is of a stream that is cut off; the module gzip gives nothing of its last block
        stream, is_whole, has_text = zlib.decompressobj(wbits=31), False, False
        while data := raw.read(1 << 20):
            while data:
                try:
                    text = stream.decompress(data, CHUNK)
                except zlib.error as error:
                    if not has_text:
                        raise InputError(f"{self.file}: not a gzip file ({error}); expected text in .gz") from None
                    notes.append(f"{self.file}: the gzip stream is damaged; what follows is lost")
                    return
                has_text = has_text or bool(text)
                yield text
                is_whole, data = stream.eof, stream.unconsumed_tail
                if stream.eof:  # a file may hold several streams, or be padded with zeros
                    data = stream.unused_data.lstrip(b"\0")
                    stream = zlib.decompressobj(wbits=31)
        if not is_whole:
            notes.append(f"{self.file}: the gzip stream is cut off; what follows is lost")

    def _texts(self, begin_only: bool = False) -> Iterator[str]:
        """Yield text in whole lines."""
        notes: list[str] = []
        decoder = io.IncrementalNewlineDecoder(codecs.getincrementaldecoder(self.encoding)(), translate=True)
        rest, has_ended = "", False
        for chunk in self._bytes(notes):
            if has_ended:
                if chunk.strip(b"\0"):
                    raise InputError(f"{self.file}: not a text file; expected CSV")
                continue
            text, zeros, tail = (rest + self._decoded(decoder, chunk)).partition("\0")
            if zeros:  # after a loss of power, files end with zeros
                if tail.strip("\0"):
                    raise InputError(f"{self.file}: not a text file; expected CSV")
                has_ended = True
            whole, line_end, rest = text.rpartition("\n")
            if line_end:
                yield whole + line_end
            if begin_only and whole.count("\n") > SAMPLE:
                return
        if rest.strip() and begin_only:
            # the only line of a file may be without its end
            yield rest + "\n"
        elif rest.strip():
            notes.append(
                f"{self.file}: the last line has no line end and may be cut off; it is left out: {rest[:40]!r}"
            )
        self._tail_notes = notes

    def _decoded(self, decoder: io.IncrementalNewlineDecoder, chunk: bytes) -> str:
        try:
            return str(decoder.decode(chunk))
        except UnicodeDecodeError as error:
            raise InputError(
                f'{self.file}: not a text file in {self.encoding} ({error.reason}); set "encoding" in "log" of the map'
            ) from None

    # --- rows ---------------------------------------------------------------------------------------------------------

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read columns; see `log.Log`."""
        places = {name: self._places[self.topics[0].place(name)] for name in wanted.get("", ())}
        row, skip = 0, self.layout.start
        for text in self._texts():
            if skip:
                lines = text.split("\n")
                skip, text = max(0, skip - len(lines) + 1), "\n".join(lines[skip:])
            if any(mark in text for mark in COMMENTS):
                text = "\n".join(line for line in text.split("\n") if not _is_comment(line))
            if not text.strip():
                continue
            block = self._parse_fast(text, places, texts)
            if block is None:
                lines = [line for line in text.split("\n") if line.strip()]
                block = self._parse_by_field(lines, places, texts, row)
            row += len(next(iter(block.values()))) if block else 0
            yield "", block
        self.notes = [*self._hints, *(f"{note}; {counted(row, 'row')} {are(row)} kept" for note in self._tail_notes)]

    def _parse_fast(
        self, text: str, places: Mapping[str, tuple[int, int | None]], texts: Sequence[str]
    ) -> Block | None:
        """Return the columns, or None if a field needs a closer look."""
        separator = self.layout.separator
        if separator == " ":
            separator = "\t"
            text = "\n".join("\t".join(line.split()) for line in text.split("\n"))
        data = text.encode()
        keys = [str(k) for k in range(len(self.layout.names))]
        types = {
            keys[place]: pa.float64() if number is None and name not in texts else pa.string()
            for name, (place, number) in places.items()
        }
        try:
            table = arrow_csv.read_csv(
                pa.BufferReader(data),
                arrow_csv.ReadOptions(column_names=keys, block_size=len(data) + 1),
                arrow_csv.ParseOptions(delimiter=separator),
                arrow_csv.ConvertOptions(
                    column_types=types,
                    include_columns=list(types),
                    decimal_point=self.layout.decimal,
                    null_values=[*MISSING, "NaN", "NAN", "NA", "N/A", "NULL", "None", "#N/A"],
                ),
            )
        except (pa.ArrowInvalid, pa.ArrowKeyError):
            return None
        block: Block = {}
        lists: dict[int, Any] = {}
        for name, (place, number) in places.items():
            column = table.column(keys[place])
            if number is None:
                block[name] = column if name in texts else np.asarray(column.to_numpy())
                continue
            if place not in lists:
                lists[place] = _numbers_of_lists(column.to_pylist())
            if lists[place] is None or number >= lists[place].shape[1]:
                return None
            block[name] = lists[place][:, number]
        return block

    def _parse_by_field(
        self, lines: list[str], places: Mapping[str, tuple[int, int | None]], texts: Sequence[str], row: int
    ) -> Block:
        """Return the same, and refuse the first invalid field by name."""
        layout = self.layout
        columns: dict[str, list[Any]] = {name: [] for name in places}
        for k, line in enumerate(lines, start=row + 1):
            fields = _fields_of(line, layout.separator)
            if len(fields) != len(layout.names):
                raise InputError(
                    f"{self.file}: row {k}: {counted(len(fields), 'field')} between {layout.separator!r}; expected "
                    f"{len(layout.names)}, as in the first line"
                )
            for name, (place, number) in places.items():
                cell = fields[place]
                if number is not None:
                    numbers = cell.strip("[]").split(",")
                    if number >= len(numbers):
                        raise InputError(
                            f"{self.file}: column {layout.names[place]}, row {k}: {counted(len(numbers), 'number')}; "
                            f"expected as many as in the first row"
                        )
                    cell = numbers[number]
                columns[name].append(cell if name in texts else self._number(layout.names[place], k, cell))
        return {
            name: pa.array(cells, pa.string()) if name in texts else np.array(cells, dtype=np.float64)
            for name, cells in columns.items()
        }

    def _number(self, name: str, row: int, text: str) -> float:
        plain = text.strip().lower()
        if plain in FLAGS:
            return FLAGS[plain]
        if plain in MISSING:
            return math.nan
        # a point in a number with a decimal comma separates thousands; this is refused, not guessed
        if _is_number(plain, self.layout.decimal) and _is_float(plain, self.layout.decimal):
            return float(plain.replace(self.layout.decimal, "."))
        raise InputError(f"{self.file}: column {name}, row {row}: {text!r}; expected a finite number")
