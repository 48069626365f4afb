"""The batch fit: its solution, its way there, and whether its standard errors are honest."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fit_cases import few_unknowns, groups, image_of, lasting_finger, small_finger, twin_of
from fit_data import make_recording, recorded, wavy_forces, wavy_motion
from oracle_trace import with_values
from random_fingers import Description, Recording
from tendonfmu.estimate.estimation import Estimator

Array = NDArray[Any]


def estimator_with(description: Description, *recordings: Recording, key: Any = few_unknowns) -> Any:
    estimator = Estimator(image_of(description), groups(description, key))
    for recording in recordings:
        estimator.add_recording(recording, 3, recording.get("external_torque"))
    return estimator


def bounds_of(estimator: Any) -> tuple[Array, Array]:
    unknowns = estimator.unknowns
    return np.array([each.lower for each in unknowns]), np.array([each.upper for each in unknowns])


def perturbed(estimator: Any, seed: int, by: float = 0.4) -> Array:
    """A start off the description's, within the bounds."""
    rng = np.random.default_rng([seed, 20])
    return np.clip(estimator.start * rng.uniform(1.0 - by, 1.0 + by, len(estimator.start)), *bounds_of(estimator))


def guessed(description: Description, seed: int, by: float = 0.3, key: Any = few_unknowns) -> Description:
    """The description as somebody would guess it: every unknown off by up to that share."""
    estimator = Estimator(image_of(description), groups(description, key))
    twin = twin_of(description, groups(description, key), estimator.unknowns)
    return with_values(description, twin.moved(perturbed(estimator, seed, by)))


def prior_cost(estimator: Any, z: Array, prior_std: float = 1.0) -> float:
    """The prior is about the description's numbers, wherever the fit started."""
    return float(0.5 * np.sum(((z - estimator.start) / (prior_std * estimator.scale)) ** 2))


def total_cost(estimator: Any, z: Array, prior_std: float = 1.0) -> float:
    return float(estimator.evaluate(z)[0]) + prior_cost(estimator, z, prior_std)


def assert_stationary(estimator: Any, result: Any, prior_std: float, share: float = 1e-3) -> None:
    """The gradient, projected on the bounds, asks for less than `share` of a standard error in any direction."""
    lower, upper = bounds_of(estimator)
    scale = estimator.scale
    # of data and prior, in units of scale
    gradient = estimator.evaluate(result.z)[1] * scale + (result.z - estimator.start) / scale / prior_std**2
    assert (result.z >= lower).all() and (result.z <= upper).all()
    at_lower, at_upper = result.z <= lower * (1 + 1e-12), result.z >= upper * (1 - 1e-12)
    free = ~((at_lower & (gradient > 0.0)) | (at_upper & (gradient < 0.0)))
    information = estimator.evaluate(result.z)[2] * np.outer(scale, scale) + np.eye(len(scale)) / prior_std**2
    step = np.linalg.solve(information[np.ix_(free, free)], gradient[free])
    assert step @ gradient[free] < share**2 * max(1, free.sum())


def test_data_without_noise_give_the_parameters_back() -> None:
    description = lasting_finger()
    recording = recorded(description, 3, 60.0, 50.0, quiet=True)
    estimator = estimator_with(description, recording)
    truth = estimator.start
    for seed in (1, 2, 3):
        z0 = perturbed(estimator, seed)
        result = estimator.fit(z0, prior_std=np.inf, tolerance=1e-9, max_passes=200)
        assert result.converged
        np.testing.assert_allclose(result.z, truth, rtol=1e-6)
        assert result.cost < 1e-10 and result.prior_cost == 0.0


def test_solution_is_stationary_and_reported_truly() -> None:
    description = small_finger()
    recordings = [recorded(description, 4, 40.0, 50.0), recorded(description, 5, 25.0, 40.0)]
    estimator = estimator_with(description, *recordings)
    z0 = perturbed(estimator, 1)
    result = estimator.fit(z0, prior_std=2.0, tolerance=1e-4)
    assert result.converged and not result.stopped
    assert_stationary(estimator, result, 2.0)
    _, gradient, information = estimator.evaluate(result.z)
    scale = estimator.scale
    assert result.cost == pytest.approx(total_cost(estimator, result.z, 2.0), rel=1e-10)
    assert result.prior_cost == pytest.approx(prior_cost(estimator, result.z, 2.0), rel=1e-10)
    np.testing.assert_allclose(result.information, information, rtol=0.0, atol=1e-10 * np.abs(information).max())
    np.testing.assert_allclose(result.gradient * scale, gradient * scale, rtol=0.0, atol=1e-7)
    expected = np.linalg.inv(information * np.outer(scale, scale) + np.eye(len(scale)) / 4.0) * np.outer(scale, scale)
    ratio = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(result.covariance / ratio, expected / ratio, rtol=0.0, atol=1e-8)
    assert result.passes >= result.steps >= 1


def no_stribeck_in_truth() -> tuple[Description, Recording]:
    """Data of a finger whose joint has no Stribeck effect, and the description that would have one."""
    description = small_finger()
    truth = copy.deepcopy(description)
    truth["joints"][0]["friction"]["static"] = truth["joints"][0]["friction"]["coulomb"]
    return description, recorded(truth, 8, 60.0, 50.0)


def test_solution_on_a_bound() -> None:
    """Where the data want a negative drop, it stops at its bound and the rest is optimal."""
    description, recording = no_stribeck_in_truth()
    estimator = estimator_with(description, recording)
    result = estimator.fit(prior_std=10.0, tolerance=1e-2, max_passes=200)
    assert result.converged
    assert_stationary(estimator, result, 10.0, share=1e-2)
    (drop,) = (k for k, u in enumerate(estimator.unknowns) if u.path == "joints[1].friction.static")
    assert result.z[drop] < 0.2 * estimator.start[drop]


def test_cost_never_increases() -> None:
    description = lasting_finger()
    estimator = estimator_with(description, recorded(description, 10, 40.0, 1000.0))
    seen: list[tuple[int, int, int, int, float, Array]] = []

    def progress(number: int, stride: int, done: int, total: int, cost: float, best: Array) -> None:
        seen.append((number, stride, done, total, cost, np.array(best)))

    z0 = perturbed(estimator, 4, 0.6)
    result = estimator.fit(z0, stride=1, tolerance=1e-6, progress=progress)
    assert {number for number, *_ in seen} == set(range(1, result.passes + 1))
    assert all(stride == 1 and 0 <= done <= total for _, stride, done, total, _, _ in seen)
    told = [cost for *_, cost, _ in seen if np.isfinite(cost)]
    assert (np.diff(told) <= 0.0).all() and len(set(told)) > 2
    for cost, best in {cost: best for *_, cost, best in seen if np.isfinite(cost)}.items():
        assert cost == pytest.approx(total_cost(estimator, best), rel=1e-10)
    assert result.cost <= min(told) <= max(told) <= total_cost(estimator, z0) * (1 + 1e-10)
    # who stops it keeps the best so far
    stopped = estimator.fit(z0, stride=1, tolerance=1e-6, progress=lambda number, *_: number < 3)
    assert stopped.stopped and not stopped.converged
    assert stopped.cost == pytest.approx(total_cost(estimator, stopped.z), rel=1e-10)
    assert stopped.cost < total_cost(estimator, z0)
    np.testing.assert_array_equal(estimator.fit(z0, progress=lambda *_: False).z, z0)

    def fail(*_: Any) -> bool:
        raise KeyError("from progress")

    with pytest.raises(KeyError, match="from progress"):
        estimator.fit(z0, progress=fail)


def test_coarse_passes_and_threads_lead_to_the_same_place() -> None:
    description = small_finger()
    estimator = estimator_with(description, recorded(description, 11, 60.0, 200.0))
    z0 = perturbed(estimator, 5)
    results = [
        estimator.fit(z0, tolerance=1e-3, stride=stride, threads=threads)
        for stride, threads in ((0, 0), (1, 1), (1, 2), (8, 2))
    ]
    std = np.sqrt(np.diag(results[0].covariance))
    for each in results:
        assert each.converged
        # each ends with a step below a thousandth of a standard error
        np.testing.assert_allclose((each.z - results[0].z) / std, 0.0, atol=0.01)


def test_what_the_data_do_not_say_stays_with_the_prior() -> None:
    """A joint that never moves: its friction keeps start and the prior's standard error."""
    description = small_finger()
    motion = wavy_motion(12, 30.0, 50.0, 2)
    motion["joint_position"][:, 0] = 0.1
    motion["joint_velocity"][:, 0] = 0.0
    made = make_recording(description, motion, wavy_forces(12, motion["time"], 4), 12, 0.02)
    estimator = estimator_with(description, made.recording)
    result = estimator.fit(perturbed(estimator, 6), prior_std=0.5)
    assert result.converged
    still = [k for k, u in enumerate(estimator.unknowns) if u.path.startswith("joints[1].friction")]
    assert len(still) == 4
    np.testing.assert_allclose(result.z[still], estimator.start[still], rtol=1e-6)
    std = np.sqrt(np.diag(result.covariance))
    np.testing.assert_allclose(std[still], 0.5 * estimator.scale[still], rtol=1e-9)


def normalised_errors(seed: int) -> tuple[Array, Array]:
    """(z − truth) / standard error of identified unknowns, and e²/S of all samples, for one seed's data."""
    description = lasting_finger(noise_std=0.001, drift_variance=1e-6)
    recording = recorded(description, 100 + seed, 40.0, 50.0)
    truth = estimator_with(description, recording)
    # decided at the truth, before fitting
    known = np.linalg.inv(truth.evaluate(truth.start)[2] + np.diag((3.0 * truth.scale) ** -2))
    identified = np.sqrt(np.diag(known)) < 0.3 * truth.start
    estimator = estimator_with(guessed(description, seed), recording)
    result = estimator.fit(prior_std=3.0)
    assert result.converged
    e, S, _ = estimator.innovations(0, result.z)
    return ((result.z - truth.start) / np.sqrt(np.diag(result.covariance)))[identified], (e[1:] ** 2 / S[1:]).ravel()


def test_standard_errors_are_honest() -> None:
    """20 seeds: errors over standard errors have variance near 1, none beyond what chance allows; NIS near 1."""
    results = [normalised_errors(seed) for seed in range(20)]
    errors = np.concatenate([errors for errors, _ in results])
    nis = np.concatenate([nis for _, nis in results])
    assert len(errors) > 200
    # 25 correlated numbers a seed: the variance's own error is about 0.1
    assert 0.7 < np.mean(errors**2) < 1.3
    assert np.mean(np.abs(errors) < 3.0) >= 0.99
    assert abs(np.mean(errors)) < 0.25
    # 80,000 values of χ²(1), less the unknowns: 1 ± 0.01
    assert np.mean(nis) == pytest.approx(1.0, abs=0.03)


def test_what_nothing_tells_is_not_known() -> None:
    """Three samples and no prior: no standard error may come out small, or as nothing."""
    description = small_finger()
    recording = {name: values[:3] for name, values in recorded(description, 6, 12.0, 20.0).items()}
    estimator = estimator_with(description, recording)
    result = estimator.fit(prior_std=np.inf)
    errors = np.sqrt(np.diag(result.covariance)) / estimator.scale
    assert np.isfinite(errors).all() and errors.min() > 10.0
