"""Make the recordings of the two-joint finger that lacks something, and say what was hidden: see README.md.

Usage: python make_hidden.py [-o FOLDER]   (needs numpy, scipy and pyarrow; physics: ../../python_tests/hidden_effects)

The demo reads the description and the two recordings; what was hidden is in two_joints_hidden.json, which it does not
read and which the package does not have.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).parent
sys.path.append(str(HERE.parents[1] / "python_tests" / "hidden_effects"))

NAME = "two_joints"
RECORDINGS = {f"{NAME}_training": (3, 60.0), f"{NAME}_unseen": (4, 40.0)}  # seed of the motion, s
EFFECT, STRENGTH, SEED = "gravity", 10.0, 12
RATE = 500.0  # Hz
FORCE_STEP, POSITION_STEP = 1e-4, 1e-7  # N, m; of the sensors


def made() -> tuple[dict[str, Any], dict[str, dict[str, NDArray[Any]]], dict[str, Any]]:
    """The nominal description, the columns of each recording, and what is hidden in them."""
    from effects_hidden import hide
    from matched_rig import random_hand, record

    hand = random_hand(SEED, joints=2, presliding=True, source=1, rate=RATE)
    hand = replace(hand, noise=replace(hand.noise, tendon_step=POSITION_STEP))
    seed, seconds = RECORDINGS[f"{NAME}_training"]
    hand, label = hide(hand, EFFECT, STRENGTH, seed=SEED, motion=seed, seconds=seconds)
    recordings = {}
    for name, (seed, seconds) in RECORDINGS.items():
        columns = record(hand, seed=seed, seconds=seconds).columns
        recordings[name] = {key: as_sensed(key, values) for key, values in columns.items()}
    return {**hand.nominal, "name": NAME}, recordings, label


def as_sensed(name: str, values: NDArray[Any]) -> NDArray[Any]:
    """As it is written: forces in steps, everything but the time in single precision."""
    if name == "time":
        return values
    stepped = FORCE_STEP * np.round(values / FORCE_STEP) if name.startswith("tendon_force") else values
    return stepped.astype(np.float32)


def main() -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=HERE, help="folder")
    folder = parser.parse_args().output
    nominal, recordings, label = made()
    for name, content in ((NAME, nominal), (f"{NAME}_hidden", label)):
        (folder / f"{name}.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    for name, columns in recordings.items():
        pq.write_table(
            pa.table(columns), folder / f"{name}.parquet", compression="zstd", compression_level=19,
            use_dictionary=False, column_encoding=dict.fromkeys(columns, "BYTE_STREAM_SPLIT"),
        )  # fmt: skip


if __name__ == "__main__":
    main()
