"""Write the demo recording as somebody's own logger would have: other names, ms and mm, `;` and decimal commas.

python examples/logs/make_log.py my_log.csv
"""

from __future__ import annotations

import sys
from pathlib import Path

import pyarrow.parquet as pq

RECORDING = Path(__file__).parents[1] / "demo_recording" / "two_joints_training.parquet"


def main(file: Path) -> None:
    columns = pq.read_table(RECORDING).to_pydict()
    tendons = sum(name.startswith("tendon_force[") for name in columns)
    signals = {"t_ms": [f"{1000 * value:.3f}" for value in columns["time"]]}
    for i in range(1, tendons + 1):
        signals[f"tension{i}"] = [f"{value:.6f}" for value in columns[f"tendon_force[{i}]"]]
        signals[f"spool{i}_mm"] = [f"{1000 * value:.7f}" for value in columns[f"tendon_position[{i}]"]]
    signals["board_temp"] = ["31.5"] * len(columns["time"])
    with open(file, "w", encoding="utf-8") as out:
        out.write("# hand logger 2.1\n" + ";".join(signals) + "\n")
        for row in zip(*signals.values(), strict=True):
            out.write(";".join(row).replace(".", ",") + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
