"""Which logs does `convert table` read, recover or refuse, and what do long ones take?"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from evidence import table
from evidence.part import Figures, Part
from made_logs import FAULTS, FORMATS, ROWS, Format, content_of, converted, cut_at, sound, write

CUTS = 60  # places at which a log is cut off


def faults(folder: Path, workers: int) -> Figures:
    """What becomes of every fault in every format, and of logs that are cut off."""
    lines, ends = [], []
    for fault, (spoil, log) in FAULTS.items():
        results = [converted(write(folder, form, spoil(sound())), form.map(**log)) for form in FORMATS.values()]
        rows = [0 if result.columns is None else len(result.columns["time"]) for result in results]
        same = {(result.name, kept) for result, kept in zip(results, rows, strict=True)}
        ends += [result.name for result in results]
        # CSV is the first format, and the others say the same of their own columns
        words = ", ".join(f"{name}, {kept} rows kept" if kept else name for name, kept in sorted(same))
        lines.append([fault, words, results[0].words.split(";")[0] or table.NOTHING])
    cut = [[name, *cuts(folder, form)] for name, form in FORMATS.items()]
    return {
        "logs": len(ends),
        "ends": {name: ends.count(name) for name in sorted(set(ends))},
        "recovered_from_half": sum(cells[3] != "refused" for cells in cut),
        "lines": lines,
        "cut": cut,
    }


def cuts(folder: Path, form: Format) -> list[str]:
    """Bytes, rows left at quarters of them, and how many of all places are refused."""
    file = write(folder, form, sound())
    content = content_of(file, form)
    rows = []
    for k in range(CUTS):
        cut_at(file, form, content, len(content) * k // CUTS)
        columns = converted(file, form.map()).columns
        rows.append("refused" if columns is None else str(len(columns["time"])))
    return [str(len(content)), *(rows[CUTS * k // 4] for k in (1, 2, 3)), f"{rows.count('refused')} of {CUTS}"]


# --- long logs --------------------------------------------------------------------------------------------------------

LENGTHS = (100_000, 1_000_000, 10_000_000)  # rows
BLOCK = 1_000_000
MAP = {
    "format": "tendonfmu-map-1",
    "columns": {
        "time": {"column": "t_ms", "unit": "ms"},
        **{f"tendon_force[{i}]": {"column": f"F{i}", "unit": "N"} for i in (1, 2)},
        **{f"tendon_position[{i}]": {"column": f"x{i}", "unit": "mm"} for i in (1, 2)},
    },
}
# VmHWM and not getrusage, which counts what the parent had before it started this program.
CONVERT = """
import re, sys
from tendonfmu.cli import main
sys.argv = ["tendonfmu", "convert", "table", "log.csv", "--map", "map.json", "-o", "rec.parquet"]
try:
    main()
finally:
    print(re.search(r"VmHWM:\\s*(\\d+)", open("/proc/self/status").read())[1])
"""


def long(folder: Path, workers: int) -> Figures:
    lines = [[f"{rows:.0e}", *map("{:.4g}".format, convert_long(folder, rows))] for rows in LENGTHS]
    memory = [float(cells[-1]) for cells in lines]
    return {"lines": lines, "memory_growth": memory[-1] / memory[-2]}


def convert_long(folder: Path, rows: int) -> list[float]:
    """MB of the CSV log and of the recording, s, MB of memory at most."""
    write_long(folder / "log.csv", rows)
    (folder / "map.json").write_text(json.dumps(MAP), encoding="utf-8")
    begin = time.monotonic()
    done = subprocess.run([sys.executable, "-c", CONVERT], cwd=folder, capture_output=True, text=True, check=True)
    seconds = time.monotonic() - begin
    sizes = [(folder / file).stat().st_size / 1e6 for file in ("log.csv", "rec.parquet")]
    return [*sizes, seconds, int(done.stdout.split()[-1]) / 1e3]


def write_long(file: Path, rows: int) -> None:
    """Rows at 1 kHz of two tendons, with 4 decimals."""
    with open(file, "wb") as out:
        for start in range(0, rows, BLOCK):
            t = np.arange(start, min(start + BLOCK, rows))
            q = np.sin(t / 700.0)
            columns = dict(zip(("F1", "F2", "x1", "x2"), (10 + q, 10 - q, 9 * q, -9 * q), strict=True))
            log = pa.table({"t_ms": t, **{name: np.round(values, 4) for name, values in columns.items()}})
            csv.write_csv(log, out, csv.WriteOptions(include_header=not start))


PARTS = {
    "faults": Part(
        faults,
        minutes=0.3,
        needs=("h5py", "mcap", "mcap_protobuf", "rosbags"),
        headlines={
            "ends.read": (16, 16),
            "ends.recovered": (48, 48),
            "ends.refused": (64, 64),
            "ends.warned": (16, 16),
            "recovered_from_half": (11, 11),
        },
        tables={
            "faults": table.of_cells("lines", ["fault", "all 16 formats", "what the user reads (CSV)"], 3),
            "cut": table.of_cells(
                "cut", ["format", "bytes", f"rows of {ROWS} left at 1/4", "at 1/2", "at 3/4", "refused"]
            ),
        },
    ),
    "long": Part(
        long,
        minutes=0.3,
        headlines={"memory_growth": (0.9, 1.1)},
        tables={"memory": table.of_cells("lines", ["rows", "CSV, MB", "Parquet, MB", "time, s", "memory, MB"], 0)},
    ),
}
