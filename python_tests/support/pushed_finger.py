"""The finger and the recordings of the demo, and one of these as it would be with pushes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.recordings.recording import Recording

Numbers = NDArray[np.float64]

PUSH = 0.06  # N·m
FINGER, FREE, UNSEEN = "two_joints.json", "two_joints_training.parquet", "two_joints_unseen.parquet"


def pushed(recording: Recording, data: dict[str, Any]) -> tuple[dict[str, Numbers], int]:
    """The recording as it would be with pushes of `PUSH` on joint 1 for 0.5 s every 3 s, and how many there are: the
    forces that bear them, and springs stretched by these."""
    arms = np.array([tendon["moment_arms"] for tendon in data["tendons"]])
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]])
    since = (recording.time - recording.time[0]) % 3.0
    touched = (since >= 2.0) & (since < 2.5)
    torque = np.zeros((len(recording), arms.shape[1]))
    torque[:, 0] = PUSH * np.minimum((since - 2.0) / 0.02, 1.0) * touched
    change = torque @ np.linalg.pinv(arms)
    columns: dict[str, Numbers] = {"time": recording.time, "contact": touched.astype(float)}
    force, position = (
        recording.groups["tendon_force"] + change,
        recording.groups["tendon_position"] + change / stiffness,
    )
    for i in range(len(stiffness)):
        columns[f"tendon_force[{i + 1}]"] = force[:, i]
        columns[f"tendon_position[{i + 1}]"] = position[:, i]
    for j in range(arms.shape[1]):
        columns[f"external_torque[{j + 1}]"] = torque[:, j]
    return columns, int((np.diff(touched.astype(int)) == 1).sum())
