"""How MCAP files are read: ROS 2 messages (CDR), JSON and Protobuf. A file that was cut off is read up to its end."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from tendonfmu.errors import InputError
from tendonfmu.files import are, counted, require_extra
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.log import Block, Topic
from tendonfmu.recordings.converters.mcap_records import McapRecords
from tendonfmu.recordings.converters.messages import Collector, FieldLister, Received
from tendonfmu.recordings.converters.ros2_types import Ros2Types

Decoder = Callable[[bytes], Any]


class McapLog:
    """MCAP files, one after the other."""

    open_ended = True

    def __init__(self, file: Path, settings: LogFormat, parts: Sequence[Path] | None = None) -> None:
        self.file = file
        self.notes: list[str] = []
        self._parts = [file] if parts is None else parts
        self._unknown: dict[str, str] = {}
        lister = FieldLister()
        for received in self._messages():
            lister.add(received)
        self.topics: list[Topic] = lister.topics()
        if not self.topics:
            said = "; ".join([*self._unknown.values(), *self.notes])
            raise InputError(
                f"{file}: no messages that can be read{f' ({said})' if said else ''}; expected at least one"
            )
        self.notes.clear()

    def _messages(self) -> Iterator[Received]:
        for part in self._parts:
            yield from self._of(part)

    def _of(self, part: Path) -> Iterator[Received]:
        schemas: dict[int, Any] = {}
        channels: dict[int, tuple[str, Decoder] | None] = {}
        types = Ros2Types(self.file)
        records = McapRecords(part)
        kept = 0
        for record in records:
            kind = type(record).__name__
            if kind == "Schema":
                schemas[record.id] = record
            elif kind == "Channel":
                if record.id not in channels:
                    decode = self._decoder(record, schemas.get(record.schema_id), types)
                    channels[record.id] = None if decode is None else (record.topic, decode)
            else:
                kept += 1
                channel = channels.get(record.channel_id)
                if channel is not None:
                    yield Received(channel[0], record.log_time, record.publish_time, _late(channel[1], record.data))
        if records.cut:
            self.notes.append(f"{part}: {records.cut}; {counted(kept, 'message')} {are(kept)} kept")

    def _decoder(self, channel: Any, schema: Any, types: Ros2Types) -> Decoder | None:
        encoding = channel.message_encoding
        if encoding == "json":
            return _of_json
        if encoding == "cdr" and schema is not None:
            return types.decoder(schema.name, schema.data.decode("utf-8", "replace"), schema.encoding)
        if encoding == "protobuf" and schema is not None:
            factory = require_extra("mcap_protobuf.decoder", str(self.file)).DecoderFactory()
            found: Decoder | None = factory.decoder_for(encoding, schema)
            return None if found is None else _guarded(found)
        self._unknown[channel.topic] = f"{channel.topic}: messages in {encoding!r}"
        return None

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read fields; see `log.Log`."""
        self.notes.clear()
        collector = Collector(wanted)
        yield from collector.blocks(self._messages())
        self.notes.extend(collector.notes(self.file))


def _late(decode: Decoder, data: bytes) -> Callable[[], Any]:
    return lambda: decode(data)


def _of_json(data: bytes) -> Any:
    return json.loads(data)  # JSONDecodeError and UnicodeDecodeError are ValueErrors


def _guarded(decode: Decoder) -> Decoder:
    def guarded(data: bytes) -> Any:
        try:
            return decode(data)
        except Exception as error:  # google.protobuf has errors of its own
            raise ValueError(str(error)) from None

    return guarded
