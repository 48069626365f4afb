"""A trend: dated recordings of a finger in numpy, the friction of one edge higher from each to the next."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from evidence.cases import write
from evidence.change.simulated import NONE, SECONDS, How, fitted, record, scaled
from evidence.diagnosis.case import run_command
from evidence.part import Figures, Part

DAYS = ("2026-03-01", "2026-03-08", "2026-03-15", "2026-03-22", "2026-04-05", "2026-04-12")
GROWTH = 0.06  # of the friction of tendon 5's edge at joint 1, from one recording to the next
JOINT, TENDON = 1, 5


def measure(folder: Path, workers: int) -> Figures:
    """What `tendonfmu diagnose --history` says of the recordings."""
    for k, day in enumerate(DAYS):
        difference = scaled("SHARE", 1.0 + GROWTH * k, TENDON - 1, JOINT - 1) if k else NONE
        recording, _ = record("maxwell", difference, How(motion=100 + k, noise=200 + k, seconds=SECONDS))
        recording.to_parquet(folder / f"{day}.parquet", index=False)
        if not k:
            write(folder / "finger.json", fitted("maxwell", recording))
    files = [f"{day}.parquet" for day in DAYS]
    run_command(["diagnose", "finger.json", *files, "--history", "-o", "out", "--jobs", str(workers)], folder)
    return figures_of(pd.read_csv(folder / "out" / "history.csv"))


def figures_of(history: pd.DataFrame) -> Figures:
    """The edge's size by recording, in % of the first one; how often it is named, and other names."""
    is_edge = (history["effect"] == "edge_friction") & (history["joint"] == JOINT) & (history["tendon"] == TENDON)
    edge, named = history[is_edge], history["named"].astype(bool)
    rows: list[dict[str, Any]] = [
        {"recording": str(row.recording), "named": bool(row.named)}
        | {"percent": [round(100.0 * (size / row.reference - 1.0), 1) for size in (row.now, row.now_low, row.now_high)]}
        for row in edge.itertuples()
    ]
    return {
        "named": sum(row["named"] for row in rows),
        "of": len(rows),
        "others": int((named & ~is_edge).sum()),
        "edge": rows,
    }


PART = Part(run=measure, minutes=4.0, headlines={"named": (4, 5), "others": (0, 0)})
