"""R19: what the learner knows after a million samples, and whether it is as far off as it says."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .row import SUPPORT, Outcome, Row, Run, spoken

Array = NDArray[np.float64]
FINGERS, RECORDINGS, RATE, PRIOR = 8, 10, 200.0, 0.05
BAND = 4.0  # standard deviations of the mean of so many squares


def consistency(run: Run) -> Outcome:
    """Fingers whose numbers are drawn from the learner's prior. e = z − truth; NEES = eᵀ P⁻¹ e is u on average."""
    samples = run.count(1_000_000 // (FINGERS * RECORDINGS), 500)
    least, scores, innovations, unknowns = np.inf, [], [], 0
    for seed in range(FINGERS):
        learner, truth, z = drawn(seed)
        for part in range(RECORDINGS):
            made = recorded(truth, 100 * seed + part, samples)
            innovation, variance, _ = learner.run(**made, kinematics_source=3)
            known = np.isfinite(variance) & (variance > 0.0)
            innovations.append(float(np.mean(innovation[known] ** 2 / variance[known])))
            least = min(least, float(np.linalg.eigvalsh(correlations(learner.covariance())).min()))
        error = learner.z() - z
        scores.append(float(error @ np.linalg.solve(learner.covariance(), error)))
        unknowns = learner.unknown_count
    total, expected = sum(scores), FINGERS * unknowns
    wide = BAND * np.sqrt(2.0 * expected)
    sound = least > 0.0 and abs(total - expected) < wide
    steps = spoken(FINGERS * RECORDINGS * samples)
    number = f"{steps} steps: {FINGERS} fingers × {RECORDINGS} recordings, {unknowns} unknowns each"
    result = (
        f"least eigenvalue of the correlations {least:.2g}, never 0 or below; NEES {total / FINGERS:.1f} of {unknowns} "
        f"({BAND:g} standard deviations: {wide / FINGERS:.1f}); squared innovations {np.mean(innovations):.3f} of "
        "their variance"
    )
    return Outcome(number, result, bool(sound))


def drawn(seed: int) -> tuple[Any, Any, Array]:
    """A learner, a finger whose numbers the learner's prior could have drawn, and its unknowns."""
    sys.path.insert(0, str(SUPPORT))
    from fit_cases import small_finger
    from tendonfmu import _estimation
    from tendonfmu.model import native, read_finger

    finger = read_finger(small_finger())
    learner = _estimation.Learner(finger.image, prior_std=PRIOR)
    estimator = _estimation.Estimator(finger.image)
    random = np.random.default_rng(seed)
    unknowns = [learner.unknown(k) for k in range(learner.unknown_count)]
    z = np.array([start + PRIOR * scale * random.standard_normal() for _, _, _, start, _, _, scale in unknowns])
    paths = [parameter.path for parameter in native.Instance(finger.image).parameters()]
    changed = dict(zip(paths, estimator.values(z).tolist(), strict=True))
    return learner, finger.replace(changed).to_dict(), z


def recorded(truth: Any, seed: int, samples: int) -> dict[str, Array]:
    """A motion that leaves no tendon slack: of several seeds the first one."""
    from fit_data import make_recording, wavy_forces, wavy_motion

    for attempt in range(seed, seed + 100_000, 1000):
        motion = wavy_motion(attempt, samples / RATE, RATE, 2)
        try:
            made = make_recording(truth, motion, wavy_forces(attempt, motion["time"], 4), attempt)
        except ValueError:
            continue
        return {name: values for name, values in made.recording.items() if name != "tendon_position"}
    raise RuntimeError(f"no motion without slack for seed {seed}")


def correlations(covariance: Array) -> Array:
    """Their least eigenvalue does not depend on the units."""
    deviation = np.sqrt(np.diag(covariance))
    return covariance / np.outer(deviation, deviation)


ROWS = [Row("R19", "The learner", "1e6 steps", "models that are wrong: then it is sure of wrong numbers", consistency)]
