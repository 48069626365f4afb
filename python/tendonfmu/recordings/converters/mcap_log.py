"""How MCAP files are read: ROS 2 messages (CDR), JSON and Protobuf. A file that was cut off is read up to its end."""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted, require_extra
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.messages import Decoder, MessageLog, Received, Ros2Types

MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 0x03, 0x04, 0x05, 0x06, 0x0F
HEAD = struct.Struct("<BQ")  # opcode, length
CHUNK_HEAD = struct.Struct("<QQQII")  # first and last time, uncompressed size, checksum, length of compression's name
LARGEST = 1 << 32  # bytes of a record
PIECE = 1 << 16  # bytes


class McapLog(MessageLog):
    """MCAP files, one after the other."""

    def __init__(self, file: Path, settings: LogFormat, parts: Sequence[Path] | None = None) -> None:
        super().__init__(file, [file] if parts is None else parts)

    def messages_of(self, part: Path) -> Iterator[Received]:
        """Yield the messages of one file."""
        schemas: dict[int, Any] = {}
        channels: dict[int, tuple[str, Decoder | None]] = {}
        types = Ros2Types(self.file)
        records = McapRecords(part)
        kept = 0
        for record in records:
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
        if records.cut:
            self.notes.append(f"{part}: {records.cut}; {counted(kept, 'message')} {are(kept)} kept")

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


def _decode_protobuf(decode: Decoder, data: bytes) -> Any:
    try:
        return decode(data)
    except Exception as error:  # google.protobuf has errors of its own
        raise ValueError(str(error)) from None


class McapRecords:
    """The schemas, channels and messages of an MCAP file in its order, also of one that was cut off."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.cut = ""  # why the file ends early
        self._records = require_extra("mcap.records", str(file))
        self._stream = require_extra("mcap.data_stream", str(file)).ReadDataStream

    def __iter__(self) -> Iterator[Any]:
        """Yield records of the package mcap: Schema, Channel and Message."""
        with open(self.file, "rb") as raw:
            if raw.read(len(MAGIC)) != MAGIC:
                raise InputError(f"{self.file}: not an MCAP file; expected one that begins with its mark")
            yield from self._in(raw, at_top=True)

    def _in(self, raw: BinaryIO, at_top: bool) -> Iterator[Any]:
        """Yield the records of a file, or of a chunk."""
        while head := raw.read(HEAD.size):
            if len(head) < HEAD.size:
                break
            opcode, length = HEAD.unpack(head)
            if opcode == DATA_END:
                return
            if length > LARGEST:
                self.cut = f"a record of {length} bytes at byte {raw.tell() - HEAD.size}: the file is damaged there"
                return
            content = raw.read(length)
            if len(content) < length:
                self.cut = "the file is cut off"
                if opcode == CHUNK:
                    yield from self._begin_of_chunk(content)
                return
            if opcode == CHUNK:
                yield from self._chunk(content)
                if self.cut:
                    return
            elif opcode in (SCHEMA, CHANNEL, MESSAGE):
                yield self._read(opcode, content)
        if at_top:
            self.cut = self.cut or "the file is cut off"

    def _read(self, opcode: int, content: bytes) -> Any:
        stream = self._stream(io.BytesIO(content))
        if opcode == SCHEMA:
            return self._records.Schema.read(stream)
        if opcode == CHANNEL:
            return self._records.Channel.read(stream)
        return self._records.Message.read(stream, len(content))

    def _chunk(self, content: bytes) -> Iterator[Any]:
        size, checksum, compression, data = _chunk_parts(content)
        plain = self._decompressed(compression, data)
        if len(plain) < size or (checksum and zlib.crc32(plain) != checksum):
            self.cut = "a block is damaged"
            return
        yield from self._in(io.BytesIO(plain), at_top=False)

    def _begin_of_chunk(self, content: bytes) -> Iterator[Any]:
        """Yield the whole messages of a chunk that is cut off: its compression is a stream."""
        try:
            _, _, compression, data = _chunk_parts(content)
        except (struct.error, UnicodeDecodeError):
            return
        yield from self._in(io.BytesIO(self._decompressed(compression, data)), at_top=False)

    def _decompressed(self, compression: str, data: bytes) -> bytes:
        """Return as much as the data give."""
        if compression not in ("", "zstd", "lz4"):
            raise InputError(f"{self.file}: compression {compression!r} is not known; expected zstd, lz4 or none")
        if not compression:
            return data
        module = require_extra("zstandard" if compression == "zstd" else "lz4.frame", str(self.file))
        stream = module.ZstdDecompressor().decompressobj() if compression == "zstd" else module.LZ4FrameDecompressor()
        damage: type[Exception] = module.ZstdError if compression == "zstd" else RuntimeError
        plain = b""
        try:
            # in small pieces: of a damaged piece nothing comes back
            for at in range(0, len(data), PIECE):
                if getattr(stream, "eof", False):
                    break
                plain += stream.decompress(data[at : at + PIECE])
        except damage:
            pass
        return plain


def _chunk_parts(content: bytes) -> tuple[int, int, str, bytes]:
    """Return uncompressed size, checksum, compression and data of a chunk."""
    _, _, size, checksum, length = CHUNK_HEAD.unpack_from(content)
    at = CHUNK_HEAD.size + length
    return size, checksum, content[CHUNK_HEAD.size : at].decode(), content[at + 8 :]
