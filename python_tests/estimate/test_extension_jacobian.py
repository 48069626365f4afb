"""∂T/∂z and ∂Δb/∂z of the estimation by the numbers of `extensions`, against differences of the oracle.

All effects together in random fingers.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fit_cases import groups, image_of
from oracle_trace import run_recorder, with_values
from random_extensions import MAGNITUDES
from random_fingers import Description, random_case
from repetitions import repeated
from tendonfmu.estimate import estimation

Array = NDArray[Any]

FINGERS = range(700, 713)
SAMPLES = 50
BY_DIFFERENCES = 3e-5  # of the column's largest


class Case:
    """A random finger with extensions and the estimator's rows at its own numbers.

    Every third one has `entry_load`; every fourth one all magnitudes at 0, where `diagnose` takes its candidates.
    """

    def __init__(self, seed: int) -> None:
        description, self.recording = random_case(seed, SAMPLES, extensions=True)
        self.source = (1, 1, 2, 3)[seed % 4]
        noise = {"drift_variance": 1e-4, "noise_std": 0.01, "entry_load": seed % 3 == 0}
        self.description: Description = description | {"bias": dict(description.get("bias") or {}) | noise}
        self.at_zero = seed % 4 == 1
        if self.at_zero:
            rows = description["extensions"]
            self.description["extensions"] = [row | {k: 0.0 for k in MAGNITUDES if k in row} for row in rows]
        self.group = groups(self.description)
        self.estimator = estimation.Estimator(image_of(self.description), self.group)
        self.estimator.add_recording(self.recording, self.source)
        self.z = self.estimator.start
        self.rows = self.estimator.jacobian(0, self.z, 0, SAMPLES)

    def oracle_rows(self, values: dict[str, float], less_tau: bool = False) -> Array:
        """[2, N, n]: T (or T − τ) and Δb of the oracle."""
        changed = with_values(self.description, values)
        finger, torque, jump, _ = run_recorder(changed, self.recording, self.source)
        tau = np.array([moment.f0 for moment in finger.moments]) @ finger.R
        return np.stack([torque - tau if less_tau else torque, jump])


@functools.cache
def case(seed: int) -> Case:
    return Case(seed)


@pytest.mark.parametrize("seed", repeated(FINGERS, 0, 3, 12))  # these have all effects
def test_all_numbers_by_differences(seed: int) -> None:
    """But for samples at which the step turns a decision (a threshold, a play, a neighbour in time)."""
    each = case(seed)
    at = each.oracle_rows({})
    np.testing.assert_allclose(np.stack(each.rows[:2]), at, rtol=0.0, atol=1e-9 * np.abs(at).max() + 1e-12)
    derivative = np.stack(each.rows[2:])
    for column, unknown in enumerate(each.estimator.unknowns):
        if not unknown.path.startswith("extensions["):
            continue
        step = 1e-4 * (abs(unknown.start) or unknown.scale)
        one_sided = unknown.start - step < unknown.lower or unknown.path.endswith((".width", ".delay"))

        # later forces change τ too, which the estimation counts with the model
        less_tau = unknown.path.endswith(".delay") and unknown.start < 0.0

        def moved(by: float, path: str = unknown.path, start: float = unknown.start, less: bool = less_tau) -> Array:
            return each.oracle_rows({path: start + by}, less)

        if one_sided and each.at_zero:  # the direction that exists: kinks at 0
            fine, wide = (moved(h) - at for h in (step / 2.0, step))
            expected, error = (4.0 * fine - wide) / step, np.abs(2.0 * fine - wide) / step
        else:
            fine, wide = (moved(h) - moved(-h) for h in (step / 2.0, step))
            expected, error = (4.0 * fine - wide / 2.0) / (3.0 * step), np.abs(fine - wide / 2.0) / step
        scale = max(np.abs(derivative[..., column]).max(), np.abs(at).max() * 1e-9 / step)
        known = error < 1e-3 * scale
        wrong = np.abs(derivative[..., column] - expected) > BY_DIFFERENCES * scale + error
        assert known.mean() > 0.9, (unknown.path, known.mean())
        assert not (wrong & known).any(), (unknown.path, each.description["extensions"])
