"""What the field's own model makes of the same recordings: the regression of a rigid body on the joints of the PSM."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.signal import butter, sosfiltfilt

from evidence import table
from evidence.cases import DATA
from evidence.machines import ANOTHER, FIRST, SECOND
from evidence.part import Figures, Part
from tendonfmu.arrays import Numbers

CUTOFF, RATE = 8.0, 200.0  # Hz; of the low pass as in the maps
SIGN = 0.01  # of the largest speed, over which the sign turns


def regression(joint: int, learned: Sequence[str]) -> Callable[[Sequence[str]], float]:
    """Least squares over inertia, coupled inertia, weight and friction; the rms error on recordings [N·m].

    What the field identifies such an arm with: 17 numbers in base parameters, of all three joints.
    """
    logs = {name: pd.read_parquet(DATA / "psm" / f"{name}.parquet").astype(float) for name in learned}
    fastest = max(float(log[f"joint_velocity_{joint}"].abs().max()) for log in logs.values())
    low_pass = butter(2, CUTOFF, fs=RATE, output="sos")

    def columns(log: Any) -> Numbers:
        angle = [log[f"joint_position_{k}"].to_numpy() for k in (1, 2, 3)]
        speed = [sosfiltfilt(low_pass, log[f"joint_velocity_{k}"]) for k in (1, 2, 3)]
        turn = [np.gradient(values) * RATE for values in speed]
        own, at = turn[joint - 1], speed[joint - 1] / fastest
        sine, cosine = np.sin(angle[:2]), np.cos(angle[:2])
        weight = [sine[0] * cosine[1], cosine[0] * sine[1], cosine[0] * cosine[1], sine[1], sine[0]]
        inertia = [own, own * angle[2], own * angle[2] ** 2, own * cosine[1] ** 2]
        coupled = [turn[k] for k in range(3) if k != joint - 1]
        by_insertion = [values * angle[2] for values in weight[:3]]
        return np.column_stack([np.ones_like(own), *inertia, *coupled, *weight, *by_insertion, np.tanh(at / SIGN), at])

    design = np.vstack([columns(log) for log in logs.values()])
    effort = np.concatenate([log[f"effort_{joint}"] for log in logs.values()])
    scale = np.maximum(np.sqrt((design**2).mean(axis=0)), 1e-12)
    numbers = np.linalg.lstsq(design / scale, effort, rcond=1e-6)[0] / scale

    def error(names: Sequence[str]) -> float:
        judged = [pd.read_parquet(DATA / "psm" / f"{name}.parquet").astype(float) for name in names]
        return table.rms(np.concatenate([log[f"effort_{joint}"] - columns(log) @ numbers for log in judged]))

    return error


def rigid_body(_folder: Path, _workers: int) -> Figures:
    lines = []
    for joint in (1, 2, 3):
        error = regression(joint, FIRST)
        lines.append([f"{joint}", *(f"{1e3 * error(names):.0f}" for names in (SECOND, ANOTHER))])
    return {"lines": lines}


PARTS = {
    "rigid_body": Part(
        rigid_body,
        minutes=0.1,
        needs=("../shared/data",),
        tables={
            "errors": table.of_cells(
                "lines", ["PSM joint, error in mN·m (3: mN)", "other excitations", "another identification"]
            )
        },
    ),
}
