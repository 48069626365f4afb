"""The batch estimation against its naive twin: cost, gradient, information and innovations by a dense covariance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import oracle
import oracle_fit
from fit_cases import (
    BIASES,
    few_unknowns,
    groups,
    image_of,
    leave_out,
    off_start,
    random_fit_case,
    shared_key,
    small_finger,
    twin_of,
)
from fit_data import recorded
from oracle_trace import Trace, with_values, without_contact
from random_fingers import Description, Recording, random_recording
from repetitions import repeated
from tendonfmu.estimate.estimation import Estimator

Array = NDArray[Any]

EXACT = 1e-9  # of the largest entry: a filter of 400 samples against Cholesky of the whole covariance


@dataclass
class Part:
    """A recording as both sides take it."""

    recording: Recording
    source: int = 1
    external_torque: Array | None = None
    use: Array | None = None
    silent: Array | None = None


def both(description: Description, group: Array, parts: list[Part]) -> tuple[Any, list[oracle_fit.Likelihood]]:
    """The estimator with its recordings, and the twin's likelihoods."""
    estimator = Estimator(image_of(description), group)
    twin = twin_of(description, group, estimator.unknowns)
    likelihoods = []
    for number, part in enumerate(parts):
        given = (part.recording, part.source, part.external_torque, part.use, part.silent)
        assert estimator.add_recording(*given) == number
        likelihoods.append(oracle_fit.Likelihood(description, twin, *given))
    return estimator, likelihoods


def assert_equal_evaluation(estimator: Any, likelihoods: list[oracle_fit.Likelihood], z: Array, **how: int) -> None:
    cost, gradient, information = estimator.evaluate(z, **how)
    expected = oracle_fit.evaluate(likelihoods, z)
    # in units that make the unknowns comparable: standard errors where the data say something
    size = np.sqrt(np.where(np.diag(expected[2]) > 0.0, np.diag(expected[2]), 1.0))
    assert cost == pytest.approx(expected[0], rel=EXACT)
    largest = np.sqrt(2.0 * expected[0])  # Cauchy-Schwarz: |gradient / size| cannot be larger
    np.testing.assert_allclose(gradient / size, expected[1] / size, rtol=0.0, atol=EXACT * max(largest, 1.0))
    ratio = np.outer(size, size)
    np.testing.assert_allclose(information / ratio, expected[2] / ratio, rtol=0.0, atol=EXACT)
    np.testing.assert_array_equal(information, information.T)


def random_parts(seed: int, samples: int, recordings: int) -> tuple[Description, list[Part]]:
    """A random finger with several recordings: left-out samples, known load, any kinematics."""
    description = random_fit_case(seed, samples)[0]
    rng = np.random.default_rng([seed, 12])
    parts = []
    for number in range(recordings):
        recording = random_recording(description, 1000 * number + seed, samples - 20 * number)
        length = len(recording["time"])
        part = Part(recording, 1 + (seed + number) % 3)
        if (seed + number) % 2:
            part.external_torque = rng.normal(0.0, 0.05, (length, len(description["joints"])))
        if (seed + number) % 4 > 1:
            part.use = leave_out(seed + number, length)
        parts.append(part)
    return description, parts


@pytest.mark.parametrize("seed", repeated(range(12), 1, 2))
def test_cost_gradient_and_information_are_those_of_the_dense_twin(seed: int) -> None:
    description, parts = random_parts(seed, 100, 1 + seed % 3)
    group = groups(description, shared_key(seed) if seed % 2 else lambda path: path)
    estimator, likelihoods = both(description, group, parts)
    for z in (np.array([u.start for u in estimator.unknowns]), off_start(estimator.unknowns, seed)):
        for likelihood, part in zip(likelihoods, parts, strict=True):
            moved = with_values(description, likelihood.unknowns.moved(z))
            assert not Trace(moved, part.recording, part.source).near.any(), "a decision that rounding may turn"
        assert_equal_evaluation(estimator, likelihoods, z)


def made_part(description: Description, seed: int, duration: float, rate: float = 20.0, **how: Any) -> Part:
    recording = recorded(description, seed, duration, rate, **how)
    return Part(recording, 3, recording.get("external_torque"))


@pytest.mark.parametrize("name", repeated(BIASES, 2, 4, 10))
@pytest.mark.parametrize("left_out", repeated([False, True], 1), ids=["all used", "some left out"])
def test_every_bias_option(name: str, left_out: bool) -> None:
    description = small_finger()
    description["bias"] |= BIASES[name]
    parts = [made_part(description, 1, 12.0), made_part(description, 2, 8.0, rate=31.0)]
    if left_out:
        for seed, part in enumerate(parts, start=2):
            part.use = leave_out(seed, len(part.recording["time"]))
            part.silent = silent_joints(seed, part.use, len(description["joints"]))
    estimator, likelihoods = both(description, groups(description), parts)
    assert_equal_evaluation(estimator, likelihoods, off_start(estimator.unknowns, 1))


def silent_joints(seed: int, use: Array, joints: int) -> Array:
    """[N, n] each joint by itself says nothing for a while, after the sample that the bias begins with."""
    silent = np.stack([~leave_out(100 * seed + j, len(use)) for j in range(joints)], axis=1)
    silent[: np.argmax(use) + 1] = False
    return silent


def test_gap_in_time() -> None:
    """A pause of 40 s wanders as far as 40 s of samples; what moved, stuck and was forgotten goes on."""
    description = small_finger()
    part = made_part(description, 5, 15.0)
    part.recording["time"] = part.recording["time"] + 40.0 * (np.arange(300) >= 170)
    estimator, likelihoods = both(description, groups(description), [part])
    assert_equal_evaluation(estimator, likelihoods, off_start(estimator.unknowns, 2))


LENGTHS = (2, 3, 4, 7, 8, 9, 31, 32, 33, 63, 64, 65, 127, 128, 129, 255, 256, 257, 400)


@pytest.mark.parametrize("samples", repeated(LENGTHS, 0, 1, 3, 4, 5, 9, 10, 11))
def test_any_length(samples: int) -> None:
    description = small_finger()
    whole = recorded(description, 7, 20.0)
    recording = {name: series[:samples] for name, series in whole.items()}
    part = Part(recording, 3, recording["external_torque"])
    estimator, likelihoods = both(description, groups(description), [part])
    assert_equal_evaluation(estimator, likelihoods, off_start(estimator.unknowns, 3))


def filtered(rows: tuple[Array, ...], y: Array, time: Array, noise: float, drift: float, use: Array) -> tuple[Any, ...]:
    """Cost, gradient and information by a plain loop over samples, one scalar filter for residual and derivatives."""
    torque, jump, d_torque, d_jump = rows
    left = np.concatenate([(y - torque)[..., None], -d_torque], axis=2)
    steps = np.concatenate([jump[..., None], d_jump], axis=2)
    b, P = left[0], noise
    whitened = []
    for k in range(1, len(time)):
        P += drift * (time[k] - time[k - 1])
        b = b + steps[k]
        if use[k]:
            e, S = left[k] - b, P + noise
            # the derivative of e by z is that of y − T − b: the jump turns b the other way
            whitened.append(e / np.sqrt(S))
            b, P = b + P / S * e, P * noise / S
    stacked = np.concatenate(whitened)
    r, J = stacked[:, 0], stacked[:, 1:]
    return 0.5 * float(r @ r), J.T @ r, J.T @ J


@pytest.mark.parametrize("threads", repeated([1, 3], 1))
def test_a_long_recording_on_any_number_of_threads(threads: int) -> None:
    """30,001 samples, longer than any block, against a filter that takes them one by one."""
    description = small_finger()
    description["bias"] |= {"initial_variance": 9e-6, "forget_rate": 0.1}
    group = groups(description, few_unknowns)
    part = made_part(description, 9, 150.005, rate=200.0)
    samples = len(part.recording["time"])
    part.use = np.ones(samples, dtype=bool)
    part.use[5000:5400] = False
    part.use[-700:-3] = False
    estimator = Estimator(image_of(description), group)
    estimator.add_recording(part.recording, 3, part.external_torque, part.use)
    z = off_start(estimator.unknowns, 6)
    R = np.array([tendon["moment_arms"] for tendon in description["tendons"]])
    y = part.recording["tendon_force"] @ R - part.external_torque
    rows = estimator.jacobian(0, z, 0, samples)
    expected = filtered(rows, y, part.recording["time"], 9e-6, 1e-5, part.use)
    size = np.sqrt(np.diag(expected[2]))
    cost, gradient, information = estimator.evaluate(z, threads=threads)
    assert cost == pytest.approx(expected[0], rel=1e-9)
    np.testing.assert_allclose(gradient / size, expected[1] / size, rtol=0.0, atol=1e-9 * np.sqrt(2.0 * cost))
    np.testing.assert_allclose(information / np.outer(size, size), expected[2] / np.outer(size, size), atol=1e-9)
    again = estimator.evaluate(z, threads=threads)
    for first, second in zip((cost, gradient, information), again, strict=True):
        np.testing.assert_array_equal(first, second)  # the same call gives the same bits


# --- innovations


@pytest.mark.parametrize("seed", repeated(range(9), 0, 1, 2))
def test_innovations_are_the_contracts_residuals(seed: int) -> None:
    """r and b_eff of docs/reference/semantics/bias.md#bias-tracker, with contact detection out of reach."""
    description, recording, source = random_fit_case(seed, 200)
    group = groups(description)
    estimator = Estimator(image_of(description), group)
    estimator.add_recording(recording, source)
    twin = twin_of(description, group, estimator.unknowns)
    z = off_start(estimator.unknowns, seed)
    moved = with_values(description, twin.moved(z))
    trace = Trace(moved, recording, source)
    e, S, bias = estimator.innovations(0, z)
    # without initial_torque, the first sample starts the bias
    first = moved["bias"].get("initial_torque")
    left = np.full(trace.n, np.nan) if first is None else trace.tau[0] - trace.torque[0] - first
    np.testing.assert_allclose(e[0], left, rtol=1e-9, atol=1e-12)
    assert np.isnan(S[0]).all()
    np.testing.assert_allclose(e[1:], trace.residual[1:], rtol=0.0, atol=1e-9 * np.abs(trace.residual[1:]).max())
    expected = oracle.run(without_contact(moved), recording, source).outputs["bias_torque"]
    np.testing.assert_allclose(bias, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
    assert (S[1:] > 0.0).all()


@pytest.mark.parametrize("seed", repeated(range(8), 0, 1, 2))
def test_innovations_with_samples_left_out(seed: int) -> None:
    """Of left-out samples too: what the used ones before them foretell; S of the used ones alone."""
    description, parts = random_parts(seed, 100, 2)
    for part in parts:
        part.use = leave_out(seed, len(part.recording["time"]))
        part.silent = silent_joints(seed, part.use, len(description["joints"]))
    estimator, likelihoods = both(description, groups(description), parts)
    z = off_start(estimator.unknowns, seed)
    for number, likelihood in enumerate(likelihoods):
        e, S, _ = estimator.innovations(number, z)
        expected_e, expected_S = likelihood.innovations(z)
        known = ~np.isnan(expected_e)
        assert (np.isnan(e) == ~known)[1:].all()  # of the first, see above
        scale = np.abs(expected_e[known]).max()
        np.testing.assert_allclose(e[known], expected_e[known], rtol=0.0, atol=1e-9 * scale)
        for j in range(S.shape[1]):
            rows = likelihood.rows(j)
            np.testing.assert_allclose(S[rows, j], expected_S[rows, j], rtol=1e-9)
            assert np.isnan(np.delete(S[:, j], rows)).all()
