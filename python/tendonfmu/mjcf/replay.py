"""A recording of free motion replayed in a MuJoCo model: what moves the joints there, against what the tendons pull."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.mjcf.compiled_model import CompiledModel
from tendonfmu.model import Finger
from tendonfmu.recordings import FEWEST, Recording, gaps, tendon_angles, zero_phase

CUTOFF = 10.0  # Hz; motion beyond it is noise
SAMPLES = 4000  # of each recording


def replay_errors(file: Path, finger: Finger, recordings: Sequence[Recording]) -> Numbers:
    """Replay recordings of free motion in a model.

    At each sample MuJoCo computes the torque that the measured motion takes (inverse dynamics, with friction). The
    tendons' share is the measured force times MuJoCo's arms there.

    Returns
    -------
    array
        Root of the mean square difference [n] (N·m).

    Raises
    ------
    InputError
        The recordings are too short to be smoothed.
    """
    model = CompiledModel(file)
    joints = [model.joint_named(str(name)) for name in finger.joint_names]
    tendons = [model.tendon_named(str(name)) for name in finger.tendon_names]
    model.leave_alone(tendons)
    squares: list[Numbers] = []
    for recording in recordings:
        time, groups = recording.time, recording.groups
        angles = groups.get("joint_position", tendon_angles(recording, finger))
        every = max(1, len(time) // SAMPLES)
        for begin, end in pairwise([0, *gaps(time), len(time)]):
            if end - begin < FEWEST:
                continue
            rate = 1.0 / float(np.median(np.diff(time[begin:end])))
            angle, force = (zero_phase(each[begin:end], CUTOFF, rate) for each in (angles, groups["tendon_force"]))
            speed = np.gradient(angle, time[begin:end], axis=0)
            rows = zip(angle, speed, np.gradient(speed, time[begin:end], axis=0), force, strict=True)
            for row in list(rows)[every::every]:
                needed, arms = model.needed_torque(joints, tendons, *row[:3])
                squares.append((needed - row[3] @ arms) ** 2)
    if not squares:
        raise InputError(f"{recordings[0].path}: too short to be replayed; expected {FEWEST} samples without a gap")
    return np.asarray(np.sqrt(np.mean(squares, axis=0)))
