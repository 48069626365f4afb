"""Recordings of three joints of a surgical arm (dVRK PSM): one recording and one finger a joint, by convert table."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import tendonfmu as tf
from tendonfmu.errors import InputError

HERE = Path(__file__).resolve().parent
JOINTS = (1, 2, 3)
FIRST = ("stribeck_3dof_svd__fourier_test", "stribeck_3dof_svd__fourier_test2")
SECOND = ("stribeck_3dof_svd__fourier_test3", "stribeck_3dof_svd__fourier_test4")
OTHERS = ("latest_3dof_inaxis_svd__fourier_test1", "latest_3dof_inaxis_svd__fourier_test2")  # another identification
RAMPS = ("stribeck_3dof_svd__brtest", "stribeck_3dof_svd__frtest_neg")  # until it breaks away; constant speeds
RATE, RAMP_RATE = 200.0, 100.0  # rows a second


def data_folder() -> Path:
    """Folder of the recordings, in $TENDONFMU_DATA or in ../shared/data. Raises InputError if it is absent."""
    data = Path(os.environ.get("TENDONFMU_DATA") or HERE.parents[2] / "shared" / "data")
    folder = data / "psm"
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; expected the PSM recordings (docs/evidence/psm.md)")
    return folder


def rate_of(name: str) -> float:
    """Rows a second of a recording."""
    return RAMP_RATE if name in RAMPS else RATE


def recording_of(name: str, joint: int) -> tf.Recording:
    """A joint's recording."""
    columns: dict[str, Any] = json.loads((HERE / f"joint_{joint}.json").read_text(encoding="utf-8"))
    columns["joint"]["time"]["rate"] = rate_of(name)
    return tf.convert(data_folder() / f"{name}.parquet", columns)


def coupled_recording(name: str, joints: Sequence[int]) -> tf.Recording:
    """Several joints as one finger: the same rows, from the first in which all move."""
    parts = [recording_of(name, joint) for joint in joints]
    start = max(float(part.time[0]) for part in parts)
    parts = [part[start - 0.5 / RATE :] for part in parts]
    groups = {group: np.hstack([part.groups[group] for part in parts]) for group in parts[0].groups}
    return tf.Recording(Path(name), parts[0].time, groups)


def coupled_finger(fingers: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Fingers of one joint as one, each joint with a drive of its own."""
    whole: dict[str, Any] = json.loads(json.dumps(dict(fingers[0])))
    whole["name"] = "psm"
    for key in ("joints", "tendons", "extensions"):
        whole[key] = [dict(row) for finger in fingers for row in finger[key]]
    for k, (drive, extension) in enumerate(zip(whole["tendons"], whole["extensions"], strict=True)):
        drive |= {"name": f"drive_{k + 1}", "moment_arms": [float(j == k) for j in range(len(fingers))]}
        extension["joint"] = k + 1
    whole["bias"]["initial_torque"] = [finger["bias"]["initial_torque"][0] for finger in fingers]
    whole["contact"]["threshold"] = [finger["contact"]["threshold"][0] for finger in fingers]
    return whole


def log_of(name: str) -> pd.DataFrame:
    """The log as it is."""
    return pd.read_parquet(data_folder() / f"{name}.parquet").astype(float)
