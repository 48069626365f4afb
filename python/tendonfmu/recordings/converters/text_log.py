"""How text logs are read: CSV with any separator, decimal mark and encoding, also compressed by gzip.

What the map does not say of their layout is found in the first lines. They are read in blocks of some megabytes, so
that memory does not grow with the log. Arrow parses a block; where it refuses one, the block is read again field by
field, to name the row. A log that is cut off is read up to its last whole line. Rows count from 1, without the line of
names.
"""

from __future__ import annotations

import codecs
import io
import math
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv as arrow_csv

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.log import LONGEST, NUMBER, TEXT, Block, Field, Topic
from tendonfmu.recordings.converters.text_layout import (
    COMMENTS,
    MISSING,
    fields_of,
    find_layout,
    is_comment,
    is_missing,
    number_of,
    stamp_separator,
    with_column_of_stamps,
)
from tendonfmu.recordings.converters.units import stated

CHUNK = 4 << 20  # bytes of text at once
HEAD = 1 << 18  # bytes by which the encoding is found
SAMPLE = 1000  # lines by which the layout is found
MOST_FAULTY = 0.1  # of the rows of a block: more are another layout
CLOCK = re.compile(r"(?<![a-z])(time|t|timestamp|x_value|zeit)(?![a-z])")  # in the name of a time
FOOTER = 20  # lines below the last row that are left out

_BOMS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))

# --- encoding and lists -----------------------------------------------------------------------------------------------


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


# [1.0, 2.0], [1. 2.], (1.0, 2.0) or array([1.0, 2.0], dtype=float32)
_LIST = re.compile(r"(?:[\w.]+\()?(?:\[([^\[\]]*)\]|\(([^()]*,[^()]*)\))(?:, *[a-z]+=[\w.]+)*\)?")


def _listed(cell: str) -> list[str]:
    """Return the numbers of a cell that holds them as a list; none if it is no list."""
    found = _LIST.fullmatch(re.sub(r"np\.\w+\(([^()]*)\)", r"\1", cell.strip()))  # np.float64(1.0)
    return re.findall(r"[^\s,]+", found[1] or found[2] or "") if found else []


def _length_of_lists(cells: Sequence[str]) -> int:
    """Return how many numbers each cell holds as a list; 0 if they are no lists."""
    if not cells or not all(map(_listed, cells)):
        return 0
    numbers = _numbers_of_lists(cells)
    return 0 if numbers is None or numbers.shape[1] > LONGEST else int(numbers.shape[1])


def _numbers_of_lists(cells: Sequence[str | None]) -> Any:
    """Return the numbers [N, k] of N lists, or None if they are not equally long."""
    try:
        return np.array([_listed(cell) for cell in cells if cell is not None], dtype=np.float64)
    except ValueError:
        return None


def _pairs(fields: list[Field]) -> list[Topic]:
    """Return a topic for each channel if they come as pairs of a time and a value, otherwise one of all fields."""
    times, values = fields[::2], fields[1::2]
    are_clocks = all(CLOCK.search(field.name.lower()) for field in times)
    if len(values) < 2 or len(times) != len(values) or not are_clocks or any(CLOCK.search(f.name) for f in values):
        return [Topic("", tuple(fields))]
    topics, names = [], [value.name for value in values]
    for k, (time, value) in enumerate(zip(times, values, strict=True), start=1):
        name = value.name if names.count(value.name) == 1 else f"{value.name}[{k}]"
        unit = (stated(time.name, time.unit) or (time.unit,))[0]
        fields = [replace(time, name=f"{name}.time", unit=unit), replace(value, name=name)]
        topics.append(Topic(name, tuple(fields), prefix=f"{name}."))
    return topics


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
        self._stamps = stamp_separator(head)  # between the times of a terminal and its lines
        if self._stamps:
            head = [with_column_of_stamps(line, self._stamps) for line in head]
        self.layout = find_layout(file, head[: (settings.skip or 0) + SAMPLE], settings)
        self._is_lenient = settings.leaves_out
        lines = [line for line in head[self.layout.start :] if line.strip()]
        self._places: list[tuple[int, int | None]] = []  # of each field: its column, and which number of a list there
        self.topics = _pairs(list(self._fields(lines[:SAMPLE])))

    def _fields(self, lines: list[str]) -> Iterator[Field]:
        """Yield the columns, with their kinds by the first lines; one with lists of numbers has a field for each."""
        layout = self.layout
        rows = [row for row in (fields_of(line, layout.separator) for line in lines) if len(row) == layout.width]
        for k, name in enumerate(layout.names):
            cells = [row[k] for row in rows if not is_missing(row[k])]
            if not cells and rows and name in ("", "Comment"):
                continue  # of rows that end in a separator, and of LabVIEW
            is_text = cells and not any(number_of(cell, layout.decimal, layout.thousands) for cell in cells)
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
        with suppress(UnicodeDecodeError):  # of a character that is cut off
            rest += decoder.decode(b"", True)  # a line end that may have been the first half of one
        if rest.endswith("\n"):
            yield rest
        elif rest.strip() and begin_only:
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
            given = f"not a text file in {self.encoding} ({error.reason})"
            raise InputError(f'{self.file}: {given}; set "encoding" in "log" of the map') from None

    # --- rows ---------------------------------------------------------------------------------------------------------

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read columns; see `log.Log`."""
        fields = [field.name for topic in self.topics for field in topic.fields]
        places = {
            name: self._places[self.topics[0].place(name) if len(self.topics) == 1 else fields.index(name)]
            for names in wanted.values()
            for name in names
        }
        row, skip = 0, self.layout.start
        self._odd: dict[str, list[str]] = {}  # rows that are no rows, by what is done about them
        for text, following in pairwise(chain(self._texts(), [None])):
            if text is None:
                break
            if skip:
                lines = text.split("\n")
                skip, text = max(0, skip - len(lines) + 1), "\n".join(lines[skip:])
            if any(mark in text for mark in COMMENTS):
                text = "\n".join(line for line in text.split("\n") if not is_comment(line))
            if not text.strip():
                continue
            if self._stamps:
                text = with_column_of_stamps(text, self._stamps)
            block = self._parse_fast(text, places, texts)
            if block is None:
                lines = [line for line in text.split("\n") if line.strip()]
                block = self._parse_by_field(lines, places, texts, row, following is None)
            row += len(next(iter(block.values()))) if block else 0
            yield from self._by_topic(wanted, block)
        self.notes = [
            *self._hints,
            *(f"{self.file}: {counted(len(odd), 'line')} {what}: {odd[0][:60]!r}" for what, odd in self._odd.items()),
            *(f"{note}; {counted(row, 'row')} {are(row)} kept" for note in self._tail_notes),
        ]

    def _by_topic(self, wanted: Mapping[str, Sequence[str]], block: Block) -> Iterator[tuple[str, Block]]:
        if len(self.topics) == 1:
            yield "", block
            return
        for topic in self.topics:
            if part := {name: block[name] for name in wanted.get(topic.name, ())}:
                # the shorter of the channels end before the last row
                clock = part.get(topic.fields[0].name, np.zeros(len(next(iter(part.values())))))
                is_number = isinstance(clock, np.ndarray)
                there = np.isfinite(clock) if is_number else np.array([bool(text) for text in clock.to_pylist()])
                yield (
                    topic.name,
                    {
                        name: values[there] if isinstance(values, np.ndarray) else values.filter(pa.array(there))
                        for name, values in part.items()
                    },
                )

    def _parse_fast(
        self, text: str, places: Mapping[str, tuple[int, int | None]], texts: Sequence[str]
    ) -> Block | None:
        """Return the columns, or None if a field needs a closer look."""
        separator = self.layout.separator
        if separator == " ":
            separator = "\t"
            text = "\n".join("\t".join(line.split()) for line in text.split("\n"))
        data = text.encode()
        keys = [str(k) for k in range(self.layout.width)]
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
        self,
        lines: list[str],
        places: Mapping[str, tuple[int, int | None]],
        texts: Sequence[str],
        row: int,
        is_last: bool,
    ) -> Block:
        """Return the same. A row without all its numbers is refused by name, or taken as missing where the map says so.

        Names that are repeated, and lines below the last row, are left out.
        """
        parsed = [self._cells(line, places, texts) for line in lines]
        if is_last:
            footer = next((k for k, cells in enumerate(reversed(parsed)) if not isinstance(cells, str)), 0)
            if 0 < footer <= FOOTER and footer < len(lines):
                self._odd.setdefault("below the last row, left out", []).extend(lines[-footer:])
                parsed, lines = parsed[:-footer], lines[:-footer]
        kept: list[list[Any]] = []
        faulty = 0
        for line, cells in zip(lines, parsed, strict=True):
            if not isinstance(cells, str):
                kept.append(cells)
                continue
            if fields_of(line, self.layout.separator)[: len(self.layout.names)] == self.layout.names:
                self._odd.setdefault("with the names again, left out", []).append(line)
                continue
            faulty += 1
            if not self._is_lenient or faulty > max(MOST_FAULTY * len(lines), 1.0):
                place, _, problem = cells.partition("\0")
                where = f"{place}row {row + len(kept) + 1}"
                raise InputError(f"{self.file}: {where}: {problem}")
            self._odd.setdefault("without all numbers, taken as missing", []).append(line)
            kept.append([None if name in texts else math.nan for name in places])
        columns = zip(*kept, strict=True) if kept else ([] for _ in places)
        return {
            name: pa.array(cells, pa.string()) if name in texts else np.array(cells, dtype=np.float64)
            for name, cells in zip(places, columns, strict=True)
        }

    def _cells(self, line: str, places: Mapping[str, tuple[int, int | None]], texts: Sequence[str]) -> list[Any] | str:
        """Return the wanted cells of a line, or what is wrong with it: column, NUL and problem."""
        layout, fields = self.layout, fields_of(line, self.layout.separator)
        if len(fields) == layout.width + 1 and not fields[-1]:
            fields.pop()  # some rows end in a separator
        if len(fields) != layout.width:
            given = f"{counted(len(fields), 'field')} between {layout.separator!r}"
            return f'\0{given}; expected {layout.width}, or "missing": "leave out" in "log" of the map'
        cells: list[Any] = []
        for name, (place, number) in places.items():
            cell = fields[place]
            if number is not None:
                numbers = _listed(cell)
                if number >= len(numbers):
                    found = counted(len(numbers), "number")
                    return f"column {layout.names[place]}, \0{found}; expected as many as in the first row"
                cell = numbers[number]
            if name in texts:
                cells.append(cell)
                continue
            value = number_of(cell, layout.decimal, layout.thousands)
            unit = layout.units[place] if place < len(layout.units) else ""
            if value is None or (value[1] and value[1] != unit):
                wanted = f"a number in {unit or 'no unit of its own'}" if value else "a finite number"
                return f"column {layout.names[place]}, \0{cell!r}; expected {wanted}"
            cells.append(value[0])
        return cells
