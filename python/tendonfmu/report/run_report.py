"""What one run of the model gives in numbers: `tendonfmu run --json`, and the tiles and tables of its page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.model import Finger
from tendonfmu.recordings import flagged_stretches
from tendonfmu.report.numbers import rms

FORMAT = "tendonfmu-run-1"

Table = Mapping[str, NDArray[Any]]


def run_report(
    model: Path, recording: Path, table: Table, finger: Finger | None, *, kinematics: int, output: str
) -> dict[str, Any]:
    """Return the results of a run in numbers."""
    # table: [N]
    time = table["time"]
    joints, tendons = _count(table, "joint_torque"), _count(table, "slack")
    joint_names = [f"joint {j}" for j in range(1, joints + 1)] if finger is None else finger.joint_names
    tendon_names = [f"tendon {i}" for i in range(1, tendons + 1)] if finger is None else finger.tendon_names
    return {
        "format": FORMAT,
        "model": str(model),
        "finger": None if finger is None else finger.name,
        "recording": str(recording),
        "kinematics": kinematics,
        "output": output,
        "samples": len(time),
        "duration": float(time[-1] - time[0]),
        "contact": {
            "samples": int(table["contact"].sum()),
            "share": _share(table["contact"]),
            "intervals": flagged_stretches(time, table["contact"]),
        },
        "joints": [_joint(table, j, name) for j, name in enumerate(joint_names, start=1)],
        "tendons": [
            {"name": name, "slack_share": _share(table[f"slack[{i}]"])} for i, name in enumerate(tendon_names, start=1)
        ],
    }


def _joint(table: Table, j: int, name: str) -> dict[str, Any]:
    torques = {key: table[f"{key}_torque[{j}]"] for key in ("joint", "friction", "compensated")}
    angle, free = table[f"joint_angle[{j}]"], ~np.asarray(table["contact"], dtype=bool)
    return {
        "name": name,
        "angle": [float(angle.min()), float(angle.max())],
        **{f"{key}_torque_rms": rms(values) for key, values in torques.items()},
        **{f"free_{key}_torque_rms": rms(values[free]) if free.any() else None for key, values in torques.items()},
        "largest_compensated_torque": float(np.abs(torques["compensated"]).max()),
        "contact_share": _share(table[f"joint_contact[{j}]"]),
    }


def _count(table: Table, name: str) -> int:
    return sum(column.startswith(f"{name}[") for column in table)


def _share(flags: NDArray[Any]) -> float:
    return float(np.mean(np.asarray(flags, dtype=np.float64)))
