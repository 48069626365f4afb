"""Make the recordings of the two-joint finger that lacks something, and say what was hidden: see README.md.

Usage: python make_hidden.py [-o FOLDER]   (needs numpy, scipy and pyarrow)
Physics: ../../python_tests/support/matched_rig.py

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
sys.path.append(str(HERE.parents[1] / "python_tests" / "support"))

NAME = "two_joints"
RECORDINGS = {f"{NAME}_training": (3, 60.0), f"{NAME}_unseen": (4, 40.0)}  # seed of the motion, s
EFFECT, STRENGTH, SEED = "gravity", 10.0, 12
RATE = 500.0  # Hz
CUTOFF = 20.0  # Hz, of the velocity that friction sees
FORCE_STEP, POSITION_STEP = 1e-4, 1e-7  # N, m; of the sensors


def true_hand() -> tuple[Any, dict[str, Any]]:
    """The finger (`matched_rig.Hand`) with the effect in it, and what is hidden."""
    from hidden_effects import hide
    from matched_rig import random_hand

    hand = random_hand(SEED, joints=2, presliding=True, source=1, rate=RATE, cutoff=CUTOFF)
    hand = replace(hand, noise=replace(hand.noise, tendon_step=POSITION_STEP))
    seed, seconds = RECORDINGS[f"{NAME}_training"]
    found: tuple[Any, dict[str, Any]] = hide(hand, EFFECT, STRENGTH, seed=SEED, motion=seed, seconds=seconds)
    return found


def recorded(hand: Any, name: str) -> dict[str, NDArray[Any]]:
    """The columns of one of `RECORDINGS`."""
    from matched_rig import record

    seed, seconds = RECORDINGS[name]
    columns = record(hand, seed=seed, seconds=seconds).columns
    return {key: as_sensed(key, values) for key, values in columns.items()}


def description(hand: Any) -> dict[str, Any]:
    """What the tool is given: without the effect, its numbers off by up to half."""
    return {**hand.nominal, "name": NAME}


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
    hand, label = true_hand()
    for name, content in ((NAME, description(hand)), (f"{NAME}_hidden", label)):
        (folder / f"{name}.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    for name in RECORDINGS:
        columns = recorded(hand, name)
        pq.write_table(
            pa.table(columns), folder / f"{name}.parquet", compression="zstd", compression_level=19,
            use_dictionary=False, column_encoding=dict.fromkeys(columns, "BYTE_STREAM_SPLIT"),
        )  # fmt: skip


if __name__ == "__main__":
    main()
