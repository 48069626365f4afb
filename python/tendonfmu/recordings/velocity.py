"""Whether measured joint velocities belong to the joint angles: each angle changes by the integral of its velocity."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.model import Finger
from tendonfmu.recordings.faults import tendon_angles
from tendonfmu.recordings.kinematics import FEWEST, Correction
from tendonfmu.recordings.recording import Recording

WINDOW = 0.1  # s over which changes are compared
ALIKE = 0.8  # correlation above which changes belong together
NEAR = 1.15  # a slope within this factor of a unit's factor shows the unit
UNITS = ((np.pi / 180, "degrees/s"), (2 * np.pi / 60, "rpm"), (1e-3, "mrad/s"), (2 * np.pi, "turns/s"))


def velocity_corrections(recording: Recording, finger: Finger) -> Iterator[tuple[Correction, float]]:
    """Yield corrections of columns of `joint_velocity`, each with the slope of the angle over the integral."""
    velocity = recording.groups.get("joint_velocity")
    if velocity is None or len(recording) < FEWEST:
        return
    turned, travelled = _changes(recording, finger, velocity)
    for j in range(velocity.shape[1]):
        column = f"joint_velocity[{j + 1}]"
        own = _correlation(turned[:, j], travelled[:, j])
        others = [abs(_correlation(turned[:, j], travelled[:, k])) for k in range(velocity.shape[1])]
        best = int(np.argmax(others))
        if best > j and abs(own) < ALIKE / 2 and others[best] > ALIKE:
            columns = (column, f"joint_velocity[{best + 1}]")
            yield Correction("exchange", columns, sources=columns[::-1]), own
        if abs(own) < ALIKE:
            continue
        slope = float(turned[:, j] @ travelled[:, j] / (travelled[:, j] @ travelled[:, j]))
        if slope < 0.0:
            yield Correction("sign", (column,), -1.0), slope
        for factor, unit in UNITS:
            if 1.0 / NEAR < abs(slope) / factor < NEAR:
                yield Correction("scale", (column,), factor, unit), slope


def _changes(recording: Recording, finger: Finger, velocity: Numbers) -> tuple[Numbers, Numbers]:
    """Return the change of each angle and the integral of each velocity over windows, [K, n] rad."""
    angle = recording.groups.get("joint_position")
    if angle is None:
        angle = tendon_angles(recording, finger)
    step = np.diff(recording.time)
    every = max(5, round(WINDOW / float(np.median(step))))
    mean = (velocity[1:] + velocity[:-1]) / 2
    path = np.concatenate([np.zeros((1, velocity.shape[1])), np.cumsum(mean * step[:, None], axis=0)])
    return np.diff(angle[::every], axis=0), np.diff(path[::every], axis=0)


def _correlation(one: Numbers, other: Numbers) -> float:
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(one @ other) / size if size > 0.0 else 0.0
