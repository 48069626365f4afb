"""How ROS 2 bags are read: a folder of .db3 or .mcap files, or one .db3 file.

The folder's metadata.yaml is not needed; a recorder that was killed has not written it. Files that are cut off are read
as far as SQLite and MCAP allow.
"""

from __future__ import annotations

import importlib
import io
import json
import os
import re
import shutil
import sqlite3
import struct
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted, require_extra
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.log import Log
from tendonfmu.recordings.converters.messages import Decoder, MessageLog, Received, Ros2Types

# --- MCAP files -------------------------------------------------------------------------------------------------------


MAGIC = b"\x89MCAP0\r\n"
CHUNK_CODE, CHUNK = 0x06, struct.Struct("<BQQQQII")  # code, length, times, size, checksum, length of a name
RECORDS = ("Schema", "Channel", "Message")
LARGEST = 1 << 32  # bytes of a record


class McapLog(MessageLog):
    """MCAP files, one after the other."""

    def __init__(self, file: Path, settings: LogFormat, parts: Sequence[Path] | None = None) -> None:
        super().__init__(file, [file] if parts is None else parts)

    def messages_of(self, part: Path) -> Iterator[Received]:
        """Yield the messages of one file."""
        schemas: dict[int, Any] = {}
        channels: dict[int, tuple[str, Decoder | None]] = {}
        types = Ros2Types(self.file)
        kept, self._cut = 0, ""  # why the file ends early
        for record in self._records(part):
            kind = type(record).__name__
            if kind == "Schema":
                schemas[record.id] = record
            elif kind == "Channel":
                if record.id not in channels:
                    channels[record.id] = (record.topic, self._decoder(record, schemas.get(record.schema_id), types))
            else:
                kept += 1
                topic, decode = channels.get(record.channel_id, ("", None))
                if decode is not None:
                    yield Received(topic, record.log_time, record.publish_time, decode, record.data)
        if self._cut:
            self.notes.append(f"{part}: {self._cut}; {counted(kept, 'message')} {are(kept)} kept")

    def _decoder(self, channel: Any, schema: Any, types: Ros2Types) -> Decoder | None:
        encoding = channel.message_encoding
        if encoding == "json":
            return json.loads  # JSONDecodeError and UnicodeDecodeError are ValueErrors
        if encoding == "cdr" and schema is not None:
            return types.decoder(schema.name, schema.data.decode("utf-8", "replace"), schema.encoding)
        if encoding == "protobuf" and schema is not None:
            factory = require_extra("mcap_protobuf.decoder", str(self.file)).DecoderFactory()
            decode: Decoder | None = factory.decoder_for(encoding, schema)
            return None if decode is None else partial(_decode_protobuf, decode)
        self.unknown[channel.topic] = f"{channel.topic}: messages in {encoding!r}"
        return None

    def _records(self, part: Path) -> Iterator[Any]:
        """Yield the schemas, channels and messages (of the package mcap) of a file, also of one that was cut off."""
        stream = require_extra("mcap.stream_reader", str(self.file))
        errors = require_extra("mcap.exceptions", str(self.file))
        with open(part, "rb") as raw:
            if raw.read(len(MAGIC)) != MAGIC:
                raise InputError(f"{part}: not an MCAP file; expected one that begins with its mark")
            reader = stream.StreamReader(raw, skip_magic=True, emit_chunks=True, record_size_limit=LARGEST)
            at = raw.tell()
            try:
                for record in reader.records:
                    at = raw.tell()
                    kind = type(record).__name__
                    if kind == "DataEnd":
                        return
                    if kind == "Chunk":
                        yield from stream.breakup_chunk(record, validate_crc=True)
                    elif kind in RECORDS:
                        yield record
            except errors.UnsupportedCompressionError as error:
                raise InputError(f"{part}: {error}; expected compression by zstd, lz4 or none") from None
            except errors.EndOfFile:
                self._cut = "the file is cut off"
                raw.seek(at)
                with suppress(Exception):  # of what is left of the last chunk, all errors mean its end
                    for record in stream.StreamReader(_begin_of_chunk(raw.read()), skip_magic=True).records:
                        if type(record).__name__ in RECORDS:
                            yield record
            except Exception as error:  # of zstd, lz4, checksums and records
                self._cut = f"a block is damaged ({error})"


def _decode_protobuf(decode: Decoder, data: bytes) -> Any:
    try:
        return decode(data)
    except Exception as error:  # google.protobuf has errors of its own
        raise ValueError(str(error)) from None


def _begin_of_chunk(record: bytes) -> io.BytesIO:
    """Return the records in a chunk that is cut off: its compression is a stream."""
    opcode, _, _, _, _, _, length = CHUNK.unpack_from(record)
    compression, data = record[CHUNK.size :][:length], record[CHUNK.size + length + 8 :]
    if compression:
        module = importlib.import_module("zstandard" if compression == b"zstd" else "lz4.frame")
        stream = module.ZstdDecompressor().decompressobj() if compression == b"zstd" else module.LZ4FrameDecompressor()
        data = stream.decompress(data)
    return io.BytesIO(data if opcode == CHUNK_CODE else b"")


# --- bags -------------------------------------------------------------------------------------------------------------

ZSTD_MARK = b"\x28\xb5\x2f\xfd"


def open_bag(file: Path, settings: LogFormat) -> Log:
    """Open a folder, or a .db3 file. Raise InputError."""
    if file.is_file():
        return Db3Log(file, [file])
    parts = sorted(file.glob("*.mcap"), key=_in_order) or sorted(file.glob("*.db3"), key=_in_order)
    if not parts:
        packed = next((part.name for part in file.iterdir() if part.suffix == ".zstd"), "")
        what = "no .mcap or .db3 file"
        if packed:
            what = f"compressed files, such as {packed}; unpack them: zstd -d --rm *.zstd"
        raise InputError(f"{file}: a folder with {what}; expected a ROS 2 bag")
    return McapLog(file, settings, parts) if parts[0].suffix == ".mcap" else Db3Log(file, parts)


def _in_order(part: Path) -> list[int | str]:
    """Return a key by which bag_2 comes before bag_10."""
    return [int(text) if text.isdigit() else text for text in re.split(r"(\d+)", part.name)]


class Db3Log(MessageLog):
    """SQLite files of a ROS 2 bag."""

    def messages_of(self, part: Path) -> Iterator[Received]:
        """Yield the messages of one file."""
        with _whole_pages(part) as readable, closing(_connect(readable)) as connection:
            kept, cut = 0, ""
            try:
                topics = self._topics(part, connection)
                # by row: the index of times may lie in a part that is lost
                rows = connection.execute("SELECT topic_id, timestamp, data FROM messages NOT INDEXED ORDER BY id")
            except sqlite3.DatabaseError as error:
                advice = "copy the file again, or try `sqlite3 FILE .recover`"
                raise InputError(f"{part}: not a ROS 2 bag that SQLite can read ({error}); {advice}") from None
            while True:
                try:
                    row = rows.fetchone()
                except sqlite3.DatabaseError as error:
                    cut = str(error)
                    break
                if row is None:
                    break
                kept += 1
                topic, decode = topics.get(row[0], ("", None))
                if decode is not None:
                    yield Received(topic, row[1], row[1], decode, row[2])
        page, pages = _pages(part)
        if cut or pages * page > part.stat().st_size:
            kept_words = f"{counted(kept, 'message')} {are(kept)} kept"
            self.notes.append(f"{part}: the file is cut off ({cut or 'pages are missing'}); {kept_words}")

    def _topics(self, part: Path, connection: sqlite3.Connection) -> dict[int, tuple[str, Decoder | None]]:
        """Return name and decoder of each topic by its key."""
        tables = {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"topics", "messages"} <= tables:
            raise InputError(f"{part}: no tables of topics and messages; expected a ROS 2 bag")
        definitions: dict[str, tuple[str, str]] = {}
        if "message_definitions" in tables:
            for name, encoding, text in connection.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            ):
                definitions[name] = (text, encoding)
        types = Ros2Types(self.file)
        topics: dict[int, tuple[str, Decoder | None]] = {}
        for key, name, kind, form in connection.execute("SELECT id, name, type, serialization_format FROM topics"):
            decode = types.decoder(kind, *definitions.get(kind, ("", ""))) if form == "cdr" else None
            if decode is None:
                self.unknown[name] = f"{name}: no definition of {kind}"
            topics[key] = (name, None if decode is None else partial(self._decode, decode))
        return topics

    def _decode(self, decode: Decoder, data: bytes) -> Any:
        if data[:4] == ZSTD_MARK:
            data = require_extra("zstandard", str(self.file)).ZstdDecompressor().decompress(data)
        return decode(data)


def _connect(part: Path) -> sqlite3.Connection:
    """Open a file read-only. A file of fewer pages than it states is read as far as it goes."""
    journal = part.with_name(part.name + "-wal")
    # the log of a recorder that was killed holds its last messages; only SQLite's usual way of opening reads it
    mode = "mode=ro" if journal.is_file() and journal.stat().st_size else "immutable=1"
    try:
        connection = sqlite3.connect(f"{part.absolute().as_uri()}?{mode}", uri=True)
        connection.execute("PRAGMA writable_schema = ON")  # without it, SQLite refuses files that are cut off
    except sqlite3.DatabaseError as error:
        raise InputError(f"{part}: not an SQLite file ({error}); expected a ROS 2 bag") from None
    return connection


@contextmanager
def _whole_pages(part: Path) -> Iterator[Path]:
    """Yield a file whose last page is whole: SQLite takes what is missing of a page for zeros."""
    page, _ = _pages(part)
    size = part.stat().st_size
    if not page or size % page == 0:
        yield part
        return
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / part.name
        shutil.copyfile(part, copy)
        os.truncate(copy, size - size % page)
        yield copy


def _pages(part: Path) -> tuple[int, int]:
    """Return the size of a page, 0 if the file has no head, and the number of pages that the head states."""
    with open(part, "rb") as raw:
        head = raw.read(32)
    if len(head) < 32 or not head.startswith(b"SQLite format 3"):
        return 0, 0
    size = int.from_bytes(head[16:18], "big")
    return 65536 if size == 1 else size, int.from_bytes(head[28:32], "big")
