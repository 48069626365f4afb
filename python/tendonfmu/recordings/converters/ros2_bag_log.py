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
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted, require_extra
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.log import Block, Log, Topic
from tendonfmu.recordings.converters.mcap_log import McapLog
from tendonfmu.recordings.converters.messages import Collector, FieldLister, Received
from tendonfmu.recordings.converters.ros2_types import Ros2Types

ZSTD_MARK = b"\x28\xb5\x2f\xfd"


def open_bag(file: Path, settings: LogFormat) -> Log:
    """Open a folder, or a .db3 file. Raise InputError."""
    if file.is_file():
        return Db3Log(file, settings, [file])
    parts = sorted(file.glob("*.mcap"), key=_in_order) or sorted(file.glob("*.db3"), key=_in_order)
    if not parts:
        packed = next((each.name for each in file.iterdir() if each.suffix == ".zstd"), "")
        what = (
            f"compressed files, such as {packed}; unpack them: zstd -d --rm *.zstd"
            if packed
            else "no .mcap or .db3 file"
        )
        raise InputError(f"{file}: a folder with {what}; expected a ROS 2 bag")
    return McapLog(file, settings, parts) if parts[0].suffix == ".mcap" else Db3Log(file, settings, parts)


def _in_order(part: Path) -> list[int | str]:
    """Return a key by which bag_2 comes before bag_10."""
    return [int(text) if text.isdigit() else text for text in re.split(r"(\d+)", part.name)]


class Db3Log:
    """SQLite files of a ROS 2 bag."""

    open_ended = True

    def __init__(self, file: Path, settings: LogFormat, parts: Sequence[Path]) -> None:
        self.file = file
        self.notes: list[str] = []
        self._parts = parts
        self._unknown: list[str] = []
        lister = FieldLister()
        for received in self._messages():
            lister.add(received)
        self.topics: list[Topic] = lister.topics()
        if not self.topics:
            said = "; ".join([*self._unknown, *self.notes])
            raise InputError(
                f"{file}: no messages that can be read{f' ({said})' if said else ''}; expected at least one"
            )
        self.notes.clear()

    def _messages(self) -> Iterator[Received]:
        for part in self._parts:
            yield from self._of(part)

    def _of(self, part: Path) -> Iterator[Received]:
        with _whole_pages(part) as readable:
            yield from self._of_whole_pages(part, readable)

    def _of_whole_pages(self, part: Path, readable: Path) -> Iterator[Received]:
        connection = _connect(readable)
        kept, cut = 0, ""
        try:
            topics = self._topics(part, connection)
            # by row: the index of times may lie in a part that is lost
            rows = connection.execute("SELECT topic_id, timestamp, data FROM messages NOT INDEXED ORDER BY id")
            while True:
                try:
                    row = rows.fetchone()
                except sqlite3.DatabaseError as error:
                    cut = str(error)
                    break
                if row is None:
                    break
                kept += 1
                name, decode = topics.get(row[0], ("", None))
                if decode is not None:
                    yield Received(name, row[1], row[1], self._late(decode, row[2]))
        except sqlite3.DatabaseError as error:
            raise InputError(
                f"{part}: not a ROS 2 bag that SQLite can read ({error}); copy the file again, or try "
                "`sqlite3 FILE .recover`"
            ) from None
        finally:
            connection.close()
        if cut or _is_short(part):
            kept_words = f"{counted(kept, 'message')} {are(kept)} kept"
            self.notes.append(f"{part}: the file is cut off ({cut or 'pages are missing'}); {kept_words}")

    def _topics(self, part: Path, connection: sqlite3.Connection) -> dict[int, tuple[str, Any]]:
        definitions: dict[str, tuple[str, str]] = {}
        tables = {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"topics", "messages"} <= tables:
            raise InputError(f"{part}: no tables of topics and messages; expected a ROS 2 bag")
        if "message_definitions" in tables:
            for name, encoding, text in connection.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            ):
                definitions[name] = (text, encoding)
        types = Ros2Types(self.file)
        found = {}
        for key, name, kind, form in connection.execute("SELECT id, name, type, serialization_format FROM topics"):
            decode = types.decoder(kind, *definitions.get(kind, ("", ""))) if form == "cdr" else None
            if decode is None:
                self._unknown.append(f"{name}: no definition of {kind}")
            found[key] = (name, decode)
        return found

    def _late(self, decode: Any, data: bytes) -> Any:
        def decoded() -> Any:
            if data[:4] == ZSTD_MARK:
                return decode(require_extra("zstandard", str(self.file)).ZstdDecompressor().decompress(data))
            return decode(data)

        return decoded

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read fields; see `log.Log`."""
        self.notes.clear()
        collector = Collector(wanted)
        yield from collector.blocks(self._messages())
        self.notes.extend(collector.notes(self.file))


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


def _is_short(part: Path) -> bool:
    """Return whether a file has fewer pages than its head states."""
    page, count = _pages(part)
    return count * page > part.stat().st_size


def _pages(part: Path) -> tuple[int, int]:
    """Return the size of a page, 0 if the file has no head, and the number of pages that the head states."""
    with open(part, "rb") as raw:
        head = raw.read(32)
    if len(head) < 32 or not head.startswith(b"SQLite format 3"):
        return 0, 0
    size = int.from_bytes(head[16:18], "big")
    return 65536 if size == 1 else size, int.from_bytes(head[28:32], "big")
