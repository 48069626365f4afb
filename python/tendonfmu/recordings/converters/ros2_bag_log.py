"""How ROS 2 bags are read: a folder of .db3 or .mcap files, or one .db3 file.

The folder's metadata.yaml is not needed; a recorder that was killed has not written it. Files that are cut off are read
as far as SQLite and MCAP allow.
"""

from __future__ import annotations

import os
import re
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted, require_extra
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.log import Log
from tendonfmu.recordings.converters.mcap_log import McapLog
from tendonfmu.recordings.converters.messages import Decoder, MessageLog, Received, Ros2Types

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
                raise InputError(
                    f"{part}: not a ROS 2 bag that SQLite can read ({error}); copy the file again, or try "
                    "`sqlite3 FILE .recover`"
                ) from None
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
