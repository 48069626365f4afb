"""The extended Kalman filter of the estimation against the naive one in Joseph form, sample by sample."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import oracle_fit
from fit_cases import (
    BIASES,
    few_unknowns,
    groups,
    image_of,
    lasting_finger,
    leave_out,
    random_fit_case,
    small_finger,
    twin_of,
)
from fit_data import make_recording, recorded, wavy_forces, wavy_motion
from oracle_ekf import JosephFilter
from oracle_trace import with_values
from random_fingers import Description, Recording
from repetitions import repeated
from tendonfmu.estimate.estimation import Estimator, Learner

Array = NDArray[Any]

CLOSE = 1e-8  # of a prior's standard deviation, or of the largest innovation: rounding through a few hundred updates


class Pair:
    """The learner with blocks of one sample, and the naive filter."""

    def __init__(self, description: Description, group: Array, prior_std: float = 1.0, drift: float = 0.0) -> None:
        self.description = description
        image = image_of(description)
        unknowns = Estimator(image, group).unknowns
        self.learner = Learner(image, group, prior_std=prior_std, block=1, parameter_drift=drift)
        self.twin = twin_of(description, group, unknowns)
        lower, upper, self.scale = (
            np.array([getattr(u, name) for u in unknowns]) for name in ("lower", "upper", "scale")
        )
        joints = len(description["joints"])
        self.naive = JosephFilter(self.twin, joints, self.scale, lower, upper, prior_std, drift)
        self.prior_std = prior_std

    def run(
        self, recording: Recording, source: int = 1, external: Array | None = None, use: Array | None = None
    ) -> None:
        """Both over a recording, compared: innovations, their variances, estimates, covariance, bias."""
        found = self.learner.run(recording, source, external, use)
        part = oracle_fit.Likelihood(self.description, self.twin, recording, source, external, use)
        e, S = self.naive.run(part)
        known = ~np.isnan(e)
        assert (np.isnan(found["innovation"]) == ~known).all()
        scale = np.abs(e[known]).max()
        np.testing.assert_allclose(found["innovation"][known], e[known], rtol=0.0, atol=CLOSE * scale)
        np.testing.assert_allclose(found["innovation_variance"][known], S[known], rtol=CLOSE)
        assert self.learner.slack_samples == self.naive.slack_samples
        self.compare()

    def compare(self) -> None:
        naive, learner = self.naive, self.learner
        np.testing.assert_allclose(learner.z / self.scale, naive.z / self.scale, rtol=0.0, atol=CLOSE * self.prior_std)
        sizes = np.outer(self.scale, self.scale) * self.prior_std**2
        np.testing.assert_allclose(learner.covariance / sizes, naive.covariance / sizes, rtol=0.0, atol=CLOSE)
        largest = max(np.abs(naive.bias).max(), 1e-3)
        np.testing.assert_allclose(learner.bias, naive.bias, rtol=0.0, atol=CLOSE * largest)
        np.testing.assert_allclose(learner.values(), self.twin.parameters(naive.z), rtol=0.0, atol=CLOSE * 1e3)


@pytest.mark.parametrize("name", repeated(BIASES, 4, 9))
@pytest.mark.parametrize("left_out", repeated([False, True], 1), ids=["all used", "some left out"])
def test_every_bias_option(name: str, left_out: bool) -> None:
    """Two recordings, each with a bias of its own; samples left out are foretold, and teach nothing."""
    description = lasting_finger()
    description["bias"] |= BIASES[name]
    pair = Pair(description, groups(description), drift=1e-4)
    for seed in (2, 3):
        recording = recorded(description, seed, 8.0, 20.0)
        use = leave_out(seed, len(recording["time"])) if left_out else None
        pair.run(recording, 3, recording["external_torque"], use)


@pytest.mark.parametrize("seed", repeated(range(10), 0))
def test_random_fingers(seed: int) -> None:
    """All structures: asymmetric, working points, loops, slack, jumps, three kinematics."""
    description, recording, source = random_fit_case(seed, 120)
    Pair(description, groups(description), prior_std=0.3).run(recording, source)


def test_standard_errors_are_those_of_the_numbers() -> None:
    """Of static = coulomb + drop and vs = 1/rate, to first order."""
    description = lasting_finger()
    group = groups(description, few_unknowns)
    recording = recorded(description, 5, 10.0, 50.0)
    learner = learner_over(description, group, recording)
    twin = twin_of(description, group, learner.unknowns)
    step = twin.steps(learner.z)
    slopes = twin.parameters(learner.z + 1j * np.diag(step)).imag / step[:, None]
    expected = np.sqrt(np.einsum("ip,ij,jp->p", slopes, learner.covariance, slopes))
    np.testing.assert_allclose(learner.standard_errors(), expected, rtol=1e-9)


def test_bounds_hold() -> None:
    """A prior far too large for its data: estimates are pushed against their bounds and stay within."""
    description = lasting_finger()
    truth = copy.deepcopy(description)
    for joint in truth["joints"]:
        for kind in ("friction", "load_friction"):
            if kind in joint:
                joint[kind] |= {"static": joint[kind]["coulomb"], "viscous": 0.0}
    recording = recorded(truth, 7, 15.0, 20.0)
    group = groups(description, few_unknowns)
    pair = Pair(description, group, prior_std=3.0)
    pair.run(recording, 3, recording["external_torque"])
    assert (pair.learner.z >= pair.naive.lower).all() and (pair.learner.z <= pair.naive.upper).all()
    assert pair.naive.stopped_by_bounds > 10


def learner_over(description: Description, group: Array, recording: Recording, passes: int = 1, **how: Any) -> Any:
    learner = Learner(image_of(description), group, **how)
    for number in range(passes):
        if number > 0:
            learner.begin_pass()
        learner.run(recording, 3, recording["external_torque"])
    return learner


def test_further_passes_leave_nothing_to_blocks() -> None:
    """From the second pass on every sample is linearised at the same unknowns: a block is then only arithmetic."""
    description = lasting_finger()
    group = groups(description, few_unknowns)
    recording = recorded(description, 8, 20.0, 100.0)
    learners = [
        learner_over(description, group, recording, passes=6, block=block, prior_std=0.3) for block in (1, 7, 64)
    ]
    std = np.sqrt(np.diag(learners[0].covariance))
    for each in learners[1:]:
        np.testing.assert_allclose((each.z - learners[0].z) / std, 0.0, atol=1e-3)
        np.testing.assert_allclose(np.sqrt(np.diag(each.covariance)) / std, 1.0, atol=1e-3)


def test_covariance_stays_symmetric_and_positive_definite() -> None:
    """20,000 samples with a noise far below what the start leaves open: where P − K H P would lose its digits."""
    description = lasting_finger(noise_std=1e-4, drift_variance=1e-9)
    recording = recorded(description, 9, 200.0, 100.0)
    group = groups(description)
    learner = learner_over(description, group, recording)
    covariance = learner.covariance
    np.testing.assert_array_equal(covariance, covariance.T)
    std = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(std, std)).min() > 0.0
    scale = np.array([unknown.scale for unknown in Estimator(image_of(description), group).unknowns])
    assert (std > 1e-5 * scale).all() and (std <= scale * (1 + 1e-12)).all()


def test_agrees_with_the_batch() -> None:
    """Both maximise the same likelihood with the same prior: after a few passes they are one."""
    description = lasting_finger(noise_std=0.001, drift_variance=1e-6)
    group = groups(description, few_unknowns)
    recording = recorded(description, 10, 60.0, 50.0)
    learner = learner_over(description, group, recording, passes=8, prior_std=0.3)
    estimator = Estimator(image_of(description), group)
    estimator.add_recording(recording, 3, recording["external_torque"])
    result = estimator.fit(prior_std=0.3, tolerance=1e-4)
    std = np.sqrt(np.diag(result.covariance))
    np.testing.assert_allclose((learner.z - result.z) / std, 0.0, atol=0.01)
    np.testing.assert_allclose(np.sqrt(np.diag(learner.covariance)) / std, 1.0, atol=0.01)


def drawn_from_the_prior(seed: int, prior_std: float) -> tuple[Description, Array]:
    """A finger whose numbers the learner's prior could have drawn, and its unknowns."""
    description = small_finger()
    group = groups(description)
    unknowns = Estimator(image_of(description), group).unknowns
    start, scale = (np.array([getattr(unknown, name) for unknown in unknowns]) for name in ("start", "scale"))
    z = start + prior_std * scale * np.random.default_rng(seed).standard_normal(len(start))
    return with_values(description, twin_of(description, group, unknowns).moved(z)), z


def test_the_numbers_drawn_are_those_of_the_finger() -> None:
    truth, z = drawn_from_the_prior(1, 0.05)
    np.testing.assert_allclose(Learner(image_of(truth), groups(truth)).z, z, rtol=1e-9)


def without_slack(truth: Description, seed: int, seconds: float) -> Recording:
    for attempt in range(seed, seed + 100_000, 1000):
        motion = wavy_motion(attempt, seconds, 200.0, 2)
        try:
            return make_recording(truth, motion, wavy_forces(attempt, motion["time"], 4), attempt).recording
        except ValueError:  # a tendon goes slack
            continue
    raise RuntimeError(f"no motion without slack for seed {seed}")


@pytest.mark.long
def test_errors_are_of_the_size_that_the_covariance_says() -> None:
    """After a million samples: e = z − truth, and eᵀ P⁻¹ e is the number of unknowns on average (NEES)."""
    fingers, prior_std, scores, count = 8, 0.05, [], 0
    for seed in range(fingers):
        truth, z = drawn_from_the_prior(seed, prior_std)
        learner = Learner(image_of(small_finger()), groups(small_finger()), prior_std=prior_std)
        for part in range(10):
            recording = without_slack(truth, 100 * seed + part, 62.5)
            learner.run(recording, 3, recording["external_torque"])
        deviation = np.sqrt(np.diag(learner.covariance))
        assert np.linalg.eigvalsh(learner.covariance / np.outer(deviation, deviation)).min() > 0.0
        scores.append(float((learner.z - z) @ np.linalg.solve(learner.covariance, learner.z - z)))
        count += len(z)
    assert abs(sum(scores) - count) < 4.0 * np.sqrt(2.0 * count)
