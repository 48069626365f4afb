"""How MCAP files are read: ROS 2 messages (CDR), JSON and Protobuf. A file that was cut off is read up to its end."""

from __future__ import annotations

import importlib
import io
import json
import struct
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted, require_extra
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.messages import Decoder, MessageLog, Received, Ros2Types

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

    def __iter__(self) -> Iterator[Any]:
        """Yield records of the package mcap: Schema, Channel and Message."""
        stream = require_extra("mcap.stream_reader", str(self.file))
        errors = require_extra("mcap.exceptions", str(self.file))
        with open(self.file, "rb") as raw:
            if raw.read(len(MAGIC)) != MAGIC:
                raise InputError(f"{self.file}: not an MCAP file; expected one that begins with its mark")
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
                raise InputError(f"{self.file}: {error}; expected compression by zstd, lz4 or none") from None
            except errors.EndOfFile:
                self.cut = "the file is cut off"
                raw.seek(at)
                with suppress(Exception):  # of what is left of the last chunk, all errors mean its end
                    for record in stream.StreamReader(_begin_of_chunk(raw.read()), skip_magic=True).records:
                        if type(record).__name__ in RECORDS:
                            yield record
            except Exception as error:  # of zstd, lz4, checksums and records
                self.cut = f"a block is damaged ({error})"


def _begin_of_chunk(record: bytes) -> io.BytesIO:
    """Return the records in a chunk that is cut off: its compression is a stream."""
    opcode, _, _, _, _, _, length = CHUNK.unpack_from(record)
    compression, data = record[CHUNK.size :][:length], record[CHUNK.size + length + 8 :]
    if compression:
        module = importlib.import_module("zstandard" if compression == b"zstd" else "lz4.frame")
        stream = module.ZstdDecompressor().decompressobj() if compression == b"zstd" else module.LZ4FrameDecompressor()
        data = stream.decompress(data)
    return io.BytesIO(data if opcode == CHUNK_CODE else b"")
