"""What the learner knows after a million samples, and whether it is as far off as it says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

pytestmark = pytest.mark.long

Array = NDArray[np.float64]
FINGERS, RECORDINGS, SAMPLES, RATE, PRIOR = 8, 10, 12_500, 200.0, 0.05
BAND = 4.0  # standard deviations of the mean of so many squares


def test_errors_are_of_the_size_that_the_covariance_says() -> None:
    """Fingers whose numbers are drawn from the learner's prior. e = z − truth; eᵀ P⁻¹ e is u on average."""
    scores, unknowns = [], 0
    for seed in range(FINGERS):
        learner, truth, z = drawn(seed)
        for part in range(RECORDINGS):
            learner.run(**recorded(truth, 100 * seed + part), kinematics_source=3)
            covariance = learner.covariance()
            deviation = np.sqrt(np.diag(covariance))
            # of the correlations, whose least eigenvalue does not depend on the units
            assert np.linalg.eigvalsh(covariance / np.outer(deviation, deviation)).min() > 0.0
        error = learner.z() - z
        scores.append(float(error @ np.linalg.solve(learner.covariance(), error)))
        unknowns = learner.unknown_count
    expected = FINGERS * unknowns
    assert abs(sum(scores) - expected) < BAND * np.sqrt(2.0 * expected)


def drawn(seed: int) -> tuple[Any, Any, Array]:
    """A learner, a finger whose numbers the learner's prior could have drawn, and its unknowns."""
    from fit_cases import small_finger
    from tendonfmu import _estimation
    from tendonfmu.model import native, read_finger

    finger = read_finger(small_finger())
    learner = _estimation.Learner(finger.image, prior_std=PRIOR)
    random = np.random.default_rng(seed)
    unknowns = [learner.unknown(k) for k in range(learner.unknown_count)]
    z = np.array([start + PRIOR * scale * random.standard_normal() for _, _, _, start, _, _, scale in unknowns])
    paths = [parameter.path for parameter in native.Instance(finger.image).parameters()]
    values = _estimation.Estimator(finger.image).values(z).tolist()
    return learner, finger.replace(dict(zip(paths, values, strict=True))).to_dict(), z


def recorded(truth: Any, seed: int) -> dict[str, Array]:
    """A motion that leaves no tendon slack: of several seeds the first one."""
    from fit_data import make_recording, wavy_forces, wavy_motion

    for attempt in range(seed, seed + 100_000, 1000):
        motion = wavy_motion(attempt, SAMPLES / RATE, RATE, 2)
        try:
            made = make_recording(truth, motion, wavy_forces(attempt, motion["time"], 4), attempt)
        except ValueError:
            continue
        return {name: values for name, values in made.recording.items() if name != "tendon_position"}
    raise RuntimeError(f"no motion without slack for seed {seed}")
