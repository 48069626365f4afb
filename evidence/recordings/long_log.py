"""Time and memory of `convert table` for long CSV logs.

python -m evidence.recordings.long_log --rows 1e5 1e6 1e7 -o long_log.md
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from evidence import tables
from evidence.runner import parser, publish

BLOCK = 1_000_000
MAP = {
    "format": "tendonfmu-map-1",
    "columns": {
        "time": {"column": "t_ms", "unit": "ms"},
        **{f"tendon_force[{i}]": {"column": f"F{i}", "unit": "N"} for i in (1, 2)},
        **{f"tendon_position[{i}]": {"column": f"x{i}", "unit": "mm"} for i in (1, 2)},
    },
}
CONVERT = """
import re, resource, sys
from tendonfmu.cli import main
sys.argv = ["tendonfmu", "convert", "table", "log.csv", "--map", "map.json", "-o", "rec.parquet"]
try:
    main()
finally:
    if sys.platform == "linux":  # here getrusage counts what the parent had before it started this program
        print(re.search(r"VmHWM:\\s*(\\d+)", open("/proc/self/status").read())[1])
    else:
        print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def write_log(file: Path, rows: int) -> None:
    """Rows at 1 kHz of two tendons, with 4 decimals."""
    with open(file, "wb") as out:
        for start in range(0, rows, BLOCK):
            t = np.arange(start, min(start + BLOCK, rows))
            q = np.sin(t / 700.0)
            columns = dict(zip(("F1", "F2", "x1", "x2"), (10 + q, 10 - q, 9 * q, -9 * q), strict=True))
            table = pa.table({"t_ms": t, **{name: np.round(values, 4) for name, values in columns.items()}})
            csv.write_csv(table, out, csv.WriteOptions(include_header=not start))


def converted(rows: int) -> list[str]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_log(folder / "log.csv", rows)
        (folder / "map.json").write_text(json.dumps(MAP), encoding="utf-8")
        begin = time.monotonic()
        done = subprocess.run([sys.executable, "-c", CONVERT], cwd=folder, capture_output=True, text=True, check=True)
        seconds = time.monotonic() - begin
        sizes = [(folder / file).stat().st_size / 1e6 for file in ("log.csv", "rec.parquet")]
    memory = int(done.stdout.split()[-1]) / (1e6 if sys.platform == "darwin" else 1e3)
    return [f"{rows:.0e}", f"{sizes[0]:.0f}", f"{sizes[1]:.1f}", f"{seconds:.1f}", f"{memory:.0f}"]


def main() -> None:
    options = parser(__doc__, output=None)
    options.add_argument("--rows", type=float, nargs="+", default=[1e5, 1e6, 1e7])
    options.add_argument("-o", "--output", type=Path, required=True, help="file of the table")
    given = options.parse_args()
    head = ["rows", "CSV, MB", "Parquet, MB", "time, s", "largest memory, MB"]
    publish(given.output, tables.table(head, map(converted, map(int, given.rows)), 0) + "\n")


if __name__ == "__main__":
    main()
