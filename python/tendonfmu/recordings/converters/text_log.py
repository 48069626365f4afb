"""How text logs are read: CSV with any separator, decimal mark and encoding, also compressed by gzip.

They are read in blocks of some megabytes, so that memory does not grow with the log. Arrow parses a block; where it
refuses one, the block is read again field by field, to name the row. A log that is cut off is read up to its last whole
line. Rows count from 1, without the line of names.
"""

from __future__ import annotations

import codecs
import io
import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.log import NUMBER, NUMBERED, TEXT, Block, Field, Topic
from tendonfmu.recordings.converters.text_layout import (
    COMMENTS,
    FLAGS,
    MISSING,
    SAMPLE,
    Layout,
    fields_of,
    find_encoding,
    find_layout,
    is_number,
)

CHUNK = 4 << 20  # bytes of text at once


class TextLog:
    """A text log."""

    open_ended = False

    def __init__(self, file: Path, settings: LogFormat) -> None:
        self.file = file
        self.notes: list[str] = []
        self._tail_notes: list[str] = []
        self.compressed = file.suffix.lower() == ".gz"
        begin = b"".join(_first(self._bytes([]), 1 << 18))
        self.encoding, note = find_encoding(file, begin, settings.encoding)
        self._hints = [note] if note else []
        head: list[str] = []
        for text in self._texts(begin_only=True):
            head += text.split("\n")[:-1]
        self.layout: Layout = find_layout(file, head[: (settings.skip or 0) + SAMPLE], settings)
        self.rows_at_head = [
            fields_of(line, self.layout.separator) for line in head[self.layout.start :] if line.strip()
        ]
        self.topics = [Topic("", tuple(self._fields()))]

    def _fields(self) -> Iterator[Field]:
        layout = self.layout
        rows = [row for row in self.rows_at_head[:SAMPLE] if len(row) == len(layout.names)]
        for k, name in enumerate(layout.names):
            cells = [row[k] for row in rows if row[k].strip().lower() not in MISSING]
            dates = cells and not any(_is_float(cell, layout.decimal) for cell in cells)
            kind = TEXT if dates else NUMBER
            yield Field(name, kind, "text" if dates else "number", layout.units[k] if layout.units else "")

    # --- bytes and lines ----------------------------------------------------------------------------------------------

    def _bytes(self, notes: list[str]) -> Iterator[bytes]:
        """Yield the content, decompressed. A stream that is cut off ends with a note."""
        try:
            with open(self.file, "rb") as raw:
                if not self.compressed:
                    while chunk := raw.read(CHUNK):
                        yield chunk
                else:
                    yield from self._decompressed(raw, notes)
        except OSError as error:
            raise InputError(f"{self.file}: cannot be read ({error.strerror or error})") from None

    def _decompressed(self, raw: io.BufferedReader, notes: list[str]) -> Iterator[bytes]:
        # zlib gives what there is of a stream that is cut off; the module gzip gives nothing of its last block
        stream, whole, any_text = zlib.decompressobj(wbits=31), False, False
        while data := raw.read(1 << 20):
            while data:
                try:
                    text = stream.decompress(data, CHUNK)
                except zlib.error as error:
                    if not any_text:
                        raise InputError(f"{self.file}: not a gzip file ({error}); expected text in .gz") from None
                    notes.append(f"{self.file}: the gzip stream is damaged; what follows is lost")
                    return
                any_text = any_text or bool(text)
                yield text
                whole, data = stream.eof, stream.unconsumed_tail
                if stream.eof:  # a file may hold several streams, or be padded with zeros
                    data = stream.unused_data.lstrip(b"\0")
                    stream = zlib.decompressobj(wbits=31)
        if not whole:
            notes.append(f"{self.file}: the gzip stream is cut off; what follows is lost")

    def _texts(self, begin_only: bool = False) -> Iterator[str]:
        """Yield text in whole lines."""
        notes: list[str] = []
        decoder = io.IncrementalNewlineDecoder(codecs.getincrementaldecoder(self.encoding)(), translate=True)
        rest, ended = "", False
        for chunk in self._bytes(notes):
            if ended:
                if chunk.strip(b"\0"):
                    raise InputError(f"{self.file}: not a text file; expected CSV")
                continue
            text = rest + self._decoded(decoder, chunk)
            nul = text.find("\0")
            if nul >= 0:  # after a loss of power, files end with zeros
                if text[nul:].strip("\0"):
                    raise InputError(f"{self.file}: not a text file; expected CSV")
                text, ended = text[:nul], True
            whole, line_end, rest = text.rpartition("\n")
            if line_end:
                yield whole + line_end
            if begin_only and whole.count("\n") > SAMPLE:
                return
        if begin_only:
            # the only line of a file may be without its end
            if rest.strip():
                yield rest + "\n"
            return
        if rest.strip():
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
        names = list(wanted.get("", ()))
        places = {name: self._place(name) for name in names}
        row, skip = 0, self.layout.start
        for text in self._texts():
            if skip:
                lines = text.split("\n")
                skip, text = max(0, skip - len(lines) + 1), "\n".join(lines[skip:])
            text = _without_comments(text)
            if not text.strip():
                continue
            block, count = self._parse(text, places, texts, row)
            row += count
            yield "", block
        self.notes = [*self._hints, *(f"{note}; {counted(row, 'row')} {are(row)} kept" for note in self._tail_notes)]

    def _place(self, name: str) -> int:
        if name.startswith(NUMBERED) and name not in self.layout.names:
            return int(name[len(NUMBERED) :]) - 1
        return self.layout.names.index(name)

    def _parse(self, text: str, places: Mapping[str, int], texts: Sequence[str], row: int) -> tuple[Block, int]:
        found = self._parse_fast(text, places, texts)
        if found is None:
            lines = [line for line in text.split("\n") if line.strip()]
            found = self._parse_by_field(lines, places, texts, row)
        return found, len(next(iter(found.values()))) if found else 0

    def _parse_fast(self, text: str, places: Mapping[str, int], texts: Sequence[str]) -> Block | None:
        """Return the columns, or None if a field needs a closer look."""
        import pyarrow as pa
        from pyarrow import csv

        separator = self.layout.separator
        if separator == " ":
            separator = "\t"
            text = "\n".join("\t".join(line.split()) for line in text.split("\n"))
        data = text.encode()
        keys = [str(k) for k in range(len(self.layout.names))]
        types = {keys[place]: pa.string() if name in texts else pa.float64() for name, place in places.items()}
        try:
            table = csv.read_csv(
                pa.BufferReader(data),
                csv.ReadOptions(column_names=keys, block_size=len(data) + 1),
                csv.ParseOptions(delimiter=separator),
                csv.ConvertOptions(
                    column_types=types,
                    include_columns=list(types),
                    decimal_point=self.layout.decimal,
                    null_values=[*MISSING, "NaN", "NAN", "NA", "N/A", "NULL", "None", "#N/A"],
                ),
            )
        except (pa.ArrowInvalid, pa.ArrowKeyError):
            return None
        return {
            name: table.column(keys[place]) if name in texts else np.asarray(table.column(keys[place]).to_numpy())
            for name, place in places.items()
        }

    def _parse_by_field(self, lines: list[str], places: Mapping[str, int], texts: Sequence[str], row: int) -> Block:
        """Return the same, and refuse the first invalid field by name."""
        import pyarrow as pa

        layout = self.layout
        found: dict[str, list[Any]] = {name: [] for name in places}
        for k, line in enumerate(lines, start=row + 1):
            fields = fields_of(line, layout.separator)
            if len(fields) != len(layout.names):
                raise InputError(
                    f"{self.file}: row {k}: {counted(len(fields), 'field')} between {layout.separator!r}; expected "
                    f"{len(layout.names)}, as in the first line"
                )
            for name, place in places.items():
                cell = fields[place]
                found[name].append(cell if name in texts else self._number(layout.names[place], k, cell))
        return {
            name: pa.array(cells, pa.string()) if name in texts else np.array(cells, dtype=np.float64)
            for name, cells in found.items()
        }

    def _number(self, name: str, row: int, text: str) -> float:
        plain = text.strip().lower()
        if plain in FLAGS:
            return FLAGS[plain]
        if plain in MISSING:
            return math.nan
        # a point in a number with a decimal comma separates thousands; this is refused, not guessed
        if is_number(plain, self.layout.decimal) and _is_float(plain, self.layout.decimal):
            return float(plain.replace(self.layout.decimal, "."))
        raise InputError(f"{self.file}: column {name}, row {row}: {text!r}; expected a finite number")


def _is_float(text: str, decimal: str) -> bool:
    plain = text.strip().lower()
    if plain in FLAGS:
        return True
    try:
        float(plain.replace(decimal, "."))
    except ValueError:
        return False
    return "_" not in plain


def _without_comments(text: str) -> str:
    if not any(mark in text for mark in COMMENTS):
        return text
    return "\n".join(line for line in text.split("\n") if not line.lstrip().startswith(COMMENTS))


def _first(chunks: Iterator[bytes], most: int) -> Iterator[bytes]:
    """Yield the first bytes."""
    for chunk in chunks:
        yield chunk[:most]
        most -= len(chunk)
        if most <= 0:
            return
