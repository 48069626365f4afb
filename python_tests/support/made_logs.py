"""Logs of every format with every fault, by the formats' own libraries, and what `convert table` makes of them."""

from __future__ import annotations

import gzip
import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.table import convert_table

ROWS = 200
START = 1_700_000_000_000_000_000  # ns
TYPE = "hand_msgs/msg/Tendon"
DEFINITION = "std_msgs/Header header\nfloat64 force\nfloat64 spool\n"

Table = dict[str, Any]


def sound() -> Table:
    """Time in ms (whole), force in N, spool in mm."""
    t = np.arange(ROWS)
    return {"t": 5 * t, "force": np.round(10 + 3 * np.sin(t / 9), 6), "spool": np.round(4 * np.cos(t / 7), 6)}


def truth(table: Table | None = None) -> dict[str, Any]:
    """The recording of a sound log."""
    log = table or sound()
    return {
        "time": (log["t"] - log["t"][0]) / 1000.0,
        "tendon_force[1]": log["force"],
        "tendon_position[1]": log["spool"] / 1000.0,
    }


# --- formats ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Format:
    """A format: its file, how it is written, and its names."""

    file: str
    write: Callable[[Path, Table], None]
    time: dict[str, Any]
    force: str = "force"
    spool: str = "spool"
    log: dict[str, Any] = field(default_factory=dict)
    cut: str = ""  # file inside a folder
    recovers: bool = True  # from a cut

    def map(self, **log: Any) -> dict[str, Any]:
        columns = {
            "time": self.time,
            "tendon_force[1]": {"column": self.force, "unit": "N"},
            "tendon_position[1]": {"column": self.spool, "unit": "mm"},
        }
        return {"format": "tendonfmu-map-1", "log": {**self.log, **log}, "columns": columns}


def text(separator: str = ",", decimal: str = ".", before: str = "", encoding: str = "utf-8", units: str = "") -> Any:
    def write(file: Path, table: Table) -> None:
        rows = zip(*(table[name].tolist() for name in table), strict=True)
        lines = [separator.join("" if v != v else repr(v).replace(".", decimal) for v in row) for row in rows]
        content = (before + "\n".join([separator.join(table), *([units] if units else []), *lines]) + "\n").encode(
            encoding
        )
        file.write_bytes(gzip.compress(content) if file.suffix == ".gz" else content)

    return write


def parquet(file: Path, table: Table) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(table), file, row_group_size=64)


def matlab(file: Path, table: Table) -> None:
    from scipy import io

    io.savemat(file, {"log": {name: values[:, None] for name, values in table.items()}, "name": "a finger"})


def matlab_73(file: Path, table: Table) -> None:
    """As MATLAB writes it: HDF5 behind a block of 512 bytes, matrices by columns."""
    import h5py

    with h5py.File(file, "w", userblock_size=512) as h5:
        group = h5.create_group("log")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in table.items():
            group.create_dataset(name, data=np.asarray(values, dtype=float)[None, :])
            group[name].attrs["MATLAB_class"] = np.bytes_("double")
    with open(file, "r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def hdf5(file: Path, table: Table) -> None:
    import h5py

    with h5py.File(file, "w") as h5:
        for name, values in table.items():
            h5.create_dataset(f"log/{name}", data=values, chunks=(32,), compression="gzip")


def ros_store() -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.LATEST)
    store.register(get_types_from_msg(DEFINITION, TYPE))
    return store


def header(store: Any, ns: int) -> Any:
    stamp = store.types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="hand")


def cdr(table: Table) -> list[tuple[int, bytes]]:
    """(ns of the recorder, message) of each row."""
    store = ros_store()
    made: list[tuple[int, bytes]] = []
    for t, force, spool in zip(*(table[name].tolist() for name in ("t", "force", "spool")), strict=True):
        message = store.types[TYPE](header=header(store, START + 1_000_000 * t), force=force, spool=spool)
        made.append((START + 5_000_000 * len(made), bytes(store.serialize_cdr(message, TYPE))))
    return made


def bag(plugin: str) -> Any:
    def write(folder: Path, table: Table) -> None:
        from rosbags.rosbag2 import StoragePlugin, Writer

        with Writer(folder, version=9, storage_plugin=StoragePlugin[plugin]) as out:
            connection = out.add_connection("/hand", TYPE, typestore=ros_store())
            for ns, data in cdr(table):
                out.write(connection, ns, data)

    return write


def mcap_cdr(compression: str) -> Any:
    def write(file: Path, table: Table) -> None:
        from mcap.writer import CompressionType, Writer

        definition, _ = ros_store().generate_msgdef(TYPE, ros_version=2)
        with open(file, "wb") as raw:
            writer: Any = Writer(raw, chunk_size=2048, compression=CompressionType[compression])
            writer.start(profile="ros2")
            schema = writer.register_schema(TYPE, "ros2msg", definition.encode())
            channel = writer.register_channel("/hand", "cdr", schema)
            for k, (ns, data) in enumerate(cdr(table)):
                writer.add_message(channel, ns, data, ns, k)
            writer.finish()

    return write


def mcap_json(file: Path, table: Table) -> None:
    rows = zip(*(values.tolist() for values in table.values()), strict=True)
    messages = [
        {name: None if value != value else value for name, value in zip(table, row, strict=True)} for row in rows
    ]
    json_messages(file, "/hand", messages, step=1)


def json_messages(file: Path, topic: str, messages: Sequence[Mapping[str, Any]], step: int = 5_000_000) -> Path:
    """Write messages to an MCAP file, one every so many ns."""
    from mcap.writer import Writer

    with open(file, "wb") as raw:
        writer: Any = Writer(raw, chunk_size=2048)
        writer.start()
        schema = writer.register_schema("Tendon", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel(topic, "json", schema)
        for k, message in enumerate(messages):
            writer.add_message(channel, START + step * k, json.dumps(message).encode(), START + step * k, k)
        writer.finish()
    return file


def mcap_protobuf(file: Path, table: Table) -> None:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    from mcap_protobuf.writer import Writer

    described = descriptor_pb2.FileDescriptorProto(name="tendon.proto", package="hand", syntax="proto3")
    message = described.message_type.add(name="Tendon")
    kinds = descriptor_pb2.FieldDescriptorProto
    for number, name in enumerate(("t", "force", "spool"), start=1):
        message.field.add(name=name, number=number, type=kinds.TYPE_DOUBLE, label=kinds.LABEL_OPTIONAL)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(described)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName("hand.Tendon"))
    with open(file, "wb") as raw, Writer(raw, chunk_size=2048) as writer:
        for k, row in enumerate(zip(*(values.tolist() for values in table.values()), strict=True)):
            writer.write_message("/hand", kind(**dict(zip(table, row, strict=True))), START + k, START + k)


PLAIN: dict[str, Any] = {"column": "t", "unit": "ms"}
STAMP = {"column": "/hand.header.stamp", "unit": "datetime"}
ROS: dict[str, Any] = {"time": STAMP, "force": "/hand.force", "spool": "/hand.spool"}
MESSAGE: dict[str, Any] = {"time": {"column": "/hand.t", "unit": "ms"}, "force": "/hand.force", "spool": "/hand.spool"}
STRUCT: dict[str, Any] = {"time": {"column": "log.t", "unit": "ms"}, "force": "log.force", "spool": "log.spool"}
GROUP: dict[str, Any] = {"time": {"column": "/log/t", "unit": "ms"}, "force": "/log/force", "spool": "/log/spool"}
NOTES = "# Logger 3\n# made by hand\n\n"

FORMATS = {
    "CSV": Format("log.csv", text(), PLAIN),
    "CSV ; and decimal comma": Format("log.txt", text(";", ","), PLAIN),
    "CSV, comments, units, UTF-16": Format("log.tsv", text("\t", ".", NOTES, "utf-16", "ms\tN\tmm"), PLAIN),
    "CSV, latin-1": Format("log.dat", text(",", ".", "# Prüfstand µ\n", "latin-1"), PLAIN),
    "CSV in gzip": Format("log.csv.gz", text(), PLAIN),
    "Parquet": Format("log.parquet", parquet, PLAIN, recovers=False),
    "MATLAB 5": Format("log.mat", matlab, **STRUCT, recovers=False),
    "MATLAB 7.3": Format("log.mat", matlab_73, **STRUCT, recovers=False),
    "HDF5": Format("log.h5", hdf5, **GROUP, recovers=False),
    "MCAP, ROS 2, zstd": Format("log.mcap", mcap_cdr("ZSTD"), **ROS),
    "MCAP, ROS 2, lz4": Format("log.mcap", mcap_cdr("LZ4"), **ROS),
    "MCAP, ROS 2, plain": Format("log.mcap", mcap_cdr("NONE"), **ROS),
    "MCAP, JSON": Format("log.mcap", mcap_json, **MESSAGE),
    "MCAP, Protobuf": Format("log.mcap", mcap_protobuf, **MESSAGE),
    "ROS 2 bag, db3": Format("bag", bag("SQLITE3"), **ROS, cut="bag.db3"),
    "ROS 2 bag, MCAP": Format("bag", bag("MCAP"), **ROS, cut="bag.mcap"),
}

# --- faults -----------------------------------------------------------------------------------------------------------


def shuffled(table: Table) -> Table:
    order = np.random.default_rng(1).permutation(ROWS)
    return {name: values[order] for name, values in table.items()}


def with_nan(table: Table) -> Table:
    force = table["force"].copy()
    force[[4, 77]] = np.nan
    return {**table, "force": force}


def repeated(table: Table) -> Table:
    order = np.sort(np.r_[np.arange(ROWS), [50, 51, 120]])
    return {name: values[order] for name, values in table.items()}


def going_back(table: Table) -> Table:
    t = table["t"].copy()
    t[100:] -= 200
    return {**table, "t": t}


def in_metres(table: Table) -> Table:
    """A spool in tenths of micrometres, which the map takes for mm."""
    return {**table, "spool": table["spool"] * 1e4}


# name: (what happens to the rows, what is added to `log` of the map)
FAULTS: dict[str, tuple[Callable[[Table], Table], dict[str, Any]]] = {
    "none": (lambda table: table, {}),
    "shuffled": (shuffled, {}),
    "shuffled, to be sorted": (shuffled, {"disorder": "sort"}),
    "NaN": (with_nan, {}),
    "NaN, to be left out": (with_nan, {"missing": "leave out"}),
    "repeated times": (repeated, {}),
    "repeated times, to be sorted": (repeated, {"disorder": "sort"}),
    "time goes back": (going_back, {}),
    "implausible unit": (in_metres, {}),
}


@dataclass(frozen=True)
class Outcome:
    """What became of a log."""

    columns: dict[str, Any] | None
    words: str  # notes, or the refusal

    @property
    def name(self) -> str:
        if self.columns is None:
            return "refused"
        return "read" if not self.words else "warned" if "warning" in self.words else "recovered"


def write(folder: Path, form: Format, table: Table) -> Path:
    file = folder / form.file
    if file.is_dir():
        shutil.rmtree(file)
    form.write(file, table)
    return file


def converted(file: Path, document: dict[str, Any]) -> Outcome:
    """Convert a log in a folder; any error but InputError is a fault of the product."""
    map_file = file.parent / "map.json"
    map_file.write_text(json.dumps(document), encoding="utf-8")
    try:
        log = convert_table(file, map_file)
    except InputError as refused:
        return Outcome(None, str(refused).replace(str(file.parent) + "/", ""))
    notes = [note for note in log.notes if "latin-1" not in note]
    return Outcome(log.columns, "; ".join(notes).replace(str(file.parent) + "/", ""))


def cut_at(file: Path, form: Format, content: bytes, size: int) -> None:
    """Cut the log after some bytes of its content. A recorder that is killed leaves no metadata."""
    if form.cut:
        (file / "metadata.yaml").unlink(missing_ok=True)
    (file / form.cut if form.cut else file).write_bytes(content[:size])


def content_of(file: Path, form: Format) -> bytes:
    return (file / form.cut if form.cut else file).read_bytes()
