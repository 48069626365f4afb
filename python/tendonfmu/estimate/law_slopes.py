"""Derivatives of what a finger leaves by the numbers of its friction laws and covers, of all of them in one run.

The core takes the share of its limit that friction with a memory holds as constant, which is exact for what slips and
near for what does not. Numbers of the memory and of other extensions have none here.
"""

from __future__ import annotations

import json

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.estimate.core_runs import CoreRuns
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.structure import Structure
from tendonfmu.model import native


class LawSlopes:
    """The derivatives over some runs."""

    def __init__(self, structure: Structure, runs: CoreRuns) -> None:
        data = structure.start.data
        bias = {**(data.get("bias") or {}), "noise_std": 1.0, "forget_rate": 0.0}  # as runs have it
        image = native.image_from_json(json.dumps({**data, "bias": bias}))
        self._estimator, self._blocks = Estimator(image, structure.group, structure.scale), runs.grid.blocks
        self._stretches = []
        for stretch in runs.stretches:
            number = self._estimator.add_recording(stretch.arrays, stretch.kinematics)
            self._stretches.append((number, len(stretch.arrays["time"]), stretch.segment))

    def at(self, z: Numbers) -> Numbers:
        """Return [B, n, u] the derivatives of τ − T less the jumps by the unknowns z [u] (N·m each)."""
        slopes = np.empty((self._blocks, self._estimator.joints, len(z)))
        for number, samples, segment in self._stretches:
            length = samples // segment.count
            _, _, by_torque, by_jump = self._estimator.jacobian(number, z, 0, samples, length)
            if by_jump.any():
                by_torque += length * (np.cumsum(by_jump, axis=0) - 0.5 * by_jump)
            np.negative(by_torque, out=slopes[segment.blocks])
        return slopes
