"""The recordings of the manipulator pulled by two wires, and the force at its tip that bends it."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import tendonfmu as tf
from tendonfmu.errors import InputError

Array = NDArray[np.float64]

MAP = Path(__file__).with_name("map.json")
ARM = 3.63  # mm of wire per radian of bending
FREE = "no-payload"
# In order of time; every second condition chooses constants, the others report.
CONDITIONS = ("left_90", "left_60", "left_30", "zero", "right_30", "right_60", "right_90")
HALVES = {
    "choosing": [f"{name}_{kind}" for name in CONDITIONS[::2] for kind in ("un-tight", "tight")],
    "reporting": [f"{name}_{kind}" for name in CONDITIONS[1::2] for kind in ("un-tight", "tight")] + ["testset"],
}
SMEAR = 1.0  # s; the force is low-passed at 0.2 Hz without delay, so a contact may begin and end so much off its label
RATE = 30  # Hz


@dataclass(frozen=True)
class WireRecording:
    """One recording; forces in units of the sensor at the tip."""

    name: str
    recording: tf.Recording  # motors and load cells, and the label `contact`
    bend: Array  # [N] rad, of the motors
    force: Array  # [N, 2] fx, fy
    bending: Array  # [N]: the force across the straight arm that bends it as much as fx and fy do
    least: Array  # [N, 2] fx and fy of the least force with a bending force of 1

    def torque(self, finger: tf.Finger) -> Array:
        """[N] N·m: what friction and springs leave of the torque of the load cells."""
        return np.asarray(tf.run(finger, self.recording).frame["compensated_torque[1]"])


def data_folder() -> Path:
    """Folder of the files, in $TENDONFMU_DATA or ../shared/data beside the repository; InputError if it is absent."""
    root = Path(__file__).resolve().parents[2]
    folder = Path(os.environ.get("TENDONFMU_DATA") or root.parent / "shared" / "data") / "wire"
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; expected the wire recordings there (see docs/evidence/wire.md)")
    return folder


def levers(bend: Array) -> Array:
    """[N, 2]: how far the tip of an arc moves along x and y per radian, over half the length of the arc."""
    q = np.where(np.abs(bend) < 1e-3, 1e-3, bend)
    moved = np.column_stack([q * np.sin(q) - 1 + np.cos(q), q * np.cos(q) - np.sin(q)])
    return np.asarray(2 * moved / q[:, None] ** 2)


def read(name: str, touch: float) -> WireRecording:
    """Convert one file by map.json, with a label `touch` from the force at the tip."""
    folder = data_folder()
    if not (files := list(folder.glob(f"*_{name}.parquet"))):
        raise InputError(f"{folder}: no file *_{name}.parquet")
    log: Any = pd.read_parquet(files[0])
    bend = (log["wire length #0"] - log["wire length #1"]).to_numpy() / (2 * ARM)
    force = log[["fx", "fy"]].to_numpy()
    if name == FREE:  # the sensor was zeroed only after it
        force = force - force.mean(axis=0)
    weights = levers(bend)
    bending = (weights * force).sum(axis=1)
    window = np.ones(2 * round(SMEAR * RATE) + 1)
    log["touch"] = (np.convolve(np.abs(bending) > touch, window, "same") > 0.5).astype(float)
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / f"{name}.parquet"
        log.to_parquet(file)
        least = weights / (weights**2).sum(axis=1, keepdims=True)
        return WireRecording(name, tf.convert(file, MAP), bend, force, bending, least)
