"""How a table becomes an MCAP file that PlotJuggler and Foxglove open: one topic, a JSON message for each row.

The schema (JSON Schema) names each column, so that viewers offer them before any message is read. Column names are the
names of fields: `/tendonfmu/joint_torque[1]` in PlotJuggler.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files.extras import require_extra

TOPIC = "/tendonfmu"
SCHEMA = "tendonfmu.Table"
TIME = "time"
NANOSECONDS = 1e9
LATEST = 2**63  # ns; readers take times as signed 64-bit integers


def write_mcap(file: Path, blocks: Iterable[Mapping[str, NDArray[Any]]]) -> None:
    """Write a table."""
    # blocks: [N]
    writer_of = require_extra("mcap.writer", str(file))
    with open(file, "wb") as raw:
        writer = writer_of.Writer(raw)
        writer.start(profile="", library="tendonfmu")
        channel, count = -1, 0
        for columns in blocks:
            if channel < 0:
                channel = _add_channel(file, writer, columns)
            times = _nanoseconds(file, columns[TIME])
            rows = zip(*(column.tolist() for column in columns.values()), strict=True)
            for at, row in zip(times, rows, strict=True):
                text = json.dumps(dict(zip(columns, row, strict=True)), separators=(",", ":"), allow_nan=False)
                writer.add_message(channel, at, text.encode(), at, count)
                count += 1
        writer.finish()


def _add_channel(file: Path, writer: Any, columns: Mapping[str, NDArray[Any]]) -> int:
    if TIME not in columns:
        raise InputError(f"{file}: no column {TIME}; expected one, which gives the times of MCAP's messages")
    properties = {
        name: {"type": "integer" if column.dtype.kind in "iu" else "number"} for name, column in columns.items()
    }
    schema = {"title": SCHEMA, "type": "object", "properties": properties}
    number = writer.register_schema(SCHEMA, "jsonschema", json.dumps(schema).encode())
    return int(writer.register_channel(TOPIC, "json", number))


def _nanoseconds(file: Path, time: NDArray[Any]) -> list[int]:
    stamps = np.round(np.asarray(time, dtype=np.float64) * NANOSECONDS)
    if len(stamps) and not (stamps.min() >= 0.0 and stamps.max() < LATEST):
        raise InputError(
            f"{file}: time {float(time[int(np.argmin(stamps))]):g} to {float(time[int(np.argmax(stamps))]):g} s; "
            "MCAP holds times from 0 s on, expected those, or .csv or .parquet"
        )
    return [int(stamp) for stamp in stamps]
