"""Logs as libraries of Python write them: numpy, Arrow, pandas and JSON, with lists, structs and durations."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pyarrow import feather

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.inspection import inspect_log
from tendonfmu.recordings.converters.proposal import propose
from tendonfmu.recordings.converters.table import convert_table

T = np.arange(300) / 500.0
FORCE = np.column_stack([9.0 + np.cos(7.0 * T), 8.0 + np.sin(5.0 * T)])
SPOOL = 0.004 * np.column_stack([np.sin(6.0 * T), np.cos(6.0 * T)])


def nested() -> pa.Table:
    """A duration, lists of variable and of fixed length, and a struct of numbers."""
    clock = pa.array(np.round(1e6 * T).astype(np.int64), pa.duration("us"))
    fixed = pa.FixedSizeListArray.from_arrays(pa.array(FORCE.ravel()), 2)
    spool = pa.StructArray.from_arrays([pa.array(SPOOL[:, 0]), pa.array(SPOOL[:, 1])], ["a", "b"])
    return pa.table(
        {"time": clock, "tension": fixed, "spool": spool, "label": pa.array(["x"] * len(T)).dictionary_encode()}
    )


def npz(file: Path) -> None:
    np.savez(file, t=T, tendon_force=FORCE, spool=SPOOL, rate=500.0)


def lines(file: Path) -> None:
    rows = zip(T, FORCE.tolist(), SPOOL.tolist(), strict=True)
    file.write_text("".join(json.dumps({"t": t, "force": f, "motor": {"spool": s}}) + "\n" for t, f, s in rows))


def pandas_fixed(file: Path) -> None:
    """As DataFrame.to_hdf writes it by default."""
    import h5py

    with h5py.File(file, "w") as h5:
        frame = h5.create_group("df")
        frame.attrs["pandas_type"] = b"frame"
        frame["axis0"] = np.array([b"force1", b"force2", b"spool1", b"spool2", b"n"])
        frame["axis1"] = np.arange(len(T))
        frame["block0_items"] = np.array([b"t", b"force1", b"force2", b"spool1", b"spool2"])
        frame["block0_values"] = np.column_stack([T, FORCE, SPOOL])
        frame["block1_items"] = np.array([b"n"])
        frame["block1_values"] = np.arange(len(T))[:, None]


FILES: dict[str, Callable[[Path], Any]] = {
    "log.npz": npz,
    "log.jsonl": lines,
    "log.parquet": lambda file: pq.write_table(nested(), file),
    "log.feather": lambda file: feather.write_feather(nested(), str(file)),
    "log.h5": pandas_fixed,
}


@pytest.mark.parametrize("name", FILES)
def test_names_and_values(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    FILES[name](file)
    proposal = propose(inspect_log(file))
    assert not proposal.undecided
    (tmp_path / "map.json").write_text(json.dumps(proposal.document), encoding="utf-8")
    columns = convert_table(file, tmp_path / "map.json").columns
    assert columns["time"] == pytest.approx(T, abs=1e-9)
    for k in range(2):
        assert columns[f"tendon_force[{k + 1}]"] == pytest.approx(FORCE[:, k], rel=1e-12)
        assert columns[f"tendon_position[{k + 1}]"] == pytest.approx(SPOOL[:, k], rel=1e-12)
    assert "tendon_force[3]" not in columns


def test_what_cannot_be_read_is_refused_by_name(tmp_path: Path) -> None:
    uneven = pa.table({"t": T[:3], "force": pa.array([[1.0, 2.0], [1.0], [2.0, 3.0]])})
    pq.write_table(uneven, tmp_path / "log.parquet")
    with pytest.raises(InputError, match=r"column force\[2\], rows from 1 on: fewer elements"):
        inspect_log(tmp_path / "log.parquet")
    np.savez(tmp_path / "log.npz", x=np.array([{}, {}], dtype=object))
    with pytest.raises(InputError, match="not a whole file of numpy arrays"):
        inspect_log(tmp_path / "log.npz")
    (tmp_path / "log.jsonl").write_text('{"t": 1}\n{"t": ', encoding="utf-8")
    with pytest.raises(InputError, match="a JSON object in each line"):
        inspect_log(tmp_path / "log.jsonl")
